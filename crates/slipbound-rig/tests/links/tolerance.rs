//! Behaviour of real grippers: wrong force readings, slow and broken answers, other words for the same.

use crate::bench::{Bench, MS, config, driver};
use slipbound::port::{DriverEvent, GripCommand, Jaws};
use slipbound_rig::emulator::NAMES;
use slipbound_rig::gripper::check_hold::{CheckHold, Step, Verdict};
use slipbound_rig::gripper::config::Config;
use slipbound_rig::gripper::wsg50::frame;
use slipbound_rig::gripper::{Driver, Error, Request, SettleDetector};
use slipbound_rig::link::Endpoint;

/// The current that a motor reads on open jaws is not an object.
#[test]
fn an_idle_reading_on_open_jaws_blocks_no_grasp() {
    for name in ["wsg50", "gcl", "line"] {
        for idle_n in [4.0, 9.0] {
            let mut bench = Bench::of(name, &format!("idle={idle_n}"));
            bench.driver.permit_lowering(false);
            bench.run(200);
            let read_n = bench.state().expect("there").force_n.expect("measured");
            assert!((read_n - idle_n).abs() < 0.01, "{name}: {read_n}");
            bench.grip(10.0).expect("nothing is held");
            bench.until(5000, |state| state.jaws == Jaws::Holding);
            bench.release().expect("taken over");
            bench.until(5000, |state| state.jaws == Jaws::Open && state.opening_mm.is_some_and(|mm| mm > 99.0));
            bench.grip(8.0).expect("nothing is held");
        }
    }
}

/// Jaws that an earlier program has left open, not as wide as a release, still set to the force of its grasp.
#[test]
fn an_idle_reading_on_jaws_left_open_by_another_program_blocks_no_grasp() {
    let mut bench = Bench::new("wsg50", Config { open_mm: 60.0, ..config("wsg50") }, "idle=4");
    bench.run(200);
    bench.grip(30.0).expect("nothing is held");
    bench.until(5000, |state| state.jaws == Jaws::Holding);
    bench.release().expect("taken over");
    bench.until(5000, |state| state.jaws == Jaws::Open && state.opening_mm.is_some_and(|mm| mm > 59.9));
    bench.request(Request::Leave).expect("taken over");
    bench.cut("the program ended");
    bench.pair.driver = driver("wsg50", config("wsg50"));
    bench.connect();
    bench.run(200);
    bench.grip(10.0).expect("nothing is held");
    bench.until(5000, |state| state.jaws == Jaws::Holding);
    assert!(bench.plant.force_n < 10.1, "{}", bench.plant.force_n);
}

/// Stopped jaws keep pressing, although the gripper does not report that it holds, whatever its force reads.
#[test]
fn what_was_held_before_a_fast_stop_is_not_loosened_whatever_the_force_reads() {
    for faults in ["fast-stop@4000", "fast-stop@4000,bias=3", "fast-stop@4000,bias=-3", "fast-stop@4000,noise=1"] {
        let mut bench = Bench::of("wsg50", faults);
        bench.run(200);
        bench.grip(20.0).expect("taken over");
        bench.until(6000, |state| state.jaws == Jaws::Stopped);
        bench.request(Request::Acknowledge).expect("taken over");
        bench.until(1000, |state| state.jaws == Jaws::Open);
        let lower = bench.grip(10.0);
        assert!(matches!(lower, Err(Error::Lowering { .. })), "{faults}: {lower:?}");
        assert!(bench.plant.force_n > 19.5, "{faults}");
    }
}

#[test]
fn a_force_that_is_no_number_is_refused_and_nothing_is_sent() {
    for name in NAMES {
        let mut bench = Bench::of(name, "");
        bench.run(300);
        for force_n in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(matches!(bench.grip(force_n), Err(Error::Force { .. })), "{name} {force_n}");
        }
        bench.run(500);
        assert_eq!((bench.plant.force_n, bench.state().expect("there").jaws), (0.0, Jaws::Open), "{name}");
    }
}

#[test]
fn answers_400_ms_late_are_waited_for() {
    for name in NAMES {
        for faults in ["late=400", "late-every=3"] {
            let mut bench = Bench::of(name, faults);
            bench.run(4000);
            bench.grip(30.0).expect(name);
            bench.until(8000, |state| state.jaws == Jaws::Holding);
            bench.run(2500);
            assert!((bench.plant.force_n - 30.0).abs() < 0.6, "{name} {faults}: {}", bench.plant.force_n);
            for _ in 0..500 {
                bench.step();
                bench.state().unwrap_or_else(|error| panic!("{name} {faults}: {error}"));
            }
        }
    }
}

