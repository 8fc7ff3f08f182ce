//! File systems of a test's own.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A file system, or a file, mounted somewhere; gone with this.
#[derive(Debug)]
pub struct Disk(PathBuf);

impl Disk {
    /// An empty file system as large as it is made. Only a privileged process gets one.
    ///
    /// # Panics
    /// If there can be no folder of that name.
    #[must_use]
    pub fn mounted_at(path: PathBuf, size: &str) -> Option<Self> {
        fs::create_dir_all(&path).expect("a folder");
        let size = format!("size={size}");
        let options = ["-t", "tmpfs", "-o", &size, "tmpfs"].map(Path::new);
        Self::mounted(path, &options)
    }

    /// A file in the place of another one. Only a privileged process gets that.
    #[must_use]
    pub fn bound(file: &Path, path: PathBuf) -> Option<Self> {
        Self::mounted(path, &[Path::new("--bind"), file])
    }

    fn mounted(path: PathBuf, options: &[&Path]) -> Option<Self> {
        let mounted = Command::new("mount").args(options).arg(&path).output();
        let mounted = mounted.is_ok_and(|output| output.status.success());
        mounted.then(|| Self(path))
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
