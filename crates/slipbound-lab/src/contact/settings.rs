//! The settings that are fixed during a run, and the command of a step.

use super::body::{Body, Pose, Wrench};
use super::friction::Friction;
use super::grid::Grid;
use super::normal::{Grip, Stop};
use crate::layer::{Gel, SoftObject, above_zero};
use serde::{Deserialize, Serialize};
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// Extent of the gel about the middle of the grid. There is no contact beyond it.
///
/// ```text
///            object
///   ===========================
///       ___________________          half_mm: of the whole gel
///      (                   )         radius_mm: of its rounded edge
///   - - - - housing - - - - - -
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GelEdge {
    /// Half the length along x and along y in mm, above 0.
    pub half_mm: Vec2,
    /// Radius of the edge in mm, above 0 and at most half the shorter side.
    pub radius_mm: f64,
}

impl GelEdge {
    /// How far the surface of the gel lies below its middle at a position, in mm; infinite beside the gel.
    pub fn below_mm(&self, place_mm: Vec2) -> f64 {
        let into = |half: f64, at: f64| (at.abs() - (half - self.radius_mm)).max(0.0);
        let (x, y) = (into(self.half_mm.x, place_mm.x), into(self.half_mm.y, place_mm.y));
        let left = self.radius_mm * self.radius_mm - x * x - y * y;
        if left < 0.0 { f64::INFINITY } else { self.radius_mm - left.sqrt() }
    }

    fn check(&self) -> Result<(), SettingError> {
        above_zero("edge.half_mm.x", self.half_mm.x)?;
        above_zero("edge.half_mm.y", self.half_mm.y)?;
        let most_mm = self.half_mm.x.min(self.half_mm.y);
        if self.radius_mm > 0.0 && self.radius_mm <= most_mm {
            return Ok(());
        }
        Err(SettingError {
            key: "edge.radius_mm".into(),
            got: self.radius_mm.to_string(),
            expected: format!("a number above 0, at most {most_mm}"),
        })
    }
}

/// The settings that are fixed during a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FingerSettings {
    /// Cells of the gel.
    pub grid: Grid,
    /// Extent of the gel; None if it extends beyond the grid.
    pub edge: Option<GelEdge>,
    /// The gel.
    pub gel: Gel,
    /// Softness of the object; None for a rigid one.
    pub soft_object: Option<SoftObject>,
    /// Friction between them.
    pub friction: Friction,
    /// How the object moves.
    pub body: Body,
    /// Pose of the shape in the object's frame, whose pose is commanded.
    pub shape_in_object: Pose,
    /// Length of a step in s, above 0. 1/120 is four steps a frame at 30 Hz: as expensive as one long step, and more
    /// accurate.
    pub substep_s: f64,
    /// When the normal solver stops.
    pub normal_stop: Stop,
    /// When the tangential solver stops.
    pub tangential_stop: Stop,
}

impl FingerSettings {
    /// The standard grid, a rigid guided object, friction 0.8, 4 steps a frame.
    pub fn standard() -> Self {
        FingerSettings {
            grid: Grid::standard(),
            edge: None,
            gel: Gel::default(),
            soft_object: None,
            friction: Friction::constant(0.8),
            body: Body::default(),
            shape_in_object: Pose::default(),
            substep_s: 1.0 / 120.0,
            normal_stop: Stop { tolerance_fraction: 1e-4, most_iterations_count: 200 },
            tangential_stop: Stop { tolerance_fraction: 1e-4, most_iterations_count: 400 },
        }
    }

    /// The same on the fast grid.
    pub fn fast() -> Self {
        FingerSettings { grid: Grid::fast(), ..Self::standard() }
    }

