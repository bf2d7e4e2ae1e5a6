//! Screwing and unscrewing a cap: end on evidence.

use crate::synthetic::{FRAME_NS, gripper, hand};
use slipbound::grip::{ArmMotion, GripController, GripDecision, Guard, Law};
use slipbound::hand::{HandReport, HandVector, Health};
use slipbound::monitor::SlipState;
use slipbound::port::{GripCommand, GripperState, Jaws, WristMotion, WristState};
use slipbound::task::{ControllerKind, Ending, Observation, Phase, Task, TaskKind, TaskSettings};
use std::sync::{Arc, Mutex};

/// A cap, and a gripper and a wrist that follow at once; the test defines the shear at each angle.
struct Bench {
    task: Box<dyn Task + Send>,
    now_ns: u64,
    force_n: f64,
    angle_rad: f64,
    slip: bool,
    /// Shear along the fingers once the thread has dragged them along by it, mm.
    along_mm: f64,
    /// Whether the gripper exerts the commanded force, or stays at 10 N.
    follows: bool,
    jaws: Jaws,
    period_ns: u64,
    /// Whether the left finger has a frame.
    sees_left: bool,
}

impl Bench {
    fn new(kind: TaskKind) -> Self {
        let task = TaskSettings::default().task(kind, Some(0.05)).expect("valid");
        let jaws = Jaws::Holding;
        let (slip, along_mm, follows) = (false, 0.0, true);
        let (period_ns, sees_left) = (FRAME_NS, true);
        Bench { task, now_ns: 0, force_n: 10.0, angle_rad: 0.0, slip, along_mm, follows, jaws, period_ns, sees_left }
    }

    fn step(&mut self, shear_mm: f64) -> Phase {
        let mut report = if self.slip { hand(SlipState::Incipient) } else { hand(SlipState::Stick) };
        report.shear_mm = Some(HandVector { around: shear_mm, along: self.along_mm.min(self.angle_rad), across: 0.0 });
        if !self.sees_left {
            (report.health[0], report.live_count, report.separated) = (Health::Blind, 1, false);
        }
        let wrist = WristState { time_ns: self.now_ns, angle_rad: self.angle_rad, lowered_mm: 0.0, moving: true };
        let gripper = GripperState { jaws: self.jaws, ..gripper(self.force_n) };
        let step =
            self.task.step(&Observation { now_ns: self.now_ns, hand: &report, gripper: &gripper, wrist: &wrist });
        if let (GripCommand::Hold { force_n }, true) = (step.grip, self.follows) {
            self.force_n = force_n;
        }
        if let WristMotion::Turn { rate_rad_per_s, most_rad } = step.wrist.motion {
            assert!(step.wrist.time_to_live_ns <= 200_000_000 && most_rad <= 0.2 * rate_rad_per_s.abs() + 1e-12);
            self.angle_rad += rate_rad_per_s * self.period_ns as f64 * 1e-9;
        }
        self.now_ns += self.period_ns;
        step.phase
    }

    /// Turns while the shear follows the angle; returns the ending and the angle in deg.
    fn run(&mut self, shear_mm: impl Fn(f64) -> f64, slip: impl Fn(f64) -> bool) -> (Option<Ending>, f64) {
        for _ in 0..200_000_000_000 / self.period_ns {
            self.slip = slip(self.angle_rad);
            if let Phase::Ended(ending) = self.step(shear_mm(self.angle_rad)) {
                return (Some(ending), self.angle_rad.to_degrees());
            }
        }
        (None, self.angle_rad.to_degrees())
    }
}

#[test]
fn a_cap_is_tight_when_the_shear_stays_flat_at_the_largest_force_and_not_at_the_first_slip_there() {
    let mut bench = Bench::new(TaskKind::Screw);
    // Slip from 0.5 rad on; the shear grows until 1.2 rad.
    let (ending, angle_deg) = bench.run(|rad| 2.0 * rad.min(1.2), |rad| rad > 0.5);
    assert_eq!(ending, Some(Ending::Tight));
    assert_eq!(bench.force_n, 60.0);
    let flat_from_deg = 1.2f64.to_degrees();
    assert!((flat_from_deg + 6.0..flat_from_deg + 12.0).contains(&angle_deg), "{angle_deg}");
}

