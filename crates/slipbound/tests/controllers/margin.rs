//! The controller that holds the load with a margin.

use crate::commands;
use crate::synthetic::{FRAME_NS, gripper, hand};
use slipbound::grip::{GripController, GripLimits, Guard, Law, MarginSettings};
use slipbound::hand::HandReport;
use slipbound::monitor::SlipState;
use slipbound::port::GripperState;
use slipbound::task::{ControllerKind, TaskKind, TaskSettings};

/// Commanded forces for a load that would make the object slide at 6.1 N for 30 frames, at 18.3 N for 60, at 2.44 N for
/// 90: with a target of 62 % it holds them with 9.8, 29.5 and 5 N, the least force of the limits.
fn told_n(settings: MarginSettings) -> Vec<f64> {
    let mut controller = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
    let mut told = vec![10.0];
    for (slides_at_n, frames) in [(6.1, 30), (18.3, 60), (2.44, 90)] {
        for _ in 0..frames {
            let force_n = told[told.len() - 1];
            let hand = HandReport { margin: Some(1.0 - slides_at_n / force_n), ..hand(SlipState::Stick) };
            told.push(controller.decide(told.len() as u64 * FRAME_NS, &hand, &gripper(force_n)).force_n);
        }
    }
    told
}

#[test]
fn a_margin_follows_the_load_at_once_and_lets_go_slowly() {
    let mut settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    settings.release_excess_per_s = 0.0;
    let told = told_n(settings);
    assert!((told[30] - 10.0).abs() < 0.1, "held at its target: {}", told[30]);
    assert!((told[90] - 30.0).abs() < 0.5, "18.3 N over 0.61: {}", told[90]);
    assert!(told[35] > 25.0, "within five frames: {}", told[35]);
    let fall_n = told[101] - told[131];
    assert!((fall_n - 5.0).abs() < 0.1, "5 N a second, not {fall_n} N in 1 s");
    assert!(told.iter().all(|n| (5.0..=60.0).contains(n)));
}

#[test]
fn many_times_what_is_needed_is_let_go_faster_but_not_all_of_it() {
    let told = told_n(MarginSettings::default().with_stiffness_mpa_per_mm(0.05));
    // 6 N are one and a half times what is wanted: from 30 N on the excess falls by a factor e in a quarter of a second.
    assert!(told[110] < 6.0 + 24.0 * 0.2, "after 0.67 s: {}", told[110]);
    assert!(told[105] > 8.0, "after half a second: {}", told[105]);
    let (last_n, before_n) = (told[125], told[124]);
    assert!((before_n - last_n - 5.0 / 30.0).abs() < 0.02, "then slowly: {before_n} to {last_n}");
}

#[test]
fn as_much_is_let_go_in_a_second_at_every_rate_of_the_loop() {
    let settings = MarginSettings::default();
    let left_n =
        |rate_hz: u32| (0..rate_hz / 10).fold(50.0, |n, _| n - settings.release_n(n, 10.0, 1.0 / f64::from(rate_hz)));
    for rate_hz in [10, 30, 100, 240] {
        assert!((left_n(rate_hz) - (15.0 + 35.0 * libm::exp(-0.4))).abs() < 1e-9, "{rate_hz} Hz: {}", left_n(rate_hz));
    }
}

#[test]
fn the_more_slippery_the_more_is_held_in_reserve() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    // 13 N hold it; the final force of a grip that starts at 10 N.
    let holds_n = |friction: Option<f64>| {
        let mut controller = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
        (0..90).fold(10.0, |force_n, frame| {
            let hand = HandReport { margin: Some(1.0 - 13.0 / force_n), friction, ..hand(SlipState::Stick) };
            controller.decide(frame * FRAME_NS, &hand, &gripper(force_n)).force_n
        })
    };
    for (friction, used) in [(None, 0.55), (Some(0.2), 0.55), (Some(0.3), 0.55), (Some(0.6), 0.655), (Some(1.2), 0.76)]
    {
        assert!((holds_n(friction) - 13.0 / used).abs() < 0.1, "{friction:?}: {}", holds_n(friction));
    }
}

