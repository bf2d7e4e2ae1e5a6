//! A gripper and a wrist that answer the line protocol.

use super::fault::Fault;
use super::firmware::Firmware;
use super::jaws::EmulatedJaws;
use crate::gripper::line::{VERSION, number_of};
use crate::link::{Lines, write_line};
use slipbound::plant::{JawSettings, Plant, WristDrive};
use slipbound::port::{WristCommand, WristMotion, WristState};

/// Time between two lines of state, ns.
const STATE_NS: u64 = 20_000_000;

/// The firmware.
#[derive(Debug)]
pub struct Line {
    jaws: EmulatedJaws,
    wrist: WristDrive,
    lines: Lines,
    is_connected: bool,
    state_ns: u64,
    target_n: Option<f64>,
    has_held: bool,
    is_stopped: bool,
}

impl Default for Line {
    fn default() -> Self {
        Line::new(JawSettings::default())
    }
}

impl Line {
    /// Wide open, at rest.
    pub fn new(jaws: JawSettings) -> Self {
        Line {
            jaws: EmulatedJaws::new(jaws),
            wrist: WristDrive::new(),
            lines: Lines::default(),
            is_connected: false,
            state_ns: 0,
            target_n: None,
            has_held: false,
            is_stopped: false,
        }
    }

    /// Where the wrist is.
    pub fn wrist(&self) -> WristState {
        self.wrist.state()
    }

    fn execute(&mut self, line: Option<&str>, outgoing: &mut Vec<u8>) {
        let numbered = line.and_then(|line| line.split_once(' '));
        let Some((number, words)) = numbered.and_then(|(n, words)| Some((n.parse::<u64>().ok()?, words))) else {
            return write_line(outgoing, "ERR 0 expected NUMBER WORD key value ...");
        };
        match self.run(words) {
            Ok(()) => write_line(outgoing, &format!("ACK {number} {words}")),
            Err(why) => write_line(outgoing, &format!("ERR {number} {why}")),
        }
    }

    fn run(&mut self, words: &str) -> Result<(), String> {
        let (word, rest) = words.split_once(' ').unwrap_or((words, ""));
        let value = |key: &str| number_of(rest, key).ok_or_else(|| format!("{word} needs {key} and a number"));
        let (least_n, most_n) = (self.jaws.settings().least_n, self.jaws.settings().most_n);
        match word {
            "GRASP" | "RELEASE" | "HOME" if self.is_stopped => return Err("stopped; acknowledge first".into()),
            "GRASP" => {
                let force_n = value("force_n")?;
                if !(least_n..=most_n).contains(&force_n) || self.jaws.refuses_force() {
                    return Err(format!("force_n may be {least_n} to {most_n}"));
                }
                self.target_n = Some(force_n);
                self.jaws.grasp(force_n);
            }
            "RELEASE" => self.open(value("opening_mm")?),
            "HOME" => self.open(self.jaws.settings().stroke_mm),
            "ACKNOWLEDGE" => self.is_stopped = false,
            "TURN" | "LOWER" | "PAUSE" => {
                let command = self.motion(word, value)?;
                if !self.wrist.command(command) {
                    return Err("a bound is negative or a rate too high".into());
                }
            }
            "BYE" => {}
            _ => return Err(format!("unknown word {word}")),
        }
        Ok(())
    }

    fn motion(&self, word: &str, value: impl Fn(&str) -> Result<f64, String>) -> Result<WristCommand, String> {
        if word == "PAUSE" {
            return Ok(WristCommand::new(WristMotion::Pause));
        }
        let time_to_live_ms = value("time_to_live_ms")?;
        if !(0.0..=200.0).contains(&time_to_live_ms) {
            return Err("time_to_live_ms may be 0 to 200".into());
        }
        let motion = match word {
            "TURN" => WristMotion::Turn { rate_rad_per_s: value("rate_rad_per_s")?, most_rad: value("most_rad")? },
            _ => WristMotion::Lower { rate_mm_per_s: value("rate_mm_per_s")?, most_mm: value("most_mm")? },
        };
        Ok(WristCommand { motion, time_to_live_ns: (time_to_live_ms * 1e6) as u64 })
    }

    fn open(&mut self, opening_mm: f64) {
        (self.target_n, self.has_held) = (None, false);
        self.jaws.move_to(opening_mm);
    }

    fn send_state(&self, outgoing: &mut Vec<u8>) {
        let jaws = match self.target_n {
            _ if self.is_stopped => "stopped",
            None => "open",
            Some(_) if self.jaws.holds() || (self.has_held && self.jaws.touches()) => "holding",
            Some(_) if self.has_held => "lost",
            Some(_) if self.jaws.opening_mm() <= 0.0 => "nothing",
            Some(_) => "closing",
        };
        let target = self.target_n.map_or_else(String::new, |target_n| format!(" target_n {target_n:.3}"));
        let (force_n, opening_mm) = (self.jaws.reading_n(), self.jaws.opening_mm());
        write_line(outgoing, &format!("GRIPPER jaws {jaws} force_n {force_n:.3}{target} opening_mm {opening_mm:.3}"));
        let WristState { angle_rad, lowered_mm, moving, .. } = self.wrist.state();
        let moving = u8::from(moving);
        write_line(outgoing, &format!("WRIST angle_rad {angle_rad:.6} lowered_mm {lowered_mm:.4} moving {moving}"));
    }
}

impl Firmware for Line {
    fn connected(&mut self, now_ns: u64, outgoing: &mut Vec<u8>) {
        self.lines.clear();
        (self.is_connected, self.state_ns) = (true, now_ns);
        write_line(outgoing, &format!("HELLO slipbound-line {VERSION}"));
    }

    fn disconnected(&mut self) {
        self.is_connected = false;
        self.wrist.command(WristCommand::new(WristMotion::Pause));
    }

    fn receive(&mut self, _now_ns: u64, bytes: &[u8], outgoing: &mut Vec<u8>) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.execute(line, outgoing));
        self.lines = lines;
    }

    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant, outgoing: &mut Vec<u8>) {
        self.wrist.advance_to(now_ns);
        self.jaws.advance_to(now_ns, plant);
        self.has_held |= self.jaws.holds();
        let WristState { angle_rad, lowered_mm, .. } = self.wrist.state();
        plant.place_wrist(angle_rad, lowered_mm);
        if self.is_connected && now_ns >= self.state_ns {
            self.state_ns = now_ns + STATE_NS;
            self.send_state(outgoing);
        }
    }

    fn inject(&mut self, fault: Fault, _outgoing: &mut Vec<u8>) -> bool {
        match fault {
            Fault::FastStop => self.is_stopped = true,
            Fault::PowerCycle => {}
            _ => return false,
        }
        self.jaws.stay();
        self.wrist.command(WristCommand::new(WristMotion::Pause));
        true
    }

    fn jaws(&self) -> &EmulatedJaws {
        &self.jaws
    }

    fn jaws_mut(&mut self) -> &mut EmulatedJaws {
        &mut self.jaws
    }
}
