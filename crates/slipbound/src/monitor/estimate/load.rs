//! Shear load as the sum over all markers: each represents a patch of a pitch squared, or more at the border of the
//! view.

use crate::monitor::report::Marker;
use crate::plane::Vec2;
use crate::sensor::Sensor;
use crate::smoothing;

/// Largest apparent load of a squeeze alone, as a share of the grip force: a camera tilted by 40 deg sees 0.03, one
/// that looks straight 0.01 (simulated; the squeezed volume of a bonded layer grows in proportion to the force).
const MOST_SQUEEZE_FRACTION: f64 = 0.06;

/// Time constant with which the area beyond a border marker joins the contact, s: a marker that enters and leaves the
/// contact must not make the load jump.
const JOINS_S: f64 = 0.1;

/// Area that a marker represents.
///
/// ```text
///                            border of the view
///   inside              |  o  |  :
///   at the border, free    |  o  :  . . .             and the dragged gel, over which displacement falls off
///   there, in contact      |  o  :  = = = = = =|      and all of the gel beyond
/// ```
#[derive(Debug, Clone, Copy, Default)]
struct Patch {
    /// Area without contact, px2: beyond the border, displacement falls off over the gel that is dragged along.
    free_px2: f64,
    /// Additional area, and area out of view, px2, in contact: the contact extends to the end of the gel. 0 where that
    /// is unknown.
    more_px2: f64,
    hidden_px2: f64,
    /// In contact: the whole area in pitches squared, 1 inside, and the way from the marker to its middle, px.
    whole_pitch2: f64,
    to_middle_px: Vec2,
    /// Whether the marker is at the border.
    at_border: bool,
    /// Degree to which it counts as in contact, 0 to 1.
    joined_fraction: f64,
}

impl Patch {
    fn area_px2(&self) -> f64 {
        self.free_px2 + self.joined_fraction * self.more_px2
    }
}

/// Time constant with which the middle of the contact is smoothed, s.
const MIDDLE_S: f64 = 0.1;

/// The middle of the contact on the squeezed gel, about which torque is reported. The middle of the markers in contact
/// is off by a fifth of a pitch, since few are at the rim. That of the region is off by less, but follows the visible
/// imprint. The mean of both is off by less than either. With an error of 0.3 mm, a pull of 20 N makes a torque of 6 N
/// mm.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Middle {
    px: Option<Vec2>,
}

impl Middle {
    /// Adds the middles of a frame, `elapsed_s` after the last; that of the region where known. Both are positions
    /// without the load.
    pub fn see(&mut self, elapsed_s: f64, of_markers: Vec2, of_region: Option<Vec2>) -> Vec2 {
        let now = of_region.map_or(of_markers, |of_region| (of_markers + of_region) / 2.0);
        let before = self.px.unwrap_or(now);
        let share = smoothing::weight(elapsed_s, MIDDLE_S);
        let px = before + (now - before) * share;
        self.px = Some(px);
        px
    }
}

/// Load of a finger along its surface, divided by the shear stiffness: displacement times area.
#[derive(Debug, Clone)]
pub(super) struct Load {
    patches: Vec<Patch>,
    /// Sum over all markers of displacement from rest times area, px3.
    pub sum_px3: Vec2,
    /// Part of the sum due to the squeeze: for a grip force of 1 N where that is known, else in total.
    squeeze_px3: Vec2,
    per_newton: bool,
}

impl Load {
    /// `inside`: smallest and largest position at which a marker has neighbours all around. Markers beyond also
    /// represent the gel out of view: over `drag_width_px`, or to the end of the gel.
    pub fn new(sensor: &Sensor, markers: &[Marker], drag_width_px: f64, inside: (Vec2, Vec2)) -> Self {
        let (pitch_px, size) = (sensor.pitch_px, sensor.rectified_px());
        let view_half = Vec2::new(size.width as f64, size.height as f64) / 2.0;
        let middle = view_half - Vec2::new(0.5, 0.5);
        let (low, high) = inside;
        let patch = |m: &Marker| {
            let at_border = [m.rest.x < low.x || m.rest.x > high.x, m.rest.y < low.y || m.rest.y > high.y];
            let free_px2 = pitch_px * (pitch_px + if at_border.contains(&true) { drag_width_px } else { 0.0 });
            let free = Patch { free_px2, whole_pitch2: 1.0, at_border: at_border.contains(&true), ..Patch::default() };
            let Some(gel_half) = sensor.gel_half_px() else { return free };
            // Along each direction: the length that the marker represents in contact, and the part of it in view.
            let lengths = |at_border: bool, off_px: f64, gel_px: f64, view_px: f64| {
                let to = |end_px: f64| pitch_px / 2.0 + (end_px - off_px).max(pitch_px / 2.0);
                if at_border { (to(gel_px.max(view_px)), to(view_px)) } else { (pitch_px, pitch_px) }
            };
            let off = m.rest - middle;
            let (x_px, x_seen_px) = lengths(at_border[0], off.x.abs(), gel_half.x, view_half.x);
            let (y_px, y_seen_px) = lengths(at_border[1], off.y.abs(), gel_half.y, view_half.y);
            let hidden_px2 = x_px * y_px - x_seen_px * y_seen_px;
            let outward = |length_px: f64, off_px: f64| ((length_px - pitch_px) / 2.0).copysign(off_px);
            Patch {
                more_px2: (x_px * y_px - free_px2).max(0.0),
                hidden_px2,
                whole_pitch2: (x_px / pitch_px) * (y_px / pitch_px),
                to_middle_px: Vec2::new(outward(x_px, off.x), outward(y_px, off.y)),
                ..free
            }
        };
        Load {
            patches: markers.iter().map(patch).collect(),
            sum_px3: Vec2::ZERO,
            squeeze_px3: Vec2::ZERO,
            per_newton: false,
        }
    }

