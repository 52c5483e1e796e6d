//! Static counts of SPIR-V modules: how many instructions, loads and stores a shader has, and how
//! many bytes of private memory its variables take. A driver removes what a job does not use, so
//! the counts compare versions of a shader and are not those of one pipeline.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use lumbre_vulkan::pipelines::shrink::instructions;

/// Storage class of variables outside of functions that each invocation has to itself.
const PRIVATE: u32 = 6;

/// Storage classes of memory that invocations share: uniform, storage buffers, and buffers by their
/// address.
const BUFFERS: [u32; 3] = [2, 12, 5349];

/// Counts of a module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Number of instructions in functions.
    pub instructions: usize,
    /// Number of loads from buffers.
    pub buffer_loads: usize,
    /// Number of 32-bit words that these load.
    pub buffer_words: u64,
    /// Number of stores to buffers, with atomic operations.
    pub buffer_stores: usize,
    /// Number of operations in double precision: instructions with a result of this type.
    pub doubles: usize,
    /// Bytes of private variables, with the default values of specialisation constants.
    pub private_bytes: u64,
}

/// Sizes, pointers, constants and types by the ids of a module.
#[derive(Default)]
struct Ids {
    /// Bytes of types; 0 for those without a size, such as arrays that end a buffer.
    sizes: BTreeMap<u32, u64>,
    /// Storage class and pointee of pointer types.
    pointers: BTreeMap<u32, (u32, u32)>,
    /// Values of integer constants.
    values: BTreeMap<u32, u64>,
    /// Type of each result.
    types: BTreeMap<u32, u32>,
    /// Types of double precision, scalars and vectors.
    doubles: Vec<u32>,
}

impl Ids {
    fn size(&self, id: u32) -> u64 {
        self.sizes.get(&id).copied().unwrap_or(0)
    }

    fn value(&self, id: u32) -> u64 {
        self.values.get(&id).copied().unwrap_or(0)
    }

    /// Records the type that an instruction declares.
    fn add_type(&mut self, op: u32, operands: &[u32]) {
        let (id, size) = match (op, operands) {
            // OpTypeBool, which has no size in memory and takes a word in practice.
            (20, [id]) => (*id, 4),
            // OpTypeInt, OpTypeFloat.
            (21 | 22, [id, bits, ..]) => {
                if (op, *bits) == (22, 64) {
                    self.doubles.push(*id);
                }
                (*id, u64::from(bits / 8))
            }
            // OpTypeVector, OpTypeMatrix.
            (23 | 24, [id, part, count]) => {
                if self.doubles.contains(part) {
                    self.doubles.push(*id);
                }
                (*id, self.size(*part) * u64::from(*count))
            }
            // OpTypeArray.
            (28, [id, part, length]) => (*id, self.size(*part) * self.value(*length)),
            // OpTypeStruct.
            (30, [id, parts @ ..]) => (*id, parts.iter().map(|part| self.size(*part)).sum()),
            // OpTypePointer.
            (32, [id, class, pointee]) => {
                self.pointers.insert(*id, (*class, *pointee));
                return;
            }
            _ => return,
        };
        self.sizes.insert(id, size);
    }

    /// Records the integer constant that an instruction declares.
    fn add_constant(&mut self, op: u32, operands: &[u32]) {
        let (id, value) = match (op, operands) {
            // OpConstant, OpSpecConstant.
            (43 | 50, [_, id, value, ..]) => (*id, u64::from(*value)),
            // OpSpecConstantOp of a product.
            (52, [_, id, 132, a, b]) => (*id, self.value(*a) * self.value(*b)),
            _ => return,
        };
        self.values.insert(id, value);
    }

    /// Returns whether a pointer points into a buffer.
    fn is_buffer(&self, pointer: u32) -> bool {
        let target = self
            .types
            .get(&pointer)
            .and_then(|of| self.pointers.get(of));
        target.is_some_and(|(class, _)| BUFFERS.contains(class))
    }
}

/// Returns whether the first two operands of an instruction are the type and the id of its result.
fn has_result_type(op: u32) -> bool {
    matches!(op,
        1 | 12 | 41..=46 | 48..=52 | 54 | 55 | 57 | 59..=61 | 65..=68 | 77..=84 | 109..=124
        | 126..=152 | 154..=191 | 194..=205 | 227 | 229..=242 | 245 | 400 | 6035)
}

