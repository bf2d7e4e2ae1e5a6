//! A Robotiq 2F-85: by Modbus RTU ([`Serial`]), or by the text socket of a UR controller ([`Socket`]).

use super::hand::Hand;
use super::{Emulator, Mishap};
use crate::gripper::config::{Config, Kind, read_table};
use crate::gripper::robotiq::rtu::{self, Ask, Parser};
use crate::gripper::robotiq::{ACTIVATED, bit, object};
use crate::gripper::text::Lines;
use slipbound::plant::JawSettings;
use slipbound::plant::Plant;

/// A position request from here on means: close on whatever is there. Below it the jaws move without pressing.
const GRIPS_FROM: u8 = 200;

/// Fault: overcurrent; stands for every cause for which the gripper stops itself.
const STOPPED: u8 = 0xE;

/// The gripper behind its interfaces.
#[derive(Debug)]
struct Gripper {
    hand: Hand,
    scales: Config,
    outputs: [u8; 6],
    activation: u8,
    fault: u8,
    refuses_force: bool,
}

impl Gripper {
    fn new() -> Self {
        let scales = Config::of(Kind::Robotiq);
        let jaws = JawSettings {
            stroke_mm: 85.0,
            resolution_n: 0.5,
            least_n: scales.least_n,
            most_n: scales.most_n,
            ..JawSettings::default()
        };
        Gripper {
            hand: Hand::new(jaws),
            scales,
            outputs: [bit::ACTIVATE, 0, 0, 0, 0, 0],
            activation: ACTIVATED,
            fault: 0,
            refuses_force: false,
        }
    }

    /// Takes new outputs. False: refused.
    fn set(&mut self, outputs: [u8; 6]) -> bool {
        if self.refuses_force && outputs[5] != self.outputs[5] {
            return false;
        }
        let was_active = self.outputs[0] & bit::ACTIVATE != 0;
        self.outputs = outputs;
        match (was_active, outputs[0] & bit::ACTIVATE != 0) {
            (_, false) => {
                (self.activation, self.fault) = (0, 0);
                self.hand.stay();
            }
            (false, true) => {
                self.activation = 1;
                self.hand.move_to(85.0);
            }
            (true, true) if self.activation == ACTIVATED && self.fault == 0 && outputs[0] & bit::GO_TO != 0 => {
                match outputs[3] {
                    GRIPS_FROM.. => self.hand.grasp(read_table(&self.scales.force_table, 0, f64::from(outputs[5]))),
                    position => self.hand.move_to(self.scales.opening_of_count(position)),
                }
            }
            _ => {}
        }
        true
    }

    fn advance_to(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        self.hand.advance_to(now_ns, plant);
        if self.activation == 1 && self.hand.is_there() {
            self.activation = ACTIVATED;
        }
    }

    fn object(&self) -> u8 {
        let grips = self.outputs[3] >= GRIPS_FROM && self.outputs[0] & bit::GO_TO != 0;
        match grips {
            true if self.hand.touches() => object::CONTACT_CLOSING,
            true if self.hand.has_begun() && self.hand.opening_mm() <= 0.0 => object::THERE,
            false if self.hand.is_there() => object::THERE,
            _ => object::MOVING,
        }
    }

    fn position(&self) -> u8 {
        self.scales.position_count(self.hand.opening_mm())
    }

    fn inputs(&self) -> [u8; 6] {
        let status = (self.outputs[0] & (bit::ACTIVATE | bit::GO_TO)) | self.activation << 4 | self.object() << 6;
        [status, 0, self.fault, self.outputs[3], self.position(), (self.hand.force_n() / 2.0) as u8]
    }

    fn befall(&mut self, mishap: Mishap) -> bool {
        match mishap {
            Mishap::FastStop => {
                self.fault = STOPPED;
                self.hand.stay();
            }
            Mishap::RefuseForce => self.refuses_force = true,
            Mishap::LosePart => self.hand.lose_part(),
            Mishap::PowerCycle => {
                (self.outputs, self.activation, self.fault) = ([0; 6], 0, 0);
                self.hand.stay();
            }
            Mishap::FixedLimit | Mishap::AllowRegrasp => return false,
        }
        true
    }
}

/// The emulator by Modbus RTU.
#[derive(Debug)]
pub struct Serial {
    gripper: Gripper,
    parser: Parser,
    outgoing: Vec<u8>,
}

impl Default for Serial {
    fn default() -> Self {
        Serial { gripper: Gripper::new(), parser: Parser::default(), outgoing: Vec::new() }
    }
}

