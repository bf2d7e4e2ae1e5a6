//! Shear load by the sum over all markers: each stands for a patch of a pitch squared.

use crate::monitor::report::Marker;
use crate::plane::Vec2;

/// The apparent load of a squeeze alone, as a share of the grip force, is at most this: a camera that looks askance at 40 deg
/// sees 0.03, one that looks straight 0.01 (simulated; the squeezed volume of a bonded layer grows in proportion to the
/// force).
const MOST_TARE_FRACTION: f64 = 0.06;

/// Load of a finger along its surface, divided by the shear stiffness: displacement times area.
#[derive(Debug, Clone)]
pub(super) struct Load {
    /// Area that each marker stands for, px2.
    areas_px2: Vec<f64>,
    /// Sum over all markers of displacement from rest times area, px3.
    pub sum_px3: Vec2,
    /// What of it the squeeze makes: for a grip force of 1 N where that is known, else altogether.
    tare_px3: Vec2,
    per_newton: bool,
}

impl Load {
    /// `inside`: least and largest place at which a marker has neighbours all around. Those beyond stand for the gel past the
    /// border of the view as well: displacement falls off over `skirt_px` there.
    pub fn new(markers: &[Marker], pitch_px: f64, skirt_px: f64, inside: (Vec2, Vec2)) -> Self {
        let (low, high) = inside;
        let border = |p: Vec2| p.x < low.x || p.y < low.y || p.x > high.x || p.y > high.y;
        let area = |m: &Marker| pitch_px * (pitch_px + if border(m.rest) { skirt_px } else { 0.0 });
        Load {
            areas_px2: markers.iter().map(area).collect(),
            sum_px3: Vec2::ZERO,
            tare_px3: Vec2::ZERO,
            per_newton: false,
        }
    }

    /// A new contact.
    pub fn clear(&mut self) {
        (self.sum_px3, self.tare_px3, self.per_newton) = (Vec2::ZERO, Vec2::ZERO, false);
    }

    /// Markers with the area of each. One that is not found counts where its neighbours expect it, one that the border
    /// cuts says nothing.
    fn seen<'a>(&'a self, markers: &'a [Marker]) -> impl Iterator<Item = (&'a Marker, f64)> {
        markers.iter().zip(self.areas_px2.iter().copied()).filter(|(m, _)| m.whole || !m.matched)
    }

    /// Takes the sum of a frame.
    pub fn sum(&mut self, markers: &[Marker]) {
        self.sum_px3 = self.seen(markers).fold(Vec2::ZERO, |sum, (m, area)| sum + m.now_from_rest() * area);
    }

    /// Nothing pulled when the markers were moved so from rest: that sum comes from the squeeze alone.
    pub fn tare(
        &mut self,
        from_rest: impl Fn(&Marker) -> Vec2,
        markers: &[Marker],
        grip_n: Option<f64>,
        stiffness_over_grip: Option<f64>,
    ) {
        self.per_newton = grip_n.is_some_and(|n| n > 0.0);
        let most = stiffness_over_grip.map_or(f64::MAX, |k| MOST_TARE_FRACTION / k);
        let sum_px3 = self.seen(markers).fold(Vec2::ZERO, |sum, (m, area)| sum + from_rest(m) * area);
        let length = sum_px3.length();
        let kept = if length > most { most / length } else { 1.0 };
        self.tare_px3 = sum_px3 * kept / grip_n.filter(|n| *n > 0.0).unwrap_or(1.0);
    }

    /// Load in the plane, px3.
    pub fn force_px3(&self, grip_n: Option<f64>) -> Vec2 {
        let times = if self.per_newton { grip_n.unwrap_or(0.0) } else { 1.0 };
        self.sum_px3 - self.tare_px3 * times
    }

    /// Area that all markers stand for, px2.
    #[cfg(test)]
    pub fn area_px2(&self) -> f64 {
        self.areas_px2.iter().sum()
    }

    /// Moment about a point, positive from x to y, px4.
    pub fn moment_px4(&self, markers: &[Marker], about: Vec2, under_load: impl Fn(&Marker) -> Vec2) -> f64 {
        self.seen(markers).map(|(m, area)| area * (m.rest - about).cross(under_load(m))).sum()
    }
}
