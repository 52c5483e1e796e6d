//! Entry point of the `lumbre` program. All other code is in the library.

fn main() -> std::process::ExitCode {
    if let Some(commit) = lumbre_commit::commit!() {
        lumbre_night::text::set_commit(commit);
    }
    lumbre::cli::main()
}
