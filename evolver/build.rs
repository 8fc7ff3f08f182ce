//! Records the source revision and the compiler version of the program, for `meta.json`.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    for file in ["HEAD", "logs/HEAD"] {
        // Cargo treats a missing file as changed in every build.
        let path = first_line("git", &["rev-parse", "--git-path", file]);
        if let Some(path) = path.filter(|path| Path::new(path).exists()) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    let compiler = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let lines = [
        (
            "BUILD_REVISION",
            first_line("git", &["describe", "--always", "--dirty"]),
        ),
        ("BUILD_COMPILER", first_line(&compiler, &["--version"])),
    ];
    for (name, line) in lines {
        println!(
            "cargo:rustc-env={name}={}",
            line.as_deref().unwrap_or("unknown")
        );
    }
}

fn first_line(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let line = text.lines().next()?.trim().to_owned();
    (output.status.success() && !line.is_empty()).then_some(line)
}
