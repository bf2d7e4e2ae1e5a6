//! WSG-50, text interface, in lock-step.

use crate::bench::{Bench, MS, WIDTH_MM, config, driver};
use slipbound::port::{GripCommand, Jaws};
use slipbound_rig::gripper::config::{Config, Lowering};
use slipbound_rig::gripper::{Driver, Error, Request};
use slipbound_rig::link::Endpoint;

/// Lines sent that are no questions.
fn commands(bench: &Bench) -> Vec<String> {
    let text = String::from_utf8(bench.sent().to_vec()).expect("ASCII");
    text.lines().filter(|line| !line.ends_with('?')).map(str::to_owned).collect()
}

#[test]
fn a_block_is_gripped_and_released_by_these_lines() {
    for chunk in [1, 3, usize::MAX] {
        let mut bench = Bench::of("gcl", "");
        bench.most_bytes = chunk;
        bench.run(100);
        assert_eq!(bench.state().expect("there").jaws, Jaws::Open);
        bench.grip(20.0).expect("taken over");
        bench.until(3000, |state| state.jaws == Jaws::Holding);
        bench.run(1000);
        let state = bench.state().expect("there");
        assert_eq!((state.target_n, state.opening_mm), (Some(20.0), Some(50.0)));
        assert!((state.force_n.expect("measured") - 20.0).abs() < 0.1);
        bench.release().expect("taken over");
        bench.until(3000, |state| state.opening_mm.is_some_and(|mm| mm > 99.9));
        bench.request(Request::Leave).expect("taken over");
        let expected = ["GRIP(20.00,50.00,50.00)", "RELEASE(50.00,50.00)", "BYE()"];
        assert_eq!(commands(&bench), expected);
    }
}

#[test]
fn without_a_width_only_the_force_is_given() {
    let mut bench = Bench::new("gcl", Config { part_width_mm: None, ..config("gcl") }, "");
    bench.run(100);
    bench.grip(12.5).expect("taken over");
    bench.until(3000, |state| state.jaws == Jaws::Holding);
    assert_eq!(commands(&bench), ["GRIP(12.50)"]);
}

#[test]
fn a_new_force_while_holding_is_tried_once_and_its_refusal_told() {
    let allowing = Config { lowering: Lowering::Allow, ..config("gcl") };
    let mut bench = Bench::holding("gcl", allowing.clone(), "", 20.0);
    bench.grip(30.0).expect("not yet known to be refused");
    let message = bench.until_error(500).to_string();
    assert!(message.contains("a new force while holding") && message.contains("wsg50://"), "{message}");
    for _ in 0..10 {
        assert!(matches!(bench.grip(30.0), Err(Error::Refused { .. })));
        bench.run(50);
    }
    bench.grip(20.0).expect("the force it has");
    assert_eq!(commands(&bench).len(), 2);
    assert!(bench.least_n > 19.9);
    assert_eq!(bench.state().expect("there").target_n, Some(20.0));

    let mut bench = Bench::holding("gcl", allowing, "allow-regrasp", 20.0);
    bench.grip(30.0).expect("taken over");
    bench.run(1000);
    assert!((bench.plant.force_n - 30.0).abs() < 0.1, "{}", bench.plant.force_n);
}

/// Another process gripped it, and has left.
#[test]
fn what_is_held_already_with_this_force_is_not_gripped_again() {
    let mut bench = Bench::holding("gcl", config("gcl"), "", 40.0);
    bench.request(Request::Leave).expect("taken over");
    bench.run(100);
    bench.cut("closed");
    bench.pair.driver = driver("gcl", config("gcl"));
    bench.pair.sent = Some(Vec::new());
    bench.connect();
    bench.run(200);
    for _ in 0..10 {
        bench.grip(40.0).expect("the force it has");
        bench.run(50);
        assert_eq!(bench.state().expect("no fault").target_n, Some(40.0));
    }
    assert_eq!((commands(&bench), bench.driver.is_busy()), (vec![], false));
    bench.grip(44.0).expect("another force");
    bench.until_error(500);
    assert_eq!(commands(&bench), ["GRIP(44.00,50.00,50.00)"]);
    // Released and gripped again at once, it is closed again whatever was measured last.
    bench.release().expect("taken over");
    bench.step();
    bench.grip(40.0).expect("taken over");
    bench.run(3000);
    assert!((bench.plant.force_n - 40.0).abs() < 0.1, "{}", bench.plant.force_n);
}