/// 7 N need 12.7 N at a used fraction of 0.55; a higher grip is lowered only to 14 N, a used fraction of 0.5.
#[test]
fn a_grip_that_is_a_little_firmer_than_it_need_be_is_left_alone() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    let ends_at_n = |first_load_n: f64| {
        let mut controller = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
        (0..600).fold(10.0, |force_n, frame| {
            let load_n = if frame < 300 { first_load_n } else { 7.0 };
            let hand = HandReport { margin: Some(1.0 - load_n / force_n), friction: None, ..hand(SlipState::Stick) };
            controller.decide(frame * FRAME_NS, &hand, &gripper(force_n)).force_n
        })
    };
    for (first_load_n, expected_n) in [(7.5, 7.5 / 0.55), (8.0, 7.0 / 0.5)] {
        let ends_n = ends_at_n(first_load_n);
        assert!((ends_n - expected_n).abs() < 0.15, "{first_load_n} N first: {ends_n} for {expected_n}");
    }
}

#[test]
fn nothing_is_let_go_while_the_load_grows() {
    // 10 N hold 1 N: far too much. Then the load grows by 1 N/s while the used fraction stays low for long.
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    let hands = |growth_per_s: f64| -> Vec<HandReport> {
        let used = |i: u32| 0.2 + growth_per_s * f64::from(i) / 30.0;
        (0..60).map(|i| HandReport { margin: Some(1.0 - used(i)), ..hand(SlipState::Stick) }).collect()
    };
    let last_n = |growth| {
        let told = commands(Law::Margin(settings), GripLimits::default(), &hands(growth));
        (told[15].force_n, told[59].force_n)
    };
    let (before_n, after_n) = last_n(0.0);
    assert!(after_n < before_n - 2.0, "a load that stands: {before_n} to {after_n}");
    let (before_n, after_n) = last_n(0.1);
    assert_eq!(after_n, before_n, "one that grows");
}

#[test]
fn a_loaded_contact_that_cannot_be_judged_is_gripped_harder_within_bounds_and_one_that_nobody_sees_is_not() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
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
fn a_contact_that_the_view_cuts_is_held_with_more_in_reserve_and_nothing_of_it_is_let_go_under_a_load() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    // The estimated required force is 7 N; the final force of a grip that starts at this force.
    let holds_n = |cut_fraction: f64, begins_n: f64| {
        let mut controller = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
        (0..300).fold(begins_n, |force_n, frame| {
            let margin = Some(1.0 - 7.0 / force_n);
            let hand = HandReport { margin, cut_fraction, friction: None, ..hand(SlipState::Stick) };
            controller.decide(frame * FRAME_NS, &hand, &gripper(force_n)).force_n
        })
    };
    for (cut_fraction, used) in [(0.0, 0.55), (0.05, 0.55), (0.1, 0.4675), (0.15, 0.385), (0.5, 0.385)] {
        assert!(
            (holds_n(cut_fraction, 10.0) - 7.0 / used).abs() < 0.1,
            "{cut_fraction}: {}",
            holds_n(cut_fraction, 10.0)
        );
    }
    let mut trusting = settings;
    trusting.cut_target_share = 1.0;
    let mut controller = Law::Margin(trusting).controller(&GripLimits::default()).expect("valid");
    let hand_of =
        |used: f64, cut_fraction: f64| HandReport { margin: Some(1.0 - used), cut_fraction, ..hand(SlipState::Stick) };
    let told = controller.decide(0, &hand_of(0.5, 0.5), &gripper(10.0));
    assert_eq!(told.force_n, 10.0, "told to trust it");
    // From a sixth on nothing is released; below that it is.
    let last_n = |used: f64, cut_fraction: f64| {
        let mut limits = GripLimits::default();
        limits.start_n = 30.0;
        commands(Law::Margin(settings), limits, &[hand_of(used, cut_fraction); 90])[89].force_n
    };
    assert_eq!((last_n(0.17, 0.2), last_n(0.17, 0.2) > last_n(0.17, 0.0)), (30.0, true));
    assert!(last_n(0.1, 0.2) < 29.0, "{}", last_n(0.1, 0.2));
}

