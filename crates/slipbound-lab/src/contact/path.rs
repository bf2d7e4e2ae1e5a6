//! Load paths as data: legs that begin where the last one ended and change linearly in time.

use super::body::{Pose, Wrench};
use super::normal::Grip;
use super::settings::Command;
use crate::layer::above_zero;
use serde::{Deserialize, Serialize};
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// The changes during a leg; everything else stays constant.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Change {
    /// Normal force per finger at the end of the leg, in N; None keeps the grip.
    pub grip_to_n: Option<f64>,
    /// Depth at the end of the leg, in mm; None keeps the grip.
    pub grip_to_depth_mm: Option<f64>,
    /// Displacement of the guided pose in mm.
    pub shift_mm: Vec2,
    /// Rotation of the guided pose in rad.
    pub turn_rad: f64,
    /// Rolling in mm: the object's lowest point moves over the gel while its skin does not slide.
    pub roll_mm: Vec2,
    /// Change of the wrench.
    pub pull: Wrench,
}

/// A leg of a path.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leg {
    /// Duration in seconds, above 0.
    pub seconds_s: f64,
    /// The changes, linear in time.
    pub change: Change,
}

impl Leg {
    fn of(seconds_s: f64, change: Change) -> Self {
        Leg { seconds_s, change }
    }

    /// Presses to a force per finger in N.
    pub fn press(force_n: f64, seconds_s: f64) -> Self {
        Self::of(seconds_s, Change { grip_to_n: Some(force_n), ..Change::default() })
    }

    /// Presses to a depth in mm.
    pub fn press_to_depth(depth_mm: f64, seconds_s: f64) -> Self {
        Self::of(seconds_s, Change { grip_to_depth_mm: Some(depth_mm), ..Change::default() })
    }

    /// Moves the pose by (x, y) mm.
    pub fn shear(x_mm: f64, y_mm: f64, seconds_s: f64) -> Self {
        Self::of(seconds_s, Change { shift_mm: Vec2::new(x_mm, y_mm), ..Change::default() })
    }

    /// Turns the pose by an angle in rad.
    pub fn twist(turn_rad: f64, seconds_s: f64) -> Self {
        Self::of(seconds_s, Change { turn_rad, ..Change::default() })
    }

    /// Moves and turns the pose together.
    pub fn shear_and_twist(x_mm: f64, y_mm: f64, turn_rad: f64, seconds_s: f64) -> Self {
        Self::of(seconds_s, Change { shift_mm: Vec2::new(x_mm, y_mm), turn_rad, ..Change::default() })
    }

    /// Rolls by (x, y) mm.
    pub fn roll(x_mm: f64, y_mm: f64, seconds_s: f64) -> Self {
        Self::of(seconds_s, Change { roll_mm: Vec2::new(x_mm, y_mm), ..Change::default() })
    }

    /// Adds a wrench, in proportion to time: the force-controlled ramp.
    pub fn pull(wrench: Wrench, seconds_s: f64) -> Self {
        Self::of(seconds_s, Change { pull: wrench, ..Change::default() })
    }

    /// Releases: the force falls to 0.
    pub fn release(seconds_s: f64) -> Self {
        Self::press(0.0, seconds_s)
    }

    /// Nothing changes.
    pub fn hold(seconds_s: f64) -> Self {
        Self::of(seconds_s, Change::default())
    }
}

/// A load path from rest: object at the origin, no grip, no wrench.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Leg>", into = "Vec<Leg>")]
pub struct Path {
    legs: Vec<Leg>,
}

impl TryFrom<Vec<Leg>> for Path {
    type Error = SettingError;
    fn try_from(legs: Vec<Leg>) -> Result<Self, SettingError> {
        Path::new(legs)
    }
}

impl From<Path> for Vec<Leg> {
    fn from(path: Path) -> Self {
        path.legs
    }
}

