//! Mask -> mask grown or shrunk by an element, 64 pixels at a time.
//!
//! ```text
//!   element, a pile of chords          one source row, grown step by step from the narrowest chord
//!     . . # . .   [ 0, 0]              to the widest; after each step it is laid onto every output
//!     # # # # #   [-2, 2]              row where the element has that chord
//!     # # o # #   [-2, 2]  o anchor
//!     # # # # #   [-2, 2]
//!     . . # . .   [ 0, 0]
//! ```
//! Shapes, anchor (w/2, h/2) and border are those of cv2.getStructuringElement, cv2.dilate and cv2.erode: pixels
//! outside the image neither grow nor shrink anything, and an even element is not mirrored between the two.

use crate::image::{Mask, SizePx};

/// Words beside a row for what a chord reaches outside the image.
const MAX_PAD_WORDS: usize = 8;
/// The largest element, in px: it must not reach further than the padding.
const MAX_ELEMENT_PX: usize = 1023;

/// A structuring element, ready to be laid onto rows of bits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    size: SizePx,
    steps: Vec<Step>,
    /// Offsets, source row minus output row, of the chords of all steps in turn.
    rows: Vec<isize>,
    pad_words: usize,
}

/// Widens the chord by `left` and `right` px, then lays it onto the next `rows` output rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Step {
    left: u32,
    right: u32,
    rows: usize,
}

impl Element {
    /// A full rectangle. Sides of 1 to 1023 px, else a panic.
    pub fn rect(width_px: usize, height_px: usize) -> Self {
        Self::from_chords(width_px, height_px, |_| Some((0, width_px)))
    }

    /// The ellipse that fills a rectangle, drawn as OpenCV draws it. Sides of 1 to 1023 px, else a panic.
    pub fn ellipse(width_px: usize, height_px: usize) -> Self {
        let (a, b) = (width_px / 2, height_px / 2);
        let inverse = if b > 0 { 1.0 / (b * b) as f64 } else { 0.0 };
        Self::from_chords(width_px, height_px, |y| {
            let dy = y.abs_diff(b);
            if dy > b {
                return None;
            }
            let half = (a as f64 * (((b * b - dy * dy) as f64) * inverse).sqrt()).round_ties_even() as usize;
            Some((a.saturating_sub(half), (a + half + 1).min(width_px)))
        })
    }

    /// Width and height.
    pub fn size(&self) -> SizePx {
        self.size
    }

    /// `chord` gives first and last + 1 column of a row; chords must be nested in one another and hold the anchor.
    fn from_chords(width_px: usize, height_px: usize, chord: impl Fn(usize) -> Option<(usize, usize)>) -> Self {
        let sides = 1..=MAX_ELEMENT_PX;
        assert!(
            sides.contains(&width_px) && sides.contains(&height_px),
            "element of {width_px} x {height_px} px: expected 1 to {MAX_ELEMENT_PX} each way"
        );
        let mut chords: Vec<(usize, usize, isize)> = (0..height_px)
            .filter_map(|y| chord(y).map(|(from, to)| (width_px / 2 - from, to - 1 - width_px / 2, y)))
            .map(|(left, right, y)| (left, right, y as isize - (height_px / 2) as isize))
            .collect();
        chords.sort_by_key(|&(left, right, _)| left + right);
        let mut steps: Vec<Step> = vec![Step { left: 0, right: 0, rows: 0 }];
        let mut now = (0, 0);
        for &(left, right, _) in &chords {
            while now != (left, right) {
                // A run of n px and its copy moved by n or less leave no gap.
                let longest = (now.0 + now.1 + 1).min(63);
                let step = ((left - now.0).min(longest), (right - now.1).min(longest));
                now = (now.0 + step.0, now.1 + step.1);
                steps.push(Step { left: step.0 as u32, right: step.1 as u32, rows: 0 });
            }
            steps.last_mut().expect("never empty").rows += 1;
        }
        let reach = now.0.max(now.1);
        Element {
            size: SizePx::new(width_px, height_px),
            steps,
            rows: chords.iter().map(|&(_, _, dy)| dy).collect(),
            pad_words: reach.div_ceil(64),
        }
    }
}

/// The scratch of the four operations.
#[derive(Debug, Clone)]
pub struct Morphology {
    size: SizePx,
    between: Mask,
    /// A row of bits with its padding, before and after a step.
    row: Vec<u64>,
    row_next: Vec<u64>,
}

impl Morphology {
    /// Scratch for masks of `size`.
    pub fn new(size: SizePx) -> Self {
        let words = size.width.div_ceil(64) + 2 * MAX_PAD_WORDS;
        Morphology { size, between: Mask::new(size), row: vec![0; words], row_next: vec![0; words] }
    }

