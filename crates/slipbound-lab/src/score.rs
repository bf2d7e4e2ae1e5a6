//! The score of a simulated run, from the ground truth: whether the task reached its goal, and with how much force.
//!
//! ```text
//!   every cycle: time, phase, commanded force, alarms, HandTruth --> RunScore --> succeeded, over-squeeze, ...
//! ```

use crate::hand::HandTruth;
use slipbound::control::Cycle;
use slipbound::task::{Ending, Phase, TaskKind};

/// Least force of the gripper, N per finger: even a perfect controller cannot press with less.
const LEAST_GRIP_N: f64 = 5.0;

/// A cap counts as tight at this share of the torque that friction transmits at the controller's largest force: the
/// goal of the task.
const TIGHT_FRACTION: f64 = 0.9;

/// Turn after which a cap counts as broken loose, rad: 2 deg, within which it loses most of its torque.
const OPEN_RAD: f64 = 2.0 * std::f64::consts::PI / 180.0;

/// Limit of the force on the ground while a tool is put down: this many times its weight, or this force, N.
const GROUND_WEIGHTS: f64 = 1.5;
const GROUND_N: f64 = 3.0;

/// Largest permitted fall of a released tool, mm.
const DROP_MM: f64 = 1.0;

/// Limit of the force on the ground while a tool of this weight is put down, N.
pub fn most_ground_n(weight_n: f64) -> f64 {
    (GROUND_WEIGHTS * weight_n).max(GROUND_N)
}

/// Sums and extremes over a run.
#[derive(Debug, Clone)]
pub struct RunScore {
    /// The controller's largest force, N per finger.
    limit_n: f64,
    /// How the task ended; None if the scene ended first.
    pub ending: Option<Ending>,
    /// When, s.
    pub ended_s: Option<f64>,
    /// Time of the last cycle, s.
    pub time_s: f64,
    /// Incipient slips that the controller answered, or would have answered had it not been at its limit.
    pub alarms_count: u32,
    /// Largest commanded force, N per finger.
    pub most_n: f64,
    /// Least force from the end of grasping until the object was released, N per finger; None if the task never got
    /// that far.
    pub least_held_n: Option<f64>,
    /// The truth at the end.
    pub last: HandTruth,
    /// How far the object slid through the fingers before it was released, mm.
    pub slid_mm: f64,
    /// Largest torque on a cap, N mm.
    pub torque_n_mm: f64,
    /// Largest torque on a cap that friction can transmit at that force, N mm; None until a cap has been gripped.
    full_torque_n_mm: Option<f64>,
    /// Sums over the cycles that required more than the gripper's least force.
    pressed_sum_n: f64,
    required_sum_n: f64,
    first_alarm_used_fraction: Option<f64>,
    let_go: bool,
}

impl RunScore {
    /// Before the first cycle. `limit_n`: the controller's largest force, N per finger
    /// ([`GripLimits::most_n`](slipbound::grip::GripLimits)).
    pub fn new(limit_n: f64) -> Self {
        RunScore {
            limit_n,
            ending: None,
            ended_s: None,
            time_s: 0.0,
            alarms_count: 0,
            most_n: 0.0,
            least_held_n: None,
            last: HandTruth::default(),
            slid_mm: 0.0,
            torque_n_mm: 0.0,
            full_torque_n_mm: None,
            pressed_sum_n: 0.0,
            required_sum_n: 0.0,
            first_alarm_used_fraction: None,
            let_go: false,
        }
    }

