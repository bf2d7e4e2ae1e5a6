//! The loop against a gripper and a wrist that record their commands.

use super::*;
use crate::hand::Side;
use crate::monitor::Settings;
use crate::port::{FrameBuffer, FrameSource, GripperError, Next, SourceError, WristError, WristErrorKind};
use crate::task::{TaskKind, TaskSettings};
use std::cell::RefCell;
use std::rc::Rc;

const S: u64 = 1_000_000_000;

/// A camera without frames.
struct Silent;

impl FrameSource for Silent {
    fn next(&mut self, _into: &mut FrameBuffer) -> Result<Next, SourceError> {
        Ok(Next::Silent)
    }
}

/// A gripper and a wrist that record their commands.
#[derive(Clone, Default)]
struct Scribe {
    told: Rc<RefCell<Vec<String>>>,
    is_lost: bool,
    is_wrist_lost: bool,
    /// Events of its driver.
    events: Vec<DriverEvent>,
}

impl Gripper for Scribe {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        let force_n = command.force_n().map_or("release".into(), |n| n.to_string());
        self.told.borrow_mut().push(format!("grip {force_n}"));
        Ok(())
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        if self.is_lost {
            return Err(GripperError::new(GripperErrorKind::Link, "gone 3 ms ago"));
        }
        let (force_n, target_n, opening_mm) = (Some(20.0), Some(20.0), None);
        Ok(GripperState { time_ns: 0, force_n, force_error_n: None, target_n, opening_mm, jaws: Jaws::Holding })
    }

    fn next_event(&mut self) -> Option<DriverEvent> {
        self.events.pop()
    }
}

impl Wrist for Scribe {
    fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
        self.told.borrow_mut().push(format!("{:?}", command.motion));
        Ok(())
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        if self.is_wrist_lost {
            return Err(WristError::new(WristErrorKind::Link, "gone"));
        }
        Ok(WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, moving: false })
    }
}

fn control(blind_force_n: Option<f64>) -> ControlLoop {
    let mut settings = TaskSettings::default();
    settings.grip.blind_force_n = blind_force_n;
    let task = settings.task(TaskKind::Lift, None).expect("valid");
    let sensor = crate::sensor::tests::smooth();
    let finger = FingerPipeline::new("left", Mounting::on(Side::Left), sensor, Settings::default(), Box::new(Silent));
    ControlLoop::new(vec![finger], task).expect("valid")
}

fn holds(phase: Phase) -> TaskStep {
    TaskStep { grip: GripCommand::Hold { force_n: 20.0 }, wrist: PAUSE, phase }
}

fn releases() -> TaskStep {
    TaskStep { grip: GripCommand::Release, wrist: PAUSE, phase: Phase::Releasing }
}

#[test]
fn who_leaves_pauses_the_wrist_first_and_only_ever_presses_harder() {
    for (blind_force_n, last, expected) in [
        (None, holds(Phase::Working), vec!["Pause"]),
        (Some(35.0), holds(Phase::Working), vec!["Pause", "grip 35"]),
        (Some(12.0), holds(Phase::Working), vec!["Pause"]),
        (Some(35.0), releases(), vec!["Pause"]),
        (Some(35.0), holds(Phase::Releasing), vec!["Pause"]),
        (Some(35.0), holds(Phase::Ended(crate::task::Ending::Held)), vec!["Pause"]),
    ] {
        let (scribe, mut control) = (Scribe::default(), control(blind_force_n));
        control.last_step = Some(last);
        control.leave(&mut scribe.clone(), &mut scribe.clone());
        assert_eq!(*scribe.told.borrow(), expected);
        let presses_harder = expected.len() > 1;
        assert_eq!(control.left_with_n(), Some(35.0).filter(|_| presses_harder));
    }
}

