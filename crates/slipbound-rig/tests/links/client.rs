//! A client that sends any bytes to an emulator, as third-party clients do.

use crate::bench::MS;
use slipbound::plant::Plant;
use slipbound_rig::emulator::{Block, Emulator, by_name};
use slipbound_rig::gripper::wsg50::frame;

/// An emulator with a block of 50 mm between its jaws, and a client that sends any bytes.
pub struct Client {
    pub emulator: Emulator,
    pub block: Block,
    pub now_ns: u64,
}

impl Client {
    pub fn of(name: &str) -> Self {
        let (mut emulator, mut block) = (by_name(name).expect("a name"), Block::new(50.0));
        emulator.tick(0, &mut block);
        emulator.connected(0);
        Client { emulator, block, now_ns: 0 }
    }

    /// Sends these bytes, advances the time by `ms`, and returns the answer.
    pub fn say(&mut self, bytes: &[u8], ms: u64) -> Vec<u8> {
        self.emulator.receive(self.now_ns, bytes);
        for _ in 0..ms {
            self.now_ns += MS;
            self.emulator.tick(self.now_ns, &mut self.block);
            self.block.advance_to(self.now_ns);
        }
        std::mem::take(self.emulator.outgoing())
    }

    pub fn line(&mut self, text: &str, ms: u64) -> String {
        String::from_utf8(self.say(format!("{text}\n").as_bytes(), ms)).expect("ASCII")
    }

    /// Sends a frame; returns the status and the rest of every answer.
    pub fn frame(&mut self, id: u8, payload: &[u8], ms: u64) -> Vec<(u8, u16, Vec<u8>)> {
        let mut bytes = Vec::new();
        frame::write(&mut bytes, id, payload);
        let answered = self.say(&bytes, ms);
        let mut answers = Vec::new();
        frame::Parser::default().feed(&answered, |frame| {
            let (status, rest) = frame.reply().expect("a status");
            answers.push((frame.id, status, rest.to_vec()));
        });
        answers
    }
}

/// Bytes, and numbers behind them.
pub fn numbers(first: &[u8], numbers: &[f32]) -> Vec<u8> {
    [first, &numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>()].concat()
}

/// A Modbus message of these bytes.
pub fn modbus(hex: &str) -> Vec<u8> {
    let mut bytes: Vec<u8> = hex.split(' ').map(|byte| u8::from_str_radix(byte, 16).expect("a byte")).collect();
    bytes.extend(crc::Crc::<u16>::new(&crc::CRC_16_MODBUS).checksum(&bytes).to_le_bytes());
    bytes
}
