//! The sandbox: features that a script cannot use, and its limits of time and memory.

use lumbre_lua::{Limits, Problem, ScriptError};

use crate::script::{Folder, GOOD, LIMITS};

/// Runs Lua code before the good script, and returns the error of the script.
fn run(code: &str) -> Result<(), ScriptError> {
    Folder::new(format!("{code}\n{GOOD}")).load().map(|_| ())
}

fn fails(code: &str) -> ScriptError {
    fails_within(code, LIMITS)
}

fn fails_within(code: &str, limits: Limits) -> ScriptError {
    match Folder::new(format!("{code}\n{GOOD}")).load_within(limits) {
        Ok(_) => panic!("this code caused no error: {code}"),
        Err(e) => e,
    }
}

#[test]
fn libraries_with_access_to_the_system_do_not_exist() {
    for name in [
        "os",
        "io",
        "debug",
        "package",
        "load",
        "loadfile",
        "dofile",
        "coroutine",
        "collectgarbage",
    ] {
        let e = fails(&format!("\nlocal y = {name}"));
        assert_eq!(e.line(), Some(2), "{e}");
        assert!(e.help_text().unwrap().contains("sandbox"), "{e}");
    }
    for name in ["loadstring", "warn", "module", "setfenv", "newproxy"] {
        assert!(matches!(
            fails(&format!("local y = {name}")).problem(),
            Problem::Field { .. }
        ));
    }
    for name in ["string.dump", "math.random", "math.randomseed"] {
        let e = fails(&format!("\n\nlocal y = {name}"));
        assert_eq!(e.line(), Some(3), "{e}");
    }
    assert!(
        fails("math.random()")
            .help_text()
            .unwrap()
            .contains("use the experiment's seed")
    );
    run("for _, n in ipairs { 'os', 'io', 'debug', 'package', 'load' } do assert(rawget(_G, n) == nil) end").unwrap();
}

#[test]
fn protected_metatables_cannot_be_replaced() {
    for code in [
        "setmetatable(_G, nil)",
        "setmetatable(_G, {})",
        "setmetatable(metric, {})",
        "setmetatable(getmetatable(''), {})",
        "getmetatable('').__index = 1",
        "setmetatable({}, { __gc = function() end })",
    ] {
        let e = fails(code);
        assert_eq!(e.line(), Some(1), "{code}: {e}");
    }
    run("answer = 42; assert(answer == 42); _G.other = 1; assert(other == 1)").unwrap();
}

#[test]
fn endless_loops_end_at_the_time_limit() {
    for code in [
        "while true do end",
        "repeat until false",
        "::again:: goto again",
        "while true do pcall(function() while true do end end) end",
        "pcall(function() while true do end end)",
        "while true do xpcall(function() while true do end end, function() while true do end end) end",
        "local t = setmetatable({}, { __index = function(t, k) while true do end end }); local y = t.x",
        "local t <close> = setmetatable({}, { __close = function() while true do end end }); while true do end",
        "local t = setmetatable({}, { __close = function() error('mine') end }); do local u <close> = t; while true do end end",
        "table.sort({ 1, 2, 3 }, function() while true do end end)",
        "string.gsub('abc', '.', function() while true do end end)",
    ] {
        let e = fails_within(
            &format!("\n{code}"),
            Limits {
                load_s: 0.3,
                ..LIMITS
            },
        );
        assert!(matches!(e.problem(), Problem::Time { .. }), "{code}: {e}");
        assert!(
            e.to_string()
                .contains("loading the script ran longer than its limit of 0.3 s"),
            "{e}"
        );
        assert_eq!(e.line(), Some(2), "{code}: {e}");
    }
}

