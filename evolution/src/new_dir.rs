//! Directories that appear complete or not at all, even if several processes create the same one.
//!
//! A directory is created beside its final path under a temporary name, then renamed. It is locked
//! until then; the lock distinguishes directories being written from leftovers of killed processes.

use crate::files::{self, FileError};
use crate::lock::{LOCK, Lock, LockError};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A directory being created. If it is dropped before it is published, it is removed.
#[derive(Debug)]
pub struct NewDir {
    part: PathBuf,
    place: PathBuf,
    lock: Option<Lock>,
}

impl NewDir {
    /// Creates an empty, locked directory beside its final path, and all missing parents.
    ///
    /// # Errors
    /// [`FileError`] if the final path exists ([`FileError::is_exists`]), or the directory cannot
    /// be created.
    pub fn beside(place: &Path) -> Result<Self, FileError> {
        refuse_existing(place)?;
        Self::unchecked_beside(place)
    }

    /// Like [`NewDir::beside`], but the final path may exist; publishing then fails.
    ///
    /// # Errors
    /// [`FileError`] if the directory cannot be created.
    pub fn unchecked_beside(place: &Path) -> Result<Self, FileError> {
        let parent = files::parent(place);
        fs::create_dir_all(parent)
            .map_err(|error| match error.kind() {
                // A file is in the way: "already exists" would not say so.
                ErrorKind::AlreadyExists => ErrorKind::NotADirectory.into(),
                _ => error,
            })
            .map_err(FileError::at(parent))?;
        loop {
            let part = files::beside(place);
            fs::create_dir(&part).map_err(FileError::at(place))?;
            let error = match Lock::take(&part) {
                Ok(lock) => {
                    return Ok(Self {
                        part,
                        place: place.to_owned(),
                        lock: Some(lock),
                    });
                }
                Err(error) => error,
            };
            // The directory is empty and unused: failure to remove it is ignored.
            let _ = fs::remove_dir_all(&part);
            match error {
                // Another process's cleanup opened the directory before it was locked.
                LockError::Held(_) => {}
                LockError::File(error) => return Err(FileError::at(place)(error.error)),
            }
        }
    }

    /// Returns the temporary path, under which the files are written.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.part
    }

    /// Rewrites an error about a file in the directory to show the file's final path.
    pub fn in_place(&self, error: FileError) -> FileError {
        match error.path.strip_prefix(&self.part) {
            Ok(file) => FileError::at(&self.place.join(file))(error.error),
            Err(_) => error,
        }
    }

    /// Renames the directory to its final path, without the lock file.
    ///
    /// # Errors
    /// See [`NewDir::publish_locked`].
    pub fn publish(self) -> Result<(), FileError> {
        // Cosmetic: failure to remove the lock file is ignored.
        let _ = fs::remove_file(self.part.join(LOCK));
        self.publish_locked().map(drop)
    }

    /// Renames the directory to its final path and keeps it locked.
    ///
    /// # Errors
    /// [`FileError`] if the final path has been created in the meantime ([`FileError::is_exists`]),
    /// or the directory cannot be renamed. In both cases, the temporary directory is removed.
    pub fn publish_locked(mut self) -> Result<Lock, FileError> {
        if let Err(error) = fs::rename(&self.part, &self.place) {
            refuse_existing(&self.place)?;
            return Err(FileError::at(&self.place)(error));
        }
        Ok(self.lock.take().expect("held until now"))
    }
}

impl Drop for NewDir {
    fn drop(&mut self) {
        if self.lock.is_some() {
            // The directory is unused: failure to remove it is ignored.
            let _ = fs::remove_dir_all(&self.part);
        }
    }
}

/// Rejects an existing path, because a rename would replace an empty directory.
fn refuse_existing(place: &Path) -> Result<(), FileError> {
    match place.symlink_metadata() {
        Ok(_) => Err(FileError::exists(place)),
        Err(_) => Ok(()),
    }
}

/// Removes unfinished directories left in a directory by killed processes of this host. Locked ones
/// are still being written; on a file system without locks, nothing is removed.
pub fn remove_abandoned(directory: &Path) {
    for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
        if !files::is_part(&entry.file_name()) {
            continue;
        }
        if let Some(_lock) = Lock::take_abandoned(&entry.path()) {
            // Cosmetic: failure to remove the directory is ignored.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        entries
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect()
    }

    #[test]
    fn abandoned_directories_are_removed_and_unfinished_ones_are_not() {
        let scratch = tempfile::tempdir().unwrap();
        let place = scratch.path().join("place");
        let making = NewDir::beside(&place).unwrap();
        // As if its process had been killed: the directory exists and is not locked.
        let abandoned = NewDir::beside(&place).unwrap();
        fs::write(abandoned.path().join("file"), "text").unwrap();
        let mut abandoned = std::mem::ManuallyDrop::new(abandoned);
        abandoned.lock = None;
        // As if created on another host, whose locks are not visible here.
        let elsewhere = scratch.path().join(files::beside(&place));
        fs::create_dir(&elsewhere).unwrap();
        fs::write(elsewhere.join(LOCK), "another-host 1\n").unwrap();
        let of_the_user = scratch.path().join(".place.part");
        fs::create_dir(&of_the_user).unwrap();

        remove_abandoned(scratch.path());
        assert!(making.path().is_dir() && elsewhere.is_dir() && of_the_user.is_dir());
        assert!(!abandoned.path().exists());
        making.publish().unwrap();
        assert!(names(&place).is_empty(), "{:?}", names(&place));
    }

    #[test]
    fn an_existing_directory_stays_and_nothing_is_left_beside_it() {
        let scratch = tempfile::tempdir().unwrap();
        let place = scratch.path().join("place");
        let [first, second, third] = [(); 3].map(|()| NewDir::beside(&place).unwrap());
        for (dir, text) in [(&first, "first"), (&second, "second")] {
            fs::write(dir.path().join("file"), text).unwrap();
        }
        first.publish().unwrap();
        assert!(second.publish().unwrap_err().is_exists());
        assert!(NewDir::beside(&place).unwrap_err().is_exists());
        drop(third);
        assert_eq!(fs::read(place.join("file")).unwrap(), b"first");
        assert_eq!(names(scratch.path()), ["place"]);
    }

    #[test]
    fn creating_and_cleaning_up_at_once_do_not_interfere() {
        let scratch = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let scratch = scratch.path();
                scope.spawn(move || {
                    for number in 0..100 {
                        remove_abandoned(scratch);
                        let place = scratch.join(format!("{thread}-{number}"));
                        let dir = NewDir::beside(&place).unwrap();
                        fs::write(dir.path().join("file"), "text").unwrap();
                        dir.publish_locked().unwrap();
                    }
                });
            }
        });
        assert_eq!(names(scratch.path()).len(), 400);
    }
}
