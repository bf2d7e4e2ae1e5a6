//! Lifting and holding: it begins with a grasp, and time without contact does not count.

use crate::synthetic::{gripper, hand};
use slipbound::hand::HandReport;
use slipbound::monitor::SlipState;
use slipbound::port::{GripperState, Jaws, WristMotion, WristState};
use slipbound::task::{Ending, Observation, Phase, TaskKind, TaskSettings};

/// Hand and gripper at a time in ms, passed to a lift every `period_ms`; the phase and force of each step.
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
    // Blind for 5 s while it is held up: the hold takes 5 s longer.
    let ended = |told: &[(u64, Phase, f64)]| first_ms(told, |phase| phase == Phase::Ended(Ending::Held)).expect("held");
    let (seen_ms, unseen_ms) = (ended(&run(|_| true)), ended(&run(|ms| !(2500..7500).contains(&ms))));
    assert!((4960..=5040).contains(&(unseen_ms - seen_ms)), "{seen_ms} ms and {unseen_ms} ms");
}

/// It is held up from 2 s on; then the gripper's link is lost for 5 s, in which the task is not stepped, or the object
/// falls.
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

/// 6 % high, 1 N off, 1.5 N of noise: the gripper holds and the fingers feel it, which is sufficient.
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

/// The jaws hold from the cycle at 528 ms on, with a force that reads 3 N low: the one at 1551 ms is the first after a
/// second.
#[test]
fn slip_in_the_cycle_that_completes_the_grasp_is_answered_in_that_cycle() {
    let told = lift_with(&TaskSettings::default(), (33, 1700), |ms| {
        let state = if ms < 1551 { SlipState::Stick } else { SlipState::Incipient };
        (hand(state), GripperState { jaws: jaws_at(ms), force_n: Some(7.0), ..gripper(10.0) })
    });
    let grasped = told.iter().position(|(_, phase, _)| *phase != Phase::Grasping).expect("grasped");
    assert_eq!(told[grasped], (1551, Phase::Waiting, 20.0), "{told:?}");
}
