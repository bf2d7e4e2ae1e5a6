//! Taring the shear: what it reads without any load, since a camera that looks askance sees a squeezed gel shifted.

use crate::hand::{HandReport, HandVector};

/// Power of the grip force with which the apparent shear grows: 0.05, 0.14 and 0.23 mm at 10, 30 and 60 N on a
/// simulated cap seen by a camera at 40 deg.
const GROWTH: f64 = 0.85;

/// The shear of an unloaded grip, taken once.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tare {
    taken: Option<(f64, HandVector)>,
}

impl Tare {
    /// The object is held with this force and nothing pulls at it yet.
    pub fn take(&mut self, hand: &HandReport, pressed_n: Option<f64>) {
        if let (Some(shear_mm), Some(pressed_n)) = (hand.shear_mm, pressed_n.filter(|n| *n > 0.0)) {
            self.taken = Some((pressed_n, shear_mm));
        }
    }

    /// The report with what the grip alone makes of the shear taken out.
    pub fn correct(&self, hand: &HandReport, pressed_n: Option<f64>) -> HandReport {
        let (Some((at_n, tare_mm)), Some(shear_mm), Some(pressed_n)) = (self.taken, hand.shear_mm, pressed_n) else {
            return *hand;
        };
        let share = libm::pow(pressed_n.max(0.0) / at_n, GROWTH);
        let shear_mm = HandVector {
            along: shear_mm.along - share * tare_mm.along,
            across: shear_mm.across - share * tare_mm.across,
            around: shear_mm.around - share * tare_mm.around,
        };
        HandReport { shear_mm: Some(shear_mm), ..*hand }
    }
}
