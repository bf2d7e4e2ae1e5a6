//! Commands of a control law to gripper and arm, frame by frame, for rows of frames drawn by a test.

mod synthetic;

use slipbound::grip::{ArmMotion, GripController, GripDecision, GripLimits, Law, MarginSettings, OnSlipSettings};
use slipbound::hand::{HandReport, Health};
use slipbound::monitor::SlipState;
use slipbound::port::{GripperState, Jaws};
use synthetic::{FRAME_NS, gripper, hand};

fn starting_with(start_n: f64) -> GripLimits {
    let mut limits = GripLimits::default();
    limits.start_n = start_n;
    limits
}

/// When the arm waits, `#`, and when it moves, `.`.
fn waits(told: &[GripDecision]) -> String {
    told.iter().map(|told| if told.arm == ArmMotion::Go { '.' } else { '#' }).collect()
}

/// Commands of a law every 33 ms to a gripper that follows at once (or always reads `pressed_n`); the number of
/// alarms, and whether it wants more than the maximum force.
fn told_by(
    law: Law,
    limits: GripLimits,
    hands: &[HandReport],
    pressed_n: Option<f64>,
) -> (Vec<GripDecision>, u32, bool) {
    let mut controller = law.controller(&limits).expect("valid");
    let mut force_n = limits.start_n;
    let step = |(i, hand): (usize, &HandReport)| {
        let state = GripperState { target_n: Some(force_n), ..gripper(pressed_n.unwrap_or(force_n)) };
        let told = controller.decide(i as u64 * FRAME_NS, hand, &state);
        force_n = told.force_n;
        told
    };
    let told = hands.iter().enumerate().map(step).collect();
    (told, controller.alarms_count(), controller.wants_more())
}

/// A row of frames: `.` stick, `x` incipient slip, `X` gross slip, `?` unsure.
fn hands(row: &str) -> Vec<HandReport> {
    let state = |shown| match shown {
        'x' => SlipState::Incipient,
        'X' => SlipState::Gross,
        '?' => SlipState::Unsure,
        _ => SlipState::Stick,
    };
    row.chars().map(|shown| hand(state(shown))).collect()
}

#[test]
fn slip_at_the_largest_force_wants_more_and_slip_at_the_least_of_a_loosening_law_does_not() {
    let gripping = Law::OnSlip(OnSlipSettings::default());
    let loosening = Law::OnSlip(OnSlipSettings::default().with_step_n(-20.0));
    for (law, start_n, row, alarms_count, wants_more) in [
        (gripping, 50.0, "xx........", 1, false),
        (gripping, 50.0, "x........X", 2, true),
        (gripping, 60.0, "..X.......", 1, true),
        (gripping, 60.0, "..........", 0, false),
        (loosening, 5.0, "..x.......", 1, false),
    ] {
        let limits = starting_with(start_n);
        let (_, count, wants) = told_by(law, limits, &hands(row), None);
        assert_eq!((count, wants), (alarms_count, wants_more), "{law:?} from {start_n} N: {row}");
    }
}

/// Within 0.2 s after an alarm it is the same slip; the seventh frame of 33.3 ms is later than that.
#[test]
fn slip_that_goes_on_is_the_next_alarm_after_a_fifth_of_a_second() {
    let law = Law::OnSlip(OnSlipSettings::default());
    let (told, count, _) = told_by(law, GripLimits::default(), &hands("xxxxxxxx"), None);
    let forces: Vec<f64> = told.iter().map(|told| told.force_n).collect();
    assert_eq!((forces, count), (vec![20.0, 20.0, 20.0, 20.0, 20.0, 20.0, 20.0, 30.0], 2));
}

#[test]
fn a_gripper_that_never_presses_as_told_stops_the_arm_for_a_second_and_not_for_ever() {
    let law = Law::OnSlip(OnSlipSettings::default());
    let row = format!("x{}", ".".repeat(39));
    let (told, ..) = told_by(law, GripLimits::default(), &hands(&row), Some(10.0));
    assert_eq!(waits(&told), format!("{}{}", "#".repeat(31), ".".repeat(9)), "30 frames are a hair less than 1 s");
}

