//! Robotiq 2F-85, both ways, in lock-step.

use crate::bench::{Bench, MS, config, driver};
use crate::client::modbus;
use slipbound::port::{GripCommand, Jaws};
use slipbound_rig::gripper::config::{Config, Lowering};
use slipbound_rig::gripper::robotiq::rtu;
use slipbound_rig::gripper::{Driver, Error, Request};
use slipbound_rig::link::Endpoint;

pub const BOTH: [&str; 2] = ["robotiq-rtu", "robotiq"];

pub fn allowing() -> Config {
    Config { lowering: Lowering::Allow, ..config("robotiq") }
}

#[test]
fn a_block_is_gripped_by_steps_of_force_and_released() {
    for name in BOTH {
        for chunk in [1, 4, usize::MAX] {
            let mut bench = Bench::new(name, allowing(), "");
            bench.most_bytes = chunk;
            bench.run(200);
            assert_eq!(bench.state().expect("there").jaws, Jaws::Open, "{name}");
            bench.grip(40.0).expect("taken over");
            bench.until(3000, |state| state.jaws == Jaws::Holding);
            for force_n in [40.0, 60.0, 100.0, 50.0] {
                bench.grip(force_n).expect("taken over");
                bench.run(1000);
                let state = bench.state().expect("there");
                assert_eq!((state.jaws, state.force_n), (Jaws::Holding, None), "{name}");
                // 0.84 N is a step of the 256, 0.5 N the emulator's own.
                assert!(state.target_n.is_some_and(|target_n| (target_n - force_n).abs() < 0.43), "{name}: {state:?}");
                assert!((bench.plant.force_n - force_n).abs() < 0.7, "{name}: {}", bench.plant.force_n);
                assert!((state.opening_mm.expect("told") - 50.0).abs() < 0.3, "{name}: {state:?}");
            }
            bench.release().expect("taken over");
            bench.until(3000, |state| state.jaws == Jaws::Open && state.opening_mm.is_some_and(|mm| mm > 84.5));
            assert_eq!((bench.plant.force_n, bench.state().expect("there").target_n), (0.0, Some(20.0)), "{name}");
        }
    }
}

#[test]
fn the_force_of_the_whole_number_it_was_sent_is_reported() {
    for name in BOTH {
        let mut bench = Bench::holding(name, config(name), "", 30.0);
        for asked_n in [30.0, 30.3, 30.0] {
            bench.grip(asked_n).expect("the same number, so no lower force");
            bench.run(100);
            assert_eq!(bench.state().expect("there").target_n, Some(20.0 + 12.0 * 215.0 / 255.0), "{name}");
        }
        assert!(matches!(bench.grip(29.6), Err(Error::Lowering { .. })), "{name}");
    }
}

#[test]
fn the_bytes_sent_are_these() {
    let mut bench = Bench::new("robotiq", allowing(), "");
    bench.run(200);
    bench.grip(128.0).expect("taken over");
    bench.run(100);
    bench.release().expect("taken over");
    bench.run(2000);
    bench.request(Request::Home).expect("taken over");
    bench.run(100);
    let text = String::from_utf8(bench.sent().to_vec()).expect("ASCII");
    assert!(text.starts_with("GET STA\nGET OBJ\nGET PRE\nGET POS\nGET FLT\nGET FOR\n"), "{text}");
    let sets: Vec<&str> = text.lines().filter(|line| line.starts_with("SET")).collect();
    assert_eq!(
        sets,
        [
            "SET POS 255 SPE 59 FOR 128 GTO 1",
            "SET POS 3 SPE 59 FOR 0 GTO 1",
            "SET ACT 0 GTO 0 ATR 0 POS 0 SPE 0 FOR 0",
            "SET ACT 1 GTO 0 ATR 0 POS 0 SPE 0 FOR 0"
        ]
    );

    let mut bench = Bench::new("robotiq-rtu", allowing(), "");
    bench.run(200);
    bench.grip(235.0).expect("taken over");
    let write = [0x09, 0x10, 0x03, 0xE8, 0, 3, 6, 0x09, 0, 0, 255, 59, 255];
    assert!(bench.sent().windows(13).any(|bytes| bytes == write), "{:02X?}", &bench.sent()[bench.sent().len() - 15..]);
    assert!(bench.sent().starts_with(&[0x09, 0x04, 0x07, 0xD0, 0, 3, 0xB1, 0xCE]));
}