/// The state of a WSG-50 that is homed and holds nothing, and a grasp with 20 N on its way.
fn grasping() -> Driver {
    let mut driver = driver("wsg50", config("wsg50"));
    driver.linked(0);
    let mut bytes = Vec::new();
    for (id, rest) in
        [(0x40, &[1u8, 0, 0, 0][..]), (0x41, &[0]), (0x43, &110f32.to_le_bytes()), (0x33, &80f32.to_le_bytes())]
    {
        frame::write(&mut bytes, id, &[&[0, 0], rest].concat());
    }
    driver.receive(MS, &bytes);
    driver.request(2 * MS, Request::Grip(GripCommand::Hold { force_n: 20.0 })).expect("taken over");
    driver
}

#[test]
fn bytes_that_are_no_message_are_told_of_where_no_message_ever_came() {
    for name in ["wsg50", "gcl", "robotiq", "robotiq-rtu", "line"] {
        let mut driver = driver(name, config(name));
        driver.linked(0);
        for at_ms in [100, 200] {
            driver.receive(at_ms * MS, b"HTTP/1.0 400 Bad Request\r\n");
        }
        let silent = driver.state(600 * MS).expect_err(name).to_string();
        assert!(silent.contains("bytes that are no message: is it another interface?"), "{silent}");
    }
    let mut driver = grasping();
    driver.receive(2 * MS, b"HTTP/1.0 400 Bad Request\r\n");
    let silent = driver.state(600 * MS).expect_err("silent").to_string();
    assert!(silent.contains("got none for 599 ms; the gripper"), "{silent}");
}

/// An answer of a WSG-50 with this status.
fn say(driver: &mut Driver, at_ms: u64, id: u8, code: u8) {
    let mut bytes = Vec::new();
    frame::write(&mut bytes, id, &[code, 0]);
    driver.receive(at_ms * MS, &bytes);
}

#[test]
fn a_wsg50_may_say_that_a_stop_or_an_acknowledgement_is_under_way() {
    for (request, id) in [(Request::Grip(GripCommand::Release), 0x22), (Request::Acknowledge, 0x24)] {
        let mut driver = grasping();
        say(&mut driver, 3, 0x32, 0);
        say(&mut driver, 4, 0x25, 26);
        driver.request(5 * MS, request).expect("taken over");
        driver.outgoing().clear();
        say(&mut driver, 6, id, 26);
        driver.state(6 * MS).expect("no refusal");
        assert!(driver.is_busy() && driver.outgoing().is_empty(), "{request:?}: {:?}", driver.outgoing());
        say(&mut driver, 7, id, 0);
        driver.state(7 * MS).expect("done");
        assert_eq!(driver.outgoing().is_empty(), request == Request::Acknowledge, "{request:?}: then it opens");
    }
}

#[test]
fn a_wsg50_may_say_more_than_once_that_a_motion_is_under_way() {
    let mut driver = grasping();
    say(&mut driver, 3, 0x32, 0);
    for at_ms in [4, 5, 6] {
        say(&mut driver, at_ms, 0x25, 26);
        assert!(driver.is_busy(), "{:?}", driver.state(at_ms * MS));
        driver.state(at_ms * MS).expect("no refusal");
    }
    say(&mut driver, 7, 0x25, 0);
    driver.state(7 * MS).expect("done");
    assert!(!driver.is_busy());
}

#[test]
fn a_text_interface_may_call_its_errors_by_name() {
    for (answer, said) in [
        ("ERR GRIP 28\n", "status 28, out of range"),
        ("ERR GRIP E_RANGE_ERROR\n", "status 28, out of range"),
        ("ERR E_RANGE_ERROR\n", "status 28, out of range"),
        ("ERR GRIP RANGE_ERROR\n", "status 28, out of range"),
        ("ERR GRIP E_ACCESS_DENIED\n", "status 16, access denied"),
    ] {
        let mut driver = driver("gcl", config("gcl"));
        driver.linked(0);
        for (i, line) in ["POS=110.0\n", "FORCE=0.0\n", "GRIPSTATE=0\n"].iter().enumerate() {
            driver.tick(i as u64 * 40 * MS);
            driver.receive(i as u64 * 40 * MS, line.as_bytes());
        }
        driver.permit_lowering(true);
        driver.request(130 * MS, Request::Grip(GripCommand::Hold { force_n: 20.0 })).expect("taken over");
        driver.receive(140 * MS, b"POS=110.0\n"); // what was asked before
        driver.tick(200 * MS);
        driver.receive(210 * MS, answer.as_bytes());
        let error = driver.state(210 * MS).expect_err(answer).to_string();
        assert!(error.contains(said), "{answer}: {error}");
    }
}

