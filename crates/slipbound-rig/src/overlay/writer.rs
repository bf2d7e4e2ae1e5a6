//! Overlay images into a folder or a video.

use super::drawing::Overlay;
use crate::avi_writer::{self, AviWriter};
use crate::file_origin;
use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

/// JPEG quality of the video: thin coloured lines stay clean.
const JPEG_QUALITY: u8 = 92;

/// An image that cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The video cannot be written.
    #[error(transparent)]
    Avi(#[from] avi_writer::Error),
    /// A folder or image cannot be written.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// The folder or file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// An encoder refused the image.
    #[error("{}: cannot encode frame {seq}: {why}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// The frame's number.
        seq: u64,
        /// Its reason.
        why: String,
    },
}

/// Writes one image a frame: `000057.png` in a folder, or a Motion-JPEG AVI.
#[derive(Debug)]
pub struct OverlayWriter {
    path: PathBuf,
    video: Option<AviWriter>,
    jpeg: Vec<u8>,
}

impl OverlayWriter {
    /// `to`: a name that ends in `.avi`, or a folder, which is created if missing. `rate_hz`: playback rate of a video.
    pub fn create(to: &Path, overlay: &Overlay, rate_hz: u32) -> Result<Self, Error> {
        let is_video = to.extension().is_some_and(|e| e.eq_ignore_ascii_case("avi"));
        let video = match is_video {
            true => Some(AviWriter::create(to, overlay.size(), rate_hz)?),
            false => {
                let failed = |source| Error::Write { path: to.to_owned(), source };
                fs::create_dir_all(to).map_err(failed)?;
                remove_older(to).map_err(failed)?;
                None
            }
        };
        Ok(OverlayWriter { path: to.to_owned(), video, jpeg: Vec::new() })
    }

    /// The same with a lower limit of a video's length than [`avi_writer::MAX_BYTES`].
    #[must_use]
    pub fn with_most_bytes(self, most_bytes: u64) -> Self {
        OverlayWriter { video: self.video.map(|video| video.with_most_bytes(most_bytes)), ..self }
    }

    /// Writes the image drawn last for frame `seq`. After [`avi_writer::Error::TooLong`] the video can still be finished.
    pub fn push(&mut self, overlay: &Overlay, seq: u64) -> Result<(), Error> {
        let (rgb, size) = (overlay.rgb(), overlay.size());
        let Some(video) = &mut self.video else {
            let path = self.path.join(format!("{seq:06}.png"));
            return write_png(&path, &rgb, size.width as u32, size.height as u32, seq);
        };
        self.jpeg.clear();
        let mut encoder = Encoder::new(&mut self.jpeg, JPEG_QUALITY);
        encoder.set_sampling_factor(SamplingFactor::F_2_1); // what players expect of Motion-JPEG
        encoder.encode(&rgb, size.width as u16, size.height as u16, ColorType::Rgb).map_err(|e| Error::Encode {
            path: self.path.clone(),
            seq,
            why: e.to_string(),
        })?;
        Ok(video.push(&self.jpeg)?)
    }

    /// Finishes a video.
    pub fn finish(self) -> Result<(), Error> {
        Ok(self.video.map_or(Ok(()), AviWriter::finish)?)
    }
}

/// Removes the images of an earlier overlay; a shorter new one would otherwise leave some of them.
fn remove_older(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if is_numbered(&path) && file_origin::is_own_file(&path)? {
            fs::remove_file(path)?;
        }
    }
    Ok(())
}

/// Whether a file is named like an overlay image: `000057.png`.
pub fn is_numbered(path: &Path) -> bool {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.extension().is_some_and(|e| e == "png") && stem.len() >= 6 && stem.bytes().all(|byte| byte.is_ascii_digit())
}

/// Writes a PNG; the error names `seq` when it cannot be encoded.
pub(crate) fn write_png(path: &Path, rgb: &[u8], width: u32, height: u32, seq: u64) -> Result<(), Error> {
    let failed = |source| Error::Write { path: path.to_owned(), source };
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(path).map_err(failed)?), width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    let encode = |e: png::EncodingError| Error::Encode { path: path.to_owned(), seq, why: e.to_string() };
    encoder.add_text_chunk("Software".into(), "slipbound".into()).map_err(encode)?;
    let written = encoder.write_header().and_then(|mut w| {
        w.write_image_data(rgb)?;
        w.finish()
    });
    written.map_err(|e| match e {
        png::EncodingError::IoError(source) => failed(source),
        other => Error::Encode { path: path.to_owned(), seq, why: other.to_string() },
    })
}