impl Path {
    /// Fails for legs without duration, negative forces and numbers that are not finite.
    pub fn new(legs: Vec<Leg>) -> Result<Self, SettingError> {
        for (n, leg) in legs.iter().enumerate() {
            above_zero(&format!("path[{n}].seconds_s"), leg.seconds_s)?;
            let Change { grip_to_n, grip_to_depth_mm, shift_mm, turn_rad, roll_mm, pull } = leg.change;
            if grip_to_n.is_some() && grip_to_depth_mm.is_some() {
                return Err(SettingError {
                    key: format!("path[{n}].grip_to_depth_mm"),
                    got: "a depth beside a force".into(),
                    expected: "one of grip_to_n and grip_to_depth_mm".into(),
                });
            }
            if let Some(force_n) = grip_to_n {
                crate::layer::zero_or_above(&format!("path[{n}].grip_to_n"), force_n)?;
            }
            for (key, number) in [
                ("grip_to_depth_mm", grip_to_depth_mm.unwrap_or(0.0)),
                ("shift_mm.x", shift_mm.x),
                ("shift_mm.y", shift_mm.y),
                ("turn_rad", turn_rad),
                ("roll_mm.x", roll_mm.x),
                ("roll_mm.y", roll_mm.y),
                ("pull.force_n.x", pull.force_n.x),
                ("pull.force_n.y", pull.force_n.y),
                ("pull.torque_n_mm", pull.torque_n_mm),
            ] {
                if !number.is_finite() {
                    return Err(SettingError {
                        key: format!("path[{n}].{key}"),
                        got: number.to_string(),
                        expected: "a finite number".into(),
                    });
                }
            }
        }
        Ok(Path { legs })
    }

    /// The legs.
    pub fn legs(&self) -> &[Leg] {
        &self.legs
    }

    /// Its duration in seconds.
    pub fn seconds_s(&self) -> f64 {
        self.legs.iter().map(|leg| leg.seconds_s).sum()
    }

    /// The command at a time in seconds since the beginning; before it the first, after the end the last.
    pub fn at(&self, time_s: f64) -> Command {
        let mut now =
            Command { grip: Grip::ForceN(0.0), pose: Pose::default(), roll_mm: Vec2::ZERO, wrench: Wrench::default() };
        let mut begin_s = 0.0;
        for leg in &self.legs {
            let end_s = begin_s + leg.seconds_s;
            // The end of a leg is reached exactly, whatever the rounding of the times: a release ends at 0 N.
            let share = if time_s > end_s - 1e-9 { 1.0 } else { ((time_s - begin_s) / leg.seconds_s).max(0.0) };
            let change = &leg.change;
            now.grip = match (change.grip_to_n, change.grip_to_depth_mm, now.grip) {
                (Some(to), _, Grip::ForceN(from)) => Grip::ForceN((1.0 - share) * from + share * to),
                (Some(to), _, Grip::DepthMm(_)) => Grip::ForceN(to),
                (None, Some(to), Grip::DepthMm(from)) => Grip::DepthMm((1.0 - share) * from + share * to),
                (None, Some(to), Grip::ForceN(_)) => Grip::DepthMm(share * to),
                (None, None, grip) => grip,
            };
            now.pose.position_mm += change.shift_mm * share;
            now.pose.turn_rad += change.turn_rad * share;
            now.roll_mm += change.roll_mm * share;
            now.wrench.force_n += change.pull.force_n * share;
            now.wrench.torque_n_mm += change.pull.torque_n_mm * share;
            if share < 1.0 {
                break;
            }
            begin_s = end_s;
        }
        now
    }

    /// The commands at the ends of all steps of `step_s` seconds, above 0, from the first step to the end.
    pub fn commands(&self, step_s: f64) -> impl Iterator<Item = Command> + '_ {
        let steps = (self.seconds_s() / step_s - 1e-9).ceil().max(0.0) as u64;
        (1..=steps).map(move |n| self.at(n as f64 * step_s))
    }
}
