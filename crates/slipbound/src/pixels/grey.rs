//! Camera pixels, colour or grey, perhaps mirrored -> one grey byte per pixel, rows without a gap, mirror undone.

use crate::image::{Gray, Rgb};
use crate::sensor::Flip;
use std::ops::Range;

/// Weights of red, green and blue as 16-bit fractions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GreyWeights {
    rgb_65536ths: [u32; 3],
}

impl GreyWeights {
    /// Rounds weights of red, green and blue, each in 0..=1 and together at most 1, to 1/65536. Values outside are
    /// clamped, so that a grey level never overflows.
    pub fn new(weights_rgb: [f64; 3]) -> Self {
        let mut left = 65536;
        let rgb_65536ths = weights_rgb.map(|w| {
            let q = ((w.clamp(0.0, 1.0) * 65536.0).round() as u32).min(left);
            left -= q;
            q
        });
        GreyWeights { rgb_65536ths }
    }
}

/// Weighted mean of the colours, rounded to the nearest level, an exact half upwards. (cv2.transform rounds an exact
/// half to the even level: where the two differ, they differ by one level.)
pub fn grey_from_rgb(src: Rgb<'_>, weights: &GreyWeights, flip: Flip, out: &mut [u8]) {
    grey_rows_from_rgb(src, weights, flip, 0..src.size().height, out);
}

/// The same for the camera's rows `rows` only; `out` is the whole image, whose other rows are kept.
pub fn grey_rows_from_rgb(src: Rgb<'_>, weights: &GreyWeights, flip: Flip, rows: Range<usize>, out: &mut [u8]) {
    let size = src.size();
    assert_eq!(out.len(), size.area(), "output of another size than the picture");
    let (rows_turned, columns_turned) = turned(flip);
    let weights_65536ths = src.order().rgb(weights.rgb_65536ths); // integers: the order of a sum changes nothing
    let products = Products::new(weights_65536ths);
    for y in rows {
        let to = if rows_turned { size.height - 1 - y } else { y };
        let out = &mut out[to * size.width..][..size.width];
        grey_row(src.bytes_from(y), &products, out);
        if columns_turned {
            out.reverse();
        }
    }
}

/// Copies the camera's rows `rows` of a grey image, the mirror undone; `out` is the whole image, whose other rows are
/// kept.
pub fn grey_rows_from_gray(src: Gray<'_>, flip: Flip, rows: Range<usize>, out: &mut [u8]) {
    let size = src.size();
    assert_eq!(out.len(), size.area(), "output of another size than the picture");
    let (rows_turned, columns_turned) = turned(flip);
    for y in rows {
        let to = if rows_turned { size.height - 1 - y } else { y };
        let out = &mut out[to * size.width..][..size.width];
        out.copy_from_slice(src.row(y));
        if columns_turned {
            out.reverse();
        }
    }
}

/// Whether rows and whether columns are in reverse order.
fn turned(flip: Flip) -> (bool, bool) {
    match flip {
        Flip::None => (false, false),
        Flip::Vertical => (true, false),
        Flip::Horizontal => (false, true),
        Flip::Both => (true, true),
    }
}

/// The weights, and on x86-64 their layouts for vectors.
struct Products {
    weights_65536ths: [u32; 3],
    #[cfg(target_arch = "x86_64")]
    four: avx2::Products,
    /// None on CPUs without the features of [`avx512::grey_row`].
    #[cfg(target_arch = "x86_64")]
    wide: Option<avx512::Products>,
}

impl Products {
    fn new(weights_65536ths: [u32; 3]) -> Self {
        Products {
            weights_65536ths,
            #[cfg(target_arch = "x86_64")]
            four: avx2::Products::new(weights_65536ths),
            #[cfg(target_arch = "x86_64")]
            wide: (super::wide::vectors() >= super::wide::Vectors::Avx512Vnni)
                .then(|| avx512::Products::new(weights_65536ths)),
        }
    }
}

