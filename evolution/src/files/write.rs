//! Atomic file writes: a file is written under a temporary name, synced, then renamed.

use super::{Existing, FileError, parent};
use sha2::{Digest, Sha256};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempPath;

/// Ending of temporary files and directories.
const PART: &str = ".part";

/// Returns a temporary name of fixed length in the same folder: a hash of the final name, and a
/// random number, because process IDs are not unique on a file system that several machines share.
#[must_use]
pub fn beside(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default();
    let hash = Sha256::digest(name.as_encoded_bytes());
    let hash = u64::from_be_bytes(hash[..8].try_into().expect("a SHA-256 has 32 bytes"));
    let number: u64 = rand::random();
    path.with_file_name(format!(".{hash:016x}.{number:016x}{PART}"))
}

/// Checks whether a name is a temporary one from [`beside`].
#[must_use]
pub fn is_part(name: &OsStr) -> bool {
    let numbers = || {
        let name = name.to_str()?.strip_prefix('.')?.strip_suffix(PART)?;
        name.split_once('.')
    };
    let is_digit = |byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f');
    let is_number = |text: &str| text.len() == 16 && text.bytes().all(is_digit);
    numbers().is_some_and(|(hash, number)| is_number(hash) && is_number(number))
}

/// Maximum age of a temporary file in use: no write takes longer than this.
const PART_AGE_MAX: Duration = Duration::from_secs(3600);

