//! Where a finger is mounted in the hand: its side, and the rotation of its image.

use crate::plane::Vec2;
use crate::setting::named;
use serde::{Deserialize, Serialize};

/// The side of the object on which a finger is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Its gel faces along Z.
    Left,
    /// Its gel faces against Z.
    Right,
}

const SIDES: [(Side, &str); 2] = [(Side::Left, "left"), (Side::Right, "right")];

named!(Side, "side", SIDES);

/// How a finger is mounted in the hand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mounting {
    /// Its side.
    pub side: Side,
    /// Angle by which its image is rotated against the finger frame, radians from x to y.
    #[serde(default)]
    pub turn_rad: f64,
}

impl Mounting {
    /// A finger on this side whose image is not rotated.
    pub const fn on(side: Side) -> Self {
        Mounting { side, turn_rad: 0.0 }
    }

    /// +1 on the right, where y is Y and a rotation from x to y is one from X to Y; -1 on the left.
    pub(super) fn sense(&self) -> f64 {
        match self.side {
            Side::Left => -1.0,
            Side::Right => 1.0,
        }
    }

    /// A vector of the rectified image in the finger frame.
    pub(super) fn in_finger(&self, v: Vec2) -> Vec2 {
        v.rotated(-self.turn_rad)
    }
}