    /// A new contact.
    pub fn clear(&mut self) {
        (self.sum_px3, self.squeeze_px3, self.per_newton) = (Vec2::ZERO, Vec2::ZERO, false);
        self.patches.iter_mut().for_each(|patch| patch.joined_fraction = 0.0);
    }

    /// Markers with their areas. A marker that is not found or is cut by the border counts at the position expected
    /// from its neighbours: otherwise a whole column would be missing from the load until it is out of view.
    fn weighed<'a>(&'a self, markers: &'a [Marker]) -> impl Iterator<Item = (&'a Marker, f64)> {
        markers.iter().zip(self.patches.iter().map(Patch::area_px2))
    }

    /// Computes the sum of a frame, `elapsed_s` after the last.
    pub fn sum(&mut self, elapsed_s: f64, markers: &[Marker]) {
        let share = smoothing::weight(elapsed_s, JOINS_S);
        for (patch, m) in self.patches.iter_mut().zip(markers) {
            let joined_fraction = if m.in_contact { 1.0 } else { 0.0 };
            patch.joined_fraction += share * (joined_fraction - patch.joined_fraction);
        }
        self.sum_px3 = self.weighed(markers).fold(Vec2::ZERO, |sum, (m, area)| sum + m.now_from_rest() * area);
    }

    /// From here on the load does not include these displacements from rest, which are due to the squeeze alone.
    pub fn subtract_squeeze(
        &mut self,
        from_rest: impl Fn(&Marker) -> Vec2,
        markers: &[Marker],
        grip_n: Option<f64>,
        stiffness_over_grip: Option<f64>,
    ) {
        self.per_newton = grip_n.is_some_and(|n| n > 0.0);
        let most = stiffness_over_grip.map_or(f64::MAX, |k| MOST_SQUEEZE_FRACTION / k);
        let sum_px3 = self.weighed(markers).fold(Vec2::ZERO, |sum, (m, area)| sum + from_rest(m) * area);
        let length = sum_px3.length();
        let kept = if length > most { most / length } else { 1.0 };
        self.squeeze_px3 = sum_px3 * kept / grip_n.filter(|n| *n > 0.0).unwrap_or(1.0);
    }

    /// Load in the plane, px3.
    pub fn force_px3(&self, grip_n: Option<f64>) -> Vec2 {
        let times = if self.per_newton { grip_n.unwrap_or(0.0) } else { 1.0 };
        self.sum_px3 - self.squeeze_px3 * times
    }

    /// Share of the contact, counted in markers, that is at the border of the view.
    pub fn cut_fraction(&self) -> f64 {
        let joined = || self.patches.iter().map(|patch| patch.joined_fraction);
        let at_border = self.patches.iter().filter(|patch| patch.at_border);
        at_border.map(|patch| patch.joined_fraction).sum::<f64>() / joined().sum::<f64>().max(1.0)
    }

    /// Area of the contact that is out of view, px2.
    pub fn hidden_px2(&self) -> f64 {
        self.patches.iter().map(|patch| patch.joined_fraction * patch.hidden_px2).sum()
    }

    /// Mean distance of the whole contact from `about` over that of its markers: more than 1 where some of it is out of
    /// view.
    pub fn lever_gain(&self, markers: &[Marker], about: Vec2) -> f64 {
        let (mut whole, mut seen) = ((0.0, 0.0), (0.0, 0.0));
        for (patch, m) in self.patches.iter().zip(markers) {
            let (area, joined) = (patch.joined_fraction * patch.whole_pitch2, patch.joined_fraction);
            whole = (whole.0 + area * (m.rest + patch.to_middle_px - about).length(), whole.1 + area);
            seen = (seen.0 + joined * (m.rest - about).length(), seen.1 + joined);
        }
        let mean = |(sum, weight): (f64, f64)| sum / weight;
        if whole.1 > 0.0 && seen.0 > 0.0 { mean(whole) / mean(seen) } else { 1.0 }
    }

    /// Area that all markers represent, px2.
    #[cfg(test)]
    pub fn area_px2(&self) -> f64 {
        self.patches.iter().map(Patch::area_px2).sum()
    }

    /// Moment about a point in rest coordinates of the gel, positive from x to y, px4: for the features, whose trees
    /// were fitted with it.
    pub fn moment_px4(&self, markers: &[Marker], about: Vec2, under_load: impl Fn(&Marker) -> Vec2) -> f64 {
        self.weighed(markers).map(|(m, area)| area * (m.rest - about).cross(under_load(m))).sum()
    }

    /// Torque about a point of the squeezed gel, positive from x to y, px4. A press spreads the gel, by a twentieth of
    /// the lever and more at 60 N, and the load acts on the spread gel. Displacement by the load itself adds no torque:
    /// it is along the load.
    pub fn torque_px4(&self, markers: &[Marker], about: Vec2, under_load: impl Fn(&Marker) -> Vec2) -> f64 {
        let of = |(m, area): (&Marker, f64)| {
            let moved = under_load(m);
            area * (m.now - moved - about).cross(moved)
        };
        self.weighed(markers).map(of).sum()
    }
}
