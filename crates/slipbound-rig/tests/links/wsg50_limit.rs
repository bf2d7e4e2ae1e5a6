//! The force limit of a WSG-50: sent again where no answer comes, and not followed by the force.

use crate::bench::{Bench, MS, config, driver};
use slipbound::port::{DriverEvent, GripCommand, Jaws};
use slipbound_rig::gripper::config::{Config, Lowering};
use slipbound_rig::gripper::wsg50::Wsg50;
use slipbound_rig::gripper::wsg50::frame::{self, Parser};
use slipbound_rig::gripper::{Driver, Error, Request};
use slipbound_rig::link::Endpoint;

fn allowing() -> Config {
    Config { lowering: Lowering::Allow, ..config("wsg50") }
}

/// The link stalls for so long that the limit is sent again. Both are answered, and the second answer comes while the
/// next limit, which the gripper refuses, is in flight.
#[test]
fn the_second_answer_to_a_limit_that_was_sent_again_is_none_to_the_next_limit() {
    let beyond = Config { most_n: 200.0, ..allowing() };
    for most_bytes in [1, 10, 25, usize::MAX] {
        let mut bench = Bench::holding("wsg50", beyond.clone(), "stall=480@4000", 20.0);
        bench.most_bytes = most_bytes;
        bench.run(4000 - bench.now_ns() / MS);
        bench.grip(30.0).expect("taken over");
        bench.run(470);
        bench.grip(100.0).expect("not yet silent");
        let error = bench.until_error(500).to_string();
        assert!(error.contains("expected set force limit to be done, got status 28"), "{most_bytes} bytes: {error}");
        bench.run(1000);
        assert_eq!(bench.state().expect("there").target_n, Some(30.0), "{most_bytes} bytes");
        assert!((bench.plant.force_n - 30.0).abs() < 0.1, "{most_bytes} bytes: {} N", bench.plant.force_n);
        bench.grip(40.0).expect("taken over");
        bench.run(1000);
        assert!((bench.plant.force_n - 40.0).abs() < 0.1, "{most_bytes} bytes: {} N", bench.plant.force_n);
    }
}

/// The object was grasped by another program: no width is set here, so the grasp cannot be given again.
#[test]
fn without_a_width_a_force_that_does_not_follow_is_told_and_no_grasp_is_claimed() {
    let mut bench = Bench::holding("wsg50", allowing(), "fixed-limit,allow-regrasp", 20.0);
    bench.pair.driver = driver("wsg50", Config { part_width_mm: None, ..allowing() });
    bench.connect();
    bench.run(200);
    assert_eq!(bench.state().expect("there").jaws, Jaws::Holding);
    bench.grip(40.0).expect("taken over");
    let errors: Vec<Error> = (0..1000)
        .filter_map(|_| {
            bench.step();
            bench.state().err()
        })
        .collect();
    assert!(matches!(errors.as_slice(), [Error::Unset { key: "part_width_mm", .. }]), "{errors:?}");
    assert!(!bench.driver.is_busy());
    let path = bench.events.iter().find(|event| matches!(event, DriverEvent::ForcePath { .. }));
    assert_eq!(path, None);
    assert!(bench.least_n > 19.9, "{} N", bench.least_n);
}

/// The newest state says holding, but it is from before the release that was stopped.
#[test]
fn a_grasp_right_after_a_release_is_given_though_the_newest_state_still_says_holding() {
    for after_ms in (0..40).step_by(2) {
        let mut bench = Bench::holding("wsg50", allowing(), "", 20.0);
        bench.release().expect("taken over");
        bench.run(after_ms);
        bench.grip(20.0).expect("taken over");
        bench.run(3000);
        let state = bench.state().expect("there");
        assert_eq!(state.jaws, Jaws::Holding, "after {after_ms} ms: {state:?}");
        assert!((bench.plant.force_n - 20.0).abs() < 0.1, "after {after_ms} ms: {} N", bench.plant.force_n);
    }
}

/// A gripper that says what the test says.
struct Scripted(Driver<Wsg50>);

impl Scripted {
    /// Homed, with a limit of 20 N, in this state of the jaws.
    fn in_state(grasp: u8) -> Self {
        let mut scripted = Scripted(Driver::new("wsg50://hand", allowing(), Wsg50::default()));
        scripted.0.linked(0);
        scripted.tell(1, 0x40, &[1, 0, 0, 0]);
        scripted.tell(1, 0x41, &[grasp]);
        scripted.tell(1, 0x43, &50f32.to_le_bytes());
        scripted.tell(1, 0x45, &20f32.to_le_bytes());
        scripted.tell(1, 0x33, &20f32.to_le_bytes());
        scripted.sent();
        scripted
    }

    /// A state, or that a command was carried out.
    fn tell(&mut self, ms: u64, id: u8, rest: &[u8]) {
        let mut bytes = Vec::new();
        frame::write(&mut bytes, id, &[&[0, 0], rest].concat());
        self.0.receive(ms * MS, &bytes);
    }

    fn answer(&mut self, ms: u64, id: u8, status: u16) {
        let mut bytes = Vec::new();
        frame::write(&mut bytes, id, &status.to_le_bytes());
        self.0.receive(ms * MS, &bytes);
    }

