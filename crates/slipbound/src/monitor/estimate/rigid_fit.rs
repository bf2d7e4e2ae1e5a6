//! Markers in contact, each with its displacement under load -> the rigid motion of those that stick.
//!
//! ```text
//!   rounds, wide to narrow:  weight = 1 / (1 + (distance from the last motion / scale)^2)^2  -->  motion
//! ```
//!
//! Markers of a slipping rim are far from the motion and lose their weight.

use crate::plane::{RigidMotion, Vec2};

/// A marker in contact.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Point {
    /// Number of the marker.
    pub id: u32,
    /// Position at rest, px.
    pub rest: Vec2,
    /// Displacement under load, px.
    pub displacement: Vec2,
    /// Residual to the rigid motion when the marker joined the contact, px.
    pub joined: Vec2,
    /// Displacement of the rigid motion there, px.
    pub rigid: Vec2,
    /// Distance from the middle of the contact, px.
    pub radius: f64,
}

impl Point {
    /// Slip over the rigid motion, px.
    pub fn residual(&self) -> Vec2 {
        self.displacement - self.rigid - self.joined
    }
}

/// Scales in pitches of the weights of the rigid fit, one a round: without a fit of the last frame, from wide to narrow,
/// and with it, where the first round starts from its stick set.
const FIRST_PITCH: [f64; 9] = [1.5, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.13, 0.1];
const NEXT_PITCH: [f64; 7] = [0.3, 0.5, 0.35, 0.25, 0.18, 0.13, 0.1];

/// The rigid motion of the sticking markers, starting from that of the last frame: the stick set is carried over, so
/// that a slipping rim does not bias the fit.
pub(super) fn fit(points: &[Point], before: Option<&RigidMotion>, pitch_px: f64) -> Option<RigidMotion> {
    let (mut motion, scales) = match before {
        Some(before) => (*before, &NEXT_PITCH[..]),
        None => (weighted(points, |_| 1.0)?, &FIRST_PITCH[..]),
    };
    for scale_pitch in scales {
        let scale_squared = (scale_pitch * pitch_px) * (scale_pitch * pitch_px);
        let last = motion.tabulated();
        motion = weighted(points, |p| {
            let off = p.displacement - p.joined - last.displacement(p.rest);
            let t = 1.0 + off.length_squared() / scale_squared;
            1.0 / (t * t)
        })?;
    }
    Some(motion)
}

fn weighted(points: &[Point], weight: impl Fn(&Point) -> f64) -> Option<RigidMotion> {
    crate::monitor::motion::fit_weighted(points.iter().map(|p| (p.rest, p.rest + p.displacement - p.joined, weight(p))))
}
