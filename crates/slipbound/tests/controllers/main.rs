//! Controllers against synthetic hand reports: the paper's law, the margin, the limits that nothing bypasses.

mod margin;
#[path = "../synthetic/mod.rs"]
mod synthetic;

use slipbound::grip::{
    ArmMotion, GripController, GripDecision, GripLimits, Guard, Law, MarginSettings, OnSlipSettings,
};
use slipbound::hand::HandReport;
use slipbound::monitor::SlipState;
use slipbound::port::{GripperState, Jaws};
use slipbound::task::TaskSettings;
use synthetic::{FRAME_NS, gripper, hand};

/// Runs a controller over hand reports, with a gripper that follows at once; returns the commands.
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

/// Slow jaws have reached 52 of the commanded 60 N when it slips again: 60 N may still hold.
#[test]
fn slip_before_the_largest_force_has_arrived_asks_for_no_more() {
    let margin = Law::Margin(MarginSettings::default().with_stiffness_mpa_per_mm(0.05));
    for law in [Law::OnSlip(OnSlipSettings::default()), margin] {
        let limits = GripLimits::default().with_forces_n(10.0, 5.0, 60.0);
        let mut controller = law.controller(&limits).expect("valid");
        let slides = HandReport { margin: Some(0.0), ..hand(SlipState::Gross) };
        let mut now_ns = 0;
        let mut step = |pressed_n: f64| {
            now_ns += 400_000_000;
            let told = controller.decide(now_ns, &slides, &gripper(pressed_n));
            (told.force_n, controller.wants_more())
        };
        for _ in 0..40 {
            assert!(!step(52.0).1, "{law:?}");
        }
        assert_eq!(step(52.0), (60.0, false), "{law:?}");
        step(60.0);
        assert_eq!(step(60.0), (60.0, true), "{law:?}: it slips at the largest force");
    }
}

#[test]
fn one_slip_seen_in_several_frames_is_one_alarm() {
    let slip = hand(SlipState::Incipient);
    let told = commands(Law::OnSlip(OnSlipSettings::default()), GripLimits::default(), &[slip; 6]);
    assert_eq!(told.last().expect("commands").force_n, 20.0);
}

#[test]
fn the_decreasing_law_loosens_down_to_the_least() {
    let settings = OnSlipSettings::default().with_step_n(-2.0);
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
        (Law::Margin(MarginSettings::default().with_stiffness_mpa_per_mm(0.05)), Some(30.0)),
    ] {
        let limits = GripLimits::default().with_blind_force_n(blind_force_n);
        let mut hands = vec![hand(SlipState::Stick); 3];
        hands.extend([hand(SlipState::Unjudged); 6]);
        let told = commands(law, limits, &hands);
        let picture: String = told.iter().map(|c| if c.arm == ArmMotion::Go { '.' } else { '#' }).collect();
        assert_eq!(picture, ".....####", "{law:?}");
        assert_eq!(told[8].force_n, blind_force_n.unwrap_or(10.0), "{law:?}");
    }
}

#[test]
fn a_force_raised_while_blind_comes_down_slowly_and_only_while_nothing_slips() {
    let limits = GripLimits::default().with_blind_force_n(Some(30.0));
    let states = |seen: &[(SlipState, usize)]| -> Vec<HandReport> {
        seen.iter().flat_map(|&(state, count)| std::iter::repeat_n(hand(state), count)).collect()
    };
    let forces = |law: Law, after: &[(SlipState, usize)]| -> Vec<f64> {
        let hands = states(&[&[(SlipState::Stick, 3), (SlipState::Unjudged, 6)], after].concat());
        commands(law, limits, &hands)[8..].iter().map(|told| told.force_n).collect()
    };
    let cycle_s = 1.0 / 30.0;
    for law in [Law::Constant, Law::OnSlip(OnSlipSettings::default())] {
        // 5 N/s: 20 N in four seconds.
        let told = forces(law, &[(SlipState::Stick, 150)]);
        assert_eq!(told[0], 30.0, "{law:?}");
        for pair in told.windows(2) {
            assert!(pair[0] - pair[1] <= 5.0 * cycle_s + 1e-3, "{law:?}: from {} to {} N", pair[0], pair[1]);
        }
        assert!((told[60] - 20.0).abs() < 0.2 && told[149] == 10.0, "{law:?}: {} {}", told[60], told[149]);
        for state in [SlipState::Unsure, SlipState::NoContact, SlipState::Unjudged] {
            assert!(forces(law, &[(state, 60)]).iter().all(|n| *n == 30.0), "{law:?} {state:?}");
        }
    }
    let steps = forces(Law::OnSlip(OnSlipSettings::default()), &[(SlipState::Stick, 30), (SlipState::Gross, 1)]);
    let (stood, stepped) = (steps[30], steps[31]);
    assert!((stood - 25.0).abs() < 0.2 && (stepped - stood - 10.0).abs() < 0.2, "{stood} {stepped}: a step from there");
}