    /// Adds a cycle, with the ground truth at its time, if known. An ending counts as [`Cycle::ending`] tells it.
    pub fn add_cycle(&mut self, cycle: &Cycle, truth: Option<&HandTruth>) {
        let (commanded_n, alarms_count) = (cycle.grip_command.force_n(), cycle.alarms_count);
        self.time_s = cycle.time_ns as f64 * 1e-9;
        self.most_n = self.most_n.max(commanded_n.unwrap_or(0.0));
        if let (Some(ending), None) = (cycle.ending(), self.ending) {
            self.ending = Some(ending);
            self.ended_s = Some(self.time_s);
        }
        let is_alarm = alarms_count > self.alarms_count;
        self.alarms_count = alarms_count;
        let Some(truth) = truth else { return };
        if is_alarm && self.first_alarm_used_fraction.is_none() && truth.grip_force_n > 0.0 {
            self.first_alarm_used_fraction = Some(truth.required_n / truth.grip_force_n);
        }
        self.let_go = commanded_n.is_none();
        if !self.let_go && matches!(cycle.phase, Phase::Working | Phase::Waiting | Phase::Ended(_)) {
            self.least_held_n.get_or_insert(truth.grip_force_n);
        }
        self.add_truth(truth);
        if truth.required_n > LEAST_GRIP_N {
            self.pressed_sum_n += truth.grip_force_n;
            self.required_sum_n += truth.required_n;
        }
        if let Some(cap) = &truth.cap {
            self.torque_n_mm = self.torque_n_mm.max(cap.torque_n_mm.abs());
            if truth.grip_force_n > LEAST_GRIP_N {
                self.full_torque_n_mm = Some(cap.limit_n_mm * self.limit_n / truth.grip_force_n);
            }
        }
    }

    /// Adds the ground truth of a time without commands: the loop waits, or has been left.
    pub fn add_truth(&mut self, truth: &HandTruth) {
        if !self.let_go {
            if let Some(least_n) = &mut self.least_held_n {
                *least_n = least_n.min(truth.grip_force_n);
            }
            self.slid_mm = truth.slid_mm;
        }
        self.last.clone_from(truth);
    }

    /// Whether the task reached its goal: it ended as it should, and according to the ground truth, if known, a cap is
    /// tight or has broken loose, a bottle did not slide, a tool was put down softly.
    pub fn succeeded(&self, kind: TaskKind) -> bool {
        match kind {
            TaskKind::Screw => match self.ending {
                Some(Ending::Tight) => self.torque_fraction().is_none_or(|fraction| fraction >= TIGHT_FRACTION),
                // With the paper's control law half of the torque may be unused at this point.
                Some(Ending::SlipAtMost) => true,
                _ => false,
            },
            TaskKind::Unscrew => {
                self.ending == Some(Ending::Opened) && self.last.cap.is_none_or(|cap| cap.angle_rad > OPEN_RAD)
            }
            TaskKind::Place => {
                let softly = self.last.ground.as_ref().is_some_and(|ground| {
                    ground.peak_force_n <= most_ground_n(ground.weight_n)
                        && ground.free_drop_mm.is_some_and(|mm| mm <= DROP_MM)
                });
                self.ending == Some(Ending::Placed) && softly
            }
            TaskKind::Lift => self.ending == Some(Ending::Held) && self.last.gross_steps_count == 0,
        }
    }

    /// Whether the object was lost, according to the gripper or the ground truth: it slid out of the fingers or fell.
    pub fn is_object_lost(&self) -> bool {
        let bottle = self.last.bottle.is_some_and(|bottle| bottle.dropped);
        let tool = self.last.ground.is_some_and(|ground| ground.dropped);
        self.ending == Some(Ending::Lost) || bottle || tool
    }

    /// Mean force over mean required force, over the cycles that required more than the gripper's least; None without
    /// these.
    pub fn over_squeeze_ratio(&self) -> Option<f64> {
        (self.required_sum_n > 0.0).then(|| self.pressed_sum_n / self.required_sum_n)
    }

    /// Largest torque on a cap over what friction transmits at the controller's largest force, 2 mu P R; None where no
    /// cap was gripped.
    pub fn torque_fraction(&self) -> Option<f64> {
        self.full_torque_n_mm.map(|full_n_mm| self.torque_n_mm / full_n_mm)
    }

