//! What every driver guarantees, whatever its protocol: tested with a protocol that only records its calls.

use crate::bench::{Bench, MS, config, driver};
use slipbound::port::{DriverEvent, GripCommand, Gripper, Jaws};
use slipbound_rig::emulator::NAMES;
use slipbound_rig::gripper::config::{Config, Kind, Lowering};
use slipbound_rig::gripper::{Driver, DriverState, Error, Protocol, Request};
use slipbound_rig::link::Endpoint;
use std::sync::{Arc, Mutex};

/// Sends bytes whenever it may, takes the first byte received as its force, and records its commands.
#[derive(Default)]
struct Recorder {
    commands: Arc<Mutex<Vec<GripCommand>>>,
}

impl Protocol for Recorder {
    fn linked(&mut self, _driver: &mut DriverState) {}

    fn receive(&mut self, driver: &mut DriverState, bytes: &[u8]) {
        driver.heard();
        driver.gripper.force_n = bytes.first().map(|byte| f64::from(*byte));
        driver.gripper.jaws = Jaws::Holding;
    }

    fn tick(&mut self, driver: &mut DriverState) {
        driver.outgoing.push(b't');
    }

    fn advance(&mut self, driver: &mut DriverState) {
        driver.outgoing.push(b'.');
    }

    fn check_ready(&self, driver: &DriverState) -> Result<(), Error> {
        match driver.gripper.jaws {
            Jaws::Unknown => Err(Error::NotReady { address: driver.address(), expected: "a byte" }),
            _ => Ok(()),
        }
    }

    fn grip(&mut self, driver: &mut DriverState, command: GripCommand) -> Result<(), Error> {
        driver.gripper.target_n = command.force_n();
        self.commands.lock().expect("no panic").push(command);
        Ok(())
    }

    fn home(&mut self, driver: &mut DriverState) -> Result<(), Error> {
        driver.raise_refused("home", "the first");
        driver.raise_refused("home", "the second");
        Ok(())
    }

    fn leave(&mut self, driver: &mut DriverState) {
        driver.outgoing.extend(b"bye");
    }

    fn is_busy(&self, driver: &DriverState) -> bool {
        driver.is_linked() && driver.gripper.jaws == Jaws::Unknown
    }
}

/// Linked at time 0, with 20 N measured; and the commands its protocol received.
fn holding() -> (Driver<Recorder>, Arc<Mutex<Vec<GripCommand>>>) {
    let recorder = Recorder::default();
    let commands = recorder.commands.clone();
    let mut driver = Driver::new("any://hand", Config::of(Kind::Wsg50), recorder);
    driver.linked(0);
    driver.receive(0, &[20]);
    (driver, commands)
}

fn hold(force_n: f64) -> Request {
    Request::Grip(GripCommand::Hold { force_n })
}

#[test]
fn a_force_reaches_a_protocol_only_after_it_was_admitted() {
    let (mut driver, commands) = holding();
    assert!(matches!(driver.request(1, hold(f64::NAN)), Err(Error::Force { .. })));
    assert!(matches!(driver.request(1, hold(19.0)), Err(Error::Lowering { .. })));
    assert_eq!(commands.lock().expect("no panic").len(), 0);
    driver.request(1, hold(25.0)).expect("more");
    driver.request(1, hold(500.0)).expect("clamped");
    driver.request(1, hold(500.0)).expect("clamped again, reported once");
    driver.permit_lowering(true);
    driver.request(1, hold(1.0)).expect("clamped from below");
    driver.request(1, Request::Grip(GripCommand::Release)).expect("released");
    let held = [25.0, 80.0, 80.0, 5.0].map(|force_n| GripCommand::Hold { force_n });
    let expected: Vec<GripCommand> = held.into_iter().chain([GripCommand::Release]).collect();
    assert_eq!(*commands.lock().expect("no panic"), expected);
    let events: Vec<DriverEvent> = std::iter::from_fn(|| driver.next_event()).collect();
    let clamped = |asked_n, given_n| DriverEvent::Clamped { asked_n, given_n };
    assert_eq!(events, [DriverEvent::Linked, clamped(500.0, 80.0), clamped(1.0, 5.0)]);
}

/// Steps below the resolution must not add up.
#[test]
fn many_steps_too_small_to_be_refused_lower_nothing() {
    let (mut driver, commands) = holding();
    driver.request(1, hold(40.0)).expect("more");
    let mut asked_n = 40.0;
    for _ in 0..1000 {
        asked_n -= 0.009;
        let _ = driver.request(1, hold(asked_n)); // refused, or 40 N are given
    }
    let least_n = commands.lock().expect("no panic").iter().filter_map(|command| command.force_n()).reduce(f64::min);
    assert_eq!(least_n, Some(40.0));
}

/// It is asked and cannot have answered yet.
#[test]
fn a_pause_of_ours_is_no_silence_of_a_gripper_that_speaks_only_when_it_is_asked() {
    for name in ["gcl", "robotiq", "robotiq-rtu"] {
        let mut bench = Bench::of(name, "");
        bench.run(1000);
        let now_ns = bench.now_ns() + 700 * MS;
        bench.driver.tick(now_ns);
        bench.driver.state(now_ns).unwrap_or_else(|error| panic!("{name}: {error}"));
        for ms in 0..600 {
            bench.driver.tick(now_ns + ms * MS);
        }
        let silent = bench.driver.state(now_ns + 600 * MS);
        assert!(matches!(silent, Err(Error::Silent { .. })), "{name}: {silent:?}");
    }
    // Whether more is to come of this answer is not yet known.
    let mut driver = driver("robotiq", config("robotiq"));
    driver.linked(0);
    driver.receive(700 * MS, b"STA 3");
    driver.state(700 * MS).expect("it is there");
}

