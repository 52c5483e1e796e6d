//! Removes from SPIR-V what drivers do not need: debug names, and declarations that nothing uses. The
//! compiler itself omits functions that nothing calls. Some versions of it, such as 12.0.0, state
//! `restrict` and `readonly` of a buffer for its members alone. Drivers look for `restrict` at the
//! variable, so both are added there.

use std::collections::{BTreeMap, BTreeSet};

/// Number of words before the first instruction.
const HEADER: usize = 5;

/// First word of a module.
const MAGIC: u32 = 0x0723_0203;

const OP_ENTRY_POINT: u32 = 15;
const OP_CAPABILITY: u32 = 17;
const OP_TYPE_STRUCT: u32 = 30;
const OP_TYPE_POINTER: u32 = 32;
const OP_FUNCTION: u32 = 54;
const OP_VARIABLE: u32 = 59;
const OP_DECORATE: u32 = 71;
const OP_MEMBER_DECORATE: u32 = 72;

/// Decoration of variables that are bound to a descriptor.
const BINDING: u32 = 33;

/// Decorations of buffers: `restrict` and `readonly`.
const QUALIFIERS: [u32; 2] = [19, 24];

/// Opcodes of debug instructions: sources, names, strings, lines, `OpModuleProcessed`.
const DEBUG: [u32; 9] = [2, 3, 4, 5, 6, 7, 8, 317, 330];

/// Instructions with the position of their result id, if they declare something outside of
/// functions.
fn result_index(op: u32) -> Option<usize> {
    match op {
        // OpExtInstImport, and types from OpTypeVoid to OpTypePipe.
        11 | 19..=38 => Some(1),
        // OpTypeRayQueryKHR and OpTypeAccelerationStructureKHR.
        4472 | 5341 => Some(1),
        // OpUndef, constants, specialisation constants, variables.
        1 | 41..=46 | 48..=52 | OP_VARIABLE => Some(2),
        _ => None,
    }
}

fn op(instruction: &[u32]) -> u32 {
    instruction[0] & 0xffff
}

/// Splits a module into its instructions. No instruction is empty.
pub fn instructions(words: &[u32]) -> Vec<&[u32]> {
    let (mut rest, mut found) = (words.get(HEADER..).unwrap_or_default(), Vec::new());
    while let Some(first) = rest.first() {
        let length = ((first >> 16) as usize).clamp(1, rest.len());
        let (instruction, next) = rest.split_at(length);
        found.push(instruction);
        rest = next;
    }
    found
}

/// Returns whether words are a module that ends where its last instruction does.
pub fn is_whole(words: &[u32]) -> bool {
    let lengths = instructions(words)
        .iter()
        .map(|i| (i[0] >> 16) as usize)
        .sum::<usize>();
    words.first() == Some(&MAGIC) && lengths + HEADER == words.len()
}

/// Returns a module without debug instructions and unused declarations, with the qualifiers of
/// buffers at their variables.
pub fn shrink(words: &[u32]) -> Vec<u32> {
    let mut kept = instructions(words);
    kept.retain(|instruction| !DEBUG.contains(&op(instruction)));
    let used = used_ids(&kept);
    let qualified = qualified(&kept);
    let mut shrunk = words[..HEADER.min(words.len())].to_vec();
    for instruction in kept {
        match op(instruction) {
            OP_ENTRY_POINT => shrunk.extend(entry_point(instruction, &used)),
            OP_DECORATE | OP_MEMBER_DECORATE if !used.contains(&instruction[1]) => {}
            OP_DECORATE if instruction[2] == BINDING => {
                shrunk.extend(instruction);
                for (variable, qualifier) in &qualified {
                    if *variable == instruction[1] {
                        shrunk.extend([3 << 16 | OP_DECORATE, *variable, *qualifier]);
                    }
                }
            }
            code if result_index(code).is_some_and(|i| !used.contains(&instruction[i])) => {}
            _ => shrunk.extend(instruction),
        }
    }
    shrunk
}

/// Returns the variables, each with a qualifier, of buffers whose members all have the qualifier
/// and that lack it themselves.
fn qualified(instructions: &[&[u32]]) -> BTreeSet<(u32, u32)> {
    let (mut blocks, mut pointees, mut variables) =
        (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    let (mut members, mut own) = (BTreeMap::<_, usize>::new(), BTreeSet::new());
    for instruction in instructions {
        match (op(instruction), &instruction[1..]) {
            (OP_TYPE_STRUCT, [id, types @ ..]) => {
                blocks.insert(*id, types.len());
            }
            (OP_TYPE_POINTER, [id, _, pointee]) => {
                pointees.insert(*id, *pointee);
            }
            (OP_VARIABLE, [pointer, id, ..]) => {
                variables.insert(*id, *pointer);
            }
            (OP_DECORATE, [id, decoration, ..]) => {
                own.insert((*id, *decoration));
            }
            (OP_MEMBER_DECORATE, [block, _, decoration, ..]) => {
                *members.entry((*block, *decoration)).or_default() += 1;
            }
            _ => {}
        }
    }
    let mut qualified = BTreeSet::new();
    for (variable, pointer) in variables {
        let block = pointees.get(&pointer).copied().unwrap_or_default();
        for qualifier in QUALIFIERS {
            let count = members.get(&(block, qualifier));
            if count.is_some()
                && count == blocks.get(&block)
                && !own.contains(&(variable, qualifier))
            {
                qualified.insert((variable, qualifier));
            }
        }
    }
    qualified
}

/// Returns the ids that functions and, in turn, used declarations refer to. Every word of an
/// instruction may be an id, so a number that equals an id keeps its declaration.
fn used_ids(instructions: &[&[u32]]) -> BTreeSet<u32> {
    let (mut used, mut open, mut declared) = (BTreeSet::new(), Vec::new(), BTreeMap::new());
    let mut inside = false;
    for instruction in instructions {
        let code = op(instruction);
        inside |= code == OP_FUNCTION;
        match result_index(code) {
            Some(i) if !inside => {
                declared.insert(instruction[i], *instruction);
            }
            _ if matches!(code, OP_ENTRY_POINT | OP_DECORATE | OP_MEMBER_DECORATE) => {}
            _ if code == OP_CAPABILITY => {}
            _ => open.extend(&instruction[1..]),
        }
    }
    while let Some(id) = open.pop() {
        if used.insert(id)
            && let Some(declaration) = declared.get(&id)
        {
            open.extend(&declaration[1..]);
        }
    }
    used
}

/// Returns an entry point without the variables that are not used.
fn entry_point(instruction: &[u32], used: &BTreeSet<u32>) -> Vec<u32> {
    let ends = |word: &u32| word.to_le_bytes().contains(&0);
    let name = instruction[3..].iter().position(ends).unwrap_or(0);
    let (head, variables) = instruction.split_at((4 + name).min(instruction.len()));
    let mut made = head.to_vec();
    made.extend(variables.iter().filter(|id| used.contains(id)));
    made[0] = (made.len() as u32) << 16 | OP_ENTRY_POINT;
    made
}