/// The numbers of what a WSG-50 was sent since the last call.
fn sent_ids(driver: &mut Driver) -> Vec<u8> {
    let (sent, mut ids) = (std::mem::take(driver.outgoing()), Vec::new());
    frame::Parser::default().feed(&sent, |frame| ids.push(frame.id));
    ids
}

/// A grasp under way is stopped for a release, and whether the part is still held is not told any more.
#[test]
fn a_release_that_waits_for_a_wsg50_to_say_what_it_holds_does_not_wait_for_ever() {
    let mut driver = grasping();
    say(&mut driver, 3, 0x32, 0);
    say(&mut driver, 4, 0x25, 26);
    let states = |driver: &mut Driver, at_ms: u64, ids: &[u8]| {
        let mut bytes = Vec::new();
        for (id, rest) in [(0x40, &[1u8, 0, 0, 0][..]), (0x41, &[4]), (0x43, &50f32.to_le_bytes())] {
            if ids.contains(&id) {
                frame::write(&mut bytes, id, &[&[0, 0], rest].concat());
            }
        }
        driver.receive(at_ms * MS, &bytes);
        driver.tick(at_ms * MS);
    };
    states(&mut driver, 5, &[0x40, 0x41, 0x43]);
    driver.request(6 * MS, Request::Grip(GripCommand::Release)).expect("taken over");
    assert!(sent_ids(&mut driver).contains(&0x22), "it is stopped first");
    say(&mut driver, 7, 0x22, 0);
    let mut told = Vec::new();
    for at_ms in (10..2000).step_by(10) {
        states(&mut driver, at_ms, &[0x40, 0x43]);
        told.extend(driver.state(at_ms * MS).err().map(|error| error.to_string()));
    }
    assert!(told.iter().any(|text| text.contains("release")), "{:?}", told.last());
    assert!(told.last().is_some_and(|text| text.contains("what the jaws do")), "{:?}", told.last());
    assert!(!driver.is_busy());
    sent_ids(&mut driver);
    states(&mut driver, 2010, &[0x40, 0x41, 0x43]);
    assert!(!sent_ids(&mut driver).contains(&0x26), "it is not released so late without a new request");
    driver.request(2020 * MS, Request::Grip(GripCommand::Release)).expect("told again");
    assert!(sent_ids(&mut driver).contains(&0x26));
}

/// Answers of a Robotiq at its socket, byte by byte with pauses, its faults in three ways of writing.
#[test]
fn a_robotiq_may_pause_within_an_answer_and_write_its_faults_in_any_way() {
    for fault in ["0", "00", "0x00", "0X0"] {
        for pause_ms in [1u64, 20, 100] {
            let mut driver = driver("robotiq", config("robotiq"));
            driver.linked(0);
            let (mut now_ns, mut answers_count, mut asked) = (0, 0, Vec::new());
            while answers_count < 6 {
                driver.tick(now_ns);
                asked.append(driver.outgoing());
                let text = String::from_utf8(std::mem::take(&mut asked)).expect("ASCII");
                let Some(name) = text.trim().strip_prefix("GET ") else {
                    now_ns += MS;
                    assert!(now_ns < 60_000 * MS, "asked {text:?}");
                    continue;
                };
                let value = match name {
                    "STA" => "3",
                    "OBJ" => "3",
                    "POS" => "230",
                    "FLT" => fault,
                    "FOR" => "12",
                    _ => "255",
                };
                // A pause before the last digit, which would make another number, and one before the end.
                let line = format!("{name} {value}\n");
                let cuts = [line.len() - 2, line.len() - 1];
                for part in [&line[..cuts[0]], &line[cuts[0]..cuts[1]], &line[cuts[1]..]] {
                    driver.receive(now_ns, part.as_bytes());
                    for _ in 0..pause_ms {
                        now_ns += MS;
                        driver.tick(now_ns);
                    }
                }
                assert!(
                    std::iter::from_fn(|| driver.next_event())
                        .all(|event| !matches!(event, DriverEvent::Garbled { .. }))
                );
                asked.append(driver.outgoing());
                answers_count += 1;
            }
            let state = driver.state(now_ns).expect("known");
            assert_eq!(state.jaws, Jaws::Nothing, "FLT {fault}, {pause_ms} ms");
            assert!(state.opening_mm.is_some_and(|mm| mm < 0.01), "POS 230, {pause_ms} ms: {state:?}");
        }
    }
}