/// A contact that used 0.4 of the friction when last judged becomes unsure: 10 N/s, from 10 N to at most 15 N, until the
/// next slip.
#[test]
fn what_was_loaded_and_cannot_be_judged_is_gripped_harder_within_bounds() {
    let settings = OnSlipSettings::default();
    let forces = |settings: OnSlipSettings, last: Option<f64>, unsure: Option<f64>, row: &str| -> Vec<f64> {
        let mut hands = hands(row);
        for hand in &mut hands {
            hand.margin = if hand.state == SlipState::Unsure { unsure } else { last };
        }
        told_by(Law::OnSlip(settings), GripLimits::default(), &hands, None).0.iter().map(|told| told.force_n).collect()
    };
    let row = format!("...{}..{}x......{}", "?".repeat(20), "?".repeat(5), "?".repeat(60));
    let risen = forces(settings, Some(0.6), None, &row);
    let near = |at: usize, n: f64| assert!((risen[at] - n).abs() < 0.02, "frame {at}: {} for {n} N", risen[at]);
    for (at, n) in
        [(2, 10.0), (3, 10.33), (11, 13.0), (22, 15.0), (29, 15.0), (30, 25.0), (36, 25.0), (37, 25.33), (96, 37.5)]
    {
        near(at, n);
    }
    let kept = |settings, last, unsure| forces(settings, last, unsure, "...????????").iter().all(|n| *n == 10.0);
    assert!(!kept(settings, Some(0.6), Some(0.45)), "a margin from images alone that shows a slip");
    assert!(kept(settings, Some(0.6), Some(0.55)), "and one that shows none");
    assert!(kept(settings, Some(0.85), None), "hardly loaded");
    assert!(kept(settings, None, None), "never judged");
    let mut never = settings;
    never.unsure_n_per_s = 0.0;
    assert!(kept(never, Some(0.6), None) && kept(settings.with_step_n(-5.0), Some(0.6), None));
}

/// `_`: no contact, and in it the left finger live or not.
fn forces_without_margin_while_unsure(law: Law, row: &str, left: Health) -> Vec<f64> {
    let mut hands = hands(row);
    for (hand, sign) in hands.iter_mut().zip(row.chars()) {
        hand.margin = (sign == '.').then_some(0.6);
        if sign == '_' {
            hand.state = SlipState::NoContact;
            hand.health[0] = left;
        }
    }
    told_by(law, GripLimits::default(), &hands, None).0.iter().map(|told| told.force_n).collect()
}

#[test]
fn a_load_of_an_earlier_contact_counts_no_longer_unless_a_finger_that_feels_it_is_missed() {
    for law in [Law::OnSlip(OnSlipSettings::default()), margin_law()] {
        let lost = forces_without_margin_while_unsure(law, "...?_????", Health::Live);
        assert!((lost[3] - lost[2] - 0.33).abs() < 0.02, "{law:?} {lost:?}");
        assert_eq!(lost[8], lost[3], "{law:?} {lost:?}");
        let missed = forces_without_margin_while_unsure(law, "...?_????", Health::Blind);
        assert!((missed[8] - lost[8] - 1.33).abs() < 0.02, "{law:?} {missed:?}");
    }
}

/// The force of this law never falls: a bound that began anew with every contact would be none.
#[test]
fn contacts_that_come_and_go_raise_the_grip_no_further() {
    let row = format!("...{}_", "?".repeat(60)).repeat(5);
    let risen = forces_without_margin_while_unsure(Law::OnSlip(OnSlipSettings::default()), &row, Health::Live);
    assert!((risen[60] - 15.0).abs() < 1e-9 && risen[60] == risen[row.len() - 1], "{risen:?}");
}

