//! What a 2F-85 does, whichever interface commands it.

use crate::emulator::fault::Fault;
use crate::emulator::jaws::EmulatedJaws;
use crate::gripper::config::{Config, Kind, read_table};
use crate::gripper::robotiq::status::{ACTIVATED, bit, object};
use slipbound::plant::{JawSettings, Plant};

/// A position request from here on means: close on whatever is there. Below it the jaws move without pressing.
const GRIPS_FROM: u8 = 200;

/// Fault: overcurrent; stands for every cause for which the gripper stops itself.
const STOPPED: u8 = 0xE;

/// The gripper behind its interfaces.
#[derive(Debug)]
pub(super) struct Gripper {
    pub jaws: EmulatedJaws,
    pub outputs: [u8; 6],
    pub activation: u8,
    pub fault: u8,
    /// Whether it presses on something that was in the way of a motion.
    meets: bool,
    scales: Config,
}

impl Gripper {
    pub fn new() -> Self {
        let scales = Config::of(Kind::Robotiq);
        let jaws = JawSettings {
            stroke_mm: 85.0,
            resolution_n: 0.5,
            least_n: scales.least_n,
            most_n: scales.most_n,
            ..JawSettings::default()
        };
        Gripper {
            jaws: EmulatedJaws::new(jaws),
            scales,
            outputs: [bit::ACTIVATE, 0, 0, 0, 0, 0],
            activation: ACTIVATED,
            fault: 0,
            meets: false,
        }
    }

    /// Takes new outputs. False: refused.
    pub fn set(&mut self, outputs: [u8; 6]) -> bool {
        if self.jaws.refuses_force() && outputs[5] != self.outputs[5] {
            return false;
        }
        let was_active = self.outputs[0] & bit::ACTIVATE != 0;
        self.outputs = outputs;
        self.meets = false;
        match (was_active, outputs[0] & bit::ACTIVATE != 0) {
            (_, false) => {
                (self.activation, self.fault) = (0, 0);
                self.jaws.stay();
            }
            (false, true) => {
                self.activation = 1;
                self.jaws.move_to(85.0);
            }
            (true, true) if self.activation == ACTIVATED && self.fault == 0 && outputs[0] & bit::GO_TO != 0 => {
                match outputs[3] {
                    GRIPS_FROM.. => self.jaws.grasp(read_table(&self.scales.force_table, 0, f64::from(outputs[5]))),
                    position => self.jaws.move_to(self.scales.opening_of_count(position)),
                }
            }
            _ => {}
        }
        true
    }

    pub fn advance_to(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        self.jaws.advance_to(now_ns, plant);
        if self.activation == 1 && self.jaws.is_there() {
            self.activation = ACTIVATED;
        }
        // Whatever is in the way of closing fingers is gripped.
        let goes = self.activation == ACTIVATED && self.fault == 0 && self.outputs[0] & bit::GO_TO != 0;
        if goes && self.outputs[3] < GRIPS_FROM && !self.meets && self.jaws.is_blocked() {
            self.meets = true;
            self.jaws.grasp(read_table(&self.scales.force_table, 0, f64::from(self.outputs[5])));
        }
    }

    pub fn object(&self) -> u8 {
        let grips = (self.outputs[3] >= GRIPS_FROM || self.meets) && self.outputs[0] & bit::GO_TO != 0;
        match grips {
            true if self.jaws.touches() => object::CONTACT_CLOSING,
            true if self.jaws.has_begun() && self.jaws.opening_mm() <= 0.0 => object::THERE,
            false if self.jaws.is_there() => object::THERE,
            _ if self.meets => object::CONTACT_CLOSING, // the moment before it presses
            _ => object::MOVING,
        }
    }

    pub fn position(&self) -> u8 {
        self.scales.position_count(self.jaws.opening_mm())
    }

    pub fn inputs(&self) -> [u8; 6] {
        let status = (self.outputs[0] & (bit::ACTIVATE | bit::GO_TO)) | self.activation << 4 | self.object() << 6;
        [status, 0, self.fault, self.outputs[3], self.position(), (self.jaws.force_n() / 2.0) as u8]
    }

    pub fn inject(&mut self, fault: Fault) -> bool {
        match fault {
            Fault::FastStop => self.fault = STOPPED,
            Fault::PowerCycle => (self.outputs, self.activation, self.fault) = ([0; 6], 0, 0),
            _ => return false,
        }
        self.jaws.stay();
        true
    }
}
