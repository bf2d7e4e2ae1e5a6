//! A file that holds complete lines only, even when the disk fails.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

/// Buffers a line until it ends, then writes it in one call. A line that cannot be written completely is removed, so
/// the lines before it stay readable, and so do later ones once the disk accepts them again.
#[derive(Debug)]
pub struct LineFile {
    file: File,
    /// Length of the complete lines in the file, bytes.
    length: u64,
    /// A line that has not ended yet.
    begun: Vec<u8>,
}

impl LineFile {
    /// Creates a file, or empties an existing one.
    pub fn create(path: &Path) -> io::Result<Self> {
        Ok(LineFile { file: File::create(path)?, length: 0, begun: Vec::new() })
    }

    fn drop_half_line(&mut self) {
        // If this fails too, it is the same disk: the first failure is reported.
        let _ = self.file.set_len(self.length).and_then(|()| self.file.seek(SeekFrom::Start(self.length)));
    }
}

impl Write for LineFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Some(end) = bytes.iter().rposition(|byte| *byte == b'\n') else {
            self.begun.extend_from_slice(bytes);
            return Ok(bytes.len());
        };
        self.begun.extend_from_slice(&bytes[..=end]);
        let written = self.file.write_all(&self.begun);
        match written {
            Ok(()) => self.length += self.begun.len() as u64,
            Err(_) => self.drop_half_line(),
        }
        self.begun.clear();
        self.begun.extend_from_slice(&bytes[end + 1..]);
        written.map(|()| bytes.len())
    }

    /// Complete lines are in the file already; a partial line waits for its end.
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use std::fs;
    use std::io::ErrorKind;

    #[test]
    fn a_full_disk_is_an_error_and_leaves_no_half_line() {
        let mut full = LineFile::create(Path::new("/dev/full")).expect("opens");
        full.write_all(b"{\"seq\":").expect("waits for the end of the line");
        assert_eq!(full.write_all(b"1}\n").expect_err("full").kind(), ErrorKind::StorageFull);
        assert_eq!(full.length, 0);
    }

    #[test]
    fn lines_after_one_that_failed_can_be_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("lines");
        let mut lines = LineFile::create(&path).expect("creates");
        lines.write_all(b"first\nsec").expect("writes");
        lines.file.write_all(b"half of").expect("writes"); // as a disk leaves it that fills up in the middle of a line
        lines.drop_half_line();
        lines.write_all(b"ond\nnever ended").expect("writes");
        drop(lines);
        assert_eq!(fs::read_to_string(path).expect("reads"), "first\nsecond\n");
    }
}
