//! A gripper and a wrist that answer the line protocol.

use super::hand::Hand;
use super::{Emulator, Mishap};
use crate::gripper::line::{VERSION, number_of};
use crate::gripper::text::Lines;
use slipbound::plant::{JawSettings, Plant, WristDrive};
use slipbound::port::{WristCommand, WristMotion, WristState};

/// Time between two lines of state, ns.
const STATE_NS: u64 = 20_000_000;

/// The emulator.
#[derive(Debug)]
pub struct Line {
    hand: Hand,
    wrist: WristDrive,
    lines: Lines,
    outgoing: Vec<u8>,
    is_connected: bool,
    state_ns: u64,
    target_n: Option<f64>,
    has_held: bool,
    is_stopped: bool,
    refuses_force: bool,
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
            hand: Hand::new(jaws),
            wrist: WristDrive::new(),
            lines: Lines::default(),
            outgoing: Vec::new(),
            is_connected: false,
            state_ns: 0,
            target_n: None,
            has_held: false,
            is_stopped: false,
            refuses_force: false,
        }
    }

    /// Where the wrist is.
    pub fn wrist(&self) -> WristState {
        self.wrist.state()
    }

    fn say(&mut self, line: &str) {
        self.outgoing.extend(line.as_bytes());
        self.outgoing.push(b'\n');
    }

    fn obey(&mut self, line: Option<&str>) {
        let numbered = line.and_then(|line| line.split_once(' '));
        let Some((number, words)) = numbered.and_then(|(n, words)| Some((n.parse::<u64>().ok()?, words))) else {
            return self.say("ERR 0 expected NUMBER WORD key value ...");
        };
        match self.act(words) {
            Ok(()) => self.say(&format!("ACK {number} {words}")),
            Err(why) => self.say(&format!("ERR {number} {why}")),
        }
    }

    fn act(&mut self, words: &str) -> Result<(), String> {
        let (word, rest) = words.split_once(' ').unwrap_or((words, ""));
        let value = |key: &str| number_of(rest, key).ok_or_else(|| format!("{word} needs {key} and a number"));
        let (least_n, most_n) = (self.hand.settings().least_n, self.hand.settings().most_n);
        match word {
            "GRASP" | "RELEASE" | "HOME" if self.is_stopped => return Err("stopped; acknowledge first".into()),
            "GRASP" => {
                let force_n = value("force_n")?;
                if !(least_n..=most_n).contains(&force_n) || self.refuses_force {
                    return Err(format!("force_n may be {least_n} to {most_n}"));
                }
                self.target_n = Some(force_n);
                self.hand.grasp(force_n);
            }
            "RELEASE" => self.open(value("opening_mm")?),
            "HOME" => self.open(self.hand.settings().stroke_mm),
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
        self.hand.move_to(opening_mm);
    }

    fn tell_state(&mut self) {
        let jaws = match self.target_n {
            _ if self.is_stopped => "stopped",
            None => "open",
            Some(_) if self.hand.holds() || (self.has_held && self.hand.touches()) => "holding",
            Some(_) if self.has_held => "lost",
            Some(_) if self.hand.opening_mm() <= 0.0 => "nothing",
            Some(_) => "closing",
        };
        let target = self.target_n.map_or_else(String::new, |target_n| format!(" target_n {target_n:.3}"));
        let (force_n, opening_mm) = (self.hand.force_n(), self.hand.opening_mm());
        self.say(&format!("GRIPPER jaws {jaws} force_n {force_n:.3}{target} opening_mm {opening_mm:.3}"));
        let WristState { angle_rad, lowered_mm, moving, .. } = self.wrist.state();
        let moving = u8::from(moving);
        self.say(&format!("WRIST angle_rad {angle_rad:.6} lowered_mm {lowered_mm:.4} moving {moving}"));
    }
}

impl Emulator for Line {
    fn connected(&mut self, now_ns: u64) {
        self.lines.clear();
        self.outgoing.clear();
        (self.is_connected, self.state_ns) = (true, now_ns);
        self.say(&format!("HELLO slipbound-line {VERSION}"));
    }

    fn disconnected(&mut self, _now_ns: u64) {
        self.is_connected = false;
        self.wrist.command(WristCommand::new(WristMotion::Pause));
        self.outgoing.clear();
    }

    fn receive(&mut self, _now_ns: u64, bytes: &[u8]) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.obey(line));
        self.lines = lines;
    }

    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        self.wrist.advance_to(now_ns);
        self.hand.advance_to(now_ns, plant);
        self.has_held |= self.hand.holds();
        let WristState { angle_rad, lowered_mm, .. } = self.wrist.state();
        plant.place_wrist(angle_rad, lowered_mm);
        if self.is_connected && now_ns >= self.state_ns {
            self.state_ns = now_ns + STATE_NS;
            self.tell_state();
        }
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }

    fn befall(&mut self, _now_ns: u64, mishap: Mishap) -> bool {
        match mishap {
            Mishap::FastStop => {
                self.is_stopped = true;
                self.hand.stay();
                self.wrist.command(WristCommand::new(WristMotion::Pause));
            }
            Mishap::RefuseForce => self.refuses_force = true,
            Mishap::LosePart => self.hand.lose_part(),
            Mishap::PowerCycle => {
                self.hand.stay();
                self.wrist.command(WristCommand::new(WristMotion::Pause));
            }
            Mishap::FixedLimit | Mishap::AllowRegrasp => return false,
        }
        true
    }

    fn force_n(&self) -> f64 {
        self.hand.force_n()
    }

    fn opening_mm(&self) -> f64 {
        self.hand.opening_mm()
    }
}
