//! A [`JawDrive`] with a speed for each command. The drive itself has one speed, so its time runs faster or slower
//! while the jaws move, and at the true rate while they press.
//!
//! ```text
//!   opening ____                       time of the drive           .
//!               \  asked speed                             .  '   on the object: 1 ns a ns
//!                \____ object                          /  on the way: asked speed over the drive's, ns a ns
//! ```

use slipbound::plant::{JawCommand, JawDrive, JawSettings};
use std::collections::VecDeque;

/// Jaws in motion.
#[derive(Debug, Clone)]
pub(super) struct PacedDrive {
    /// Without a delay: the delay is applied here, in true time.
    drive: JawDrive,
    settings: JawSettings,
    /// When they take effect, ns; the command; its speed, mm/s.
    waiting: VecDeque<(u64, JawCommand, f64)>,
    running: JawCommand,
    speed_mm_per_s: f64,
    now_ns: u64,
    /// Time of the drive, ns; not rounded, because many short steps would lose some of it.
    drive_ns: f64,
}

impl PacedDrive {
    /// Wide open, at time 0. Settings out of range give the default's.
    pub fn new(settings: JawSettings) -> Self {
        let settings = if settings.check().is_ok() { settings } else { JawSettings::default() };
        let drive = JawDrive::new(JawSettings { delay_ns: 0, ..settings });
        PacedDrive {
            drive: drive.unwrap_or_else(|_| unreachable!("the settings were checked")),
            settings,
            waiting: VecDeque::new(),
            running: JawCommand::Stay,
            speed_mm_per_s: settings.speed_mm_per_s,
            now_ns: 0,
            drive_ns: 0.0,
        }
    }

    /// The settings of the jaws; the speed is the drive's own.
    pub fn settings(&self) -> &JawSettings {
        &self.settings
    }

    /// Takes a command with the speed off the object, mm/s; it takes effect after the delay.
    pub fn command(&mut self, command: JawCommand, speed_mm_per_s: f64) {
        self.waiting.push_back((self.now_ns + self.settings.delay_ns, command, speed_mm_per_s));
    }

    /// Advances the time to `now_ns`, with an object of this width between the jaws (None: nothing).
    pub fn advance_to(&mut self, now_ns: u64, width_mm: Option<f64>) {
        while let Some((due_ns, command, speed_mm_per_s)) = self.waiting.pop_front() {
            if due_ns > now_ns {
                self.waiting.push_front((due_ns, command, speed_mm_per_s));
                break;
            }
            self.run_to(due_ns, width_mm);
            (self.running, self.speed_mm_per_s) = (command, speed_mm_per_s);
            self.drive.command(command);
            self.drive.advance_to(self.drive_ns.round() as u64, width_mm);
        }
        self.run_to(now_ns, width_mm);
    }

    fn run_to(&mut self, now_ns: u64, width_mm: Option<f64>) {
        let left_ns = now_ns.saturating_sub(self.now_ns);
        self.now_ns = self.now_ns.max(now_ns);
        let way_mm = match self.running {
            JawCommand::MoveTo { .. } => f64::INFINITY,
            JawCommand::Grasp { .. } if self.drive.touches() => 0.0,
            JawCommand::Grasp { .. } => width_mm.map_or(f64::INFINITY, |mm| (self.opening_mm() - mm).max(0.0)),
            JawCommand::Stay => 0.0,
        };
        let way_ns = (way_mm / self.speed_mm_per_s * 1e9).min(left_ns as f64);
        let pace = self.speed_mm_per_s / self.settings.speed_mm_per_s;
        self.drive_ns += way_ns * pace + (left_ns as f64 - way_ns);
        self.drive.advance_to(self.drive_ns.round() as u64, width_mm);
    }

    /// Normal force per finger, N.
    pub fn force_n(&self) -> f64 {
        self.drive.force_n()
    }

    /// Distance between the fingertips, mm.
    pub fn opening_mm(&self) -> f64 {
        self.drive.opening_mm()
    }

    /// Whether the fingertips touch the object.
    pub fn touches(&self) -> bool {
        self.drive.touches()
    }

    /// The target force per finger, N; None when they do not grasp.
    pub fn target_n(&self) -> Option<f64> {
        self.drive.target_n()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn every_command_has_its_speed_and_the_force_the_lag_it_has_anyway() {
        for (speed_mm_per_s, step_ms) in [(20.0, 1), (20.0, 7), (60.0, 2), (240.0, 1), (240.0, 40)] {
            let mut jaws = PacedDrive::new(JawSettings::default());
            jaws.command(JawCommand::Grasp { force_n: 10.0 }, speed_mm_per_s);
            let contact_ns = 25 * MS + (60.0 / speed_mm_per_s * 1e9) as u64;
            let run = |jaws: &mut PacedDrive, to_ns: u64| {
                while jaws.now_ns < to_ns {
                    jaws.advance_to((jaws.now_ns + step_ms * MS).min(to_ns), Some(50.0));
                }
            };
            run(&mut jaws, contact_ns - 100 * MS);
            assert!((jaws.opening_mm() - 50.0 - 0.1 * speed_mm_per_s).abs() < 1e-4, "{}", jaws.opening_mm());
            run(&mut jaws, contact_ns + 80 * MS);
            assert!(jaws.touches());
            assert!((jaws.force_n() - 10.0 * (1.0 - (-1.0f64).exp())).abs() < 1e-5, "{}", jaws.force_n());
        }
    }
}
