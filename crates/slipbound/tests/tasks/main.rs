//! Tasks against synthetic hand reports: end on evidence, begin with a grasp, never drop the object.

mod lifting;
mod placing;
mod screwing;
#[path = "../synthetic/mod.rs"]
mod synthetic;

use slipbound::monitor::SlipState;
use slipbound::port::{GripperState, Jaws, WristMotion, WristState};
use slipbound::sensor::{Sensor, Shear};
use slipbound::task::{ControllerKind, Ending, Missing, Observation, Phase, TaskKind, TaskSettings};
use synthetic::{FRAME_NS, gripper, hand};

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

/// Jaws that close for as long as they do, or wait for a link; and jaws that stand open.
#[test]
fn nothing_is_found_only_by_jaws_that_had_the_time_to_close() {
    let ended_s = |jaws: Jaws, opening_mm: &dyn Fn(f64) -> f64, interrupted: &dyn Fn(u64) -> bool| {
        let mut task = TaskSettings::default().task(TaskKind::Lift, None).expect("valid");
        let wrist = WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
        let report = hand(SlipState::NoContact);
        (0..100 * 30).find_map(|cycle| {
            if interrupted(cycle) {
                task.interrupt();
                return None;
            }
            let now_ns = cycle * FRAME_NS;
            let opening_mm = Some(opening_mm(now_ns as f64 * 1e-9));
            let state = GripperState { jaws, opening_mm, ..gripper(0.0) };
            let step = task.step(&Observation { now_ns, hand: &report, gripper: &state, wrist: &wrist });
            matches!(step.phase, Phase::Ended(Ending::NothingHeld)).then_some(now_ns / 1_000_000_000)
        })
    };
    let never = |_| false;
    assert_eq!(ended_s(Jaws::Open, &|_| 100.0, &never), Some(10));
    assert_eq!(ended_s(Jaws::Open, &|_| 100.0, &|cycle| (60..270).contains(&cycle)), Some(17), "seven seconds away");
    assert_eq!(ended_s(Jaws::Open, &|_| 100.0, &|cycle| cycle % 60 == 59), Some(10), "a fault that flickers");
    assert_eq!(ended_s(Jaws::Closing, &|_| 100.0, &never), Some(10), "stuck");
    assert_eq!(ended_s(Jaws::Closing, &|s| 100.0 + (s * 9.0).sin(), &never), Some(10), "shaking");
    // At the least speed of the grippers, to the end.
    assert_eq!(ended_s(Jaws::Closing, &|s| (100.0 - 5.0 * s).max(0.0), &never), Some(30));
}

/// An object that is held but not felt is not lifted, and the missing condition is reported.
#[test]
fn a_task_that_cannot_begin_says_what_it_waits_for() {
    for (state, jaws, missing) in [
        (SlipState::Unjudged, Jaws::Holding, Missing::Sight),
        (SlipState::NoContact, Jaws::Holding, Missing::Contact),
        (SlipState::Stick, Jaws::Open, Missing::Hold),
        (SlipState::Stick, Jaws::Holding, Missing::SteadyGrip),
    ] {
        let mut task = TaskSettings::default().task(TaskKind::Screw, None).expect("valid");
        assert_eq!(task.missing(), None);
        let wrist = WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
        let state = (hand(state), GripperState { jaws, ..gripper(10.0) });
        task.step(&Observation { now_ns: 0, hand: &state.0, gripper: &state.1, wrist: &wrist });
        assert_eq!(task.missing(), Some(missing));
        assert!(!missing.in_words().is_empty());
    }
    assert_eq!(Missing::SteadyGrip.in_words(), "the grip did not settle");
}

/// The fingers see nothing for a moment while the object is grasped: the force goes to the blind force, once, and back
/// slowly when the work has begun. Slip during the grasp adds a step to it.
#[test]
fn a_moment_without_sight_during_the_grasp_raises_the_force_to_the_blind_force_and_no_further() {
    let told_n = |seen: &[(SlipState, usize)]| -> Vec<(Phase, f64)> {
        let mut settings = TaskSettings::default().with_controller(ControllerKind::Paper);
        settings.grip.blind_force_n = Some(30.0);
        let mut task = settings.task(TaskKind::Lift, None).expect("valid");
        let (states, mut force_n) = (seen.iter().flat_map(|&(state, count)| vec![state; count]), 10.0);
        let step = |(cycle, state): (usize, SlipState)| {
            let now_ns = cycle as u64 * FRAME_NS;
            let wrist = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
            let (hand, gripper) = (hand(state), gripper(force_n));
            let step = task.step(&Observation { now_ns, hand: &hand, gripper: &gripper, wrist: &wrist });
            force_n = step.grip.force_n().expect("it holds");
            (step.phase, force_n)
        };
        states.enumerate().map(step).collect()
    };
    let told = told_n(&[(SlipState::Stick, 3), (SlipState::Unjudged, 5), (SlipState::Stick, 60)]);
    assert_eq!(told[3..8].iter().map(|(_, n)| *n).collect::<Vec<_>>(), [10.0, 10.0, 30.0, 30.0, 30.0]);
    let grasped = told.iter().position(|(phase, _)| *phase != Phase::Grasping).expect("it begins");
    assert!(grasped > 10 && told[8..grasped].iter().all(|(_, n)| *n == 30.0), "{told:?}");
    for pair in told[grasped - 1..].windows(2) {
        assert!((0.0..0.17).contains(&(pair[0].1 - pair[1].1)), "5 N/s: {told:?}");
    }
    let told =
        told_n(&[(SlipState::Stick, 3), (SlipState::Unjudged, 5), (SlipState::Incipient, 1), (SlipState::Stick, 3)]);
    assert_eq!(told[8], (Phase::Grasping, 40.0), "{told:?}");
}

