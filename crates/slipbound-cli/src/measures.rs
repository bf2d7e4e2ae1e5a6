//! What a simulated run is measured by, from the truth.

use crate::closed_loop::Turn;
use slipbound::task::{Ending, Phase, TaskKind};
use slipbound_lab::hand::HandTruth;
use slipbound_rig::run::Truth;

/// Least force of the gripper, N per finger: what a perfect controller would still press with.
const FLOOR_N: f64 = 5.0;

/// Radius of the cap, mm, and the force per finger, N, for the torque that counts as all there is.
const CAP_RADIUS_MM: f64 = 14.0;
const FULL_GRIP_N: f64 = 60.0;

/// Most force on the ground while a tool is put down: this many times its weight, or this force, N.
const GROUND_WEIGHTS: f64 = 1.5;
const GROUND_N: f64 = 3.0;

/// Furthest fall when it is let go, mm.
const DROP_MM: f64 = 1.0;

/// Whether a task did what it is for: ended as it should, and a bottle did not slide, a tool was put down softly.
pub fn succeeded(kind: TaskKind, run: &Measures) -> bool {
    match kind {
        TaskKind::Screw => matches!(run.ending, Some(Ending::Tight | Ending::SlipAtMost)),
        TaskKind::Unscrew => run.ending == Some(Ending::Opened),
        TaskKind::Place => {
            let softly = run.last.ground.as_ref().is_some_and(|ground| {
                ground.peak_force_n <= most_ground_n(ground.weight_n)
                    && ground.free_drop_mm.is_some_and(|mm| mm <= DROP_MM)
            });
            run.ending == Some(Ending::Placed) && softly
        }
        TaskKind::Lift => run.ending == Some(Ending::Held) && run.last.gross_steps_count == 0,
    }
}

/// Most force on the ground while a tool of this weight is put down, N.
pub fn most_ground_n(weight_n: f64) -> f64 {
    (GROUND_WEIGHTS * weight_n).max(GROUND_N)
}

/// The truth of a moment, as the run folder keeps it.
pub fn truth_of(truth: &HandTruth) -> Truth {
    let used_fraction = (truth.grip_force_n > 0.0).then(|| truth.required_n / truth.grip_force_n);
    Truth {
        cap_angle_rad: truth.cap.as_ref().map(|cap| cap.angle_rad),
        torque_n_mm: truth.cap.as_ref().map(|cap| cap.torque_n_mm.abs()),
        torque_limit_n_mm: truth.cap.as_ref().map(|cap| cap.limit_n_mm.abs()),
        load_n: truth.bottle.as_ref().map(|bottle| bottle.load_n),
        required_n: Some(truth.required_n),
        margin: used_fraction.map(|used| (1.0 - used).max(-1.0)),
        stick_ratio: truth.stick_ratio,
        slid_mm: Some(truth.slid_mm),
        gross: truth.gross,
        ground_force_n: truth.ground.as_ref().map(|ground| ground.force_n),
        mass_kg: truth.bottle.as_ref().map(|bottle| bottle.mass_kg),
    }
}

/// Adds up over a run.
#[derive(Debug, Clone, Default)]
pub struct Measures {
    /// How the task ended; None when the scene was over before.
    pub ending: Option<Ending>,
    /// When, s.
    pub ended_s: Option<f64>,
    /// Time of the last turn, s.
    pub time_s: f64,
    /// Incipient slips the controller answered or would have.
    pub alarms_count: u32,
    /// Largest commanded force, N per finger.
    pub most_n: f64,
    /// Least force while something was held, N per finger.
    pub least_held_n: Option<f64>,
    /// The truth at the end.
    pub last: HandTruth,
    /// Largest torque on a cap, N mm.
    pub torque_n_mm: f64,
    /// Largest margin error and the like are for later; these are sums for the over-squeeze.
    pressed_sum_n: f64,
    needed_sum_n: f64,
    first_alarm_ratio: Option<f64>,
}

impl Measures {
    /// Takes the next turn, and what was true then where that is known.
    pub fn see(&mut self, now_ns: u64, turn: &Turn, alarms_count: u32, truth: Option<&HandTruth>) {
        self.time_s = now_ns as f64 * 1e-9;
        self.most_n = self.most_n.max(turn.step.grip.force_n);
        if let (Phase::Ended(ending), None) = (turn.step.phase, self.ending) {
            self.ending = Some(ending);
            self.ended_s = Some(self.time_s);
        }
        let is_alarm = alarms_count > self.alarms_count;
        self.alarms_count = alarms_count;
        let Some(truth) = truth else { return };
        if is_alarm && self.first_alarm_ratio.is_none() && truth.grip_force_n > 0.0 {
            self.first_alarm_ratio = Some(truth.required_n / truth.grip_force_n);
        }
        if matches!(turn.step.phase, Phase::Working | Phase::Waiting | Phase::Ended(_)) {
            self.least_held_n.get_or_insert(truth.grip_force_n);
        }
        self.watch(truth);
        if truth.required_n > FLOOR_N {
            self.pressed_sum_n += truth.grip_force_n;
            self.needed_sum_n += truth.required_n;
        }
        if let Some(cap) = &truth.cap {
            self.torque_n_mm = self.torque_n_mm.max(cap.torque_n_mm.abs());
        }
    }

    /// Takes what is true at a moment without a turn.
    pub fn watch(&mut self, truth: &HandTruth) {
        if let Some(least_n) = &mut self.least_held_n {
            *least_n = least_n.min(truth.grip_force_n);
        }
        self.last = truth.clone();
    }

    /// Mean force over mean needed force, while more than the gripper's least was needed; None when it never was.
    pub fn over_squeeze_ratio(&self) -> Option<f64> {
        (self.needed_sum_n > 0.0).then(|| self.pressed_sum_n / self.needed_sum_n)
    }

    /// Largest torque on a cap over 2 mu 60 N R; None where there is no cap.
    pub fn torque_fraction(&self, mu: f64) -> Option<f64> {
        self.last.cap.as_ref()?;
        Some(self.torque_n_mm / (2.0 * mu * FULL_GRIP_N * CAP_RADIUS_MM))
    }

    /// Share of the friction that was used at the first alarm; None without one.
    pub fn first_alarm_ratio(&self) -> Option<f64> {
        self.first_alarm_ratio
    }
}
