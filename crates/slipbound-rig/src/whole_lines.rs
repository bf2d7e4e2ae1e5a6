//! A file of lines that holds whole lines only, whatever the disk does.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

/// Collects what is written until a line ends, then hands it to the file in one write. Of a line that cannot be written whole
/// nothing stays, so that the lines before it can be read, and those after it where the disk takes them again.
#[derive(Debug)]
pub struct WholeLines {
    file: File,
    /// Bytes of the whole lines in the file.
    length: u64,
    /// A line whose end has not come yet.
    begun: Vec<u8>,
}

impl WholeLines {
    /// A new file, or an empty one in the place of an old one.
    pub fn create(path: &Path) -> io::Result<Self> {
        Ok(WholeLines { file: File::create(path)?, length: 0, begun: Vec::new() })
    }

    fn drop_half_line(&mut self) {
        // What fails here too is the same disk: its first failure is what is told.
        let _ = self.file.set_len(self.length).and_then(|()| self.file.seek(SeekFrom::Start(self.length)));
    }
}

impl Write for WholeLines {
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

    /// Whole lines are in the file already; a line that has only begun waits for its end.
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
        let mut full = WholeLines::create(Path::new("/dev/full")).expect("opens");
        full.write_all(b"{\"seq\":").expect("waits for the end of the line");
        assert_eq!(full.write_all(b"1}\n").expect_err("full").kind(), ErrorKind::StorageFull);
        assert_eq!(full.length, 0);
    }

    #[test]
    fn lines_after_one_that_failed_can_be_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("lines");
        let mut lines = WholeLines::create(&path).expect("creates");
        lines.write_all(b"first\nsec").expect("writes");
        lines.file.write_all(b"half of").expect("writes"); // as a disk that fills up in the middle of a line leaves it
        lines.drop_half_line();
        lines.write_all(b"ond\nnever ended").expect("writes");
        drop(lines);
        assert_eq!(fs::read_to_string(path).expect("reads"), "first\nsecond\n");
    }
}
