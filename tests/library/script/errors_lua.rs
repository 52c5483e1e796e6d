//! Errors raised by Lua, errors in modules, and files that are not scripts.

use lumbre_lua::Problem;

use super::errors::error_of;
use crate::script::{Folder, GOOD};

#[test]
fn errors_raised_by_lua_have_lines() {
    let e = error_of("local x = = 1\n");
    assert!(matches!(e.problem(), Problem::Syntax { .. }), "{e}");
    assert_eq!(e.line(), Some(1));
    let e = error_of("local x = 1\nlocal y = {\n\n");
    assert!(
        matches!(e.problem(), Problem::Syntax { .. }) && e.line() == Some(4),
        "{e}"
    );
    for (text, line, expected) in [
        (
            "local t\nlocal y = t.z\n",
            2,
            "attempt to index a nil value",
        ),
        (
            "\n\nerror(\"message of the script\")",
            3,
            "message of the script",
        ),
        ("\nerror({ code = 1 })", 2, ""),
        ("\nerror()", 2, ""),
        (
            "\nlocal s = (\"x\"):rpe(3)",
            2,
            "string.rpe: unknown name `rpe` (did you mean `rep`?)",
        ),
        (
            "\ntable.concat({ {} })",
            2,
            "invalid value (table) at index 1",
        ),
        (
            "\nlocal y = 1 + ('x'):find()",
            2,
            "bad argument #2 to 'string.find' (string expected",
        ),
        (
            "local function f() return f() + 1 end\nf()",
            1,
            "stack overflow",
        ),
    ] {
        let e = error_of(text);
        assert!(
            matches!(e.problem(), Problem::Runtime { .. } | Problem::Field { .. }),
            "{text}: {e}"
        );
        assert!(e.to_string().contains(expected), "{text}: {e}");
        assert_eq!(e.line(), Some(line), "{text}: {e}");
    }
}

#[test]
fn errors_in_modules_have_the_file_and_line_of_the_module() {
    let folder = Folder::new("local lib = require(\"lib.scenes\")\nreturn lib\n");
    folder.put("lib/scenes.lua", "local a = 1\nlocal b = metrics.rmse\n");
    let e = folder.load().unwrap_err();
    assert_eq!(
        (e.line(), e.file()),
        (Some(2), folder.path("lib/scenes.lua").as_path()),
        "{e}"
    );
    folder.put("lib/scenes.lua", "local a = 1\nlocal b = = 2\n");
    let e = folder.load().unwrap_err();
    assert!(matches!(e.problem(), Problem::Syntax { .. }), "{e}");
    assert_eq!(
        (e.line(), e.file()),
        (Some(2), folder.path("lib/scenes.lua").as_path()),
        "{e}"
    );
}

#[test]
fn files_that_are_not_scripts_are_refused() {
    let folder = Folder::new("x");
    let at = |name: &str| lumbre_lua::load(&folder.path(name)).unwrap_err();
    assert!(matches!(
        at("none.lua").problem(),
        Problem::Unreadable { .. }
    ));
    assert!(
        matches!(at("").problem(), Problem::Unreadable { .. }),
        "a folder"
    );
    folder.put("big.lua", vec![b'-'; (4 << 20) + 1]);
    assert!(
        matches!(at("big.lua").problem(), Problem::TooLarge { bytes, .. } if *bytes == (4 << 20) + 1)
    );
    #[cfg(target_os = "linux")]
    {
        std::os::unix::fs::symlink("/proc/version", folder.path("system.lua")).unwrap();
        assert!(
            !matches!(at("system.lua").problem(), Problem::Syntax { .. }),
            "the system reports length 0, so nothing is read"
        );
    }
    folder.put("code.lua", b"\x1bLua\x54");
    assert!(at("code.lua").to_string().contains("bytecode"));
    folder.put("latin.lua", b"-- one\n-- caf\xe9\n");
    assert!(
        at("latin.lua")
            .to_string()
            .contains("byte 14 in line 2 is not UTF-8"),
        "{}",
        at("latin.lua")
    );
    folder.put("bom.lua", format!("\u{feff}{GOOD}"));
    assert!(lumbre_lua::load(&folder.path("bom.lua")).is_ok());
}
