//! How the jaws of a parallel gripper move and press: finite speed, a delay before a command takes effect, force that
//! follows its target with a first-order lag, in steps of the gripper's resolution. The time is an argument; the
//! simulator and every emulator use this model, so that both press alike.
//!
//! ```text
//!   opening  ____                            force            ______ target
//!                \  speed                            delay  .-'
//!                 \_____ width of the object        |-----|/  lag
//! ```

use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};

/// Parameters of a gripper's jaws. The default is a WSG-50 from the literature, not from our own measurements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JawSettings {
    /// Widest opening, mm.
    pub stroke_mm: f64,
    /// Speed of the jaws when they do not touch the object, mm/s.
    pub speed_mm_per_s: f64,
    /// Time until a command takes effect, ns.
    pub delay_ns: u64,
    /// Time constant with which the force follows its target, s.
    pub lag_s: f64,
    /// Step in which force can be set, N per finger.
    pub resolution_n: f64,
    /// Minimum force while holding, N per finger.
    pub least_n: f64,
    /// Maximum force, N per finger.
    pub most_n: f64,
}

impl Default for JawSettings {
    fn default() -> Self {
        JawSettings {
            stroke_mm: 110.0,
            speed_mm_per_s: 60.0,
            delay_ns: 25_000_000,
            lag_s: 0.08,
            resolution_n: 0.5,
            least_n: 5.0,
            most_n: 80.0,
        }
    }
}

impl JawSettings {
    /// Checks every setting; the error names the first invalid one.
    pub fn check(&self) -> Result<(), SettingError> {
        within("jaws.stroke_mm", self.stroke_mm, 1.0, 1000.0)?;
        within("jaws.speed_mm_per_s", self.speed_mm_per_s, 0.1, 1000.0)?;
        within("jaws.delay_ns", self.delay_ns as f64, 0.0, 1e9)?;
        within("jaws.lag_s", self.lag_s, 0.001, 10.0)?;
        within("jaws.resolution_n", self.resolution_n, 0.001, 20.0)?;
        within("jaws.least_n", self.least_n, 0.0, 1000.0)?;
        within("jaws.most_n", self.most_n, self.least_n, 1000.0)
    }
}

/// A command for the jaws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum JawCommand {
    /// Close, and hold the object with this force per finger.
    Grasp {
        /// Force per finger, N.
        force_n: f64,
    },
    /// Open to this opening.
    MoveTo {
        /// Opening, mm.
        opening_mm: f64,
    },
    /// Keep the opening, or the force if an object is held.
    Stay,
}

/// The state of moving jaws.
#[derive(Debug, Clone)]
pub struct JawDrive {
    settings: JawSettings,
    now_ns: u64,
    waiting: [Option<(u64, JawCommand)>; 8],
    running: JawCommand,
    opening_mm: f64,
    force_n: f64,
    touches: bool,
}

impl JawDrive {
    /// Wide open, at time 0.
    pub fn new(settings: JawSettings) -> Result<Self, SettingError> {
        settings.check()?;
        Ok(JawDrive {
            now_ns: 0,
            waiting: [None; 8],
            running: JawCommand::Stay,
            opening_mm: settings.stroke_mm,
            force_n: 0.0,
            touches: false,
            settings,
        })
    }

    /// The parameters of the jaws.
    pub fn settings(&self) -> &JawSettings {
        &self.settings
    }

    /// Accepts a command, which takes effect after the delay. The force is rounded to the gripper's resolution and
    /// limited to its range; a force that is not a number is ignored.
    pub fn command(&mut self, command: JawCommand) {
        let s = &self.settings;
        let command = match command {
            JawCommand::Grasp { force_n } if force_n.is_finite() => {
                let force_n = (force_n / s.resolution_n).round() * s.resolution_n;
                JawCommand::Grasp { force_n: force_n.clamp(s.least_n, s.most_n) }
            }
            JawCommand::MoveTo { opening_mm } if opening_mm.is_finite() => {
                JawCommand::MoveTo { opening_mm: opening_mm.clamp(0.0, s.stroke_mm) }
            }
            JawCommand::Stay => JawCommand::Stay,
            _ => return,
        };
        let due_ns = self.now_ns + s.delay_ns;
        // A full queue drops its oldest command: it would have been overtaken anyway.
        if self.waiting.iter().all(Option::is_some) {
            self.waiting.rotate_left(1);
            self.waiting[7] = None;
        }
        if let Some(slot) = self.waiting.iter_mut().find(|slot| slot.is_none()) {
            *slot = Some((due_ns, command));
        }
    }

    /// Advances the time to `now_ns`, with an object of this width in mm between the jaws (None: nothing).
    pub fn advance_to(&mut self, now_ns: u64, width_mm: Option<f64>) {
        while let Some((due_ns, command)) = self.waiting[0].filter(|(due_ns, _)| *due_ns <= now_ns) {
            self.run_to(due_ns, width_mm);
            self.running = command;
            self.waiting[0] = None;
            self.waiting.rotate_left(1);
        }
        self.run_to(now_ns, width_mm);
    }

