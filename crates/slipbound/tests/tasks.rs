//! Tasks against made-up hands: endings on evidence, beginnings with a hold, nothing let go.

mod made_up;

use made_up::{FRAME_NS, gripper, hand};
use slipbound::hand::{HandReport, HandSlip, HandVector, Health};
use slipbound::monitor::SlipState;
use slipbound::port::{GripCommand, GripperState, Jaws, WristMotion, WristState};
use slipbound::sensor::Sensor;
use slipbound::task::{ControllerKind, Ending, Missing, Observation, Phase, Task, TaskKind, TaskSettings};

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

/// A cap that runs freely with a little friction; at the largest force one frame, or two that are far apart, tell of slip.
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

/// It is held up from 2 s on; then the gripper's link is lost for 5 s, in which the task is not stepped, or it falls out of the jaws.
#[test]
fn a_hold_counts_what_was_felt_and_an_object_that_fell_was_not_held() {
    let mut settings = TaskSettings::default();
    settings.lift.hold_ns = 4_000_000_000;
    let ends = |skipped: std::ops::Range<u64>, fallen: Option<Jaws>| {
        let mut task = settings.task(TaskKind::Lift, None).expect("valid");
        let mut lowered_mm = 0.0;
        for ms in (0..20_000u64).step_by(33).filter(|ms| !skipped.contains(ms)) {
            let fell = fallen.filter(|_| ms > 3000);
            let report = hand(if fell.is_some() { SlipState::NoContact } else { SlipState::Stick });
            let state = GripperState { jaws: fell.unwrap_or(jaws_at(ms)), ..gripper(10.0) };
            let wrist = WristState { time_ns: ms, angle_rad: 0.0, lowered_mm, moving: true };
            let now_ns = ms * 1_000_000;
            let step = task.step(&Observation { now_ns, hand: &report, gripper: &state, wrist: &wrist });
            if let WristMotion::Lower { rate_mm_per_s, .. } = step.wrist.motion {
                lowered_mm += rate_mm_per_s * 0.033;
            }
            if let Phase::Ended(ending) = step.phase {
                return Some((ending, ms));
            }
        }
        None
    };
    let (ending, ends_ms) = ends(0..0, None).expect("it ends");
    assert_eq!(ending, Ending::Held);
    let (ending, late_ms) = ends(3000..8000, None).expect("it ends");
    assert_eq!(ending, Ending::Held);
    assert!((4700..=5050).contains(&(late_ms - ends_ms)), "{ends_ms} ms and {late_ms} ms");
    assert_eq!(ends(0..0, Some(Jaws::Holding)), None, "nobody feels it");
    for jaws in [Jaws::Lost, Jaws::Nothing] {
        assert!(matches!(ends(0..0, Some(jaws)), Some((Ending::Lost, 3003..=3100))), "{jaws:?}");
    }
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
        if cycle > 25 {
            loose_n.push(force_n);
        }
    }
    assert!(loose_n.iter().all(|n| *n == 5.0), "{loose_n:?}");
}

/// A tool that hangs is lowered, and touches the ground at 5 mm, which turns and pushes it. `sees`: which fingers have a frame in a cycle; `None`: the
/// fingers feel nothing from there on.
fn lowered(hand_of: impl Fn(u64, f64) -> HandReport) -> (Option<Ending>, f64) {
    let mut task = TaskSettings::default().task(TaskKind::Place, Some(0.05)).expect("valid");
    let (mut force_n, mut lowered_mm, mut released) = (10.0, 0.0, false);
    for cycle in 0..20_000u64 {
        let now_ns = cycle * FRAME_NS;
        let report = hand_of(cycle, lowered_mm);
        let state = GripperState { jaws: if released { Jaws::Open } else { Jaws::Holding }, ..gripper(force_n) };
        let wrist = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm, moving: true };
        let step = task.step(&Observation { now_ns, hand: &report, gripper: &state, wrist: &wrist });
        match step.grip {
            GripCommand::Hold { force_n: asked_n } => force_n = asked_n,
            GripCommand::Release => released = true,
        }
        if let WristMotion::Lower { rate_mm_per_s, .. } = step.wrist.motion {
            lowered_mm += rate_mm_per_s * FRAME_NS as f64 * 1e-9;
        }
        if let Phase::Ended(ending) = step.phase {
            return (Some(ending), lowered_mm);
        }
    }
    (None, lowered_mm)
}

fn ground_at_5_mm(lowered_mm: f64) -> HandReport {
    let deep_mm = (lowered_mm - 5.0).max(0.0);
    HandReport {
        pivot_rad: Some(1f64.to_radians() * deep_mm),
        shear_mm: Some(HandVector { along: -0.1 * deep_mm, ..HandVector::default() }),
        ..hand(SlipState::Stick)
    }
}

/// Cameras that take turns, or of which one is slow.
#[test]
fn the_ground_is_felt_whichever_finger_has_a_frame() {
    let (ending, both_mm) = lowered(|_, mm| ground_at_5_mm(mm));
    assert_eq!(ending, Some(Ending::Placed));
    type Sees = fn(u64) -> (bool, bool);
    let patterns: [(&str, Sees); 4] = [
        ("right in every second", |cycle| (true, cycle % 2 == 0)),
        ("in turns", |cycle| (cycle % 2 == 0, cycle % 2 == 1)),
        ("right lost in every third", |cycle| (true, cycle % 3 != 0)),
        ("right in every fifth", |cycle| (true, cycle % 5 == 0)),
    ];
    for (name, sees) in patterns {
        let told = lowered(|cycle, mm| {
            let (left, right) = sees(cycle);
            let mut report = ground_at_5_mm(mm);
            for (health, sees) in report.health.iter_mut().zip([left, right]) {
                *health = if sees { Health::Live } else { Health::Blind };
            }
            (report.separated, report.live_count) = (left && right, u32::from(left) + u32::from(right));
            // One is turned and sheared more than the other.
            let off = match (left, right) {
                (true, true) => 0.0,
                (true, false) => 1.0,
                _ => -1.0,
            };
            report.pivot_rad = report.pivot_rad.map(|rad| rad + 0.1 * off);
            report.shear_mm = report.shear_mm.map(|mm| HandVector { along: mm.along + 0.3 * off, ..mm });
            report
        });
        assert_eq!(told.0, Some(Ending::Placed), "{name}: {told:?}");
        assert!((told.1 - both_mm).abs() < 0.5, "{name}: {told:?} for {both_mm} mm");
    }
}

