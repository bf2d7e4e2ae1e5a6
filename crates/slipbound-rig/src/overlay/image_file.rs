//! Images as files: PNG in a folder, or frames of a Motion-JPEG video.

use crate::avi_writer::{self, AviWriter};
use crate::file_origin;
use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use slipbound::image::SizePx;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
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

/// How an image is encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ImageKind {
    Png,
    Jpeg,
}

impl ImageKind {
    /// Appends the image: red, green, blue, rows without gaps. The error is the encoder's reason.
    pub fn encode(self, rgb: &[u8], size: SizePx, to: &mut Vec<u8>) -> Result<(), String> {
        match self {
            ImageKind::Png => encode_png(rgb, size, to).map_err(|e| e.to_string()),
            ImageKind::Jpeg => {
                let mut encoder = Encoder::new(to, JPEG_QUALITY);
                encoder.set_sampling_factor(SamplingFactor::F_2_1); // what players expect of Motion-JPEG
                let encoded = encoder.encode(rgb, size.width as u16, size.height as u16, ColorType::Rgb);
                encoded.map_err(|e| e.to_string())
            }
        }
    }
}

/// Where encoded images go: a folder, or a video.
#[derive(Debug)]
pub(super) struct ImageFile {
    path: PathBuf,
    video: Option<AviWriter>,
}

impl ImageFile {
    /// `to`: a name that ends in `.avi`, or a folder, which is created if missing and from which the images of an
    /// earlier overlay are removed.
    pub fn create(to: &Path, size: SizePx, rate_hz: u32, most_bytes: u64) -> Result<Self, Error> {
        let is_video = to.extension().is_some_and(|e| e.eq_ignore_ascii_case("avi"));
        let video = match is_video {
            true => Some(AviWriter::create(to, size, rate_hz)?.with_most_bytes(most_bytes)),
            false => {
                let failed = |source| Error::Write { path: to.to_owned(), source };
                fs::create_dir_all(to).map_err(failed)?;
                remove_older(to).map_err(failed)?;
                None
            }
        };
        Ok(ImageFile { path: to.to_owned(), video })
    }

    pub fn kind(&self) -> ImageKind {
        if self.video.is_some() { ImageKind::Jpeg } else { ImageKind::Png }
    }

    /// Writes the image of frame `seq`. Returns false when a video is full; it can still be finished.
    pub fn push(&mut self, encoded: &[u8], seq: u64) -> Result<bool, Error> {
        match &mut self.video {
            None => {
                let path = self.image(seq);
                fs::write(&path, encoded).map_err(|source| Error::Write { path, source })?;
                Ok(true)
            }
            Some(video) => match video.push(encoded) {
                Err(avi_writer::Error::TooLong { .. }) => Ok(false),
                written => Ok(written.map(|()| true)?),
            },
        }
    }

    /// The error of an image that an encoder refused.
    pub fn refused(&self, seq: u64, why: String) -> Error {
        let path = if self.video.is_some() { self.path.clone() } else { self.image(seq) };
        Error::Encode { path, seq, why }
    }

    /// Finishes a video.
    pub fn finish(self) -> Result<(), Error> {
        Ok(self.video.map_or(Ok(()), AviWriter::finish)?)
    }

    fn image(&self, seq: u64) -> PathBuf {
        self.path.join(format!("{seq:06}.png"))
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

/// Writes a PNG.
pub(crate) fn write_png(path: &Path, rgb: &[u8], size: SizePx) -> Result<(), Error> {
    let failed = |source| Error::Write { path: path.to_owned(), source };
    let to = BufWriter::new(File::create(path).map_err(failed)?);
    encode_png(rgb, size, to).map_err(|e| match e {
        png::EncodingError::IoError(source) => failed(source),
        other => Error::Encode { path: path.to_owned(), seq: 0, why: other.to_string() },
    })
}

fn encode_png(rgb: &[u8], size: SizePx, to: impl Write) -> Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(to, size.width as u32, size.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    encoder.add_text_chunk("Software".into(), "slipbound".into())?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb)?;
    writer.finish()
}
