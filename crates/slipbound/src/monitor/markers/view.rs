//! Where markers can be seen whole: within the picture, and within what the camera sees of it.
//!
//! ```text
//!   +----------+      a rectified picture goes on beyond the camera's border: what it shows there is made up
//!   |  o  o  o |
//!   | o  o  o  +--    a marker that the border cuts has its place along it; across it the neighbours say where it is
//! ```

use crate::image::{Mask, SizePx};
use crate::plane::{Vec2, nearest_px};
use crate::sensor::Sensor;

/// The picture and the part of it that the camera sees.
#[derive(Debug, Clone)]
pub(super) struct View {
    size: SizePx,
    radius_px: f64,
    seen: Option<Mask>,
}

impl View {
    /// `seen`: which pixels the camera sees, where that is not all of them.
    pub fn new(sensor: &Sensor, seen: Option<&Mask>) -> Self {
        View { size: sensor.rectified_px(), radius_px: sensor.marker_diameter_px / 2.0, seen: seen.cloned() }
    }

    /// Whether a marker there lies whole in it.
    pub fn holds(&self, p: Vec2) -> bool {
        let margin = self.radius_px + 0.5;
        let inside = |v: f64, end: usize| v >= margin && v <= end as f64 - 1.0 - margin;
        inside(p.x, self.size.width) && inside(p.y, self.size.height) && !self.ends_beside(p, margin).contains(&true)
    }

    /// Whether a marker there is cut along x, and along y.
    pub fn cuts(&self, p: Vec2) -> [bool; 2] {
        let near = |v: f64, end: usize| v < self.radius_px + 0.5 || v > end as f64 - 1.5 - self.radius_px;
        let [x, y] = self.ends_beside(p, self.radius_px + 1.0);
        [near(p.x, self.size.width) || x, near(p.y, self.size.height) || y]
    }

    /// Whether what the camera sees ends within so far of a place, along x and along y.
    fn ends_beside(&self, p: Vec2, px: f64) -> [bool; 2] {
        let Some(seen) = &self.seen else { return [false; 2] };
        let sees = |p: Vec2| seen.get(nearest_px(p.x), nearest_px(p.y));
        [Vec2::new(px, 0.0), Vec2::new(0.0, px)].map(|by| !(sees(p + by) && sees(p - by)))
    }
}
