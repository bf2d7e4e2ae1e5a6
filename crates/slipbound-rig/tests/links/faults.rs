//! What an emulator keeps holding when something fails, and what the driver reports. The object is never dropped: the
//! least force of every run is checked, not only the last.

use crate::bench::{Bench, MS, config};
use slipbound::port::{DriverEvent, Jaws};
use slipbound_rig::emulator::NAMES;
use slipbound_rig::gripper::config::{Config, Lowering};
use slipbound_rig::gripper::{Error, Request};

fn force_n(name: &str) -> f64 {
    if name.starts_with("robotiq") { 40.0 } else { 20.0 }
}

fn holding(name: &str, faults: &str) -> Bench {
    Bench::holding(name, config(name), faults, force_n(name))
}

/// The force on the block never fell below the requested one, less a step of the gripper.
fn assert_held(bench: &Bench, name: &str, what: &str) {
    assert!(bench.least_n > force_n(name) - 0.7, "{name}, {what}: {} N", bench.least_n);
}

#[test]
fn a_cut_link_leaves_the_force_and_a_new_one_changes_nothing() {
    for name in NAMES {
        let mut bench = holding(name, "");
        bench.cut("cut");
        let message = bench.state().expect_err("lost").to_string();
        assert!(message.contains("the link is lost (cut); the gripper keeps its force"), "{message}");
        assert!(matches!(bench.grip(60.0), Err(Error::Lost { .. })), "{name}");
        bench.run(3000);
        bench.sent = Some(Vec::new());
        bench.connect();
        bench.run(1000);
        assert_held(&bench, name, "cut and linked anew");
        if name.starts_with("robotiq") || name == "line" {
            assert_eq!(bench.state().expect("there").jaws, Jaws::Holding, "{name}");
            bench.grip(60.0).expect("taken over");
            bench.run(1000);
            assert!((bench.plant.force_n - 60.0).abs() < 0.7, "{name}: {}", bench.plant.force_n);
        }
    }
}

#[test]
fn a_stalled_link_is_told_and_then_goes_on() {
    for name in NAMES {
        let mut bench = holding(name, "stall=5000@8000");
        bench.run(8000 - bench.now_ns() / MS);
        let from_ns = bench.now_ns();
        let error = bench.until_error(700);
        assert!(matches!(error, Error::Silent { .. }), "{name}: {error}");
        assert!(bench.now_ns() - from_ns <= 540 * MS, "{name}");
        bench.run(6000);
        assert_held(&bench, name, "stalled for 5 s");
        while bench.state().is_err() {} // errors that are reported late
        assert_eq!(bench.state().expect("there").jaws, Jaws::Holding, "{name}");
    }
}

#[test]
fn a_half_open_link_is_told_and_the_force_stays() {
    for name in NAMES {
        let mut bench = holding(name, "");
        bench.is_delivering = false; // bytes are lost without an error
        let error = bench.until_error(700);
        assert!(matches!(error, Error::Silent { .. }), "{name}: {error}");
        bench.run(5000);
        assert!(matches!(bench.grip(60.0), Err(Error::Silent { .. })), "{name}");
        assert_held(&bench, name, "half open");
    }
}

#[test]
fn a_power_cycle_leaves_the_force_and_asks_for_home() {
    for name in NAMES {
        let mut bench = holding(name, "power-cycle@8000");
        bench.run(8000);
        assert!(!bench.is_connected(), "{name}");
        bench.connect();
        bench.run(500);
        assert_held(&bench, name, "power cycle");
        match name {
            // These do not report that they must be homed until they are commanded to move.
            "gcl" | "line" => {}
            _ => assert!(matches!(bench.grip(60.0), Err(Error::NotHomed { .. })), "{name}"),
        }
        assert_held(&bench, name, "asked to grip after a power cycle");
    }
}

