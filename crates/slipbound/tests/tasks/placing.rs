//! Laying a tool down: the ground is felt, and nothing is released before the ground carries it.

use crate::synthetic::{FRAME_NS, gripper, hand};
use slipbound::hand::{HandReport, HandSlip, HandVector, Health};
use slipbound::monitor::SlipState;
use slipbound::port::{GripCommand, GripperState, Jaws, WristMotion, WristState};
use slipbound::task::{Ending, Observation, Phase, TaskKind, TaskSettings};

/// A tool is lowered, touches and turns; its grip should be loosened. `follows`: whether the gripper does so; `opens`:
/// whether it opens.
fn laid_down(follows: bool, opens: bool) -> (Option<Ending>, bool) {
    laid_down_with_faults(follows, opens, |_, _| false)
}

/// The same with faults, by the time since the touch and since the release, s: no command is carried out meanwhile.
fn laid_down_with_faults(follows: bool, opens: bool, is_fault: impl Fn(f64, f64) -> bool) -> (Option<Ending>, bool) {
    let (mut touched_ns, mut released_ns) = (None, None);
    let mut task = TaskSettings::default().task(TaskKind::Place, Some(0.05)).expect("valid");
    let (mut force_n, mut lowered_mm, mut released) = (10.0, 0.0, false);
    for cycle in 0..1200u64 {
        let now_ns = cycle * FRAME_NS;
        let since_s = |ns: Option<u64>| ns.map_or(-1.0, |ns| (now_ns - ns) as f64 * 1e-9);
        let mut report = hand(SlipState::Stick);
        // From 5 mm on it touches the ground, turns, and is pushed against the gels.
        let touches = lowered_mm > 5.0;
        report.pivot_rad = Some(if touches { 0.2 } else { 0.0 });
        let along = if lowered_mm > 5.0 { 0.1 * (5.0 - lowered_mm) } else { 0.0 };
        report.shear_mm = Some(HandVector { along, ..HandVector::default() });
        let jaws = if released && opens { Jaws::Open } else { Jaws::Holding };
        let state = GripperState { jaws, ..gripper(force_n) };
        let wrist = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm, moving: true };
        let step = task.step(&Observation { now_ns, hand: &report, gripper: &state, wrist: &wrist });
        if step.grip == GripCommand::Release {
            released_ns.get_or_insert(now_ns);
        }
        if step.grip.force_n().is_some_and(|n| n < 10.0) {
            touched_ns.get_or_insert(now_ns);
        }
        if is_fault(since_s(touched_ns), since_s(released_ns)) {
            task.interrupt();
            continue;
        }
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
    assert_eq!(laid_down(true, true), (Some(Ending::Placed), true));
    assert_eq!(laid_down(false, true), (Some(Ending::GripStays), false));
}

/// From the touch on for eight seconds, and from the release on for twenty.
#[test]
fn a_fault_while_it_is_laid_down_is_waited_for_and_not_blamed_on_the_gripper() {
    let touching = |touched_s: f64, _: f64| (0.0..8.0).contains(&touched_s);
    assert_eq!(laid_down_with_faults(true, true, touching), (Some(Ending::Placed), true));
    // A fault that flickers keeps nobody waiting for ever.
    let flickers = |touched_s: f64, _: f64| touched_s > 0.0 && touched_s % 2.0 < 0.05;
    assert_eq!(laid_down_with_faults(false, true, flickers), (Some(Ending::GripStays), false));
    assert_eq!(laid_down_with_faults(true, false, flickers), (Some(Ending::NotReleased), true));
    let releasing = |_: f64, released_s: f64| (0.0..20.0).contains(&released_s);
    assert_eq!(laid_down_with_faults(true, true, releasing), (Some(Ending::Placed), true));
}

#[test]
fn a_gripper_that_does_not_open_ends_the_task_which_asks_it_to_the_end() {
    assert_eq!(laid_down(true, false), (Some(Ending::NotReleased), true));
}

/// From 10 N to 5.5 N in nine tenths of a second, on ground so firm that it carries the tool at once.
#[test]
fn the_ground_is_judged_once_the_looser_grip_has_stood_for_its_time() {
    let mut task = TaskSettings::default().task(TaskKind::Place, Some(0.05)).expect("valid");
    let (mut force_n, mut lowered_mm, mut loose_ns) = (10.0f64, 0.0, None);
    for cycle in 0..600u64 {
        let now_ns = cycle * FRAME_NS;
        let ground = ground_at_5_mm(lowered_mm);
        let shear_mm = Some(HandVector { along: (5.0 - lowered_mm).min(0.0), ..HandVector::default() });
        let state = GripperState { target_n: None, ..gripper(force_n) };
        let wrist = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm, moving: true };
        let hand = HandReport { shear_mm, ..ground };
        let step = task.step(&Observation { now_ns, hand: &hand, gripper: &state, wrist: &wrist });
        if force_n <= 5.5 {
            loose_ns.get_or_insert(now_ns);
        }
        let Some(asked_n) = step.grip.force_n() else {
            let loose_s = loose_ns.map(|ns| (now_ns - ns) as f64 * 1e-9).expect("loose");
            assert!((0.5..1.0).contains(&loose_s), "released {loose_s} s after the grip was loose");
            return;
        };
        force_n = asked_n.max(force_n - 5.0 * FRAME_NS as f64 * 1e-9);
        if let WristMotion::Lower { rate_mm_per_s, .. } = step.wrist.motion {
            lowered_mm += rate_mm_per_s * FRAME_NS as f64 * 1e-9;
        }
    }
    panic!("not released");
}

