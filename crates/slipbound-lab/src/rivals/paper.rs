//! The rule of Dong, Ma, Donlon and Rodriguez (ICRA 2019): the inner region moves as a rigid body, and it is slip if
//! more than N markers deviate from that motion by more than 4.5 px.

use super::detector::Detector;
use super::reference::Reference;
use slipbound::monitor::{SlipMonitor, SlipReport, SlipSettings, fit_similarity};

/// Score: the slip of the marker that decides, the k-th longest, over 4.5 px at the paper's pitch. 1 is the paper's
/// threshold.
fn kth_over_threshold(slips_px: &mut [f64], needed_count: u32, threshold_px: f64) -> f64 {
    slips_px.sort_by(|a, b| b.total_cmp(a));
    let kth = slips_px.get(needed_count.saturating_sub(1) as usize);
    kth.map_or(0.0, |slip_px| slip_px / threshold_px)
}

/// The rule on our markers and our contact.
#[derive(Debug, Clone, Default)]
pub struct Paper {
    reference: Reference,
    slips_px: Vec<f64>,
}

impl Detector for Paper {
    fn see(&mut self, monitor: &SlipMonitor, report: &SlipReport) -> f64 {
        let moved = self.reference.moved(monitor, report);
        let inner = moved.iter().filter(|m| m.inner).map(|m| (m.from_px, m.from_px + m.by_px));
        self.slips_px.clear();
        let Some(motion) = fit_similarity(inner) else { return 0.0 };
        let rigid_px = |m: &super::reference::Moved| motion.displacement_small_angle(m.from_px);
        self.slips_px.extend(moved.iter().map(|m| (m.by_px - rigid_px(m)).length()));
        let settings = SlipSettings::default();
        let needed_count = settings.over_needed_count(monitor.markers().len());
        let threshold_px = settings.threshold_pitch * monitor.sensor().pitch_px;
        kth_over_threshold(&mut self.slips_px, needed_count, threshold_px)
    }

    fn threshold(&self) -> f64 {
        1.0
    }

    fn restart(&mut self) {
        self.reference.restart();
    }
}

/// The complete method of the paper: a monitor with its settings, its markers, its contact, its reference.
#[derive(Debug, Clone, Copy, Default)]
pub struct PaperAsWritten;

impl Detector for PaperAsWritten {
    fn see(&mut self, monitor: &SlipMonitor, report: &SlipReport) -> f64 {
        let mut slips_px: Vec<f64> =
            monitor.markers().iter().filter(|m| m.in_contact).map(|m| m.slip.length()).collect();
        let threshold_px = report.slip.threshold_pitch * monitor.sensor().pitch_px;
        if threshold_px > 0.0 {
            kth_over_threshold(&mut slips_px, report.slip.markers_needed, threshold_px)
        } else {
            0.0
        }
    }

    fn threshold(&self) -> f64 {
        1.0
    }

    /// The monitor keeps the reference.
    fn restart(&mut self) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_eighth_marker_decides() {
        let mut slips_px: Vec<f64> = (1..=10).map(f64::from).collect();
        assert_eq!(kth_over_threshold(&mut slips_px, 8, 1.5), 2.0);
        assert_eq!(kth_over_threshold(&mut slips_px, 11, 1.5), 0.0);
    }
}