    /// The commands sent since it was last asked: no request for a state.
    fn sent(&mut self) -> Vec<u8> {
        let mut ids = Vec::new();
        Parser::default().feed(&std::mem::take(self.0.outgoing()), |frame| ids.push(frame.id));
        ids.retain(|id| *id != 0x33 && !(0x40..=0x45).contains(id));
        ids
    }

    fn request(&mut self, ms: u64, command: GripCommand) {
        self.0.request(ms * MS, Request::Grip(command)).expect("taken over");
    }
}

/// A release of what is not held any more would be refused.
#[test]
fn a_release_after_a_stop_waits_for_what_the_jaws_do_now() {
    for (now, sent) in [(0u8, 0x21), (4, 0x26)] {
        let mut scripted = Scripted::in_state(0);
        scripted.request(2, GripCommand::Hold { force_n: 20.0 });
        scripted.answer(3, 0x25, 26); // it is under way
        scripted.tell(50, 0x41, &[4]); // it holds, but has not told its end
        assert_eq!(scripted.sent(), [0x25]);
        scripted.request(51, GripCommand::Release);
        assert_eq!(scripted.sent(), [0x22]);
        scripted.tell(60, 0x22, &[]);
        scripted.0.tick(62 * MS);
        assert_eq!(scripted.sent(), [0u8; 0], "what it said before the stop does not count");
        scripted.tell(70, 0x41, &[now]);
        assert_eq!(scripted.sent(), [sent]);
    }
}

/// The force follows its limit while the link stalls; the next states come one by one.
#[test]
fn a_force_from_before_a_stall_does_not_make_it_grasp_again() {
    let mut scripted = Scripted::in_state(4);
    scripted.request(10, GripCommand::Hold { force_n: 40.0 });
    assert_eq!(scripted.sent(), [0x32]);
    scripted.tell(20, 0x32, &[]);
    scripted.tell(30, 0x45, &21f32.to_le_bytes());
    for ms in [470, 475, 480] {
        scripted.tell(ms, 0x41, &[4]);
        scripted.0.tick(ms * MS);
    }
    assert_eq!(scripted.sent(), [0u8; 0]);
    scripted.tell(485, 0x45, &40f32.to_le_bytes());
    assert!(!scripted.0.is_busy() && scripted.sent().is_empty(), "it has followed");
    // One that has not followed by then is grasped again.
    scripted.request(490, GripCommand::Hold { force_n: 60.0 });
    scripted.tell(500, 0x32, &[]);
    scripted.tell(895, 0x45, &40f32.to_le_bytes());
    scripted.0.tick(905 * MS);
    assert_eq!(scripted.sent(), [0x32]);
    scripted.tell(910, 0x45, &40f32.to_le_bytes());
    assert_eq!(scripted.sent(), [0x25]);
}

/// It can no longer tell its force, and then it can.
#[test]
fn a_force_that_is_not_told_does_not_make_it_grasp_again() {
    let mut scripted = Scripted::in_state(4);
    scripted.request(10, GripCommand::Hold { force_n: 40.0 });
    scripted.tell(20, 0x32, &[]);
    scripted.answer(30, 0x45, 2); // no sensor
    for ms in (40..800).step_by(20) {
        scripted.tell(ms, 0x41, &[4]);
        scripted.0.tick(ms * MS);
    }
    assert_eq!(scripted.sent(), [0x32]);
    scripted.tell(800, 0x45, &21f32.to_le_bytes());
    assert!(scripted.0.is_busy(), "whether it follows is seen from now on");
    for ms in (820..1300).step_by(20) {
        scripted.tell(ms, 0x45, &21f32.to_le_bytes());
        scripted.0.tick(ms * MS);
    }
    assert_eq!(scripted.sent(), [0x25]);
}

#[test]
fn what_the_old_link_told_is_not_known_on_a_new_one() {
    let mut scripted = Scripted::in_state(4);
    for from_ms in [100, 200] {
        scripted.0.unlinked(from_ms * MS, "cut");
        scripted.0.linked(from_ms * MS);
        scripted.tell(from_ms + 1, 0x40, &[1, 0, 0, 0]);
        scripted.tell(from_ms + 1, 0x41, &[4]);
        let state = scripted.0.state((from_ms + 2) * MS).expect("it is there");
        assert_eq!((state.jaws, state.opening_mm, state.force_n), (Jaws::Unknown, None, None), "{from_ms}");
    }
    scripted.tell(210, 0x43, &50f32.to_le_bytes());
    let state = scripted.0.state(211 * MS).expect("it is there");
    assert_eq!((state.jaws, state.opening_mm, state.force_n), (Jaws::Holding, Some(50.0), None));
}

/// The answer to the stop is lost.
#[test]
fn a_release_survives_a_stop_that_is_never_answered() {
    let mut scripted = Scripted::in_state(0);
    scripted.request(2, GripCommand::Hold { force_n: 20.0 });
    scripted.answer(3, 0x25, 26); // it is under way
    scripted.request(51, GripCommand::Release);
    assert_eq!(scripted.sent(), [0x25, 0x22]);
    for ms in (60..600).step_by(20) {
        scripted.tell(ms, 0x41, &[1]);
        scripted.0.tick(ms * MS);
    }
    assert_eq!(scripted.sent(), [0x22], "again");
    scripted.tell(610, 0x22, &[]);
    scripted.tell(620, 0x41, &[0]);
    assert_eq!(scripted.sent(), [0x21], "and then it opens");
}