#[test]
fn what_has_stopped_a_slide_is_kept_until_the_load_has_fallen() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    let slides = HandReport { margin: Some(0.0), ..hand(SlipState::Gross) };
    let told_after = |first: HandReport, used: f64| {
        let mut hands = vec![HandReport { margin: Some(0.5), ..hand(SlipState::Stick) }; 10];
        hands.extend([first; 3]);
        hands.extend([HandReport { margin: Some(1.0 - used), ..hand(SlipState::Stick) }; 120]);
        let told = commands(Law::Margin(settings), GripLimits::default(), &hands);
        (told[13].force_n, told[132].force_n)
    };
    let (stopped_n, kept_n) = told_after(slides, 0.35);
    assert!(stopped_n > 13.0 && kept_n >= stopped_n, "{stopped_n} {kept_n}");
    let (stopped_n, let_go_n) = told_after(slides, 0.05);
    assert!(let_go_n < stopped_n - 3.0, "the load has fallen: {stopped_n} {let_go_n}");
    let (before_n, after_n) = told_after(HandReport { margin: Some(0.0), ..hand(SlipState::Incipient) }, 0.35);
    assert!(after_n < before_n, "nothing slid: {before_n} {after_n}");
}

#[test]
fn what_was_raised_after_a_slide_is_lowered_again_but_not_below_the_force_that_stopped_it() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    let mut controller = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
    let (mut force_n, mut told_n) = (10.0, Vec::new());
    let loads = [(SlipState::Gross, 10.0, 3), (SlipState::Stick, 6.0, 60), (SlipState::Stick, 24.0, 60)];
    for (state, slides_at_n, frames_count) in loads.into_iter().chain([(SlipState::Stick, 6.0, 150)]) {
        for _ in 0..frames_count {
            let hand = HandReport { margin: Some(1.0 - slides_at_n / force_n), ..hand(state) };
            force_n = controller.decide(told_n.len() as u64 * FRAME_NS, &hand, &gripper(force_n)).force_n;
            told_n.push(force_n);
        }
    }
    let (stopped_n, held_n, raised_n, last_n) = (told_n[2], told_n[62], told_n[122], told_n[272]);
    assert!(stopped_n > 15.0 && held_n >= stopped_n, "{stopped_n} {held_n}");
    assert!(raised_n > 1.5 * stopped_n, "{raised_n}");
    assert_eq!(last_n, stopped_n);
}

#[test]
fn a_margin_without_a_known_gel_is_refused_and_says_what_to_do() {
    let settings = TaskSettings::default().with_controller(ControllerKind::Margin);
    let error = settings.task(TaskKind::Screw, None).err().expect("refused");
    assert_eq!(error.key, "margin.stiffness_mpa_per_mm");
    assert!(error.to_string().contains("calibrate"), "{error}");
    assert!(settings.task(TaskKind::Screw, Some(0.05)).is_ok());
}

/// An object that slides below 20 N is held with 32 N. Then the fingers are blind, or the gripper is not linked, for a
/// while. Then a single frame reports a very small used fraction, and later frames are correct, with a load of only 12
/// N.
#[test]
fn after_a_gap_no_frame_alone_lets_go_and_what_is_let_go_is_let_go_slowly() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    for (gap_ms, blind) in [(0u64, false), (300, true), (600, true), (5000, true), (5000, false)] {
        let law = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
        let mut guard = Guard::new(Box::new(law), GripLimits::default());
        let (mut now_ns, mut force_n) = (0, 30.0);
        let step = |guard: &mut Guard, now_ns: &mut u64, hand: HandReport, force_n: f64| {
            *now_ns += FRAME_NS;
            guard.decide(*now_ns, &hand, &gripper(force_n)).force_n
        };
        let of_load = |load_n: f64, force_n: f64| HandReport {
            margin: Some(1.0 - load_n / force_n),
            friction: Some(0.55),
            ..hand(SlipState::Stick)
        };
        for _ in 0..120 {
            force_n = step(&mut guard, &mut now_ns, of_load(20.0, force_n), force_n);
        }
        let before_n = force_n;
        for _ in 0..gap_ms * 1_000_000 / FRAME_NS {
            now_ns += FRAME_NS;
            if blind {
                let told = guard.decide(now_ns, &hand(SlipState::Unjudged), &gripper(force_n));
                assert_eq!(told.force_n, before_n);
            }
        }
        let at = format!("{gap_ms} ms, blind {blind}: {before_n} N before");
        let light = HandReport { margin: Some(0.9), ..hand(SlipState::Stick) };
        force_n = step(&mut guard, &mut now_ns, light, force_n);
        assert!(force_n > before_n - 0.6, "{at}, {force_n} N by one frame");
        let after_n = force_n;
        for _ in 0..15 {
            force_n = step(&mut guard, &mut now_ns, of_load(12.0, force_n), force_n);
        }
        assert!(force_n > after_n - 0.55 * 5.0, "{at}, from {after_n} to {force_n} N within half a second");
        for _ in 0..240 {
            force_n = step(&mut guard, &mut now_ns, of_load(12.0, force_n), force_n);
        }
        assert!(force_n < 22.0, "{at}, {force_n} N in the end: it is let go");
    }
}

