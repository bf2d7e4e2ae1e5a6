//! A 2F-85 by Modbus RTU.

use super::gripper::Gripper;
use crate::emulator::fault::Fault;
use crate::emulator::firmware::Firmware;
use crate::emulator::jaws::EmulatedJaws;
use crate::gripper::robotiq::rtu::{self, Parser, Registers, Request};
use slipbound::plant::Plant;
use std::ops::Range;

/// Silence that ends a message of unknown length, ns. On the line it is 3.5 characters, 0.3 ms; a client that is not a
/// real-time computer may take longer within a message.
const SILENCE_NS: u64 = 10_000_000;

/// Modbus exceptions: no such function, no such register, invalid message.
const NO_SUCH_FUNCTION: u8 = 1;
const NO_SUCH_REGISTER: u8 = 2;
const NO_SUCH_VALUE: u8 = 3;

/// The function that writes and reads.
const READ_WRITE: u8 = 23;

/// The firmware.
#[derive(Debug)]
pub struct Serial {
    gripper: Gripper,
    parser: Parser,
    received_ns: u64,
}

impl Default for Serial {
    fn default() -> Self {
        Serial { gripper: Gripper::new(), parser: Parser::default(), received_ns: 0 }
    }
}

/// The bytes of `registers` among those of the three registers that begin at `first`. The error is a Modbus exception.
fn place(registers: Registers, first: u16) -> Result<Range<usize>, u8> {
    let from = registers.first.checked_sub(first).ok_or(NO_SUCH_REGISTER)?;
    match registers.count {
        0 => Err(NO_SUCH_VALUE),
        count if from.saturating_add(count) > rtu::REGISTERS_COUNT => Err(NO_SUCH_REGISTER),
        count => Ok(2 * usize::from(from)..2 * usize::from(from + count)),
    }
}

impl Serial {
    fn execute(&mut self, request: Request, outgoing: &mut Vec<u8>) {
        let refused = match request {
            Request::Read { function, registers } => {
                self.read(function, registers, outgoing).map_err(|why| (function, why))
            }
            Request::Write { function, registers, bytes } => match self.write(registers, bytes) {
                Ok(()) => return rtu::answer_write(outgoing, function, registers, bytes),
                Err(why) => Err((function, why)),
            },
            Request::WriteRead { written, bytes, read } => {
                // What cannot be read is refused before anything is written.
                let result = self.registers(read).and_then(|_| self.write(written, bytes));
                result.and_then(|()| self.read(READ_WRITE, read, outgoing)).map_err(|why| (READ_WRITE, why))
            }
            Request::Malformed(function) => Err((function, NO_SUCH_VALUE)),
            Request::Unknown(function) => Err((function, NO_SUCH_FUNCTION)),
        };
        if let Err((function, why)) = refused {
            rtu::answer_refused(outgoing, function, why);
        }
    }

    /// The six bytes that contain the registers, and their place among them.
    fn registers(&self, registers: Registers) -> Result<([u8; 6], Range<usize>), u8> {
        let outputs = place(registers, rtu::FIRST_OUTPUT).map(|at| (self.gripper.outputs, at));
        outputs.or_else(|_| place(registers, rtu::FIRST_INPUT).map(|at| (self.gripper.inputs(), at)))
    }

    fn read(&self, function: u8, registers: Registers, outgoing: &mut Vec<u8>) -> Result<(), u8> {
        let (bytes, at) = self.registers(registers)?;
        rtu::answer_read(outgoing, function, &bytes[at]);
        Ok(())
    }

    fn write(&mut self, registers: Registers, bytes: [u8; 6]) -> Result<(), u8> {
        let at = place(registers, rtu::FIRST_OUTPUT)?;
        let mut outputs = self.gripper.outputs;
        let count = at.len();
        outputs[at].copy_from_slice(&bytes[..count]);
        if self.gripper.set(outputs) { Ok(()) } else { Err(NO_SUCH_VALUE) }
    }

    /// A silence ends the received message.
    fn end(&mut self, now_ns: u64, outgoing: &mut Vec<u8>) {
        if self.parser.is_within() && now_ns >= self.received_ns + SILENCE_NS {
            let mut parser = std::mem::take(&mut self.parser);
            parser.end_request(|request| self.execute(request, outgoing));
            self.parser = parser;
        }
    }
}

impl Firmware for Serial {
    fn connected(&mut self, _now_ns: u64, _outgoing: &mut Vec<u8>) {
        self.parser.clear();
    }

    fn disconnected(&mut self) {}

    fn receive(&mut self, now_ns: u64, bytes: &[u8], outgoing: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        self.end(now_ns, outgoing);
        self.received_ns = now_ns;
        let mut parser = std::mem::take(&mut self.parser);
        parser.feed_requests(bytes, |request| self.execute(request, outgoing));
        self.parser = parser;
    }

    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant, outgoing: &mut Vec<u8>) {
        self.gripper.advance_to(now_ns, plant);
        self.end(now_ns, outgoing);
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
