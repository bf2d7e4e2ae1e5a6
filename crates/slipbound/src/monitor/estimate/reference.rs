//! What the markers' displacement counts from: the finger squeezed, but not yet loaded along its surface.
//!
//! ```text
//!   touched ----press----> settled (grip and area stand for 0.2 s): squeeze of every marker taken over, as it was 0.1 s
//!                                     |            ago: a load that begins meanwhile is no squeeze
//!                                     v       squeeze (P / P_taken)^0.85 when the grip changes later
//!   displacement under load = now - rest - squeeze - what the marker had over the rigid motion when it joined the contact
//!
//!   gripped harder by a tenth: what has slipped sticks again where it is, and slip counts from there
//! ```

use super::window::Window;
use crate::monitor::report::Marker;
use crate::plane::Vec2;

/// Power of the grip force with which the squeeze of a marker grows: 0.8 to 0.9 for simulated spheres, cylinders and boxes
/// between 5 and 60 N (a Hertz contact on a wide layer lies between 2/3 and 1).
const SQUEEZE_GROWTH: f64 = 0.85;

/// A grip or an area that changes by less than this share between the halves of the window stands still.
const SETTLED_GRIP_FRACTION: f64 = 0.03;
const SETTLED_AREA_FRACTION: f64 = 0.1;
/// Besides, a grip may change by this much: readings of grippers are no better.
const SETTLED_GRIP_N: f64 = 0.15;
/// After this time in contact the reference is taken, settled or not.
const LONGEST_S: f64 = 1.0;
/// A grip that has grown by this share holds what slipped under the lighter one.
const REGRIP_FRACTION: f64 = 0.1;
/// A marker that has been out of the contact for as many frames joins it anew.
const AWAY_FRAMES: u8 = 10;

/// What is remembered of a marker.
#[derive(Debug, Clone, Copy, Default)]
struct Base {
    /// Displacement from rest by the squeeze alone, px.
    squeeze: Vec2,
    /// Displacement that it had over the rigid motion when it joined the contact, px.
    joined: Vec2,
    /// Frames since it was last in the contact; [`AWAY_FRAMES`] or more: it is no part of it.
    away_frames: u8,
}

/// The reference of a contact.
#[derive(Debug, Clone)]
pub(super) struct Reference {
    bases: Vec<Base>,
    recent: Recent,
    touched_s: f64,
    taken: bool,
    taken_grip_n: Option<f64>,
    /// Grip at which slip began to count.
    counts_from_n: Option<f64>,
}

impl Reference {
    pub fn new(markers_count: usize) -> Self {
        Reference {
            bases: vec![Base::default(); markers_count],
            recent: Recent::new(markers_count),
            touched_s: 0.0,
            taken: false,
            taken_grip_n: None,
            counts_from_n: None,
        }
    }

    /// Nothing touches any more.
    pub fn clear(&mut self) {
        (self.touched_s, self.taken, self.taken_grip_n, self.counts_from_n) = (0.0, false, None, None);
        self.recent.clear();
    }

    /// Whether there is a reference.
    pub fn is_taken(&self) -> bool {
        self.taken
    }