#[test]
fn nothing_a_lost_part_a_fault_and_a_refusal_are_told() {
    for name in BOTH {
        let mut bench = Bench::of(name, "");
        bench.plant.width_mm = None;
        bench.run(200);
        bench.grip(40.0).expect("taken over");
        bench.until(3000, |state| state.jaws == Jaws::Nothing);

        let mut bench = Bench::holding(name, config(name), "lose-part@6000", 40.0);
        bench.until(6000, |state| state.jaws == Jaws::Lost);

        let mut bench = Bench::holding(name, config(name), "fast-stop@6000", 40.0);
        bench.until(6000, |state| state.jaws == Jaws::Stopped);
        let message = bench.grip(60.0).expect_err("refused").to_string();
        assert!(message.ends_with("got fault 14, overcurrent; home clears it"), "{message}");
        assert!(bench.least_n > 39.0, "{name}: {}", bench.least_n);

        let mut bench = Bench::holding(name, config(name), "refuse-force@6000", 40.0);
        bench.run(5000);
        bench.grip(60.0).expect("taken over");
        let message = bench.until_error(2000).to_string();
        let words = if name == "robotiq" { "expected SET to be done, got `?`" } else { "got Modbus exception 3" };
        assert!(message.contains(words), "{name}: {message}");
        assert!(bench.state().expect("there").target_n.is_some_and(|n| (n - 40.0).abs() < 0.43), "{name}");
        assert!((bench.plant.force_n - 40.0).abs() < 0.7, "{name}");
    }
}

#[test]
fn what_it_was_set_to_is_known_after_a_new_link_only_by_the_socket() {
    for (name, target_n) in [("robotiq", Some(40.0)), ("robotiq-rtu", None)] {
        let mut bench = Bench::holding(name, config(name), "", 40.0);
        let fresh = Bench::new(name, config(name), "");
        bench.pair.driver = fresh.pair.driver;
        bench.connect();
        // As soon as its first state is there.
        while bench.driver.is_busy() {
            bench.step();
        }
        let got = bench.state().expect("there").target_n;
        assert!(
            got.zip(target_n).is_none_or(|(got, wanted): (f64, f64)| (got - wanted).abs() < 0.5),
            "{name}: {got:?}"
        );
        assert_eq!(got.is_some(), target_n.is_some(), "{name}: {got:?}");
        let lower = bench.grip(30.0);
        assert!(matches!(lower, Err(Error::Lowering { .. } | Error::NotReady { .. })), "{name}: {lower:?}");
        assert_eq!(bench.grip(60.0).is_ok(), target_n.is_some(), "{name}");
    }
}

/// Overheated, then cool again: some faults end by themselves, and the state of the jaws is then unknown.
#[test]
fn after_a_fault_that_ended_by_itself_the_same_force_is_sent_again() {
    for name in BOTH {
        let mut driver = driver(name, allowing());
        driver.linked(0);
        let (mut sent, mut forces_count, mut fault) = (Vec::new(), Vec::new(), 0);
        for now_ms in 0..4000u64 {
            driver.tick(now_ms * MS);
            match now_ms {
                1000 | 3000 => {
                    let command = GripCommand::Hold { force_n: 40.0 };
                    driver.request(now_ms * MS, Request::Grip(command)).expect("active");
                }
                1500 => forces_count.push(count_forces(&sent)),
                2000 => fault = 8,
                2500 => fault = 0,
                _ => {}
            }
            let asked = std::mem::take(driver.outgoing());
            sent.extend(&asked);
            driver.receive(now_ms * MS, &answer(name, &asked, 3, 2, fault));
        }
        forces_count.push(count_forces(&sent));
        assert_eq!(forces_count, [1, 2], "{name}");
    }
}

