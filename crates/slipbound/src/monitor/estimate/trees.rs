//! Boosted regression trees of depth 3: features -> used fraction and stick ratio, with their errors.
//!
//! The table is made by `cargo run --release -p slipbound-lab --example fit_estimates`, from simulated trials alone. Its lines:
//! `ensemble NAME first second`, the values it starts from, then its trees, `feature:threshold` of seven splits and eight
//! leaves of two values each.

use super::features::{FEATURES_COUNT, Features, GEOMETRIC_COUNT};
use std::sync::LazyLock;

const SPLITS: usize = 7;
const LEAVES: usize = 8;

/// A tree. Split i goes on with split 2 i + 1 where the feature is at most the threshold, else with 2 i + 2.
#[derive(Debug, Clone, Copy)]
struct Tree {
    features: [u8; SPLITS],
    thresholds: [f32; SPLITS],
    leaves: [[f32; 2]; LEAVES],
}

/// Trees whose leaves add up.
#[derive(Debug, Clone, Default)]
struct Ensemble {
    base: [f64; 2],
    trees: Vec<Tree>,
}

/// What a frame says.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Said {
    /// Load over the load at gross slip.
    pub used: f64,
    pub used_sd: f64,
    /// Area that sticks over area in contact.
    pub stick: f64,
    pub stick_sd: f64,
}

/// The four ensembles.
#[derive(Debug, Clone, Default)]
pub(super) struct Trees {
    grip: Ensemble,
    grip_error: Ensemble,
    alone: Ensemble,
    alone_error: Ensemble,
}

/// The ones that are shipped.
pub(super) fn shipped() -> &'static Trees {
    static SHIPPED: LazyLock<Trees> = LazyLock::new(|| Trees::parse(include_str!("trees.txt")).unwrap_or_default());
    &SHIPPED
}

/// The least standard deviation that is ever stated.
const LEAST_SD: f64 = 0.02;

impl Trees {
    /// With grip force and stiffness.
    pub fn with_grip(&self, features: &Features) -> Said {
        said(&self.grip, &self.grip_error, features)
    }

    /// From the picture alone: the features that need more are taken for 0, as they were when the trees were fitted.
    pub fn alone(&self, features: &Features) -> Said {
        let mut seen = *features;
        seen[GEOMETRIC_COUNT..].fill(0.0);
        said(&self.alone, &self.alone_error, &seen)
    }

    /// None when a line is not as described above.
    pub fn parse(text: &str) -> Option<Trees> {
        let mut trees = Trees::default();
        let mut into = None;
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            let mut words = line.split_ascii_whitespace();
            if let Some(rest) = line.strip_prefix("ensemble ") {
                let mut words = rest.split_ascii_whitespace();
                let ensemble = match words.next()? {
                    "grip" => &mut trees.grip,
                    "grip_error" => &mut trees.grip_error,
                    "alone" => &mut trees.alone,
                    "alone_error" => &mut trees.alone_error,
                    _ => return None,
                };
                ensemble.base = [words.next()?.parse().ok()?, words.next()?.parse().ok()?];
                into = Some(ensemble);
                continue;
            }
            let mut tree = Tree { features: [0; SPLITS], thresholds: [0.0; SPLITS], leaves: [[0.0; 2]; LEAVES] };
            for split in 0..SPLITS {
                let (feature, threshold) = words.next()?.split_once(':')?;
                tree.features[split] = feature.parse().ok().filter(|f| usize::from(*f) < FEATURES_COUNT)?;
                tree.thresholds[split] = threshold.parse().ok()?;
            }
            for leaf in &mut tree.leaves {
                *leaf = [words.next()?.parse().ok()?, words.next()?.parse().ok()?];
            }
            into.as_mut()?.trees.push(tree);
        }
        Some(trees)
    }
}

#[cfg(test)]
impl Trees {
    /// Trees of each ensemble.
    pub fn counts(&self) -> [usize; 4] {
        [&self.grip, &self.grip_error, &self.alone, &self.alone_error].map(|ensemble| ensemble.trees.len())
    }
}

fn said(values: &Ensemble, errors: &Ensemble, features: &Features) -> Said {
    let [used, stick] = values.at(features);
    let [used_error, stick_error] = errors.at(features);
    // The mean length of an error, as the standard deviation of a normal one.
    let sd = |error: f64| (1.2533 * error).max(LEAST_SD);
    Said { used, used_sd: sd(used_error), stick, stick_sd: sd(stick_error) }
}

impl Ensemble {
    fn at(&self, features: &Features) -> [f64; 2] {
        let mut sum = self.base;
        for tree in &self.trees {
            let mut at = 0;
            while at < SPLITS {
                let over = features[usize::from(tree.features[at])] > f64::from(tree.thresholds[at]);
                at = 2 * at + 1 + usize::from(over);
            }
            let [first, second] = tree.leaves[at - SPLITS];
            sum = [sum[0] + f64::from(first), sum[1] + f64::from(second)];
        }
        sum
    }
}
