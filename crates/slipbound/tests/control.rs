//! Controllers and tasks against made-up hands: the paper's law, the bounds nobody gets past, endings on evidence.

use slipbound::grip::{
    ArmMotion, GripController, GripDecision, GripLimits, Guard, Law, MarginSettings, OnSlipSettings,
};
use slipbound::hand::{FINGERS_MOST, HandReport, HandSlip, HandVector, Health};
use slipbound::monitor::SlipState;
use slipbound::port::{GripCommand, GripperState, Jaws, WristMotion, WristState};
use slipbound::task::{ControllerKind, Ending, Missing, Observation, Phase, Task, TaskKind, TaskSettings};

const FRAME_NS: u64 = 33_333_333;

fn hand(state: SlipState) -> HandReport {
    let around = HandVector { around: 1.0, ..HandVector::default() };
    let slip = matches!(state, SlipState::Incipient).then_some(HandSlip {
        direction: around,
        pivots: false,
        fingers_count: 2,
    });
    let mut health = [Health::Absent; FINGERS_MOST];
    health[..2].fill(if state == SlipState::Unjudged { Health::Blind } else { Health::Live });
    HandReport {
        seq: 1,
        time_ns: None,
        state,
        live_count: if state == SlipState::Unjudged { 0 } else { 2 },
        health,
        separated: true,
        shear_mm: Some(HandVector::default()),
        pivot_rad: Some(0.0),
        slip_max_mm: Some(0.1),
        contact_area_mm2: Some(100.0),
        quality: 0.8,
        slip,
        margin: None,
        friction: None,
    }
}

fn gripper(force_n: f64) -> GripperState {
    GripperState {
        time_ns: 0,
        force_n: Some(force_n),
        force_error_n: None,
        target_n: Some(force_n),
        opening_mm: Some(28.0),
        jaws: Jaws::Holding,
    }
}

/// Runs a controller over hands, with a gripper that does at once what it is told; the commands as text.
fn commands(law: Law, limits: GripLimits, hands: &[HandReport]) -> Vec<GripDecision> {
    let mut controller = law.controller(&limits).expect("valid");
    let mut force_n = limits.start_n;
    let step = |(i, hand): (usize, &HandReport)| {
        let command = controller.decide(i as u64 * FRAME_NS, hand, &gripper(force_n));
        force_n = command.force_n;
        command
    };
    hands.iter().enumerate().map(step).collect()
}

#[test]
fn the_papers_law_pauses_adds_ten_newtons_and_goes_on_up_to_sixty() {
    let slip = hand(SlipState::Incipient);
    let stick = hand(SlipState::Stick);
    let mut hands = Vec::new();
    for _ in 0..8 {
        hands.push(slip);
        hands.extend([stick; 9]);
    }
    let told = commands(Law::OnSlip(OnSlipSettings::default()), GripLimits::default(), &hands);
    let forces: Vec<f64> = told.iter().step_by(10).map(|c| c.force_n).collect();
    assert_eq!(forces, [20.0, 30.0, 40.0, 50.0, 60.0, 60.0, 60.0, 60.0]);
    let picture: String = told[..20].iter().map(|c| if c.arm == ArmMotion::Go { '.' } else { '#' }).collect();
    assert_eq!(picture, "####......####......", "paused until the force has stood for 0.1 s");
    assert!(told[50..].iter().all(|c| c.arm == ArmMotion::Go), "at the largest force there is nothing to wait for");
}

#[test]
fn one_slip_seen_in_several_frames_is_one_alarm() {
    let slip = hand(SlipState::Incipient);
    let told = commands(Law::OnSlip(OnSlipSettings::default()), GripLimits::default(), &[slip; 6]);
    assert_eq!(told.last().expect("commands").force_n, 20.0);
}

#[test]
fn the_decreasing_law_loosens_down_to_the_least() {
    let settings = OnSlipSettings { step_n: -2.0, ..OnSlipSettings::default() };
    let mut hands = Vec::new();
    for _ in 0..5 {
        hands.push(hand(SlipState::Incipient));
        hands.extend([hand(SlipState::Stick); 9]);
    }
    let told = commands(Law::OnSlip(settings), GripLimits::default(), &hands);
    let forces: Vec<f64> = told.iter().step_by(10).map(|c| c.force_n).collect();
    assert_eq!(forces, [8.0, 6.0, 5.0, 5.0, 5.0]);
}

