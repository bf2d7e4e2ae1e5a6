//! Reference of the markers' displacement: the finger squeezed, but not yet loaded along its surface.
//!
//! ```text
//!   touched ----press----> settled (grip and area steady for 0.2 s): squeeze of every marker stored, as it was 0.1 s
//!                                     |            ago: a load that begins meanwhile is no squeeze
//!                                     v       squeeze (P / P_taken)^0.85 when the grip changes later
//!   displacement under load = now - rest - squeeze;   slip = that - rigid - residual of the marker when it joined
//!
//!   rolled or slid over the gel: the squeeze moves with the contact, interpolated between markers
//!   gripped harder by a tenth: slipped markers stick again where they are, and slip counts from there
//!   lighter by a tenth at almost no load: what remains of the squeeze is no slip, and slip counts from there, too
//! ```

use super::window::Window;
use crate::monitor::report::Marker;
use crate::plane::Vec2;
use crate::smoothing;

/// Exponent of the grip force in the squeeze of a marker: 0.8 to 0.9 for simulated spheres, cylinders and boxes between
/// 5 and 60 N (a Hertz contact on a wide layer lies between 2/3 and 1).
const SQUEEZE_GROWTH: f64 = 0.85;

/// Grip or area is steady if it changes by less than this share between the halves of the window.
const SETTLED_GRIP_FRACTION: f64 = 0.03;
const SETTLED_AREA_FRACTION: f64 = 0.1;
/// Additional tolerance of the grip: readings of grippers are no better.
const SETTLED_GRIP_N: f64 = 0.15;
/// After this time in contact the reference is taken, settled or not.
const LONGEST_S: f64 = 1.0;
/// If the grip has grown by this share, slipped markers stick again; if it has fallen by it, some of the squeeze
/// remains.
const REGRIP_FRACTION: f64 = 0.1;
/// A marker that has been out of contact for this time, s, counts as new when it returns.
const AWAY_S: f64 = 0.33;

/// Step in which the squeeze follows the contact, pitches: the middle of the contact is known to 0.2.
const ROLLED_PITCH: f64 = 0.4;
/// Radius within which a marker's squeeze is interpolated, pitches.
const REACH_PITCH: f64 = 1.5;
/// Time constant with which the middle of a contact is smoothed, s.
const ROLL_S: f64 = 0.1;

/// Change of the grip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Regrip {
    /// Slipped markers stick again where they are.
    Harder,
    /// The rim of the former, larger contact stays where the squeeze has moved it: less of the squeeze recovers than
    /// its growth law predicts.
    Lighter,
}

/// State of a marker.
#[derive(Debug, Clone, Copy, Default)]
struct Base {
    /// Displacement from rest by the squeeze alone when the reference was taken, px.
    taken_squeeze: Vec2,
    /// The same for the contact's current place, px.
    squeeze: Vec2,
    /// Residual to the rigid motion when the marker joined the contact, px.
    joined: Vec2,
    /// Time since it was last in the contact, s; from [`AWAY_S`] on it is not part of it.
    away_s: f64,
}

/// The reference of a contact.
#[derive(Debug, Clone)]
pub(super) struct Reference {
    bases: Vec<Base>,
    /// Markers in ascending order of x at rest.
    by_x: Vec<u32>,
    recent: DisplacementHistory,
    touched_s: f64,
    taken: bool,
    taken_grip_n: Option<f64>,
    /// Grip at which slip began to count, and that in the frame before, N.
    counts_from_n: Option<f64>,
    before_n: Option<f64>,
    /// Middle of the contact on the gel when the reference was taken and now, and shift of the squeeze, px.
    taken_middle_px: Option<Vec2>,
    middle_px: Vec2,
    rolled_px: Vec2,
}