/// Returns the counts of a module.
pub fn count(words: &[u32]) -> Counts {
    let (mut ids, mut counts) = (Ids::default(), Counts::default());
    let mut in_function = false;
    for instruction in instructions(words) {
        let (op, operands) = (instruction[0] & 0xffff, &instruction[1..]);
        ids.add_type(op, operands);
        ids.add_constant(op, operands);
        // OpFunction and OpFunctionEnd.
        in_function = (in_function || op == 54) && op != 56;
        counts.instructions += usize::from(in_function);
        if let ([of, id, ..], true) = (operands, has_result_type(op)) {
            ids.types.insert(*id, *of);
            counts.doubles += usize::from(in_function && ids.doubles.contains(of));
        }
        match (op, operands) {
            // OpVariable.
            (59, [of, _, PRIVATE, ..]) => {
                let pointee = ids.pointers.get(of).map_or(0, |(_, pointee)| *pointee);
                counts.private_bytes += ids.size(pointee);
            }
            // OpLoad.
            (61, [of, _, pointer, ..]) if ids.is_buffer(*pointer) => {
                counts.buffer_loads += 1;
                counts.buffer_words += ids.size(*of) / 4;
            }
            // OpStore.
            (62, [pointer, ..]) if ids.is_buffer(*pointer) => counts.buffer_stores += 1,
            // OpAtomicLoad to OpAtomicXor, OpAtomicFAddEXT.
            (227..=242 | 6035, _) => counts.buffer_stores += 1,
            _ => {}
        }
    }
    counts
}

/// Returns a table of the counts of all modules in a folder, by file name.
///
/// # Errors
/// Returns a message if the folder or a module cannot be read, or there is none.
pub fn table(folder: &Path) -> Result<String, String> {
    let unreadable = |e: std::io::Error| format!("{}: {e}", folder.display());
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        files.extend((path.extension() == Some("spv".as_ref())).then_some(path));
    }
    files.sort();
    if files.is_empty() {
        return Err(format!("{} has no modules (*.spv)", folder.display()));
    }
    let mut text = String::from(
        "| module | instructions | loads | words loaded | stores | in double precision | private bytes |\n\
         |---|--:|--:|--:|--:|--:|--:|\n",
    );
    for path in files {
        let bytes = std::fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let words: Vec<u32> = bytes
            .chunks_exact(4)
            .map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
            .collect();
        let c = count(&words);
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| `{name}` | {} | {} | {} | {} | {} | {} |",
            c.instructions,
            c.buffer_loads,
            c.buffer_words,
            c.buffer_stores,
            c.doubles,
            c.private_bytes
        );
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns an instruction.
    fn instruction(op: u32, operands: &[u32]) -> Vec<u32> {
        let mut words = vec![(operands.len() as u32 + 1) << 16 | op];
        words.extend(operands);
        words
    }

    #[test]
    fn loads_stores_doubles_and_private_bytes_are_counted() {
        let module: Vec<u32> = [
            vec![0x0723_0203, 0, 0, 100, 0],
            instruction(21, &[1, 32, 0]),
            instruction(22, &[2, 32]),
            instruction(22, &[3, 64]),
            instruction(23, &[4, 2, 3]),
            instruction(30, &[5, 4, 2, 1]),
            // Two times eight rows of 20 bytes.
            instruction(43, &[1, 6, 2]),
            instruction(50, &[1, 7, 8]),
            instruction(52, &[1, 8, 132, 6, 7]),
            instruction(28, &[9, 5, 8]),
            instruction(32, &[10, PRIVATE, 9]),
            instruction(59, &[10, 11, PRIVATE]),
            instruction(32, &[12, 12, 4]),
            instruction(59, &[12, 13, 12]),
            instruction(54, &[14, 15, 0, 16]),
            instruction(61, &[4, 17, 13]),
            instruction(62, &[13, 17]),
            // A sum of doubles.
            instruction(129, &[3, 18, 19, 19]),
            instruction(61, &[9, 20, 11]),
            instruction(56, &[]),
        ]
        .concat();
        let expected = Counts {
            instructions: 5,
            buffer_loads: 1,
            buffer_words: 3,
            buffer_stores: 1,
            doubles: 1,
            private_bytes: 320,
        };
        assert_eq!(count(&module), expected);
    }

    #[test]
    fn the_committed_modules_have_a_table() {
        let folder = crate::root().join("crates/lumbre-vulkan/spirv");
        let text = table(&folder).unwrap();
        let row = text
            .lines()
            .find(|line| line.contains("`bdpt.floats.comp.spv`"));
        let cells: Vec<&str> = row.unwrap().split('|').map(str::trim).collect();
        // A traversal stack of 64 words and the numbers of the film: vertices
        // of subpaths, 76 bytes each, are in buffers.
        let private: u64 = cells[7].parse().unwrap();
        assert!((256..384).contains(&private), "{private}");
        assert_eq!(cells[6], "0", "no double precision");
    }
}
