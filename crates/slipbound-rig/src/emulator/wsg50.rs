//! A Weiss WSG-50 at its binary interface.

pub use super::weiss::Settings;

use super::fault::Fault;
use super::firmware::Firmware;
use super::jaws::EmulatedJaws;
use super::weiss::{End, Task, Weiss};
use crate::gripper::wsg50::frame::{self, Frame, Parser, number};
use crate::gripper::wsg50::words::{flag, id, status};
use slipbound::plant::Plant;

/// Flags of MOVE: the opening counts from where the fingers are; they stop, without pressing, where they are blocked.
const RELATIVE: u8 = 1;
const STOPS_ON_BLOCK: u8 = 1 << 1;

/// A state that it sends by itself.
#[derive(Debug, Clone)]
struct Update {
    id: u8,
    period_ns: u64,
    due_ns: u64,
    only_changes: bool,
    /// The state that was last sent.
    sent: Vec<u8>,
}

/// The firmware.
#[derive(Debug)]
pub struct Wsg50 {
    weiss: Weiss,
    parser: Parser,
    updates: Vec<Update>,
}

impl Default for Wsg50 {
    fn default() -> Self {
        Wsg50::new(Settings::default())
    }
}

impl Wsg50 {
    /// Wide open, with the largest force limit.
    pub fn new(settings: Settings) -> Self {
        Wsg50 { weiss: Weiss::new(settings), parser: Parser::default(), updates: Vec::new() }
    }

    fn send_ended(&mut self, outgoing: &mut Vec<u8>) {
        for (task, status) in self.weiss.take_ended() {
            let id = match task {
                Task::Home { .. } => id::HOME,
                Task::Move { .. } => id::MOVE,
                Task::Grasp { .. } => id::GRASP,
                Task::Release { .. } => id::RELEASE,
            };
            reply(outgoing, id, status, &[]);
        }
    }

    fn execute(&mut self, now_ns: u64, frame: &Frame, outgoing: &mut Vec<u8>) {
        let payload = frame.payload();
        match frame.id {
            id::DISCONNECT => self.weiss.bid_farewell(),
            id::ACKNOWLEDGE if payload == b"ack" => self.weiss.acknowledge(),
            id::STOP => self.weiss.stop(),
            id::FAST_STOP => self.weiss.stop_fast(),
            _ => {}
        }
        self.send_ended(outgoing);
        let status = match frame.id {
            id::DISCONNECT | id::STOP | id::FAST_STOP => status::OK,
            id::ACKNOWLEDGE if payload != b"ack" => status::FORMAT,
            id::ACKNOWLEDGE => status::OK,
            id::SET_LIMIT => match number(payload) {
                Some(limit_n) => self.weiss.set_limit(f64::from(limit_n)),
                None => status::TOO_SHORT,
            },
            id::GET_LIMIT => {
                let limit_n = self.weiss.limit_n as f32;
                return reply(outgoing, frame.id, status::OK, &limit_n.to_le_bytes());
            }
            id::SYSTEM_STATE | id::GRASP_STATE | id::OPENING | id::SPEED | id::FORCE => {
                self.subscribe(now_ns, frame.id, payload);
                return reply(outgoing, frame.id, status::OK, &self.state(frame.id));
            }
            id::HOME => match payload.first() {
                None | Some(0 | 1) => self.weiss.begin(Task::Home { closes: false }),
                Some(2) => self.weiss.begin(Task::Home { closes: true }),
                Some(_) => status::RANGE,
            },
            id::SET_ACCELERATION => match number(payload) {
                Some(acceleration) => self.weiss.set_acceleration(f64::from(acceleration)),
                None => status::TOO_SHORT,
            },
            id::GET_ACCELERATION => {
                let acceleration = self.weiss.acceleration as f32;
                return reply(outgoing, frame.id, status::OK, &acceleration.to_le_bytes());
            }
            id::TARE => self.weiss.tare(),
            id::MOVE | id::GRASP | id::RELEASE => match self.task(frame.id, payload) {
                Some(task) => self.weiss.begin(task),
                None => status::TOO_SHORT,
            },
            _ => status::UNKNOWN,
        };
        reply(outgoing, frame.id, status, &[]);
    }

