//! The `lumbre` program: the library's command line.

fn main() {}
