//! A Weiss WSG-50 at its text interface.

use super::weiss::{Settings, Task, Weiss};
use super::{Emulator, Mishap};
use crate::gripper::text::Lines;
use crate::gripper::wsg50::words::status;
use slipbound::plant::Plant;

/// The emulator.
#[derive(Debug)]
pub struct Gcl {
    weiss: Weiss,
    lines: Lines,
    outgoing: Vec<u8>,
}

impl Default for Gcl {
    fn default() -> Self {
        Gcl::new(Settings::default())
    }
}

impl Gcl {
    /// Wide open.
    pub fn new(settings: Settings) -> Self {
        Gcl { weiss: Weiss::new(settings), lines: Lines::default(), outgoing: Vec::new() }
    }

    fn say(&mut self, line: &str) {
        self.outgoing.extend(line.as_bytes());
        self.outgoing.push(b'\n');
    }

    fn tell_ended(&mut self) {
        for (task, code) in std::mem::take(&mut self.weiss.ended) {
            let name = match task {
                Task::Home => "HOME",
                Task::Move { .. } => "MOVE",
                Task::Grasp { .. } => "GRIP",
                Task::Release { .. } => "RELEASE",
            };
            match code {
                status::OK => self.say(&format!("FIN {name}")),
                code => self.say(&format!("ERR {name} {code}")),
            }
        }
    }

    fn obey(&mut self, line: Option<&str>) {
        let Some(line) = line else { return self.say(&format!("ERR {}", status::FORMAT)) };
        match line {
            "" => return,
            "POS?" => return self.say(&format!("POS={:.2}", self.weiss.hand.opening_mm())),
            "FORCE?" => return self.say(&format!("FORCE={:.2}", self.weiss.hand.force_n())),
            "GRIPSTATE?" => return self.say(&format!("GRIPSTATE={}", self.weiss.grasp)),
            _ => {}
        }
        let Some((name, numbers)) = call(line) else { return self.say(&format!("ERR {}", status::UNKNOWN)) };
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
                let opening_mm = self.weiss.hand.opening_mm() + distance_mm;
                self.weiss.begin(Task::Release { opening_mm, speed: *speed })
            }
            _ => status::FORMAT,
        };
        self.tell_ended();
        match code {
            status::OK | status::PENDING => self.say(&format!("ACK {name}")),
            code => self.say(&format!("ERR {name} {code}")),
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

impl Emulator for Gcl {
    fn connected(&mut self, _now_ns: u64) {
        self.lines.clear();
        self.outgoing.clear();
        self.weiss.connected();
    }

    fn disconnected(&mut self, _now_ns: u64) {
        self.weiss.disconnected();
        self.weiss.ended.clear();
        self.outgoing.clear();
    }

    fn receive(&mut self, _now_ns: u64, bytes: &[u8]) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.obey(line));
        self.lines = lines;
    }

    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        self.weiss.advance_to(now_ns, plant);
        self.tell_ended();
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }

    fn befall(&mut self, _now_ns: u64, mishap: Mishap) -> bool {
        self.weiss.befall(mishap);
        self.tell_ended();
        true
    }

    fn force_n(&self) -> f64 {
        self.weiss.hand.force_n()
    }

    fn opening_mm(&self) -> f64 {
        self.weiss.hand.opening_mm()
    }
}
