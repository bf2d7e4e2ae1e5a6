//! Borrowed pixels with a stride, and the bit-packed mask.

use crate::plane::Vec2;
use std::fmt;
use std::ops::Range;

/// Why a pixel buffer was refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ImageError {
    /// Width or height is zero.
    Empty,
    /// The buffer is shorter than its size and stride require.
    TooShort {
        /// Bytes that the size and stride require.
        expected_bytes: usize,
        /// Bytes there are.
        got_bytes: usize,
    },
    /// A row is longer than the stride between rows.
    StrideTooSmall {
        /// Bytes of one row.
        expected_bytes: usize,
        /// The stride given.
        got_bytes: usize,
    },
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ImageError::Empty => write!(f, "the image has no pixels"),
            ImageError::TooShort { expected_bytes, got_bytes } => {
                write!(f, "pixel buffer too short: expected {expected_bytes} bytes, got {got_bytes}")
            }
            ImageError::StrideTooSmall { expected_bytes, got_bytes } => {
                write!(f, "stride too small: expected at least {expected_bytes} bytes, got {got_bytes}")
            }
        }
    }
}

impl std::error::Error for ImageError {}

/// Size of an image in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(into = "[usize; 2]", from = "[usize; 2]")]
pub struct SizePx {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl SizePx {
    /// A size of `width` x `height` pixels.
    pub const fn new(width: usize, height: usize) -> Self {
        SizePx { width, height }
    }

    /// Number of pixels.
    pub const fn area(self) -> usize {
        self.width * self.height
    }

    /// Whether one of the two stands upright and the other does not: turned by 90 degrees they might be the same.
    pub fn is_turned_from(self, other: SizePx) -> bool {
        self.width != self.height && self.width.cmp(&self.height) == other.height.cmp(&other.width)
    }
}

impl From<[usize; 2]> for SizePx {
    fn from([width, height]: [usize; 2]) -> Self {
        SizePx { width, height }
    }
}

impl From<SizePx> for [usize; 2] {
    fn from(s: SizePx) -> Self {
        [s.width, s.height]
    }
}

impl fmt::Display for SizePx {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// Byte order of a colour pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ByteOrder {
    /// Red, green, blue.
    #[default]
    Rgb,
    /// Blue, green, red, as in OpenCV.
    Bgr,
}

impl ByteOrder {
    /// Three values in the order of the bytes as red, green, blue, or the other way round.
    pub const fn rgb<T: Copy>(self, [a, b, c]: [T; 3]) -> [T; 3] {
        match self {
            ByteOrder::Rgb => [a, b, c],
            ByteOrder::Bgr => [c, b, a],
        }
    }
}

/// Pixels of one byte (`CHANNELS` = 1) or three bytes (`CHANNELS` = 3), rows `stride` bytes apart.
#[derive(Debug, Clone, Copy)]
pub struct Interleaved<'a, const CHANNELS: usize> {
    bytes: &'a [u8],
    size: SizePx,
    stride: usize,
    order: ByteOrder,
}

/// Grey pixels, one byte each, 0 black to 255 white.
pub type Gray<'a> = Interleaved<'a, 1>;
/// Colour pixels, bytes in the order red, green, blue, unless [`Rgb::in_order`] says otherwise.
pub type Rgb<'a> = Interleaved<'a, 3>;

impl<'a, const CHANNELS: usize> Interleaved<'a, CHANNELS> {
    /// Wraps a buffer whose rows follow each other without a gap.
    pub fn new(bytes: &'a [u8], size: SizePx) -> Result<Self, ImageError> {
        Self::with_stride(bytes, size, size.width * CHANNELS)
    }

    /// Wraps a buffer whose rows start `stride_bytes` apart. The last row need not be padded.
    pub fn with_stride(bytes: &'a [u8], size: SizePx, stride_bytes: usize) -> Result<Self, ImageError> {
        if size.area() == 0 {
            return Err(ImageError::Empty);
        }
        let row = size.width * CHANNELS;
        if stride_bytes < row {
            return Err(ImageError::StrideTooSmall { expected_bytes: row, got_bytes: stride_bytes });
        }
        let expected_bytes = stride_bytes * (size.height - 1) + row;
        if bytes.len() < expected_bytes {
            return Err(ImageError::TooShort { expected_bytes, got_bytes: bytes.len() });
        }
        Ok(Interleaved { bytes, size, stride: stride_bytes, order: ByteOrder::Rgb })
    }

    /// Width and height.
    pub fn size(&self) -> SizePx {
        self.size
    }