#[test]
fn a_poor_margin_of_an_unsure_frame_does_not_replace_the_one_that_was_judged() {
    let mut hands = hands("...????");
    for (hand, margin) in hands.iter_mut().zip([Some(0.6), Some(0.6), Some(0.6), Some(0.85), None, None, None]) {
        hand.margin = margin;
    }
    let (told, ..) = told_by(Law::OnSlip(OnSlipSettings::default()), GripLimits::default(), &hands, None);
    assert!(told[3].force_n == 10.0 && (told[6].force_n - 11.0).abs() < 0.02, "{told:?}");
    // The same for the other law, whose gripper falls silent on its force.
    let mut controller = margin_law().controller(&GripLimits::default()).expect("valid");
    let untold = GripperState { force_n: None, target_n: None, ..gripper(0.0) };
    let step = |(i, hand): (usize, &HandReport)| {
        controller.decide(i as u64 * FRAME_NS, hand, &if i < 3 { gripper(10.0) } else { untold }).force_n
    };
    let told: Vec<f64> = hands.iter().enumerate().map(step).collect();
    assert!(told[6] - told[3] > 0.9, "{told:?}");
    let never_judged = with_margin(self::hands("????"), 0.7);
    let (told, ..) = told_by(margin_law(), GripLimits::default(), &never_judged, Some(0.0));
    assert!(told.iter().all(|told| told.force_n == 10.0), "{told:?}");
}

fn margin_law() -> Law {
    Law::Margin(MarginSettings::default().with_stiffness_mpa_per_mm(0.05))
}

/// The same frames with a margin.
fn with_margin(hands: Vec<HandReport>, margin: f64) -> Vec<HandReport> {
    hands.into_iter().map(|hand| HandReport { margin: Some(margin), ..hand }).collect()
}

#[test]
fn one_frame_counts_alone_only_where_little_is_left() {
    // 10 N at a constant 62 %; then a single frame reports 79 or 81 %.
    let raised_n = |used: f64| {
        let mut hands = with_margin(hands(&".".repeat(30)), 0.38);
        hands.push(HandReport { margin: Some(1.0 - used), ..hand(SlipState::Stick) });
        let (told, ..) = told_by(margin_law(), GripLimits::default(), &hands, Some(10.0));
        told[30].force_n - told[29].force_n
    };
    // An average over 100 ms passes 28 % of a step within 33 ms.
    let average_n = (1.0 - (-1.0f64 / 3.0).exp()) * 1.7 / 0.62;
    assert!((raised_n(0.79) - average_n).abs() < 1e-3, "{} N for {average_n} N", raised_n(0.79));
    assert!((raised_n(0.81) - 1.9 / 0.62).abs() < 1e-3, "{} N for all of it", raised_n(0.81));
}

#[test]
fn an_object_that_slides_uses_all_there_is_whatever_the_margin_says() {
    for margin in [None, Some(0.9), Some(0.0)] {
        let slides = HandReport { margin, ..hand(SlipState::Gross) };
        // It slides at 10 N: 10 N over 62 % would hold it; the rate limit of 120 N a second allows it.
        let (told, count, wants) =
            told_by(margin_law(), GripLimits::default(), &[hand(SlipState::Stick), slides, slides], Some(10.0));
        let forces: Vec<f64> = told.iter().map(|told| told.force_n).collect();
        assert!((forces[1] - 14.0).abs() < 1e-3 && (forces[2] - 10.0 / 0.62).abs() < 1e-3, "{margin:?}: {forces:?}");
        assert_eq!((count, wants), (1, false), "one slide, and more force to be had");
    }
    let slip = with_margin(hands(".xx.x"), 0.0);
    let limits = starting_with(60.0);
    let (_, count, wants) = told_by(margin_law(), limits, &slip, None);
    assert_eq!((count, wants), (2, true), "slip that comes again counts again, and 60 N are the most");
    let (_, count, wants) = told_by(margin_law(), limits, &with_margin(hands("....."), 0.0), None);
    assert_eq!((count, wants), (0, false), "no slip");
}

#[test]
fn the_arm_waits_while_the_grip_is_behind_the_load() {
    // The gripper always exerts 10 N; the used fraction of it, and whether the arm waits once 12 N or more were
    // commanded.
    for (used, picture) in [(0.73, "......"), (0.765, "......"), (0.775, ".#####"), (0.95, ".#####")] {
        let (told, ..) =
            told_by(margin_law(), GripLimits::default(), &with_margin(hands("......"), 1.0 - used), Some(10.0));
        assert_eq!(waits(&told), picture, "{used}: {told:?}");
    }
}