/// A row of pixels; `row` may be longer, best by sixteen bytes. The twin of [`avx2::grey_row`] and
/// [`avx512::grey_row`], which give the same bits.
fn grey_row(row: &[u8], products: &Products, out: &mut [u8]) {
    let mut done = 0;
    #[cfg(target_arch = "x86_64")]
    if let Some(products) = &products.wide {
        // SAFETY: without the four features the kernel needs, which this CPU has been found to have, there are no
        // products for it.
        #[allow(unsafe_code)]
        let wide = unsafe { avx512::grey_row(row, products, out) };
        done = wide;
    }
    #[cfg(target_arch = "x86_64")]
    if super::wide::vectors() >= super::wide::Vectors::Avx2 {
        // SAFETY: the CPU this runs on has just been found to have AVX2, the one feature the kernel needs.
        #[allow(unsafe_code)]
        let more = unsafe { avx2::grey_row(&row[3 * done..], &products.four, &mut out[done..]) };
        done += more;
    }
    grey_pixels(&row[3 * done..], products.weights_65536ths, &mut out[done..]);
}

fn grey_pixels(row: &[u8], [r, g, b]: [u32; 3], out: &mut [u8]) {
    for (out, p) in out.iter_mut().zip(row.as_chunks::<3>().0) {
        *out = ((u32::from(p[0]) * r + u32::from(p[1]) * g + u32::from(p[2]) * b + 32768) >> 16) as u8;
    }
}

/// The largest weight of one product of signed numbers.
#[cfg(target_arch = "x86_64")]
const MOST: u32 = i16::MAX as u32;

/// Four products per pixel: which of its bytes (255: none), and the weights in 65536ths. A weight above [`MOST`] is
/// split over several; as they sum to at most 65536, four suffice.
#[cfg(target_arch = "x86_64")]
fn four_products(weights_65536ths: [u32; 3]) -> [(u8, u32); 4] {
    let mut four = [(u8::MAX, 0u32); 4];
    let mut free = four.iter_mut();
    for (byte, mut left) in (0..).zip(weights_65536ths) {
        while let Some(product) = if left > 0 { free.next() } else { None } {
            *product = (byte, left.min(MOST));
            left -= product.1;
        }
    }
    four
}

/// How far ahead a frame is fetched, bytes: it comes from a camera or a decoder and is not in the nearer caches.
#[cfg(target_arch = "x86_64")]
const AHEAD_BYTES: usize = 3072;

