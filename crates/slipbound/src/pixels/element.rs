//! Structuring elements of morphology: stacks of nested chords.

use crate::image::{Mask, SizePx};

/// Maximum size of an element, in px: it must not exceed the padding.
pub const MAX_ELEMENT_PX: usize = 1023;

/// A structuring element, prepared for rows of bits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    size: SizePx,
    pub(super) steps: Vec<Step>,
    /// Offsets, source row minus output row, of the chords of all steps in order; ascending within a step.
    pub(super) rows: Vec<isize>,
    /// Left and right extent of each chord from the anchor, px, and its row as above; the widest first.
    chords: Vec<(usize, usize, isize)>,
    /// For an element at most a word wide: row and pixels of each chord from its upper left corner, the widest first;
    /// else empty.
    chord_bits: Vec<(usize, u64)>,
    pub(super) pad_words: usize,
}

/// Widens the chord by `left` and `right` px, then applies it to the next `rows` output rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Step {
    pub(super) left: u32,
    pub(super) right: u32,
    pub(super) rows: usize,
}

impl Element {
    /// A full rectangle. Sides of 1 to 1023 px, else a panic.
    pub fn rect(width_px: usize, height_px: usize) -> Self {
        Self::from_chords(width_px, height_px, |_| Some((0, width_px)))
    }

    /// The ellipse that fills a rectangle, as OpenCV draws it. Sides of 1 to 1023 px, else a panic.
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

    /// `chord` gives first and last + 1 column of a row; chords must be nested in one another and contain the anchor.
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
                // A run of n px and a copy of it shifted by n or less leave no gap.
                let longest = (now.0 + now.1 + 1).min(63);
                let step = ((left - now.0).min(longest), (right - now.1).min(longest));
                now = (now.0 + step.0, now.1 + step.1);
                steps.push(Step { left: step.0 as u32, right: step.1 as u32, rows: 0 });
            }
            steps.last_mut().expect("never empty").rows += 1;
        }
        let reach = now.0.max(now.1);
        let chord_bits = chords.iter().rev().map(|&(left, right, dy)| {
            let bits = u64::MAX >> (63 - left - right) << (width_px / 2 - left);
            ((dy + (height_px / 2) as isize) as usize, bits)
        });
        let chord_bits = if width_px <= 64 { chord_bits.collect() } else { Vec::new() };
        Element {
            size: SizePx::new(width_px, height_px),
            steps,
            chord_bits,
            rows: chords.iter().map(|&(_, _, dy)| dy).collect(),
            chords: chords.into_iter().rev().collect(),
            pad_words: reach.div_ceil(64),
        }
    }

    /// Whether [`erode`](crate::pixels::morphology::Morphology::erode) by this element would set the pixel (x, y) of
    /// `mask`: whether the element, placed there, contains only set pixels as far as it lies inside the image. False
    /// outside the image.
    pub fn fits(&self, mask: &Mask, x: isize, y: isize) -> bool {
        if !mask.get(x, y) {
            return false;
        }
        let SizePx { width, height } = mask.size();
        let (x, y) = (x as usize, y as usize);
        let (left, above) = (self.size.width / 2, self.size.height / 2);
        let whole =
            x >= left && x - left + self.size.width <= width && y >= above && y - above + self.size.height <= height;
        if whole && !self.chord_bits.is_empty() {
            let (word, shift) = ((x - left) / 64, (x - left) % 64);
            let per_row = mask.row(0).len();
            let words = &mask.words()[(y - above) * per_row + word..];
            return self.chord_bits.iter().all(|&(row, bits)| {
                let at = row * per_row;
                // The part of a chord in the next word, without a shift by 64; at the end of a row the chord has no
                // pixel there.
                let seen = words[at] >> shift | words.get(at + 1).copied().unwrap_or(0) << 1 << (63 - shift);
                bits & !seen == 0
            });
        }
        self.chords.iter().all(|&(left, right, dy)| match y.checked_add_signed(dy).filter(|&y| y < height) {
            Some(row) => all_set(mask.row(row), x.saturating_sub(left), (x + right).min(width - 1)),
            None => true,
        })
    }
}

/// Whether the bits from `first` to `last` are set.
fn all_set(row: &[u64], first: usize, last: usize) -> bool {
    let (from, to) = (u64::MAX << (first % 64), u64::MAX >> (63 - last % 64));
    let missing = |word: usize, wanted: u64| !row[word] & wanted != 0;
    let (first, last) = (first / 64, last / 64);
    if first == last {
        return !missing(first, from & to);
    }
    !missing(first, from) && !missing(last, to) && row[first + 1..last].iter().all(|&word| word == u64::MAX)
}