#[test]
fn nothing_a_lost_part_and_a_fast_stop_are_told() {
    let mut bench = Bench::of("gcl", "");
    bench.plant.width_mm = None;
    bench.run(100);
    bench.grip(20.0).expect("taken over");
    bench.until(3000, |state| state.jaws == Jaws::Nothing);

    let mut bench = Bench::holding("gcl", config("gcl"), "lose-part@4000", 20.0);
    bench.until(3000, |state| state.jaws == Jaws::Lost);

    let mut bench = Bench::holding("gcl", config("gcl"), "fast-stop@4000", 20.0);
    bench.run(2000);
    bench.grip(25.0).expect("nothing tells yet");
    let message = bench.until_error(500).to_string();
    assert!(message.contains("status 16, access denied: fast stop"), "{message}");
    let message = bench.grip(25.0).expect_err("refused").to_string();
    assert!(message.contains("latched fast stop") && message.contains("acknowledge"), "{message}");
    bench.request(Request::Acknowledge).expect("taken over");
    bench.run(100);
    bench.grip(25.0).expect("taken over");
    bench.until(2000, |state| state.jaws == Jaws::Holding);
    bench.run(1000);
    assert!((bench.plant.force_n - 25.0).abs() < 0.1 && bench.least_n > 19.9, "{}", bench.least_n);
}

/// After a fast stop and its acknowledgement the gripper presses, and reports itself idle.
#[test]
fn home_is_refused_while_something_is_pressed_whatever_the_gripper_says() {
    let mut bench = Bench::holding("gcl", config("gcl"), "fast-stop@4000", 20.0);
    bench.run(2000);
    bench.grip(30.0).expect("nothing tells yet");
    bench.until_error(500);
    bench.request(Request::Acknowledge).expect("taken over");
    bench.run(200);
    assert_eq!(bench.state().expect("there").jaws, Jaws::Open);
    let home = bench.request(Request::Home);
    bench.run(2000);
    assert!(bench.least_n > 19.9, "{home:?}, {} N", bench.least_n);
    let message = home.expect_err("refused").to_string();
    assert!(message.contains("home to be done, got something between the jaws"), "{message}");
    bench.release().expect("taken over");
    bench.until(3000, |state| state.opening_mm.is_some_and(|mm| mm > 99.9));
    bench.request(Request::Home).expect("open jaws hold nothing");
}

/// A release is refused then, too: only homing is left, once the gripper has said so.
#[test]
fn after_a_power_cycle_home_is_refused_until_the_gripper_asks_for_it() {
    let mut bench = Bench::holding("gcl", config("gcl"), "power-cycle@4000", 20.0);
    bench.run(2000);
    bench.connect();
    bench.run(300);
    assert!(matches!(bench.request(Request::Home), Err(Error::Refused { .. })));
    bench.release().expect("taken over");
    let message = bench.until_error(500).to_string();
    assert!(message.contains("status 3, not homed"), "{message}");
    bench.run(1000);
    assert!(bench.least_n > 19.9, "{} N", bench.least_n);
    bench.request(Request::Home).expect("asked for by the gripper");
    bench.until(3000, |state| state.opening_mm.is_some_and(|mm| mm > 109.9));
    bench.run(100);
    bench.grip(20.0).expect("taken over");
    bench.until(3000, |state| state.jaws == Jaws::Holding);
    assert!(matches!(bench.request(Request::Home), Err(Error::Refused { .. })), "it is homed now, and holds");
}

#[test]
fn a_force_that_found_nothing_is_sent_again_after_home() {
    let mut bench = Bench::of("gcl", "");
    bench.plant.width_mm = None;
    bench.run(200);
    bench.grip(20.0).expect("taken over");
    bench.until(3000, |state| state.jaws == Jaws::Nothing);
    bench.request(Request::Home).expect("nothing is held");
    bench.until(3000, |state| state.opening_mm.is_some_and(|mm| mm > 109.9));
    bench.plant.width_mm = Some(WIDTH_MM);
    bench.run(100);
    bench.grip(20.0).expect("taken over");
    bench.until(3000, |state| state.jaws == Jaws::Holding);
    bench.run(1000);
    assert!((bench.plant.force_n - 20.0).abs() < 0.1, "{} N", bench.plant.force_n);
}