#[test]
fn a_blind_hand_keeps_its_force_and_the_arm_waits_after_three_frames() {
    for (law, blind_force_n) in [
        (Law::Constant, None),
        (Law::OnSlip(OnSlipSettings::default()), None),
        (Law::Margin(MarginSettings { stiffness_mpa_per_mm: 0.05, ..MarginSettings::default() }), Some(30.0)),
    ] {
        let limits = GripLimits { blind_force_n, ..GripLimits::default() };
        let mut hands = vec![hand(SlipState::Stick); 3];
        hands.extend([hand(SlipState::Unjudged); 6]);
        let told = commands(law, limits, &hands);
        let picture: String = told.iter().map(|c| if c.arm == ArmMotion::Go { '.' } else { '#' }).collect();
        assert_eq!(picture, ".....####", "{law:?}");
        assert_eq!(told[8].force_n, blind_force_n.unwrap_or(10.0), "{law:?}");
    }
}

#[test]
fn a_gripper_that_lost_the_part_or_stopped_is_told_to_keep_its_force() {
    for jaws in [Jaws::Lost, Jaws::Nothing, Jaws::Stopped] {
        let mut controller = Law::OnSlip(OnSlipSettings::default()).controller(&GripLimits::default()).expect("valid");
        let state = GripperState { jaws, ..gripper(10.0) };
        let command = controller.decide(0, &hand(SlipState::Incipient), &state);
        assert_eq!(command, GripDecision { force_n: 10.0, arm: ArmMotion::Pause });
    }
}

/// A controller gone mad.
struct Mad(std::vec::IntoIter<f64>);

impl GripController for Mad {
    fn decide(&mut self, _: u64, _: &HandReport, _: &GripperState) -> GripDecision {
        GripDecision { force_n: self.0.next().unwrap_or(f64::NAN), arm: ArmMotion::Go }
    }

    fn alarms_count(&self) -> u32 {
        0
    }

    fn wants_more(&self) -> bool {
        false
    }
}

#[test]
fn a_controller_that_asks_for_what_cannot_be_never_lets_go() {
    let asked = vec![30.0, f64::NAN, f64::INFINITY, 1e9, -5.0, 0.0, f64::NEG_INFINITY];
    let mut guard = Guard::new(Box::new(Mad(asked.into_iter())), GripLimits::default());
    let told: Vec<f64> =
        (0..7).map(|i| guard.decide(i * FRAME_NS, &hand(SlipState::Stick), &gripper(30.0)).force_n).collect();
    assert_eq!(told, [30.0, 30.0, 30.0, 60.0, 5.0, 5.0, 5.0]);
}

#[test]
fn a_margin_follows_the_load_at_once_and_lets_go_slowly() {
    let settings = MarginSettings { stiffness_mpa_per_mm: 0.05, ..MarginSettings::default() };
    // A load that would make the object slide at 13 N, then at 26 N, then at 2.6 N: the margin that is left at 65 %.
    let mut controller = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
    let mut force_n = 10.0;
    let mut told = Vec::new();
    for (slides_at_n, frames) in [(6.5, 30), (19.5, 60), (2.6, 90)] {
        for _ in 0..frames {
            let hand = HandReport { margin: Some(1.0 - slides_at_n / force_n), ..hand(SlipState::Stick) };
            let decided = controller.decide(told.len() as u64 * FRAME_NS, &hand, &gripper(force_n));
            force_n = decided.force_n;
            told.push(force_n);
        }
    }
    assert!((told[29] - 10.0).abs() < 0.1, "held at its target: {}", told[29]);
    assert!((told[89] - 30.0).abs() < 0.5, "19.5 N over 0.65: {}", told[89]);
    assert!(told[34] > 25.0, "within five frames: {}", told[34]);
    let fall_n = told[100] - told[130];
    assert!((fall_n - 5.0).abs() < 0.1, "5 N a second, not {fall_n} N in 1 s");
    assert!(told.iter().all(|n| (5.0..=60.0).contains(n)));
}

#[test]
fn a_loaded_contact_that_cannot_be_judged_is_gripped_harder_within_bounds_and_one_that_nobody_sees_is_not() {
    let settings = MarginSettings { stiffness_mpa_per_mm: 0.05, ..MarginSettings::default() };
    let forces = |margin: f64, then: SlipState| {
        let known = HandReport { margin: Some(margin), ..hand(SlipState::Stick) };
        let hands: Vec<HandReport> = (0..10).map(|_| known).chain((0..60).map(|_| hand(then))).collect();
        let told = commands(Law::Margin(settings), GripLimits::default(), &hands);
        (told[9].force_n, told[39].force_n, told[69].force_n)
    };
    let (before_n, after_n, last_n) = forces(0.4, SlipState::Unsure);
    assert!((after_n - before_n - 5.0).abs() < 0.5 && (last_n / before_n - 1.5).abs() < 0.01, "{after_n} {last_n}");
    for (margin, then) in [(0.9, SlipState::Unsure), (0.4, SlipState::Unjudged), (0.4, SlipState::NoContact)] {
        let (before_n, after_n, last_n) = forces(margin, then);
        assert_eq!((after_n, last_n), (before_n, before_n), "{margin} {then:?}");
    }
}