/// Its first answer comes shortly before it is given up, and in two pieces.
#[test]
fn a_robotiqs_late_first_answer_is_not_read_before_its_second_piece() {
    let mut driver = driver("robotiq", config("robotiq"));
    driver.linked(0);
    let mut asked_ns = None;
    for now_ns in (0..5000).map(|ms| ms * MS) {
        driver.tick(now_ns);
        if std::mem::take(driver.outgoing()) == b"GET POS\n" {
            asked_ns.get_or_insert(now_ns);
        }
        let late_ms = asked_ns.map_or(0, |asked_ns| (now_ns - asked_ns) / MS);
        match late_ms.checked_sub(config("robotiq").reply_ms - 9) {
            Some(0) => driver.receive(now_ns, b"POS 1"),
            Some(3) => driver.receive(now_ns, b"17\n"),
            _ => {}
        }
    }
    assert!(asked_ns.is_some());
    let strays: Vec<_> = std::iter::from_fn(|| driver.next_event())
        .filter(|event| matches!(event, DriverEvent::Garbled { .. }))
        .collect();
    assert_eq!(strays, []);
}

/// A gripper that ends its lines late: the complete answer, and its end 300 ms later. It reads later questions
/// afterwards.
#[test]
fn a_robotiq_may_pause_before_the_end_of_its_line_and_read_nothing_meanwhile() {
    let mut driver = driver("robotiq", config("robotiq"));
    driver.linked(0);
    let (mut asked, mut free_ms, mut end_due_ms) = (Vec::new(), 0, None);
    for now_ms in 0..6000u64 {
        driver.tick(now_ms * MS);
        asked.append(driver.outgoing());
        if end_due_ms == Some(now_ms) {
            driver.receive(now_ms * MS, b"\n");
            end_due_ms = None;
        }
        let end = asked.iter().position(|byte| *byte == b'\n').filter(|_| now_ms >= free_ms && end_due_ms.is_none());
        if let Some(end) = end {
            let line: Vec<u8> = asked.drain(..=end).collect();
            let name = std::str::from_utf8(&line[4..7]).expect("ASCII");
            let value = match name {
                "STA" | "OBJ" => "3",
                "POS" => "117",
                _ => "0",
            };
            driver.receive(now_ms * MS, format!("{name} {value}").as_bytes());
            (free_ms, end_due_ms) = (now_ms + 300, Some(now_ms + 300));
        }
        driver.state(now_ms * MS).unwrap_or_else(|error| panic!("{now_ms} ms: {error}"));
    }
    assert_eq!(driver.state(6000 * MS).expect("known").jaws, Jaws::Open);
}

/// Without line ends, but for one that came by chance, and with a pause in the acknowledgement.
#[test]
fn a_robotiq_that_ends_no_lines_may_end_one_and_pause_within_an_acknowledgement() {
    let mut driver = driver("robotiq", config("robotiq"));
    driver.linked(0);
    let mut rest: Option<(u64, &[u8])> = None;
    for now_ms in 0..12_000u64 {
        driver.tick(now_ms * MS);
        if let Some((_, bytes)) = rest.take_if(|(due_ms, _)| *due_ms == now_ms) {
            driver.receive(now_ms * MS, bytes);
        }
        let asked = String::from_utf8(std::mem::take(driver.outgoing())).expect("ASCII");
        let end = if (4000..4100).contains(&now_ms) { "\n" } else { "" };
        match asked.trim().split_once(' ') {
            Some(("GET", name)) => {
                let value = match name {
                    "STA" | "OBJ" => "3",
                    "POS" => "117",
                    "PRE" => "255",
                    _ => "0",
                };
                driver.receive(now_ms * MS, format!("{name} {value}{end}").as_bytes());
            }
            Some(("SET", _)) => {
                driver.receive(now_ms * MS, b"a");
                rest = Some((now_ms + 100, b"ck"));
            }
            _ => {}
        }
        if now_ms == 2000 {
            driver.request(now_ms * MS, Request::Grip(GripCommand::Hold { force_n: 30.0 })).expect("it tells its jaws");
        }
        driver.state(now_ms * MS).unwrap_or_else(|error| panic!("{now_ms} ms: {error}"));
    }
    assert_eq!(driver.state(12_000 * MS).expect("known").target_n.map(f64::round), Some(30.0));
}

