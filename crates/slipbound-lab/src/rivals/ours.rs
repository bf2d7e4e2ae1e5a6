//! The shipped verdict.

use super::detector::Detector;
use slipbound::monitor::{Estimate, SlipKind, SlipMonitor, SlipReport, SlipState};

/// Reads the monitor's own report.
#[derive(Debug, Clone, Copy, Default)]
pub struct Ours;

impl Detector for Ours {
    fn see(&mut self, _: &SlipMonitor, report: &SlipReport) -> f64 {
        score(report)
    }

    fn threshold(&self) -> f64 {
        1.0
    }

    /// The monitor keeps its reference itself.
    fn restart(&mut self) {}

    fn alarms(&self, _: f64, report: &SlipReport) -> bool {
        matches!(report.state, SlipState::Incipient | SlipState::Gross)
    }
}

/// The evidence behind the verdict as one number: the used fraction of the load over the alarm threshold; 0 without an
/// estimate.
fn score(report: &SlipReport) -> f64 {
    let judged = matches!(report.state, SlipState::Stick | SlipState::Incipient | SlipState::Gross | SlipState::Unsure);
    let margin = report.estimates.margin.map(|margin| (1.0 - margin.value) / 0.5);
    let score = margin.unwrap_or(0.0);
    if judged && score.is_finite() { score } else { 0.0 }
}

/// The estimates of a report besides its state. None if absent.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReportEstimates {
    /// Stick ratio of the contact.
    pub stick_ratio: Option<Estimate>,
    /// Slip margin, 1 - f.
    pub margin: Option<Estimate>,
    /// Tangential force, N.
    pub shear_n: Option<Estimate>,
    /// Torque about the contact's middle, N mm, positive from x to y.
    pub torque_n_mm: Option<Estimate>,
    /// Friction coefficient.
    pub friction: Option<Estimate>,
    /// Kind of slip.
    pub kind: Option<SlipKind>,
    /// Sliding direction of the object, rad.
    pub direction_rad: Option<f64>,
    /// Rotation of the object, rad, positive from x to y.
    pub rotation_rad: Option<f64>,
}

/// Reads a report: the only place where its estimates enter the scores.
pub fn estimates_of(report: &SlipReport) -> ReportEstimates {
    let estimates = &report.estimates;
    ReportEstimates {
        stick_ratio: estimates.stick_ratio,
        margin: estimates.margin,
        shear_n: estimates.shear_n,
        torque_n_mm: estimates.torque_nmm,
        friction: estimates.friction,
        kind: report.slip.kind,
        direction_rad: report.slip.direction_rad,
        rotation_rad: report.shear.map(|shear| shear.rotation_rad),
    }
}