impl Reference {
    pub fn new(markers: &[Marker]) -> Self {
        let mut by_x: Vec<u32> = (0..markers.len() as u32).collect();
        by_x.sort_by(|&a, &b| markers[a as usize].rest.x.total_cmp(&markers[b as usize].rest.x));
        Reference {
            bases: vec![Base::default(); markers.len()],
            by_x,
            recent: DisplacementHistory::new(markers.len()),
            touched_s: 0.0,
            taken: false,
            taken_grip_n: None,
            counts_from_n: None,
            before_n: None,
            taken_middle_px: None,
            middle_px: Vec2::ZERO,
            rolled_px: Vec2::ZERO,
        }
    }

    /// Resets after contact is lost.
    pub fn clear(&mut self) {
        (self.touched_s, self.taken, self.taken_grip_n, self.counts_from_n) = (0.0, false, None, None);
        self.before_n = None;
        self.recent.clear();
    }

    /// Whether there is a reference.
    pub fn is_taken(&self) -> bool {
        self.taken
    }

    /// Measures the time in contact; takes the reference once grip and area are steady, or before when loaded in the
    /// plane.
    pub fn follow(&mut self, elapsed_s: f64, window: &Window, loaded: bool, markers: &[Marker]) {
        if self.taken {
            return;
        }
        self.touched_s += elapsed_s;
        self.recent.push(self.touched_s, markers);
        let grip = window.change(|s| s.grip_n);
        let area = window.change(|s| Some(s.area_px2));
        let stands = |change: Option<(f64, f64)>, share: f64, least: f64| {
            change.is_some_and(|(by, mean)| by.abs() <= share * mean + least)
        };
        let grip_stands =
            window.newest().is_none_or(|s| s.grip_n.is_none()) || stands(grip, SETTLED_GRIP_FRACTION, SETTLED_GRIP_N);
        let settled = grip_stands && stands(area, SETTLED_AREA_FRACTION, 0.0);
        if settled {
            // The window is steady: its mean is the grip, and its middle is no later than the onset of a load in it.
            let grip_n = grip.map(|(_, mean_n)| mean_n).or(window.newest().and_then(|s| s.grip_n));
            self.take(grip_n, markers, true);
        } else if loaded || self.touched_s >= LONGEST_S {
            self.take(window.newest().and_then(|s| s.grip_n), markers, false);
        }
    }

    /// Takes the rest frame as the unloaded state: for a recording that starts in contact.
    pub fn take_rest(&mut self, grip_n: Option<f64>, markers: &[Marker]) {
        self.recent.clear();
        self.take_with(grip_n, markers, |_| Vec2::ZERO);
    }

    /// Takes the reference from the markers now, or shortly before.
    fn take(&mut self, grip_n: Option<f64>, markers: &[Marker], before: bool) {
        let recent = std::mem::take(&mut self.recent);
        let then_px = if before { recent.before_px(self.touched_s) } else { None };
        self.take_with(grip_n, markers, |m| then_px.map_or(m.now_from_rest(), |px| px[m.id as usize]));
        self.recent = recent;
    }

    fn take_with(&mut self, grip_n: Option<f64>, markers: &[Marker], squeeze: impl Fn(&Marker) -> Vec2) {
        for (base, marker) in self.bases.iter_mut().zip(markers) {
            let away_s = if marker.in_contact { 0.0 } else { AWAY_S };
            let squeeze = squeeze(marker);
            *base = Base { taken_squeeze: squeeze, squeeze, joined: Vec2::ZERO, away_s };
        }
        (self.taken_middle_px, self.rolled_px) = (None, Vec2::ZERO);
        (self.taken, self.taken_grip_n) = (true, grip_n.filter(|n| *n > 0.0));
        self.counts_from_n = self.taken_grip_n;
    }