/// Removes the temporary files that killed processes left in a folder.
pub fn remove_old_parts(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let is_old = |metadata: fs::Metadata| {
            let age = metadata.modified().ok()?.elapsed().ok()?;
            Some(metadata.is_file() && age > PART_AGE_MAX)
        };
        if is_part(&entry.file_name()) && entry.metadata().ok().and_then(is_old) == Some(true) {
            // Cosmetic: failure to remove the file is ignored.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Writes a file, replacing an existing one only if `existing` allows it.
///
/// # Errors
/// See [`create`] and [`replace`].
pub fn write(path: &Path, contents: &[u8], existing: Existing) -> Result<(), FileError> {
    match existing {
        Existing::Refuse => create(path, contents),
        Existing::Replace => replace(path, contents),
    }
}

/// Writes a file that must not exist yet. The file appears under its name only when complete, and
/// replaces nothing, not even a file created in the meantime. On a file system with neither hard
/// links nor a rename that fails if the target exists, an empty file briefly reserves the name.
///
/// # Errors
/// [`FileError`] if the file exists ([`FileError::is_exists`]) or cannot be written; no partial
/// file is left.
pub fn create(path: &Path, contents: &[u8]) -> Result<(), FileError> {
    if path.symlink_metadata().is_ok() {
        return Err(FileError::exists(path));
    }
    let create = || {
        let refused = match write_beside(path, contents, None)?.persist_noclobber(path) {
            Ok(()) => return Ok(()),
            Err(refused) if refused.error.kind() == ErrorKind::AlreadyExists => {
                return Err(refused.error);
            }
            Err(refused) => refused,
        };
        File::create_new(path)?;
        refused.path.persist(path).map_err(|refused| {
            // This process created the empty file; the first error is the one to report.
            let _ = fs::remove_file(path);
            refused.error
        })
    };
    create().map_err(FileError::at(path))
}

/// Replaces a file as a whole: if the process is killed, either the old or the new file exists. The
/// new one gets the permissions of the old one. A symbolic link is kept, and its target is
/// replaced. A target that cannot be replaced (a device, a pipe, a mounted file) is written in
/// place.
///
/// # Errors
/// [`FileError`] if the file cannot be written. The old file is then unchanged, unless it is
/// written in place.
pub fn replace(path: &Path, contents: &[u8]) -> Result<(), FileError> {
    let replace = || {
        let old = fs::metadata(path).ok();
        let is_file = old.as_ref().is_some_and(fs::Metadata::is_file);
        if old.as_ref().is_some_and(|old| !is_file && !old.is_dir()) {
            return write_to(path, contents);
        }
        let target = target(path)?;
        let permissions = old.map(|old| old.permissions());
        let written = write_beside(&target, contents, permissions)
            .and_then(|part| part.persist(&target).map_err(|refused| refused.error));
        match written.as_ref().map_err(io::Error::kind) {
            // A mount point cannot be a rename's target, and its folder may be read-only.
            Err(ErrorKind::ResourceBusy | ErrorKind::ReadOnlyFilesystem) if is_file => {
                write_to(&target, contents)
            }
            _ => written,
        }
    };
    replace().map_err(FileError::at(path))
}

/// Writes a temporary file beside a path; the file is removed unless it is renamed.
fn write_beside(
    path: &Path,
    contents: &[u8],
    permissions: Option<fs::Permissions>,
) -> io::Result<TempPath> {
    let part = beside(path);
    let mut file = File::create_new(&part)?;
    let part = TempPath::try_from_path(part)?;
    if let Some(permissions) = permissions
        && permissions != file.metadata()?.permissions()
    {
        file.set_permissions(permissions)?;
    }
    file.write_all(contents)?;
    file.sync_data()?;
    Ok(part)
}

/// Writes to an existing device, pipe or file.
fn write_to(path: &Path, contents: &[u8]) -> io::Result<()> {
    let mut file = File::options().write(true).truncate(true).open(path)?;
    file.write_all(contents)
}

/// Returns the target of a chain of symbolic links, whether or not it exists.
fn target(path: &Path) -> io::Result<PathBuf> {
    let mut target = path.to_owned();
    // The maximum number of links that Linux follows.
    for _ in 0..40 {
        match fs::read_link(&target) {
            Ok(next) => target = parent(&target).join(next),
            Err(_) => return Ok(target),
        }
    }
    // The links form a loop: using the path reports the error.
    fs::metadata(path).map(|_| target)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().path()).collect()
    }

    #[test]
    fn only_names_from_this_program_count_as_temporary() {
        assert!(is_part(beside(Path::new("file")).as_os_str()));
        for name in [
            ".g.part",
            ".0123456789abcdef.part",
            ".0123456789abcdef.0123456789abcde.part",
            ".0123456789abcdef.0123456789ABCDEF.part",
            "0123456789abcdef.0123456789abcdef.part",
            ".0123456789abcdef.0123456789abcdef.0123456789abcdef.part",
        ] {
            assert!(!is_part(OsStr::new(name)), "{name}");
        }
    }

    #[test]
    fn only_old_temporary_files_are_removed() {
        let scratch = tempfile::tempdir().unwrap();
        let [young, old, folder] = [(); 3].map(|()| beside(&scratch.path().join("file")));
        let of_the_user = scratch.path().join(".letter.part");
        fs::create_dir(&folder).unwrap();
        let long_ago = std::time::SystemTime::now() - 2 * PART_AGE_MAX;
        for file in [&young, &old, &of_the_user] {
            let file = File::create(file).unwrap();
            file.set_modified(long_ago).unwrap();
        }
        fs::write(&young, "text").unwrap();
        remove_old_parts(scratch.path());
        assert!(young.exists() && folder.exists() && of_the_user.exists());
        assert!(!old.exists());
    }

    #[test]
    fn the_longest_possible_name_can_be_written_and_replaced() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("x".repeat(255));
        create(&path, b"old").unwrap();
        assert!(create(&path, b"new").unwrap_err().is_exists());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        replace(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(scratch.path()), [path]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_name_that_is_not_utf_8_can_be_written_and_replaced() {
        use std::os::unix::ffi::OsStrExt;
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join(OsStr::from_bytes(b"a\xff"));
        create(&path, b"old").unwrap();
        replace(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        let hash = |name: &OsStr| beside(Path::new(name)).to_string_lossy()[..18].to_owned();
        assert_ne!(
            hash(OsStr::from_bytes(b"a\xff")),
            hash(OsStr::from_bytes(b"a\xfe"))
        );
    }

    #[cfg(unix)]
    #[test]
    fn replacing_a_symbolic_link_replaces_its_target() {
        use std::os::unix::fs::symlink;
        let scratch = tempfile::tempdir().unwrap();
        let at = |name: &str| scratch.path().join(name);
        fs::create_dir(at("folder")).unwrap();
        symlink("folder/second", at("first")).unwrap();
        symlink("../file", at("folder/second")).unwrap();
        for contents in [b"new".as_slice(), b"newer"] {
            // In the first round, the link's target does not exist.
            replace(&at("first"), contents).unwrap();
            assert_eq!(fs::read(at("file")).unwrap(), contents);
        }
        assert!(at("first").is_symlink() && at("folder/second").is_symlink());
        assert!(create(&at("first"), b"").unwrap_err().is_exists());
        symlink("loop", at("loop")).unwrap();
        let error = replace(&at("loop"), b"").unwrap_err().to_string();
        assert!(error.contains("symbolic link"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn a_replaced_file_keeps_its_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("file");
        create(&path, b"old").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        replace(&path, b"new").unwrap();
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_is_written_to_and_reports_when_it_is_full() {
        use std::os::unix::fs::FileTypeExt;
        let error = replace(Path::new("/dev/full"), b"text").unwrap_err();
        assert_eq!(error.error.kind(), ErrorKind::StorageFull, "{error}");
        replace(Path::new("/dev/null"), b"text").unwrap();
        let null = fs::metadata("/dev/null").unwrap();
        assert!(null.file_type().is_char_device());
    }

    #[test]
    fn of_many_threads_creating_one_file_one_succeeds_and_none_sees_half_of_it() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("file");
        let texts: Vec<Vec<u8>> = (b'a'..=b'h').map(|letter| vec![letter; 100_000]).collect();
        let created = std::thread::scope(|scope| {
            let path = &path;
            let writers = texts.iter();
            let writers = writers.map(|text| scope.spawn(move || create(path, text).is_ok()));
            let writers: Vec<_> = writers.collect();
            while !path.exists() {}
            assert!(texts.contains(&fs::read(path).unwrap()));
            let ended = writers.into_iter().map(|writer| writer.join().unwrap());
            ended.filter(|created| *created).count()
        });
        assert_eq!(created, 1);
        assert_eq!(names(scratch.path()), [path]);
    }
}
