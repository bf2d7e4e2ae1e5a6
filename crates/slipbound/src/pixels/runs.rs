//! Runs of set pixels in the rows of a mask, and which of them are connected.
//!
//! ```text
//!   ..###..##     runs of row y        two runs of neighbouring rows that touch belong together:
//!   .##..#...     runs of row y + 1    union-find over runs, the earliest is the root
//! ```

use crate::image::{Mask, SizePx};

/// Pixels from `from` to `to - 1` of a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) row: u32,
}

impl Run {
    /// Its words in a row, and its pixels in each.
    fn words(&self) -> impl Iterator<Item = (usize, u64)> {
        let (from, to) = (self.from, self.to);
        (from / 64..=(to - 1) / 64).map(move |word| {
            let (from, to) = (from.saturating_sub(word * 64), (to - word * 64).min(64));
            (word as usize, (u64::MAX >> (64 - (to - from))) << from)
        })
    }

    /// Sets or clears its pixels.
    pub(super) fn write(&self, mask: &mut Mask, on: bool) {
        let row = mask.row_mut(self.row as usize);
        for (word, bits) in self.words() {
            if on {
                row[word] |= bits;
            } else {
                row[word] &= !bits;
            }
        }
    }

    /// Number of its pixels that are set in a mask.
    pub(super) fn count(&self, mask: &Mask) -> u32 {
        let row = mask.row(self.row as usize);
        self.words().map(|(word, bits)| (row[word] & bits).count_ones()).sum()
    }
}

/// Whether runs that meet only at a corner are connected.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Corners {
    Join,
    Part,
}

/// The runs of a mask, row by row, with their roots; owns its memory.
#[derive(Debug, Clone)]
pub(super) struct Runs {
    size: SizePx,
    pub(super) all: Vec<Run>,
    /// Per run a run of the same component, not later; the earliest points to itself.
    pub(super) earlier: Vec<u32>,
}

impl Runs {
    /// Memory for the most runs that a mask of `size` can have.
    pub(super) fn new(size: SizePx) -> Self {
        let most = size.width.div_ceil(2) * size.height;
        assert!(most < u32::MAX as usize, "mask of {size}: too many pixels");
        Runs { size, all: Vec::with_capacity(most), earlier: Vec::with_capacity(most) }
    }

    /// Runs with their roots.
    pub(super) fn with_roots(&self) -> impl Iterator<Item = (&Run, u32)> + Clone {
        self.all.iter().zip(self.earlier.iter().copied())
    }

    /// Finds the runs of `mask` (of its clear pixels where `turn` is all ones) and points each to its root.
    pub(super) fn find(&mut self, mask: &Mask, turn: u64, corners: Corners) {
        assert_eq!(mask.size(), self.size, "mask of another size");
        self.all.clear();
        self.earlier.clear();
        // For the row above: the first run not yet passed and the end.
        let (mut above, mut above_end) = (0, 0);
        let reach = if corners == Corners::Join { 1 } else { 0 };
        for y in 0..self.size.height {
            let start = self.all.len();
            runs_of_row(mask, y, turn, &mut self.all);
            for i in start..self.all.len() {
                self.earlier.push(i as u32);
                let run = self.all[i];
                while above < above_end && self.all[above].to + reach <= run.from {
                    above += 1;
                }
                let mut touching = above;
                while touching < above_end && self.all[touching].from < run.to + reach {
                    join(&mut self.earlier, touching as u32, i as u32);
                    touching += 1;
                }
            }
            (above, above_end) = (start, self.all.len());
        }
        for i in 0..self.earlier.len() {
            // Earlier runs already point to their root.
            self.earlier[i] = self.earlier[self.earlier[i] as usize];
        }
    }
}

fn runs_of_row(mask: &Mask, y: usize, turn: u64, runs: &mut Vec<Run>) {
    let (words, width) = (mask.row(y), mask.size().width as u32);
    let row = y as u32;
    let (mut start, mut before) = (None, 0);
    for (i, &word) in words.iter().enumerate() {
        let mut word = word ^ turn;
        if i + 1 == words.len() {
            word &= mask.last_word();
        }
        let mut changes = word ^ (word << 1 | before);
        before = word >> 63;
        while changes != 0 {
            let x = i as u32 * 64 + changes.trailing_zeros();
            changes &= changes - 1;
            start = match start {
                None => Some(x),
                Some(from) => {
                    runs.push(Run { from, to: x, row });
                    None
                }
            };
        }
    }
    if let Some(from) = start {
        runs.push(Run { from, to: width, row });
    }
}

fn root(earlier: &mut [u32], mut i: u32) -> u32 {
    while earlier[i as usize] != i {
        let next = earlier[i as usize];
        earlier[i as usize] = earlier[next as usize];
        i = next;
    }
    i
}

fn join(earlier: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(earlier, a), root(earlier, b));
    earlier[a.max(b) as usize] = a.min(b);
}
