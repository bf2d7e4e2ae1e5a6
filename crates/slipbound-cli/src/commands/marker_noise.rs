//! The motion of a finger's markers while nothing should move: for `doctor` and `tare`.

use slipbound::monitor::{SlipMonitor, SlipState};
use slipbound::plane::Vec2;
use slipbound::port::FrameBuffer;

/// A finger seen over some frames in which nothing should touch it.
pub struct MarkerNoise {
    /// RMS distance of every marker from its mean position over the untouched frames, px, in ascending order; without
    /// markers seen there fewer than three times.
    pub noise_px: Vec<f64>,
    /// Median over these markers of the distance from the mean position to that in the rest frame, px.
    pub drift_px: Option<f64>,
    /// Number of markers followed through three frames or more, touched or not.
    pub followed_count: usize,
    /// The first frame that shows a contact.
    pub touched_seq: Option<u64>,
    /// Number of frames that show one.
    pub touched_count: usize,
}

impl MarkerNoise {
    /// Judges the frames. `noisy`: numbers of the frames whose noise is measured.
    pub fn measure<'a>(
        frames: impl IntoIterator<Item = &'a FrameBuffer>,
        monitor: &mut SlipMonitor,
        noisy: impl Fn(u64) -> bool,
    ) -> Self {
        let markers_count = monitor.markers().len();
        let (mut scatters, mut seen_counts) = (vec![Scatter::default(); markers_count], vec![0; markers_count]);
        let (mut touched_seq, mut touched_count) = (None, 0);
        for frame in frames.into_iter().filter_map(|frame| frame.frame().ok()) {
            let report = monitor.step(&frame, None);
            let is_touched = !matches!(report.state, SlipState::NoContact | SlipState::Unjudged);
            if is_touched {
                touched_seq = touched_seq.or(Some(report.seq));
                touched_count += 1;
            }
            let is_wanted = !is_touched && noisy(report.seq);
            let seen = scatters.iter_mut().zip(&mut seen_counts).zip(monitor.markers());
            for ((scatter, seen_count), marker) in seen.filter(|(_, marker)| marker.matched) {
                *seen_count += 1;
                if is_wanted {
                    scatter.see(marker.now_from_rest());
                }
            }
        }
        let sorted = |of: fn(&Scatter) -> Option<f64>| {
            let mut values: Vec<f64> = scatters.iter().filter_map(of).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let drifts_px = sorted(Scatter::drift_px);
        MarkerNoise {
            noise_px: sorted(Scatter::rms_px),
            drift_px: drifts_px.get(drifts_px.len() / 2).copied(),
            followed_count: seen_counts.iter().filter(|count| **count >= 3).count(),
            touched_seq,
            touched_count,
        }
    }

    /// The noise of the median and of the worst marker, in words; None where no marker was seen often enough.
    pub fn noise(&self) -> Option<(f64, String)> {
        let (median_px, worst_px) = (*self.noise_px.get(self.noise_px.len() / 2)?, self.noise_px.last()?);
        let words = format!("{median_px:.3} px in the middle, {worst_px:.3} px at worst, of a marker at rest");
        Some((median_px, words))
    }
}

/// Sums over a marker's positions, for its scatter.
#[derive(Debug, Clone, Copy, Default)]
struct Scatter {
    count: f64,
    sum: (f64, f64),
    sum_of_squares: f64,
}

impl Scatter {
    fn see(&mut self, at: Vec2) {
        self.count += 1.0;
        self.sum = (self.sum.0 + at.x, self.sum.1 + at.y);
        self.sum_of_squares += at.x * at.x + at.y * at.y;
    }

    /// RMS distance from its mean position, px; None before it was seen three times.
    fn rms_px(&self) -> Option<f64> {
        let mean_square = (self.sum.0 * self.sum.0 + self.sum.1 * self.sum.1) / (self.count * self.count);
        (self.count >= 3.0).then(|| (self.sum_of_squares / self.count - mean_square).max(0.0).sqrt())
    }

    /// Distance of its mean position from its position at rest, px; None before it was seen three times.
    fn drift_px(&self) -> Option<f64> {
        (self.count >= 3.0).then(|| Vec2::new(self.sum.0 / self.count, self.sum.1 / self.count).length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_of_a_marker_is_its_scatter_and_its_drift_is_not() {
        let mut scatter = Scatter::default();
        for (x, y) in [(5.0, 1.0), (5.2, 1.0), (4.8, 1.0), (5.0, 1.0)] {
            scatter.see(Vec2::new(x, y));
        }
        let (rms_px, drift_px) = (scatter.rms_px(), scatter.drift_px());
        let (rms_px, drift_px) = (rms_px.expect("seen often enough"), drift_px.expect("seen often enough"));
        assert!((rms_px - (0.08f64 / 4.0).sqrt()).abs() < 1e-6, "{rms_px}");
        assert!((drift_px - 26f64.sqrt()).abs() < 1e-9, "{drift_px}");
    }
}