/// 10 N/s, from 10 N to at most 15 N: how much is missing is not known.
#[test]
fn a_grip_whose_force_is_unknown_rises_slowly_while_too_much_is_used_and_stays_otherwise() {
    let risen = |hands: &[HandReport]| {
        let mut controller = margin_law().controller(&GripLimits::default()).expect("valid");
        let untold = GripperState { force_n: None, target_n: None, ..gripper(0.0) };
        let step = |(i, hand)| controller.decide(i as u64 * FRAME_NS, hand, &untold);
        let told: Vec<GripDecision> = hands.iter().enumerate().map(step).collect();
        assert!(told.iter().all(|told| told.arm == ArmMotion::Go), "{told:?}");
        (told[3].force_n - 10.0, told[told.len() - 1].force_n)
    };
    let with = |row: &str, margin| with_margin(hands(row), margin);
    // Of the friction 0.5 a target of 0.62 is used.
    for (row, margin) in [("....................", 0.1), ("xxxxxxxxxxxxxxxxxxxx", 0.3)] {
        let (by_n, last_n) = risen(&with(row, margin));
        assert!((by_n - 1.0).abs() < 0.01 && last_n == 15.0, "{row} {margin}: {by_n} N, then {last_n} N");
    }
    assert_eq!(risen(&with("xxxxxxxxxxxxxxxxxxxx", 0.42)), (0.0, 10.0), "what is used is within the target");
    let unsure = [with("x", 0.42), hands("???????????????????")].concat();
    assert_eq!(risen(&unsure).1, 15.0, "a contact that was loaded when the force was unknown, too");
}

/// A command that has stood for a second counts as reached, and is answered by one step of 4 N; it is no reading, so the
/// slow rise does not begin anew at its end.
#[test]
fn a_reading_of_no_force_begins_no_second_rise_and_a_grip_that_may_not_let_go_stays() {
    let loaded = with_margin(hands(&".".repeat(71)), 0.1);
    for pressed_n in [0.0, -1.0] {
        let (told, ..) = told_by(margin_law(), GripLimits::default(), &loaded, Some(pressed_n));
        assert!(told[..46].iter().all(|told| told.arm == ArmMotion::Go), "{pressed_n} N: {told:?}");
        for (frame, force_n) in [(3, 11.0), (16, 15.0), (44, 15.0), (50, 19.0), (70, 19.0)] {
            assert!((told[frame].force_n - force_n).abs() < 0.01, "{pressed_n} N, frame {frame}: {told:?}");
        }
    }
    let mut settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    settings.release_n_per_s = 0.0;
    let idle = with_margin(hands(&".".repeat(60)), 0.95);
    let (told, ..) = told_by(Law::Margin(settings), GripLimits::default(), &idle, None);
    assert!(told.iter().all(|told| told.force_n == 10.0), "{told:?}");
}

#[test]
fn the_margin_that_is_told_is_that_of_the_least_force_that_holds() {
    let mut controller = margin_law().controller(&GripLimits::default()).expect("valid");
    assert_eq!(controller.margin(), None);
    let stands = HandReport { margin: Some(0.4), ..hand(SlipState::Stick) };
    controller.decide(0, &stands, &gripper(10.0));
    assert!((controller.margin().expect("known") - 0.4).abs() < 1e-12);
    // The hand still reports 40 % at twice the force: the load doubled, and the average lags.
    controller.decide(FRAME_NS, &stands, &gripper(20.0));
    let average_n = 6.0 + (1.0 - (-1.0f64 / 3.0).exp()) * 6.0;
    assert!((controller.margin().expect("known") - (1.0 - average_n / 20.0)).abs() < 1e-6);
}

/// A blind hand uses the blind force only where something may be held.
#[test]
fn a_blind_hand_whose_jaws_are_open_or_closing_is_told_no_more() {
    for (jaws, force_n) in
        [(Jaws::Open, 10.0), (Jaws::Closing, 10.0), (Jaws::Holding, 30.0), (Jaws::Unknown, 30.0), (Jaws::Stopped, 30.0)]
    {
        let limits = GripLimits::default().with_blind_force_n(Some(30.0));
        let mut controller = Law::Constant.controller(&limits).expect("valid");
        let state = GripperState { jaws, ..gripper(10.0) };
        let told: Vec<f64> =
            (0..6).map(|i| controller.decide(i * FRAME_NS, &hand(SlipState::Unjudged), &state).force_n).collect();
        assert_eq!(told, [10.0, 10.0, 10.0, force_n, force_n, force_n], "{jaws:?}");
    }
}
