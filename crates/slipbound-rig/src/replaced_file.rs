//! A file that replaces another only once it is complete.
//!
//! ```text
//!   create --> .slipbound-PID-N.part beside it --keep: sync, rename--> NAME
//!                                              --dropped: removed      NAME as it was
//! ```

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// A file that is being written. If it is dropped, the old file stays.
#[derive(Debug)]
pub(crate) struct ReplacedFile {
    file: File,
    /// The temporary path and the final path; None for a pipe or a device, which is written to directly.
    beside: Option<(PathBuf, PathBuf)>,
}

impl ReplacedFile {
    /// Creates an empty file in the same folder, with the permissions of the file that it will replace. Also fails if
    /// that file is not writable.
    pub fn create(path: &Path) -> io::Result<Self> {
        let there = match OpenOptions::new().write(true).open(path) {
            Ok(there) => Some(there),
            Err(e) if e.kind() == io::ErrorKind::NotFound => None,
            Err(e) => return Err(e),
        };
        let Some(there) = there else {
            return Self::beside(path);
        };
        let metadata = there.metadata()?;
        if !metadata.is_file() {
            return Ok(ReplacedFile { file: there, beside: None });
        }
        // The target of a link is replaced, not the link.
        let replaced = Self::beside(&fs::canonicalize(path)?)?;
        replaced.file.set_permissions(metadata.permissions())?;
        Ok(replaced)
    }

    fn beside(place: &Path) -> io::Result<Self> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let part = place.with_file_name(format!(".slipbound-{}-{number}.part", std::process::id()));
            match OpenOptions::new().write(true).create_new(true).open(&part) {
                Ok(file) => return Ok(ReplacedFile { file, beside: Some((part, place.to_owned())) }),
                // Left by a killed program; in a container its number can recur.
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
                Err(e) => return Err(e),
            }
        }
    }

    /// The file to write to.
    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// Completes the file and moves it into place. On failure the old file stays.
    pub fn keep(mut self) -> io::Result<()> {
        let Some((part, place)) = &self.beside else { return Ok(()) };
        self.file.sync_all()?;
        fs::rename(part, place)?;
        self.beside = None;
        Ok(())
    }
}

impl Drop for ReplacedFile {
    fn drop(&mut self) {
        if let Some((part, _)) = &self.beside {
            let _ = fs::remove_file(part); // if this fails too, the first failure is reported
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    #[test]
    fn what_a_killed_program_has_left_is_in_nobodys_way() {
        let scratch = tempfile::tempdir().expect("a folder");
        let path = scratch.path().join("a.bin");
        for number in 0..100 {
            let left = format!(".slipbound-{}-{number}.part", std::process::id());
            fs::write(scratch.path().join(left), "half").expect("writes");
        }
        let mut file = ReplacedFile::create(&path).expect("begins");
        file.file().write_all(b"whole").expect("writes");
        file.keep().expect("replaces");
        assert_eq!(fs::read_to_string(&path).expect("reads"), "whole");
    }

    #[test]
    fn a_file_is_replaced_when_it_is_whole_and_left_as_it_was_otherwise() {
        let scratch = tempfile::tempdir().expect("a folder");
        let path = scratch.path().join("a.bin");
        let names = || fs::read_dir(scratch.path()).expect("reads").count();
        for (text, is_whole, expected) in [
            ("one", false, None),
            ("two", true, Some("two")),
            ("three", false, Some("two")),
            ("four", true, Some("four")),
        ] {
            let mut file = ReplacedFile::create(&path).expect("begins");
            file.file().write_all(text.as_bytes()).expect("writes");
            if is_whole {
                file.keep().expect("is put in its place");
            } else {
                drop(file);
            }
            assert_eq!(fs::read_to_string(&path).ok().as_deref(), expected);
            assert_eq!(names(), usize::from(expected.is_some()), "nothing is left beside it");
        }
        assert!(ReplacedFile::create(scratch.path()).is_err(), "a folder is no file to be replaced");
    }

    #[cfg(unix)]
    #[test]
    fn what_a_link_leads_to_is_replaced_and_keeps_its_permissions() {
        use std::os::unix::fs::PermissionsExt as _;
        let scratch = tempfile::tempdir().expect("a folder");
        let (path, link) = (scratch.path().join("a.bin"), scratch.path().join("link"));
        fs::write(&path, "old").expect("writes");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("sets");
        std::os::unix::fs::symlink(&path, &link).expect("links");
        let mut file = ReplacedFile::create(&link).expect("begins");
        file.file().write_all(b"new").expect("writes");
        file.keep().expect("is put in its place");
        assert_eq!(fs::read_to_string(&path).expect("there"), "new");
        assert_eq!(fs::metadata(&path).expect("there").permissions().mode() & 0o777, 0o600);
        assert!(link.is_symlink());
    }
}
