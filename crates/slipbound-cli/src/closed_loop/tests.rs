//! The loop against a gripper and a wrist that write down what they are told.

use super::*;
use slipbound::hand::Side;
use slipbound::monitor::Settings;
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError, WristError};
use slipbound::task::{TaskKind, TaskSettings};
use std::cell::RefCell;
use std::rc::Rc;

const S: u64 = 1_000_000_000;

/// A camera that is silent.
struct Silent;

impl FrameSource for Silent {
    fn next(&mut self, _into: &mut FrameBuffer) -> Result<Next, SourceError> {
        Ok(Next::Silent)
    }
}

/// A gripper and a wrist that write down what they are told.
#[derive(Clone, Default)]
struct Scribe {
    told: Rc<RefCell<Vec<String>>>,
    is_lost: bool,
    is_wrist_lost: bool,
}

impl Gripper for Scribe {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        self.told.borrow_mut().push(format!("grip {}", command.force_n));
        Ok(())
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        if self.is_lost {
            return Err("gone 3 ms ago".into());
        }
        let (force_n, target_n, opening_mm) = (Some(20.0), Some(20.0), None);
        Ok(GripperState { time_ns: 0, force_n, target_n, opening_mm, jaws: Jaws::Holding })
    }
}

impl Wrist for Scribe {
    fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
        self.told.borrow_mut().push(format!("{:?}", command.motion));
        Ok(())
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        if self.is_wrist_lost {
            return Err("gone".into());
        }
        Ok(WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, moving: false })
    }
}

fn around(blind_force_n: Option<f64>) -> ClosedLoop {
    let mut settings = TaskSettings::default();
    settings.grip.blind_force_n = blind_force_n;
    let task = settings.task(TaskKind::Lift, None).expect("valid");
    let sensor = slipbound_rig::sensors::load("gelslim").expect("built in");
    let eye = Eye::new("left", Mounting::on(Side::Left), sensor, Settings::default(), Box::new(Silent));
    ClosedLoop::new(vec![eye], task).expect("valid")
}

fn step(phase: Phase, motion: Motion) -> TaskStep {
    TaskStep { grip: GripCommand { force_n: 20.0, motion }, wrist: PAUSE, phase }
}

#[test]
fn who_leaves_pauses_the_wrist_first_and_only_ever_presses_harder() {
    let releases = step(Phase::Releasing, Motion::Release);
    for (blind_force_n, last, expected) in [
        (None, step(Phase::Working, Motion::Go), vec!["Pause"]),
        (Some(35.0), step(Phase::Working, Motion::Go), vec!["Pause", "grip 35"]),
        (Some(12.0), step(Phase::Working, Motion::Go), vec!["Pause"]),
        (Some(35.0), releases, vec!["Pause"]),
    ] {
        let (scribe, mut around) = (Scribe::default(), around(blind_force_n));
        around.last = Some(last);
        around.leave(&mut scribe.clone(), &mut scribe.clone());
        assert_eq!(*scribe.told.borrow(), expected);
    }
}

#[test]
fn a_lost_gripper_is_waited_for_with_the_wrist_paused_for_ten_seconds() {
    let (scribe, mut around) = (Scribe::default(), around(None));
    let mut lost = Scribe { is_lost: true, ..scribe.clone() };
    for now_ns in [S, 5 * S, 10 * S] {
        assert!(matches!(around.turn(now_ns, &mut lost, &mut scribe.clone()), Ok(Turned::Waiting)));
    }
    assert_eq!(around.trouble.as_ref().map(Trouble::kind).as_deref(), Some("gripper: gone  ms ago"));
    assert!(matches!(around.turn(10 * S + 1, &mut scribe.clone(), &mut scribe.clone()), Ok(Turned::AtRest)));
    let error = around.turn(11 * S, &mut lost, &mut scribe.clone()).expect_err("patience ends").to_string();
    assert_eq!(error, "gripper: gone 3 ms ago; waited 10 s");
    assert!(scribe.told.borrow().iter().all(|told| told == "Pause"), "{:?}", scribe.told.borrow());
    assert!(scribe.told.borrow().len() >= 4);
}

#[test]
fn a_force_that_does_not_follow_is_trouble_and_one_on_its_way_is_not() {
    let mut around = around(None);
    let state = |force_n| GripperState { force_n: Some(force_n), ..Scribe::default().poll_state() };
    let asked = step(Phase::Waiting, Motion::Pause);
    assert_eq!(around.lacks(0, &state(10.0), &asked), None);
    assert_eq!(around.lacks(S, &state(12.0), &asked), None);
    assert_eq!(around.lacks(S + S / 4, &state(17.0), &asked), None, "it has come up");
    assert_eq!(around.lacks(2 * S, &state(10.0), &asked), None, "counted anew");
    let why = around.lacks(4 * S, &state(10.0), &asked).expect("too long");
    assert!(why.contains("expected 20.0 N per finger, measured 10.0 N"), "{why}");
    assert_eq!(around.lacks(5 * S, &state(0.0), &step(Phase::Releasing, Motion::Release)), None);
}

impl Scribe {
    fn poll_state(mut self) -> GripperState {
        Gripper::poll(&mut self).expect("there")
    }
}

/// With the wrist gone the loop does not wait: whoever fills the bottle does not wait either.
#[test]
fn a_lost_wrist_is_trouble_but_the_loop_goes_on() {
    let (scribe, mut around) = (Scribe::default(), around(None));
    let mut lost = Scribe { is_wrist_lost: true, ..scribe.clone() };
    assert!(matches!(around.turn(S, &mut scribe.clone(), &mut lost), Ok(Turned::Waiting)), "never heard of");
    assert!(matches!(around.turn(2 * S, &mut scribe.clone(), &mut scribe.clone()), Ok(Turned::AtRest)));
    assert!(matches!(around.turn(3 * S, &mut scribe.clone(), &mut lost), Ok(Turned::AtRest)), "it stands");
    assert_eq!(around.wrist.map(|wrist| wrist.moving), Some(false));
}