/// What a gripper that was told to close answers, with this activation, object and fault.
pub fn answer(name: &str, asked: &[u8], activation: u8, object: u8, fault: u8) -> Vec<u8> {
    let mut answer = Vec::new();
    rtu::Parser::default().feed_requests(asked, |request| match request {
        rtu::Request::Write { function, registers, bytes } => {
            rtu::answer_write(&mut answer, function, registers, bytes);
        }
        _ => rtu::answer_read(&mut answer, 4, &[object << 6 | activation << 4 | 9, 0, fault, 255, 90, 0]),
    });
    for line in asked.split(|byte| *byte == b'\n').filter(|_| name == "robotiq") {
        match line.strip_prefix(b"GET ") {
            Some(b"STA") => answer.extend(format!("STA {activation}\n").into_bytes()),
            Some(b"OBJ") => answer.extend(format!("OBJ {object}\n").into_bytes()),
            Some(b"FLT") => answer.extend(format!("FLT {fault}\n").into_bytes()),
            Some(value) => answer.extend([value, b" 255\n"].concat()),
            None if line.starts_with(b"SET") => answer.extend(b"ack"),
            None => {}
        }
    }
    answer
}

/// It moves when it presses with another force.
#[test]
fn jaws_that_press_anew_what_they_hold_have_not_lost_it_until_they_are_at_their_end() {
    for (name, then, end) in BOTH.iter().flat_map(|name| [(*name, 2, Jaws::Holding), (*name, 3, Jaws::Lost)]) {
        let mut driver = driver(name, allowing());
        driver.linked(0);
        let mut seen = Vec::new();
        for now_ms in 0..1500u64 {
            driver.tick(now_ms * MS);
            let asked = std::mem::take(driver.outgoing());
            let object = [2, 0, then][now_ms as usize / 500];
            driver.receive(now_ms * MS, &answer(name, &asked, 3, object, 0));
            seen.push(driver.state(now_ms * MS).expect("there").jaws);
        }
        seen.dedup();
        seen.retain(|jaws| *jaws != Jaws::Unknown); // before the first answer
        assert_eq!(seen, [Jaws::Holding, Jaws::Closing, end], "{name}");
    }
}

/// How often a force of 40 N is among what was sent.
fn count_forces(sent: &[u8]) -> usize {
    let mut count = sent.windows(18).filter(|bytes| *bytes == b"SET POS 255 SPE 59").count();
    rtu::Parser::default()
        .feed_requests(sent, |request| count += usize::from(matches!(request, rtu::Request::Write { .. })));
    count
}

/// Its registers are zero then, and so is its force.
#[test]
fn a_restart_on_a_living_link_forgets_the_force() {
    for name in BOTH {
        let mut driver = driver(name, allowing());
        let mut writes_count = 0;
        driver.linked(0);
        for ms in 0..2000u64 {
            if matches!(ms, 300 | 1800) {
                let target_n = driver.state(ms * MS).expect("there").target_n;
                assert!(target_n.is_none_or(|n| n == 20.0), "{name}, {ms} ms: {target_n:?}");
                let hold = GripCommand::Hold { force_n: 40.0 };
                driver.request(ms * MS, Request::Grip(hold)).expect("taken over");
            }
            driver.tick(ms * MS);
            let asked = std::mem::take(driver.outgoing());
            let is_active = !(900..1300).contains(&ms);
            let answer = match asked.get(..7) {
                None => continue,
                Some([9, 16, ..] | b"SET POS") => {
                    writes_count += 1;
                    if name == "robotiq" { b"ack".to_vec() } else { modbus("09 10 03 E8 00 03") }
                }
                Some([9, ..]) if is_active => modbus("09 04 06 B9 00 00 FF 75 00"),
                Some([9, ..]) => modbus("09 04 06 00 00 00 00 75 00"),
                Some(b"GET STA") => format!("STA {}\n", if is_active { 3 } else { 0 }).into_bytes(),
                Some(b"GET OBJ") => b"OBJ 2\n".to_vec(),
                Some(get) => [&get[4..], b" 0\n"].concat(),
            };
            driver.receive(ms * MS, &answer);
            let target_n = driver.state(ms * MS).expect("there").target_n;
            assert!(ms != 800 || target_n.is_some_and(|n| (n - 40.0).abs() < 0.43), "{name}: {target_n:?}");
        }
        assert_eq!(writes_count, 2, "{name}");
    }
}

