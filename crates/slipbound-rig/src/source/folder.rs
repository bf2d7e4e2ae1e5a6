//! Pictures in files: a folder, a pattern or a single one, in the natural order of their names.

use super::{Error, natural, picture};
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Pictures in files as frames. They carry no time: the clock is [`Clock::Unknown`].
#[derive(Debug)]
pub struct Folder {
    files: Vec<PathBuf>,
    next: usize,
}

impl Folder {
    /// The images of a folder; other files are passed over.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let read = |source| Error::Read { path: path.to_owned(), source };
        let mut all = Vec::new();
        for entry in fs::read_dir(path).map_err(read)? {
            all.push(entry.map_err(read)?.path());
        }
        Self::of_images(path, all)
    }

    /// The images that a pattern (`*`, `?`, `[...]`, `**`) matches.
    pub fn matching(pattern: &str) -> Result<Self, Error> {
        let paths = glob::glob(pattern).map_err(|e| Error::Pattern {
            pattern: pattern.into(),
            at: e.pos,
            why: e.msg.into(),
        })?;
        let mut all = Vec::new();
        for path in paths {
            all.push(path.map_err(|e| Error::Read { path: e.path().to_owned(), source: e.into() })?);
        }
        Self::of_images(Path::new(pattern), all)
    }

    /// One image.
    pub fn single(path: &Path) -> Self {
        Folder { files: vec![path.to_owned()], next: 0 }
    }

    fn of_images(path: &Path, all: Vec<PathBuf>) -> Result<Self, Error> {
        let all_count = all.len();
        let mut files: Vec<PathBuf> = all.into_iter().filter(|p| has_image_name(p) && !p.is_dir()).collect();
        if files.is_empty() {
            return Err(Error::NoImages { path: path.to_owned(), others_count: all_count });
        }
        files.sort_by(|a, b| natural::compare(&a.to_string_lossy(), &b.to_string_lossy()));
        Ok(Folder { files, next: 0 })
    }
}

/// The image files that a folder, a pattern or the name of an image stands for; none where it is something else.
pub(super) fn image_files(uri: &str) -> Vec<PathBuf> {
    let path = Path::new(uri);
    let folder = match fs::metadata(path) {
        Ok(there) if there.is_dir() => Folder::open(path),
        Ok(_) if has_image_name(path) => Ok(Folder::single(path)),
        Ok(_) => return Vec::new(),
        Err(_) => Folder::matching(uri),
    };
    folder.map_or_else(|_| Vec::new(), |folder| folder.files)
}

/// Whether a file is named as an image that can be read.
pub(super) fn has_image_name(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    matches!(extension.as_str(), "jpg" | "jpeg" | "png")
}

impl FrameSource for Folder {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let Some(path) = self.files.get(self.next) else {
            return Ok(Next::End);
        };
        into.seq = self.next as u64;
        into.time_ns = None;
        into.clock = Clock::Unknown;
        into.label.clear();
        into.label.push_str(&path.file_name().unwrap_or_default().to_string_lossy());
        into.encoded.clear();
        File::open(path)
            .and_then(|mut file| file.read_to_end(&mut into.encoded))
            .map_err(|source| Error::Read { path: path.clone(), source })?;
        self.next += 1;
        Ok(match picture::decode(into) {
            Ok(()) => Next::Frame,
            Err(reason) => Next::Torn { reason },
        })
    }

    fn frames_count(&self) -> Option<u64> {
        Some(self.files.len() as u64)
    }
}