/// The first camera fails: the second camera's frame of the cycle before is not shown as new.
#[test]
fn a_camera_that_fails_makes_nothing_come_twice() {
    struct Black(u64);
    impl FrameSource for Black {
        fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
            self.0 += 1;
            (into.seq, into.size) = (self.0, crate::image::SizePx::new(640, 480));
            into.pixels = vec![0; 3 * into.size.area()];
            Ok(Next::Frame)
        }
    }
    struct Fails(u64);
    impl FrameSource for Fails {
        fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
            if self.0 == 2 {
                return Err(SourceError::new(crate::port::SourceErrorKind::Disconnected, "unplugged"));
            }
            self.0 += 1;
            Black(self.0).next(into)
        }
    }
    #[derive(Default)]
    struct Came(Vec<Vec<bool>>);
    impl CycleObserver for Came {
        fn after_cycle(&mut self, view: &CycleView<'_>) {
            self.0.push(view.fingers.iter().map(|finger| *finger.next == Next::Frame).collect());
        }
    }
    let task = TaskSettings::default().task(TaskKind::Lift, None).expect("valid");
    let finger = |name: &str, side, source: Box<dyn FrameSource + Send>| {
        FingerPipeline::new(name, Mounting::on(side), crate::sensor::tests::smooth(), Settings::default(), source)
    };
    let fingers =
        vec![finger("left", Side::Left, Box::new(Fails(0))), finger("right", Side::Right, Box::new(Black(0)))];
    let mut control = ControlLoop::new(fingers, task).expect("valid");
    let (mut scribe, mut came) = (Scribe::default(), Came::default());
    for cycle in 1..=3u64 {
        let outcome = control.cycle(cycle * S / 30, &mut scribe.clone(), &mut scribe, &mut came);
        assert_eq!(outcome.is_err(), cycle == 3);
    }
    assert_eq!(came.0, [vec![true, true], vec![true, true], vec![false, false]]);
}

#[test]
fn a_lost_gripper_is_waited_for_with_the_wrist_paused_for_ten_seconds() {
    let (scribe, mut control) = (Scribe::default(), control(None));
    let mut lost = Scribe { is_lost: true, ..scribe.clone() };
    for now_ns in [S, 5 * S, 10 * S] {
        assert!(matches!(control.cycle(now_ns, &mut lost, &mut scribe.clone(), &mut ()), Ok(CycleOutcome::Waiting)));
    }
    assert_eq!(control.fault().map(|fault| fault.kind), Some(FaultKind::Gripper(GripperErrorKind::Link)));
    assert!(matches!(
        control.cycle(10 * S + 1, &mut scribe.clone(), &mut scribe.clone(), &mut ()),
        Ok(CycleOutcome::FindingRest)
    ));
    let error = control.cycle(11 * S, &mut lost, &mut scribe.clone(), &mut ()).expect_err("patience ends").to_string();
    assert_eq!(error, "gripper: gone 3 ms ago; waited 10 s");
    assert!(scribe.told.borrow().iter().all(|told| told == "Pause"), "{:?}", scribe.told.borrow());
    assert!(scribe.told.borrow().len() >= 4);
}

#[test]
fn a_force_that_does_not_follow_is_a_fault_and_one_on_its_way_is_not() {
    let mut shortfall = ForceShortfall::default();
    let state = |force_n| GripperState { force_n: Some(force_n), ..Scribe::default().poll_state() };
    let asked = holds(Phase::Waiting);
    assert_eq!(shortfall.check(0, &state(10.0), &asked), None);
    assert_eq!(shortfall.check(S, &state(12.0), &asked), None);
    assert_eq!(shortfall.check(S + S / 4, &state(17.0), &asked), None, "it has come up");
    assert_eq!(shortfall.check(2 * S, &state(10.0), &asked), None, "counted anew");
    let fault = shortfall.check(4 * S, &state(10.0), &asked).expect("too long");
    assert!(fault.text.contains("expected 20.0 N per finger, measured 10.0 N"), "{fault}");
    assert_eq!(shortfall.check(5 * S, &state(0.0), &releases()), None);
}

