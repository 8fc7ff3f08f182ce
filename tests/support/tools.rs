//! Tools that a test needs but that may not be installed.

use std::fmt;

/// Error: a tool is missing; describes what to install.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing(pub String);

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Returns the tool, or prints that the test is skipped and returns `None`.
///
/// # Panics
/// If the tool is missing and the environment has `CI=true`, since a skipped test would go
/// unnoticed in CI.
#[must_use]
pub fn require<T>(tool: Result<T, Missing>) -> Option<T> {
    match tool {
        Ok(tool) => Some(tool),
        Err(missing) if std::env::var("CI").as_deref() == Ok("true") => panic!("{missing}"),
        Err(missing) => {
            println!("SKIPPED: {missing}");
            None
        }
    }
}
