//! Recordings as [`FrameSource`]s: `open("uri")` finds out which.
//!
//! ```text
//!   folder/   'grasp_*.png'   frame.jpg            video.avi (MJPG)        any other video
//!   `------------ Folder -----------'                   Avi            Ffmpeg (the installed program)
//! ```
//!
//! | source | number of a frame | time | clock |
//! |---|---|---|---|
//! | folder, pattern, image | place in the natural order of the names | none | unknown |
//! | video | place in the file, dropped frames counted | number times the header's frame rate | assumed |
//!
//! The rate in a video's header is often not the rate it was recorded at: nobody measured it, so the clock says
//! `assumed`. A picture that cannot be decoded whole is [`Next::Torn`](slipbound::port::Next) and the recording
//! goes on; EXIF orientation is ignored, for a finger's camera is turned by its sensor file.
//!
//! ```no_run
#![doc = include_str!("../examples/watch_recording.rs")]
//! ```

mod avi;
mod error;
mod ffmpeg;
mod folder;
mod jpeg;
mod natural;
mod newest;
mod picture;
mod read_ahead;
mod riff;

pub use avi::Avi;
pub use error::Error;
pub use ffmpeg::Ffmpeg;
pub use folder::Folder;
pub use newest::{Arrivals, Newest};
pub use read_ahead::{AheadFrame, ReadAhead, most_common_size};
pub use riff::Rate;

use slipbound::port::FrameSource;
use std::fs::{self, File};
use std::io::{self, BufReader, ErrorKind, Read, Seek};
use std::path::{Path, PathBuf};

/// Opens an image folder, a pattern, an image or a video file.
pub fn open(uri: &str) -> Result<Box<dyn FrameSource + Send>, Error> {
    let path = Path::new(uri);
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => Ok(Box::new(Folder::open(path)?)),
        Ok(_) if folder::has_image_name(path) => Ok(Box::new(Folder::single(path))),
        Ok(_) => open_video(path),
        // A file whose own name holds such signs was found above.
        Err(_) if uri.contains(['*', '?', '[']) => Ok(Box::new(Folder::matching(uri)?)),
        Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory | ErrorKind::InvalidFilename) => {
            Err(Error::Missing { path: path.to_owned() })
        }
        Err(source) => Err(Error::Read { path: path.to_owned(), source }),
    }
}

/// Decodes `into.encoded`, a JPEG or PNG picture, into `into.pixels`; the text of the failure says what is wrong
/// with it.
pub fn decode_image(into: &mut slipbound::port::FrameBuffer) -> Result<(), String> {
    picture::decode(into)
}

/// The image files that `open` would read, in their order; none where it would read a video.
pub fn image_files(uri: &str) -> Vec<PathBuf> {
    folder::image_files(uri)
}

/// Whether `open` would read image files named by a pattern or one by one.
pub fn reads_images(uri: &str) -> bool {
    let path = Path::new(uri);
    !path.is_dir() && (folder::has_image_name(path) || !path.exists())
}

/// Decodes MJPEG AVI files here and leaves everything else to `ffmpeg`.
fn open_video(path: &Path) -> Result<Box<dyn FrameSource + Send>, Error> {
    let read = |source| Error::Read { path: path.to_owned(), source };
    let mut file = BufReader::new(File::open(path).map_err(read)?);
    let start = first_bytes(&mut file).map_err(read)?;
    let is_avi = start.starts_with(b"RIFF") && start.ends_with(b"AVI ");
    if start.len() < 12 && (b"RIFF".starts_with(&start) || start.starts_with(b"RIFF")) {
        let got = format!("{} bytes in all", start.len());
        return Err(Error::Avi { path: path.to_owned(), expected: "`RIFF`, a length and `AVI `", got });
    }
    if !is_avi {
        return Ok(Box::new(Ffmpeg::open(path, None)?));
    }
    let mut walk = riff::Walk::open(file).map_err(|fault| fault.at(path))?;
    if walk.video().is_motion_jpeg() {
        Ok(Box::new(Avi::new(path, walk)))
    } else {
        let survey = walk.survey().map_err(read)?;
        Ok(Box::new(Ffmpeg::open(path, Some((walk.video(), survey)))?))
    }
}

/// Up to 12 bytes from the start; the file is wound back.
fn first_bytes(file: &mut (impl Read + Seek)) -> io::Result<Vec<u8>> {
    let mut start = Vec::with_capacity(12);
    file.take(12).read_to_end(&mut start)?;
    file.rewind()?;
    Ok(start)
}
