//! Runs a firmware program under QEMU, prints its log, and exits with its exit code.

use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    let Some(elf) = std::env::args_os().nth(1) else {
        eprintln!("usage: run-firmware ELF");
        return ExitCode::from(2);
    };
    match tests::firmware::run(&PathBuf::from(elf), |line| println!("{line}")) {
        Ok(Ok(status)) if status.success() => ExitCode::SUCCESS,
        Ok(Ok(status)) => {
            eprintln!("the program failed: {status}");
            ExitCode::FAILURE
        }
        Ok(Err(error)) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
        Err(missing) => {
            eprintln!("{missing}");
            ExitCode::FAILURE
        }
    }
}