    /// The bytes of row `y`, `width * CHANNELS` of them; those of a colour pixel in the order of [`Rgb::order`].
    pub fn row(&self, y: usize) -> &'a [u8] {
        &self.bytes[y * self.stride..][..self.size.width * CHANNELS]
    }

    /// The bytes from row `y` to the end of the buffer.
    pub(crate) fn bytes_from(&self, y: usize) -> &'a [u8] {
        &self.bytes[y * self.stride..]
    }
}

impl Rgb<'_> {
    /// The same pixels with their bytes interpreted in this order. Reports do not depend on the order.
    #[must_use]
    pub fn in_order(self, order: ByteOrder) -> Self {
        Interleaved { order, ..self }
    }

    /// The order of the bytes of a pixel.
    pub fn order(&self) -> ByteOrder {
        self.order
    }
}

/// What a camera delivers.
#[derive(Debug, Clone, Copy)]
pub enum Pixels<'a> {
    /// One byte a pixel.
    Gray(Gray<'a>),
    /// Three bytes a pixel.
    Rgb(Rgb<'a>),
}

impl Pixels<'_> {
    /// Width and height.
    pub fn size(&self) -> SizePx {
        match self {
            Pixels::Gray(g) => g.size(),
            Pixels::Rgb(c) => c.size(),
        }
    }
}

/// One camera frame, with the number and time its source gave it.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// The image as the camera delivers it, before any flip or rectification.
    pub pixels: Pixels<'a>,
    /// The source's running number; a gap means frames that never arrived.
    pub seq: u64,
    /// Time of exposure in nanoseconds on the source's clock; None where the source knows none.
    pub time_ns: Option<u64>,
}

/// A binary image, one bit a pixel, rows padded to whole 64-bit words; bit x % 64 of word x / 64 is column x.
/// Bits beyond the width are always zero.
#[derive(Clone, PartialEq, Eq)]
pub struct Mask {
    size: SizePx,
    words_per_row: usize,
    words: Vec<u64>,
}

/// The columns of a word whose index has a given binary digit set, and the value of that digit.
const COLUMN_BITS: [(usize, u64); 6] = [
    (1, 0xaaaa_aaaa_aaaa_aaaa),
    (2, 0xcccc_cccc_cccc_cccc),
    (4, 0xf0f0_f0f0_f0f0_f0f0),
    (8, 0xff00_ff00_ff00_ff00),
    (16, 0xffff_0000_ffff_0000),
    (32, 0xffff_ffff_0000_0000),
];

/// Whether the set bits of a non-zero word are adjacent.
fn is_run(word: u64) -> bool {
    let above = word.wrapping_add(word & word.wrapping_neg());
    above & word == 0
}

/// Number of set bits. Most words of a region are full or empty, and the baseline instruction set cannot count bits.
fn ones_count(word: u64) -> usize {
    match word {
        0 => 0,
        u64::MAX => 64,
        _ if is_run(word) => 64 - word.leading_zeros() as usize - word.trailing_zeros() as usize,
        _ => word.count_ones() as usize,
    }
}

/// Sum of the indices of the set bits.
fn columns_sum(word: u64) -> usize {
    match word {
        u64::MAX => 64 * 63 / 2,
        0 => 0,
        // A single run, as in most words at a border.
        _ if is_run(word) => {
            let (first, count) = (word.trailing_zeros() as usize, ones_count(word));
            count * first + count * (count - 1) / 2
        }
        _ => COLUMN_BITS.iter().map(|(weight, columns)| weight * (word & columns).count_ones() as usize).sum(),
    }
}

impl Mask {
    /// An empty mask.
    pub fn new(size: SizePx) -> Self {
        let words_per_row = size.width.div_ceil(64);
        Mask { size, words_per_row, words: vec![0; words_per_row * size.height] }
    }

    /// Width and height.
    pub fn size(&self) -> SizePx {
        self.size
    }

    /// Whether pixel (x, y) is set; false outside the image.
    pub fn get(&self, x: isize, y: isize) -> bool {
        if x < 0 || y < 0 || x as usize >= self.size.width || y as usize >= self.size.height {
            return false;
        }
        let (x, y) = (x as usize, y as usize);
        self.words[y * self.words_per_row + x / 64] >> (x % 64) & 1 == 1
    }

    /// Sets or clears pixel (x, y). Panics outside the image, like an index of a slice.
    pub fn set(&mut self, x: usize, y: usize, on: bool) {
        assert!(x < self.size.width && y < self.size.height, "pixel ({x}, {y}) outside {}", self.size);
        let bit = 1u64 << (x % 64);
        let word = &mut self.words[y * self.words_per_row + x / 64];
        *word = if on { *word | bit } else { *word & !bit };
    }

    /// Clears every pixel.
    pub fn clear(&mut self) {
        self.words.fill(0);
    }