impl Serial {
    fn obey(&mut self, ask: Ask) {
        match ask {
            Ask::Write(outputs) if self.gripper.set(outputs) => rtu::answer_write(&mut self.outgoing),
            Ask::Write(_) => rtu::answer_refused(&mut self.outgoing, 16, 3),
            Ask::Read { function, registers_count } => {
                let inputs = self.gripper.inputs();
                rtu::answer_read(&mut self.outgoing, function, &inputs[..2 * usize::from(registers_count)]);
            }
            Ask::Unknown(function) => rtu::answer_refused(&mut self.outgoing, function, 1),
        }
    }
}

impl Emulator for Serial {
    fn connected(&mut self, _now_ns: u64) {
        self.parser.clear();
        self.outgoing.clear();
    }

    fn disconnected(&mut self, _now_ns: u64) {
        self.outgoing.clear();
    }

    fn receive(&mut self, _now_ns: u64, bytes: &[u8]) {
        let mut parser = std::mem::take(&mut self.parser);
        parser.feed_asks(bytes, |ask| self.obey(ask));
        self.parser = parser;
    }

    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        self.gripper.advance_to(now_ns, plant);
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }

    fn befall(&mut self, _now_ns: u64, mishap: Mishap) -> bool {
        self.gripper.befall(mishap)
    }

    fn force_n(&self) -> f64 {
        self.gripper.hand.force_n()
    }

    fn opening_mm(&self) -> f64 {
        self.gripper.hand.opening_mm()
    }
}

/// The emulator by the text socket.
#[derive(Debug)]
pub struct Socket {
    gripper: Gripper,
    lines: Lines,
    outgoing: Vec<u8>,
}

impl Default for Socket {
    fn default() -> Self {
        Socket { gripper: Gripper::new(), lines: Lines::default(), outgoing: Vec::new() }
    }
}

impl Socket {
    fn obey(&mut self, line: Option<&str>) {
        let words: Vec<&str> = line.unwrap_or_default().split_whitespace().collect();
        match words.as_slice() {
            ["GET", name] => {
                let answer = self.get(name).map(|value| format!("{name} {value}\n"));
                self.outgoing.extend(answer.unwrap_or_else(|| "?\n".into()).into_bytes());
            }
            ["SET", pairs @ ..] if self.set(pairs) => self.outgoing.extend(b"ack"),
            _ => self.outgoing.extend(b"?\n"),
        }
    }

    fn get(&self, name: &str) -> Option<u8> {
        let gripper = &self.gripper;
        let outputs = gripper.outputs;
        Some(match name {
            "ACT" => outputs[0] & bit::ACTIVATE,
            "GTO" => u8::from(outputs[0] & bit::GO_TO != 0),
            "SPE" => outputs[4],
            "FOR" => outputs[5],
            "STA" => gripper.activation,
            "OBJ" => gripper.object(),
            "PRE" => outputs[3],
            "POS" => gripper.position(),
            "FLT" => gripper.fault,
            _ => return None,
        })
    }

    fn set(&mut self, pairs: &[&str]) -> bool {
        let mut outputs = self.gripper.outputs;
        if pairs.is_empty() || !pairs.len().is_multiple_of(2) {
            return false;
        }
        for pair in pairs.chunks_exact(2) {
            let Ok(value) = pair[1].parse::<u8>() else { return false };
            let flag = |bits: u8, bit: u8| if value != 0 { bits | bit } else { bits & !bit };
            match pair[0] {
                "ACT" => outputs[0] = flag(outputs[0], bit::ACTIVATE),
                "GTO" => outputs[0] = flag(outputs[0], bit::GO_TO),
                "POS" => outputs[3] = value,
                "SPE" => outputs[4] = value,
                "FOR" => outputs[5] = value,
                _ => return false,
            }
        }
        self.gripper.set(outputs)
    }
}

impl Emulator for Socket {
    fn connected(&mut self, _now_ns: u64) {
        self.lines.clear();
        self.outgoing.clear();
    }

    fn disconnected(&mut self, _now_ns: u64) {
        self.outgoing.clear();
    }

    fn receive(&mut self, _now_ns: u64, bytes: &[u8]) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.obey(line));
        self.lines = lines;
    }

    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        self.gripper.advance_to(now_ns, plant);
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }

    fn befall(&mut self, _now_ns: u64, mishap: Mishap) -> bool {
        self.gripper.befall(mishap)
    }

    fn force_n(&self) -> f64 {
        self.gripper.hand.force_n()
    }

    fn opening_mm(&self) -> f64 {
        self.gripper.hand.opening_mm()
    }
}