    /// Refuses numbers outside the ranges of the fields.
    pub fn check(&self) -> Result<(), SettingError> {
        self.grid.check()?;
        if let Some(edge) = &self.edge {
            edge.check()?;
        }
        self.gel.check()?;
        if let Some(soft) = &self.soft_object {
            soft.check()?;
        }
        self.friction.check()?;
        self.body.check()?;
        check_pose("shape_in_object", &self.shape_in_object)?;
        above_zero("substep_s", self.substep_s)?;
        for (name, stop) in [("normal_stop", self.normal_stop), ("tangential_stop", self.tangential_stop)] {
            if !(1e-14..=0.1).contains(&stop.tolerance_fraction) {
                return Err(SettingError {
                    key: format!("{name}.tolerance_fraction"),
                    got: stop.tolerance_fraction.to_string(),
                    expected: "a number from 1e-14 to 0.1".into(),
                });
            }
            if stop.most_iterations_count == 0 {
                return Err(SettingError {
                    key: format!("{name}.most_iterations_count"),
                    got: "0".into(),
                    expected: "1 or more".into(),
                });
            }
        }
        Ok(())
    }

    /// Refuses a shape that does not fit on the gel.
    pub(super) fn check_size(&self, half: Vec2) -> Result<(), SettingError> {
        let (s, c) = libm::sincos(self.shape_in_object.turn_rad);
        let at = self.shape_in_object.position_mm;
        let reach = Vec2::new(
            at.x.abs() + (c * half.x).abs() + (s * half.y).abs(),
            at.y.abs() + (s * half.x).abs() + (c * half.y).abs(),
        );
        let room = self.grid.half_size_mm() - Vec2::new(self.grid.cell_mm, self.grid.cell_mm);
        if reach.x <= room.x && reach.y <= room.y {
            return Ok(());
        }
        Err(SettingError {
            key: "shape".into(),
            got: format!("an object of {:.2} x {:.2} mm about the middle of the pad", 2.0 * reach.x, 2.0 * reach.y),
            expected: format!("at most {:.2} x {:.2} mm, the pad less a cell all round", 2.0 * room.x, 2.0 * room.y),
        })
    }
}

fn check_pose(key: &str, pose: &Pose) -> Result<(), SettingError> {
    if pose.position_mm.is_finite() && pose.turn_rad.is_finite() {
        return Ok(());
    }
    Err(SettingError { key: key.into(), got: format!("{pose:?}"), expected: "finite numbers".into() })
}

/// The command for the object at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
    /// Force or depth that holds it against the gel.
    pub grip: Grip,
    /// Pose of a guided object, or of the hand of a mounted one.
    pub pose: Pose,
    /// How far it has rolled: the offset of its lowest point from its reference point, in mm.
    pub roll_mm: Vec2,
    /// External load on an object that is free or mounted, about its reference point.
    pub wrench: Wrench,
}

impl Command {
    /// A command at a share of the way to another one: grip (if both are forces or depths), pose and roll. The wrench,
    /// and a grip of another kind, are those of the other at once.
    pub(super) fn towards(&self, to: &Command, share: f64) -> Command {
        let mix = |from: f64, to: f64| from + (to - from) * share;
        let place = |from: Vec2, to: Vec2| from + (to - from) * share;
        Command {
            grip: match (self.grip, to.grip) {
                (Grip::ForceN(from), Grip::ForceN(to)) => Grip::ForceN(mix(from, to)),
                (Grip::DepthMm(from), Grip::DepthMm(to)) => Grip::DepthMm(mix(from, to)),
                (_, grip) => grip,
            },
            pose: Pose {
                position_mm: place(self.pose.position_mm, to.pose.position_mm),
                turn_rad: mix(self.pose.turn_rad, to.pose.turn_rad),
            },
            roll_mm: place(self.roll_mm, to.roll_mm),
            wrench: to.wrench,
        }
    }

    /// The command of increment `n` of `count` on the way to another command.
    pub(super) fn part(&self, to: &Command, n: u32, count: u32) -> Command {
        if n == count { *to } else { self.towards(to, f64::from(n) / f64::from(count)) }
    }

    /// Refuses negative forces and numbers that are not finite.
    pub fn check(&self) -> Result<(), SettingError> {
        self.grip.check()?;
        check_pose("command.pose", &self.pose)?;
        if self.roll_mm.is_finite() && self.wrench.force_n.is_finite() && self.wrench.torque_n_mm.is_finite() {
            return Ok(());
        }
        Err(SettingError {
            key: "command.roll_mm, command.wrench".into(),
            got: format!("{:?}, {:?}", self.roll_mm, self.wrench),
            expected: "finite numbers".into(),
        })
    }
}