/// At 1 mm/s; the wrist moves for 0.1 s, stands for 2 s, and is paused by the fault from then on.
#[test]
fn a_wrist_that_stands_although_it_is_to_move_is_a_fault_and_one_that_was_paused_is_not() {
    let lower = |most_mm| WristMotion::Lower { rate_mm_per_s: -1.0, most_mm };
    let state = |lowered_mm| WristState { time_ns: 0, angle_rad: 0.0, lowered_mm, moving: true };
    let faults = |lowered_mm: &dyn Fn(u64) -> f64, commanded: &dyn Fn(u64) -> WristMotion, wanted| {
        let mut standstill = WristStandstill::default();
        let mut is_fault =
            |ms: u64| standstill.check(ms * 1_000_000, &state(lowered_mm(ms)), Some(commanded(ms)), wanted).is_some();
        (0..9000).step_by(100).filter(|ms| is_fault(*ms)).collect::<Vec<_>>()
    };
    let noise_mm = |ms: u64| (ms % 7) as f64 * 1e-3;
    let stands = |ms: u64| -0.1 * f64::from(u8::from(ms >= 100)) + noise_mm(ms);
    let paused = |from_ms| move |ms: u64| if ms < from_ms { lower(0.2) } else { WristMotion::Pause };
    let told = faults(&stands, &paused(1800), lower(0.2));
    assert_eq!(told, (1700..9000).step_by(100).collect::<Vec<_>>(), "and it lasts while it is wanted to move");
    assert!(faults(&stands, &paused(1500), lower(0.2)).is_empty(), "paused by another fault");
    assert!(faults(&|ms| -1e-4 * ms as f64, &paused(9000), lower(0.2)).is_empty(), "at a tenth of its speed");
    for wanted in [WristMotion::Pause, lower(0.0)] {
        assert!(faults(&stands, &paused(9000), wanted).is_empty(), "{wanted:?}");
    }
    // The gripper's link was lost for five seconds, in which nothing was commanded.
    let mut standstill = WristStandstill::default();
    for ms in [0, 100, 200, 5200, 5300] {
        assert_eq!(standstill.check(ms * 1_000_000, &state(stands(ms)), Some(lower(0.2)), lower(0.2)), None, "{ms}");
    }
}

impl Scribe {
    fn poll_state(mut self) -> GripperState {
        Gripper::poll(&mut self).expect("there")
    }
}

/// The loop does not wait for a lost wrist, because the load may still grow.
#[test]
fn a_lost_wrist_is_a_fault_but_the_loop_goes_on() {
    let (scribe, mut control) = (Scribe::default(), control(None));
    let mut lost = Scribe { is_wrist_lost: true, ..scribe.clone() };
    assert!(
        matches!(control.cycle(S, &mut scribe.clone(), &mut lost, &mut ()), Ok(CycleOutcome::Waiting)),
        "never heard of"
    );
    assert!(matches!(
        control.cycle(2 * S, &mut scribe.clone(), &mut scribe.clone(), &mut ()),
        Ok(CycleOutcome::FindingRest)
    ));
    assert!(
        matches!(control.cycle(3 * S, &mut scribe.clone(), &mut lost, &mut ()), Ok(CycleOutcome::FindingRest)),
        "it stands"
    );
    assert_eq!(control.wrist.map(|wrist| wrist.moving), Some(false));
}

#[test]
fn a_loop_that_gives_up_leaves_with_the_force_for_blind_hands() {
    let (scribe, mut control) = (Scribe::default(), control(Some(35.0)));
    control.last_step = Some(holds(Phase::Working));
    let mut lost = Scribe { is_lost: true, ..scribe.clone() };
    assert!(control.cycle(S, &mut lost, &mut scribe.clone(), &mut ()).is_ok());
    assert!(scribe.told.borrow().iter().all(|told| told == "Pause"), "it waits: {:?}", scribe.told.borrow());
    assert!(control.cycle(12 * S, &mut lost, &mut scribe.clone(), &mut ()).is_err());
    assert_eq!(scribe.told.borrow().last().map(String::as_str), Some("grip 35"));
}

#[test]
fn the_wrist_is_told_before_the_gripper() {
    let turn = WristCommand::new(WristMotion::Turn { rate_rad_per_s: 0.3, most_rad: 1.0 });
    let step = TaskStep { wrist: turn, ..holds(Phase::Working) };
    let (scribe, mut control) = (Scribe::default(), control(None));
    let state = scribe.clone().poll_state();
    let sent = control.command(&step, &state, &mut scribe.clone(), &mut scribe.clone());
    assert_eq!(sent, Sent { fault: None, refused_lowering: false });
    let told = scribe.told.take();
    assert!(told[0].starts_with("Turn") && told[1] == "grip 20" && told.len() == 2, "{told:?}");
    control.raise_fault(S, Fault::stopped(), &mut scribe.clone()).expect("it waits");
    assert_eq!(scribe.told.take(), ["Pause"]);
}

