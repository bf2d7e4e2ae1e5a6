//! A command whose answer is lost. The gripper may have accepted it or not: neither is assumed, and the same force is
//! sent again when it is requested again.

use crate::bench::{Bench, MS, config};
use slipbound::port::{GripCommand, Jaws};
use slipbound_rig::emulator::NAMES;
use slipbound_rig::gripper::config::{Config, Lowering};
use slipbound_rig::gripper::wsg50::frame;
use slipbound_rig::gripper::{Error, Request};
use slipbound_rig::link::Endpoint;

fn hold(force_n: f64) -> GripCommand {
    GripCommand::Hold { force_n }
}

/// The answer to a new force, and how far it reaches: to the end of the line, or these bytes only.
fn answer_to_force(name: &str) -> (&'static [u8], bool) {
    match name {
        "wsg50" => (&[0xAA, 0xAA, 0xAA, 0x32, 2, 0, 0, 0], false),
        "gcl" => (b"ACK GRIP", true),
        "line" => (b"ACK", true),
        "robotiq" => (b"ack", false),
        _ => (&[0x09, 0x10, 0x03, 0xE8, 0, 3, 1, 0x30], false),
    }
}

/// Without the answers to new forces.
fn without_answers(name: &str, mut bytes: Vec<u8>) -> Vec<u8> {
    let (answer, is_line) = answer_to_force(name);
    while let Some(at) = bytes.windows(answer.len()).position(|window| window == answer) {
        let line = bytes[at..].iter().position(|byte| *byte == b'\n').map(|end| end + 1);
        let length = line.filter(|_| is_line).unwrap_or(answer.len());
        bytes.drain(at..at + length);
    }
    bytes
}

/// Gives a command, and drops every answer to a new force for this many ms; everything else comes through. An error
/// from the driver ends it sooner.
fn lose_answers(bench: &mut Bench, name: &str, command: GripCommand, most_ms: u64) -> Option<Error> {
    bench.is_delivering = false;
    bench.request(Request::Grip(command)).expect("taken over");
    let until_ns = bench.now_ns() + most_ms * MS;
    let mut error = None;
    while error.is_none() && bench.now_ns() < until_ns {
        bench.step();
        let now_ns = bench.now_ns();
        for _ in 0..4 {
            let ours = std::mem::take(bench.driver.outgoing());
            bench.emulator.receive(now_ns, &ours);
            let theirs = without_answers(name, std::mem::take(bench.emulator.outgoing()));
            bench.pair.driver.receive(now_ns, &theirs);
        }
        // A serial line says nothing while it waits for an answer.
        error = bench.driver.state(now_ns).err().filter(|error| !matches!(error, Error::Silent { .. }));
    }
    bench.is_delivering = true;
    error
}

#[test]
fn a_force_asked_for_again_after_an_unanswered_one_is_sent_again() {
    let pressed_n = NAMES.map(|name| {
        let allowing = Config { lowering: Lowering::Allow, ..config(name) };
        let mut bench = Bench::holding(name, allowing, "allow-regrasp", 40.0);
        let error = lose_answers(&mut bench, name, hold(25.0), 2000);
        assert!(matches!(error, Some(Error::Unanswered { .. })), "{name}: {error:?}");
        bench.run(1000);
        assert!((bench.plant.force_n - 25.0).abs() < 0.7, "{name} has taken it over: {} N", bench.plant.force_n);
        bench.grip(40.0).expect("taken over");
        bench.run(3000);
        assert!(!bench.driver.is_busy(), "{name}");
        bench.plant.force_n
    });
    assert!(pressed_n.iter().all(|force_n| (force_n - 40.0).abs() < 0.7), "{NAMES:?}: {pressed_n:?} N");
}

/// It may hold with the higher force of the two: no lower one is admitted where lowering is refused.
#[test]
fn after_an_unanswered_higher_force_lowering_counts_from_that_one() {
    let pressed_n = NAMES.map(|name| {
        let refusing = Config { lowering: Lowering::Refuse, ..config(name) };
        let mut bench = Bench::holding(name, refusing, "allow-regrasp", 40.0);
        lose_answers(&mut bench, name, hold(60.0), 2000);
        let _ = bench.grip(50.0); // refused, or 60 N are given
        bench.run(2000);
        bench.plant.force_n
    });
    assert!(pressed_n.iter().all(|force_n| (force_n - 60.0).abs() < 0.7), "{NAMES:?}: {pressed_n:?} N");
}

#[test]
fn while_a_higher_force_is_on_its_way_no_lower_one_follows_it() {
    let pressed_n = NAMES.map(|name| {
        let refusing = Config { lowering: Lowering::Refuse, ..config(name) };
        let mut bench = Bench::holding(name, refusing, "late=30,allow-regrasp", 40.0);
        bench.grip(60.0).expect("taken over");
        bench.run(40); // by then it is sent
        for _ in 0..100 {
            let lower = bench.grip(50.0);
            assert!(matches!(lower, Ok(()) | Err(Error::Lowering { .. })), "{name}: {lower:?}");
            bench.step();
        }
        bench.run(2000);
        bench.plant.force_n
    });
    assert!(pressed_n.iter().all(|force_n| (force_n - 60.0).abs() < 0.7), "{NAMES:?}: {pressed_n:?} N");
}