    /// Share of the friction that was used at the first alarm; None without an alarm.
    pub fn first_alarm_used_fraction(&self) -> Option<f64> {
        self.first_alarm_used_fraction
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plants::{BottleTruth, CapTruth, GroundTruth};
    use slipbound::hand::{Hand, Mounting, Side};
    use slipbound::port::{GripCommand, GripperState, Jaws, WristCommand, WristMotion, WristState};

    fn cycle(time_ns: u64, phase: Phase, commanded_n: Option<f64>, alarms_count: u32) -> Cycle {
        let hand = Hand::new(&[Mounting::on(Side::Left)]).expect("one finger").report(time_ns);
        Cycle {
            time_ns,
            hand,
            gripper: GripperState {
                time_ns,
                force_n: None,
                force_error_n: None,
                target_n: None,
                opening_mm: None,
                jaws: Jaws::Holding,
            },
            idle_force_n: 0.0,
            wrist: WristState { time_ns, angle_rad: 0.0, lowered_mm: 0.0, moving: false },
            grip_command: commanded_n.map_or(GripCommand::Release, |force_n| GripCommand::Hold { force_n }),
            wrist_command: WristCommand::new(WristMotion::Pause),
            phase,
            margin: None,
            alarms_count,
            slips_count: 0,
            truth: None,
            fault: false,
            on_fault: false,
            refused_lowering: false,
        }
    }

    fn pressed(grip_force_n: f64, required_n: f64) -> HandTruth {
        HandTruth { grip_force_n, required_n, ..HandTruth::default() }
    }

    #[test]
    fn an_object_is_lost_by_the_truth_whatever_the_task_says_of_its_end() {
        let mut score = RunScore { ending: Some(Ending::Held), ..RunScore::new(60.0) };
        assert!(!score.is_object_lost());
        score.last.bottle = Some(BottleTruth::default());
        assert!(!score.is_object_lost());
        score.last.bottle = Some(BottleTruth { dropped: true, ..BottleTruth::default() });
        assert!(score.is_object_lost());
        score.last =
            HandTruth { ground: Some(GroundTruth { dropped: true, ..GroundTruth::default() }), ..HandTruth::default() };
        assert!(score.is_object_lost());
        let told = RunScore { ending: Some(Ending::Lost), ..RunScore::new(60.0) };
        assert!(told.is_object_lost());
    }

    const SECOND_NS: u64 = 1_000_000_000;

    #[test]
    fn forces_alarms_and_the_ending_add_up_over_cycles() {
        let mut score = RunScore::new(60.0);
        score.add_cycle(&cycle(SECOND_NS, Phase::Grasping, Some(10.0), 0), Some(&pressed(2.0, 0.0)));
        assert_eq!(score.least_held_n, None, "still grasping");
        score.add_cycle(&cycle(2 * SECOND_NS, Phase::Working, Some(10.0), 0), Some(&pressed(10.0, 6.0)));
        score.add_cycle(&cycle(3 * SECOND_NS, Phase::Waiting, Some(14.0), 1), Some(&pressed(10.0, 8.0)));
        score.add_cycle(&cycle(4 * SECOND_NS, Phase::Working, Some(14.0), 2), Some(&pressed(14.0, 4.0)));
        score.add_truth(&HandTruth { slid_mm: 0.3, ..pressed(9.0, 4.0) });
        assert_eq!((score.ending, score.alarms_count, score.most_n), (None, 2, 14.0));
        assert_eq!((score.least_held_n, score.last.grip_force_n), (Some(9.0), 9.0));
        assert_eq!(score.first_alarm_used_fraction(), Some(0.8), "at the first of the two");
        assert_eq!(score.over_squeeze_ratio(), Some(20.0 / 14.0), "only where more than 5 N was required");
        score.add_cycle(&cycle(5 * SECOND_NS, Phase::Ended(Ending::Held), None, 2), None);
        let opened = HandTruth { slid_mm: 2.0, ..pressed(-0.01, 4.0) };
        score.add_cycle(&cycle(6 * SECOND_NS, Phase::Ended(Ending::Lost), None, 2), Some(&opened));
        assert_eq!((score.slid_mm, score.last.slid_mm), (0.3, 2.0), "what it slides while it is let go does not count");
        assert_eq!((score.ending, score.ended_s, score.time_s), (Some(Ending::Held), Some(5.0), 6.0));
        assert_eq!((score.most_n, score.last.grip_force_n), (14.0, -0.01), "a release commands no force");
        assert_eq!(score.least_held_n, Some(9.0), "what is let go is not held");
        score.add_truth(&pressed(0.0, 0.0));
        assert_eq!(score.least_held_n, Some(9.0), "nor while nothing is commanded after that");
        assert_eq!(RunScore::new(60.0).over_squeeze_ratio(), None);
    }

    #[test]
    fn what_is_held_to_the_end_of_the_time_with_a_fault_has_not_ended() {
        for (ending, counts) in [(Ending::Held, false), (Ending::NothingHeld, false), (Ending::Lost, true)] {
            let mut score = RunScore::new(60.0);
            score.add_cycle(&Cycle { fault: true, ..cycle(SECOND_NS, Phase::Ended(ending), Some(10.0), 0) }, None);
            let expected = (Some(ending).filter(|_| counts), Some(1.0).filter(|_| counts));
            assert_eq!((score.ending, score.ended_s), expected, "{ending:?}");
        }
    }

    /// A cap of radius 14 mm at friction 0.6, gripped with 30 N.
    fn turned(limit_n: f64, ending: Ending, torque_n_mm: f64, angle_rad: f64) -> RunScore {
        let cap = CapTruth { torque_n_mm, limit_n_mm: 2.0 * 0.6 * 30.0 * 14.0, angle_rad, ..CapTruth::default() };
        let mut score = RunScore::new(limit_n);
        let truth = HandTruth { cap: Some(cap), ..pressed(30.0, 20.0) };
        score.add_cycle(&cycle(0, Phase::Working, Some(30.0), 0), Some(&truth));
        score.add_cycle(&cycle(SECOND_NS, Phase::Ended(ending), Some(30.0), 0), Some(&truth));
        score
    }

    #[test]
    fn torque_is_told_as_a_share_of_what_friction_transmits_at_the_largest_force() {
        // 2 x 0.6 x 60 N x 14 mm = 1008 N mm.
        assert_eq!(turned(60.0, Ending::Tight, -504.0, 1.0).torque_fraction(), Some(0.5));
        assert_eq!(turned(40.0, Ending::Tight, 504.0, 1.0).torque_fraction(), Some(0.75));
        assert_eq!(RunScore::new(60.0).torque_fraction(), None);
    }

    #[test]
    fn a_task_succeeds_when_it_ended_as_it_should() {
        let ended = |ending: Ending| RunScore { ending: Some(ending), ..RunScore::new(60.0) };
        for (kind, good) in [(TaskKind::Screw, Ending::Tight), (TaskKind::Unscrew, Ending::Opened)] {
            assert!(ended(good).succeeded(kind) && !ended(Ending::Stuck).succeeded(kind), "{kind:?}");
            assert!(!RunScore::new(60.0).succeeded(kind), "{kind:?}: the scene was over before");
        }
        assert!(ended(Ending::SlipAtMost).succeeded(TaskKind::Screw));
        let turned = |ending, torque_n_mm, angle_rad| turned(60.0, ending, torque_n_mm, angle_rad);
        assert!(turned(Ending::Tight, 920.0, 1.0).succeeded(TaskKind::Screw));
        assert!(!turned(Ending::Tight, 700.0, 1.0).succeeded(TaskKind::Screw), "it slid before it was tight");
        assert!(super::tests::turned(40.0, Ending::Tight, 700.0, 1.0).succeeded(TaskKind::Screw), "tight for 40 N");
        assert!(turned(Ending::SlipAtMost, 500.0, 1.0).succeeded(TaskKind::Screw), "as published");
        assert!(turned(Ending::Opened, 100.0, 0.2).succeeded(TaskKind::Unscrew));
        assert!(!turned(Ending::Opened, 100.0, 0.01).succeeded(TaskKind::Unscrew), "the fingers slid around it");
        let mut lift = ended(Ending::Held);
        assert!(lift.succeeded(TaskKind::Lift));
        lift.last.gross_steps_count = 1;
        assert!(!lift.succeeded(TaskKind::Lift), "it slid");
    }

    #[test]
    fn a_tool_is_put_down_softly_or_it_is_no_success() {
        assert_eq!((most_ground_n(1.0), most_ground_n(4.0)), (3.0, 6.0));
        let placed = |peak_force_n: f64, free_drop_mm: Option<f64>| {
            let ground = GroundTruth { weight_n: 4.0, peak_force_n, free_drop_mm, ..GroundTruth::default() };
            let last = HandTruth { ground: Some(ground), ..HandTruth::default() };
            RunScore { ending: Some(Ending::Placed), last, ..RunScore::new(60.0) }.succeeded(TaskKind::Place)
        };
        assert!(placed(6.0, Some(1.0)));
        assert!(!placed(6.1, Some(1.0)), "pressed on the ground");
        assert!(!placed(6.0, Some(1.1)) && !placed(6.0, None), "fell, or was not let go");
    }
}