#[test]
fn a_link_cut_without_farewell_latches_a_fast_stop_that_is_explained() {
    let mut bench = holding("wsg50", "");
    bench.cut("cut");
    bench.run(500);
    bench.connect();
    bench.run(200);
    assert_eq!(bench.state().expect("there").jaws, Jaws::Stopped);
    let message = bench.grip(30.0).expect_err("stopped").to_string();
    for part in ["latched fast stop", "our last link to it was cut without a farewell", "acknowledge it"] {
        assert!(message.contains(part), "{message}");
    }
    assert!(bench.events.iter().any(|event| matches!(event, DriverEvent::FastStop { .. })), "{:?}", bench.events);
    bench.request(Request::Acknowledge).expect("taken over");
    bench.run(200);
    assert_held(&bench, "wsg50", "acknowledged");
    assert_eq!(bench.state().expect("there").jaws, Jaws::Open, "it does not know that it presses, but we do:");
    assert!(matches!(bench.grip(10.0), Err(Error::Lowering { .. })));
    assert!(matches!(bench.request(Request::Home), Err(Error::Refused { .. })));
    bench.grip(30.0).expect("taken over");
    bench.until(2000, |state| state.jaws == Jaws::Holding);
    bench.run(1000);
    assert_held(&bench, "wsg50", "gripped again");
    assert!((bench.plant.force_n - 30.0).abs() < 0.1, "{}", bench.plant.force_n);
}

#[test]
fn our_own_fast_stop_is_acknowledged_if_the_settings_say_so_and_no_other() {
    let config = Config { acknowledge_own_fast_stop: true, lowering: Lowering::Allow, ..config("wsg50") };
    let mut bench = Bench::holding("wsg50", config.clone(), "", 20.0);
    bench.cut("cut");
    bench.run(500);
    bench.connect();
    bench.run(200);
    assert!(bench.events.contains(&DriverEvent::Acknowledged), "{:?}", bench.events);
    bench.grip(25.0).expect("taken over");
    bench.until(2000, |state| state.jaws == Jaws::Holding);
    assert_held(&bench, "wsg50", "acknowledged by itself");

    let mut bench = Bench::holding("wsg50", config, "fast-stop@6000", 20.0);
    bench.until(6000, |state| state.jaws == Jaws::Stopped);
    bench.run(1000);
    let message = bench.grip(25.0).expect_err("stopped").to_string();
    assert!(message.contains("no fault is reported"), "{message}");
    assert_held(&bench, "wsg50", "fast stop");
}

/// A link that ended after a farewell has latched nothing; a fast stop long after it has another cause.
#[test]
fn a_fast_stop_of_somebody_else_is_not_acknowledged_because_a_link_was_lost_before() {
    let config = Config { acknowledge_own_fast_stop: true, ..config("wsg50") };
    let mut bench = Bench::holding("wsg50", config, "fast-stop@8000", 20.0);
    bench.request(Request::Leave).expect("taken over");
    bench.cut("closed");
    bench.connect();
    bench.run(1000);
    assert_eq!(bench.state().expect("there").jaws, Jaws::Holding);
    bench.run(8000 - bench.now_ns() / MS + 100);
    assert!(!bench.events.contains(&DriverEvent::Acknowledged), "{:?}", bench.events);
    assert_eq!(bench.state().expect("there").jaws, Jaws::Stopped);
    let message = bench.grip(30.0).expect_err("stopped").to_string();
    assert!(message.contains("somebody sent a fast stop"), "{message}");
    assert_held(&bench, "wsg50", "stopped by somebody else");
}

#[test]
fn after_a_farewell_no_fast_stop_latches() {
    for name in ["wsg50", "gcl"] {
        let mut bench = holding(name, "");
        bench.request(Request::Leave).expect("taken over");
        bench.run(20);
        bench.cut("cut");
        bench.run(500);
        bench.connect();
        bench.run(200);
        assert_eq!(bench.state().expect("there").jaws, Jaws::Holding, "{name}");
        assert_held(&bench, name, "left and linked anew");
        if name == "wsg50" {
            assert_eq!(bench.state().expect("there").target_n, Some(20.0), "asked of the gripper");
            bench.grip(30.0).expect("taken over");
            bench.run(1000);
            assert!((bench.plant.force_n - 30.0).abs() < 0.1, "{}", bench.plant.force_n);
        }
    }
}

#[test]
fn a_refused_force_is_told_and_the_old_one_stays() {
    let mut bench = holding("wsg50", "refuse-force@6000");
    bench.run(6000);
    bench.grip(30.0).expect("not yet known to be refused");
    let message = bench.until_error(500).to_string();
    assert!(message.contains("expected set force limit to be done, got status 28, out of range"), "{message}");
    bench.run(1000);
    assert_eq!(bench.state().expect("there").target_n, Some(20.0));
    assert_held(&bench, "wsg50", "refused");
}
