//! Image content other than the gel's own light: walls, glare, highlights, dirt. Drawn once per camera.
//!
//! ```text
//!     wall, bright, textured, mirrors the dots     z up the wall
//!     o  o o   o  chain of highlights
//!   =================== far border, red rim        y = half of the gel
//!    ( lamp's strip: glare )  o o  o   highlights
//!  \   .   .   .   .   .   .   .   .   /
//!  red   .   .  #dirt    .   .   .   green         side walls, their shadows on the gel
//!   \  .   .   .   . --scratch--  .  /
//! ```
//!
//! Everything is procedural: no image of a real camera was used.

use super::settings::CameraSettings;
use super::surroundings_kind::Surroundings;
use crate::random::Random;
use slipbound::plane::Vec2;

/// Levels of the walls (red, green, blue): far, left, right, and the rim at their foot.
const FAR_LEVELS: [f64; 3] = [96.0, 216.0, 134.0];
const LEFT_LEVELS: [f64; 3] = [186.0, 92.0, 42.0];
const RIGHT_LEVELS: [f64; 3] = [48.0, 214.0, 92.0];
const RIM_LEVELS: [f64; 3] = [196.0, 52.0, 40.0];
/// Width of the rim and of the shadow of a side wall on the gel, in mm.
const RIM_MM: f64 = 0.35;
const SHADOW_MM: f64 = 1.2;
/// Nodes of the grain along each side; a power of two.
const GRAIN_NODES: usize = 64;

/// A round highlight with a dark middle.
#[derive(Debug, Clone, Copy)]
struct Highlight {
    at_mm: Vec2,
    radius_mm: f64,
}

/// Surroundings of one gel, evaluated pixel by pixel.
#[derive(Debug)]
pub(super) struct Backdrop<'a> {
    settings: &'a CameraSettings,
    kind: Surroundings,
    grain: Vec<f64>,
    highlights: Vec<Highlight>,
    /// Bright spots of lamps on the far wall: position along the wall and up it, half their size.
    lamps_mm: Vec<(Vec2, Vec2)>,
    patch: Highlight,
    /// Middle of a scratch and the direction along it.
    scratch: (Vec2, Vec2),
}

impl<'a> Backdrop<'a> {
    pub fn new(settings: &'a CameraSettings, seed: u64) -> Self {
        let random = &mut Random::of(seed, 0x0BAC);
        let half = settings.gel_half_mm;
        let pitch_mm = settings.sensor.pitch_mm.unwrap_or(1.5);
        let grain = (0..GRAIN_NODES * GRAIN_NODES).map(|_| random.between(-1.0, 1.0)).collect();
        let mut highlights = Vec::new();
        for (y_mm, scatter_mm) in [(half.y - 1.1, 0.25), (half.y + 1.9, 0.6)] {
            let mut x_mm = -half.x + random.between(0.3, 1.5);
            while x_mm < half.x {
                let at_mm = Vec2::new(x_mm, y_mm + random.between(-scatter_mm, scatter_mm));
                highlights.push(Highlight { at_mm, radius_mm: settings.dots.radius_mm * random.between(0.8, 1.3) });
                x_mm += pitch_mm * random.between(0.65, 1.35);
            }
        }
        let lamps_mm = (0..5)
            .map(|_| {
                let at = Vec2::new(random.between(-half.x, half.x), random.between(1.5, 7.0));
                (at, Vec2::new(random.between(1.0, 3.5), random.between(0.2, 0.5)))
            })
            .collect();
        // Beside markers, off the middle, where most objects touch; the scratch opposite to the dirt.
        let angle = random.between(0.0, std::f64::consts::TAU);
        let mut beside = |angle: f64| {
            let far = Vec2::new(libm::cos(angle), libm::sin(angle)) * (0.62 * half.y / pitch_mm);
            let marker = Vec2::new(far.x.round(), far.y.round() + 0.5) * pitch_mm;
            let off = random.between(0.0, std::f64::consts::TAU);
            marker + Vec2::new(libm::cos(off), libm::sin(off)) * (0.45 * pitch_mm)
        };
        let patch = Highlight { at_mm: beside(angle), radius_mm: 0.4 * pitch_mm };
        let middle = beside(angle + std::f64::consts::PI);
        let along = random.between(0.0, std::f64::consts::PI);
        let scratch = (middle, Vec2::new(libm::cos(along), libm::sin(along)));
        Backdrop { settings, kind: settings.surroundings, grain, highlights, lamps_mm, patch, scratch }
    }

