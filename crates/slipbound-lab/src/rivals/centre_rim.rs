//! Centre against rim, after Dong, Yuan and Adelson (IROS 2017): slip starts at the border of the contact, whose
//! markers then lag behind those of the middle.

use super::detector::Detector;
use super::reference::{LEAST_COUNT, Moved, Reference, middle_px};
use slipbound::monitor::{SlipMonitor, SlipReport};

/// Displacement added to both means, in pitches: the ratio of two small displacements contains no information.
const NONE_PITCH: f64 = 0.05;

/// Ratio above which it raises an alarm. Ours, see docs/eval.md.
const THRESHOLD_RATIO: f64 = 1.4;

/// Score: mean displacement of the third of the markers in contact nearest to its middle over that of the outermost
/// third, each with 0.05 pitch added.
#[derive(Debug, Clone, Default)]
pub struct CentreRim {
    reference: Reference,
    by_radius: Vec<(f64, f64)>,
}

/// Fills in radius and displacement length, the smallest radius first.
fn sort_by_radius(moved: &[Moved], into: &mut Vec<(f64, f64)>) {
    let middle_px = middle_px(moved);
    into.clear();
    into.extend(moved.iter().map(|m| ((m.from_px - middle_px).length_squared(), m.by_px.length())));
    into.sort_by(|a, b| a.0.total_cmp(&b.0));
}

/// The ratio for markers sorted by radius.
fn ratio(by_radius: &[(f64, f64)], none_px: f64) -> f64 {
    let third = by_radius.len() / 3;
    let mean_px = |part: &[(f64, f64)]| part.iter().map(|m| m.1).sum::<f64>() / part.len() as f64;
    (mean_px(&by_radius[..third]) + none_px) / (mean_px(&by_radius[by_radius.len() - third..]) + none_px)
}

impl Detector for CentreRim {
    fn see(&mut self, monitor: &SlipMonitor, report: &SlipReport) -> f64 {
        let moved = self.reference.moved(monitor, report);
        if moved.len() < LEAST_COUNT {
            return 0.0;
        }
        sort_by_radius(moved, &mut self.by_radius);
        ratio(&self.by_radius, NONE_PITCH * monitor.sensor().pitch_px)
    }

    fn threshold(&self) -> f64 {
        THRESHOLD_RATIO
    }

    fn restart(&mut self) {
        self.reference.restart();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::plane::Vec2;

    #[test]
    fn a_rim_that_lags_behind_raises_the_ratio() {
        let markers = |rim_px: f64| -> Vec<Moved> {
            (0..81)
                .map(|i| {
                    let from_px = Vec2::new(f64::from(i % 9) - 4.0, f64::from(i / 9) - 4.0) * 10.0;
                    let by_px = Vec2::new(if from_px.length() > 35.0 { rim_px } else { 4.0 }, 0.0);
                    Moved { from_px, by_px, inner: false }
                })
                .collect()
        };
        let mut by_radius = Vec::new();
        sort_by_radius(&markers(4.0), &mut by_radius);
        assert_eq!(ratio(&by_radius, 0.5), 1.0, "all alike");
        sort_by_radius(&markers(1.0), &mut by_radius);
        assert!(ratio(&by_radius, 0.5) > 2.0, "{}", ratio(&by_radius, 0.5));
    }
}
