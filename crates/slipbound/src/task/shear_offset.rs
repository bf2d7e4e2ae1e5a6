//! Shear of a grip without load -> reports without it: a camera at an oblique angle measures an apparent shear of a
//! squeezed gel.

use crate::hand::{HandReport, HandVector};

/// Exponent with which the apparent shear grows with the grip force: 0.05, 0.14 and 0.23 mm at 10, 30 and 60 N on a
/// simulated cap seen by a camera at 40 deg.
const GROWTH: f64 = 0.85;

/// The shear of an unloaded grip, taken once.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ShearOffset {
    taken: Option<(f64, HandVector)>,
}

impl ShearOffset {
    /// Call it while the object is held with this force, before any load.
    pub fn take(&mut self, hand: &HandReport, pressed_n: Option<f64>) {
        if let (Some(shear_mm), Some(pressed_n)) = (hand.shear_mm, pressed_n.filter(|n| *n > 0.0)) {
            self.taken = Some((pressed_n, shear_mm));
        }
    }

    /// The report without the shear that the grip alone causes.
    pub fn correct(&self, hand: &HandReport, pressed_n: Option<f64>) -> HandReport {
        let (Some((at_n, offset_mm)), Some(shear_mm), Some(pressed_n)) = (self.taken, hand.shear_mm, pressed_n) else {
            return *hand;
        };
        let share = libm::pow(pressed_n.max(0.0) / at_n, GROWTH);
        let shear_mm = HandVector {
            along: shear_mm.along - share * offset_mm.along,
            across: shear_mm.across - share * offset_mm.across,
            around: shear_mm.around - share * offset_mm.around,
        };
        HandReport { shear_mm: Some(shear_mm), ..*hand }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::{Hand, Mounting, Side};

    /// A hand that feels this shear, mm.
    fn feels(shear_mm: Option<[f64; 3]>) -> HandReport {
        let report = Hand::new(&[Mounting::on(Side::Left)]).expect("one finger").report(0);
        let vector = |[along, across, around]: [f64; 3]| HandVector { along, across, around };
        HandReport { shear_mm: shear_mm.map(vector), quality: 0.7, ..report }
    }

    #[test]
    fn what_the_grip_alone_makes_of_the_shear_is_taken_out_at_any_force() {
        // The squeeze of a simulated cap: 0.05, 0.14 and 0.23 mm at 10, 30 and 60 N; taken at 10 N the remainder is
        // noise.
        let mut offset = ShearOffset::default();
        offset.take(&feels(Some([0.05, -0.1, 0.2])), Some(10.0));
        for (pressed_n, grown) in [(10.0, 1.0), (30.0, 2.544), (60.0, 4.586), (5.0, 0.5548), (0.0, 0.0), (-1.0, 0.0)] {
            let squeezed = [0.05 * grown + 1.0, -0.1 * grown + 2.0, 0.2 * grown - 3.0];
            let seen = offset.correct(&feels(Some(squeezed)), Some(pressed_n));
            let HandVector { along, across, around } = seen.shear_mm.expect("felt");
            let off = (along - 1.0).abs().max((across - 2.0).abs()).max((around + 3.0).abs());
            assert!(off < 1e-3, "{pressed_n} N: {along} {across} {around}");
            assert_eq!(seen.quality, 0.7, "the rest of the report stays");
        }
    }

    #[test]
    fn what_is_not_known_is_not_corrected() {
        let loaded = feels(Some([1.0, 2.0, 3.0]));
        let mut offset = ShearOffset::default();
        assert_eq!(offset.correct(&loaded, Some(10.0)), loaded, "never taken");
        for (hand, pressed_n) in [(feels(None), Some(10.0)), (loaded, None), (loaded, Some(0.0)), (loaded, Some(-1.0))]
        {
            offset.take(&hand, pressed_n);
            assert_eq!(offset.correct(&loaded, Some(10.0)), loaded, "taken from {pressed_n:?}, {:?}", hand.shear_mm);
        }
        offset.take(&loaded, Some(10.0));
        assert_eq!(offset.correct(&loaded, None), loaded);
        assert_eq!(offset.correct(&feels(None), Some(10.0)), feels(None));
        assert_eq!(offset.correct(&loaded, Some(10.0)).shear_mm, Some(HandVector::default()));
    }
}
