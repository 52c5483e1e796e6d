//! The program `lumbre` with the technique of this crate: every verb, option and file is the same.

fn main() -> std::process::ExitCode {
    lumbre::main_with(&[own_technique::TECHNIQUE])
}
