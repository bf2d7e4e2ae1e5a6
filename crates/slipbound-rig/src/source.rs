//! Recordings and cameras as [`FrameSource`]s: `open("uri")` selects the kind.
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
//! | video whose stamps are uneven, through `ffmpeg` | place in the file | the container's stamps | container |
//! | `run.mcap` | as it was recorded | as it was recorded, else the message's | as it was recorded, else container |
//! | `bag.db3` (ROS 2 in SQLite) | place | that of the message | container |
//! | `-` (standard input), named pipe, through `ffmpeg` | place | none | unknown |
//! | `http://` Motion JPEG | place | the server's stamp, arrival without one or once one stood still | device, host |
//! | `v4l2:` camera | the driver's, gaps counted | the driver's stamp | device |
//! | `rtsp://` and others, through `ffmpeg` | place | arrival | host |
//!
//! The last three are live ([`is_live`]): a [`Camera`] reports the negotiated settings and counts its frames and
//! losses; on a thread of its own ([`Newest`]) only the newest frame is kept.
//!
//! The rate in a video's header often differs from the true recording rate, so the clock is `assumed`. An image that
//! cannot be decoded completely is [`Next::Torn`](slipbound::port::Next) and the recording goes on. EXIF orientation is
//! ignored: the sensor file defines how the camera is rotated.
//!
//! ```no_run
#![doc = include_str!("../examples/watch_recording.rs")]
//! ```

mod avi;
mod camera;
mod chunked;
mod encoded;
mod error;
mod ffmpeg;
mod ffmpeg_live;
mod file_ending;
mod folder;
mod jpeg;
mod mjpeg_http;
mod multipart;
mod natural_sort;
mod newest;
mod picture;
mod picture_size;
mod read_ahead;
mod riff;
mod stamps;
#[cfg(all(feature = "v4l2", target_os = "linux", target_pointer_width = "64"))]
pub mod v4l2;
mod video_times;

pub use avi::Avi;
pub(crate) use camera::is_news;
pub use camera::{Camera, CameraCounts, CameraTally};
pub use encoded::Encoded;
pub use error::Error;
pub use ffmpeg::Ffmpeg;
pub use ffmpeg_live::FfmpegLive;
pub use file_ending::has_ending;
pub use folder::{Folder, has_image_name};
pub use mjpeg_http::MjpegHttp;
pub use newest::{Arrivals, Awaited, Newest};
pub use picture::decode as decode_image;
pub(crate) use picture_size::checked_size;
pub use read_ahead::{AheadFrame, ReadAhead, most_common_size};
pub use riff::Rate;

use slipbound::port::FrameSource;
use std::fs::{self, File};
use std::io::{self, BufReader, ErrorKind, Read, Seek};
use std::path::{Path, PathBuf};

/// Whether frames arrive on their own and are lost if not taken.
pub fn is_live(uri: &str) -> bool {
    ["http://", "v4l2:"].iter().chain(&ffmpeg_live::SCHEMES).any(|scheme| uri.starts_with(scheme))
}

/// Opens a live source, for which [`is_live`] is true.
pub fn open_camera(uri: &str) -> Result<Camera, Error> {
    if uri.starts_with("v4l2:") {
        return open_v4l2(uri);
    }
    if ffmpeg_live::SCHEMES.iter().any(|scheme| uri.starts_with(scheme)) {
        return FfmpegLive::open(uri);
    }
    MjpegHttp::open(uri)
}

#[cfg(all(feature = "v4l2", target_os = "linux", target_pointer_width = "64"))]
fn open_v4l2(uri: &str) -> Result<Camera, Error> {
    v4l2::V4l2::open(uri)
}

#[cfg(not(all(feature = "v4l2", target_os = "linux", target_pointer_width = "64")))]
fn open_v4l2(uri: &str) -> Result<Camera, Error> {
    let expected = "a build with cameras: the feature v4l2, on 64-bit Linux".into();
    Err(Error::Address { uri: uri.into(), expected })
}