#[test]
fn calls_of_library_functions_that_would_loop_too_long_are_refused() {
    for (code, expected) in [
        (
            "table.move({}, 1, math.maxinteger - 1, 2)",
            "more than 10000000 elements",
        ),
        (
            "table.move({}, '1', '9e15', 2)",
            "more than 10000000 elements",
        ),
        (
            "table.concat({}, '', 1, 1 << 60)",
            "more than 10000000 elements",
        ),
        (
            "table.unpack({}, 1, 1 << 40)",
            "more than 10000000 elements",
        ),
        (
            "table.insert(setmetatable({}, { __len = function() return 1 << 60 end }), 1, 1)",
            "__len",
        ),
        (
            "table.remove(setmetatable({}, { __len = function() return 1 << 60 end, __metatable = false }), 1)",
            "__len",
        ),
        (
            "table.sort(setmetatable({}, { __len = function() return 1 << 30 end }), rawequal)",
            "__len",
        ),
        (
            "local s = string.rep('', 1 << 60)",
            "string.rep would make more",
        ),
        (
            "local s = string.rep('', '1e18')",
            "string.rep would make more",
        ),
        ("local s = ('x'):rep(1e10)", "string.rep would make more"),
        (
            "local m = ('a'):rep(3000):find(('a-'):rep(30) .. 'b')",
            "could take very long",
        ),
        (
            "local m = ('a'):rep(3000):gsub(('.*'):rep(8) .. 'b', '')",
            "could take very long",
        ),
        (
            "for w in ('a'):rep(3000):gmatch(('.*'):rep(8) .. 'b') do end",
            "could take very long",
        ),
    ] {
        let e = fails(&format!("\n{code}"));
        assert!(e.to_string().contains(expected), "{code}: {e}");
        assert_eq!(e.line(), Some(2), "{code}: {e}");
    }
}

#[test]
fn excessive_allocations_end_at_the_memory_limit() {
    for code in [
        "local t = {}; for i = 1, 1e9 do t[i] = i end",
        "local s = 'x'; while true do s = s .. s end",
        "local s = ('x'):rep(1 << 27)",
        "local t = {}; while true do t = { t } end",
    ] {
        let e = fails_within(
            &format!("\n{code}"),
            Limits {
                memory: 48 << 20,
                ..LIMITS
            },
        );
        assert!(
            matches!(e.problem(), Problem::Memory { mib: 48 }),
            "{code}: {e}"
        );
        // One huge allocation can precede the first check of the line, so an error without a line
        // is accepted.
        assert!(e.line().is_none_or(|l| l <= 2), "{code}: {e}");
    }
    let code = "\nlocal t = {}\nfor i = 1, 1e9 do\n  t[i] = i\nend";
    let e = fails_within(
        code,
        Limits {
            memory: 48 << 20,
            ..LIMITS
        },
    );
    assert!((3..=5).contains(&e.line().unwrap()), "{e}");
    assert!(
        matches!(fails("local s = ('error '):rep(200000); error(s)").problem(), Problem::Runtime { message } if message.len() < 3000)
    );
}

#[test]
fn deep_recursion_is_an_error_and_no_crash() {
    for code in [
        "local function f(n) return 1 + f(n + 1) end; f(1)",
        "local function f() return pcall(f) end; for i = 1, 3 do f() end; error('done')",
        "local function f() return (string.gsub('a', 'a', f)) end; f()",
        "local t = setmetatable({}, {}); getmetatable(t).__index = t; local y = t.x",
        "local t = setmetatable({}, { __tostring = function(s) return tostring(s) end }); tostring(t)",
    ] {
        let e = fails(code);
        assert!(
            matches!(e.problem(), Problem::Runtime { .. }),
            "{code}: {e}"
        );
    }
    let nested = format!("local t = {}1{}", "{".repeat(500), "}".repeat(500));
    let e = fails(&nested);
    assert!(e.to_string().contains("t.lua: C stack overflow"), "{e}");
}