/// The last command before the fault, that of the task, and what is commanded.
#[test]
fn on_a_fault_the_wrist_pauses_and_the_force_is_not_lowered_nor_the_hand_opened() {
    let turn = WristCommand::new(WristMotion::Turn { rate_rad_per_s: 0.3, most_rad: 1.0 });
    let hold = |force_n| GripCommand::Hold { force_n };
    for (last, asked, given) in [
        (Some(hold(20.0)), hold(15.0), hold(20.0)),
        (Some(hold(20.0)), hold(25.0), hold(25.0)),
        (Some(hold(20.0)), GripCommand::Release, hold(20.0)),
        (Some(GripCommand::Release), GripCommand::Release, GripCommand::Release),
        (Some(GripCommand::Release), hold(15.0), hold(15.0)),
        (None, hold(15.0), hold(15.0)),
    ] {
        let mut control = control(None);
        control.last_step = last.map(|grip| TaskStep { grip, wrist: turn, phase: Phase::Working });
        let step = control.step_on_fault(TaskStep { grip: asked, wrist: turn, phase: Phase::Waiting }, None);
        assert_eq!(step, TaskStep { grip: given, wrist: PAUSE, phase: Phase::Waiting }, "{last:?} {asked:?}");
        // The controller starts at 10 N.
        assert_eq!(control.task.grip().force_n(), given.force_n().unwrap_or(10.0), "{last:?} {asked:?}");
    }
    // A gripper that reaches 17 of 20 N.
    for (asked_n, given_n) in [(19.0, 19.0), (15.0, 17.0)] {
        let mut control = control(None);
        control.last_step = Some(holds(Phase::Working));
        let step = TaskStep { grip: hold(asked_n), ..holds(Phase::Working) };
        assert_eq!(control.step_on_fault(step, Some(17.0)).grip, hold(given_n));
    }
}