    /// Moves the squeeze with a contact that rolls or slides over the gel. `middle_px`: middle of the contact, in rest
    /// coordinates of the gel.
    pub fn roll(&mut self, elapsed_s: f64, middle_px: Vec2, pitch_px: f64, markers: &[Marker]) {
        let newest = if self.taken_middle_px.is_some() { smoothing::weight(elapsed_s, ROLL_S) } else { 1.0 };
        self.middle_px += (middle_px - self.middle_px) * newest;
        let by = self.middle_px - *self.taken_middle_px.get_or_insert(self.middle_px);
        if (by - self.rolled_px).length() < ROLLED_PITCH * pitch_px {
            return;
        }
        self.rolled_px = by;
        let reach_px = REACH_PITCH * pitch_px;
        for to in markers {
            let (mut sum, mut weights) = (Vec2::ZERO, 0.0);
            let place = to.rest - by;
            let first = self.by_x.partition_point(|&from| markers[from as usize].rest.x < place.x - reach_px);
            for &from in &self.by_x[first..] {
                let off = markers[from as usize].rest - place;
                if off.x > reach_px {
                    break;
                }
                if off.length_squared() < reach_px * reach_px {
                    let weight = 1.0 / (off.length_squared() * off.length_squared() + 1e-6);
                    let base = &self.bases[from as usize];
                    (sum, weights) = (sum + base.taken_squeeze * weight, weights + weight);
                }
            }
            self.bases[to.id as usize].squeeze = if weights > 0.0 { sum / weights } else { Vec2::ZERO };
        }
    }

    /// Change of the grip, each time it is large enough to restart the count of slip; a lighter grip does so only where
    /// the contact is `hardly_pulled`.
    pub fn regripped(&mut self, grip_n: Option<f64>, hardly_pulled: bool) -> Option<Regrip> {
        let before_n = std::mem::replace(&mut self.before_n, grip_n);
        let (Some(from_n), Some(now_n)) = (self.counts_from_n, grip_n) else {
            self.counts_from_n = self.counts_from_n.or(grip_n);
            return None;
        };
        if now_n > (1.0 + REGRIP_FRACTION) * from_n {
            self.counts_from_n = Some(now_n);
            return Some(Regrip::Harder);
        }
        if now_n >= (1.0 - REGRIP_FRACTION) * from_n {
            return None;
        }
        // Under a load a later increase counts from here, but a single low reading is not followed by one.
        let low_n = if hardly_pulled { now_n } else { before_n.unwrap_or(from_n).max(now_n) };
        self.counts_from_n = Some(from_n.min(low_n));
        hardly_pulled.then_some(Regrip::Lighter)
    }

    /// Slip of a marker counts from where it is now.
    pub fn count_anew(&mut self, id: u32, residual: Vec2) {
        self.bases[id as usize].joined += residual;
    }

    /// Factor by which the squeeze has grown since the reference was taken.
    pub fn growth(&self, grip_n: Option<f64>) -> f64 {
        match (self.taken_grip_n, grip_n) {
            (Some(taken_n), Some(now_n)) => libm::pow((now_n / taken_n).clamp(0.0, 20.0), SQUEEZE_GROWTH),
            _ => 1.0,
        }
    }

    /// Displacement of a marker from rest by the squeeze alone when the reference was taken, px.
    pub fn squeeze(&self, marker: &Marker) -> Vec2 {
        self.bases[marker.id as usize].squeeze
    }

    /// Grip when the reference was taken, N.
    pub fn taken_grip_n(&self) -> Option<f64> {
        self.taken_grip_n
    }

    /// Displacement of a marker under load, px.
    pub fn under_load(&self, marker: &Marker, growth: f64) -> Vec2 {
        marker.now_from_rest() - self.bases[marker.id as usize].squeeze * growth
    }

    /// Residual of a marker to the rigid motion when it joined the contact, px.
    pub fn joined(&self, marker: &Marker) -> Vec2 {
        self.bases[marker.id as usize].joined
    }