    /// Sets a pixel where the element, laid on it, holds a set pixel.
    pub fn dilate(&mut self, src: &Mask, element: &Element, out: &mut Mask) {
        self.check(src, out);
        spread(src, element, 0, &mut self.row, &mut self.row_next, out);
    }

    /// Sets a pixel where the element, laid on it, holds only set pixels, as far as it lies inside the image.
    pub fn erode(&mut self, src: &Mask, element: &Element, out: &mut Mask) {
        self.check(src, out);
        spread(src, element, u64::MAX, &mut self.row, &mut self.row_next, out);
    }

    /// Dilates, then erodes: closes gaps narrower than the element.
    pub fn close(&mut self, src: &Mask, element: &Element, out: &mut Mask) {
        self.check(src, out);
        spread(src, element, 0, &mut self.row, &mut self.row_next, &mut self.between);
        spread(&self.between, element, u64::MAX, &mut self.row, &mut self.row_next, out);
    }

    /// Erodes, then dilates: removes what is narrower than the element.
    pub fn open(&mut self, src: &Mask, element: &Element, out: &mut Mask) {
        self.check(src, out);
        spread(src, element, u64::MAX, &mut self.row, &mut self.row_next, &mut self.between);
        spread(&self.between, element, 0, &mut self.row, &mut self.row_next, out);
    }

    fn check(&self, src: &Mask, out: &Mask) {
        assert_eq!(src.size(), self.size, "mask of another size");
        assert_eq!(out.size(), self.size, "output mask of another size");
    }
}

/// Dilates; with `turn` all ones, what is not set spreads instead, which erodes what is.
fn spread(src: &Mask, element: &Element, turn: u64, row: &mut Vec<u64>, row_next: &mut Vec<u64>, out: &mut Mask) {
    let (pad, words, height) = (element.pad_words, src.row(0).len(), src.size().height as isize);
    let padded = words + 2 * pad;
    let last_word = src.last_word();
    out.clear();
    for y in 0..height {
        let inside = pad..pad + words;
        row[..pad].fill(0);
        row[pad + words..padded].fill(0);
        let mut any = 0;
        for (bits, &from) in row[inside.clone()].iter_mut().zip(src.row(y as usize)) {
            *bits = from ^ turn;
            any |= *bits;
        }
        row[pad + words - 1] &= last_word;
        if any == 0 {
            continue;
        }
        let mut rows = &element.rows[..];
        for step in &element.steps {
            if step.left + step.right > 0 {
                widen(&row[..padded], &mut row_next[..padded], step.left, step.right);
                std::mem::swap(row, row_next);
            }
            let (here, later) = rows.split_at(step.rows);
            for dy in here {
                if (0..height).contains(&(y - dy)) {
                    for (out, bits) in out.row_mut((y - dy) as usize).iter_mut().zip(&row[inside.clone()]) {
                        *out |= bits;
                    }
                }
            }
            rows = later;
        }
    }
    for y in 0..height as usize {
        let bits = out.row_mut(y);
        for bits in bits.iter_mut() {
            *bits ^= turn;
        }
        bits[words - 1] &= last_word;
    }
}

/// Pixel x of `out` is set where x - left, x or x + right of `row` is. Moves of 0 to 63 px.
fn widen(row: &[u64], out: &mut [u64], left: u32, right: u32) {
    let n = row.len();
    let mixed = |before: u64, here: u64, after: u64| {
        // Two shifts, since a shift by 64 is none.
        here | here >> right | (after << 1) << (63 - right) | here << left | (before >> 1) >> (63 - left)
    };
    if n == 1 {
        out[0] = mixed(0, row[0], 0);
        return;
    }
    let (before, here, after) = (&row[..n - 2], &row[1..n - 1], &row[2..]);
    for (out, ((&before, &here), &after)) in out[1..n - 1].iter_mut().zip(before.iter().zip(here).zip(after)) {
        *out = mixed(before, here, after);
    }
    out[0] = mixed(0, row[0], row[1]);
    out[n - 1] = mixed(row[n - 2], row[n - 1], 0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The element as a picture.
    fn picture(element: &Element) -> Mask {
        // Dilating one pixel draws the element mirrored in its anchor.
        let SizePx { width, height } = element.size;
        let size = SizePx::new(2 * width + 1, 2 * height + 1);
        let (mut one, mut grown, mut shape) = (Mask::new(size), Mask::new(size), Mask::new(element.size));
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
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
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
        }
    }
}