#[test]
fn require_loads_only_files_below_the_folder() {
    for name in [
        "../x",
        "..",
        "/etc/passwd",
        "a//b",
        "a..b",
        "",
        "a b",
        "a\\\\b",
        "C:x",
        "./a",
        "a/",
    ] {
        let e = fails(&format!("\nrequire(\"{name}\")"));
        assert!(
            e.to_string().contains("is not a valid module name"),
            "{name}: {e}"
        );
        assert_eq!(e.line(), Some(2));
    }
    let e = fails("require(\"nowhere\")");
    assert!(e.to_string().contains("there is no file"), "{e}");
    let folder = Folder::new(format!("require('code')\n{GOOD}"));
    folder.put("code.lua", b"\x1bLua\x54");
    assert!(folder.load().unwrap_err().to_string().contains("bytecode"));
}

#[cfg(unix)]
#[test]
fn modules_behind_links_out_of_the_folder_are_refused() {
    let outside = Folder::new("return 1");
    let folder = Folder::new(format!("require('link')\n{GOOD}"));
    std::os::unix::fs::symlink(outside.path("t.lua"), folder.path("link.lua")).unwrap();
    let e = folder.load().unwrap_err();
    assert!(
        e.to_string().contains("is outside the script's folder"),
        "{e}"
    );
}

#[test]
fn modules_are_loaded_once_and_circular_requires_are_refused() {
    let folder = Folder::new(format!(
        "local a, b = require('lib.a'), require('lib/a')\nassert(a == b and a.n == 1 and count == 1)\n\
         assert(require('none') == true)\n{GOOD}"
    ));
    folder.put(
        "lib/a.lua",
        "count = (rawget(_G, 'count') or 0) + 1\nreturn { n = 1 }",
    );
    folder.put("none.lua", "");
    folder.load().unwrap();
    let folder = Folder::new("require('a')");
    folder.put("a.lua", "require('b')");
    folder.put("b.lua", "\nrequire('a')");
    let e = folder.load().unwrap_err();
    assert!(e.to_string().contains("in a circle: a -> b -> a"), "{e}");
    assert_eq!(
        (e.line(), e.file()),
        (Some(2), folder.path("b.lua").as_path())
    );
}

#[test]
fn common_library_functions_work() {
    run("local parts = {}\nfor word in ('a,b,c'):gmatch('[^,]+') do table.insert(parts, word) end\n\
         assert(table.concat(parts, '-') == 'a-b-c')\nassert(select('#', table.unpack(parts)) == 3)\n\
         table.sort(parts, function(a, b) return a > b end)\nassert(parts[1] == 'c' and table.remove(parts) == 'a')\n\
         assert(('%.2f'):format(math.pi) == '3.14')\nassert(('x'):rep(3, ',') == 'x,x,x')\n\
         local ok, why = pcall(error, 'no')\nassert(not ok and why == 'no')\n\
         local ok, why = pcall(error, { code = 7 })\nassert(why.code == 7)\n\
         assert(xpcall(function(a) return a end, print, 1))\n\
         local ok, why = xpcall(error, function(m) return m .. '!' end, 'no')\nassert(not ok and why == 'no!')\n\
         local t = table.move({ 1, 2, 3 }, 1, 3, 2)\nassert(#t == 4 and t[2] == 1)\n\
         assert(('scene_12'):match('_(%d+)$') == '12' and ('a.b'):find('.', 1, true) == 2)\n\
         print('hello', 1, nil, {})\nassert(next({}) == nil and utf8.len('ñ') == 1)")
    .unwrap();
}

#[test]
fn pairs_iterates_in_a_fixed_order() {
    run("local seen = {}\nlocal t = { zeta = 1, alpha = 2, [3] = 3, [1] = 1, [2.5] = 4, [true] = 5 }\n\
         for k in pairs(t) do seen[#seen + 1] = tostring(k) end\n\
         assert(table.concat(seen, ' ') == 'true 1 2.5 3 alpha zeta', table.concat(seen, ' '))\n\
         for k in pairs(t) do t[k] = nil end\nassert(next(t) == nil)\n\
         local p = setmetatable({}, { __pairs = function(s) return next, { a = 1 }, nil end })\n\
         for k, v in pairs(p) do assert(k == 'a' and v == 1) end")
    .unwrap();
}
