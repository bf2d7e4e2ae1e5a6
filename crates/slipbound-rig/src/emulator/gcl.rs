//! A Weiss WSG-50 at its text interface.

use super::fault::Fault;
use super::firmware::Firmware;
use super::jaws::EmulatedJaws;
use super::weiss::{Settings, Task, Weiss};
use crate::gripper::wsg50::words::status;
use crate::link::{Lines, write_line};
use slipbound::plant::Plant;

/// Default speed, mm/s, and default travel of a release, mm.
const SPEED: f64 = 50.0;
const RELEASE_MM: f64 = 10.0;

/// A value that it sends by itself.
#[derive(Debug)]
struct Update {
    name: String,
    period_ns: u64,
    due_ns: u64,
}

/// The firmware.
#[derive(Debug)]
pub struct Gcl {
    weiss: Weiss,
    lines: Lines,
    updates: Vec<Update>,
    is_verbose: bool,
    /// The settings with which every new connection begins.
    configured: Settings,
}

impl Default for Gcl {
    fn default() -> Self {
        Gcl::new(Settings::default())
    }
}

impl Gcl {
    /// Wide open.
    pub fn new(settings: Settings) -> Self {
        let (weiss, lines) = (Weiss::new(settings), Lines::default());
        Gcl { weiss, lines, updates: Vec::new(), is_verbose: false, configured: settings }
    }

    fn send_ended(&mut self, outgoing: &mut Vec<u8>) {
        for (task, code) in self.weiss.take_ended() {
            let name = match task {
                Task::Home { .. } => "HOME",
                Task::Move { .. } => "MOVE",
                Task::Grasp { .. } => "GRIP",
                Task::Release { .. } => "RELEASE",
            };
            match code {
                status::OK => write_line(outgoing, &format!("FIN {name}")),
                code => write_line(outgoing, &self.refusal(name, code)),
            }
        }
    }

    fn execute(&mut self, now_ns: u64, line: Option<&str>, outgoing: &mut Vec<u8>) {
        let Some(line) = line else { return write_line(outgoing, &self.refusal("", status::FORMAT)) };
        if line.is_empty() {
            return;
        }
        if let Some(name) = line.strip_suffix('?') {
            let answer = self.value(name);
            return write_line(outgoing, &answer.unwrap_or_else(|| self.refusal("", status::UNKNOWN)));
        }
        if let Some((name, value)) = line.split_once('=') {
            let (name, value) = (name.trim(), value.trim().parse::<f64>().ok());
            let answer = match self.set(name, value) {
                status::OK => format!("{name}={}", value.unwrap_or(0.0)),
                code => self.refusal(name, code),
            };
            return write_line(outgoing, &answer);
        }
        let Some((name, words)) = call(line) else {
            return write_line(outgoing, &self.refusal("", status::UNKNOWN));
        };
        let code = match name {
            "AUTOSEND" => self.subscribe(now_ns, &words),
            name => match words.iter().map(|word| word.parse()).collect::<Result<Vec<f64>, _>>() {
                Ok(numbers) => self.command(name, &numbers),
                Err(_) => status::FORMAT,
            },
        };
        self.send_ended(outgoing);
        match code {
            status::OK | status::PENDING => write_line(outgoing, &format!("ACK {name}")),
            code => write_line(outgoing, &self.refusal(name, code)),
        }
    }

    /// Runs a command by its name. Omitted values are those set in the gripper.
    fn command(&mut self, name: &str, numbers: &[f64]) -> u16 {
        let speed_or = |speed: Option<&f64>| speed.copied().unwrap_or(SPEED);
        match (name, numbers) {
            ("BYE", []) => self.weiss.bid_farewell(),
            ("STOP", []) => self.weiss.stop(),
            ("FSACK", []) => self.weiss.acknowledge(),
            ("FSTOP" | "FASTSTOP", []) => self.weiss.stop_fast(),
            ("HOME", []) => return self.weiss.begin(Task::Home { closes: false }),
            ("HOME", [direction]) => return self.weiss.begin(Task::Home { closes: *direction <= 0.0 }),
            ("MOVE", [opening_mm, rest @ ..]) if rest.len() <= 1 => {
                let speed = speed_or(rest.first());
                return self.weiss.begin(Task::Move { opening_mm: *opening_mm, speed, clamps: false });
            }
            ("GRIP", rest) if rest.len() <= 3 => {
                let force_n = rest.first().copied().unwrap_or(self.weiss.limit_n);
                return self.grip(force_n, rest.get(1..).unwrap_or_default());
            }
            ("RELEASE", rest) if rest.len() <= 2 => {
                let distance_mm = rest.first().copied().unwrap_or(RELEASE_MM);
                let opening_mm = self.weiss.jaws.opening_mm() + distance_mm;
                let opening_mm =
                    if rest.is_empty() { opening_mm.min(self.weiss.settings.jaws.stroke_mm) } else { opening_mm };
                return self.weiss.begin(Task::Release { opening_mm, speed: speed_or(rest.get(1)) });
            }
            _ => return status::FORMAT,
        }
        status::OK
    }

