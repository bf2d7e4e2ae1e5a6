//! A grey image of unknown dots -> their size, their polarity (dark or bright), and their grid.

use super::fit::median;
use super::lattice::{self, Nodes};
use crate::image::SizePx;
use crate::pixels::dots::{DotFinder, Spot};
use crate::sensor::Polarity;

/// Diameters tried, px: each a quarter larger than the one before.
const DIAMETERS: (f64, f64, f64) = (3.0, 1.25, 64.0);
/// Spots of at least this contrast are considered.
const LEAST_LEVELS: f32 = 2.0;
/// And of at least this share of the contrast of the strongest ones.
const LEAST_RATIO: f32 = 0.15;
/// Number of strongest spots that define the contrast of a dot.
const STRONG_COUNT: usize = 24;
/// Most spots kept: more are texture.
const MOST_SPOTS: usize = 1500;

/// One scale of dots and the grid found at it.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub spots: Vec<Spot>,
    pub nodes: Nodes,
    pub diameter_px: f64,
    pub polarity: Polarity,
}

impl Found {
    /// Total contrast on the grid. The gaps between dark dots form a grid of bright ones, but a fainter one; a dot is
    /// strongest at its own size.
    fn score(&self) -> f64 {
        let levels: Vec<f64> = self.nodes.values().map(|&i| f64::from(self.spots[i].response_levels)).collect();
        levels.len() as f64 * median(&levels)
    }
}

/// The best scale and polarity; a fixed polarity if one is given.
pub(super) fn search(grey: &[u8], size: SizePx, polarity: Option<Polarity>) -> Option<Found> {
    let mut best: Option<Found> = None;
    let mut diameter_px = DIAMETERS.0;
    while diameter_px <= DIAMETERS.2 && 8.0 * diameter_px < size.width.min(size.height) as f64 {
        for polarity in [Polarity::Dark, Polarity::Bright].into_iter().filter(|p| polarity.is_none_or(|q| q == *p)) {
            let found = at_scale(grey, size, diameter_px, polarity);
            if best.as_ref().is_none_or(|b| found.score() > b.score()) {
                best = Some(found);
            }
        }
        diameter_px *= DIAMETERS.1;
    }
    best
}

fn at_scale(grey: &[u8], size: SizePx, diameter_px: f64, polarity: Polarity) -> Found {
    let mut finder = DotFinder::new(size, diameter_px, 2.0 * diameter_px, polarity);
    let spots = finder.run(grey, LEAST_LEVELS);
    let strong: Vec<f64> = spots.iter().take(STRONG_COUNT).map(|s| f64::from(s.response_levels)).collect();
    let least = LEAST_RATIO * median(&strong) as f32;
    let spots: Vec<Spot> = spots.iter().filter(|s| s.response_levels >= least).take(MOST_SPOTS).copied().collect();
    let nodes = lattice::find(&spots);
    Found { spots, nodes, diameter_px, polarity }
}