/// A gripper that refuses to lower its force holds with 30 N. `states`: what the hand reports from then on, and the
/// margin.
fn commands_from_30_n(law: Law, states: &[(SlipState, f64)]) -> Vec<f64> {
    let mut guard = law.controller(&GripLimits::default()).expect("valid");
    let step = |(i, &(state, margin)): (usize, &(SlipState, f64))| {
        guard.raise_to(30.0);
        guard.decide(i as u64 * FRAME_NS, &HandReport { margin: Some(margin), ..hand(state) }, &gripper(30.0)).force_n
    };
    states.iter().enumerate().map(step).collect()
}

#[test]
fn what_a_controller_adds_is_added_to_the_force_that_could_not_be_lowered() {
    let (stick, slip) = ((SlipState::Stick, 0.8), (SlipState::Incipient, 0.1));
    let told = commands_from_30_n(Law::OnSlip(OnSlipSettings::default()), &[stick, stick, slip, stick]);
    assert!((29.5..=30.0).contains(&told[1]), "lowered slowly, and refused each time: {told:?}");
    assert!((told[2] - 40.0).abs() < 0.5, "a step of 10 N: {told:?}");
    assert!(commands_from_30_n(Law::Constant, &[stick, slip]).iter().all(|n| (29.5..=30.0).contains(n)));
    // It wants 10 N, and later half as much again as the gripper has: what it has counts.
    let margin = Law::Margin(MarginSettings::default().with_stiffness_mpa_per_mm(0.05));
    let told = commands_from_30_n(margin, &[[stick; 5], [(SlipState::Stick, 0.1); 5]].concat());
    assert!(told[..5].iter().all(|n| (29.0..=30.0).contains(n)), "{told:?}");
    assert!((31.0..36.0).contains(&told[5]), "120 N/s from there: {told:?}");
}

/// Blind for a moment, so that the force is raised to 30 N, which the gripper then refuses to lower.
#[test]
fn a_force_raised_while_blind_is_still_lowered_slowly_when_the_gripper_has_refused() {
    let limits = GripLimits::default().with_blind_force_n(Some(30.0));
    let law = Law::Margin(MarginSettings::default().with_stiffness_mpa_per_mm(0.05));
    let mut guard = law.controller(&limits).expect("valid");
    let (mut now_ns, mut force_n) = (0, 10.0);
    let mut step = |state, margin| {
        now_ns += FRAME_NS;
        let hand = HandReport { margin: Some(margin), ..hand(state) };
        let wanted_n = guard.decide(now_ns, &hand, &gripper(force_n)).force_n;
        if wanted_n < force_n {
            guard.raise_to(force_n);
        }
        force_n = force_n.max(wanted_n);
        (force_n, guard.is_raised())
    };
    (0..3).for_each(|_| _ = step(SlipState::Stick, 0.8));
    let blind_n = (0..6).map(|_| step(SlipState::Unjudged, 0.8)).last();
    let kept_n = (0..6).map(|_| step(SlipState::Stick, 0.8)).last();
    assert_eq!((blind_n, kept_n), (Some((30.0, true)), Some((30.0, true))), "and is lowered slowly");
    let (raised_n, _) = step(SlipState::Stick, 0.1);
    assert!((31.0..36.0).contains(&raised_n), "120 N/s from 30 N: {raised_n}");
}

/// What the gripper held with 30 N when the fingers began to see: no margin of theirs knows the load it has already.
#[test]
fn a_force_that_may_not_be_lowered_is_only_raised_until_nothing_is_held() {
    let margin = Law::Margin(MarginSettings::default().with_stiffness_mpa_per_mm(0.05));
    for (law, slip_adds_n) in [(Law::Constant, 0.0), (Law::OnSlip(OnSlipSettings::default()), 10.0), (margin, 4.0)] {
        let mut guard = law.controller(&GripLimits::default()).expect("valid");
        guard.raise_to(30.0);
        guard.never_lower();
        let (mut now_ns, mut force_n) = (0, 30.0);
        let mut step = |state, margin, jaws, count| {
            for _ in 0..count {
                now_ns += FRAME_NS;
                let hand = HandReport { margin: Some(margin), ..hand(state) };
                force_n = guard.decide(now_ns, &hand, &GripperState { jaws, ..gripper(force_n) }).force_n;
            }
            force_n
        };
        assert_eq!(step(SlipState::Stick, 0.99, Jaws::Holding, 300), 30.0, "{law:?}: ten seconds");
        assert_eq!(step(SlipState::NoContact, 0.99, Jaws::Holding, 30), 30.0, "{law:?}: not felt for a second");
        let raised_n = step(SlipState::Gross, -1.0, Jaws::Holding, 1);
        assert!((raised_n - 30.0 - slip_adds_n).abs() < 1e-3, "{law:?}: {raised_n} N");
        assert_eq!(step(SlipState::Stick, 0.99, Jaws::Holding, 300), raised_n, "{law:?}");
        step(SlipState::NoContact, 0.99, Jaws::Open, 1);
        assert!(step(SlipState::Stick, 0.99, Jaws::Holding, 90) < raised_n - 10.0, "{law:?}: another object");
    }
}