/// The paper's end of screwing belongs to the paper's controller: the settings' name for another plays no part.
#[test]
fn screwing_with_a_controller_of_your_own_ends_on_evidence() {
    let settings = TaskSettings::default().with_controller(ControllerKind::Paper);
    let own = Law::OnSlip(settings.on_slip).controller(&settings.grip).expect("valid");
    let own = settings.task_with(TaskKind::Screw, own, Some(0.05)).expect("valid");
    let paper = settings.task(TaskKind::Screw, Some(0.05)).expect("valid");
    for (task, expected) in [(own, Ending::Tight), (paper, Ending::SlipAtMost)] {
        let mut bench = Bench { task, ..Bench::new(TaskKind::Screw) };
        assert_eq!(bench.run(|rad| 2.0 * rad.min(1.2), |rad| rad > 0.5).0, Some(expected));
    }
}

/// A cap that turns freely with little friction; at the largest force slip is reported in one frame, or in some far
/// apart.
#[test]
fn an_alarm_or_two_at_the_largest_force_do_not_make_a_loose_cap_tight() {
    for alarms_deg in [&[20.0f64][..], &[20.0, 60.0, 100.0]] {
        let mut settings = TaskSettings::default();
        settings.grip.start_n = 60.0;
        let task = settings.task(TaskKind::Screw, Some(0.05)).expect("valid");
        let mut bench = Bench { task, force_n: 60.0, ..Bench::new(TaskKind::Screw) };
        let alarms = |rad: f64| alarms_deg.iter().any(|deg| (0.0..0.7).contains(&(rad.to_degrees() - deg)));
        assert_eq!(bench.run(|rad| rad.min(0.1), alarms).0, Some(Ending::Limit));
    }
}

/// A flat shear under the lighter grip is no evidence for the harder one.
#[test]
fn a_shear_has_to_stay_flat_from_the_last_change_of_force_on() {
    let mut settings = TaskSettings::default();
    settings.grip.most_n = 20.0;
    let mut bench =
        Bench { task: settings.task(TaskKind::Screw, Some(0.05)).expect("valid"), ..Bench::new(TaskKind::Screw) };
    // Flat from 0.15 rad on, slip from 0.8 rad on: there the force is raised to 20 N, the maximum.
    let (ending, angle_deg) = bench.run(|rad| (2.0 * rad).min(0.3), |rad| rad > 0.8);
    assert_eq!((ending, bench.force_n), (Some(Ending::Tight), 20.0));
    let gripped_deg = 0.8f64.to_degrees();
    assert!((gripped_deg + 8.0..gripped_deg + 11.0).contains(&angle_deg), "{angle_deg}");
}

#[test]
fn a_cap_is_not_tight_while_the_gripper_does_not_press_with_what_it_was_told() {
    let mut bench = Bench { follows: false, ..Bench::new(TaskKind::Screw) };
    let (ending, _) = bench.run(|rad| 2.0 * rad.min(1.2), |rad| rad > 0.5);
    assert_ne!(ending, Some(Ending::Tight));
}

#[test]
fn a_cap_that_runs_freely_is_not_tight() {
    let mut bench = Bench::new(TaskKind::Screw);
    let (ending, _) = bench.run(|rad| 0.1f64.min(rad), |_| false);
    assert_eq!((ending, bench.force_n), (Some(Ending::Limit), 10.0));
}

#[test]
fn fingers_that_slide_unseen_round_a_cap_are_noticed_by_the_load() {
    let mut bench = Bench::new(TaskKind::Screw);
    // 6.67 N per mm: 0.6 mm is 4 N of 10, flat from 0.3 rad on, and no marker shows slip.
    let (ending, _) = bench.run(|rad| (2.0 * rad).min(0.6), |_| false);
    assert!(bench.force_n > 10.0, "{ending:?} at {} N", bench.force_n);
}

