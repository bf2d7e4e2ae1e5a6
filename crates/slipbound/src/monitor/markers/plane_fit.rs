//! Least-squares plane through the displacements of a few neighbours: local stretch and rotation of the gel.

use crate::plane::Vec2;

/// Neighbours of a marker.
pub(super) const NEIGHBOURS: usize = 8;

/// The neighbours of a marker at rest, precomputed for the plane fit when all are known.
#[derive(Debug, Clone, Copy)]
pub(super) struct NeighbourPlane {
    /// From the marker to the mean of its neighbours; `arms`: from there to each.
    pub middle: Vec2,
    arms: [Vec2; NEIGHBOURS],
    normal: NormalMatrix,
}

impl NeighbourPlane {
    pub fn new(arms: [Vec2; NEIGHBOURS], pitch_px: f64) -> Self {
        let mut middle = Vec2::ZERO;
        arms.iter().for_each(|&arm| middle += arm);
        middle = middle / NEIGHBOURS as f64;
        let arms = arms.map(|arm| arm - middle);
        let mut normal = NormalMatrix::new(pitch_px);
        arms.iter().for_each(|&arm| normal.add(arm));
        NeighbourPlane { middle, arms, normal }
    }

    /// Slopes along x and along y of the displacements of all neighbours relative to their mean.
    pub fn slopes(&self, displaced: [Vec2; NEIGHBOURS]) -> [Vec2; 2] {
        self.normal.slopes(self.arms.iter().copied().zip(displaced))
    }
}

/// Sums of products of the arms, with a ridge for arms that do not determine a slope.
#[derive(Debug, Clone, Copy)]
struct NormalMatrix {
    xx: f64,
    xy: f64,
    yy: f64,
}

impl NormalMatrix {
    fn new(pitch_px: f64) -> Self {
        let ridge = 0.5 * pitch_px * pitch_px;
        NormalMatrix { xx: ridge, xy: 0.0, yy: ridge }
    }

    fn add(&mut self, arm: Vec2) {
        self.xx += arm.x * arm.x;
        self.xy += arm.x * arm.y;
        self.yy += arm.y * arm.y;
    }

    /// Least-squares slopes along x and along y of displacements at these arms, damped where arms do not fix them.
    fn slopes(&self, points: impl Iterator<Item = (Vec2, Vec2)>) -> [Vec2; 2] {
        let NormalMatrix { xx, xy, yy } = *self;
        let (mut by_x, mut by_y) = (Vec2::ZERO, Vec2::ZERO);
        for (arm, d) in points {
            by_x += d * arm.x;
            by_y += d * arm.y;
        }
        let det = xx * yy - xy * xy;
        [(by_x * yy - by_y * xy) / det, (by_y * xx - by_x * xy) / det]
    }
}

/// Least-squares slopes along x and along y of displacements at these arms, damped where arms do not fix them.
pub(super) fn slopes(points: impl Iterator<Item = (Vec2, Vec2)> + Clone, pitch_px: f64) -> [Vec2; 2] {
    let mut normal = NormalMatrix::new(pitch_px);
    points.clone().for_each(|(arm, _)| normal.add(arm));
    normal.slopes(points)
}