/// Fingers that tell no shear (no size in mm), or feel nothing; a tool that pivots in the air; ground that is never there.
#[test]
fn nothing_is_lowered_further_than_it_may_be() {
    let hanging = hand(SlipState::Stick);
    let blind_to_shear = HandReport { shear_mm: None, ..hanging };
    let (ending, mm) = lowered(|_, _| blind_to_shear);
    assert!(ending.is_none() && mm < 1.0, "it waits: {ending:?} after {mm} mm");
    let feels_nothing = HandReport { shear_mm: None, pivot_rad: None, ..hand(SlipState::NoContact) };
    let (ending, mm) = lowered(|cycle, _| if cycle < 60 { hanging } else { feels_nothing });
    assert!(ending.is_none() && mm < 6.0, "{ending:?} after {mm} mm");
    let pivots = |cycles: std::ops::Range<u64>| {
        let mut forces_mm = lowered(|cycle, _| match cycles.contains(&cycle) {
            true => HandReport {
                slip: Some(HandSlip { direction: HandVector::default(), pivots: true, fingers_count: 2 }),
                ..hand(SlipState::Incipient)
            },
            false => hanging,
        });
        forces_mm.1 = forces_mm.1.round();
        forces_mm
    };
    assert_eq!(pivots(60..60), (Some(Ending::Limit), 100.0), "no ground at all");
    assert_eq!(pivots(60..90), (Some(Ending::Limit), 100.0), "taken for a touch, and no ground after it");
}

#[test]
fn one_frame_in_which_it_pivots_is_no_ground_and_a_push_counts_in_a_row_only() {
    let mut task = TaskSettings::default().task(TaskKind::Place, Some(0.05)).expect("valid");
    let (mut force_n, mut now_ns) = (10.0, 0);
    let mut step = |report: &HandReport, after_ns: u64| {
        now_ns += after_ns;
        let wrist = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
        let step = task.step(&Observation { now_ns, hand: report, gripper: &gripper(force_n), wrist: &wrist });
        if let GripCommand::Hold { force_n: asked_n } = step.grip {
            force_n = asked_n;
        }
        (step.phase, force_n)
    };
    let hanging = hand(SlipState::Stick);
    let slip = Some(HandSlip { direction: HandVector::default(), pivots: true, fingers_count: 2 });
    let pivots = HandReport { slip, ..hand(SlipState::Incipient) };
    for cycle in 0..120 {
        let told = step(if cycle % 3 == 2 { &pivots } else { &hanging }, FRAME_NS);
        assert_eq!(told.1, 10.0, "{cycle}: it hangs in the air");
    }
    let turned = HandReport { pivot_rad: Some(0.1), ..hanging };
    for _ in 0..60 {
        step(&turned, FRAME_NS);
    }
    assert_eq!(step(&turned, FRAME_NS), (Phase::Working, 5.0));
    let pushed = HandReport { shear_mm: Some(HandVector { along: -0.6, ..HandVector::default() }), ..turned };
    step(&pushed, FRAME_NS);
    step(&pushed, FRAME_NS);
    let (phase, _) = step(&pushed, 5_000_000_000);
    assert_eq!(phase, Phase::Waiting, "the first of a new row");
    let further = HandReport { shear_mm: Some(HandVector { along: -1.5, ..HandVector::default() }), ..turned };
    let phases = [0; 2].map(|_| step(&further, FRAME_NS).0);
    assert_eq!(phases, [Phase::Waiting, Phase::Releasing], "and it is not pressed onto the ground meanwhile");
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
    assert_eq!(phases[1..], [Phase::Waiting, Phase::Releasing, Phase::Releasing], "{phases:?}");
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

/// What a task goes by, a finger must tell; a lift goes by slip.
#[test]
fn a_task_that_goes_by_shear_wants_a_finger_that_tells_it_in_mm() {
    let settings = TaskSettings::default();
    let mut sensor: Sensor = serde_json::from_value(serde_json::json!({
        "name": "bare", "description": "", "image_px": [320, 240], "flip": "none", "grey_weights_rgb": [0.3, 0.4, 0.3],
        "polarity": "dark", "pitch_px": 20.0, "marker_diameter_px": 6.0, "skin": "smooth"
    }))
    .expect("a sensor");
    for kind in [TaskKind::Screw, TaskKind::Unscrew, TaskKind::Place] {
        let error = settings.check_finger(kind, &sensor).expect_err("no pitch_mm");
        assert!(error.to_string().contains("pitch_mm") && error.to_string().contains(kind.name()), "{error}");
    }
    settings.check_finger(TaskKind::Lift, &sensor).expect("by slip");
    settings.with_controller(ControllerKind::Paper).check_finger(TaskKind::Screw, &sensor).expect("by slip");
    sensor.pitch_mm = Some(1.5);
    settings.check_finger(TaskKind::Place, &sensor).expect("it tells mm");
}
