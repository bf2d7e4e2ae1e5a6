//! Features -> used fraction and stick ratio, with their errors, by boosted trees.
//!
//! The table is made by `cargo run --release -p slipbound-lab --example fit_estimates`, from simulated trials alone.

use super::features::{FEATURES_COUNT, Features, GEOMETRIC_COUNT};
use crate::monitor::trees::{Ensemble, parse};
use std::sync::{Arc, LazyLock};

/// Largest used fraction that is reported; above 1 the object slides.
pub(super) const MAX_USED: f64 = 1.2;

/// Estimates from one frame.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Prediction {
    /// Load over the load at gross slip.
    pub used: f64,
    pub used_sd: f64,
    /// Standard deviation of its logarithm, for friction that is log-uniform from 0.2 to 1.3 a priori; None where the
    /// trees were fitted to ramps alone.
    pub log_used_sd: Option<f64>,
    /// Area that sticks over area in contact.
    pub stick: f64,
    pub stick_sd: f64,
}

/// The ensembles, each with that of its error. With grip force: the logarithm of the used fraction, equally accurate
/// for slow and fast loads, and the stick ratio. Without: the used fraction of ramps to gross slip, and the stick
/// ratio.
#[derive(Debug, Clone, Default)]
pub(super) struct Trees {
    used: [Ensemble; 2],
    stick: [Ensemble; 2],
    alone_used: [Ensemble; 2],
    alone_stick: [Ensemble; 2],
}

/// The shipped trees.
pub(super) fn shipped() -> Arc<Trees> {
    static SHIPPED: LazyLock<Arc<Trees>> = LazyLock::new(|| {
        Arc::new(Trees::parse(include_str!("trees.txt")).expect("the shipped table is read by tests"))
    });
    SHIPPED.clone()
}

/// Trees of used fraction and stick ratio other than the shipped ones, fitted to other objects or to another finger, as
/// `fit_estimates` of slipbound-lab writes them. Monitors share them.
#[derive(Debug, Clone)]
pub struct EstimateTrees(pub(super) Arc<Trees>);

impl EstimateTrees {
    /// Reads a table; None if it is invalid or an ensemble has no trees.
    pub fn parse(table: &str) -> Option<Self> {
        let trees = Trees::parse(table)?;
        let whole = trees.counts().iter().all(|count| *count > 0);
        whole.then(|| EstimateTrees(Arc::new(trees)))
    }
}

/// Smallest standard deviation reported.
const LEAST_SD: f64 = 0.02;

/// Names of the ensembles in the table.
const NAMES: [&str; 8] = [
    "used",
    "used_error",
    "stick",
    "stick_error",
    "alone_used",
    "alone_used_error",
    "alone_stick",
    "alone_stick_error",
];

impl Trees {
    /// With grip force and stiffness.
    pub fn with_grip(&self, features: &Features) -> Prediction {
        let ((log_used, log_used_sd), (stick, stick_sd)) =
            (predict(&self.used, features), predict(&self.stick, features));
        let used = libm::exp(log_used);
        Prediction {
            used,
            used_sd: (used * log_used_sd).max(LEAST_SD),
            log_used_sd: Some(log_used_sd),
            stick,
            stick_sd,
        }
    }

    /// From images alone: the features that need more are set to 0, as in the fit of the trees.
    pub fn alone(&self, features: &Features) -> Prediction {
        let mut seen = *features;
        seen[GEOMETRIC_COUNT..].fill(0.0);
        let ((used, used_sd), (stick, stick_sd)) =
            (predict(&self.alone_used, &seen), predict(&self.alone_stick, &seen));
        Prediction { used, used_sd, log_used_sd: None, stick, stick_sd }
    }

    /// None when the table is invalid.
    pub fn parse(text: &str) -> Option<Trees> {
        let [used, used_error, stick, stick_error, alone_used, alone_used_error, alone_stick, alone_stick_error] =
            parse(text, NAMES, FEATURES_COUNT)?;
        Some(Trees {
            used: [used, used_error],
            stick: [stick, stick_error],
            alone_used: [alone_used, alone_used_error],
            alone_stick: [alone_stick, alone_stick_error],
        })
    }

    /// Number of trees of each ensemble.
    pub fn counts(&self) -> Vec<usize> {
        let all = [&self.used, &self.stick, &self.alone_used, &self.alone_stick];
        all.into_iter().flatten().map(Ensemble::trees_count).collect()
    }
}

/// The value and its standard deviation: the error ensemble predicts the mean absolute error.
fn predict([value, error]: &[Ensemble; 2], features: &Features) -> (f64, f64) {
    let (value, error) = (value.at(features), error.at(features));
    (value, (1.2533 * error).max(LEAST_SD))
}