/// Jaws commanded to close between two questions must not count as arrived, with nothing found, because of an earlier
/// question.
#[test]
fn a_robotiq_that_is_told_to_close_between_two_questions_has_not_found_nothing() {
    for given_ms in 2000..2100u64 {
        let mut driver = driver("robotiq", config("robotiq"));
        driver.linked(0);
        driver.permit_lowering(true);
        let (mut asked, mut due_ms, mut closes_ms) = (Vec::new(), None, None::<u64>);
        for now_ms in 0..2600u64 {
            driver.tick(now_ms * MS);
            asked.append(driver.outgoing());
            if now_ms == given_ms {
                driver.request(now_ms * MS, Request::Grip(GripCommand::Hold { force_n: 50.0 })).expect("taken over");
            }
            if due_ms.is_none() && !asked.is_empty() {
                due_ms = Some(now_ms + 20);
            }
            if due_ms == Some(now_ms) {
                due_ms = None;
                let line = String::from_utf8(std::mem::take(&mut asked)).expect("ASCII");
                let answer = match line.split_whitespace().nth(1).expect("a name") {
                    "POS" if line.starts_with("SET") => {
                        closes_ms = Some(now_ms);
                        "ack".into()
                    }
                    "STA" => "STA 3\n".into(),
                    "OBJ" => format!("OBJ {}\n", if closes_ms.is_some() { 0 } else { 3 }),
                    "PRE" => format!("PRE {}\n", if closes_ms.is_some() { 255 } else { 0 }),
                    name => format!("{name} 0\n"),
                };
                driver.receive(now_ms * MS, answer.as_bytes());
            }
            let jaws = driver.state(now_ms * MS).expect("no fault").jaws;
            assert_ne!(jaws, Jaws::Nothing, "told at {given_ms} ms, at {now_ms} ms");
        }
        assert_eq!(driver.state(2600 * MS).expect("no fault").jaws, Jaws::Closing, "told at {given_ms} ms");
    }
}

/// Unsolicited values, in one packet with an answer or alone, are ignored without an error.
#[test]
fn a_robotiq_may_say_more_than_was_asked() {
    let mut driver = driver("robotiq", config("robotiq"));
    driver.linked(0);
    driver.permit_lowering(true);
    let (mut set_count, mut asked) = (0, Vec::new());
    for now_ms in 0..3000u64 {
        driver.tick(now_ms * MS);
        asked.append(driver.outgoing());
        if now_ms == 500 {
            driver.request(now_ms * MS, Request::Grip(GripCommand::Hold { force_n: 50.0 })).expect("taken over");
        }
        while let Some(end) = asked.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = asked.drain(..=end).collect();
            let answer = match std::str::from_utf8(&line).expect("ASCII").split_whitespace().nth(1) {
                Some("POS") if line.starts_with(b"SET") => {
                    set_count += 1;
                    "COU 12\nCOU 13\nCOU 14\nCOU 15\nCOU 16\nackCOU 17\n".into()
                }
                Some(name @ ("STA" | "OBJ")) => format!("COU 1\n{name} 3\nCOU 2\n"),
                Some(name) => format!("ackCOU 1\n{name} 0\n"),
                None => unreachable!("an empty line"),
            };
            driver.receive(now_ms * MS, answer.as_bytes());
        }
        driver.state(now_ms * MS).unwrap_or_else(|error| panic!("{now_ms} ms: {error}"));
        let garbled =
            std::iter::from_fn(|| driver.next_event()).find(|event| matches!(event, DriverEvent::Garbled { .. }));
        assert_eq!(garbled, None, "{now_ms} ms");
    }
    assert_eq!(set_count, 1);
    assert_eq!(driver.state(3000 * MS).expect("known").target_n.map(f64::round), Some(50.0));
}

#[test]
fn a_robotiqs_fault_in_hexadecimal_is_one_without_0x_too() {
    for (fault, stops) in [("0E", true), ("0B", true), ("0x0B", true), ("11", true), ("00", false), ("0", false)] {
        let mut driver = driver("robotiq", config("robotiq"));
        driver.linked(0);
        let mut asked = Vec::new();
        for now_ms in 0..1000u64 {
            driver.tick(now_ms * MS);
            asked.append(driver.outgoing());
            while let Some(end) = asked.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = asked.drain(..=end).collect();
                let name = std::str::from_utf8(&line[4..7]).expect("ASCII");
                let value = if name == "FLT" { fault } else { "3" };
                driver.receive(now_ms * MS, format!("{name} {value}\n").as_bytes());
            }
        }
        let refused = driver.request(1000 * MS, Request::Grip(GripCommand::Hold { force_n: 50.0 }));
        let is_stopped = matches!(refused, Err(Error::Fault { .. }));
        assert_eq!(is_stopped, stops, "FLT {fault}: {refused:?}");
    }
}

