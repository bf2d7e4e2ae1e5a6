//! Evidence from the lengths of marker displacements: relaxation, and how evenly the contact is carried along.
//!
//! ```text
//!   |u|  ___/\        relaxation: the gel springs back        |u|   o O O o    sticking: the middle is carried further
//!      _/    \___     once the object slides over it               o O O O o   than the rim; sliding: far more so
//! ```

use crate::monitor::report::Marker;
use crate::plane::Vec2;

/// Percentile of the displacements that represents the field: one marker in ten may be wrong.
const FIELD_PERCENTILE: f64 = 0.90;

/// Added to the largest displacement, in pitches: ten times the noise of a marker, so that noise is no relaxation.
const STILL_PITCH: f64 = 0.02;

/// Markers displaced by less than this share of the 95th percentile do not count as carried along.
const CARRIED_FRACTION: f64 = 0.35;

/// Evidence from the displacement since the reference.
#[derive(Debug, Clone, Default)]
pub(super) struct Field {
    lengths: Vec<f64>,
    /// Distance from the middle of the markers carried along, and displacement.
    carried: Vec<(f64, f64)>,
    distances: Vec<f64>,
    /// Largest 90th percentile since the reference, px.
    most_px: f64,
    /// That percentile now, px.
    pub(super) now_px: f64,
    pub(super) relaxation: f64,
    pub(super) centre_rim_ratio: Option<f64>,
}

impl Field {
    pub(super) fn new(markers_count: usize) -> Self {
        Field {
            lengths: Vec::with_capacity(markers_count),
            carried: Vec::with_capacity(markers_count),
            distances: Vec::with_capacity(markers_count),
            ..Field::default()
        }
    }

    /// Starts from a new reference.
    pub(super) fn restart(&mut self) {
        (self.most_px, self.now_px, self.relaxation, self.centre_rim_ratio) = (0.0, 0.0, 0.0, None);
    }

    /// Adds a frame: positions of the markers in the reference frame, and now.
    pub(super) fn take(&mut self, reference_px: &[Vec2], markers: &[Marker], pitch_px: f64) {
        let still_px = STILL_PITCH * pitch_px;
        let seen = || markers.iter().zip(reference_px).filter(|(m, _)| m.matched);
        self.lengths.clear();
        self.lengths.extend(seen().map(|(m, &reference)| (m.now - reference).length()));
        self.now_px = percentile(&mut self.lengths, FIELD_PERCENTILE);
        self.most_px = self.most_px.max(self.now_px);
        self.relaxation = (self.most_px - self.now_px) / (self.most_px + still_px);
        let high_px = percentile(&mut self.lengths, 0.95);
        self.centre_rim_ratio = None;
        if high_px < still_px {
            return;
        }
        let carried = || seen().filter(|(m, r)| (m.now - **r).length() > CARRIED_FRACTION * high_px);
        let (mut centre, mut count) = (Vec2::ZERO, 0.0);
        for (_, &reference) in carried() {
            centre += reference;
            count += 1.0;
        }
        centre = centre / count;
        self.carried.clear();
        self.carried.extend(carried().map(|(m, &r)| ((r - centre).length(), (m.now - r).length())));
        self.distances.clear();
        self.distances.extend(self.carried.iter().map(|&(distance, _)| distance));
        let third = (self.carried.len() / 3).max(1);
        let last = self.carried.len() - third;
        let inner_px = *self.distances.select_nth_unstable_by(third - 1, f64::total_cmp).1;
        let outer_px = *self.distances.select_nth_unstable_by(last, f64::total_cmp).1;
        let mean = |belongs: &dyn Fn(f64) -> bool| {
            let some = || self.carried.iter().filter(|(distance, _)| belongs(*distance)).map(|(_, moved)| moved);
            some().sum::<f64>() / some().count() as f64
        };
        self.centre_rim_ratio = Some(mean(&|distance| distance <= inner_px) / mean(&|distance| distance >= outer_px));
    }
}

/// The value below which a share of them lies, interpolated between two of them. Reorders them.
fn percentile(values: &mut [f64], share: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    let at = share * last as f64;
    let (_, &mut below, above) = values.select_nth_unstable_by(at as usize, f64::total_cmp);
    let next = above.iter().copied().min_by(f64::total_cmp).unwrap_or(below);
    below + (at - at.floor()) * (next - below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_percentile_lies_between_two_values() {
        let mut values = [3.0, 0.0, 4.0, 1.0, 2.0];
        for (share, value) in [(0.0, 0.0), (0.5, 2.0), (0.9, 3.6), (1.0, 4.0)] {
            assert!((percentile(&mut values, share) - value).abs() < 1e-12, "{share}");
        }
        assert_eq!(percentile(&mut [], 0.5), 0.0);
    }
}
