//! Shear load by the sum over all markers: each stands for a patch of a pitch squared, at the border of the view for more.

use crate::monitor::report::Marker;
use crate::plane::Vec2;
use crate::sensor::Sensor;

/// The apparent load of a squeeze alone, as a share of the grip force, is at most this: a camera that looks askance at 40 deg
/// sees 0.03, one that looks straight 0.01 (simulated; the squeezed volume of a bonded layer grows in proportion to the
/// force).
const MOST_TARE_FRACTION: f64 = 0.06;

/// Time in which what lies beyond a marker at the border is taken into the contact, s: one that is in and out of it must not
/// make the load jump.
const JOINS_S: f64 = 0.1;

/// What a marker stands for.
///
/// ```text
///                            border of the view
///   inside              |  o  |  :
///   at the border, free    |  o  :  . . .             and the skirt, over which displacement falls off
///   there, in contact      |  o  :  = = = = = =|      and all of the gel beyond
/// ```
#[derive(Debug, Clone, Copy, Default)]
struct Patch {
    /// Area while it is free, px2: displacement falls off over the skirt beyond the border.
    free_px2: f64,
    /// Area by which that grows, and area out of view, px2, while it is in contact: that goes on to where the gel ends. 0 where that is
    /// unknown.
    more_px2: f64,
    hidden_px2: f64,
    /// Whether it is at the border.
    at_border: bool,
    /// How far it is taken to be in contact, 0 to 1.
    joined_fraction: f64,
}

impl Patch {
    fn area_px2(&self) -> f64 {
        self.free_px2 + self.joined_fraction * self.more_px2
    }
}

/// Time constant of the mean of where the middle of the contact is, s.
const MIDDLE_S: f64 = 0.1;

/// The middle of the contact on the squeezed gel, about which torque is told. That of the markers in contact is off by a fifth of a pitch,
/// since few are at the rim; that of the region by less, but it is where the picture shows an imprint; their mean is off by less than
/// either. A pull of 20 N beside it makes a torque of 6 N mm from 0.3 mm.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Middle {
    px: Option<Vec2>,
}

impl Middle {
    /// Takes the middles of a frame, so many seconds after the last; that of the region where it is known. Both are where the gel would be
    /// without the load.
    pub fn see(&mut self, seconds_s: f64, of_markers: Vec2, of_region: Option<Vec2>) -> Vec2 {
        let now = of_region.map_or(of_markers, |of_region| (of_markers + of_region) / 2.0);
        let before = self.px.unwrap_or(now);
        let share = 1.0 - libm::exp(-seconds_s / MIDDLE_S);
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
    /// What of it the squeeze makes: for a grip force of 1 N where that is known, else altogether.
    tare_px3: Vec2,
    per_newton: bool,
}

impl Load {
    /// `inside`: least and largest place at which a marker has neighbours all around. Those beyond stand for the gel past the
    /// border of the view as well: over `skirt_px`, or to the end of the gel.
    pub fn new(sensor: &Sensor, markers: &[Marker], skirt_px: f64, inside: (Vec2, Vec2)) -> Self {
        let (pitch_px, size) = (sensor.pitch_px, sensor.rectified_px());
        let view_half = Vec2::new(size.width as f64, size.height as f64) / 2.0;
        let middle = view_half - Vec2::new(0.5, 0.5);
        let (low, high) = inside;
        let patch = |m: &Marker| {
            let at_border = [m.rest.x < low.x || m.rest.x > high.x, m.rest.y < low.y || m.rest.y > high.y];
            let free_px2 = pitch_px * (pitch_px + if at_border.contains(&true) { skirt_px } else { 0.0 });
            let free = Patch { free_px2, at_border: at_border.contains(&true), ..Patch::default() };
            let Some(gel_half) = sensor.gel_half_px() else { return free };
            // Along each direction: what it stands for in contact, and what of that is in view.
            let lengths = |at_border: bool, off_px: f64, gel_px: f64, view_px: f64| {
                let to = |end_px: f64| pitch_px / 2.0 + (end_px - off_px).max(pitch_px / 2.0);
                if at_border { (to(gel_px.max(view_px)), to(view_px)) } else { (pitch_px, pitch_px) }
            };
            let off = m.rest - middle;
            let (x_px, x_seen_px) = lengths(at_border[0], off.x.abs(), gel_half.x, view_half.x);
            let (y_px, y_seen_px) = lengths(at_border[1], off.y.abs(), gel_half.y, view_half.y);
            let hidden_px2 = x_px * y_px - x_seen_px * y_seen_px;
            Patch { more_px2: (x_px * y_px - free_px2).max(0.0), hidden_px2, ..free }
        };
        Load {
            patches: markers.iter().map(patch).collect(),
            sum_px3: Vec2::ZERO,
            tare_px3: Vec2::ZERO,
            per_newton: false,
        }
    }

