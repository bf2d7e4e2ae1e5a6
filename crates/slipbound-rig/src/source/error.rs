//! Errors of a source, one variant a cause.

use slipbound::port::{SourceError, SourceErrorKind};
use std::io;
use std::path::{Path, PathBuf};

/// A source that cannot be opened or cannot go on. Every text names the file, what was expected and what was got.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Nothing is there.
    #[error("{}: expected a folder, an image, a video or a pattern that matches images; there is no such file", path.display())]
    Missing {
        /// What was asked for.
        path: PathBuf,
    },
    /// An invalid pattern.
    #[error("{pattern}: expected a file pattern (`*`, `?`, `[...]`), got a fault at sign {at}: {why}")]
    Pattern {
        /// The pattern.
        pattern: String,
        /// Position in it, counted from 0.
        at: usize,
        /// What is wrong there.
        why: String,
    },
    /// A folder or pattern without a single image.
    #[error(
        "{}: expected images (.jpg, .jpeg, .png), got none among {others_count} other files{}",
        path.display(), folders(path, *folders_count)
    )]
    NoImages {
        /// The folder or pattern.
        path: PathBuf,
        /// How many files of other kinds were ignored.
        others_count: usize,
        /// How many folders.
        folders_count: usize,
    },
    /// Only images of a kind that cannot be read.
    #[error(
        "{}: expected images (.jpg, .jpeg, .png), got {count} .{kind} {}; make PNGs of them, without loss: \
         `for f in *.{kind}; do ffmpeg -i $f ${{f%.{kind}}}.png; done`",
        path.display(), if *count == 1 { "file" } else { "files" }
    )]
    OtherImages {
        /// The folder, pattern or file.
        path: PathBuf,
        /// How their names end.
        kind: &'static str,
        /// How many.
        count: usize,
    },
    /// An invalid address of a live source.
    #[error("{uri}: expected {expected}")]
    Address {
        /// What was asked for.
        uri: String,
        /// What was expected and, where that helps, what was got.
        expected: String,
    },
    /// A stream that does not answer, or whose answer is something else.
    #[error("{uri}: {source}")]
    Stream {
        /// Its address.
        uri: String,
        /// Why.
        source: io::Error,
    },
    /// A recording (MCAP, or a ROS 2 bag in SQLite) without what is needed.
    #[error("{}: {why}", path.display())]
    Mcap {
        /// The file.
        path: PathBuf,
        /// Expected and got.
        why: String,
    },
    /// The operating system refused.
    #[error("{}: cannot read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// An AVI file whose structure cannot be followed up to the first frame.
    #[error("{}: expected {expected} in the AVI file, got {got}", path.display())]
    Avi {
        /// The file.
        path: PathBuf,
        /// What was expected there.
        expected: &'static str,
        /// What is there.
        got: String,
    },
    /// A codec that needs the program `ffmpeg`, which is not installed.
    #[error(
        "{}: decoding {codec} needs the program `ffmpeg`, which is not on the PATH; \
         install it (Debian, Ubuntu: `apt install ffmpeg`; macOS: `brew install ffmpeg`; Windows: \
         `winget install ffmpeg`) or convert the video to an MJPEG AVI elsewhere",
        path.display()
    )]
    FfmpegMissing {
        /// The video.
        path: PathBuf,
        /// What is known of its codec.
        codec: String,
    },
    /// `ffmpeg` is there but could not be started.
    #[error("{}: cannot start `ffmpeg`: {source}", path.display())]
    FfmpegStart {
        /// The video.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// `ffmpeg` failed.
    #[error("{}: expected a frame from `ffmpeg`, got {got}; it says: {stderr}", path.display())]
    Ffmpeg {
        /// The video.
        path: PathBuf,
        /// What came instead of a frame.
        got: String,
        /// The end of what it wrote to its standard error.
        stderr: String,
    },
}

/// What to do about folders in place of images.
fn folders(path: &Path, count: usize) -> String {
    let each = if path.is_dir() { path.join("*") } else { path.to_owned() };
    let folders = if count == 1 { "folder" } else { "folders" };
    match count {
        0 => String::new(),
        _ => format!(" and {count} {folders}: name each one, as the shell does for {} without quotes", each.display()),
    }
}

impl Error {
    fn kind(&self) -> SourceErrorKind {
        match self {
            Error::Missing { .. }
            | Error::Pattern { .. }
            | Error::OtherImages { .. }
            | Error::NoImages { .. }
            | Error::Address { .. } => SourceErrorKind::Settings,
            Error::Stream { .. } => SourceErrorKind::Disconnected,
            Error::Read { .. } => SourceErrorKind::Unreadable,
            Error::Avi { .. } | Error::Mcap { .. } | Error::Ffmpeg { .. } => SourceErrorKind::Format,
            Error::FfmpegMissing { .. } | Error::FfmpegStart { .. } => SourceErrorKind::Unsupported,
        }
    }

    fn file(&self) -> String {
        match self {
            Error::Pattern { pattern, .. } => pattern.clone(),
            Error::Address { uri, .. } | Error::Stream { uri, .. } => uri.clone(),
            Error::Missing { path }
            | Error::OtherImages { path, .. }
            | Error::NoImages { path, .. }
            | Error::Read { path, .. }
            | Error::Avi { path, .. }
            | Error::Mcap { path, .. }
            | Error::FfmpegMissing { path, .. }
            | Error::FfmpegStart { path, .. }
            | Error::Ffmpeg { path, .. } => path.display().to_string(),
        }
    }
}

impl From<Error> for SourceError {
    fn from(error: Error) -> Self {
        let (kind, file) = (error.kind(), error.file());
        SourceError::new(kind, error).of_file(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_keeps_its_text_and_says_its_kind_and_file() {
        let path = std::path::Path::new("there/left.avi");
        let read = Error::Read { path: path.into(), source: io::Error::other("the stick was pulled out") };
        let text = read.to_string();
        let error = SourceError::from(read);
        assert_eq!((error.kind, error.file.as_deref()), (SourceErrorKind::Unreadable, Some("there/left.avi")));
        assert_eq!(error.to_string(), text);
        let ended = Error::Ffmpeg { path: path.into(), got: "none".into(), stderr: "nothing".into() };
        assert_eq!(SourceError::from(ended).kind, SourceErrorKind::Format);
    }
}
