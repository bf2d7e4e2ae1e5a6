//! Behaviour of tasks, one letter per frame: grasping, lifting, laying down.

mod synthetic;

use slipbound::hand::{HandReport, HandVector};
use slipbound::monitor::SlipState;
use slipbound::port::{GripCommand, GripperState, Jaws, WristMotion, WristState};
use slipbound::task::{ControllerKind, Ending, Observation, Phase, TaskKind, TaskSettings};
use synthetic::{FRAME_NS, gripper, hand};

/// Phase of a lift in each frame of 33 ms: `G` grasps, `>` rises, `-` waits, `H` held, `L` lost, `N` nothing held; and
/// the final height, mm.
fn lift_picture(
    settings: &TaskSettings,
    frames_count: u64,
    shows: impl Fn(u64, f64) -> (HandReport, GripperState),
) -> (String, f64) {
    let mut task = settings.task(TaskKind::Lift, Some(0.05)).expect("valid");
    let (mut lowered_mm, mut force_n, mut picture) = (3.0, 10.0, String::new());
    for frame in 0..frames_count {
        let (hand, gripper) = shows(frame, force_n);
        let now_ns = frame * FRAME_NS;
        let wrist = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm, moving: true };
        let step = task.step(&Observation { now_ns, hand: &hand, gripper: &gripper, wrist: &wrist });
        force_n = step.grip.force_n().expect("it holds");
        picture.push(match step.phase {
            Phase::Grasping => 'G',
            Phase::Working => '>',
            Phase::Ended(Ending::Held) => 'H',
            Phase::Ended(Ending::Lost) => 'L',
            Phase::Ended(Ending::NothingHeld) => 'N',
            Phase::Waiting => '-',
            other => panic!("{other:?}"),
        });
        match step.wrist.motion {
            // The wrist stops at the commanded distance, however fast.
            WristMotion::Lower { rate_mm_per_s, most_mm } => {
                lowered_mm +=
                    (rate_mm_per_s.abs() * 1.5 * FRAME_NS as f64 * 1e-9).min(most_mm) * rate_mm_per_s.signum();
            }
            _ => assert_ne!(step.phase, Phase::Working, "frame {frame} of {picture}"),
        }
    }
    (picture, 3.0 - lowered_mm)
}

#[test]
fn a_lift_rises_as_far_as_it_was_told_and_counts_the_time_it_is_held_there() {
    let mut settings = TaskSettings::default();
    (settings.lift.lift_mm, settings.lift.hold_ns) = (4.5, 300_000_000);
    let (picture, way_mm) = lift_picture(&settings, 24, |_, force_n| (hand(SlipState::Stick), gripper(force_n)));
    // 0.2 s to grasp, a millimetre per frame, half of it in the last; ten frames are 0.3 s.
    assert_eq!(picture, "GGGGGGG>>>>>----------HH");
    assert!((way_mm - 4.5).abs() < 1e-9, "{way_mm} mm");
}

#[test]
fn a_lift_waits_while_the_grip_is_raised_and_ends_when_the_part_is_lost() {
    let mut settings = TaskSettings::default().with_controller(ControllerKind::OnSlip);
    settings.lift.lift_mm = 100.0;
    let (picture, _) = lift_picture(&settings, 30, |frame, force_n| {
        let state = if frame == 12 { SlipState::Incipient } else { SlipState::Stick };
        let jaws = if frame < 22 { Jaws::Holding } else { Jaws::Lost };
        (hand(state), GripperState { jaws, ..gripper(force_n) })
    });
    assert_eq!(picture, "GGGGGGG>>>>>---->>>>>>LLLLLLLL");
}

