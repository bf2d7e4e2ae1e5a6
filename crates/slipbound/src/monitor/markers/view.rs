//! Where markers are entirely visible: within the image, and within the part of it that the camera sees.
//!
//! ```text
//!   +----------+      the rectified image extends beyond the camera's border: its pixels there are not measured
//!   |  o  o  o |
//!   | o  o  o  +--    a marker cut by the border: its own position along it, that of its neighbours across it
//! ```

use crate::image::{Mask, SizePx};
use crate::plane::{Vec2, nearest_px};
use crate::sensor::Sensor;

/// The image and the part of it that the camera sees.
#[derive(Debug, Clone)]
pub(super) struct View {
    size: SizePx,
    radius_px: f64,
    seen: Option<Mask>,
}

impl View {
    /// `seen`: the pixels that the camera sees, if not all.
    pub fn new(sensor: &Sensor, seen: Option<&Mask>) -> Self {
        View { size: sensor.rectified_px(), radius_px: sensor.marker_diameter_px / 2.0, seen: seen.cloned() }
    }

    /// Whether a marker at `p` is entirely visible.
    pub fn holds(&self, p: Vec2) -> bool {
        let margin = self.radius_px + 0.5;
        let inside = |v: f64, end: usize| v >= margin && v <= end as f64 - 1.0 - margin;
        inside(p.x, self.size.width) && inside(p.y, self.size.height) && !self.ends_beside(p, margin).contains(&true)
    }

    /// Whether a marker at `p` is cut along x, and along y.
    pub fn cuts(&self, p: Vec2) -> [bool; 2] {
        let near = |v: f64, end: usize| v < self.radius_px + 0.5 || v > end as f64 - 1.5 - self.radius_px;
        let [x, y] = self.ends_beside(p, self.radius_px + 1.0);
        [near(p.x, self.size.width) || x, near(p.y, self.size.height) || y]
    }

    /// Whether the visible part ends within `px` of `p`, along x and along y.
    fn ends_beside(&self, p: Vec2, px: f64) -> [bool; 2] {
        let Some(seen) = &self.seen else { return [false; 2] };
        let sees = |p: Vec2| seen.get(nearest_px(p.x), nearest_px(p.y));
        [Vec2::new(px, 0.0), Vec2::new(0.0, px)].map(|by| !(sees(p + by) && sees(p - by)))
    }
}