/// The same where the link ends before the answer comes.
#[test]
fn after_a_link_that_took_the_answer_with_it_lowering_counts_from_the_higher_force() {
    let pressed_n = NAMES.map(|name| {
        let refusing = Config { lowering: Lowering::Refuse, ..config(name) };
        let mut bench = Bench::holding(name, refusing, "allow-regrasp", 40.0);
        assert!(lose_answers(&mut bench, name, hold(60.0), 400).is_none(), "{name}: not yet given up");
        bench.cut("cut");
        bench.connect();
        bench.run(400);
        if let Ok(()) = bench.request(Request::Acknowledge) {
            bench.run(200);
        }
        let _ = bench.grip(50.0); // as above
        bench.run(2000);
        bench.plant.force_n
    });
    assert!(pressed_n.iter().all(|force_n| *force_n > 58.0), "{NAMES:?}: {pressed_n:?} N");
}

/// The text interface forbids a new force while holding; its present force may still be requested.
#[test]
fn a_force_that_was_never_answered_and_then_is_denied_leaves_the_old_one_known() {
    let mut bench = Bench::holding("gcl", Config { lowering: Lowering::Allow, ..config("gcl") }, "", 20.0);
    bench.is_delivering = false;
    bench.grip(30.0).expect("taken over");
    for _ in 0..240 {
        bench.step();
        let now_ns = bench.now_ns();
        let questions = String::from_utf8(std::mem::take(bench.driver.outgoing())).expect("ASCII");
        let questions = questions.replace("GRIP(30.00,50.00,50.00)\n", "");
        bench.emulator.receive(now_ns, questions.as_bytes());
        let theirs = std::mem::take(bench.emulator.outgoing());
        bench.pair.driver.receive(now_ns, &theirs);
    }
    bench.is_delivering = true;
    assert!(matches!(bench.state(), Err(Error::Unanswered { .. })), "the command was lost");
    bench.grip(20.0).expect("it may have been taken over");
    let message = bench.until_error(500).to_string();
    assert!(message.contains("a new force while holding"), "{message}");
    for _ in 0..10 {
        bench.grip(20.0).expect("the force it has");
        bench.run(50);
        assert_eq!(bench.state().expect("there").target_n, Some(20.0));
    }
}

/// A step in which this question of ours, or the states of a WSG-50 with this number, are lost on the way.
fn step_without(bench: &mut Bench, lost: &str) {
    bench.is_delivering = false;
    bench.step();
    let now_ns = bench.now_ns();
    for _ in 0..4 {
        let mut ours = std::mem::take(bench.driver.outgoing());
        if let Some(at) = ours.windows(lost.len()).position(|window| lost.len() > 1 && window == lost.as_bytes()) {
            ours.drain(at..at + lost.len());
        }
        bench.emulator.receive(now_ns, &ours);
        let mut theirs = std::mem::take(bench.emulator.outgoing());
        if let [id] = lost.as_bytes() {
            let mut kept = Vec::new();
            frame::Parser::default().feed(&theirs, |frame| {
                if frame.id != *id {
                    frame::write(&mut kept, frame.id, frame.payload());
                }
            });
            theirs = kept;
        }
        bench.pair.driver.receive(now_ns, &theirs);
    }
    bench.is_delivering = true;
}

/// Somebody may have opened them meanwhile.
#[test]
fn jaws_that_are_no_longer_told_of_are_a_fault_and_get_no_new_force() {
    for (name, lost) in [("wsg50", "\x40"), ("wsg50", "\x41"), ("gcl", "GRIPSTATE?\n"), ("robotiq", "GET OBJ\n")] {
        let mut bench = Bench::holding(name, config(name), "allow-regrasp", 40.0);
        for _ in 0..600 {
            step_without(&mut bench, lost);
        }
        let now_ns = bench.now_ns();
        let told = bench.driver.state(now_ns).expect_err(name).to_string();
        assert!(told.contains("what the jaws do, got only other answers for 1"), "{name}: {told}");
        assert!(matches!(bench.grip(60.0), Err(Error::Untold { .. })), "{name}");
        for _ in 0..500 {
            step_without(&mut bench, lost);
        }
        assert!((bench.plant.force_n - 40.0).abs() < 0.7, "{name}: {} N", bench.plant.force_n);
        bench.run(500);
        assert_eq!(bench.state().expect("told again").jaws, Jaws::Holding, "{name}");
        bench.grip(60.0).expect("taken over");
    }
}