    /// A new contact.
    pub fn clear(&mut self) {
        (self.sum_px3, self.tare_px3, self.per_newton) = (Vec2::ZERO, Vec2::ZERO, false);
        self.patches.iter_mut().for_each(|patch| patch.joined_fraction = 0.0);
    }

    /// Markers with the area of each. One that is not found counts where its neighbours expect it, and so does, across the border, one that
    /// the border cuts: left out, a column of them would be missing from the load until the last of it is out of view.
    fn weighed<'a>(&'a self, markers: &'a [Marker]) -> impl Iterator<Item = (&'a Marker, f64)> {
        markers.iter().zip(self.patches.iter().map(Patch::area_px2))
    }

    /// Takes the sum of a frame, so many seconds after the last.
    pub fn sum(&mut self, seconds_s: f64, markers: &[Marker]) {
        let share = 1.0 - libm::exp(-seconds_s / JOINS_S);
        for (patch, m) in self.patches.iter_mut().zip(markers) {
            let joined_fraction = if m.in_contact { 1.0 } else { 0.0 };
            patch.joined_fraction += share * (joined_fraction - patch.joined_fraction);
        }
        self.sum_px3 = self.weighed(markers).fold(Vec2::ZERO, |sum, (m, area)| sum + m.now_from_rest() * area);
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
        let sum_px3 = self.weighed(markers).fold(Vec2::ZERO, |sum, (m, area)| sum + from_rest(m) * area);
        let length = sum_px3.length();
        let kept = if length > most { most / length } else { 1.0 };
        self.tare_px3 = sum_px3 * kept / grip_n.filter(|n| *n > 0.0).unwrap_or(1.0);
    }

    /// Load in the plane, px3.
    pub fn force_px3(&self, grip_n: Option<f64>) -> Vec2 {
        let times = if self.per_newton { grip_n.unwrap_or(0.0) } else { 1.0 };
        self.sum_px3 - self.tare_px3 * times
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

    /// Area that all markers stand for, px2.
    #[cfg(test)]
    pub fn area_px2(&self) -> f64 {
        self.patches.iter().map(Patch::area_px2).sum()
    }

    /// Moment about a point with the gel as it is at rest, positive from x to y, px4: of the features, whose trees were fitted with it.
    pub fn moment_px4(&self, markers: &[Marker], about: Vec2, under_load: impl Fn(&Marker) -> Vec2) -> f64 {
        self.weighed(markers).map(|(m, area)| area * (m.rest - about).cross(under_load(m))).sum()
    }

    /// Torque about a point of the squeezed gel, positive from x to y, px4. A press spreads the gel under it, by a twentieth of the lever
    /// and more at 60 N, and the load acts there. That the load carries it further adds nothing: it moves along the load.
    pub fn torque_px4(&self, markers: &[Marker], about: Vec2, under_load: impl Fn(&Marker) -> Vec2) -> f64 {
        let of = |(m, area): (&Marker, f64)| {
            let moved = under_load(m);
            area * (m.now - moved - about).cross(moved)
        };
        self.weighed(markers).map(of).sum()
    }
}
