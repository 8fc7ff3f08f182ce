//! Temporary file systems for tests.

use crate::tools::Missing;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A mounted file system or file, which is unmounted on drop.
#[derive(Debug)]
pub struct Disk(PathBuf);

impl Disk {
    /// Mounts an empty file system of the given size.
    ///
    /// # Errors
    /// [`Missing`] if this process is not privileged.
    ///
    /// # Panics
    /// If the folder cannot be created.
    pub fn mounted_at(path: PathBuf, size: &str) -> Result<Self, Missing> {
        fs::create_dir_all(&path).expect("a folder");
        let size = format!("size={size}");
        let options = ["-t", "tmpfs", "-o", &size, "tmpfs"].map(Path::new);
        Self::mounted(path, &options)
    }

    /// Mounts a file over another file.
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
            || Missing("mounting: it needs root, for example in a separate container".to_owned());
        if mounted {
            Ok(Self(path))
        } else {
            Err(missing())
        }
    }

    /// Remounts the file system with this option.
    ///
    /// # Panics
    /// If the file system cannot be remounted.
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
