//! The status of a 2F-85, on either interface, and its numbers in newtons and mm.

use crate::gripper::config::{Config, ROBOTIQ_SPEEDS_MM_PER_S, read_table};
use slipbound::port::Jaws;

/// Bits of the first output and input byte.
pub(crate) mod bit {
    pub const ACTIVATE: u8 = 1;
    pub const GO_TO: u8 = 1 << 3;
}

/// Activation state: done.
pub(crate) const ACTIVATED: u8 = 3;

/// Position request: closed as far as it goes.
pub(crate) const CLOSED: u8 = 255;

/// What the gripper reports of its object.
pub(crate) mod object {
    pub const MOVING: u8 = 0;
    pub const CONTACT_OPENING: u8 = 1;
    pub const CONTACT_CLOSING: u8 = 2;
    pub const THERE: u8 = 3;
}

/// Its status, on either interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Status {
    /// gSTA, 0 to 3.
    pub activation: u8,
    /// gOBJ, 0 to 3.
    pub object: u8,
    /// gFLT.
    pub fault: u8,
    /// gPR: requested position, 255 is closed.
    pub position_asked: u8,
    /// gPO: position, 255 is closed; None while it is not told.
    pub position: Option<u8>,
}

impl Status {
    /// From the six input bytes.
    pub fn from_bytes(bytes: [u8; 6]) -> Self {
        Status {
            activation: (bytes[0] >> 4) & 3,
            object: bytes[0] >> 6,
            fault: bytes[2] & 0xF,
            position_asked: bytes[3],
            position: Some(bytes[4]),
        }
    }

    pub fn is_active(&self) -> bool {
        self.activation == ACTIVATED
    }

    pub fn is_moving(&self) -> bool {
        self.object == object::MOVING
    }

    /// The fault in words; None for none, and for those that end by themselves.
    pub fn fault_in_words(&self) -> Option<String> {
        let words = match self.fault {
            0..=7 | 9 => return None,
            0x8 => "it is too hot",
            0xA => "its supply voltage is too low",
            0xB => "an automatic release is under way",
            0xC => "an internal fault",
            0xD => "its activation failed",
            0xE => "overcurrent",
            _ => "an automatic release was done",
        };
        Some(format!("fault {}, {words}", self.fault))
    }

    /// The state of the jaws; `has_held` distinguishes a lost object from one that was never there.
    pub fn jaws(&self, has_held: bool) -> Jaws {
        let closes = self.position_asked == CLOSED;
        match (self.is_active(), self.fault_in_words(), self.object) {
            (_, Some(_), _) => Jaws::Stopped,
            (false, ..) => Jaws::Unknown,
            (_, _, object::CONTACT_CLOSING) => Jaws::Holding,
            (_, _, object::CONTACT_OPENING) => Jaws::Open,
            _ if !closes => Jaws::Open,
            // Also while it presses anew what it holds, with another force.
            (_, _, object::MOVING) => Jaws::Closing,
            _ if has_held => Jaws::Lost,
            _ => Jaws::Nothing,
        }
    }
}

/// The speed of a number, mm/s.
pub(crate) fn speed_of_count(count: u8) -> f64 {
    let (slowest, fastest) = ROBOTIQ_SPEEDS_MM_PER_S;
    slowest + f64::from(count) * (fastest - slowest) / 255.0
}

impl Config {
    /// Robotiq's number for a force per finger.
    pub(crate) fn force_count(&self, force_n: f64) -> u8 {
        read_table(&self.force_table, 1, self.to_own_n(force_n)).round() as u8
    }

    /// The force per finger of Robotiq's number.
    pub(crate) fn force_of_count(&self, count: u8) -> Option<f64> {
        self.from_own_n(read_table(&self.force_table, 0, f64::from(count)))
    }

    /// The opening at a position, mm.
    pub(crate) fn opening_of_count(&self, count: u8) -> f64 {
        read_table(&self.opening_table, 0, f64::from(count))
    }

    /// The position of an opening.
    pub(crate) fn position_count(&self, opening_mm: f64) -> u8 {
        read_table(&self.opening_table, 1, opening_mm).round() as u8
    }

    /// The speed as a number: 0 is 20 mm/s, 255 is 150 mm/s, by the data sheet.
    pub(crate) fn speed_count(&self) -> u8 {
        ((self.speed_mm_per_s - 20.0) / 130.0 * 255.0).round() as u8
    }
}
