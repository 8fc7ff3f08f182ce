//! The `evolver` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    minimal_surprise_evolver::cli::main()
}