    /// The answer to a question; None for an unknown one.
    fn value(&self, name: &str) -> Option<String> {
        let weiss = &self.weiss;
        Some(match name {
            "POS" => format!("POS={:.2}", weiss.jaws.opening_mm()),
            "FORCE" => format!("FORCE={:.2}", weiss.jaws.reading_n()),
            "GRIPSTATE" => format!("GRIPSTATE={}", weiss.grasp),
            "SPEED" => format!("SPEED={:.2}", weiss.jaws.velocity_mm_per_s()),
            "PWT" => format!("PWT={:.2}", weiss.settings.part_width_tolerance_mm),
            "CLT" => format!("CLT={:.2}", weiss.settings.clamping_travel_mm),
            "VERBOSE" => format!("VERBOSE={}", u8::from(self.is_verbose)),
            _ => return None,
        })
    }

    /// Sets one of its settings.
    fn set(&mut self, name: &str, value: Option<f64>) -> u16 {
        let settings = &mut self.weiss.settings;
        match (name, value) {
            (_, None) => return status::FORMAT,
            ("VERBOSE", Some(value)) => self.is_verbose = value != 0.0,
            ("PWT", Some(mm)) if (0.0..=100.0).contains(&mm) => settings.part_width_tolerance_mm = mm,
            ("CLT", Some(mm)) if (0.0..=100.0).contains(&mm) => settings.clamping_travel_mm = mm,
            ("PWT" | "CLT", Some(_)) => return status::RANGE,
            _ => return status::UNKNOWN,
        }
        status::OK
    }

    /// `AUTOSEND("POS", 100)` sends a value every 100 ms, marked by `@`; `AUTOSEND("POS", 0)` stops that. Further words
    /// are ignored.
    fn subscribe(&mut self, now_ns: u64, words: &[&str]) -> u16 {
        let [name, period_ms, ..] = words else { return status::FORMAT };
        let name = name.trim_matches('"');
        let Ok(period_ms) = period_ms.parse::<u64>() else { return status::FORMAT };
        if self.value(name).is_none() || period_ms > 60_000 {
            return status::RANGE;
        }
        self.updates.retain(|update| update.name != name);
        if period_ms > 0 {
            let period_ns = period_ms.max(10) * 1_000_000;
            self.updates.push(Update { name: name.into(), period_ns, due_ns: now_ns + period_ns });
        }
        status::OK
    }

    /// A refusal: the status as a number or, in verbose mode, by its name.
    fn refusal(&self, name: &str, code: u16) -> String {
        let code = match self.is_verbose {
            true => status::name(code).map_or(code.to_string(), |name| format!("E_{name}")),
            false => code.to_string(),
        };
        match name {
            "" => format!("ERR {code}"),
            name => format!("ERR {name} {code}"),
        }
    }

    fn grip(&mut self, force_n: f64, rest: &[f64]) -> u16 {
        let speed = rest.get(1).copied().unwrap_or(SPEED);
        let task = Task::Grasp { width_mm: rest.first().copied(), speed };
        // A refused grip leaves the force as it is.
        match self.weiss.refusal(task) {
            status::OK => match self.weiss.set_limit(force_n) {
                status::OK => self.weiss.begin(task),
                refused => refused,
            },
            refused => refused,
        }
    }
}

/// Splits `NAME(1,2)` into the name and what is in the brackets.
fn call(line: &str) -> Option<(&str, Vec<&str>)> {
    let (name, words) = line.strip_suffix(')')?.split_once('(')?;
    let known = ["HOME", "MOVE", "GRIP", "RELEASE", "STOP", "FSACK", "FSTOP", "FASTSTOP", "BYE", "AUTOSEND"];
    // An empty word between commas is one that is no number.
    let words = if words.trim().is_empty() { Vec::new() } else { words.split(',').map(str::trim).collect() };
    known.contains(&name).then_some((name, words))
}

impl Firmware for Gcl {
    fn connected(&mut self, _now_ns: u64, _outgoing: &mut Vec<u8>) {
        self.lines.clear();
        self.updates.clear();
        self.is_verbose = false;
        self.weiss.settings = self.configured;
        self.weiss.connected();
    }

    fn disconnected(&mut self) {
        self.weiss.disconnected();
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8], outgoing: &mut Vec<u8>) {
        let mut lines = std::mem::take(&mut self.lines);
        lines.feed(bytes, |line| self.execute(now_ns, line, outgoing));
        self.lines = lines;
    }

    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant, outgoing: &mut Vec<u8>) {
        self.weiss.advance_to(now_ns, plant);
        self.send_ended(outgoing);
        for i in 0..self.updates.len() {
            let update = &mut self.updates[i];
            if now_ns >= update.due_ns {
                update.due_ns = now_ns.max(update.due_ns + update.period_ns);
                let name = update.name.clone();
                self.value(&name).iter().for_each(|value| write_line(outgoing, &format!("@{value}")));
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
