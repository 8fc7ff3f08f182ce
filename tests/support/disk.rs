//! File systems of a test's own.

use crate::tools::Missing;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A file system, or a file, mounted somewhere; gone with this.
#[derive(Debug)]
pub struct Disk(PathBuf);

impl Disk {
    /// An empty file system as large as it is made.
    ///
    /// # Errors
    /// [`Missing`] if this process is not privileged.
    ///
    /// # Panics
    /// If there can be no folder of that name.
    pub fn mounted_at(path: PathBuf, size: &str) -> Result<Self, Missing> {
        fs::create_dir_all(&path).expect("a folder");
        let size = format!("size={size}");
        let options = ["-t", "tmpfs", "-o", &size, "tmpfs"].map(Path::new);
        Self::mounted(path, &options)
    }

    /// A file in the place of another one.
    ///
    /// # Errors
    /// [`Missing`] if this process is not privileged.
    pub fn bound(file: &Path, path: PathBuf) -> Result<Self, Missing> {
        Self::mounted(path, &[Path::new("--bind"), file])
    }

    fn mounted(path: PathBuf, options: &[&Path]) -> Result<Self, Missing> {
        let mounted = Command::new("mount").args(options).arg(&path).output();
        let mounted = mounted.is_ok_and(|output| output.status.success());
        let missing =
            || Missing("mounting: it needs root, as in a container of its own".to_owned());
        if mounted {
            Ok(Self(path))
        } else {
            Err(missing())
        }
    }

    /// Mounts it with another option.
    ///
    /// # Panics
    /// If that is refused.
    pub fn remount(&self, option: &str) {
        let mounted = Command::new("mount")
            .args(["-o", &format!("remount,{option}")])
            .arg(&self.0)
            .status();
        assert!(mounted.is_ok_and(|status| status.success()), "{option}");
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}
