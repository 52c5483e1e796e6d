//! Scripts that want too much time or memory, or what they must not have.

use super::night::Site;
use super::{EXTENT, Random, Verdict, mutation};
use crate::root;

/// Ends of scripts. None may be planned; `SIZE` is replaced by a large number.
const HOSTILE: &[&str] = &[
    "while true do end",
    "local t = {} while true do t[#t + 1] = {} end",
    "local s = ('x'):rep(SIZE)",
    "local s = 'x' for i = 1, 64 do s = s .. s end",
    "local function f() return f() + 1 end f()",
    "local function f(n) if n > 0 then return pcall(f, n - 1) end end f(SIZE)",
    "local t = {} for i = 1, SIZE do t[i] = i end x:axis('a', t)",
    "x:axis('a', range(1, SIZE, 1))",
    "for i = 1, SIZE do x:axis('a' .. i, { 1, 2 }) end",
    "x:axis('a', { string.format('%p', {}) })",
    "x:axis('a', { tostring(print) })",
    "x:axis('a', { 0/0 })",
    "x:axis('a', { '\\27[2J' })  error('\\27]0;title\\7')",
    "os.execute('touch got_out')",
    "io.open('got_out', 'w'):write('x'):close()",
    "require('os').execute('touch got_out')",
    "load('\\27Lua')()",
    "string.dump(function() end)",
    "debug.sethook(function() end)",
    "setmetatable(_G, { __index = function(t, k) return t[k] end }) local y = nothing",
    "string.find(('a'):rep(SIZE), ('a*'):rep(30) .. 'b')",
    "table.concat({}, 'x', 1, SIZE)",
    "coroutine.wrap(function() while true do end end)()",
    "dofile('/dev/zero')",
    "require('../../../../etc/passwd')",
    "x:render(function() return { scene = '/dev/zero' } end) return x",
    "x:render(function() return { scene = 'ball.scn', resolution = { SIZE, SIZE } } end) return x",
    "x:render(function() while true do end end) return x",
    "x:render(function() return setmetatable({}, { __pairs = function() while true do end end }) end) return x",
    "for i = 1, SIZE do print(i) end error('end')",
];

/// Values of `SIZE`.
const SIZES: [&str; 4] = ["1e5", "1e7", "2^31", "2^53"];

/// Shipped scripts whose changed forms are planned, which require no other file.
const SHIPPED: [&str; 4] = [
    "first_light.lua",
    "techniques.lua",
    "theses/s1_figure_3_5.lua",
    "theses/s1_table_4_2.lua",
];

/// Plans a hostile script, which must be refused and must not get out of the sandbox.
pub fn hostile(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    let room = site.empty_room()?;
    let body = random
        .pick(HOSTILE)
        .replace("SIZE", random.pick::<&str>(&SIZES));
    let script = format!("local x = experiment('hostile', {{ seed = 1 }})\n{body}\nreturn x\n");
    room.write("hostile.lua", script.as_bytes())?;
    let ended = room.run(&["plan", "hostile.lua"])?;
    if let Some(crash) = ended.crash() {
        return Ok(Verdict::Failed(format!("`{body}`: {crash}")));
    }
    if room.file("got_out").exists() {
        return Ok(Verdict::Failed(format!("`{body}` wrote a file")));
    }
    if ended.text.contains('\u{1b}') {
        return Ok(Verdict::Failed(format!(
            "`{body}` printed a control character"
        )));
    }
    Ok(match ended.code {
        Some(2) => Verdict::Noticed,
        // Some are harmless with a small size.
        Some(0) => Verdict::Harmless,
        _ => Verdict::Failed(format!("`{body}`: {}", ended.excerpt())),
    })
}

/// Plans a shipped script after changes of its text.
pub fn changed(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    let room = site.empty_room()?;
    let name = *random.pick(&SHIPPED);
    let path = root().join("scripts").join(name);
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{name}: {e}"))?;
    let text = mutation::of_text(&text, &EXTENT, random).replace("\"scenes/", "\"SCENES/");
    let scenes = format!("\"{}/", root().join("scenes").display());
    let text = text.replace("\"SCENES/", &scenes);
    room.write("changed.lua", text.as_bytes())?;
    let ended = room.run(&["plan", "changed.lua"])?;
    Ok(match (ended.crash(), ended.code) {
        (Some(crash), _) => Verdict::Failed(format!("{name}: {crash}")),
        (None, Some(0)) => Verdict::Harmless,
        (None, Some(2)) => Verdict::Noticed,
        (None, _) => Verdict::Failed(format!("{name}: {}", ended.excerpt())),
    })
}