#[test]
fn after_a_new_link_the_force_of_before_counts_only_where_it_still_holds() {
    let relinked = |width_mm: Option<f64>| {
        let mut bench = Bench::holding("gcl", config("gcl"), "", 20.0);
        bench.request(Request::Leave).expect("taken over");
        bench.cut("closed");
        bench.plant.width_mm = width_mm;
        bench.run(500);
        bench.sent = Some(Vec::new());
        bench.connect();
        bench.run(500);
        bench.plant.width_mm = Some(WIDTH_MM);
        bench.grip(20.0).expect("taken over");
        bench.run(3000);
        assert_eq!(bench.state().expect("there").jaws, Jaws::Holding, "{width_mm:?}");
        commands(&bench)
    };
    assert_eq!(relinked(Some(WIDTH_MM)), [""; 0], "it holds with that force");
    assert_eq!(relinked(None), ["GRIP(20.00,50.00,50.00)"], "the part was lost meanwhile");
}

#[test]
fn a_gripper_that_has_stopped_itself_takes_no_home_and_is_not_busy() {
    let mut bench = Bench::of("gcl", "fast-stop@300");
    bench.run(400);
    bench.grip(20.0).expect("nothing tells yet");
    bench.until_error(500);
    let home = bench.request(Request::Home);
    bench.run(2000);
    assert!(!bench.driver.is_busy());
    assert!(matches!(home, Err(Error::FastStop { .. })), "{home:?}");
}

#[test]
fn a_fast_stop_is_not_blamed_on_a_link_that_was_lost_without_latching_one() {
    let mut bench = Bench::holding("gcl", config("gcl"), "fast-stop@8000", 20.0);
    bench.request(Request::Leave).expect("taken over");
    bench.cut("closed");
    bench.connect();
    bench.run(8000 - bench.now_ns() / MS + 100);
    bench.release().expect("nothing tells yet");
    bench.until_error(500);
    let message = bench.grip(20.0).expect_err("stopped").to_string();
    assert!(message.contains("a fast stop is the likely cause"), "{message}");

    let mut bench = Bench::holding("gcl", config("gcl"), "", 20.0);
    bench.cut("cut");
    bench.connect();
    bench.run(200);
    bench.release().expect("nothing tells yet");
    bench.until_error(500);
    let message = bench.grip(20.0).expect_err("stopped").to_string();
    assert!(message.contains("our last link to it was cut"), "{message}");
}

/// A sensor without a reading.
#[test]
fn a_force_that_is_no_number_is_unknown_and_delays_no_question() {
    let mut driver = driver("gcl", config("gcl"));
    driver.linked(0);
    let mut rounds_count = 0;
    for now_ns in (0..400).map(|ms| ms * MS) {
        driver.tick(now_ns);
        for line in String::from_utf8(std::mem::take(driver.outgoing())).expect("ASCII").lines() {
            rounds_count += usize::from(line == "GRIPSTATE?");
            let value = if line == "FORCE?" { "nan" } else { "0" };
            driver.receive(now_ns, format!("{}={value}\n", line.trim_end_matches('?')).as_bytes());
        }
    }
    let state = driver.state(400 * MS).expect("there");
    assert_eq!((state.force_n, state.opening_mm, state.jaws), (None, Some(0.0), Jaws::Open));
    assert!(rounds_count >= 12, "{rounds_count} rounds of 33 ms");
}

