//! Clips with labels -> the scale of the evidence, with an object left out.

use crate::eval::clip_verdict::Latch;
use crate::eval::statistics::median;
use slipbound::monitor::{EvidenceScale, EvidenceSettings};

/// A clip for the fit of a scale.
#[derive(Debug, Clone, Copy)]
pub(super) struct Example<'a> {
    /// The held object.
    pub object: &'a str,
    /// Whether it slipped.
    pub slips: bool,
    /// Its evidence.
    pub latch: Latch,
}

/// The scale on which the medians of held and of slipped clips are 0 and 1; None unless there are examples of both.
fn fit<'a>(examples: impl Iterator<Item = Example<'a>> + Clone) -> Option<EvidenceSettings> {
    let scale = |value: fn(&Latch) -> f64| {
        let of = |slips: bool| {
            let some: Vec<f64> = examples.clone().filter(|e| e.slips == slips).map(|e| value(&e.latch)).collect();
            median(&some).value
        };
        Some(EvidenceScale { held: of(false)?, slid: of(true)? })
    };
    let mut settings = EvidenceSettings::default();
    settings.relaxation = scale(|latch| latch.relaxation)?;
    settings.centre_rim_ratio = scale(|latch| latch.centre_rim_ratio.unwrap_or(0.0))?;
    settings.imprint_change = scale(|latch| latch.imprint_change.unwrap_or(0.0))?;
    Some(settings)
}

/// The scale for clips of an object, fitted to those of all other objects.
pub(super) fn left_out_scale(examples: &[Example<'_>], object: &str) -> Option<EvidenceSettings> {
    fit(examples.iter().filter(|other| other.object != object).copied())
}
