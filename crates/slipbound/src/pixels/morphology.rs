//! Mask -> mask dilated or eroded by an element, 64 pixels at a time.
//!
//! ```text
//!   element, a stack of chords         the whole source, grown step by step from the narrowest chord
//!     . . # . .   [ 0, 0]              to the widest; after each step it is added to the output, shifted
//!     # # # # #   [-2, 2]              by each row that has that chord. Rows of the widest chord are doubled
//!     # # o # #   [-2, 2]  o anchor    first: two, four, eight of them at once
//!     # # # # #   [-2, 2]
//!     . . # . .   [ 0, 0]
//! ```
//! Shapes, anchor (w/2, h/2) and border are those of cv2.getStructuringElement, cv2.dilate and cv2.erode: pixels
//! outside the image have no effect, and an even element is not mirrored between the two.

pub use super::element::Element;

use super::wide::wide;
use crate::image::{Mask, SizePx};

/// Padding words beside a row for the part of a chord outside the image.
const MAX_PAD_WORDS: usize = 8;
/// Maximum number of neighbouring rows of one chord that are combined by doubling.
const MOST_DOUBLED_ROWS: usize = 64;

/// The scratch memory of the four operations.
#[derive(Debug, Clone)]
pub struct Morphology {
    size: SizePx,
    between: Mask,
    spread: Spread,
}

/// Rows of bits with their padding: before and after a step, and the accumulated output.
#[derive(Debug, Clone)]
struct Spread {
    rows: Vec<u64>,
    rows_next: Vec<u64>,
    laid: Vec<u64>,
}

impl Morphology {
    /// Scratch memory for masks of `size`.
    pub fn new(size: SizePx) -> Self {
        let words = (size.width.div_ceil(64) + 2 * MAX_PAD_WORDS) * (size.height + MOST_DOUBLED_ROWS);
        let spread = Spread { rows: vec![0; words], rows_next: vec![0; words], laid: vec![0; words] };
        Morphology { size, between: Mask::new(size), spread }
    }

    /// Sets a pixel where the element, placed on it, contains a set pixel.
    pub fn dilate(&mut self, src: &Mask, element: &Element, out: &mut Mask) {
        self.check(src, out);
        self.spread.run(src, element, 0, out);
    }

    /// Sets a pixel where the element, placed on it, contains only set pixels, as far as it lies inside the image.
    pub fn erode(&mut self, src: &Mask, element: &Element, out: &mut Mask) {
        self.check(src, out);
        self.spread.run(src, element, u64::MAX, out);
    }

    /// Dilates, then erodes: closes gaps narrower than the element.
    pub fn close(&mut self, src: &Mask, element: &Element, out: &mut Mask) {
        self.check(src, out);
        self.spread.run(src, element, 0, &mut self.between);
        self.spread.run(&self.between, element, u64::MAX, out);
    }

    /// Erodes, then dilates: removes what is narrower than the element.
    pub fn open(&mut self, src: &Mask, element: &Element, out: &mut Mask) {
        self.check(src, out);
        self.spread.run(src, element, u64::MAX, &mut self.between);
        self.spread.run(&self.between, element, 0, out);
    }

    fn check(&self, src: &Mask, out: &Mask) {
        assert_eq!(src.size(), self.size, "mask of another size");
        assert_eq!(out.size(), self.size, "output mask of another size");
    }
}

