//! Tasks against made-up hands: endings on evidence, beginnings with a hold, nothing let go.

mod made_up;

use made_up::{FRAME_NS, gripper, hand};
use slipbound::hand::{HandReport, HandSlip, HandVector, Health};
use slipbound::monitor::SlipState;
use slipbound::port::{GripCommand, GripperState, Jaws, WristMotion, WristState};
use slipbound::task::{Ending, Missing, Observation, Phase, Task, TaskKind, TaskSettings};

/// A cap, a gripper and a wrist that follow at once; the shear is what the test says it is at each angle.
struct Bench {
    task: Box<dyn Task + Send>,
    now_ns: u64,
    force_n: f64,
    angle_rad: f64,
    slip: bool,
    /// Whether the gripper presses with what it is told, or goes on with 10 N.
    follows: bool,
    period_ns: u64,
}

impl Bench {
    fn new(kind: TaskKind) -> Self {
        let task = TaskSettings::default().task(kind, Some(0.05)).expect("valid");
        Bench { task, now_ns: 0, force_n: 10.0, angle_rad: 0.0, slip: false, follows: true, period_ns: FRAME_NS }
    }

    fn step(&mut self, shear_mm: f64) -> Phase {
        let mut report = if self.slip { hand(SlipState::Incipient) } else { hand(SlipState::Stick) };
        report.shear_mm = Some(HandVector { around: shear_mm, ..HandVector::default() });
        let wrist = WristState { time_ns: self.now_ns, angle_rad: self.angle_rad, lowered_mm: 0.0, moving: true };
        let gripper = gripper(self.force_n);
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

    /// Turns while the shear follows the angle; gives the ending and the angle in deg.
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

/// What was flat under the lighter grip says nothing of the harder one.
#[test]
fn a_shear_has_to_stay_flat_from_the_last_change_of_force_on() {
    let mut settings = TaskSettings::default();
    settings.grip.most_n = 20.0;
    let mut bench =
        Bench { task: settings.task(TaskKind::Screw, Some(0.05)).expect("valid"), ..Bench::new(TaskKind::Screw) };
    // Flat from 0.15 rad on, and slip from 0.8 rad on: to 20 N there, which is the most.
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

#[test]
fn a_cap_is_open_when_the_torque_fell_and_stayed_down() {
    let mut bench = Bench::new(TaskKind::Unscrew);
    let (ending, angle_deg) = bench.run(|rad| if rad > -0.5 { 2.0 * rad } else { -0.1 }, |rad| rad < -0.3);
    assert_eq!(ending, Some(Ending::Opened));
    assert!((-44.0..-36.0).contains(&angle_deg), "10 deg after it fell at 29 deg: {angle_deg}");
}

#[test]
fn a_cap_that_does_not_open_is_stuck_and_slip_alone_is_never_open() {
    let mut bench = Bench::new(TaskKind::Unscrew);
    let (ending, _) = bench.run(|rad| (2.0 * rad).max(-1.5), |rad| rad < -0.3);
    assert_eq!((ending, bench.force_n), (Some(Ending::Stuck), 60.0));
}

#[test]
fn an_empty_gripper_ends_the_task() {
    let mut task = TaskSettings::default().task(TaskKind::Lift, None).expect("valid");
    let state = GripperState { jaws: Jaws::Nothing, ..gripper(0.0) };
    let wrist = WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
    let report = hand(SlipState::NoContact);
    let step = task.step(&Observation { now_ns: 0, hand: &report, gripper: &state, wrist: &wrist });
    assert_eq!(step.phase, Phase::Ended(Ending::NothingHeld));
    assert_eq!(step.wrist.motion, WristMotion::Pause);
}

/// A tool is lowered, touches and turns; its grip is to be loosened. `follows`: whether the gripper does that.
fn laid_down(follows: bool) -> (Option<Ending>, bool) {
    let mut task = TaskSettings::default().task(TaskKind::Place, Some(0.05)).expect("valid");
    let (mut force_n, mut lowered_mm, mut released) = (10.0, 0.0, false);
    for cycle in 0..600u64 {
        let now_ns = cycle * FRAME_NS;
        let mut report = hand(SlipState::Stick);
        // From 5 mm on it touches the ground, turns, and is pushed against the gels.
        let touches = lowered_mm > 5.0;
        report.pivot_rad = Some(if touches { 0.2 } else { 0.0 });
        let along = if lowered_mm > 5.0 { 0.1 * (5.0 - lowered_mm) } else { 0.0 };
        report.shear_mm = Some(HandVector { along, ..HandVector::default() });
        let jaws = if released { Jaws::Open } else { Jaws::Holding };
        let state = GripperState { jaws, ..gripper(force_n) };
        let wrist = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm, moving: true };
        let step = task.step(&Observation { now_ns, hand: &report, gripper: &state, wrist: &wrist });
        released = step.grip == GripCommand::Release;
        if let GripCommand::Hold { force_n: asked_n } = step.grip
            && (follows || asked_n > force_n)
        {
            force_n = asked_n;
        }
        if let WristMotion::Lower { rate_mm_per_s, .. } = step.wrist.motion {
            lowered_mm += rate_mm_per_s * FRAME_NS as f64 * 1e-9;
        }
        if let Phase::Ended(ending) = step.phase {
            return (Some(ending), released);
        }
    }
    (None, released)
}

#[test]
fn a_gripper_that_does_not_loosen_its_grip_lets_nothing_go() {
    assert_eq!(laid_down(true), (Some(Ending::Placed), true));
    assert_eq!(laid_down(false), (Some(Ending::GripStays), false));
}

/// The hand, the gripper and what it does at a time in ms, shown to a lift every `period_ms`; the phase and force of each.
fn lift_with(
    settings: &TaskSettings,
    (period_ms, longest_ms): (u64, u64),
    shows: impl Fn(u64) -> (HandReport, GripperState),
) -> Vec<(u64, Phase, f64)> {
    let mut task = settings.task(TaskKind::Lift, None).expect("valid");
    let (mut lowered_mm, mut told) = (0.0, Vec::new());
    for ms in (0..longest_ms).step_by(period_ms as usize) {
        let (hand, gripper) = shows(ms);
        let wrist = WristState { time_ns: ms, angle_rad: 0.0, lowered_mm, moving: true };
        let now_ns = ms * 1_000_000;
        let step = task.step(&Observation { now_ns, hand: &hand, gripper: &gripper, wrist: &wrist });
        if let WristMotion::Lower { rate_mm_per_s, .. } = step.wrist.motion {
            lowered_mm += rate_mm_per_s * period_ms as f64 * 1e-3;
        }
        told.push((ms, step.phase, step.grip.force_n().expect("it holds")));
    }
    told
}

fn first_ms(told: &[(u64, Phase, f64)], wanted: impl Fn(Phase) -> bool) -> Option<u64> {
    told.iter().find(|(_, phase, _)| wanted(*phase)).map(|(ms, ..)| *ms)
}

/// The jaws close by 0.5 s.
fn jaws_at(ms: u64) -> Jaws {
    if ms < 500 { Jaws::Closing } else { Jaws::Holding }
}

#[test]
fn blind_fingers_never_begin_to_lift_and_a_hold_that_is_not_seen_does_not_count() {
    let mut settings = TaskSettings::default();
    settings.lift.hold_ns = 2_000_000_000;
    let run = |sees: fn(u64) -> bool| {
        lift_with(&settings, (33, 30_000), |ms| {
            let state = if sees(ms) { SlipState::Stick } else { SlipState::Unjudged };
            (hand(state), GripperState { jaws: jaws_at(ms), ..gripper(10.0) })
        })
    };
    let told = run(|ms| ms < 500);
    assert!(told.iter().all(|(_, phase, _)| *phase == Phase::Grasping), "{:?}", told.last());
    let told = run(|ms| !(500..3000).contains(&ms));
    let began_ms = first_ms(&told, |phase| phase == Phase::Working).expect("it begins");
    assert!((3200..3400).contains(&began_ms), "0.2 s after the cameras are back: {began_ms} ms");
    // Blind for 5 s while it is held up: the hold lasts 5 s longer.
    let ended = |told: &[(u64, Phase, f64)]| first_ms(told, |phase| phase == Phase::Ended(Ending::Held)).expect("held");
    let (seen_ms, unseen_ms) = (ended(&run(|_| true)), ended(&run(|ms| !(2500..7500).contains(&ms))));
    assert!((4960..=5040).contains(&(unseen_ms - seen_ms)), "{seen_ms} ms and {unseen_ms} ms");
}

/// 6 % high, 1 N off, 1.5 N of noise: the gripper holds, the fingers feel it, and that is believed.
#[test]
fn a_grasp_is_believed_though_the_force_reads_otherwise() {
    let noise = |ms: u64| ((ms * ms * 2_654_435_761 % 1024) as f64 / 1024.0 - 0.5) * 5.2;
    type Reading<'a> = &'a dyn Fn(u64) -> Option<f64>;
    let readings: [(&str, Reading<'_>, u64); 6] = [
        ("exact", &|_| Some(10.0), 200),
        ("none", &|_| None, 200),
        ("6 % high", &|_| Some(10.6), 1000),
        ("3 N low", &|_| Some(7.0), 1000),
        ("1.5 N rms", &|ms| Some(10.0 + noise(ms)), 1000),
        ("nothing", &|_| Some(0.0), 1000),
    ];
    for (name, reading, most_ms) in readings {
        let told = lift_with(&TaskSettings::default(), (33, 5000), |ms| {
            let jaws = jaws_at(ms);
            let force_n = reading(ms).map(|n| if jaws == Jaws::Holding { n } else { 0.0 });
            (
                hand(if ms < 500 { SlipState::NoContact } else { SlipState::Stick }),
                GripperState { jaws, force_n, ..gripper(10.0) },
            )
        });
        let began_ms = first_ms(&told, |phase| phase == Phase::Working).expect(name);
        assert!((700..=500 + most_ms + 66).contains(&began_ms), "{name}: {began_ms} ms");
    }
}

#[test]
fn slip_is_answered_from_the_first_contact_on() {
    let told = lift_with(&TaskSettings::default(), (33, 700), |ms| {
        let state = if ms < 500 { SlipState::NoContact } else { SlipState::Incipient };
        (hand(state), GripperState { jaws: jaws_at(ms), ..gripper(10.0) })
    });
    assert!(told.iter().all(|(_, phase, _)| *phase == Phase::Grasping));
    let raised_ms = told.iter().find(|(.., force_n)| *force_n > 10.0).map(|(ms, ..)| *ms);
    assert_eq!(raised_ms, Some(528), "the first frame in which it is held");
}

/// What is held but not felt is not lifted, and what is missing is said.
#[test]
fn a_task_that_cannot_begin_says_what_it_waits_for() {
    for (state, jaws, missing) in [
        (SlipState::Unjudged, Jaws::Holding, Missing::Sight),
        (SlipState::NoContact, Jaws::Holding, Missing::Contact),
        (SlipState::Stick, Jaws::Open, Missing::Hold),
        (SlipState::Stick, Jaws::Holding, Missing::Rest),
    ] {
        let mut task = TaskSettings::default().task(TaskKind::Screw, None).expect("valid");
        assert_eq!(task.missing(), None);
        let wrist = WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
        let state = (hand(state), GripperState { jaws, ..gripper(10.0) });
        task.step(&Observation { now_ns: 0, hand: &state.0, gripper: &state.1, wrist: &wrist });
        assert_eq!(task.missing(), Some(missing));
        assert!(!missing.in_words().is_empty());
    }
}

/// Frames without shear while it is laid down, with slip seen all the time: the loose grip stays loose.
#[test]
fn frames_without_shear_do_not_kick_the_grip_while_it_is_laid_down() {
    let mut task = TaskSettings::default().task(TaskKind::Place, Some(0.05)).expect("valid");
    let (mut force_n, mut loose_n) = (10.0, Vec::new());
    for cycle in 0..200u64 {
        let mut report = hand(SlipState::Incipient);
        let touches = cycle > 20;
        report.pivot_rad = Some(if touches { 0.2 } else { 0.0 });
        report.slip = report.slip.map(|slip| HandSlip { pivots: touches, direction: HandVector::default(), ..slip });
        if touches && cycle % 3 == 0 {
            (report.shear_mm, report.pivot_rad) = (None, None);
        }
        if cycle == 100 {
            report = hand(SlipState::Unjudged);
        }
        let wrist = WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
        let now_ns = cycle * FRAME_NS;
        let step = task.step(&Observation { now_ns, hand: &report, gripper: &gripper(force_n), wrist: &wrist });
        if let GripCommand::Hold { force_n: asked_n } = step.grip {
            force_n = asked_n;
        }
        if cycle > 22 {
            loose_n.push(force_n);
        }
    }
    assert!(loose_n.iter().all(|n| *n == 5.0), "{loose_n:?}");
}

/// While a tool hangs, and while it is laid down, a finger drops out for some frames and comes back; what the two feel differs. Then the ground
/// turns the tool, and carries it.
#[test]
fn a_finger_that_is_lost_for_some_frames_is_no_ground() {
    // Shear along, mm, and pivot, rad, of the left finger and of the right; which see; whether the phase may be what it is then.
    let felt = |left: (f64, f64), right: (f64, f64), sees: (bool, bool)| {
        let mean = |a: f64, b: f64| match sees {
            (true, true) => (a + b) / 2.0,
            (true, false) => a,
            _ => b,
        };
        let mut report = hand(SlipState::Stick);
        report.shear_mm = Some(HandVector { along: mean(left.0, right.0), ..HandVector::default() });
        report.pivot_rad = Some(mean(left.1, right.1));
        for (health, sees) in report.health.iter_mut().zip([sees.0, sees.1]) {
            *health = if sees { Health::Live } else { Health::Blind };
        }
        (report.separated, report.live_count) = (sees.0 && sees.1, u32::from(sees.0) + u32::from(sees.1));
        report
    };
    let mut task = TaskSettings::default().task(TaskKind::Place, None).expect("valid");
    let (mut force_n, mut cycle) = (10.0, 0u64);
    let mut step = |report: &HandReport| {
        cycle += 1;
        let wrist = WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
        let now_ns = cycle * FRAME_NS;
        let step = task.step(&Observation { now_ns, hand: report, gripper: &gripper(force_n), wrist: &wrist });
        if let GripCommand::Hold { force_n: asked_n } = step.grip {
            force_n = asked_n;
        }
        (step.phase, force_n)
    };
    let both = (true, true);
    // One finger is sheared by 0.5 mm more and turned by 6 deg more than the other.
    let (left, right) = ((0.6, 0.1), (0.1, 0.0));
    for (count, sees) in [(30, both), (1, (true, false)), (5, both), (20, (false, true)), (30, both)] {
        for _ in 0..count {
            let (phase, force_n) = step(&felt(left, right, sees));
            assert_eq!(force_n, 10.0, "it hangs in the air: {phase:?}");
        }
    }
    // The ground turns it by 2 deg.
    let turned = |(mm, rad): (f64, f64)| (mm, rad + 2f64.to_radians());
    let (left, right) = (turned(left), turned(right));
    let loosened: Vec<f64> = (0..4).map(|_| step(&felt(left, right, both)).1).collect();
    assert_eq!(loosened, [10.0, 10.0, 5.0, 5.0], "felt for three cycles");
    for (count, sees) in
        [(60, both), (1, (false, true)), (5, both), (20, (false, true)), (1, (true, false)), (30, both)]
    {
        for _ in 0..count {
            let (phase, _) = step(&felt(left, right, sees));
            assert!(matches!(phase, Phase::Working | Phase::Waiting), "nothing carries it: {phase:?}");
        }
    }
    let carried = |(mm, rad): (f64, f64)| (mm - 0.15, rad);
    let phases: Vec<Phase> = (0..4).map(|_| step(&felt(carried(left), carried(right), both)).0).collect();
    assert_eq!(phases[1..], [Phase::Working, Phase::Releasing, Phase::Releasing], "{phases:?}");
}

/// The loop's rate and the wrist's speed do not decide how a task ends.
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
            // The angle, too, but for the turn between two cycles.
            let step_deg = 3.0 * speed_deg_per_s / f64::from(rate_hz);
            assert!((tight.1 - 77.0).abs() < 2.5 + step_deg, "{at}");
            assert!((opened.1 + 39.0).abs() < 1.5 + step_deg, "{at}");
        }
    }
}

#[test]
fn windows_that_can_never_fill_are_refused() {
    for (change, key) in [
        ((|s| s.screw.flat_window_rad = 0.6) as fn(&mut TaskSettings), "screw.flat_window_rad"),
        (|s| s.screw.slide.window_rad = 0.6, "slide.window_rad"),
        (|s| s.unscrew.open_rad = 0.6, "unscrew.open_rad"),
        (|s| s.unscrew.stuck_rad = 0.6, "unscrew.stuck_rad"),
    ] {
        let mut settings = TaskSettings::default();
        (settings.screw.most_rad, settings.unscrew.most_rad) = (0.5, 0.5);
        settings.check().expect("windows within the turn");
        change(&mut settings);
        assert_eq!(settings.check().expect_err(key).key, key);
    }
}