#[test]
fn a_gripper_that_is_not_ready_gets_no_command() {
    let recorder = Recorder::default();
    let commands = recorder.commands.clone();
    let mut driver = Driver::new("any://hand", Config::of(Kind::Wsg50), recorder);
    assert!(matches!(driver.request(1, hold(20.0)), Err(Error::Lost { .. })));
    assert!(driver.outgoing().is_empty() && !driver.is_busy(), "no link, nothing to send");
    driver.tick(1);
    assert!(driver.outgoing().is_empty());
    driver.linked(2);
    assert!(driver.is_busy());
    assert!(matches!(driver.request(3, hold(20.0)), Err(Error::NotReady { .. })));
    driver.receive(4, &[0]);
    assert!(matches!(driver.request(4 + 501 * MS, hold(20.0)), Err(Error::Silent { got_ms: 501, .. })));
    assert_eq!(commands.lock().expect("no panic").len(), 0);
}

#[test]
fn nothing_is_sent_after_the_farewell_nor_left_over_for_the_next_link() {
    let (mut driver, _) = holding();
    driver.tick(1);
    driver.outgoing().clear();
    driver.request(2, Request::Leave).expect("linked");
    driver.tick(3);
    driver.receive(4, &[20]);
    driver.request(5, hold(30.0)).expect("the link is still up");
    assert_eq!(driver.outgoing(), b"bye");
    driver.unlinked(6, "closed");
    assert!(driver.outgoing().is_empty());
    assert!(matches!(driver.request(7, Request::Leave), Err(Error::Lost { .. })));
    driver.linked(8);
    driver.tick(8);
    assert_eq!(driver.outgoing(), b".t.", "sends again");
    driver.linked(8); // whoever moves the bytes may see a new link before the end of the old one
    assert_eq!(driver.outgoing(), b".");
    // A silent link still takes a farewell.
    driver.request(9 + 600 * MS, Request::Leave).expect("linked");
}

#[test]
fn the_first_fault_is_reported_once_and_none_outlives_its_link() {
    let (mut driver, _) = holding();
    driver.request(1, Request::Home).expect("taken over");
    let message = driver.state(2).expect_err("a fault").to_string();
    assert!(message.contains("got the first"), "{message}");
    assert_eq!(driver.state(3).expect("once").force_n, Some(20.0));
    driver.request(4, Request::Home).expect("taken over");
    driver.unlinked(5, "cut");
    assert!(matches!(driver.state(6), Err(Error::Lost { .. })), "the link comes first");
    driver.linked(7);
    let unheard = driver.state(8).expect_err("nothing has been received on the new link").to_string();
    assert!(unheard.contains("link is lost (cut)"), "{unheard}");
    driver.receive(8, &[20]);
    assert_eq!(driver.state(8).expect("a new link").force_n, Some(20.0));
    assert!(
        matches!(driver.request(9, Request::Acknowledge), Err(Error::Unable { .. })),
        "where it has no word for it"
    );
}

#[test]
fn events_are_kept_up_to_a_number_the_oldest_go_first() {
    let (mut driver, _) = holding();
    for i in 0..100 {
        driver.request(1, hold(100.0 + f64::from(i))).expect("clamped");
    }
    let events: Vec<DriverEvent> = std::iter::from_fn(|| driver.next_event()).collect();
    assert_eq!(events.len(), 64);
    assert_eq!(events.last(), Some(&DriverEvent::Clamped { asked_n: 199.0, given_n: 80.0 }));
}

/// Another program, with other settings, has gripped.
#[test]
fn what_is_held_with_more_than_most_n_is_told_and_not_loosened() {
    for name in NAMES.into_iter().filter(|name| *name != "robotiq-rtu") {
        let mut bench = Bench::holding(name, config(name), "", 62.0);
        bench.request(Request::Leave).expect("linked");
        bench.run(100);
        bench.cut("closed");
        bench.pair.driver = driver(name, Config { most_n: 30.0, lowering: Lowering::Refuse, ..config(name) });
        bench.connect();
        bench.run(400);
        let state = bench.state().expect("there");
        assert!(state.force_n.or(state.target_n).is_some_and(|n| (n - 62.0).abs() < 0.5), "{name}: {state:?}");
        assert!(matches!(bench.grip(30.0), Err(Error::Lowering { from_n: 61.5..62.5, .. })), "{name}");
    }
}

/// Through the port alone, as the loop sees any gripper.
#[test]
fn the_port_tells_busy_and_events() {
    let mut bench = Bench::of("line", "");
    let gripper: &mut dyn Gripper = &mut bench.pair;
    gripper.poll_io();
    assert_eq!(gripper.next_event(), Some(DriverEvent::Linked));
    assert!(gripper.is_busy(), "its first state has not come");
    bench.run(100);
    let gripper: &mut dyn Gripper = &mut bench.pair;
    assert!(!gripper.is_busy() && gripper.next_event().is_none());
    gripper.command(GripCommand::Hold { force_n: 900.0 }).expect("clamped");
    assert_eq!(gripper.next_event(), Some(DriverEvent::Clamped { asked_n: 900.0, given_n: 80.0 }));
    let mut dry = slipbound_rig::gripper::open("dry", None).expect("opens");
    let command = GripCommand::Hold { force_n: 12.0 };
    dry.command(command).expect("taken over");
    assert_eq!((dry.is_busy(), dry.next_event()), (false, Some(DriverEvent::Dry { command })));
}