/// A cap that follows its thread drags the fingers along: with 6.67 N per mm 2.7 N of 10, and 1.7 N around.
#[test]
fn what_the_thread_drags_along_is_no_slide_round_the_cap() {
    let mut bench = Bench { along_mm: 0.4, ..Bench::new(TaskKind::Screw) };
    let (ending, _) = bench.run(|rad| rad.min(0.25), |_| false);
    assert_eq!((ending, bench.force_n), (Some(Ending::Limit), 10.0));
}

/// A controller whose force is never the same twice, as that of one which follows the load; where told so it adds 2 N
/// in each cycle of a slide.
struct Restless {
    force_n: f64,
    adds_n: f64,
    cycles_count: u64,
    /// The cycles in which the object slid.
    slid: Arc<Mutex<Vec<u64>>>,
}

impl GripController for Restless {
    fn decide(&mut self, _: u64, hand: &HandReport, _: &GripperState) -> GripDecision {
        if hand.state == SlipState::Gross {
            self.slid.lock().expect("alone").push(self.cycles_count);
            self.force_n += self.adds_n;
        }
        self.cycles_count += 1;
        let force_n = self.force_n + if self.cycles_count.is_multiple_of(2) { 0.2 } else { -0.2 };
        GripDecision { force_n, arm: ArmMotion::Go }
    }

    fn alarms_count(&self) -> u32 {
        0
    }

    fn wants_more(&self) -> bool {
        false
    }
}

/// The load stays at 0.8 P, as that of fingers that slide: 6.67 N per mm of shear.
#[test]
fn fingers_that_slide_are_noticed_while_the_force_changes_and_as_long_as_they_slide() {
    for (adds_n, cycles_count) in [(0.0, 60), (2.0, 12)] {
        let mut settings = TaskSettings::default();
        settings.grip.most_n = 40.0;
        let slid = Arc::new(Mutex::new(Vec::new()));
        let own = Restless { force_n: 10.0, adds_n, cycles_count: 0, slid: slid.clone() };
        let own = Guard::new(Box::new(own), settings.grip);
        let task = settings.task_with(TaskKind::Screw, own, Some(0.05)).expect("valid");
        let mut bench = Bench { task, ..Bench::new(TaskKind::Screw) };
        for _ in 0..100 {
            bench.step((20.0 * bench.angle_rad).min(0.12 * bench.force_n));
        }
        let slid = slid.lock().expect("alone");
        // Two thirds of a degree a cycle: loaded after five cycles, flat over 8 deg after twelve more.
        assert!(slid.first().is_some_and(|first| (15..21).contains(first)), "{adds_n}: {slid:?}");
        assert!(slid.len() >= cycles_count, "{adds_n}: {slid:?}");
    }
}

#[test]
fn a_cap_is_open_when_the_torque_fell_and_stayed_down() {
    let mut bench = Bench::new(TaskKind::Unscrew);
    let (ending, angle_deg) = bench.run(|rad| if rad > -0.5 { 2.0 * rad } else { -0.1 }, |rad| rad < -0.3);
    assert_eq!(ending, Some(Ending::Opened));
    assert!((-44.0..-36.0).contains(&angle_deg), "10 deg after it fell at 29 deg: {angle_deg}");
    // The cap has slipped out of the jaws, which close on.
    let mut bench = Bench::new(TaskKind::Unscrew);
    while bench.angle_rad > -0.5 {
        bench.step(2.0 * bench.angle_rad);
    }
    bench.jaws = Jaws::Closing;
    assert_eq!(bench.run(|_| -0.1, |_| false).0, Some(Ending::Limit));
}

#[test]
fn a_cap_that_does_not_open_is_stuck_and_slip_alone_is_never_open() {
    let mut bench = Bench::new(TaskKind::Unscrew);
    let (ending, _) = bench.run(|rad| (2.0 * rad).max(-1.5), |rad| rad < -0.3);
    assert_eq!((ending, bench.force_n), (Some(Ending::Stuck), 60.0));
}

