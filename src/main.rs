//! The `lumbre` program; everything is in the library.

fn main() -> std::process::ExitCode {
    lumbre::cli::main()
}
