//! Features -> used fraction and stick ratio, with their errors, by boosted trees.
//!
//! The table is made by `cargo run --release -p slipbound-lab --example fit_estimates`, from simulated trials alone.

use super::features::{FEATURES_COUNT, Features, GEOMETRIC_COUNT};
use crate::monitor::trees::{Ensemble, parse};
use std::sync::LazyLock;

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
    grip: Ensemble<2>,
    grip_error: Ensemble<2>,
    alone: Ensemble<2>,
    alone_error: Ensemble<2>,
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

    /// None when the table is spoiled.
    pub fn parse(text: &str) -> Option<Trees> {
        let names = ["grip", "grip_error", "alone", "alone_error"];
        let [grip, grip_error, alone, alone_error] = parse(text, names, FEATURES_COUNT)?;
        Some(Trees { grip, grip_error, alone, alone_error })
    }
}

#[cfg(test)]
impl Trees {
    /// Trees of each ensemble.
    pub fn counts(&self) -> [usize; 4] {
        [&self.grip, &self.grip_error, &self.alone, &self.alone_error].map(Ensemble::trees_count)
    }
}

fn said(values: &Ensemble<2>, errors: &Ensemble<2>, features: &Features) -> Said {
    let [used, stick] = values.at(features);
    let [used_error, stick_error] = errors.at(features);
    // The mean length of an error, as the standard deviation of a normal one.
    let sd = |error: f64| (1.2533 * error).max(LEAST_SD);
    Said { used, used_sd: sd(used_error), stick, stick_sd: sd(stick_error) }
}