impl Spread {
    /// Dilates; with `turn` all ones the clear pixels are dilated instead, which erodes the set ones.
    fn run(&mut self, src: &Mask, element: &Element, turn: u64, out: &mut Mask) {
        let (pad, words, height) = (element.pad_words, src.row(0).len(), src.size().height);
        let (stride, last_word) = (words + 2 * pad, src.last_word());
        // Only rows with spreading pixels matter.
        let holds = |y: &usize| {
            let row = src.row(*y).iter().enumerate();
            row.fold(0, |any, (i, &bits)| any | spreading(bits, turn, i, words, last_word)) != 0
        };
        let Some(first) = (0..height).find(&holds) else {
            for y in 0..height {
                let to = out.row_mut(y);
                to.fill(turn);
                to[words - 1] &= last_word;
            }
            return;
        };
        let end = (first..height).rev().find(holds).map_or(height, |last| last + 1);
        let count = (end - first) * stride;
        add_pads(&src.words()[first * words..end * words], words, pad, turn, last_word, &mut self.rows[..count]);
        let laid = &mut self.laid[..height * stride];
        laid.fill(0);
        let mut offsets = &element.rows[..];
        for (i, step) in element.steps.iter().enumerate() {
            if step.left + step.right > 0 {
                widen(&self.rows[..count], &mut self.rows_next[..count], step.left, step.right);
                std::mem::swap(&mut self.rows, &mut self.rows_next);
            }
            let (here, later) = offsets.split_at(step.rows);
            if i + 1 == element.steps.len() {
                lay(here, &mut self.rows, &mut self.rows_next, count, first, stride, laid);
            } else {
                here.iter().for_each(|dy| join_moved(&self.rows[..count], first as isize - dy, stride, laid));
            }
            offsets = later;
        }
        drop_pads(laid, words, pad, turn, last_word, out.words_mut());
    }
}

/// The spreading bits of word `i` of a row: none beyond the width of the image.
fn spreading(bits: u64, turn: u64, i: usize, words: usize, last_word: u64) -> u64 {
    (bits ^ turn) & if i + 1 == words { last_word } else { u64::MAX }
}

/// Adds the first `count` words of `rows`, whose first row is row `first` of the image, to `laid`, moved up by each of
/// `offsets`. Neighbouring offsets, as those of a rectangle, are combined: the rows are joined with copies of
/// themselves moved down by 1, 2, 4 ..; `rows` and `scratch` are overwritten.
fn lay(
    offsets: &[isize],
    rows: &mut [u64],
    scratch: &mut [u64],
    count: usize,
    first: usize,
    stride: usize,
    laid: &mut [u64],
) {
    let one_run = offsets.windows(2).all(|pair| pair[1] == pair[0] + 1);
    if !one_run || !(4..=MOST_DOUBLED_ROWS).contains(&offsets.len()) {
        for &offset in offsets {
            join_moved(&rows[..count], first as isize - offset, stride, laid);
        }
        return;
    }
    // Row j becomes rows j - n + 1 to j.
    let all = count + (offsets.len() - 1) * stride;
    let (mut rows, mut scratch) = (&mut rows[..all], &mut scratch[..all]);
    rows[count..].fill(0);
    let mut n = 1;
    while n < offsets.len() {
        let by = n.min(offsets.len() - n);
        let away = by * stride;
        scratch[..away].copy_from_slice(&rows[..away]);
        join(&rows[away..], &rows[..all - away], &mut scratch[away..]);
        std::mem::swap(&mut rows, &mut scratch);
        n += by;
    }
    join_moved(rows, first as isize - offsets[offsets.len() - 1], stride, laid);
}