    fn run_to(&mut self, now_ns: u64, width_mm: Option<f64>) {
        let elapsed_s = now_ns.saturating_sub(self.now_ns) as f64 * 1e-9;
        self.now_ns = self.now_ns.max(now_ns);
        let reach_mm = self.settings.speed_mm_per_s * elapsed_s;
        let stop_mm = width_mm.unwrap_or(0.0);
        self.touches &= width_mm.is_some();
        match self.running {
            JawCommand::Grasp { force_n } => {
                let before_mm = self.opening_mm;
                self.opening_mm = if self.touches { stop_mm } else { (before_mm - reach_mm).max(stop_mm) };
                self.touches = width_mm.is_some() && self.opening_mm <= stop_mm;
                // Force builds up only since the jaws touched.
                let pressed_s = if before_mm > stop_mm {
                    elapsed_s - (before_mm - stop_mm) / self.settings.speed_mm_per_s
                } else {
                    elapsed_s
                };
                let target_n = if self.touches { force_n } else { 0.0 };
                self.follow(target_n, pressed_s.max(0.0));
            }
            JawCommand::MoveTo { opening_mm } => {
                self.touches = false;
                self.force_n = 0.0;
                let step_mm = (opening_mm - self.opening_mm).clamp(-reach_mm, reach_mm);
                self.opening_mm = (self.opening_mm + step_mm).max(stop_mm);
            }
            JawCommand::Stay => {}
        }
        if !self.touches {
            self.force_n = 0.0;
        }
    }

    fn follow(&mut self, target_n: f64, elapsed_s: f64) {
        let left = libm::exp(-elapsed_s / self.settings.lag_s);
        self.force_n = target_n + (self.force_n - target_n) * left;
    }

    /// Normal force per finger, N.
    pub fn force_n(&self) -> f64 {
        self.force_n
    }

    /// Distance between the fingertips, mm.
    pub fn opening_mm(&self) -> f64 {
        self.opening_mm
    }

    /// Whether the fingertips touch the object.
    pub fn touches(&self) -> bool {
        self.touches
    }

    /// Target force per finger, N; None when the jaws do not grasp.
    pub fn target_n(&self) -> Option<f64> {
        match self.running {
            JawCommand::Grasp { force_n } => Some(force_n),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn jaws_close_with_finite_speed_then_press_with_a_lag_after_the_delay() {
        let mut jaws = JawDrive::new(JawSettings::default()).expect("valid");
        jaws.command(JawCommand::Grasp { force_n: 10.0 });
        jaws.advance_to(25 * MS, Some(50.0));
        assert_eq!((jaws.opening_mm(), jaws.force_n()), (110.0, 0.0), "nothing before the delay is over");
        jaws.advance_to(525 * MS, Some(50.0));
        assert!((jaws.opening_mm() - 80.0).abs() < 1e-9 && !jaws.touches(), "30 mm in half a second");
        jaws.advance_to(1025 * MS + 80 * MS, Some(50.0));
        assert!(jaws.touches());
        assert!((jaws.force_n() - 10.0 * (1.0 - (-1.0f64).exp())).abs() < 1e-6, "{}", jaws.force_n());
    }

    #[test]
    fn cut_into_steps_time_passes_alike() {
        let run = |step_ms: u64| {
            let mut jaws = JawDrive::new(JawSettings::default()).expect("valid");
            jaws.command(JawCommand::Grasp { force_n: 20.0 });
            for ms in (0..=1600).step_by(step_ms as usize) {
                jaws.advance_to(ms * MS, Some(50.0));
            }
            jaws.force_n()
        };
        assert!((run(1600) - run(4)).abs() < 1e-9);
    }

    #[test]
    fn a_force_that_is_no_number_or_out_of_range_never_lets_go() {
        let mut jaws = JawDrive::new(JawSettings::default()).expect("valid");
        jaws.command(JawCommand::Grasp { force_n: 20.0 });
        jaws.advance_to(3000 * MS, Some(50.0));
        jaws.command(JawCommand::Grasp { force_n: f64::NAN });
        jaws.advance_to(4000 * MS, Some(50.0));
        assert!((jaws.force_n() - 20.0).abs() < 1e-6);
        jaws.command(JawCommand::Grasp { force_n: -4.0 });
        jaws.advance_to(5000 * MS, Some(50.0));
        assert!((jaws.force_n() - 5.0).abs() < 1e-3, "the least force, not none");
        jaws.command(JawCommand::Grasp { force_n: 1e9 });
        jaws.advance_to(7000 * MS, Some(50.0));
        assert!((jaws.force_n() - 80.0).abs() < 1e-3);
    }

    #[test]
    fn without_the_object_jaws_close_at_their_speed_and_press_on_nothing() {
        let mut jaws = JawDrive::new(JawSettings::default()).expect("valid");
        jaws.command(JawCommand::Grasp { force_n: 20.0 });
        jaws.advance_to(3000 * MS, Some(50.0));
        let mut stopped = jaws.clone();
        jaws.advance_to(3100 * MS, None);
        assert!((jaws.opening_mm() - 44.0).abs() < 1e-9, "6 mm in 0.1 s: {} mm", jaws.opening_mm());
        assert_eq!((jaws.touches(), jaws.force_n()), (false, 0.0));
        stopped.command(JawCommand::Stay);
        stopped.advance_to(3100 * MS, Some(50.0));
        assert!(stopped.force_n() > 19.0, "held as it was");
        stopped.advance_to(3200 * MS, None);
        assert_eq!((stopped.opening_mm(), stopped.touches(), stopped.force_n()), (50.0, false, 0.0));
    }
}
