//! A Weiss WSG-50 at its text interface.

use super::fault::Fault;
use super::firmware::Firmware;
use super::jaws::EmulatedJaws;
use super::weiss::{Settings, Task, Weiss};
use crate::gripper::wsg50::words::status;
use crate::link::{Lines, write_line};
use slipbound::plant::Plant;

/// The firmware.
#[derive(Debug)]
pub struct Gcl {
    weiss: Weiss,
    lines: Lines,
}

impl Default for Gcl {
    fn default() -> Self {
        Gcl::new(Settings::default())
    }
}

impl Gcl {
    /// Wide open.
    pub fn new(settings: Settings) -> Self {
        Gcl { weiss: Weiss::new(settings), lines: Lines::default() }
    }

    fn send_ended(&mut self, outgoing: &mut Vec<u8>) {
        for (task, code) in self.weiss.take_ended() {
            let name = match task {
                Task::Home => "HOME",
                Task::Move { .. } => "MOVE",
                Task::Grasp { .. } => "GRIP",
                Task::Release { .. } => "RELEASE",
            };
            match code {
                status::OK => write_line(outgoing, &format!("FIN {name}")),
                code => write_line(outgoing, &format!("ERR {name} {code}")),
            }
        }
    }

    fn execute(&mut self, line: Option<&str>, outgoing: &mut Vec<u8>) {
        let Some(line) = line else { return write_line(outgoing, &format!("ERR {}", status::FORMAT)) };
        match line {
            "" => return,
            "POS?" => return write_line(outgoing, &format!("POS={:.2}", self.weiss.jaws.opening_mm())),
            "FORCE?" => return write_line(outgoing, &format!("FORCE={:.2}", self.weiss.jaws.force_n())),
            "GRIPSTATE?" => return write_line(outgoing, &format!("GRIPSTATE={}", self.weiss.grasp)),
            _ => {}
        }
        let Some((name, numbers)) = call(line) else {
            return write_line(outgoing, &format!("ERR {}", status::UNKNOWN));
        };
        let code = match (name, numbers.as_slice()) {
            ("BYE", []) => {
                self.weiss.bid_farewell();
                status::OK
            }
            ("STOP", []) => {
                self.weiss.stop();
                status::OK
            }
            ("FSACK", []) => {
                self.weiss.acknowledge();
                status::OK
            }
            ("HOME", [] | [_]) => self.weiss.begin(Task::Home),
            ("MOVE", [opening_mm, speed]) => self.weiss.begin(Task::Move { opening_mm: *opening_mm, speed: *speed }),
            ("GRIP", [force_n, rest @ ..]) if rest.len() <= 2 => self.grip(*force_n, rest),
            ("RELEASE", [distance_mm, speed]) => {
                let opening_mm = self.weiss.jaws.opening_mm() + distance_mm;
                self.weiss.begin(Task::Release { opening_mm, speed: *speed })
            }
            _ => status::FORMAT,
        };
        self.send_ended(outgoing);
        match code {
            status::OK | status::PENDING => write_line(outgoing, &format!("ACK {name}")),
            code => write_line(outgoing, &format!("ERR {name} {code}")),
        }
    }

    fn grip(&mut self, force_n: f64, rest: &[f64]) -> u16 {
        if self.weiss.refuses_grasp() {
            return status::DENIED; // before the new force could reach what is held
        }
        match self.weiss.set_limit(force_n) {
            status::OK => {
                let speed = rest.get(1).copied().unwrap_or(50.0);
                self.weiss.begin(Task::Grasp { width_mm: rest.first().copied(), speed })
            }
            code => code,
        }
    }
}

/// A name and its numbers out of `NAME(1,2)`.
fn call(line: &str) -> Option<(&str, Vec<f64>)> {
    let (name, numbers) = line.strip_suffix(')')?.split_once('(')?;
    let numbers = numbers.split(',').map(str::trim).filter(|number| !number.is_empty());
    let numbers: Result<Vec<f64>, _> = numbers.map(str::parse).collect();
    let is_known = ["HOME", "MOVE", "GRIP", "RELEASE", "STOP", "FSACK", "BYE"].contains(&name);
    Some((name, numbers.ok()?)).filter(|_| is_known)
}

impl Firmware for Gcl {
    fn connected(&mut self, _now_ns: u64, _outgoing: &mut Vec<u8>) {
        self.lines.clear();
        self.weiss.connected();
    }

    fn disconnected(&mut self) {
        self.weiss.disconnected();
    }

    fn receive(&mut self, _now_ns: u64, bytes: &[u8], outgoing: &mut Vec<u8>) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.execute(line, outgoing));
        self.lines = lines;
    }

    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant, outgoing: &mut Vec<u8>) {
        self.weiss.advance_to(now_ns, plant);
        self.send_ended(outgoing);
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