/// By silence or in words. It loses what it holds at 2.5 s.
#[test]
fn a_gripper_that_does_not_tell_its_force_tells_its_jaws() {
    for force in ["", "FOR ?\n"] {
        let mut driver = driver("robotiq", allowing());
        driver.linked(0);
        let mut seen = Vec::new();
        for ms in 0..5000u64 {
            driver.tick(ms * MS);
            let asked = std::mem::take(driver.outgoing());
            let object = if ms < 2500 { 2 } else { 3 };
            match &asked[..] {
                b"GET FOR\n" => driver.receive(ms * MS, force.as_bytes()),
                _ => driver.receive(ms * MS, &answer("robotiq", &asked, 3, object, 0)),
            }
            let state = driver.state(ms * MS).unwrap_or_else(|error| panic!("{force:?}, {ms} ms: {error}"));
            assert_eq!(state.target_n, None);
            seen.push(state.jaws);
        }
        seen.dedup();
        assert_eq!(seen, [Jaws::Unknown, Jaws::Holding, Jaws::Lost], "{force:?}");
    }
}

/// Some do not tell it at all; this one stops after 2 s.
#[test]
fn a_position_that_is_not_told_is_not_known() {
    let mut driver = driver("robotiq", allowing());
    driver.linked(0);
    let mut seen = Vec::new();
    for ms in 0..4000u64 {
        driver.tick(ms * MS);
        let asked = std::mem::take(driver.outgoing());
        match &asked[..] {
            b"GET POS\n" if !(1000..2000).contains(&ms) => {}
            _ => driver.receive(ms * MS, &answer("robotiq", &asked, 3, 2, 0)),
        }
        let state = driver.state(ms * MS).expect("there");
        seen.push((state.jaws, state.opening_mm.map(|mm| mm.round())));
    }
    seen.dedup();
    let told = seen.iter().find_map(|(_, mm)| *mm);
    let holding = |opening_mm| (Jaws::Holding, opening_mm);
    assert_eq!(seen, [(Jaws::Unknown, None), holding(None), holding(told), holding(None)]);
    assert!(told.is_some());
}

#[test]
fn what_is_held_is_not_known_on_a_new_link_before_the_first_status() {
    let mut driver = driver("robotiq", allowing());
    let mut now_ms = 0;
    // Answers everything for half a second; jaws at the end of their way say so by 3.
    let mut run = |driver: &mut Driver, object: u8| {
        for _ in 0..500 {
            now_ms += 1;
            driver.tick(now_ms * MS);
            let asked = std::mem::take(driver.outgoing());
            driver.receive(now_ms * MS, &answer("robotiq", &asked, 3, object, 0));
        }
        let state = driver.state(now_ms * MS).expect("there");
        (state.jaws, state.opening_mm.is_some(), now_ms)
    };
    driver.linked(0);
    assert_eq!(run(&mut driver, 2), (Jaws::Holding, true, 500));
    driver.unlinked(500 * MS, "cut");
    driver.linked(500 * MS);
    driver.receive(500 * MS, b"STA 3\n");
    let state = driver.state(500 * MS).expect("it is there");
    assert_eq!((state.jaws, state.opening_mm), (Jaws::Unknown, None));
    assert_eq!(run(&mut driver, 3), (Jaws::Lost, true, 1000), "it held before the link was lost");
}

/// It forgets what it was told when its supply fails, and so does its link.
#[test]
fn the_force_of_before_is_not_told_of_a_gripper_that_has_restarted_without_a_link() {
    for name in BOTH {
        let mut bench = Bench::holding(name, config(name), "power-cycle@8000", 40.0);
        bench.run(8100 - bench.now_ns() / MS);
        bench.connect();
        bench.run(300);
        let state = bench.state().expect("there");
        let target_n = if name == "robotiq" { Some(20.0) } else { None }; // the number 0, where it tells
        assert_eq!((state.jaws, state.target_n), (Jaws::Unknown, target_n), "{name}");
    }
}

/// The program of the arm sets another one while nobody listens.
#[test]
fn the_force_that_it_is_set_to_is_asked_for_on_every_new_link() {
    let mut bench = Bench::holding("robotiq", allowing(), "", 40.0);
    bench.request(Request::Leave).expect("taken over");
    bench.run(100);
    bench.cut("closed");
    let now_ns = bench.now_ns();
    bench.emulator.connected(now_ns);
    bench.emulator.receive(now_ns, b"SET FOR 128\n");
    bench.emulator.disconnected(now_ns);
    bench.connect();
    bench.run(300);
    let target_n = bench.state().expect("there").target_n.expect("told");
    assert!((target_n - 127.9).abs() < 0.1, "{target_n}");
}
