//! The name of a serial port.

use minimal_surprise_evolution::text::terminal_path;
use std::fmt;
use std::path::PathBuf;

/// Port name, as given by the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortName(pub PathBuf);

impl fmt::Display for PortName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&terminal_path(&self.0))
    }
}