    /// Tracks whether a marker is part of the contact, `elapsed_s` after the last frame; for a marker that joins,
    /// stores its residual to the rigid motion. Its slip counts from there.
    pub fn keep(&mut self, elapsed_s: f64, marker: &Marker, residual: impl FnOnce() -> Vec2) {
        let base = &mut self.bases[marker.id as usize];
        if !marker.in_contact {
            base.away_s += elapsed_s;
            return;
        }
        if base.away_s >= AWAY_S {
            base.joined = residual();
        }
        base.away_s = 0.0;
    }
}

/// Displacements of the markers from rest in the last tenth of a second.
#[derive(Debug, Clone, Default)]
struct DisplacementHistory {
    /// Displacements, px, and their time; the oldest is overwritten.
    kept: [(Vec<Vec2>, f64); RECENT_COUNT],
    next: usize,
}

/// Number of entries, and least time between them: they span [`BEFORE_S`] at any frame rate.
const RECENT_COUNT: usize = 5;
const RECENT_APART_S: f64 = 0.024;

/// Age at which the squeeze of a settled contact is taken, s: the middle of the steady window.
const BEFORE_S: f64 = 0.09;

impl DisplacementHistory {
    fn new(markers_count: usize) -> Self {
        DisplacementHistory {
            kept: std::array::from_fn(|_| (vec![Vec2::ZERO; markers_count], f64::NEG_INFINITY)),
            next: 0,
        }
    }

    fn clear(&mut self) {
        self.kept.iter_mut().for_each(|(_, at_s)| *at_s = f64::NEG_INFINITY);
    }

    fn push(&mut self, now_s: f64, markers: &[Marker]) {
        let last = (self.next + RECENT_COUNT - 1) % RECENT_COUNT;
        if now_s - self.kept[last].1 < RECENT_APART_S - 1e-9 {
            return;
        }
        let (px, at_s) = &mut self.kept[self.next];
        px.iter_mut().zip(markers).for_each(|(px, marker)| *px = marker.now_from_rest());
        *at_s = now_s;
        self.next = (self.next + 1) % RECENT_COUNT;
    }