/// One definition of a settled force: noise of 0.3 N rms and more does not prevent a grasp or a release from
/// completing, however often a reading is repeated.
#[test]
fn grasp_and_release_settle_under_noise() {
    for (name, others) in [("wsg50", ""), ("wsg50, apart", ""), ("gcl", ""), ("line", ""), ("line", ",period=100")] {
        for noise_n in [0.0, 0.3, 1.0, 2.0] {
            let what = format!("{name}{others} {noise_n} N rms");
            let faults = format!("noise={noise_n},seed=5{others}");
            let mut bench = Bench::of(name.trim_end_matches(", apart"), &faults);
            bench.run(300);
            if name.ends_with("apart") {
                send_states_apart(&mut bench);
            }
            for (request, wanted) in
                [(GripCommand::Hold { force_n: 20.0 }, Jaws::Holding), (GripCommand::Release, Jaws::Open)]
            {
                bench.request(Request::Grip(request)).expect("taken over");
                let (mut settled, from_ns) = (SettleDetector::default(), bench.now_ns());
                loop {
                    bench.step();
                    let state = bench.state().expect("there");
                    if settled.see(&state, !bench.driver.is_busy() && state.jaws == wanted) {
                        break;
                    }
                    let is_in_time = bench.now_ns() - from_ns < 15_000 * MS;
                    assert!(is_in_time, "{what}: {request:?} never settles");
                }
            }
        }
    }
}

/// Makes a WSG-50 send its four states one after the other, each with a time of its own.
fn send_states_apart(bench: &mut Bench) {
    for id in [0x40, 0x41, 0x43, 0x45] {
        bench.run(4);
        let mut subscription = Vec::new();
        frame::write(&mut subscription, id, &[1, 20, 0]);
        let now_ns = bench.now_ns();
        bench.emulator.receive(now_ns, &subscription);
    }
}

/// What `check-hold` finds of a WSG-50 with these faults.
fn check_hold(faults: &str, config: Config) -> Verdict {
    let mut bench = Bench::new("wsg50", config, faults);
    bench.driver.permit_lowering(true);
    let mut trial = CheckHold::new(20.0, 30.0);
    for _ in 0..30_000 {
        bench.step();
        if bench.now_ns() < 300 * MS {
            continue; // until its state is known
        }
        let now_ns = bench.now_ns();
        let state = match bench.state() {
            Ok(state) => state,
            Err(error) => return Verdict::Failed { why: error.to_string() },
        };
        match trial.step(now_ns, &state) {
            Step::Command(command) => bench.request(Request::Grip(command)).expect("taken over"),
            Step::Wait => {}
            Step::Done(verdict) => return verdict,
        }
    }
    panic!("{faults}: no verdict");
}

/// A block that never moves.
#[test]
fn check_hold_takes_no_noise_for_a_dip() {
    let mut failed = Vec::new();
    for seed in 0..50 {
        for (update_ms, noise_n) in [(20, 1.0), (20, 1.5), (40, 1.0), (40, 1.5)] {
            let faults = format!("noise={noise_n},seed={seed}");
            if let Verdict::Failed { why } = check_hold(&faults, Config { update_ms, ..config("wsg50") }) {
                failed.push(format!("every {update_ms} ms, {faults}: {why}"));
            }
        }
    }
    assert!(failed.is_empty(), "{} of 200: {failed:#?}", failed.len());
}

#[test]
fn check_hold_is_not_misled_by_noise_bias_or_gain_and_still_finds_a_dip() {
    for faults in
        ["", "noise=1.5,seed=2", "noise=2,seed=3", "bias=3", "bias=-3", "gain=0.85", "gain=1.15,noise=1,bias=-2"]
    {
        let verdict = check_hold(faults, config("wsg50"));
        assert!(matches!(verdict, Verdict::Held { .. }), "{faults}: {verdict:?}");
    }
    for faults in ["lose-part@4000", "fixed-limit"] {
        let verdict = check_hold(faults, config("wsg50"));
        assert!(matches!(verdict, Verdict::Failed { .. }), "{faults}: {verdict:?}");
    }
}
