//! The program `surfel`; all of it is in the library beside this file.

use std::process::ExitCode;

fn main() -> ExitCode {
    surfel_cli::main()
}