/// Compilers vectorise three bytes per pixel poorly: explicit intrinsics take half the time.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{AHEAD_BYTES, four_products};
    use crate::pixels::lanes::prefetch;
    use std::arch::x86_64::*;

    /// Pixels per round, and the bytes it reads: the last eight pixels are read with four bytes to spare.
    const PIXELS: usize = 32;
    const READ_BYTES: usize = 3 * PIXELS + 4;

    /// The products in two pairs.
    pub(super) struct Products {
        /// For each pair, the byte positions of four pixels, each before a zero.
        places: [[i32; 4]; 2],
        weights: [i32; 2],
    }

    impl Products {
        pub(super) fn new(weights_65536ths: [u32; 3]) -> Self {
            // A position of 255 gives a zero.
            let place = |byte: u8, pixel: u8| if byte == u8::MAX { byte } else { byte + 3 * pixel };
            let pixels = |a: u8, b: u8| [0, 1, 2, 3].map(|p| i32::from_le_bytes([place(a, p), 255, place(b, p), 255]));
            let [a, b, c, d] = four_products(weights_65536ths);
            Products {
                places: [pixels(a.0, b.0), pixels(c.0, d.0)],
                weights: [(a, b), (c, d)].map(|(a, b)| (a.1 | b.1 << 16) as i32),
            }
        }
    }

    /// ```text
    ///   8 pixels, 12 bytes a lane:   r g b r g b r g b r g b      --shuffle--> (r g) (r g) ..   and (b g) (b g) .. , 16 bits each
    ///                                r g . weights + b g . weights + 1/2, of which the upper half is kept
    /// ```
    /// Returns how many pixels are done; the remainder is too short for a round, or has too few bytes to read.
    #[target_feature(enable = "avx2")]
    pub(super) fn grey_row(row: &[u8], products: &Products, out: &mut [u8]) -> usize {
        let [first_places, second_places] = products.places.map(|[a, b, c, d]| twice(_mm_setr_epi32(a, b, c, d)));
        let [first_weights, second_weights] = products.weights.map(|pair| _mm256_set1_epi32(pair));
        let half = _mm256_set1_epi32(32768);
        let in_order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
        let mut at = 0;
        while at + PIXELS <= out.len() && 3 * at + READ_BYTES <= row.len() {
            let bytes = &row[3 * at..][..READ_BYTES];
            (0..3 * PIXELS).step_by(64).for_each(|line| prefetch(bytes, AHEAD_BYTES + line));
            let mut eights = [_mm256_setzero_si256(); 4];
            for (k, eight) in eights.iter_mut().enumerate() {
                let pixels = load(&bytes[24 * k..], &bytes[24 * k + 12..]);
                let first = _mm256_madd_epi16(_mm256_shuffle_epi8(pixels, first_places), first_weights);
                let second = _mm256_madd_epi16(_mm256_shuffle_epi8(pixels, second_places), second_weights);
                let sum = _mm256_add_epi32(_mm256_add_epi32(first, second), half);
                *eight = _mm256_srli_epi32(sum, 16);
            }
            let [a, b, c, d] = eights;
            let bytes = _mm256_packus_epi16(_mm256_packus_epi32(a, b), _mm256_packus_epi32(c, d));
            store(_mm256_permutevar8x32_epi32(bytes, in_order), &mut out[at..at + PIXELS]);
            at += PIXELS;
        }
        at
    }

    #[target_feature(enable = "avx2")]
    fn twice(lane: __m128i) -> __m256i {
        _mm256_set_m128i(lane, lane)
    }

    /// 16 bytes of each, the first in the lower lane.
    #[target_feature(enable = "avx2")]
    fn load(lower: &[u8], upper: &[u8]) -> __m256i {
        let number = |bytes: &[u8], at: usize| {
            let mut eight = [0; 8];
            eight.copy_from_slice(&bytes[at..at + 8]);
            i64::from_le_bytes(eight)
        };
        _mm256_setr_epi64x(number(lower, 0), number(lower, 8), number(upper, 0), number(upper, 8))
    }

    #[target_feature(enable = "avx2")]
    fn store(from: __m256i, to: &mut [u8]) {
        let numbers = [
            _mm256_extract_epi64::<0>(from),
            _mm256_extract_epi64::<1>(from),
            _mm256_extract_epi64::<2>(from),
            _mm256_extract_epi64::<3>(from),
        ];
        for (to, number) in to.as_chunks_mut::<8>().0.iter_mut().zip(numbers) {
            *to = number.to_le_bytes();
        }
    }
}

/// Two thirds fewer instructions than [`avx2`]: bytes go to any place of a vector in one step, and products are added
/// as they are made.
#[cfg(target_arch = "x86_64")]
mod avx512 {
    use super::{AHEAD_BYTES, four_products};
    use crate::pixels::lanes::{load, prefetch, store};
    use std::arch::x86_64::*;

    /// Pixels per round, and the bytes it reads: each sixteen pixels are read with sixteen bytes to spare.
    const PIXELS: usize = 64;
    const READ_BYTES: usize = 3 * PIXELS + 16;

    /// The products in two pairs.
    pub(super) struct Products {
        /// For each pair, the byte positions of sixteen pixels, each before a zero; bits of the positions that are not
        /// zeros.
        places: [[u8; 64]; 2],
        filled: [u64; 2],
        weights: [i32; 2],
    }

    impl Products {
        pub(super) fn new(weights_65536ths: [u32; 3]) -> Self {
            let [a, b, c, d] = four_products(weights_65536ths);
            let (mut places, mut filled) = ([[0; 64]; 2], [0; 2]);
            for (k, pair) in [[a, b], [c, d]].iter().enumerate() {
                for (at, byte) in (0..16).flat_map(|pixel| [(4 * pixel, pair[0].0), (4 * pixel + 2, pair[1].0)]) {
                    if byte != u8::MAX {
                        places[k][at] = 3 * (at / 4) as u8 + byte;
                        filled[k] |= 1 << at;
                    }
                }
            }
            Products { places, filled, weights: [(a, b), (c, d)].map(|(a, b)| (a.1 | b.1 << 16) as i32) }
        }
    }