#[test]
fn taking_hold_waits_until_the_jaws_stand_still_and_begins_anew_when_the_object_is_not_felt() {
    let settings = TaskSettings::default().with_controller(ControllerKind::Constant);
    let run = |shows: &dyn Fn(u64) -> (SlipState, f64)| {
        let picture = lift_picture(&settings, 40, |frame, force_n| {
            let (state, opening_mm) = shows(frame);
            (hand(state), GripperState { opening_mm: Some(opening_mm), ..gripper(force_n) })
        });
        picture.0.find('>').expect("it begins")
    };
    let stick = SlipState::Stick;
    assert_eq!(run(&|_| (stick, 28.0)), 7, "0.2 s are seven frames");
    assert_eq!(
        run(&|frame| (stick, 28.0 - frame.min(10) as f64)),
        17,
        "closing by a millimetre a frame until frame 10"
    );
    let creeps = |frame: u64| (stick, 28.0 - 0.1 * frame.min(20) as f64);
    assert_eq!(run(&creeps), 18 + 7, "more than half a millimetre in a fifth of a second, three times");
    assert_eq!(run(&|frame| (if frame == 5 { SlipState::NoContact } else { stick }, 28.0)), 6 + 7, "not felt once");
    assert_eq!(run(&|frame| (if frame == 5 { SlipState::Unsure } else { stick }, 28.0)), 7, "felt, though not judged");
}

#[test]
fn jaws_that_hold_nothing_for_ten_seconds_end_it_and_blind_fingers_or_a_felt_object_do_not() {
    let settings = TaskSettings::default().with_controller(ControllerKind::Constant);
    let run = |state: SlipState, jaws: Jaws, opening_mm: &dyn Fn(u64) -> f64| {
        let picture = lift_picture(&settings, 310, |frame, force_n| {
            (hand(state), GripperState { jaws, opening_mm: Some(opening_mm(frame)), ..gripper(force_n) })
        });
        picture.0.find('N')
    };
    // 300 frames are slightly less than 10 s.
    assert_eq!(run(SlipState::NoContact, Jaws::Holding, &|_| 28.0), Some(301));
    assert_eq!(run(SlipState::Stick, Jaws::Closing, &|_| 28.0), Some(301));
    assert_eq!(run(SlipState::Unjudged, Jaws::Holding, &|_| 28.0), None);
    // Jaws that hold and fingers that feel, but the jaws shake.
    assert_eq!(run(SlipState::Stick, Jaws::Holding, &|frame| (frame % 2) as f64), None);
    assert_eq!(run(SlipState::NoContact, Jaws::Lost, &|_| 28.0), Some(0));
}

/// How a tool is laid down, one letter per frame of 33 ms: `G` grasps, `v` lowers, `-` waits, `R` releases, `P` placed,
/// `L` lost, `E` too far, `S` the grip stays firm. `shows`: shear along in mm (None: not felt), pivot in rad, jaws, and
/// the force that the gripper exerts for a commanded force.
fn laying_picture(
    settings: &TaskSettings,
    stiffness_mpa_per_mm: Option<f64>,
    frames_count: u64,
    shows: impl Fn(u64, f64) -> (Option<f64>, f64, Jaws, f64),
) -> String {
    let mut task = settings.task(TaskKind::Place, stiffness_mpa_per_mm).expect("valid");
    let (mut lowered_mm, mut force_n, mut picture) = (20.0, 10.0, String::new());
    for frame in 0..frames_count {
        let (along, pivot_rad, jaws, pressed_n) = shows(frame, force_n);
        let mut report = hand(SlipState::Stick);
        report.shear_mm = along.map(|along| HandVector { along, ..HandVector::default() });
        report.pivot_rad = along.map(|_| pivot_rad);
        let (now_ns, state) = (frame * FRAME_NS, GripperState { jaws, ..gripper(pressed_n) });
        let wrist = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm, moving: true };
        let step = task.step(&Observation { now_ns, hand: &report, gripper: &state, wrist: &wrist });
        picture.push(match step.phase {
            Phase::Grasping => 'G',
            Phase::Working => 'v',
            Phase::Waiting => '-',
            Phase::Releasing => 'R',
            Phase::Ended(Ending::Placed) => 'P',
            Phase::Ended(Ending::Lost) => 'L',
            Phase::Ended(Ending::Limit) => 'E',
            Phase::Ended(Ending::GripStays) => 'S',
            other => panic!("{other:?}"),
        });
        assert_eq!(step.grip == GripCommand::Release, matches!(picture.chars().last(), Some('R' | 'P')), "{picture}");
        force_n = step.grip.force_n().unwrap_or(force_n);
        if let WristMotion::Lower { rate_mm_per_s, .. } = step.wrist.motion {
            lowered_mm += rate_mm_per_s * FRAME_NS as f64 * 1e-9;
        }
    }
    picture
}

