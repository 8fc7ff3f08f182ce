//! Description of this program, for `meta.json`.

use minimal_surprise_evolution::run_files::Program;
use minimal_surprise_evolution::text::shell_word;

/// Returns the program's name, version, revision, compiler, and command line.
#[must_use]
pub fn this_program() -> Program {
    let arguments = std::env::args_os();
    let words = arguments.map(|argument| argument.into_string().unwrap_or_else(shell_word));
    Program {
        name: env!("CARGO_PKG_NAME").to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        revision: env!("BUILD_REVISION").to_owned(),
        compiler: env!("BUILD_COMPILER").to_owned(),
        command_line: words.collect(),
    }
}