    /// The newest entry that is at least [`BEFORE_S`] old; None while there is none.
    fn before_px(&self, now_s: f64) -> Option<&[Vec2]> {
        let old = |(_, at_s): &&(Vec<Vec2>, f64)| at_s.is_finite() && now_s - at_s >= BEFORE_S - 1e-9;
        self.kept.iter().filter(old).max_by(|a, b| a.1.total_cmp(&b.1)).map(|(px, _)| px.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PITCH_PX: f64 = 30.0;

    /// Displacement of the gel by a squeeze: outwards, largest at 60 px.
    fn squeeze(from_middle: Vec2) -> Vec2 {
        from_middle * (0.1 * (-from_middle.length_squared() / (2.0 * 60.0 * 60.0)).exp())
    }

    /// Takes the reference of a squeeze that then moves over the gel within a second. Returns the largest displacement
    /// that counts as load at the end, and the largest squeeze, px.
    fn rolled(by: Vec2, follows: bool) -> (f64, f64) {
        let place = |i: u32| Vec2::new(15.0 + PITCH_PX * f64::from(i % 16), 15.0 + PITCH_PX * f64::from(i / 16));
        let mut markers: Vec<Marker> = (0..192).map(|id| Marker::at_rest(id, place(id))).collect();
        let middle = Vec2::new(220.0, 180.0);
        let mut press = |middle: Vec2| -> Vec<Marker> {
            for m in &mut markers {
                (m.in_contact, m.now) = ((m.rest - middle).length() < 80.0, m.rest + squeeze(m.rest - middle));
            }
            markers.clone()
        };
        let pressed = press(middle);
        let mut reference = Reference::new(&pressed);
        reference.take(Some(10.0), &pressed, false);
        let mut now = pressed;
        for frame in 0..60 {
            let at = middle + by * (f64::from(frame) / 30.0).min(1.0);
            now = press(at);
            if follows {
                reference.roll(1.0 / 30.0, at, PITCH_PX, &now);
            }
        }
        let longest = |of: &dyn Fn(&Marker) -> Vec2| now.iter().map(|m| of(m).length()).fold(0.0, f64::max);
        (longest(&|m| reference.under_load(m, 1.0)), longest(&|m| m.now_from_rest()))
    }

    #[test]
    fn a_squeeze_goes_along_with_a_contact_that_rolls() {
        let by = Vec2::new(70.0, 50.0);
        let ((with, longest_px), (without, _)) = (rolled(by, true), rolled(by, false));
        assert!(without > 0.8 * longest_px, "left behind, the squeeze is taken for a load: {without} of {longest_px}");
        assert!(with < 0.25 * longest_px, "{with} of {longest_px}");
        let (still, _) = rolled(Vec2::new(8.0, -6.0), true);
        let (left, _) = rolled(Vec2::new(8.0, -6.0), false);
        assert_eq!(still, left, "less than a step is noise of the middle");
    }

    #[test]
    fn a_middle_that_is_not_sure_of_its_place_is_no_roll() {
        let marker = |id: u32, rest: Vec2, now: Vec2| Marker { in_contact: true, now, ..Marker::at_rest(id, rest) };
        let markers = [0, 1].map(|id| {
            let rest = Vec2::new(100.0 + 30.0 * f64::from(id), 100.0);
            marker(id, rest, rest + Vec2::new(f64::from(id), 0.0))
        });
        let mut reference = Reference::new(&markers);
        reference.take(None, &markers, false);
        for frame in 0..30 {
            // Two thirds of a pitch to and fro: more than a step.
            reference.roll(1.0 / 30.0, Vec2::new(f64::from(frame % 2) * 20.0, 0.0), PITCH_PX, &markers);
        }
        assert_eq!(markers.map(|m| reference.under_load(&m, 1.0)), [Vec2::ZERO; 2]);
    }

    #[test]
    fn a_marker_that_is_away_for_a_moment_keeps_its_slip_at_every_frame_rate() {
        for frames_per_s in [10u32, 30, 90, 240] {
            let rest = Vec2::new(100.0, 100.0);
            let there = Marker { in_contact: true, ..Marker::at_rest(0, rest) };
            let away = Marker { in_contact: false, ..there };
            let after = |away_s: f64| {
                let mut reference = Reference::new(&[there]);
                reference.take_rest(Some(10.0), &[there]);
                let elapsed_s = f64::from(frames_per_s).recip();
                let residual = || Vec2::new(3.0, 0.0);
                (0..(away_s / elapsed_s).round() as u32).for_each(|_| reference.keep(elapsed_s, &away, residual));
                reference.keep(elapsed_s, &there, residual);
                reference.joined(&there)
            };
            assert_eq!(after(0.1), Vec2::ZERO, "{frames_per_s} Hz");
            assert_eq!(after(0.4), Vec2::new(3.0, 0.0), "{frames_per_s} Hz");
        }
    }

    #[test]
    fn a_new_contact_has_not_rolled() {
        let marker =
            Marker { in_contact: true, now: Vec2::new(103.0, 100.0), ..Marker::at_rest(0, Vec2::new(100.0, 100.0)) };
        let mut reference = Reference::new(&[marker]);
        reference.take(None, &[marker], false);
        for at in [0.0, 300.0, 300.0, 300.0, 300.0] {
            reference.roll(0.1, Vec2::new(at, 0.0), PITCH_PX, &[marker]);
        }
        assert_eq!(
            reference.under_load(&marker, 1.0),
            Vec2::new(3.0, 0.0),
            "the contact, and its squeeze with it, is elsewhere"
        );
        reference.take(None, &[marker], false);
        reference.roll(0.1, Vec2::new(300.0, 0.0), PITCH_PX, &[marker]);
        assert_eq!(reference.under_load(&marker, 1.0), Vec2::ZERO);
    }
}