/// Opens an image folder, a pattern, an image or a video file, or a live source.
pub fn open(uri: &str) -> Result<Box<dyn FrameSource + Send>, Error> {
    if is_live(uri) {
        return open_camera(uri).map(|camera| camera.source);
    }
    if let Some((path, topic)) = mcap_file(uri) {
        return open_mcap(Path::new(path), topic);
    }
    let path = Path::new(uri);
    if uri == ffmpeg::STDIN {
        return Ok(Box::new(Ffmpeg::open_pipe(path)?));
    }
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => Ok(Box::new(Folder::open(path)?)),
        Ok(there) if is_pipe(&there) => Ok(Box::new(Ffmpeg::open_pipe(path)?)),
        Ok(_) if folder::has_image_name(path) => Ok(Box::new(Folder::single(path))),
        Ok(_) => match folder::other_image(path) {
            Some(kind) => Err(Error::OtherImages { path: path.to_owned(), kind, count: 1 }),
            None => open_video(path),
        },
        // A file whose name contains such characters was found above.
        Err(_) if uri.contains(['*', '?', '[', '%']) => match Folder::matching(uri) {
            Err(Error::NoImages { others_count: 0, folders_count: 0, .. } | Error::Pattern { .. })
                if folder::is_no_pattern(uri) =>
            {
                Err(Error::Missing { path: path.to_owned() })
            }
            found => Ok(Box::new(found?)),
        },
        Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory | ErrorKind::InvalidFilename) => {
            Err(Error::Missing { path: path.to_owned() })
        }
        Err(source) => Err(Error::Read { path: path.to_owned(), source }),
    }
}

/// `FILE.mcap` or `FILE.mcap#TOPIC`, or the same for a `.db3`, as file and topic; None for anything else, and if there
/// is no such file.
pub fn mcap_file(uri: &str) -> Option<(&str, Option<&str>)> {
    let is_it = |path: &str| {
        let path = Path::new(path);
        ["mcap", "db3"].iter().any(|ending| has_ending(path, ending)) && path.is_file()
    };
    if is_it(uri) {
        return Some((uri, None));
    }
    uri.rsplit_once('#').filter(|(path, _)| is_it(path)).map(|(path, topic)| (path, Some(topic)))
}

#[cfg(feature = "mcap")]
fn open_mcap(path: &Path, topic: Option<&str>) -> Result<Box<dyn FrameSource + Send>, Error> {
    if has_ending(path, "db3") {
        return Ok(Box::new(crate::container::Db3Source::open(path, topic)?));
    }
    Ok(Box::new(crate::container::McapSource::open(path, topic)?))
}

#[cfg(not(feature = "mcap"))]
fn open_mcap(path: &Path, _topic: Option<&str>) -> Result<Box<dyn FrameSource + Send>, Error> {
    Err(Error::Mcap { path: path.to_owned(), why: "this build has no MCAP files (feature `mcap`)".into() })
}

#[cfg(unix)]
fn is_pipe(there: &fs::Metadata) -> bool {
    std::os::unix::fs::FileTypeExt::is_fifo(&there.file_type())
}

#[cfg(not(unix))]
fn is_pipe(_there: &fs::Metadata) -> bool {
    false
}

/// Whether `open` gives the same frames a second time: not those of a camera, of standard input, a pipe or a device.
pub fn is_repeatable(uri: &str) -> bool {
    if is_live(uri) || uri == ffmpeg::STDIN {
        return false;
    }
    fs::metadata(uri).map_or(true, |there| there.is_file() || there.is_dir())
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
    if start.is_empty() && !has_ending(path, "avi") {
        return Err(read(io::Error::new(ErrorKind::UnexpectedEof, "expected a video, got an empty file")));
    }
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

/// What the user should know about a recording that can be read, but not as it seems: images of kinds that are left out
/// or that a viewer turns, or an AVI file whose header states a rate that no camera has. That rate is ignored and its frames have no time.
pub fn doubt(uri: &str) -> Option<String> {
    if let Some((kind, count)) = folder::images_left_out(uri) {
        let images = if count == 1 { "image" } else { "images" };
        return Some(format!(
            "{uri}: {count} {images} of other kinds (.{kind}) left out: only .jpg, .jpeg and .png are read"
        ));
    }
    if let Some(orientation) = folder::orientation(uri) {
        let taken = "images are taken as they are stored, not as a viewer shows them";
        return Some(format!("{uri}: the first image has the EXIF orientation {orientation}: {taken}"));
    }
    let path = Path::new(uri);
    let mut file = fs::metadata(path).ok().filter(fs::Metadata::is_file).and_then(|_| File::open(path).ok())?;
    let start = first_bytes(&mut file).ok()?;
    if !(start.starts_with(b"RIFF") && start.ends_with(b"AVI ")) {
        return None;
    }
    let rate = riff::Walk::open(BufReader::new(file)).ok()?.video().rate;
    rate.is_doubtful().then(|| {
        let (least_hz, most_hz) = (riff::LEAST_RATE_HZ, riff::MOST_RATE_HZ);
        let expected = format!("expected {least_hz} to {most_hz} frames per second in its header");
        format!("{uri}: {expected}, got {} in {} s: its frames are given no time", rate.frames, rate.seconds)
    })
}

/// Up to 12 bytes from the start; the file is rewound.
fn first_bytes(file: &mut (impl Read + Seek)) -> io::Result<Vec<u8>> {
    let mut start = Vec::with_capacity(12);
    file.take(12).read_to_end(&mut start)?;
    file.rewind()?;
    Ok(start)
}