#[test]
fn a_lower_force_or_none_is_not_the_one_kept() {
    let mut guard = Law::Constant.controller(&GripLimits::default()).expect("valid");
    for (kept_n, expected_n) in [(8.0, 10.0), (f64::NAN, 10.0), (90.0, 60.0), (20.0, 60.0)] {
        guard.raise_to(kept_n);
        assert_eq!(guard.force_n(), expected_n, "{kept_n}");
    }
    assert!(guard.is_raised());
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

/// A controller that outputs arbitrary forces.
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
    with(|s| s.margin.slippery_target_fraction = 0.77, "margin.slippery_target_fraction");
    with(|s| s.margin.cut_target_share = f64::NAN, "margin.cut_target_share");
    with(|s| s.screw.rate_rad_per_s = 0.0, "screw.rate_rad_per_s");
    with(|s| s.unscrew.open_rad = -1.0, "unscrew.open_rad");
    with(|s| s.place.laying_mm_per_s = 0.1, "place.laying_mm_per_s");
    with(|s| s.lift.lift_mm = f64::NAN, "lift.lift_mm");
    for (settings, key) in cases {
        assert_eq!(settings.check().expect_err(key).key, key);
    }
}

/// A loop whose gripper is not linked does not step its task.
#[test]
fn a_force_that_was_raised_while_blind_comes_down_slowly_after_a_gap_too() {
    let limits = GripLimits::default().with_blind_force_n(Some(50.0));
    let mut guard = Guard::new(Box::new(Mad(vec![10.0; 90].into_iter())), limits);
    let mut force_n = 10.0;
    for ms in (0..400u64).step_by(33).chain([9000, 9033, 9066]) {
        let state = if ms < 400 { SlipState::Unjudged } else { SlipState::Stick };
        force_n = guard.decide(ms * 1_000_000, &hand(state), &gripper(force_n)).force_n;
    }
    assert!((48.9..50.0).contains(&force_n), "5 N/s for three cycles: {force_n}");
}

/// The frames of a gap were judged, but the guard was not asked. A hand that goes on without sight is blind, at a slow
/// loop too.
#[test]
fn one_frame_without_sight_after_a_gap_is_no_blindness() {
    use SlipState::{Stick, Unjudged};
    let limits = GripLimits::default().with_blind_force_n(Some(50.0));
    for (seen, expected) in [
        (&[(0, Stick), (5000, Unjudged), (5033, Stick)][..], [(10.0, false), (10.0, false), (10.0, false)]),
        (&[(0, Stick), (5000, Unjudged), (5066, Unjudged)], [(10.0, false), (10.0, false), (50.0, true)]),
        (&[(0, Stick), (333, Unjudged), (666, Unjudged)], [(10.0, false), (10.0, false), (50.0, true)]),
        (&[(0, Unjudged), (100, Unjudged), (5000, Unjudged)], [(10.0, false), (50.0, true), (50.0, true)]),
    ] {
        let mut guard = Law::Constant.controller(&limits).expect("valid");
        for (&(ms, state), expected) in seen.iter().zip(expected) {
            let told = guard.decide(ms * 1_000_000, &hand(state), &gripper(10.0));
            assert_eq!((told.force_n, guard.is_blind()), expected, "{seen:?} at {ms} ms");
        }
    }
}

/// A grip from an earlier run, which the gripper refuses to lower: it has what a step asks for already. A step on top of
/// it is waited for.
#[test]
fn a_force_above_the_one_of_the_step_is_not_waited_for() {
    for (raised_n, told_n, pause_cycles_count) in [(30.0, 40.0, 3), (40.0, 50.0, 13)] {
        let mut guard = Law::OnSlip(OnSlipSettings::default()).controller(&GripLimits::default()).expect("valid");
        guard.raise_to(raised_n);
        let told = |cycle: u64| {
            let state = hand(if cycle == 0 { SlipState::Incipient } else { SlipState::Stick });
            // It has 40 N, and reaches the force of the step after a third of a second.
            let force_n = Some(if cycle < 11 { 40.0 } else { told_n });
            let gripper =
                GripperState { target_n: Some(if cycle == 0 { 40.0 } else { told_n }), force_n, ..gripper(0.0) };
            guard.decide(cycle * FRAME_NS, &state, &gripper)
        };
        let told: Vec<GripDecision> = (0..30).map(told).collect();
        assert!((told[0].force_n - told_n).abs() < 0.5, "{told:?}");
        let goes = told.iter().position(|told| told.arm == ArmMotion::Go).expect("it goes on");
        assert!((pause_cycles_count..pause_cycles_count + 3).contains(&goes), "{raised_n} N: {goes}");
    }
}

/// Arbitrary hand reports, grippers, controllers and task forces.
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
            let limits = GripLimits::default().with_blind_force_n(blind_force_n);
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