/// The finger with the smallest margin may have lost its camera, have no margin, or have a frame in every second cycle
/// only.
#[test]
fn nothing_is_let_go_while_a_finger_is_missing() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    let of = |used: f64, margins_count, live_count| HandReport {
        margin: Some(1.0 - used),
        margins_count,
        live_count,
        ..hand(SlipState::Stick)
    };
    let held_n = |frames: &[HandReport]| {
        let mut law = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
        let held = |(i, hand)| law.decide(i as u64 * FRAME_NS, hand, &gripper(20.0)).force_n;
        (0..).zip(frames).map(held).collect::<Vec<_>>()
    };
    let both = [of(0.6, 2, 2); 60];
    let stands_n = held_n(&both)[59];
    for (one, what) in [(of(0.2, 1, 1), "its camera is gone"), (of(0.2, 1, 2), "its margin is not known")] {
        let told = held_n(&[&both[..], &[one; 60]].concat());
        assert!(told[60..].iter().all(|n| (n - stands_n).abs() < 0.5), "{what}: {stands_n} N, then {:?}", &told[60..]);
        let raised = held_n(&[&both[..], &[of(0.95, 1, 1); 60]].concat());
        assert!(raised[70] > stands_n + 3.0, "{what}, more load: {stands_n} N, then {}", raised[70]);
        let back = held_n(&[&both[..], &[one; 60], &[of(0.2, 2, 2); 120]].concat());
        assert!(back[239] < stands_n - 5.0, "{what}, until both are there: {stands_n} N, then {}", back[239]);
        let anew = held_n(&[&both[..], &[hand(SlipState::NoContact); 3], &[one; 120]].concat());
        assert!(anew[182] < stands_n - 5.0, "another object, of one finger: {stands_n} N, then {}", anew[182]);
    }
    let turns: Vec<_> = (0..60).map(|i| if i % 2 == 0 { of(0.2, 1, 1) } else { of(0.6, 2, 2) }).collect();
    let told = held_n(&[&both[..], &turns].concat());
    assert!(told[60..].iter().all(|n| *n > stands_n - 0.5), "in turns: {stands_n} N, then {:?}", &told[60..]);
}

/// The gripper reads half of what it is told, or nothing: 5 N of 10 lie below what a slide at 5 N would ask for.
#[test]
fn what_slides_is_gripped_harder_whatever_the_gripper_reads() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    for reads_fraction in [Some(0.5), Some(0.3), Some(0.0), None] {
        let ends_n = |state, margin, frames: u64| {
            let mut controller = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
            (0..frames).fold(10.0, |told_n: f64, frame| {
                let force_n = reads_fraction.map(|fraction| fraction * told_n);
                let state_n = GripperState { force_n, target_n: None, ..gripper(told_n) };
                let hand = HandReport { margin, ..hand(state) };
                controller.decide(frame * FRAME_NS, &hand, &state_n).force_n
            })
        };
        for margin in [Some(0.0), Some(0.5), None] {
            let told_n = ends_n(SlipState::Gross, margin, 10);
            assert!(told_n > 40.0, "{reads_fraction:?} {margin:?}: {told_n} N after 0.3 s");
        }
        // Nine tenths are used up: no less, and more once the reading can no longer be on its way.
        let (soon_n, later_n) =
            (ends_n(SlipState::Incipient, Some(0.1), 25), ends_n(SlipState::Incipient, Some(0.1), 90));
        assert!(
            soon_n >= 10.0 && (reads_fraction.is_none() || later_n > soon_n + 5.0),
            "{reads_fraction:?}: {soon_n} {later_n}"
        );
    }
}

