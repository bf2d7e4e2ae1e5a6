//! What a run shows on the terminal: cycles in, lines and a status out.

use crate::terminal::Terminal;
use slipbound::control::{Cycle, CycleObserver, CycleView};
use slipbound_rig::run::{CameraLimits, RunNotes};
use std::time::Duration;

/// Least change of the commanded force that is printed, N.
const SHOWN_STEP_N: f64 = 4.5;

/// Prints a line where something happened, the status otherwise.
pub struct Console {
    /// Where it prints.
    pub terminal: Terminal,
    notes: RunNotes,
    last: Option<Cycle>,
}

impl Console {
    /// On this terminal.
    pub fn new(terminal: Terminal) -> Self {
        Console { terminal, notes: RunNotes::default(), last: None }
    }

    /// The same with other limits for reports about cameras.
    pub fn limited(self, limits: CameraLimits) -> Self {
        Console { notes: RunNotes::new(limits), ..self }
    }

    /// The same on a terminal that is not waited for longer than this.
    pub fn with_timeout(self, longest: Duration) -> Self {
        Console { terminal: self.terminal.with_timeout(longest), ..self }
    }

    /// A note that no cycle shows.
    pub fn note(&mut self, now_ns: u64, text: &str) {
        self.say(&format!("{}  {text}", at(now_ns)));
    }

    fn say(&mut self, line: &str) {
        let _ = self.terminal.say(line); // a terminal that is gone does not end the run: everything is in the folder
    }

    fn show_cycle(&mut self, cycle: &Cycle) {
        let at = at(cycle.time_ns);
        let before = self.last.as_ref();
        let force_n = cycle.gripper.pressed_n().unwrap_or(0.0);
        let mut lines = Vec::new();
        if before.map_or(0, |last| last.slips_count) < cycle.slips_count {
            lines.push(format!("{at}  slip {} at {force_n:.1} N", cycle.slips_count));
        }
        let commanded_n = before.and_then(|last| last.grip_command.force_n()).zip(cycle.grip_command.force_n());
        if let Some((_, to_n)) = commanded_n.filter(|(from_n, to_n)| (from_n - to_n).abs() >= SHOWN_STEP_N) {
            lines.push(format!("{at}  grip to {to_n:.1} N"));
        }
        if let Some(ending) = cycle.ending()
            && before.is_none_or(|last| last.phase != cycle.phase)
        {
            lines.push(format!("{at}  {}", ending.evidence()));
        }
        lines.iter().for_each(|line| self.say(line));
        let bar = "#".repeat((force_n / 2.0).round().clamp(0.0, 40.0) as usize);
        let angle_deg = cycle.wrist.angle_rad.to_degrees();
        self.terminal.status(&format!("{at}  {angle_deg:6.1} deg  {force_n:5.1} N {bar}"));
        self.last = Some(*cycle);
    }
}

impl CycleObserver for Console {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        for line in self.notes.see(view) {
            self.note(view.now_ns, &line);
        }
        if let Some(cycle) = view.cycle() {
            self.show_cycle(&cycle);
        }
    }
}

fn at(now_ns: u64) -> String {
    format!("{:6.2} s", now_ns as f64 * 1e-9)
}