#[test]
fn a_refused_lower_force_is_no_fault_and_every_other_refusal_is_one() {
    let mut control = control(None);
    let state = |target_n, jaws| GripperState { target_n, jaws, ..Scribe::default().poll_state() };
    struct Refuses(GripperErrorKind, &'static str);
    impl Gripper for Refuses {
        fn command(&mut self, _: GripCommand) -> Result<(), GripperError> {
            Err(GripperError::new(self.0, self.1))
        }

        fn poll(&mut self) -> Result<GripperState, GripperError> {
            Ok(Scribe::default().poll_state())
        }
    }
    let mut refuse_at = |kind, text, target_n, jaws| {
        let (step, wrist) = (holds(Phase::Working), &mut Scribe::default());
        let sent = control.command(&step, &state(target_n, jaws), &mut Refuses(kind, text), wrist);
        assert_eq!(sent.refused_lowering, sent.fault.is_none());
        (sent.refused_lowering, control.task.grip().force_n())
    };
    let lowering = GripperErrorKind::Lowering;
    let open = refuse_at(lowering, "80 N to 10 N", Some(80.0), Jaws::Open);
    assert_eq!(open, (true, 10.0), "open jaws are not closed with more than asked for");
    let mut refuse = |kind, text, target_n| refuse_at(kind, text, target_n, Jaws::Holding);
    assert_eq!(refuse(lowering, "22 N to 15 N", Some(22.0)), (true, 22.0), "the force it goes on with");
    assert_eq!(refuse(lowering, "22 N to 14 N", Some(15.0)), (true, 22.0), "a higher one is on its way");
    assert_eq!(refuse(lowering, "30 N to 14 N", Some(30.0)), (true, 30.0));
    for kind in [GripperErrorKind::Refused, GripperErrorKind::Link, GripperErrorKind::Value] {
        assert_eq!(refuse(kind, "no", Some(40.0)), (false, 30.0), "{kind:?}");
    }
    assert_eq!(control.refused_lowering.as_deref(), Some("80 N to 10 N"), "the first is kept");
}

#[test]
fn stopped_jaws_are_a_fault_and_unknown_ones_unless_the_task_is_over() {
    let mut control = control(None);
    let jaws = |jaws| GripperState { jaws, ..Scribe::default().poll_state() };
    assert!(control.usable(jaws(Jaws::Holding)).is_ok());
    assert_eq!(control.usable(jaws(Jaws::Stopped)), Err(Fault::stopped()));
    assert_eq!(control.usable(jaws(Jaws::Unknown)), Err(Fault::jaws_unknown()));
    control.last_step = Some(holds(Phase::Ended(crate::task::Ending::Held)));
    assert!(control.usable(jaws(Jaws::Unknown)).is_ok(), "a gripper that is let go may be switched off");
}

#[test]
fn the_measured_grip_is_known_to_the_monitors_and_events_of_the_driver_are_shown_once() {
    struct Counts(Vec<usize>);
    impl CycleObserver for Counts {
        fn after_cycle(&mut self, view: &CycleView<'_>) {
            self.0.push(view.driver_events.len());
        }
    }
    let mut counts = Counts(Vec::new());
    let (mut scribe, mut control) = (Scribe { events: vec![DriverEvent::Linked], ..Scribe::default() }, control(None));
    for now_ns in [S, 2 * S] {
        control.cycle(now_ns, &mut scribe, &mut Scribe::default(), &mut counts).expect("goes on");
    }
    assert_eq!(counts.0, [1, 0]);
    assert_eq!(control.grip.map(|grip| grip.force_n), Some(20.0));
}

#[test]
fn the_error_of_an_interrupted_loop_tells_both_forces_that_the_gripper_may_hold() {
    let told = ControlError::Interrupted.to_string();
    assert!(told.contains("keeps its force, or holds with grip.blind_force_n if that is higher"), "{told}");
}

/// What the monitors are told of the grip while the gripper is away.
#[test]
fn a_force_of_before_a_lost_link_is_not_judged_with() {
    let (mut gripper, mut wrist) = (Scribe::default(), Scribe::default());
    let mut control = control(None);
    control.cycle(0, &mut gripper, &mut wrist, &mut ()).expect("goes on");
    assert!(control.grip.is_some());
    gripper.is_lost = true;
    control.cycle(33_000_000, &mut gripper, &mut wrist, &mut ()).expect("it is waited for");
    assert!(control.grip.is_none());
}

/// Before the work is over, and in the cycle in which it is.
#[test]
fn jaws_that_were_opened_are_not_closed_again_because_the_work_is_over() {
    use crate::control::fault::HoldEnd;
    use crate::task::Ending;
    let state = |jaws, opening_mm| GripperState {
        time_ns: 0,
        force_n: None,
        force_error_n: None,
        target_n: Some(20.0),
        opening_mm: Some(opening_mm),
        jaws,
    };
    let (held, opened) = (state(Jaws::Holding, 28.0), state(Jaws::Open, 60.0));
    let over = |ending| holds(Phase::Ended(ending));
    for (steps, has_opened) in [
        (vec![(holds(Phase::Waiting), opened), (over(Ending::GripStays), opened)], true),
        (vec![(holds(Phase::Working), held), (over(Ending::Limit), opened)], true),
        (vec![(over(Ending::Held), held), (over(Ending::Held), opened)], true),
        (vec![(over(Ending::Limit), opened), (over(Ending::Limit), held)], false), // grasped again
        (vec![(releases(), opened)], false),
        (vec![(TaskStep { phase: Phase::Ended(Ending::Placed), ..releases() }, opened)], false),
    ] {
        let mut hold_end = HoldEnd::default();
        hold_end.check(0, &held, &holds(Phase::Working));
        for (number, (step, state)) in steps.iter().enumerate() {
            hold_end.check(33_000_000 * (number as u64 + 1), state, step);
        }
        assert_eq!(hold_end.has_opened(), has_opened, "{steps:?}");
    }
    let mut empty = HoldEnd::default();
    empty.check(0, &opened, &holds(Phase::Grasping));
    empty.check(33_000_000, &opened, &over(Ending::NothingHeld));
    assert!(!empty.has_opened(), "it never worked");
}