    /// Gel coverage at a position in the plane, 0 to 1: its border is half a millimetre soft. The near border is out of
    /// sight, two millimetres farther away.
    pub fn gel(&self, plane_mm: Vec2) -> f64 {
        let half = self.settings.gel_half_mm;
        let across = if plane_mm.y > 0.0 { half.y - plane_mm.y } else { half.y + 2.0 + plane_mm.y };
        ((half.x - plane_mm.x.abs()).min(across) / 0.5 + 0.5).clamp(0.0, 1.0)
    }

    /// The light of the gel, in levels, as changed by the walls and the lens.
    pub fn on_gel(&self, plane_mm: Vec2, levels: [f64; 3]) -> [f64; 3] {
        let mut levels = levels;
        if self.kind.walls() {
            let inside = (self.settings.gel_half_mm.x - plane_mm.x.abs()).max(0.0);
            let shadow = 1.0 - 0.45 * libm::exp(-inside / SHADOW_MM);
            levels = levels.map(|level| level * shadow);
        }
        if self.kind.highlights() {
            levels = self.highlit(plane_mm, levels);
        }
        if self.kind.dirt() {
            levels = self.dirty(plane_mm, levels);
        }
        levels
    }

    /// Levels beyond the gel.
    pub fn beyond(&self, plane_mm: Vec2) -> [f64; 3] {
        if !self.kind.walls() {
            return self.settings.light.housing_levels;
        }
        let half = self.settings.gel_half_mm;
        let (over, beside) = (plane_mm.y - half.y, plane_mm.x.abs() - half.x);
        // The line of sight meets first the wall that it has passed by the larger share of its length.
        let [eye_x, eye_y, eye_z] = self.settings.eye_mm;
        let share = |past: f64, way: f64| if past > 0.0 { past / way.abs().max(1e-6) } else { 0.0 };
        let (far, side) = (share(over, plane_mm.y - eye_y), share(beside, plane_mm.x - eye_x));
        let levels = if far >= side { self.far(plane_mm, far, eye_x) } else { self.side(plane_mm, side, eye_y) };
        let up_mm = eye_z * far.max(side);
        let rim = (1.0 - up_mm / RIM_MM).clamp(0.0, 1.0).sqrt();
        let levels = std::array::from_fn(|c| levels[c] + (RIM_LEVELS[c] - levels[c]) * rim);
        if self.kind.highlights() { self.highlit(plane_mm, levels) } else { levels }
    }

    /// The far wall: `share` of the way from the point in the plane that it hides to the eye.
    fn far(&self, plane_mm: Vec2, share: f64, eye_x_mm: f64) -> [f64; 3] {
        let up_mm = self.settings.eye_mm[2] * share;
        let wall = Vec2::new(plane_mm.x + (eye_x_mm - plane_mm.x) * share, up_mm);
        let tone =
            1.0 + 0.11 * self.grain(wall, 5.0) + 0.10 * self.grain(wall * 1.7, 1.3) + 0.09 * self.grain(wall, 0.4);
        let shadow = 1.0 - 0.22 * smooth((up_mm - 6.5 - 1.5 * self.grain(wall * 0.5, 4.0)) / 1.5);
        let lamps: f64 = self
            .lamps_mm
            .iter()
            .map(|(at, half)| {
                let d = wall - *at;
                70.0 * bell(Vec2::new(d.x / half.x, d.y / half.y).length())
            })
            .sum();
        // The wall mirrors the gel: its dots appear again beyond the border, distorted by the wavy wall and soon faint.
        let bent = Vec2::new(self.grain(wall, 2.2), self.grain(wall * 1.3 + Vec2::new(7.0, 3.0), 2.2)) * 0.4;
        let mirrored = Vec2::new(plane_mm.x, 2.0 * self.settings.gel_half_mm.y - plane_mm.y) + bent;
        let dot = 0.55 * libm::exp(-up_mm / 2.5) * self.dot(mirrored);
        FAR_LEVELS.map(|level| (level * tone * shadow + lamps) * (1.0 - dot))
    }

    /// A side wall, as [`Self::far`].
    fn side(&self, plane_mm: Vec2, share: f64, eye_y_mm: f64) -> [f64; 3] {
        let up_mm = self.settings.eye_mm[2] * share;
        let wall = Vec2::new(plane_mm.y + (eye_y_mm - plane_mm.y) * share, up_mm + 40.0);
        let tone = 1.0 + 0.15 * self.grain(wall, 3.0) + 0.08 * self.grain(wall, 0.7);
        let levels = if plane_mm.x < 0.0 { LEFT_LEVELS } else { RIGHT_LEVELS };
        levels.map(|level| level * tone)
    }