/// Joins rows to `laid` from row `at` on; start and end may lie outside it.
fn join_moved(rows: &[u64], at: isize, stride: usize, laid: &mut [u64]) {
    let skipped = (-at).max(0) as usize * stride;
    let from = at.max(0) as usize * stride;
    if skipped < rows.len() && from < laid.len() {
        let count = (rows.len() - skipped).min(laid.len() - from);
        join_into(&rows[skipped..][..count], &mut laid[from..][..count]);
    }
}
wide! {
    /// Rows of words -> the same with `pad` empty words on each side; bits of `turn` are inverted, none beyond the
    /// width.
    fn add_pads(rows: &[u64], words: usize, pad: usize, turn: u64, last_word: u64, out: &mut [u64]) {
        for (to, from) in out.chunks_exact_mut(words + 2 * pad).zip(rows.chunks_exact(words)) {
            let (before, to) = to.split_at_mut(pad);
            let (to, after) = to.split_at_mut(words);
            to.iter_mut().zip(from).for_each(|(to, bits)| *to = bits ^ turn);
            to[words - 1] &= last_word;
            match (before, after) {
                // The usual case; two calls per row would take longer than the row.
                ([before], [after]) => (*before, *after) = (0, 0),
                (before, after) => {
                    before.fill(0);
                    after.fill(0);
                }
            }
        }
    }

    /// The inverse of `add_pads`.
    fn drop_pads(padded: &[u64], words: usize, pad: usize, turn: u64, last_word: u64, out: &mut [u64]) {
        for (to, from) in out.chunks_exact_mut(words).zip(padded.chunks_exact(words + 2 * pad)) {
            to.iter_mut().zip(&from[pad..]).for_each(|(to, bits)| *to = bits ^ turn);
            to[words - 1] &= last_word;
        }
    }

    /// Pixel x of `out` is set where x - left, x or x + right of `rows` is, over all rows with their padding. Shifts of
    /// 0 to 63 px.
    fn widen(rows: &[u64], out: &mut [u64], left: u32, right: u32) {
        // Two shifts, because a shift by 64 is not defined.
        let mixed = |before: u64, here: u64, after: u64| {
            here | here >> right | (after << 1) << (63 - right) | here << left | (before >> 1) >> (63 - left)
        };
        let n = rows.len();
        if n < 3 {
            let at = |i: usize| rows.get(i).copied().unwrap_or(0);
            (0..n).for_each(|i| out[i] = mixed(if i > 0 { at(i - 1) } else { 0 }, rows[i], at(i + 1)));
            return;
        }
        let (before, here, after) = (&rows[..n - 2], &rows[1..n - 1], &rows[2..]);
        for (out, ((&before, &here), &after)) in out[1..n - 1].iter_mut().zip(before.iter().zip(here).zip(after)) {
            *out = mixed(before, here, after);
        }
        out[0] = mixed(0, rows[0], rows[1]);
        out[n - 1] = mixed(rows[n - 2], rows[n - 1], 0);
    }

    fn join(a: &[u64], b: &[u64], out: &mut [u64]) {
        out.iter_mut().zip(a.iter().zip(b)).for_each(|(out, (a, b))| *out = a | b);
    }

    fn join_into(from: &[u64], out: &mut [u64]) {
        out.iter_mut().zip(from).for_each(|(out, bits)| *out |= bits);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The element as a mask.
    fn picture(element: &Element) -> Mask {
        // Dilating one pixel draws the element mirrored in its anchor.
        let SizePx { width, height } = element.size();
        let size = SizePx::new(2 * width + 1, 2 * height + 1);
        let (mut one, mut grown, mut shape) = (Mask::new(size), Mask::new(size), Mask::new(element.size()));
        one.set(width, height, true);
        Morphology::new(size).dilate(&one, element, &mut grown);
        for y in 0..height {
            for x in 0..width {
                let (dx, dy) = (x as isize - (width / 2) as isize, y as isize - (height / 2) as isize);
                shape.set(x, y, grown.get(width as isize - dx, height as isize - dy));
            }
        }
        assert_eq!(shape.area_px2(), grown.area_px2(), "the element fits its size");
        shape
    }

    /// The rectangle, or the ellipse by its equation.
    fn shape(width: usize, height: usize, round: bool) -> Mask {
        let mut shape = Mask::new(SizePx::new(width, height));
        let (a, b) = ((width / 2) as f64, (height / 2) as f64);
        for y in 0..height {
            for x in 0..width {
                let v = if b > 0.0 { (y as f64 - b) / b } else { 1.0 };
                let half = (a * (1.0 - v * v).max(0.0).sqrt()).round_ties_even();
                shape.set(x, y, !round || (x as f64 - a).abs() <= half);
            }
        }
        shape
    }

    fn naive(src: &Mask, shape: &Mask, erode: bool) -> Mask {
        let (size, element) = (src.size(), shape.size());
        let mut out = Mask::new(size);
        for y in 0..size.height as isize {
            for x in 0..size.width as isize {
                let mut any = false;
                for j in 0..element.height as isize {
                    for i in 0..element.width as isize {
                        let (sx, sy) = (x + i - (element.width / 2) as isize, y + j - (element.height / 2) as isize);
                        let inside = sx >= 0 && sy >= 0 && sx < size.width as isize && sy < size.height as isize;
                        any |= shape.get(i, j) && inside && src.get(sx, sy) != erode;
                    }
                }
                out.set(x as usize, y as usize, any != erode);
            }
        }
        out
    }

    #[test]
    fn shapes() {
        assert_eq!(
            picture(&Element::ellipse(7, 5)),
            Mask::from_picture(
                "...#...
                 #######
                 #######
                 #######
                 ...#..."
            )
        );
        assert_eq!(
            picture(&Element::ellipse(4, 4)),
            Mask::from_picture(
                "..#.
                 ####
                 ####
                 ####"
            )
        );
        assert_eq!(picture(&Element::rect(3, 2)).area_px2(), 6);
        assert_eq!(picture(&Element::ellipse(1, 1)).area_px2(), 1);
    }

    #[test]
    fn closing_bridges_a_gap_and_opening_removes_a_speck() {
        let src = Mask::from_picture(
            "..........
             .###.###..
             .###.###..
             .###.###..
             .........#
             ..........",
        );
        let mut morphology = Morphology::new(src.size());
        let mut out = Mask::new(src.size());
        // At the border, too: what lies beyond it never erodes.
        morphology.close(&src, &Element::rect(3, 3), &mut out);
        assert_eq!(
            out,
            Mask::from_picture(
                "########..
                 ########..
                 ########..
                 ########..
                 .........#
                 .........#"
            )
        );
        morphology.open(&src, &Element::rect(3, 3), &mut out);
        assert_eq!(
            out,
            Mask::from_picture(
                "..........
                 .###.###..
                 .###.###..
                 .###.###..
                 ..........
                 .........."
            )
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn equals_the_pixel_by_pixel_form(
            width in 1usize..200, height in 1usize..24, seed: u64, sparse in 1u32..7,
            element_width in 1usize..150, element_height in 1usize..30, round: bool
        ) {
            let size = SizePx::new(width, height);
            let mut src = Mask::new(size);
            let mut state = seed;
            for i in 0..size.area() {
                state = crate::random::next(state);
                src.set(i % width, i / width, (state >> 40) % (1 << sparse) == 0);
            }
            let element = if round {
                Element::ellipse(element_width, element_height)
            } else {
                Element::rect(element_width, element_height)
            };
            let shape = shape(element_width, element_height, round);
            let mut morphology = Morphology::new(size);
            let mut out = Mask::new(size);
            morphology.dilate(&src, &element, &mut out);
            prop_assert_eq!(&out, &naive(&src, &shape, false));
            let dilated = out.clone();
            morphology.erode(&src, &element, &mut out);
            prop_assert_eq!(&out, &naive(&src, &shape, true));
            let eroded = out.clone();
            morphology.close(&src, &element, &mut out);
            prop_assert_eq!(&out, &naive(&dilated, &shape, true));
            morphology.open(&src, &element, &mut out);
            prop_assert_eq!(&out, &naive(&eroded, &shape, false));
            morphology.erode(&dilated, &element, &mut out);
            for i in 0..size.area() {
                let (x, y) = ((i % width) as isize, (i / width) as isize);
                prop_assert_eq!(element.fits(&dilated, x, y), out.get(x, y) && dilated.get(x, y), "({}, {})", x, y);
            }
        }
    }
}