/// A question that is answered with an error; the command that waited for it is sent all the same.
#[test]
fn a_state_that_cannot_be_told_is_not_known_and_stops_no_command() {
    for (name, status) in [("FORCE", 2), ("POS", 16), ("GRIPSTATE", 7)] {
        let mut driver = driver("gcl", config("gcl"));
        let run = |driver: &mut Driver, from_ms: u64, fails: bool| {
            let mut grips_count = 0;
            for now_ns in (from_ms..from_ms + 200).map(|ms| ms * MS) {
                driver.tick(now_ns);
                let sent = String::from_utf8(std::mem::take(driver.outgoing())).expect("ASCII");
                for line in sent.lines() {
                    let answer = match line.trim_end_matches('?') {
                        asked if fails && asked == name => format!("ERR {name} {status}"),
                        "FORCE" => "FORCE=20".into(),
                        "POS" => "POS=110".into(),
                        "GRIPSTATE" => "GRIPSTATE=0".into(),
                        _ => "ACK GRIP".into(),
                    };
                    grips_count += u32::from(line.starts_with("GRIP("));
                    driver.receive(now_ns, format!("{answer}\n").as_bytes());
                }
            }
            grips_count
        };
        driver.linked(0);
        assert_eq!(run(&mut driver, 1, false), 0);
        let request = Request::Grip(GripCommand::Hold { force_n: 30.0 });
        driver.request(201 * MS, request).expect("taken over");
        assert_eq!(run(&mut driver, 201, true), 1, "{name}");
        let state = driver.state(401 * MS);
        let known = state.map_or((false, false, Jaws::Unknown), |state| {
            (state.force_n.is_some(), state.opening_mm.is_some(), state.jaws)
        });
        let jaws = if name == "GRIPSTATE" { Jaws::Unknown } else { Jaws::Open };
        assert_eq!(known, (name != "FORCE", name != "POS", jaws), "{name}");
    }
}

/// The end of an opening motion, and whether the next command to release gives it again.
#[test]
fn a_release_that_failed_under_way_is_given_again_and_one_that_somebody_aborted_is_not() {
    let release = Request::Grip(GripCommand::Release);
    for (end, is_fault, is_again) in [
        (Some("FIN RELEASE"), false, false),
        (Some("ERR RELEASE 18"), true, true),
        (Some("ERR RELEASE 19"), false, false),
        (None, true, true),
    ] {
        let mut driver = driver("gcl", config("gcl"));
        let say = |driver: &mut Driver, ms: u64, line: &str| driver.receive(ms * MS, format!("{line}\n").as_bytes());
        // Answers what is asked from `ms` on; returns the number of releases sent.
        let run = |driver: &mut Driver, from_ms: u64, ms: u64| {
            let mut releases_count = 0;
            for ms in from_ms..from_ms + ms {
                driver.tick(ms * MS);
                let sent = String::from_utf8(std::mem::take(driver.outgoing())).expect("ASCII");
                for line in sent.lines() {
                    match line {
                        "GRIPSTATE?" => say(driver, ms, "GRIPSTATE=4"),
                        "POS?" => say(driver, ms, "POS=50.00"),
                        "FORCE?" => say(driver, ms, "FORCE=20.00"),
                        _ => releases_count += u32::from(line.starts_with("RELEASE")),
                    }
                }
            }
            releases_count
        };
        driver.linked(0);
        assert_eq!(run(&mut driver, 1, 200), 0);
        driver.request(201 * MS, release).expect("taken over");
        assert_eq!(run(&mut driver, 201, 20), 1);
        say(&mut driver, 221, "ACK RELEASE");
        let end_ms = if end.is_some() { 300 } else { 10_300 };
        assert_eq!(run(&mut driver, 221, end_ms - 221), 0, "{end:?}: it is under way");
        end.into_iter().for_each(|line| say(&mut driver, end_ms, line));
        assert_eq!(driver.state(end_ms * MS).is_err(), is_fault, "{end:?}");
        let mut again_count = 0;
        for ms in (end_ms..end_ms + 60).step_by(20) {
            driver.request(ms * MS, release).expect("taken over");
            again_count += run(&mut driver, ms, 20);
        }
        assert_eq!(again_count, u32::from(is_again), "{end:?}");
    }
}

#[test]
fn what_the_old_link_told_is_not_known_on_a_new_one() {
    let mut bench = Bench::holding("gcl", config("gcl"), "", 20.0);
    let now_ns = bench.now_ns();
    let driver = &mut bench.driver;
    driver.unlinked(now_ns, "cut");
    driver.linked(now_ns);
    driver.receive(now_ns, b"@SPEED=0.00\n"); // it is there
    let state = driver.state(now_ns).expect("it is there");
    assert_eq!((state.opening_mm, state.force_n, state.jaws), (None, None, Jaws::Unknown));
}