/// The right finger alone feels half as much again as both. The left one has no frame in some cycles of the plateau, or
/// is lost for good before it, or for a while around the fall of a cap that opens.
#[test]
fn a_finger_that_drops_out_is_no_change_of_torque() {
    let end = |both_mm: fn(f64) -> f64, is_torn: &dyn Fn(u64, f64) -> bool| {
        let (mut bench, mut plateau_cycles_count) = (Bench::new(TaskKind::Unscrew), 0);
        for _ in 0..1000 {
            bench.slip = bench.angle_rad < -0.3;
            plateau_cycles_count += u64::from(bench.force_n == 60.0 && bench.angle_rad < -0.8);
            bench.sees_left = !is_torn(plateau_cycles_count, bench.angle_rad);
            let share = if bench.sees_left { 1.0 } else { 1.5 };
            if let Phase::Ended(ending) = bench.step(share * both_mm(bench.angle_rad)) {
                return Some(ending);
            }
        }
        None
    };
    let stuck = |rad: f64| (2.0 * rad).max(-1.5);
    assert_eq!(end(stuck, &|cycles_count, _| cycles_count == 10), Some(Ending::Stuck), "one torn frame");
    assert_eq!(end(stuck, &|cycles_count, _| cycles_count % 7 == 6), Some(Ending::Stuck), "one in seven");
    assert_eq!(end(stuck, &|cycles_count, _| cycles_count % 2 == 0), Some(Ending::Stuck), "every second one");
    assert_eq!(end(stuck, &|_, rad| rad > -0.4), Some(Ending::Stuck), "it comes back");
    assert_eq!(end(stuck, &|_, rad| rad < -0.9), Some(Ending::Stuck), "it is lost");
    let opens = |rad: f64| if rad > -0.5 { 2.0 * rad } else { -0.1 };
    assert_eq!(end(opens, &|_, rad| rad > -0.55 && rad < -0.54), Some(Ending::Opened), "torn after the fall");
    assert_eq!(end(opens, &|_, rad| rad < -0.4), Some(Ending::Opened), "lost before it");
}

/// The loop rate and the wrist speed must not affect how a task ends.
#[test]
fn every_rate_and_speed_ends_alike() {
    for rate_hz in [10u32, 15, 30, 60, 90, 120, 240] {
        for speed_deg_per_s in [2.0f64, 5.0, 20.0, 60.0] {
            let mut settings = TaskSettings::default();
            settings.screw.rate_rad_per_s = speed_deg_per_s.to_radians();
            settings.unscrew.rate_rad_per_s = -speed_deg_per_s.to_radians();
            let end = |kind, shear_mm: fn(f64) -> f64, slip: fn(f64) -> bool| {
                let task = settings.task(kind, Some(0.05)).expect("valid");
                let mut bench = Bench { task, period_ns: 1_000_000_000 / u64::from(rate_hz), ..Bench::new(kind) };
                bench.run(shear_mm, slip)
            };
            let tight = end(TaskKind::Screw, |rad| 2.0 * rad.min(1.2), |rad| rad > 0.5);
            let stuck = end(TaskKind::Unscrew, |rad| (2.0 * rad).max(-1.5), |rad| rad < -0.3);
            let opened = end(TaskKind::Unscrew, |rad| if rad > -0.5 { 2.0 * rad } else { -0.1 }, |rad| rad < -0.3);
            let endings = [tight.0, stuck.0, opened.0];
            let at = format!("{rate_hz} Hz {speed_deg_per_s} deg/s: {tight:?} {stuck:?} {opened:?}");
            assert_eq!(endings, [Some(Ending::Tight), Some(Ending::Stuck), Some(Ending::Opened)], "{at}");
            // The angle is also the same, except for the turn between two cycles.
            let step_deg = 3.0 * speed_deg_per_s / f64::from(rate_hz);
            assert!((tight.1 - 77.0).abs() < 2.5 + step_deg, "{at}");
            assert!((opened.1 + 39.0).abs() < 1.5 + step_deg, "{at}");
        }
    }
}
