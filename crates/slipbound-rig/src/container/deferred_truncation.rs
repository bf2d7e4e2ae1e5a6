//! The file of a recording before anything is recorded.
//!
//! A refused source must not destroy an existing recording, and recorded data must be under the file's name however the
//! program ends. So the file is opened at once, and emptied when the first item is recorded.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// A writable file that still has its old content. If dropped, it stays unchanged; a new file is removed.
#[derive(Debug)]
pub(super) struct DeferredTruncation {
    path: PathBuf,
    file: File,
    is_new: bool,
}

impl DeferredTruncation {
    /// Opens the file, or creates an empty one.
    pub fn open(path: &Path) -> io::Result<Self> {
        let made = OpenOptions::new().write(true).create_new(true).open(path);
        let is_new = made.is_ok();
        let file = match made {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {
                OpenOptions::new().write(true).create(true).truncate(false).open(path)
            }
            made => made,
        }?;
        Ok(DeferredTruncation { path: path.to_owned(), file, is_new })
    }

    /// The file, emptied.
    pub fn begin(mut self) -> io::Result<File> {
        self.is_new = false;
        let file = self.file.try_clone()?;
        if file.metadata()?.is_file() {
            file.set_len(0)?; // a pipe has no length
        }
        Ok(file)
    }
}

impl Drop for DeferredTruncation {
    fn drop(&mut self) {
        if self.is_new {
            let _ = fs::remove_file(&self.path); // if this fails, an empty file stays
        }
    }
}