#[test]
fn a_margin_without_a_known_gel_is_refused_and_says_what_to_do() {
    let settings = TaskSettings { controller: ControllerKind::Margin, ..TaskSettings::default() };
    let error = settings.task(TaskKind::Screw, None).err().expect("refused");
    assert_eq!(error.key, "margin.stiffness_mpa_per_mm");
    assert!(error.to_string().contains("calibrate"), "{error}");
    assert!(settings.task(TaskKind::Screw, Some(0.05)).is_ok());
}

#[test]
fn settings_that_are_no_numbers_or_out_of_range_are_refused_by_name() {
    let good = TaskSettings::default();
    let mut cases: Vec<(TaskSettings, &str)> = Vec::new();
    let mut with = |change: fn(&mut TaskSettings), key| {
        let mut bad = good;
        change(&mut bad);
        cases.push((bad, key));
    };
    with(|s| s.grip.most_n = f64::NAN, "grip.most_n");
    with(|s| s.grip.start_n = 70.0, "grip.start_n");
    with(|s| s.grip.start_n = 1.0, "grip.start_n");
    with(|s| s.grip.blind_force_n = Some(100.0), "grip.blind_force_n");
    with(|s| s.on_slip.step_n = f64::INFINITY, "on_slip.step_n");
    with(|s| s.margin.target_fraction = 1.5, "margin.target_fraction");
    with(|s| s.screw.rate_rad_per_s = 0.0, "screw.rate_rad_per_s");
    with(|s| s.unscrew.open_rad = -1.0, "unscrew.open_rad");
    with(|s| s.place.laying_mm_per_s = 0.1, "place.laying_mm_per_s");
    with(|s| s.lift.lift_mm = f64::NAN, "lift.lift_mm");
    for (settings, key) in cases {
        assert_eq!(settings.check().expect_err(key).key, key);
    }
}

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

/// Any hands, grippers, controllers and wishes of tasks.
mod guarded {
    use super::*;
    use proptest::prelude::*;

    fn force() -> impl Strategy<Value = f64> {
        prop_oneof![
            5 => -20.0..120.0f64,
            1 => proptest::sample::select(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 1e300, 1e-300])
        ]
    }

    fn state() -> impl Strategy<Value = SlipState> {
        use SlipState::*;
        proptest::sample::select(vec![NoContact, Unsure, Stick, Incipient, Gross, Unjudged])
    }

    fn jaws() -> impl Strategy<Value = Jaws> {
        use Jaws::*;
        prop_oneof![4 => Just(Holding), 1 => proptest::sample::select(vec![Unknown, Open, Closing, Nothing, Lost, Stopped])]
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn no_force_leaves_the_limits_and_none_falls_while_blind(
            cycles in proptest::collection::vec((force(), state(), jaws(), 0..120u64, any::<bool>()), 1..60),
            blind_force_n in proptest::option::of(5.0..60.0f64),
        ) {
            let wanted: Vec<f64> = cycles.iter().map(|cycle| cycle.0).collect();
            let limits = GripLimits { blind_force_n, ..GripLimits::default() };
            let mut guard = Guard::new(Box::new(Mad(wanted.into_iter())), limits);
            let (mut now_ns, mut before_n, mut blind_ms) = (0, limits.start_n, 0);
            for (i, (wanted_n, state, jaws, wait_ms, by_task)) in cycles.into_iter().enumerate() {
                now_ns += wait_ms * 1_000_000;
                let (hand, state_n) = (hand(state), GripperState { jaws, ..gripper(before_n) });
                let told = match by_task {
                    true => guard.hold(now_ns, &hand, &state_n, wanted_n),
                    false => guard.decide(now_ns, &hand, &state_n),
                };
                prop_assert!((limits.least_n..=limits.most_n).contains(&told.force_n), "{told:?}");
                prop_assert_eq!(told.force_n, guard.force_n());
                let sees = state != SlipState::Unjudged;
                blind_ms = if sees || i == 0 { 0 } else { blind_ms + wait_ms };
                let is_gone = matches!(jaws, Jaws::Lost | Jaws::Nothing | Jaws::Stopped);
                if !sees || is_gone {
                    prop_assert!(told.force_n >= before_n, "it fell from {before_n} N to {} N", told.force_n);
                }
                prop_assert_eq!(guard.is_blind(), !sees && blind_ms >= 90);
                if guard.is_blind() || is_gone {
                    prop_assert_eq!(told.arm, ArmMotion::Pause);
                }
                before_n = told.force_n;
            }
        }
    }
}