    fn subscribe(&mut self, now_ns: u64, id: u8, payload: &[u8]) {
        let Some([flags, low, high]) = payload.first_chunk() else { return };
        self.updates.retain(|update| update.id != id);
        let period_ns = u64::from(u16::from_le_bytes([*low, *high]).max(1)) * 1_000_000;
        if flags & 1 != 0 {
            let (only_changes, sent) = (flags & 2 != 0, self.state(id));
            self.updates.push(Update { id, period_ns, due_ns: now_ns + period_ns, only_changes, sent });
        }
    }

    /// A state as it goes over the link.
    fn state(&self, id: u8) -> Vec<u8> {
        let weiss = &self.weiss;
        match id {
            id::SYSTEM_STATE => {
                let bits = [
                    (weiss.is_homed, flag::REFERENCED),
                    (weiss.running.is_some(), flag::MOVING),
                    (weiss.end == End::Blocked, flag::BLOCKED_MINUS),
                    (weiss.end == End::Stopped, flag::AXIS_STOPPED),
                    (weiss.end == End::Reached, flag::TARGET_POS_REACHED),
                    (weiss.is_stopped, flag::FAST_STOP),
                ];
                let bits = bits.iter().filter(|(is_set, _)| *is_set).fold(0, |all, (_, bit)| all | bit);
                bits.to_le_bytes().to_vec()
            }
            id::GRASP_STATE => vec![weiss.grasp],
            id::OPENING => bytes(weiss.jaws.opening_mm()),
            id::SPEED => bytes(weiss.jaws.velocity_mm_per_s()),
            _ => bytes(weiss.jaws.reading_n()),
        }
    }

    fn task(&self, id: u8, payload: &[u8]) -> Option<Task> {
        let (flags, numbers) = if id == id::MOVE { payload.split_first()? } else { (&0, payload) };
        let opening_mm = f64::from(number(numbers)?);
        let speed = f64::from(number(numbers.get(4..)?)?);
        let from_mm = if flags & RELATIVE != 0 { self.weiss.jaws.opening_mm() } else { 0.0 };
        Some(match id {
            id::MOVE => Task::Move { opening_mm: from_mm + opening_mm, speed, clamps: flags & STOPS_ON_BLOCK == 0 },
            id::GRASP => Task::Grasp { width_mm: Some(opening_mm), speed },
            _ => Task::Release { opening_mm, speed },
        })
    }
}

/// A number as it goes over the link.
fn bytes(number: f64) -> Vec<u8> {
    (number as f32).to_le_bytes().to_vec()
}

fn reply(outgoing: &mut Vec<u8>, id: u8, status: u16, rest: &[u8]) {
    let mut payload = status.to_le_bytes().to_vec();
    payload.extend(rest);
    frame::write(outgoing, id, &payload);
}

impl Firmware for Wsg50 {
    fn connected(&mut self, _now_ns: u64, _outgoing: &mut Vec<u8>) {
        self.parser.clear();
        self.updates.clear();
        self.weiss.connected();
    }

    fn disconnected(&mut self) {
        self.updates.clear();
        self.weiss.disconnected();
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8], outgoing: &mut Vec<u8>) {
        let mut parser = std::mem::take(&mut self.parser);
        parser.feed(bytes, |frame| self.execute(now_ns, &frame, outgoing));
        self.parser = parser;
    }

    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant, outgoing: &mut Vec<u8>) {
        self.weiss.advance_to(now_ns, plant);
        self.send_ended(outgoing);
        for i in 0..self.updates.len() {
            if now_ns < self.updates[i].due_ns {
                continue;
            }
            let state = self.state(self.updates[i].id);
            let update = &mut self.updates[i];
            update.due_ns = now_ns.max(update.due_ns + update.period_ns);
            if !update.only_changes || state != update.sent {
                reply(outgoing, update.id, status::OK, &state);
                update.sent = state;
            }
        }
    }

    fn inject(&mut self, fault: Fault, outgoing: &mut Vec<u8>) -> bool {
        let is_injected = self.weiss.inject(fault);
        self.send_ended(outgoing);
        is_injected
    }

    fn jaws(&self) -> &EmulatedJaws {
        &self.weiss.jaws
    }

    fn jaws_mut(&mut self) -> &mut EmulatedJaws {
        &mut self.weiss.jaws
    }
}
