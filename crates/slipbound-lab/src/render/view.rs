//! Projection of a point of the gel to the camera image, and back from a pixel.
//!
//! ```text
//!            eye o                      A point pressed to depth u_z (towards the camera) seems to lie at
//!                 \  angle a            Xa = X + u + u_z kappa, farther from the camera by
//!   ===============\======= lens
//!                   \  angle a'         |kappa| = tan a',  sin a' = sin a / n
//!                    o  u_z             along the direction from the eye to the point.
//!   - - - - - - - - - -\- - - gel at rest
//!                      Xa
//! ```

use super::surface::Surface;
use crate::render::CameraSettings;
use slipbound::plane::{Homography, Vec2};
use slipbound::sensor::{Flip, Sensor};

/// Most iterations for a point; each reduces the error by the gradient of the displacement.
const ROUNDS_COUNT: usize = 40;

/// Geometry of the camera; px are of the camera image as delivered unless they are called rectified.
#[derive(Debug, Clone)]
pub(super) struct View {
    eye_mm: [f64; 3],
    refractive_index: f64,
    mm_per_px: f64,
    /// Centre of the rectified image, px.
    middle_px: Vec2,
    crop_px: Vec2,
    upright_from_plane: Homography,
    plane_from_upright: Homography,
    /// The camera image's last column if columns are mirrored, and last row if rows are.
    mirror_px: [Option<f64>; 2],
}

impl View {
    pub fn new(settings: &CameraSettings) -> Self {
        let sensor: &Sensor = &settings.sensor;
        let (plane_from_upright, crop_px) = match &sensor.rectification {
            None => (Homography::IDENTITY, Vec2::ZERO),
            Some(r) => (r.homography, Vec2::new(r.crop_px[0] as f64, r.crop_px[1] as f64)),
        };
        let size = sensor.rectified_px();
        let last = |px: usize, mirrored: bool| mirrored.then(|| (px - 1) as f64);
        View {
            eye_mm: settings.eye_mm,
            refractive_index: settings.refractive_index,
            mm_per_px: sensor.mm_per_px().expect("a simulated finger knows its pitch"),
            middle_px: Vec2::new((size.width - 1) as f64, (size.height - 1) as f64) * 0.5,
            crop_px,
            upright_from_plane: plane_from_upright.inverse().expect("a rectification can be undone"),
            plane_from_upright,
            mirror_px: [
                last(sensor.image_px.width, matches!(sensor.flip, Flip::Horizontal | Flip::Both)),
                last(sensor.image_px.height, matches!(sensor.flip, Flip::Vertical | Flip::Both)),
            ],
        }
    }

    fn mirrored(&self, p: Vec2) -> Vec2 {
        Vec2::new(self.mirror_px[0].map_or(p.x, |last| last - p.x), self.mirror_px[1].map_or(p.y, |last| last - p.y))
    }

    /// Position of a point of the gel plane in the rectified image.
    pub fn rectified_from_plane(&self, at_mm: Vec2) -> Vec2 {
        at_mm / self.mm_per_px + self.middle_px
    }

    /// Point of the gel plane at a position of the rectified image, in mm.
    pub fn plane_from_rectified(&self, px: Vec2) -> Vec2 {
        (px - self.middle_px) * self.mm_per_px
    }

    /// Position of a point of the gel plane in the camera image.
    pub fn camera_from_plane(&self, at_mm: Vec2) -> Vec2 {
        self.mirrored(self.upright_from_plane.apply(self.rectified_from_plane(at_mm) + self.crop_px))
    }

    /// Point of the gel plane at a position of the camera image, in mm.
    pub fn plane_from_camera(&self, px: Vec2) -> Vec2 {
        self.plane_from_rectified(self.plane_from_upright.apply(self.mirrored(px)) - self.crop_px)
    }

    /// kappa: apparent displacement of a point away from the eye, in mm for each mm of depth.
    pub fn parallax(&self, at_mm: Vec2) -> Vec2 {
        let away = at_mm - Vec2::new(self.eye_mm[0], self.eye_mm[1]);
        let across = away.length();
        let sine = across / libm::hypot(across, self.eye_mm[2]) / self.refractive_index;
        away * (sine / ((1.0 - sine * sine).sqrt() * across.max(1e-9)))
    }

    /// Apparent position in the gel plane of the piece that is at `rest_mm` without contact.
    pub fn seen_at(&self, rest_mm: Vec2, surface: &Surface) -> Vec2 {
        let moved = surface.displacement_at(rest_mm);
        let there = rest_mm + moved.shift_mm;
        let mut seen = there;
        for _ in 0..ROUNDS_COUNT {
            let next = there + self.parallax(seen) * moved.depth_mm;
            // A value that is unchanged to the last bit stays unchanged.
            if next == seen {
                break;
            }
            seen = next;
        }
        seen
    }
}