#[test]
fn a_tool_is_laid_down_only_as_far_as_the_ground_is_felt() {
    let mut settings = TaskSettings::default().with_controller(ControllerKind::Constant);
    let touches = |frame: u64| if frame < 12 { 0.0 } else { 0.2 };
    // The ground pushes by 0.01 mm per frame from frame 30 on. 0.05 MPa/mm on 100 mm2: 0.25 N are 0.05 mm beyond the
    // mean over a second.
    let push = |frame: u64| -0.01 * frame.saturating_sub(30) as f64 - 0.001;
    let jaws = |frame: u64, from| if frame < from { Jaws::Holding } else { Jaws::Open };
    let told = |stiffness| {
        laying_picture(&settings, stiffness, 42, |frame, n| (Some(push(frame)), touches(frame), jaws(frame, 40), n))
    };
    // Touch at 12, confirmed after three frames; the gripper holds loosely in the next one, and half a second later the
    // grip has settled; then down until the ground carries it, confirmed over three frames in which it is not lowered.
    let touched = "G".repeat(7) + "vvvvvvv" + &"-".repeat(17);
    let after = touched.clone() + "vvvvvv--";
    assert_eq!(told(Some(0.05)), after.clone() + "RPP");
    assert_eq!(told(None), after.clone() + "RPP", "by the displacement alone");
    assert_eq!(told(Some(0.1)), touched.clone() + "vvv--RRRRPP", "twice as stiff: 0.025 mm");

    // The shear present when the loose grip settled does not count as push of the ground.
    let picture = laying_picture(&settings, None, 36, |frame, n| (Some(-0.3), touches(frame), Jaws::Holding, n));
    assert_eq!(picture, touched.clone() + "vvvvv");

    // Nor does a push that grows by 0.03 mm in a second, as the gel creeps and the object turns on its edge: 0.27 mm in
    // nine seconds.
    let creep = |frame: u64| Some(-0.001 * frame.saturating_sub(30) as f64);
    let picture = laying_picture(&settings, None, 300, |frame, n| (creep(frame), touches(frame), Jaws::Holding, n));
    assert_eq!(picture, touched.clone() + &"v".repeat(269));

    // No shear for three frames: no lowering meanwhile.
    let unresponsive = |frame: u64| if (30..33).contains(&frame) { None } else { Some(0.0) };
    let picture =
        laying_picture(&settings, None, 36, |frame, n| (unresponsive(frame), touches(frame), Jaws::Holding, n));
    assert_eq!(picture, touched + "--vvv");

    // Before the touch a single frame without shear is no reason to wait; the object may hang turned, and it may be
    // lost.
    let unresponsive = |frame: u64| if frame == 9 { None } else { Some(0.0) };
    let picture = laying_picture(&settings, None, 16, |frame, n| (unresponsive(frame), 0.3, jaws(frame, 99), n));
    assert_eq!(picture, "GGGGGGGvvvvvvvvv");
    let lost = |frame| if frame < 10 { Jaws::Holding } else { Jaws::Lost };
    let picture = laying_picture(&settings, None, 12, |frame, n| (Some(0.0), 0.0, lost(frame), n));
    assert_eq!(picture, "GGGGGGGvvvLL");

    // 3 mm/s are 0.1 mm per frame: 1 mm takes ten.
    settings.place.most_mm = 0.999;
    let picture = laying_picture(&settings, None, 20, |_, n| (Some(0.0), 0.0, Jaws::Holding, n));
    assert_eq!(picture, "G".repeat(7) + &"v".repeat(10) + "EEE");
}

