//! A 2F-85 by the text socket of a UR controller.

use super::gripper::Gripper;
use crate::emulator::fault::Fault;
use crate::emulator::firmware::Firmware;
use crate::emulator::jaws::EmulatedJaws;
use crate::gripper::robotiq::status::bit;
use crate::link::Lines;
use slipbound::plant::Plant;

/// The firmware.
#[derive(Debug)]
pub struct Socket {
    gripper: Gripper,
    lines: Lines,
    /// ATR and ADR: an automatic release was requested, and its direction. It is remembered, not done.
    releases: u8,
    release_direction: u8,
}

impl Default for Socket {
    fn default() -> Self {
        Socket { gripper: Gripper::new(), lines: Lines::default(), releases: 0, release_direction: 0 }
    }
}

impl Socket {
    fn execute(&mut self, line: Option<&str>, outgoing: &mut Vec<u8>) {
        let words: Vec<&str> = line.unwrap_or_default().split_whitespace().collect();
        match words.as_slice() {
            ["GET", name] => {
                let answer = self.get(name).map(|value| format!("{name} {value}\n"));
                outgoing.extend(answer.unwrap_or_else(|| "?\n".into()).into_bytes());
            }
            ["SET", pairs @ ..] if self.set(pairs) => outgoing.extend(b"ack"),
            _ => outgoing.extend(b"?\n"),
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
            "ATR" => self.releases,
            "ADR" => self.release_direction,
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
                "ATR" => self.releases = value,
                "ADR" => self.release_direction = value,
                _ => return false,
            }
        }
        self.gripper.set(outputs)
    }
}

impl Firmware for Socket {
    fn connected(&mut self, _now_ns: u64, _outgoing: &mut Vec<u8>) {
        self.lines.clear();
    }

    fn disconnected(&mut self) {}

    fn receive(&mut self, _now_ns: u64, bytes: &[u8], outgoing: &mut Vec<u8>) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.execute(line, outgoing));
        self.lines = lines;
    }

    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant, _outgoing: &mut Vec<u8>) {
        self.gripper.advance_to(now_ns, plant);
    }

    fn inject(&mut self, fault: Fault, _outgoing: &mut Vec<u8>) -> bool {
        self.gripper.inject(fault)
    }

    fn jaws(&self) -> &EmulatedJaws {
        &self.gripper.jaws
    }

    fn jaws_mut(&mut self) -> &mut EmulatedJaws {
        &mut self.gripper.jaws
    }
}
