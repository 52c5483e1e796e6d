//! Entry point of the `lumbre` program. All code is in the library.

fn main() -> std::process::ExitCode {
    lumbre::cli::main()
}
