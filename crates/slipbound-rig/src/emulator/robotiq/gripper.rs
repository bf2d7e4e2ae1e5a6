//! What a 2F-85 does, whichever interface commands it.

use crate::emulator::fault::Fault;
use crate::emulator::jaws::EmulatedJaws;
use crate::gripper::config::{Config, Kind, read_table};
use crate::gripper::robotiq::status::{ACTIVATED, bit, object, speed_of_count};
use slipbound::plant::{JawSettings, Plant};

/// Activation under way: the jaws close and open to find their ends.
const ACTIVATING: u8 = 1;

/// Widest opening, mm.
const STROKE_MM: f64 = 85.0;

/// Speed while activating: 1.2 s to close and open. A real one takes a few seconds; clients wait for its state.
const ACTIVATION_MM_PER_S: f64 = 150.0;

/// Fault: overcurrent; stands for every cause for which the gripper stops itself.
const STOPPED: u8 = 0xE;

/// The motion that the outputs command. Speed and force are the gripper's numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Motion {
    Stay,
    /// Closes, and opens again at the end.
    Activate {
        opens: bool,
    },
    /// Nothing is in the way.
    To {
        position: u8,
        speed: u8,
    },
    /// An object in the way stops the fingers, and is gripped.
    Grip {
        speed: u8,
        force: u8,
    },
}

/// The gripper behind its interfaces.
#[derive(Debug)]
pub(super) struct Gripper {
    pub jaws: EmulatedJaws,
    pub outputs: [u8; 6],
    pub activation: u8,
    pub fault: u8,
    motion: Motion,
    /// Whether activation has closed the jaws.
    has_closed: bool,
    /// Width of what is between the jaws, mm.
    between_mm: Option<f64>,
    scales: Config,
}

impl Gripper {
    pub fn new() -> Self {
        let scales = Config::of(Kind::Robotiq);
        let jaws = JawSettings {
            stroke_mm: STROKE_MM,
            speed_mm_per_s: ACTIVATION_MM_PER_S,
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
            motion: Motion::Stay,
            has_closed: false,
            between_mm: None,
        }
    }

    /// Takes new outputs. False: refused.
    pub fn set(&mut self, outputs: [u8; 6]) -> bool {
        if self.jaws.refuses_force() && outputs[5] != self.outputs[5] {
            return false;
        }
        let was_active = self.outputs[0] & bit::ACTIVATE != 0;
        self.outputs = outputs;
        match (was_active, outputs[0] & bit::ACTIVATE != 0) {
            (_, false) => (self.activation, self.fault) = (0, 0),
            (false, true) => (self.activation, self.has_closed) = (ACTIVATING, false),
            (true, true) => {}
        }
        self.steer();
        true
    }

    pub fn advance_to(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        self.between_mm = self.jaws.between_mm(plant);
        self.jaws.advance_to(now_ns, plant);
        if let Motion::Activate { opens } = self.motion {
            // An object in the way ends the closing stroke.
            self.has_closed |= !opens && (self.jaws.is_there() || self.jaws.is_blocked());
            if opens && self.jaws.is_there() {
                self.activation = ACTIVATED;
            }
        }
        self.steer();
    }

    fn goes(&self) -> bool {
        self.activation == ACTIVATED && self.outputs[0] & bit::GO_TO != 0
    }

    fn wanted(&self) -> Motion {
        let [.., position, speed, force] = self.outputs;
        if self.fault != 0 {
            return Motion::Stay;
        }
        match self.activation {
            ACTIVATING => Motion::Activate { opens: self.has_closed },
            _ if !self.goes() => Motion::Stay,
            _ if self.between_mm > Some(self.scales.opening_of_count(position)) => Motion::Grip { speed, force },
            _ => Motion::To { position, speed },
        }
    }

    /// Commands the jaws, where the wanted motion is new.
    fn steer(&mut self) {
        let wanted = self.wanted();
        if wanted == self.motion {
            return;
        }
        self.motion = wanted;
        match wanted {
            Motion::Stay => self.jaws.stay(),
            Motion::Activate { opens } => {
                self.jaws.set_speed(ACTIVATION_MM_PER_S);
                self.jaws.move_to(if opens { STROKE_MM } else { 0.0 });
            }
            Motion::To { position, speed } => {
                self.jaws.set_speed(speed_of_count(speed));
                self.jaws.move_to(self.scales.opening_of_count(position));
            }
            Motion::Grip { speed, force } => {
                self.jaws.set_speed(speed_of_count(speed));
                self.jaws.grasp(read_table(&self.scales.force_table, 0, f64::from(force)));
            }
        }
    }

    /// gOBJ. The manual: to be ignored without gGTO; it is 0 in the manual's examples then.
    pub fn object(&self) -> u8 {
        match self.motion {
            _ if !self.goes() => object::MOVING,
            Motion::To { .. } if self.jaws.is_there() => object::THERE,
            Motion::Grip { .. } | Motion::Stay if self.jaws.touches() => object::CONTACT_CLOSING,
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
        self.steer();
        true
    }
}