/// A wrist that carries out every motion to its end, which is further than the settings allow in all.
#[test]
fn no_task_goes_further_than_its_settings_say() {
    for rate_mm_per_s in [3.0, 100.0] {
        let rate_rad_per_s = if rate_mm_per_s > 50.0 { 60f64 } else { 20.0 }.to_radians();
        let mut settings = TaskSettings::default();
        (settings.place.rate_mm_per_s, settings.place.most_mm) = (rate_mm_per_s, 3.0);
        (settings.lift.rate_mm_per_s, settings.lift.lift_mm, settings.lift.hold_ns) =
            (rate_mm_per_s, 2.0, 1_000_000_000);
        (settings.screw.rate_rad_per_s, settings.screw.most_rad) = (rate_rad_per_s, 0.2);
        (settings.unscrew.rate_rad_per_s, settings.unscrew.most_rad) = (-rate_rad_per_s, 0.4);
        for (kind, way, ending) in [
            (TaskKind::Place, 3.0, Ending::Limit),
            (TaskKind::Lift, -2.0, Ending::Held),
            (TaskKind::Screw, 0.2, Ending::Limit),
            (TaskKind::Unscrew, -0.4, Ending::Limit),
        ] {
            let mut task = settings.task(kind, Some(0.05)).expect("valid");
            let (mut at, mut ended) = (7.0, None);
            for cycle in 0..200u64 {
                let wrist = WristState { time_ns: 0, angle_rad: at, lowered_mm: at, moving: true };
                let (report, state, now_ns) = (hand(SlipState::Stick), gripper(10.0), cycle * FRAME_NS);
                let step = task.step(&Observation { now_ns, hand: &report, gripper: &state, wrist: &wrist });
                at += match step.wrist.motion {
                    WristMotion::Lower { rate_mm_per_s, most_mm } => most_mm.copysign(rate_mm_per_s),
                    WristMotion::Turn { rate_rad_per_s, most_rad } => most_rad.copysign(rate_rad_per_s),
                    WristMotion::Pause => 0.0,
                };
                if let Phase::Ended(how) = step.phase {
                    ended = Some(how);
                }
            }
            assert_eq!(ended, Some(ending), "{kind}");
            assert!((at - 7.0 - way).abs() < 1e-9, "{kind} at {rate_mm_per_s} mm/s: {}", at - 7.0);
        }
    }
}

#[test]
fn a_window_that_can_never_fill_is_refused_by_its_full_key() {
    for (change, key) in [
        ((|s| s.screw.flat_window_rad = 0.6) as fn(&mut TaskSettings), "screw.flat_window_rad"),
        (|s| s.screw.slide.window_rad = 0.6, "screw.slide.window_rad"),
        (|s| s.unscrew.slide.window_rad = 0.6, "unscrew.slide.window_rad"),
        (|s| s.unscrew.slide.flat_fraction = 9.0, "unscrew.slide.flat_fraction"),
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

/// A finger must measure what a task needs; a lift needs only slip.
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
    // `margin` wants the stiffness of every finger, not only of the first.
    let margin = settings.with_controller(ControllerKind::Margin);
    let error = margin.check_finger(TaskKind::Lift, &sensor).expect_err("no [shear]").to_string();
    assert!(error.contains("margin.stiffness_mpa_per_mm") && error.contains("file of bare"), "{error}");
    sensor.shear = Some(Shear { stiffness_n_per_pitch: 0.2, provenance: "measured".into() });
    margin.check_finger(TaskKind::Lift, &sensor).expect("its stiffness is known");
    sensor.pitch_mm = None;
    let error = margin.check_finger(TaskKind::Lift, &sensor).expect_err("known in pitches only").to_string();
    assert!(error.contains("no pitch_mm in the sensor file of bare"), "{error}");
}