#[test]
fn a_reading_that_is_no_number_leaves_no_trace() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    for reading_n in [f64::INFINITY, f64::NAN, f64::NEG_INFINITY] {
        let mut controller = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
        let mut force_n = 30.0;
        for frame in 0..60 {
            let hand = HandReport { margin: Some(0.4), ..hand(SlipState::Stick) };
            let state =
                GripperState { force_n: Some(if frame == 30 { reading_n } else { force_n }), ..gripper(force_n) };
            force_n = controller.decide(frame * FRAME_NS, &hand, &state).force_n;
        }
        assert!(controller.margin().is_some_and(|margin| margin.is_finite()), "{reading_n}: {:?}", controller.margin());
    }
}

/// The command of 30 N was given in the cycle in which the link was lost, and never sent.
#[test]
fn a_command_from_before_a_gap_does_not_count_as_reached() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    let mut controller = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
    let of_load = |load_n: f64| HandReport { margin: Some(1.0 - load_n / 20.0), ..hand(SlipState::Stick) };
    let mut told_n = [0.0; 2];
    for (frame, now_ns) in (0..30).map(|frame| (frame, frame * FRAME_NS)).chain([(30, 6_000_000_000)]) {
        // The gripper keeps 20 N whatever it is told.
        let force_n = controller.decide(now_ns, &of_load(14.0), &gripper(20.0)).force_n;
        told_n = [if frame < 30 { force_n } else { told_n[0] }, force_n];
    }
    assert!(told_n[0] > 21.0, "{told_n:?}");
    assert!(told_n[1] < told_n[0] + 0.5, "{told_n:?}: half as much again is held with the 20 N");
}

/// The gripper refuses every command: it holds with 20 N, and says so, where 27 N are needed.
#[test]
fn a_command_that_the_gripper_does_not_accept_never_counts_as_reached() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    let mut controller = Law::Margin(settings).controller(&GripLimits::default()).expect("valid");
    let hand = HandReport { margin: Some(0.15), ..hand(SlipState::Stick) };
    let told_n = (0..300).map(|frame| controller.decide(frame * FRAME_NS, &hand, &gripper(20.0)).force_n);
    assert!(told_n.fold(0.0, f64::max) < 28.0, "17 N over 0.62 are 27.4 N");
}

/// It tells which force it has accepted, but measures none.
#[test]
fn a_gripper_that_measures_no_force_is_never_lowered() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    let mut limits = GripLimits::default();
    limits.start_n = 30.0;
    let mut controller = Law::Margin(settings).controller(&limits).expect("valid");
    let told_n = |(frame, used): (u64, f64)| {
        let hand = HandReport { margin: Some(1.0 - used), ..hand(SlipState::Stick) };
        let state = GripperState { force_n: None, ..gripper(30.0) };
        controller.decide(frame * FRAME_NS, &hand, &state).force_n
    };
    let told_n: Vec<f64> = (0..).zip([0.2; 90].into_iter().chain([0.9; 30])).map(told_n).collect();
    assert!(told_n[..90].iter().all(|n| *n == 30.0), "{told_n:?}");
    assert!(told_n[119] > 35.0, "more load: {told_n:?}");
}

/// The object is lost, with all fingers live, and another one is gripped firmly.
#[test]
fn what_stopped_the_slide_of_one_object_is_not_kept_for_the_next() {
    let settings = MarginSettings::default().with_stiffness_mpa_per_mm(0.05);
    let slides = HandReport { margin: Some(0.0), ..hand(SlipState::Gross) };
    let mut hands = vec![HandReport { margin: Some(0.5), ..hand(SlipState::Stick) }; 10];
    hands.extend([slides; 10]);
    hands.extend([HandReport { margin: None, ..hand(SlipState::NoContact) }; 10]);
    hands.extend([HandReport { margin: Some(0.65), ..hand(SlipState::Stick) }; 150]);
    let told = commands(Law::Margin(settings), GripLimits::default(), &hands);
    let (stopped_n, last_n) = (told[19].force_n, told[179].force_n);
    assert!(stopped_n > 15.0 && last_n < stopped_n - 3.0, "{stopped_n} {last_n}");
}
