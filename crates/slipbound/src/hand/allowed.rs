//! Slip that a task allows: a report of the hand -> the same without slip in these directions.

use super::report::{HandReport, HandSlip, HandVector};
use crate::monitor::SlipState;
use serde::{Deserialize, Serialize};

/// Directions in which a task allows the object to slide, for example along a thread but not around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Allowed {
    /// Along the fingers.
    pub along: bool,
    /// Across them.
    pub across: bool,
    /// Around the axis along them.
    pub around: bool,
    /// Pivoting about the axis through both.
    pub pivot: bool,
}

/// Sine of the angle, 30 deg, by which a slip may deviate from an allowed direction.
const STRAY_SIN: f64 = 0.5;

impl Allowed {
    /// Whether this slip is in a direction that is not allowed.
    pub fn forbids(&self, slip: &HandSlip) -> bool {
        let d = slip.direction;
        let outside = self.outside(d);
        // It slides in an unknown direction, or the fingers disagree: not allowed unless all directions are.
        let is_unknown = d.length() == 0.0 && !slip.pivots && !(self.along && self.across && self.around);
        let slides = d.length() > 0.0 && outside.length() > STRAY_SIN;
        let pivots = slip.pivots && !self.pivot;
        slides || pivots || is_unknown
    }

    /// The components in directions that are not allowed.
    pub(crate) fn outside(&self, vector: HandVector) -> HandVector {
        let part = |component: f64, allowed: bool| if allowed { 0.0 } else { component };
        HandVector {
            along: part(vector.along, self.along),
            across: part(vector.across, self.across),
            around: part(vector.around, self.around),
        }
    }

    /// The report as a controller should see it: without slip in an allowed direction, and without the margin that this
    /// motion has used up.
    pub fn filter(&self, report: &HandReport) -> HandReport {
        match report.slip {
            Some(slip) if !self.forbids(&slip) => {
                HandReport { state: SlipState::Stick, slip: None, margin: None, margins_count: 0, ..*report }
            }
            _ => *report,
        }
    }
}