    /// ```text
    ///   16 pixels, 48 bytes:   r g b r g b ..   --permute-->   (r g) (r g) ..   and (b g) (b g) .. , 16 bits each
    ///                          1/2 + r g . weights + b g . weights, of which the third byte is kept
    /// ```
    /// Returns how many pixels are done; the remainder is too short for a round, or has too few bytes to read.
    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi,avx512vnni")]
    pub(super) fn grey_row(row: &[u8], products: &Products, out: &mut [u8]) -> usize {
        let places = products.places.map(|places| load(&places));
        let weights = products.weights.map(|pair| _mm512_set1_epi32(pair));
        let half = _mm512_set1_epi32(32768);
        // The third byte of each sum of two vectors.
        let third: [u8; 64] = std::array::from_fn(|i| (4 * (i % 32) + 2) as u8);
        let third = load(&third);
        let (rounds, _) = out.as_chunks_mut::<PIXELS>();
        let mut done = 0;
        for out in rounds {
            let Some(bytes) = row.get(3 * done..).and_then(|row| row.first_chunk::<READ_BYTES>()) else { break };
            (0..3 * PIXELS).step_by(64).for_each(|line| prefetch(bytes, AHEAD_BYTES + line));
            let mut sums = [half; 4];
            for (k, sum) in sums.iter_mut().enumerate() {
                let Some(pixels) = bytes[48 * k..].first_chunk() else { break };
                let pixels = load(pixels);
                for ((places, filled), weights) in places.iter().zip(products.filled).zip(&weights) {
                    let pairs = _mm512_maskz_permutexvar_epi8(filled, *places, pixels);
                    *sum = _mm512_dpwssd_epi32(*sum, pairs, *weights);
                }
            }
            let [a, b, c, d] = sums;
            let upper = _mm512_castsi512_si256(_mm512_permutex2var_epi8(c, third, d));
            store(_mm512_inserti64x4::<1>(_mm512_permutex2var_epi8(a, third, b), upper), out);
            done += PIXELS;
        }
        done
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::SizePx;

    const PICTURE: [u8; 18] = [10, 20, 30, 40, 50, 60, 70, 80, 90, 1, 2, 255, 0, 0, 0, 255, 255, 255];

    fn grey(weights_rgb: [f64; 3], flip: Flip) -> [u8; 6] {
        let mut out = [0; 6];
        let src = Rgb::new(&PICTURE, SizePx::new(3, 2)).expect("long enough");
        grey_from_rgb(src, &GreyWeights::new(weights_rgb), flip, &mut out);
        out
    }

    #[test]
    fn weighs_and_rounds_half_upwards() {
        assert_eq!(grey([0.0, 0.5, 0.5], Flip::None), [25, 55, 85, 129, 0, 255]); // (2 + 255) / 2 = 128.5
        assert_eq!(grey([0.3, 0.7, 0.0], Flip::None), [17, 47, 77, 2, 0, 255]);
        let third = 1.0 / 3.0;
        assert_eq!(grey([third, third, third], Flip::None)[5], 255, "weights that round up to more than 1");
        assert_eq!(grey([1.0, 1.0, 1.0], Flip::None)[3], 1, "the sum is held at 1");
    }

    #[test]
    fn blue_green_red_gives_the_same_grey() {
        use crate::image::ByteOrder;
        let mut bgr = PICTURE;
        bgr.as_chunks_mut::<3>().0.iter_mut().for_each(|p| p.reverse());
        let mut out = [0; 6];
        let src = Rgb::new(&bgr, SizePx::new(3, 2)).expect("long enough").in_order(ByteOrder::Bgr);
        for weights_rgb in [[0.0, 0.5, 0.5], [0.3, 0.7, 0.0]] {
            grey_from_rgb(src, &GreyWeights::new(weights_rgb), Flip::None, &mut out);
            assert_eq!(out, grey(weights_rgb, Flip::None));
        }
    }

    #[test]
    fn every_row_length_follows_the_formula() {
        for (width, weights) in [(31, [0.3, 0.7, 0.0]), (64, [0.299, 0.587, 0.114]), (100, [0.0, 0.0, 1.0])] {
            let size = SizePx::new(width, 2);
            let rgb: Vec<u8> = (0..6 * width as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
            let mut out = vec![0; size.area()];
            let src = Rgb::new(&rgb, size).expect("long enough");
            grey_from_rgb(src, &GreyWeights::new(weights), Flip::None, &mut out);
            for (p, &got) in rgb.chunks(3).zip(&out) {
                let exact: f64 = p.iter().zip(weights).map(|(&v, w)| f64::from(v) * w).sum();
                assert!((f64::from(got) - exact).abs() < 0.51, "{p:?}: {got} for {exact}");
            }
        }
    }

    #[test]
    fn wide_rows_have_the_bits_of_plain_ones() {
        use crate::pixels::wide::{Vectors, with_vectors};
        for (width, weights) in [
            (33, [0.3, 0.7, 0.0]),
            (640, [0.299, 0.587, 0.114]),
            (641, [1.0, 0.0, 0.0]),
            (95, [0.0, 0.0, 1.0]),
            (64, [0.5, 0.0, 0.5]),
            (96, [0.0, 0.5, 0.5]),
            (128, [0.2, 0.5, 0.3]),
            (65, [1e-5, 0.99998, 0.0]),
        ] {
            let row: Vec<u8> = (0..3 * width as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
            let weights = GreyWeights::new(weights).rgb_65536ths;
            let mut plain = vec![1; width];
            grey_pixels(&row, weights, &mut plain);
            for vectors in [Vectors::Avx512Vnni, Vectors::Avx2, Vectors::Baseline] {
                let grey_row = |row: &[u8], out: &mut [u8]| {
                    with_vectors(vectors, || grey_row(row, &Products::new(weights), out));
                };
                let mut wide = vec![0; width];
                grey_row(&row, &mut wide);
                assert_eq!(wide, plain, "{width} pixels, {vectors:?}");
                // As many pixels as requested, however long the row is.
                let count = 64.min(width);
                grey_row(&row, &mut wide[..count]);
                grey_row(&vec![255; 3 * count], &mut wide[..count]);
                assert!(wide[..count].iter().all(|&v| v >= 254), "a white row that ends with its last pixel");
                assert_eq!(wide[count..], plain[count..], "{width} pixels, {vectors:?}: written beyond the end");
            }
        }
    }

    #[test]
    fn flips_put_each_pixel_where_it_belongs() {
        let red = [1.0, 0.0, 0.0];
        assert_eq!(grey(red, Flip::None), [10, 40, 70, 1, 0, 255]);
        assert_eq!(grey(red, Flip::Vertical), [1, 0, 255, 10, 40, 70]);
        assert_eq!(grey(red, Flip::Horizontal), [70, 40, 10, 255, 0, 1]);
        assert_eq!(grey(red, Flip::Both), [255, 0, 1, 70, 40, 10]);
    }

    #[test]
    fn grey_is_copied_with_its_stride_and_flip() {
        let padded = [1, 2, 3, 99, 4, 5, 6];
        let src = Gray::with_stride(&padded, SizePx::new(3, 2), 4).expect("long enough");
        let mut out = [0; 6];
        for (flip, expected) in [
            (Flip::None, [1, 2, 3, 4, 5, 6]),
            (Flip::Vertical, [4, 5, 6, 1, 2, 3]),
            (Flip::Horizontal, [3, 2, 1, 6, 5, 4]),
            (Flip::Both, [6, 5, 4, 3, 2, 1]),
        ] {
            grey_rows_from_gray(src, flip, 0..2, &mut out);
            assert_eq!(out, expected);
        }
    }
}
