//! An image twice: in full size, as a PNG file, and small, as a JPEG for the page.

use crate::html_page::picture;
use crate::run::error::Error;
use slipbound::image::Rgb;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

/// Writes the PNG; returns the JPEG.
pub(in crate::run) fn write(path: &Path, rgb: Rgb<'_>) -> Result<Vec<u8>, Error> {
    let size = rgb.size();
    let pixels = (0..size.height).flat_map(|y| rgb.row(y).as_chunks::<3>().0);
    let bytes: Vec<u8> = pixels.flat_map(|pixel| rgb.order().rgb(*pixel)).collect();
    let failed = |source| Error::Write { path: path.to_owned(), source };
    let refused = |why: String| Error::Encode { path: path.to_owned(), why };
    let file = BufWriter::new(File::create(path).map_err(failed)?);
    let mut encoder = png::Encoder::new(file, size.width as u32, size.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    let written = encoder.write_header().and_then(|mut w| {
        w.write_image_data(&bytes)?;
        w.finish()
    });
    written.map_err(|e| match e {
        png::EncodingError::IoError(source) => failed(source),
        other => refused(other.to_string()),
    })?;
    picture::jpeg(&bytes, size.width as u32, size.height as u32).map_err(refused)
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::image::SizePx;
    use zune_core::bytestream::ZCursor;
    use zune_jpeg::JpegDecoder;

    #[test]
    fn the_file_is_whole_and_the_page_gets_a_smaller_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let (path, size) = (folder.path().join("a.png"), SizePx::new(2000, 30));
        let bytes: Vec<u8> = [200, 100, 50].repeat(size.area());
        let jpeg = write(&path, Rgb::new(&bytes, size).expect("whole")).expect("writes");
        let file = std::io::BufReader::new(File::open(&path).expect("opens"));
        let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("fits")];
        reader.next_frame(&mut pixels).expect("decodes");
        assert_eq!(pixels, bytes);
        let mut decoder = JpegDecoder::new(ZCursor::new(jpeg.as_slice()));
        let pixels = decoder.decode().expect("a JPEG");
        assert_eq!(decoder.dimensions(), Some((1000, 15)));
        let middle = &pixels[3 * (7 * 1000 + 500)..][..3];
        assert!(middle.iter().zip([200u8, 100, 50]).all(|(got, wanted)| got.abs_diff(wanted) <= 3), "{middle:?}");
    }
}
