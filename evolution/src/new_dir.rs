//! Directories that are there as a whole or not at all, however many processes make the same one.
//!
//! A directory is made beside its place under a name of its own, and renamed. While it is made it
//! is locked, so that what a process leaves behind that is killed meanwhile can be told from what
//! another process is still making.

use crate::files::{self, FileError};
use crate::lock::{LOCK, Lock, LockError};
use std::fs;
use std::path::{Path, PathBuf};

/// A directory that is being made. Dropped before it is published, it is removed.
#[derive(Debug)]
pub struct NewDir {
    part: PathBuf,
    place: PathBuf,
    lock: Option<Lock>,
}

impl NewDir {
    /// An empty directory beside its place, locked; directories above it are made.
    ///
    /// # Errors
    /// [`FileError`] if there is something in that place ([`FileError::is_exists`]), or it cannot
    /// be made.
    pub fn beside(place: &Path) -> Result<Self, FileError> {
        refuse_existing(place)?;
        Self::unchecked_beside(place)
    }

    /// [`NewDir::beside`], also if something has appeared in that place: publishing fails then.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be made.
    pub fn unchecked_beside(place: &Path) -> Result<Self, FileError> {
        let parent = files::parent(place);
        fs::create_dir_all(parent).map_err(FileError::at(parent))?;
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
            // It is empty and of no use; that it cannot be removed changes nothing.
            let _ = fs::remove_dir_all(&part);
            match error {
                // Somebody who tidies up looked at it before it was locked.
                LockError::Held(_) => {}
                LockError::File(error) => return Err(FileError::at(place)(error.error)),
            }
        }
    }

    /// Where its files are written.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.part
    }

    /// An error about a file in it, said of the place where the file was to be in the end.
    pub fn in_place(&self, error: FileError) -> FileError {
        match error.path.strip_prefix(&self.part) {
            Ok(file) => FileError::at(&self.place.join(file))(error.error),
            Err(_) => error,
        }
    }

    /// Puts it in its place, without the lock's file.
    ///
    /// # Errors
    /// As [`NewDir::publish_locked`].
    pub fn publish(self) -> Result<(), FileError> {
        // Cosmetic: failure to remove it is ignored.
        let _ = fs::remove_file(self.part.join(LOCK));
        self.publish_locked().map(drop)
    }

    /// Puts it in its place, where it stays locked.
    ///
    /// # Errors
    /// [`FileError`] if there is something in that place now ([`FileError::is_exists`]), or it
    /// cannot be renamed; what was made is removed then.
    pub fn publish_locked(mut self) -> Result<Lock, FileError> {
        if let Err(error) = fs::rename(&self.part, &self.place) {
            refuse_existing(&self.place)?;
            return Err(FileError::at(&self.place)(error));
        }
        Ok(self.lock.take().expect("it is held until now"))
    }
}

impl Drop for NewDir {
    fn drop(&mut self) {
        if self.lock.is_some() {
            // It is of no use; that it cannot be removed changes nothing.
            let _ = fs::remove_dir_all(&self.part);
        }
    }
}

/// A rename replaces an empty directory.
fn refuse_existing(place: &Path) -> Result<(), FileError> {
    match place.symlink_metadata() {
        Ok(_) => Err(FileError::exists(place)),
        Err(_) => Ok(()),
    }
}

/// Removes what processes of this host left in a directory that were killed while they made
/// another one in it. What is locked is still being made; where the file system knows no locks,
/// nothing is removed.
pub fn remove_abandoned(directory: &Path) {
    for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
        if !files::is_part(&entry.file_name()) {
            continue;
        }
        if let Some(_lock) = Lock::take_abandoned(&entry.path()) {
            // Cosmetic: failure to remove it is ignored.
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
    fn what_is_being_made_is_never_tidied_up_and_what_was_abandoned_is() {
        let scratch = tempfile::tempdir().unwrap();
        let place = scratch.path().join("place");
        let making = NewDir::beside(&place).unwrap();
        // As after a kill: the directory is there, and nobody holds its lock.
        let abandoned = NewDir::beside(&place).unwrap();
        fs::write(abandoned.path().join("file"), "text").unwrap();
        let mut abandoned = std::mem::ManuallyDrop::new(abandoned);
        abandoned.lock = None;
        // As on another host, whose locks are not seen here.
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
    fn what_is_in_the_place_stays_and_nothing_is_left_beside_it() {
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
    fn making_and_tidying_up_at_once_never_meet() {
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
