//! Scripts: loading a file into an `ExperimentSpec`, and calling its functions while planning.

#![allow(clippy::unwrap_used, reason = "test helpers may panic, as tests do")]

mod displays;
mod errors;
mod errors_lua;
mod errors_results;
mod hooks;
mod readme;
mod sandbox;
mod scenes;
mod shipped;
mod spec;

use std::path::PathBuf;

use lumbre_lua::{Limits, Script, ScriptError, load_with};

/// A correct script of nine lines; tests change one of them.
const GOOD: &str = "\
local x = experiment(\"t\", { seed = 1, repeats = 2 })
x:axis(\"depth\", { 2, 5 })
x:render(function(p)
  return { scene = \"s.scn\", integrator = \"bpt\", max_depth = p.depth }
end)
x:reference { stop = stop.samples(64) }
x:measure { rmse = metric.rmse(), every = \"1s\" }
x:stop(stop.samples(16))
return x
";

/// The default limits, but with less time for functions, so that their test is quick.
const LIMITS: Limits = Limits {
    load_s: 10.0,
    hook_s: 1.0,
    memory: 256 << 20,
};

/// A temporary folder with a script `t.lua` and an empty scene `s.scn`.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new(text: impl AsRef<[u8]>) -> Folder {
        let folder = Folder(tempfile::tempdir().unwrap());
        folder.put("t.lua", text);
        folder.put("s.scn", "{}");
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn put(&self, name: &str, text: impl AsRef<[u8]>) {
        let file = self.path(name);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, text).unwrap();
    }

    fn load(&self) -> Result<Script, ScriptError> {
        self.load_within(LIMITS)
    }

    fn load_within(&self, limits: Limits) -> Result<Script, ScriptError> {
        load_with(&self.path("t.lua"), limits)
    }
}

/// Returns the good script with `from` replaced by `to`. Panics unless `from` occurs exactly once.
fn edited(from: &str, to: &str) -> String {
    assert_eq!(
        GOOD.matches(from).count(),
        1,
        "`{from}` must occur exactly once in the good script"
    );
    GOOD.replace(from, to)
}