#[test]
fn a_grip_that_does_not_loosen_is_waited_for_three_seconds_more() {
    let settings = TaskSettings::default().with_controller(ControllerKind::Constant);
    let touches = |frame: u64| if frame < 12 { 0.0 } else { 0.2 };
    let told = |from: u64| {
        laying_picture(&settings, None, 125, |frame, n| {
            (Some(0.0), touches(frame), Jaws::Holding, if frame < from { 10.0 } else { n })
        })
    };
    let waits = |picture: &str| picture.chars().filter(|c| *c == '-').count();
    // From then on it stands for half a second, 16 frames.
    assert_eq!((waits(&told(60)), told(60).ends_with('v')), (60 - 14 + 16, true));
    // Confirmed two frames after it; 3.5 s are slightly more than 105 frames.
    assert_eq!((waits(&told(999)), told(999).ends_with('S')), (106, true));
}

/// Every task reports what it waits for during the grasp, and nothing after.
#[test]
fn what_is_missing_is_said_while_hold_is_taken() {
    use slipbound::task::Missing;
    for kind in [TaskKind::Screw, TaskKind::Unscrew, TaskKind::Place, TaskKind::Lift] {
        let settings = TaskSettings::default().with_controller(ControllerKind::Constant);
        let mut task = settings.task(kind, Some(0.05)).expect("valid");
        let mut missing = Vec::new();
        for frame in 0..14u64 {
            let (state, jaws) = match frame {
                0..2 => (SlipState::NoContact, Jaws::Closing),
                2..4 => (SlipState::NoContact, Jaws::Holding),
                4 => (SlipState::Unjudged, Jaws::Holding),
                _ => (SlipState::Stick, Jaws::Holding),
            };
            let (now_ns, gripper) = (frame * FRAME_NS, GripperState { jaws, ..gripper(10.0) });
            let wrist = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
            task.step(&Observation { now_ns, hand: &hand(state), gripper: &gripper, wrist: &wrist });
            missing.push(task.missing());
        }
        use Missing::*;
        let waits = [Some(Hold), Some(Hold), Some(Contact), Some(Contact), Some(Sight)];
        let rests = [Some(SteadyGrip); 7];
        assert_eq!(missing, [&waits[..], &rests[..], &[None, None]].concat(), "{kind:?}");
    }
}

/// The force counts once it has been constant for a fifth of a second, not at the first correct reading.
#[test]
fn taking_hold_waits_until_the_force_has_stood_as_well() {
    let settings = TaskSettings::default().with_controller(ControllerKind::Constant);
    let begins = |reads_wrong: &dyn Fn(u64) -> bool| {
        let picture = lift_picture(&settings, 40, |frame, force_n| {
            (hand(SlipState::Stick), gripper(if reads_wrong(frame) { 7.0 } else { force_n }))
        });
        picture.0.find('>').expect("it begins")
    };
    assert_eq!(begins(&|frame| frame < 12), 12 + 7);
    assert_eq!(begins(&|frame| frame < 12 || frame == 15), 16 + 7, "it flickered once");
    assert_eq!(begins(&|_| true), 31, "1 s, whatever it reads");
}

#[test]
fn a_lift_that_need_not_be_held_is_lifted_all_the_same() {
    let mut settings = TaskSettings::default();
    (settings.lift.lift_mm, settings.lift.hold_ns) = (4.5, 0);
    let (picture, _) = lift_picture(&settings, 16, |frame, force_n| {
        // Blind when it reaches its height: the hold must be observed.
        let state = if (12..14).contains(&frame) { SlipState::Unjudged } else { SlipState::Stick };
        (hand(state), gripper(force_n))
    });
    assert_eq!(picture, "GGGGGGG>>>>>--HH");
}
