//! The commit that a program is built from, as a macro that the compiler evaluates with the crate
//! of the program. A build script would rebuild all targets of its package after each commit; the
//! macro is evaluated whenever the crate that calls it is compiled, which is after each change of
//! its dependencies or of the checked-out commit, and at no other time.

use std::path::Path;
use std::process::Command;

use proc_macro::TokenStream;

/// Expands to an `Option<&'static str>`: the commit of the calling package's repository in twelve
/// hexadecimal digits, followed by `with changes` if tracked files differ from it when the program
/// is built. `None` if the package is not the root of a repository, as in an unpacked archive, or
/// if there is no git.
#[proc_macro]
pub fn commit(_: TokenStream) -> TokenStream {
    let package = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_default();
    let found = checked_out(Path::new(&package));
    let text = match found {
        // The compiler watches the log, to which git adds a line for each commit and checkout.
        Some((commit, Some(log))) => {
            format!("{{ const _: &[u8] = include_bytes!({log:?}); Some({commit:?}) }}")
        }
        Some((commit, None)) => format!("Some({commit:?})"),
        None => "None".to_owned(),
    };
    text.parse().unwrap_or_default()
}

/// Returns the commit that is checked out in a folder, and the log of its changes if there is one.
fn checked_out(folder: &Path) -> Option<(String, Option<String>)> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git")
            .current_dir(folder)
            .args(arguments)
            .output()
            .ok()?;
        let text = output.status.success().then_some(output.stdout)?;
        Some(String::from_utf8(text).ok()?.trim_end().to_owned())
    };
    let top = git(&["rev-parse", "--show-toplevel"])?;
    if Path::new(&top).canonicalize().ok()? != folder.canonicalize().ok()? {
        return None;
    }
    let mut commit = git(&["rev-parse", "--short=12", "HEAD"])?;
    if !git(&["status", "--porcelain", "--untracked-files=no"])?.is_empty() {
        commit.push_str(" with changes");
    }
    let log = folder.join(git(&["rev-parse", "--git-path", "logs/HEAD"])?);
    let log = log.is_file().then(|| log.to_str().map(str::to_owned));
    Some((commit, log.flatten()))
}