    /// Counts the time in contact; takes the reference once grip and area stand still, or loaded in the plane too early.
    pub fn follow(&mut self, seconds_s: f64, window: &Window, loaded: bool, markers: &[Marker]) {
        if self.taken {
            return;
        }
        self.touched_s += seconds_s;
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
            // The window has stood still: its mean is the grip, and its middle no later than a load that begins in it.
            let grip_n = grip.map(|(_, mean_n)| mean_n).or(window.newest().and_then(|s| s.grip_n));
            self.take(grip_n, markers, true);
        } else if loaded || self.touched_s >= LONGEST_S {
            self.take(window.newest().and_then(|s| s.grip_n), markers, false);
        }
    }

    /// Takes the markers at rest for unloaded: for a recording that starts in contact.
    pub fn take_rest(&mut self, grip_n: Option<f64>, markers: &[Marker]) {
        self.recent.clear();
        self.take_with(grip_n, markers, |_| Vec2::ZERO);
    }

    /// Takes the markers as they are, or as they were shortly before.
    fn take(&mut self, grip_n: Option<f64>, markers: &[Marker], before: bool) {
        let recent = std::mem::take(&mut self.recent);
        let then_px = if before { recent.before_px(self.touched_s) } else { None };
        self.take_with(grip_n, markers, |m| then_px.map_or(m.now_from_rest(), |px| px[m.id as usize]));
        self.recent = recent;
    }

    fn take_with(&mut self, grip_n: Option<f64>, markers: &[Marker], squeeze: impl Fn(&Marker) -> Vec2) {
        for (base, marker) in self.bases.iter_mut().zip(markers) {
            let away_frames = if marker.in_contact { 0 } else { AWAY_FRAMES };
            *base = Base { squeeze: squeeze(marker), joined: Vec2::ZERO, away_frames };
        }
        (self.taken, self.taken_grip_n) = (true, grip_n.filter(|n| *n > 0.0));
        self.counts_from_n = self.taken_grip_n;
    }

    /// Whether the grip has grown so much that slip counts anew.
    pub fn regripped(&mut self, grip_n: Option<f64>) -> bool {
        let (Some(from_n), Some(now_n)) = (self.counts_from_n, grip_n) else {
            self.counts_from_n = self.counts_from_n.or(grip_n);
            return false;
        };
        let grown = now_n > (1.0 + REGRIP_FRACTION) * from_n;
        if grown || now_n < (1.0 - REGRIP_FRACTION) * from_n {
            self.counts_from_n = Some(now_n);
        }
        grown
    }

    /// Slip of a marker counts from where it is now.
    pub fn count_anew(&mut self, id: u32, residual: Vec2) {
        self.bases[id as usize].joined += residual;
    }

    /// By which share the squeeze has grown since it was taken.
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

    /// What a marker had over the rigid motion when it joined, px.
    pub fn joined(&self, marker: &Marker) -> Vec2 {
        self.bases[marker.id as usize].joined
    }

    /// Keeps who is part of the contact; a marker that joins takes what it has over the rigid motion as its own. Its
    /// slip counts from there.
    pub fn keep(&mut self, marker: &Marker, in_contact: bool, residual: impl FnOnce() -> Vec2) {
        let base = &mut self.bases[marker.id as usize];
        if !in_contact {
            base.away_frames = base.away_frames.saturating_add(1);
            return;
        }
        if base.away_frames >= AWAY_FRAMES {
            base.joined = residual();
        }
        base.away_frames = 0;
    }
}

/// Where the markers were in the last tenth of a second, from rest.
#[derive(Debug, Clone, Default)]
struct Recent {
    /// Displacements, px, and when; the oldest is overwritten.
    kept: [(Vec<Vec2>, f64); RECENT_COUNT],
    next: usize,
}

/// How many are kept, and how far apart at least: [`BEFORE_S`] fits in at any frame rate.
const RECENT_COUNT: usize = 5;
const RECENT_APART_S: f64 = 0.024;

/// How far back the squeeze of a settled contact is taken, s: the middle of the window over which it stood.
const BEFORE_S: f64 = 0.09;

impl Recent {
    fn new(markers_count: usize) -> Self {
        Recent { kept: std::array::from_fn(|_| (vec![Vec2::ZERO; markers_count], f64::NEG_INFINITY)), next: 0 }
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

    /// The newest that is at least [`BEFORE_S`] old; None while there is none.
    fn before_px(&self, now_s: f64) -> Option<&[Vec2]> {
        let old = |(_, at_s): &&(Vec<Vec2>, f64)| at_s.is_finite() && now_s - at_s >= BEFORE_S - 1e-9;
        self.kept.iter().filter(old).max_by(|a, b| a.1.total_cmp(&b.1)).map(|(px, _)| px.as_slice())
    }
}