/// Frames without shear while it is laid down, with continuous slip: the loose grip stays loose.
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

/// A hanging tool is lowered and touches the ground at 5 mm, which turns and pushes it. `hand_of`: the hand report by
/// cycle and lowered distance.
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

/// The wrist stands while the contact with the ground is being confirmed; one cycle of noise does not lower it further.
#[test]
fn a_cycle_that_does_not_feel_the_ground_pushes_no_tool_onto_it() {
    let (ending, carried_mm) = lowered(|_, mm| ground_at_5_mm(mm));
    assert_eq!(ending, Some(Ending::Placed));
    let standing_count = std::cell::Cell::new(0);
    let told = lowered(|_, mm| {
        let mut report = ground_at_5_mm(mm);
        if mm >= carried_mm {
            standing_count.set(standing_count.get() + 1);
            if standing_count.get() == 3 {
                report.shear_mm = Some(HandVector::default());
            }
        }
        report
    });
    assert!(standing_count.get() > 3);
    assert_eq!(told, (Some(Ending::Placed), carried_mm));
}

/// A force raised while the hand was blind is lowered slowly, not because of a single frame; meanwhile the ground is
/// not judged.
#[test]
fn a_grip_that_was_raised_while_blind_is_not_let_go_at_once() {
    let mut settings = TaskSettings::default();
    settings.grip.blind_force_n = Some(40.0);
    let mut task = settings.task(TaskKind::Place, Some(0.05)).expect("valid");
    let (mut force_n, mut lowered_mm, mut blind_left, mut released) = (10.0, 0.0, 6, false);
    let mut told = Vec::new();
    for cycle in 0..2000u64 {
        let now_ns = cycle * FRAME_NS;
        let mut report = ground_at_5_mm(lowered_mm);
        if force_n == 5.0 && blind_left > 0 || (1..6).contains(&blind_left) {
            report = hand(SlipState::Unjudged);
            blind_left -= 1;
        } else if blind_left == 0 && told.last() == Some(&40.0) {
            report.state = SlipState::Gross;
            blind_left = -1;
        }
        let jaws = if released { Jaws::Open } else { Jaws::Holding };
        let state = GripperState { jaws, ..gripper(force_n) };
        let wrist = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm, moving: true };
        let step = task.step(&Observation { now_ns, hand: &report, gripper: &state, wrist: &wrist });
        match step.grip {
            GripCommand::Hold { force_n: asked_n } => force_n = asked_n,
            GripCommand::Release => released = true,
        }
        assert!(!released || force_n == 5.0, "released with {force_n} N");
        if let WristMotion::Lower { rate_mm_per_s, .. } = step.wrist.motion {
            assert!(force_n <= 10.0, "lowered with {force_n} N");
            lowered_mm += rate_mm_per_s * FRAME_NS as f64 * 1e-9;
        }
        told.push(force_n);
        if let Phase::Ended(ending) = step.phase {
            assert_eq!(ending, Ending::Placed);
            break;
        }
    }
    assert!(released, "{told:?}");
    let raised = told.iter().position(|n| *n == 40.0).expect("raised while blind");
    let longest_n = told[raised..].windows(2).map(|pair| pair[0] - pair[1]).fold(0.0, f64::max);
    assert!(longest_n < 0.2, "{longest_n} N in one cycle: {:?}", &told[raised..]);
    assert_eq!(
        told[raised..].iter().filter(|n| **n == 40.0).count(),
        5,
        "four blind cycles and one in which it slides"
    );
}

/// Cameras with alternating frames, or one slow camera.
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
            // One finger is turned and sheared more than the other.
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

/// Fingers that measure no shear (no size in mm), or feel nothing; a tool that pivots in the air; ground that is never
/// reached.
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

/// While a tool hangs, and while it is laid down, a finger drops out for some frames and returns; the two fingers feel
/// different values. Then the ground turns the tool, and carries it.
#[test]
fn a_finger_that_is_lost_for_some_frames_is_no_ground() {
    // Shear along, mm, and pivot, rad, of the left finger and of the right; which of them have a frame.
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
    // One finger is sheared by 0.5 mm and turned by 6 deg more than the other.
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