    /// A dot of the regular grid at a position of the gel: 1 in it, 0 beside it.
    fn dot(&self, at_mm: Vec2) -> f64 {
        let dots = &self.settings.dots;
        let pitch_mm = self.settings.sensor.pitch_mm.unwrap_or(1.5);
        let off = |at: f64, count: usize| {
            let middle = (count - 1) as f64 / 2.0;
            let number = (at / pitch_mm + middle).round().clamp(0.0, (count - 1) as f64);
            at - (number - middle) * pitch_mm
        };
        let off_mm = Vec2::new(off(at_mm.x, dots.columns_count), off(at_mm.y, dots.rows_count)).length();
        smooth((dots.radius_mm - off_mm) / dots.edge_mm + 0.5)
    }

    /// Chains of highlights.
    fn highlit(&self, plane_mm: Vec2, levels: [f64; 3]) -> [f64; 3] {
        self.highlights.iter().fold(levels, |levels, spot| {
            let off = plane_mm - spot.at_mm;
            let reach_mm = 5.0 * spot.radius_mm;
            if off.x.abs() > reach_mm || off.y.abs() > reach_mm {
                return levels;
            }
            let off_mm = off.length();
            if off_mm > reach_mm {
                return levels;
            }
            let ring = bell((off_mm - 2.0 * spot.radius_mm) / (0.55 * spot.radius_mm));
            let core = 0.55 * smooth((spot.radius_mm - off_mm) / 0.12 + 0.5);
            levels.map(|level| (level + 55.0 * ring) * (1.0 - core))
        })
    }

    /// A patch of dirt with a ragged border, and a scratch with a bright flank.
    fn dirty(&self, plane_mm: Vec2, levels: [f64; 3]) -> [f64; 3] {
        let off = plane_mm - self.patch.at_mm;
        let dirt = if off.length() < 1.5 * self.patch.radius_mm + 0.2 {
            let edge_mm = self.patch.radius_mm * (1.0 + 0.5 * self.grain(off + Vec2::new(3.0, 5.0), 0.5));
            0.5 * smooth((edge_mm - off.length()) / 0.2 + 0.5) * (1.0 + 0.3 * self.grain(plane_mm, 0.25))
        } else {
            0.0
        };
        let (middle, along) = self.scratch;
        let d = plane_mm - middle;
        let (far, near) = (d.x * along.x + d.y * along.y, d.x * along.y - d.y * along.x);
        // Beyond its ends, and where the exponential below is practically 0.
        if far.abs() > 3.7 || near.abs() > 3.0 {
            return levels.map(|level| level * (1.0 - dirt));
        }
        let near = near + 0.06 * self.grain(Vec2::new(far, 0.0), 0.8);
        let line = |at: f64| bell((near - at) / 0.06) * smooth((3.2 - far.abs()) / 0.8 + 0.5);
        levels.map(|level| level * (1.0 - dirt) * (1.0 - 0.45 * line(0.0)) + 35.0 * line(0.15))
    }

    /// Smooth noise between -1 and 1, `step_mm` from node to node.
    fn grain(&self, at_mm: Vec2, step_mm: f64) -> f64 {
        let (x, y) = (at_mm.x / step_mm + 512.0, at_mm.y / step_mm + 512.0);
        let (column, row) = (x.floor(), y.floor());
        let (fx, fy) = (smooth(x - column), smooth(y - row));
        let node = |dx: i64, dy: i64| {
            let wrap = |at: i64| at.rem_euclid(GRAIN_NODES as i64) as usize;
            self.grain[wrap(row as i64 + dy) * GRAIN_NODES + wrap(column as i64 + dx)]
        };
        let (upper, lower) = (node(0, 0) + (node(1, 0) - node(0, 0)) * fx, node(0, 1) + (node(1, 1) - node(0, 1)) * fx);
        upper + (lower - upper) * fy
    }
}

/// A Gaussian of height 1 over distance in standard deviations.
pub(super) fn bell(distance: f64) -> f64 {
    libm::exp(-0.5 * distance * distance)
}

/// From 0 below 0 to 1 above 1, with zero slope at both ends.
fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