#[test]
fn a_force_or_an_opening_that_is_no_longer_told_is_not_known() {
    for (name, force, opening) in [("wsg50", "\x45", "\x43"), ("gcl", "FORCE?\n", "POS?\n")] {
        for (lost, is_known) in [(force, (false, true)), (opening, (true, false))] {
            let mut bench = Bench::holding(name, config(name), "", 40.0);
            for _ in 0..600 {
                step_without(&mut bench, lost);
            }
            let now_ns = bench.now_ns();
            let state = bench.driver.state(now_ns).expect("the jaws are told");
            assert_eq!((state.force_n.is_some(), state.opening_mm.is_some()), is_known, "{name} {lost:?}");
        }
    }
}

#[test]
fn a_slow_gripper_whose_force_keeps_changing_tells_what_its_jaws_do() {
    for name in NAMES {
        let allowing = Config { lowering: Lowering::Allow, ..config(name) };
        let mut bench = Bench::new(name, allowing, "late=300,allow-regrasp");
        bench.run(4000);
        bench.grip(40.0).expect("taken over");
        bench.until(8000, |state| state.jaws == Jaws::Holding);
        for cycle in 0..1000 {
            let state = bench.state().unwrap_or_else(|error| panic!("{name}: {error}"));
            let age_ms = (bench.now_ns() - state.time_ns) / MS;
            // The socket of a Robotiq takes five questions, with a command before each.
            assert!(age_ms < 3100, "{name}: its state is {age_ms} ms old");
            bench.grip(40.0 + f64::from(cycle % 59)).expect("taken over");
            bench.run(10);
        }
    }
}

/// A 2F-85 that does not tell its position has opened when it says so. Nor does a release close on what it holds.
#[test]
fn a_gripper_that_no_longer_tells_its_opening_opens_wide_and_is_homed_after_a_release() {
    let narrow = Config { part_width_mm: None, open_mm: 40.0, ..config("robotiq") };
    let mut bench = Bench::holding("robotiq", narrow, "", 40.0);
    let run = |bench: &mut Bench| (0..600).for_each(|_| step_without(bench, "GET POS\n"));
    run(&mut bench);
    assert!(matches!(bench.request(Request::Home), Err(Error::Refused { .. })));
    bench.release().expect("taken over");
    run(&mut bench);
    let state = bench.state().expect("there");
    assert_eq!((state.jaws, state.opening_mm, bench.plant.force_n), (Jaws::Open, None, 0.0));
    bench.request(Request::Home).expect("open jaws hold nothing");
}

/// What a loop is left with is asked for once: the grip before it must not take it along.
#[test]
fn a_force_requested_while_an_older_one_is_on_its_way_is_set_though_the_older_one_is_never_answered() {
    let pressed_n = NAMES.map(|name| {
        let mut bench = Bench::holding(name, config(name), "allow-regrasp", 40.0);
        assert!(lose_answers(&mut bench, name, hold(60.0), 100).is_none(), "{name}: it is waited for");
        let error = lose_answers(&mut bench, name, hold(70.0), 2000);
        // On a serial line the newer one is in flight by then, as silent as the older one.
        let is_told = matches!(error, Some(Error::Unanswered { .. }));
        assert!(is_told || name == "robotiq-rtu", "{name}: {error:?}");
        bench.run(3000);
        assert!(!bench.driver.is_busy(), "{name}");
        bench.plant.force_n
    });
    assert!(pressed_n.iter().all(|force_n| (force_n - 70.0).abs() < 0.7), "{NAMES:?}: {pressed_n:?} N");
}

/// The grip is refused, or its answer is lost.
#[test]
fn a_release_requested_while_a_grip_is_on_its_way_is_given_whatever_becomes_of_the_grip() {
    for name in NAMES {
        let mut bench = Bench::holding(name, config(name), "allow-regrasp", 40.0);
        assert!(lose_answers(&mut bench, name, hold(60.0), 100).is_none(), "{name}: it is waited for");
        let error = lose_answers(&mut bench, name, GripCommand::Release, 2000);
        // On a serial line the release is in flight by then, as silent as the grip.
        let is_told = matches!(error, Some(Error::Unanswered { .. }));
        assert!(is_told || name == "robotiq-rtu", "{name}: {error:?}");
        bench.run(2000);
        assert_eq!(bench.plant.force_n, 0.0, "{name}");
    }
    // An emulated 2F-85 that refuses forces refuses to open, too: both are one command.
    for name in ["wsg50", "gcl", "line"] {
        for after_ms in (0..50).step_by(10) {
            let mut bench = Bench::holding(name, config(name), "late=30,refuse-force@6000", 40.0);
            bench.run(6000 - bench.now_ns() / MS);
            bench.grip(60.0).expect("taken over");
            bench.run(after_ms);
            bench.release().expect("taken over");
            bench.run(3000);
            assert_eq!(bench.plant.force_n, 0.0, "{name} after {after_ms} ms");
        }
    }
}
