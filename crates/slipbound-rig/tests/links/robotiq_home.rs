//! Homing of a Robotiq 2F-85, both ways: it is deactivated and activated again.

use crate::bench::{Bench, MS, config, driver};
use crate::client::modbus;
use crate::robotiq::{BOTH, allowing, answer};
use slipbound::port::Jaws;
use slipbound_rig::gripper::robotiq::rtu;
use slipbound_rig::gripper::{Error, Request};
use slipbound_rig::link::Endpoint;

#[test]
fn activation_is_asked_for_and_never_done_by_itself() {
    for name in BOTH {
        let mut bench = Bench::new(name, allowing(), "power-cycle@100");
        bench.run(200);
        bench.connect();
        bench.run(300);
        assert_eq!(bench.state().expect("there").jaws, Jaws::Unknown);
        assert!(matches!(bench.grip(40.0), Err(Error::NotHomed { .. })), "{name}");
        bench.request(Request::Home).expect("taken over");
        bench.run(10);
        assert!(bench.driver.is_busy() && matches!(bench.grip(40.0), Err(Error::NotHomed { .. })), "{name}");
        bench.until(3000, |state| state.jaws == Jaws::Open);
        bench.run(300);
        assert!(!bench.driver.is_busy(), "{name}");
        bench.grip(40.0).expect("taken over");
        bench.until(3000, |state| state.jaws == Jaws::Holding);
        assert!(matches!(bench.request(Request::Home), Err(Error::Refused { .. })), "{name}: something is held");
    }
}

#[test]
fn home_after_a_fault_clears_what_the_jaws_were_told() {
    for name in BOTH {
        let mut bench = Bench::holding(name, config(name), "fast-stop@6000", 100.0);
        bench.until(6000, |state| state.jaws == Jaws::Stopped);
        bench.request(Request::Home).expect("taken over");
        bench.until(3000, |state| state.jaws == Jaws::Open);
        bench.run(2000);
        let state = bench.state().expect("there");
        assert_eq!((state.jaws, bench.plant.force_n), (Jaws::Open, 0.0), "{name}");
        assert_eq!(state.target_n, Some(20.0), "{name}: homing sends the force number 0");
    }
}

/// Its status follows 30 ms behind what it was told, and activation takes a second.
#[test]
fn homing_waits_for_a_status_that_follows_late() {
    for name in BOTH {
        let mut driver = driver(name, allowing());
        driver.linked(0);
        let (mut told, mut done_ms) = (vec![(0, true)], 0);
        for now_ms in 2000..5000u64 {
            driver.tick(now_ms * MS);
            if now_ms == 2500 {
                driver.request(now_ms * MS, Request::Home).expect("nothing is held");
            }
            let asked = std::mem::take(driver.outgoing());
            told.extend(
                activates(&asked).filter(|is_active| *is_active != told[told.len() - 1].1).map(|a| (now_ms, a)),
            );
            let (since_ms, is_active) = told[told.len() - 1];
            let activation = match (is_active, now_ms - since_ms) {
                (false, 0..30) => 3,
                (false, _) | (true, 0..30) => 0,
                (true, 30..1000) => 1,
                (true, _) => 3,
            };
            driver.receive(now_ms * MS, &answer(name, &asked, activation, 1, 0));
            if driver.is_busy() {
                done_ms = now_ms;
            }
        }
        let [_, (off_ms, false), (on_ms, true)] = told[..] else { panic!("{name}: {told:?}") };
        assert!(off_ms >= 2500 && on_ms >= off_ms + 30, "{name}: {told:?}");
        assert!((on_ms + 995..on_ms + 1050).contains(&done_ms), "{name}: {told:?}, done at {done_ms} ms");
    }
}

/// Whether what was sent activates the gripper (true) or deactivates it.
fn activates(sent: &[u8]) -> Option<bool> {
    let mut activates = None;
    rtu::Parser::default().feed_requests(sent, |request| {
        if let rtu::Request::Write { bytes, .. } = request {
            activates = Some(bytes[0] & 1 != 0);
        }
    });
    activates.or(sent.strip_prefix(b"SET ACT ").map(|rest| rest[0] == b'1'))
}

/// The activation is refused, and homing is asked for again.
#[test]
fn a_homing_that_was_refused_half_way_begins_anew_when_it_is_asked_for_again() {
    let mut driver = driver("robotiq-rtu", allowing());
    driver.linked(0);
    let (mut written, mut is_refusing) = (Vec::new(), true);
    let mut run = |driver: &mut slipbound_rig::gripper::Driver, from_ms: u64, is_refusing: bool| {
        for ms in from_ms..from_ms + 1000 {
            driver.tick(ms * MS);
            let asked = std::mem::take(driver.outgoing());
            let activated = activates(&asked);
            written.extend(activated);
            let refused = activated == Some(true) && is_refusing;
            let activation =
                if written.last() == Some(&false) || written.last() == Some(&true) && is_refusing { 0 } else { 3 };
            let said = if refused { modbus("09 90 04") } else { answer("robotiq-rtu", &asked, activation, 3, 0) };
            driver.receive(ms * MS, &said);
        }
        (std::mem::take(&mut written), driver.is_busy(), driver.state((from_ms + 1000) * MS).is_err())
    };
    run(&mut driver, 1, is_refusing);
    driver.request(1001 * MS, Request::Home).expect("nothing is held");
    assert_eq!(run(&mut driver, 1001, is_refusing), (vec![false, true], false, true), "refused, and told");
    is_refusing = false;
    driver.request(2001 * MS, Request::Home).expect("not active");
    assert_eq!(run(&mut driver, 2001, is_refusing), (vec![false, true], false, false));
}
