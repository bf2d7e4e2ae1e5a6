//! A 2F-85 by Modbus RTU.

use super::gripper::Gripper;
use crate::emulator::fault::Fault;
use crate::emulator::firmware::Firmware;
use crate::emulator::jaws::EmulatedJaws;
use crate::gripper::robotiq::rtu::{self, Ask, Parser};
use slipbound::plant::Plant;

/// The firmware.
#[derive(Debug)]
pub struct Serial {
    gripper: Gripper,
    parser: Parser,
}

impl Default for Serial {
    fn default() -> Self {
        Serial { gripper: Gripper::new(), parser: Parser::default() }
    }
}

/// Modbus exception: there is no such register.
const NO_SUCH_REGISTER: u8 = 2;

/// Where registers stand among the three that begin at `first`, as a place of their bytes; None where they do not.
fn place(register: u16, registers_count: u8, first: u16) -> Option<usize> {
    let from = usize::from(register.checked_sub(first)?);
    let is_there = registers_count > 0 && from + usize::from(registers_count) <= usize::from(rtu::REGISTERS_COUNT);
    is_there.then_some(2 * from)
}

impl Serial {
    fn execute(&mut self, ask: Ask, outgoing: &mut Vec<u8>) {
        match ask {
            Ask::Write(outputs) if self.gripper.set(outputs) => rtu::answer_write(outgoing),
            Ask::Write(_) => rtu::answer_refused(outgoing, 16, 3),
            Ask::Read { function, registers_count } => {
                let inputs = self.gripper.inputs();
                rtu::answer_read(outgoing, function, &inputs[..2 * usize::from(registers_count)]);
            }
            Ask::WriteSome { function, register, registers_count, bytes } => {
                let Some(from) = place(register, registers_count, rtu::FIRST_OUTPUT) else {
                    return rtu::answer_refused(outgoing, function, NO_SUCH_REGISTER);
                };
                let count = 2 * usize::from(registers_count);
                let mut outputs = self.gripper.outputs;
                outputs[from..from + count].copy_from_slice(&bytes[..count]);
                match self.gripper.set(outputs) {
                    true => rtu::answer_write_some(outgoing, function, register, registers_count, bytes),
                    false => rtu::answer_refused(outgoing, function, 3),
                }
            }
            Ask::ReadSome { function, register, registers_count } => {
                let outputs = place(register, registers_count, rtu::FIRST_OUTPUT).map(|at| (at, self.gripper.outputs));
                let inputs = place(register, registers_count, rtu::FIRST_INPUT).map(|at| (at, self.gripper.inputs()));
                match outputs.or(inputs) {
                    Some((from, bytes)) => {
                        let to = from + 2 * usize::from(registers_count);
                        rtu::answer_read(outgoing, function, &bytes[from..to]);
                    }
                    None => rtu::answer_refused(outgoing, function, NO_SUCH_REGISTER),
                }
            }
            Ask::Unknown(function) => rtu::answer_refused(outgoing, function, 1),
        }
    }
}

impl Firmware for Serial {
    fn connected(&mut self, _now_ns: u64, _outgoing: &mut Vec<u8>) {
        self.parser.clear();
    }

    fn disconnected(&mut self) {}

    fn receive(&mut self, _now_ns: u64, bytes: &[u8], outgoing: &mut Vec<u8>) {
        let mut parser = std::mem::take(&mut self.parser);
        parser.feed_asks(bytes, |ask| self.execute(ask, outgoing));
        self.parser = parser;
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