    /// A mask with every pixel set.
    pub fn full(size: SizePx) -> Self {
        let mut mask = Mask::new(size);
        let last = mask.last_word();
        for row in mask.words.chunks_exact_mut(mask.words_per_row.max(1)) {
            row.fill(u64::MAX);
            if let Some(word) = row.last_mut() {
                *word = last;
            }
        }
        mask
    }

    /// Clears a rectangle, which must lie within the image.
    pub fn clear_rectangle(&mut self, columns: Range<usize>, rows: Range<usize>) {
        for y in rows {
            columns.clone().for_each(|x| self.set(x, y, false));
        }
    }

    /// Takes over the pixels of a mask of the same size.
    pub fn copy_from(&mut self, other: &Mask) {
        assert_eq!(self.size, other.size, "masks differ in size");
        self.words.copy_from_slice(&other.words);
    }

    /// Number of pixels set.
    pub fn area_px2(&self) -> usize {
        self.words.iter().map(|&word| ones_count(word)).sum()
    }

    /// Mean position of the set pixels, px; None for an empty mask.
    pub fn middle_px(&self) -> Option<Vec2> {
        let (mut sum_x, mut sum_y, mut count) = (0, 0, 0);
        for (y, row) in self.words.chunks_exact(self.words_per_row.max(1)).enumerate() {
            for (at, word) in row.iter().enumerate().filter(|(_, word)| **word != 0) {
                let ones = ones_count(*word);
                sum_x += 64 * at * ones + columns_sum(*word);
                sum_y += y * ones;
                count += ones;
            }
        }
        (count > 0).then(|| Vec2::new(sum_x as f64, sum_y as f64) / count as f64)
    }

    /// The words of row `y`.
    pub fn row(&self, y: usize) -> &[u64] {
        &self.words[y * self.words_per_row..][..self.words_per_row]
    }

    /// The words of row `y`, to write. Bits beyond the width must stay zero.
    pub(crate) fn row_mut(&mut self, y: usize) -> &mut [u64] {
        &mut self.words[y * self.words_per_row..][..self.words_per_row]
    }

    /// All words, row by row.
    pub(crate) fn words(&self) -> &[u64] {
        &self.words
    }

    /// All words, row by row, to write. Bits beyond the width must stay zero.
    pub(crate) fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// Which bits of the last word of a row lie inside the image.
    pub(crate) fn last_word(&self) -> u64 {
        match self.size.width % 64 {
            0 => u64::MAX,
            n => (1 << n) - 1,
        }
    }

    /// Parses a text drawing of `.` (clear) and any other character (set), one line per row: the form in which tests
    /// write masks.
    ///
    /// # Panics
    /// If the lines differ in length.
    pub fn from_picture(picture: &str) -> Self {
        let rows: Vec<&str> = picture.lines().map(str::trim).filter(|l| !l.is_empty()).collect();
        let width = rows.first().map_or(0, |r| r.len());
        let mut mask = Mask::new(SizePx::new(width, rows.len()));
        for (y, row) in rows.iter().enumerate() {
            assert_eq!(row.len(), width, "row {y} of the picture has another length");
            for (x, sign) in row.bytes().enumerate() {
                mask.set(x, y, sign != b'.');
            }
        }
        mask
    }
}

/// The mask as a text drawing of `.` and `#`.
impl fmt::Debug for Mask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for y in 0..self.size.height {
            for x in 0..self.size.width {
                f.write_str(if self.get(x as isize, y as isize) { "#" } else { "." })?;
            }
            f.write_str("\n")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn full_words_count_as_the_pixels_they_are() {
        let mut mask = Mask::full(SizePx::new(192, 3));
        assert_eq!((mask.area_px2(), mask.middle_px()), (576, Some(Vec2::new(95.5, 1.0))));
        (0..3).for_each(|y| mask.set(191, y, false));
        assert_eq!((mask.area_px2(), mask.middle_px()), (573, Some(Vec2::new(95.0, 1.0))));
    }

    proptest! {
        #[test]
        fn the_middle_is_the_mean_place(
            width in 1usize..200, height in 1usize..5, seed in 1u64.., run in proptest::option::of((0usize..200, 1usize..150)),
        ) {
            let mut mask = Mask::new(SizePx::new(width, height));
            let (mut state, mut sum, mut count) = (seed, Vec2::ZERO, 0.0);
            for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
                state = crate::random::next(state);
                if run.map_or(state >> 62 == 0, |(first, length)| (first..first + length).contains(&x)) {
                    mask.set(x, y, true);
                    (sum, count) = (sum + Vec2::new(x as f64, y as f64), count + 1.0);
                }
            }
            prop_assert_eq!(mask.area_px2() as f64, count);
            match mask.middle_px() {
                Some(middle) => prop_assert!((middle - sum / count).length() < 1e-9),
                None => prop_assert_eq!(count, 0.0),
            }
        }
    }
}
