//! WSG-50, binary interface, in lock-step.

use crate::bench::{Bench, MS, WIDTH_MM, config, driver};
use slipbound::port::{DriverEvent, GripCommand, Jaws};
use slipbound_rig::gripper::config::{Config, ForceChange, ForceIs, Lowering};
use slipbound_rig::gripper::wsg50::Wsg50;
use slipbound_rig::gripper::wsg50::frame::{self, Parser};
use slipbound_rig::gripper::{Driver, Error, Request};
use slipbound_rig::link::Endpoint;

/// Payloads of a command among sent bytes.
fn sent(bench: &Bench, id: u8) -> Vec<Vec<u8>> {
    let mut found = Vec::new();
    let mut keep = |frame: frame::Frame| {
        if frame.id == id {
            found.push(frame.payload().to_vec());
        }
    };
    Parser::default().feed(bench.sent(), &mut keep);
    found
}

fn allowing() -> Config {
    Config { lowering: Lowering::Allow, ..config("wsg50") }
}

#[test]
fn a_block_is_grasped_held_by_steps_of_force_and_released() {
    let mut bench = Bench::new("wsg50", allowing(), "");
    bench.run(100);
    assert_eq!(bench.state().expect("there").jaws, Jaws::Open);
    bench.grip(20.0).expect("taken over");
    let closing_ms = bench.until(3000, |state| state.jaws == Jaws::Holding);
    // 110 to 50 mm at 50 mm/s, 25 ms of delay, 2.3 lags of 80 ms to nine tenths of the force.
    assert!((1400..=1460).contains(&closing_ms), "{closing_ms} ms");
    bench.run(500);
    for force_n in [30.0, 42.5, 60.0, 35.0, 20.0] {
        bench.grip(force_n).expect("taken over");
        bench.run(700);
        let state = bench.state().expect("there");
        assert_eq!((state.jaws, state.target_n), (Jaws::Holding, Some(force_n)));
        assert!((state.force_n.expect("measured") - force_n).abs() < 0.1, "{state:?}");
        assert!((bench.plant.force_n - force_n).abs() < 0.1, "{}", bench.plant.force_n);
    }
    assert_eq!(sent(&bench, 0x25).len(), 1, "one grasp: the limit alone carried every change");
    let path = DriverEvent::ForcePath { path: "setting the force limit alone" };
    assert_eq!(bench.events.iter().filter(|event| **event == path).count(), 1, "{:?}", bench.events);
    for _ in 0..60 {
        bench.release().expect("taken over"); // a controller repeats it with every frame
        bench.run(32);
    }
    assert!(bench.state().expect("there").opening_mm.is_some_and(|mm| mm > 99.9));
    assert_eq!((bench.state().expect("there").jaws, bench.plant.force_n), (Jaws::Open, 0.0));
    assert_eq!((sent(&bench, 0x26).len(), sent(&bench, 0x21).len()), (1, 0));
    bench.grip(10.0).expect("taken over");
    bench.until(3000, |state| state.jaws == Jaws::Holding);
}

#[test]
fn the_bytes_of_a_grasp_are_the_known_good_ones() {
    let mut bench = Bench::of("wsg50", "");
    bench.run(50);
    bench.grip(20.0).expect("taken over");
    bench.run(2000);
    let limit_20_n = [0xAA, 0xAA, 0xAA, 0x32, 0x04, 0x00, 0x00, 0x00, 0xA0, 0x41, 0xF5, 0x22];
    assert!(bench.sent().windows(12).any(|bytes| bytes == limit_20_n));
    assert_eq!(sent(&bench, 0x25), [[50f32.to_le_bytes(), 50f32.to_le_bytes()].concat()]);
    assert_eq!(sent(&bench, 0x40)[0], [1, 20, 0], "system state by itself, every 20 ms");
    for id in [0x20, 0x21, 0x22, 0x23, 0x24, 0x26, 0x07] {
        assert!(sent(&bench, id).is_empty(), "{id:#x} was never asked for");
    }
    bench.request(Request::Acknowledge).expect("taken over");
    let ack = [0xAA, 0xAA, 0xAA, 0x24, 0x03, 0x00, 0x61, 0x63, 0x6B, 0xDC, 0xB9];
    assert!(bench.sent().ends_with(&ack));
}

#[test]
fn split_into_single_bytes_the_run_is_the_same() {
    let run = |chunk| {
        let mut bench = Bench::new("wsg50", allowing(), "");
        bench.most_bytes = chunk;
        bench.run(100);
        bench.grip(25.0).expect("taken over");
        bench.run(2000);
        bench.grip(15.0).expect("taken over");
        bench.run(150);
        (bench.state().expect("there"), bench.plant.force_n)
    };
    assert_eq!(run(1), run(usize::MAX));
    assert_eq!(run(5), run(usize::MAX));
}

#[test]
fn force_stays_in_its_range_whatever_is_asked() {
    let mut bench = Bench::new("wsg50", Config { least_n: 8.0, most_n: 40.0, ..allowing() }, "");
    bench.run(100);
    let message = bench.grip(f64::NAN).expect_err("refused").to_string();
    assert_eq!(message, "wsg50://bench: expected a force from 8 N to 40 N per finger, got NaN");
    for (asked_n, given_n) in [(1e300, 40.0), (-5.0, 8.0), (1e9, 40.0), (0.0, 8.0)] {
        bench.grip(asked_n).expect("taken over");
        bench.run(2500);
        assert_eq!(bench.state().expect("there").target_n, Some(given_n));
        assert!((bench.plant.force_n - given_n).abs() < 0.1, "{}", bench.plant.force_n);
        assert!(bench.events.contains(&DriverEvent::Clamped { asked_n, given_n }));
    }
    for payload in sent(&bench, 0x32) {
        let own_n = f32::from_le_bytes(payload.try_into().expect("four bytes"));
        assert!((8.0..=40.0).contains(&own_n), "{own_n}");
    }
}

#[test]
fn newtons_of_both_fingers_are_halved_and_doubled() {
    let config = Config { force_is: ForceIs::Total, most_n: 40.0, ..allowing() };
    let mut bench = Bench::new("wsg50", config, "");
    bench.run(100);
    bench.grip(15.0).expect("taken over");
    bench.run(2500);
    assert_eq!(sent(&bench, 0x32), [30f32.to_le_bytes()]);
    let state = bench.state().expect("there");
    assert_eq!(state.target_n, Some(15.0));
    assert!((state.force_n.expect("measured") - 15.0).abs() < 0.1, "{state:?}");
}

#[test]
fn a_lower_force_while_holding_is_refused_until_it_is_allowed() {
    let mut bench = Bench::holding("wsg50", config("wsg50"), "", 30.0);
    let message = bench.grip(20.0).expect_err("refused").to_string();
    for part in ["30 N to 20 N", "check-hold", "lowering = \"allow\""] {
        assert!(message.contains(part), "{message}");
    }
    bench.run(1000);
    assert!(bench.least_n > 29.9, "{}", bench.least_n);
    bench.grip(35.0).expect("higher is taken over");
    bench.run(700);
    bench.driver.permit_lowering(true);
    bench.grip(20.0).expect("taken over");
    bench.run(700);
    assert!((bench.plant.force_n - 20.0).abs() < 0.1);
    bench.driver.permit_lowering(false);
    assert!(matches!(bench.grip(10.0), Err(Error::Lowering { .. })));
    bench.release().expect("letting go is no lowering");
}

#[test]
fn where_the_limit_has_no_effect_the_grasp_is_given_again() {
    let mut bench = Bench::holding("wsg50", allowing(), "fixed-limit,allow-regrasp", 20.0);
    bench.grip(40.0).expect("taken over");
    bench.run(350);
    assert!((bench.plant.force_n - 20.0).abs() < 0.1, "not before it was seen not to follow");
    bench.run(1000);
    assert!((bench.plant.force_n - 40.0).abs() < 0.1, "{}", bench.plant.force_n);
    assert!(
        bench.events.contains(&DriverEvent::ForcePath { path: "setting the force limit and giving the grasp again" })
    );
    assert!(bench.least_n > 19.9, "{}", bench.least_n);

    // A change that the gripper hardly resolves proves nothing; such changes add up to one that does.
    let mut bench = Bench::holding("wsg50", allowing(), "fixed-limit,allow-regrasp", 20.0);
    bench.grip(21.0).expect("taken over");
    bench.run(1000);
    assert!((bench.plant.force_n - 20.0).abs() < 0.1, "{}", bench.plant.force_n);
    bench.grip(22.5).expect("taken over");
    bench.run(1500);
    assert!((bench.plant.force_n - 22.5).abs() < 0.1, "{}", bench.plant.force_n);

    // If neither way works, that is reported, and the force stays.
    let mut bench = Bench::holding("wsg50", allowing(), "fixed-limit", 20.0);
    bench.grip(40.0).expect("taken over");
    let message = bench.until_error(2000).to_string();
    assert!(message.contains("expected grasp to be done, got status 16"), "{message}");
    bench.run(1000);
    assert!((bench.plant.force_n - 20.0).abs() < 0.1, "{}", bench.plant.force_n);

    let config = Config { force_change: ForceChange::Regrasp, ..allowing() };
    let mut bench = Bench::holding("wsg50", config, "fixed-limit,allow-regrasp", 20.0);
    bench.grip(40.0).expect("taken over");
    bench.run(350);
    assert!((bench.plant.force_n - 40.0).abs() < 2.0, "at once: {}", bench.plant.force_n);
}

/// A law that asks for more in every cycle; and one whose last step comes while the grasp is given again.
#[test]
fn a_limit_without_effect_is_noticed_though_it_moves_on() {
    let mut bench = Bench::holding("wsg50", allowing(), "fixed-limit,allow-regrasp", 20.0);
    for force_n in [30.0, 40.0, 50.0, 60.0] {
        bench.grip(force_n).expect("taken over");
        bench.run(200);
    }
    assert!(bench.plant.force_n > 29.0, "after 0.8 s: {}", bench.plant.force_n);
    bench.run(1500);
    assert!((bench.plant.force_n - 60.0).abs() < 0.1, "{}", bench.plant.force_n);
    assert!(bench.least_n > 19.9, "{}", bench.least_n);

    for wait_ms in (300..700).step_by(10) {
        let mut bench = Bench::holding("wsg50", allowing(), "fixed-limit,allow-regrasp", 20.0);
        bench.grip(30.0).expect("taken over");
        bench.run(wait_ms);
        bench.grip(40.0).expect("taken over");
        bench.run(2500);
        assert!((bench.plant.force_n - 40.0).abs() < 0.1, "after {wait_ms} ms: {}", bench.plant.force_n);
    }

    // Where the limit works no grasp is given again.
    let mut bench = Bench::holding("wsg50", allowing(), "", 20.0);
    for cycle in 0..60 {
        bench.grip(20.5 + 0.5 * f64::from(cycle)).expect("taken over");
        bench.run(33);
    }
    bench.run(1000);
    assert!((bench.plant.force_n - 50.0).abs() < 0.1, "{}", bench.plant.force_n);
    let again = DriverEvent::ForcePath { path: "setting the force limit and giving the grasp again" };
    assert!(!bench.events.contains(&again));
}

#[test]
fn nothing_and_a_lost_part_are_told_and_no_grasp_is_given_again() {
    let mut bench = Bench::of("wsg50", "");
    bench.plant.width_mm = None;
    bench.run(100);
    bench.grip(20.0).expect("taken over");
    bench.until(3000, |state| state.jaws == Jaws::Nothing);

    let mut bench = Bench::holding("wsg50", config("wsg50"), "lose-part@4000", 20.0);
    bench.until(3000, |state| state.jaws == Jaws::Lost);
    for _ in 0..20 {
        bench.grip(20.0).expect("taken over");
        bench.run(50);
    }
    assert_eq!((sent(&bench, 0x25).len(), bench.state().expect("there").jaws), (1, Jaws::Lost));
}

/// The part is lost, or the jaws are opened, while the driver waits for the force to follow a new limit.
#[test]
fn no_grasp_is_given_again_where_nothing_is_held_any_more() {
    for force_n in [40.0, 10.0] {
        let mut bench = Bench::holding("wsg50", allowing(), "fixed-limit", 20.0);
        bench.grip(force_n).expect("taken over");
        bench.run(50);
        bench.plant.width_mm = None;
        bench.run(2000);
        assert_eq!(sent(&bench, 0x25).len(), 1, "{force_n} N");
        assert_ne!(bench.state().expect("there").jaws, Jaws::Holding);
    }
}

/// Jaws that were opened while the link was cut are seen as such before anything else of them.
#[test]
fn on_a_new_link_nothing_is_told_or_taken_over_before_the_opening_is() {
    let mut bench = Bench::holding("wsg50", config("wsg50"), "", 20.0);
    assert!(bench.state().expect("there").opening_mm.is_some());
    let mut driver = std::mem::replace(&mut bench.driver, driver("wsg50", config("wsg50")));
    let (mut now_ns, mut bytes) = (bench.now_ns() + MS, Vec::new());
    driver.linked(now_ns);
    let told = |id: u8, payload: &[u8]| {
        let mut bytes = Vec::new();
        frame::write(&mut bytes, id, &[&[0, 0], payload].concat());
        bytes
    };
    for (id, payload) in [(0x33, 20f32.to_le_bytes().to_vec()), (0x40, vec![1, 0, 0, 0]), (0x41, vec![0])] {
        bytes.extend(told(id, &payload));
    }
    driver.receive(now_ns, &bytes);
    assert_eq!(driver.state(now_ns).map_or(Jaws::Unknown, |state| state.jaws), Jaws::Unknown);
    let request = Request::Grip(GripCommand::Hold { force_n: 20.0 });
    driver.request(now_ns, request).expect_err("its opening may be that of the link before");
    now_ns += MS;
    driver.receive(now_ns, &told(0x43, &100f32.to_le_bytes()));
    let state = driver.state(now_ns).expect("told");
    assert_eq!((state.jaws, state.opening_mm), (Jaws::Open, Some(100.0)));
}

#[test]
fn contact_far_from_the_parts_width_is_told_as_a_collision() {
    let config = Config { part_width_mm: Some(WIDTH_MM - 20.0), ..config("wsg50") };
    let mut bench = Bench::new("wsg50", config.clone(), "");
    bench.run(100);
    bench.grip(20.0).expect("taken over");
    let message = bench.until_error(3000).to_string();
    assert!(message.contains("status 29") && message.contains("part_width_mm"), "{message}");
    let mut bench = Bench::new("wsg50", Config { part_width_mm: None, ..config }, "");
    bench.run(100);
    let message = bench.grip(20.0).expect_err("refused").to_string();
    assert!(message.contains("grasp needs the setting part_width_mm"), "{message}");
}

#[test]
fn home_is_refused_while_holding_and_asked_for_where_it_is_missing() {
    let mut bench = Bench::holding("wsg50", config("wsg50"), "", 20.0);
    let message = bench.request(Request::Home).expect_err("refused").to_string();
    assert!(message.contains("home to be done, got something between the jaws"), "{message}");

    let mut bench = Bench::of("wsg50", "power-cycle@100");
    bench.run(200);
    bench.connect();
    bench.run(100);
    assert_eq!(bench.state().expect("there").jaws, Jaws::Unknown);
    assert!(matches!(bench.grip(20.0), Err(Error::NotHomed { .. })));
    bench.request(Request::Home).expect("taken over");
    bench.until(3000, |state| state.jaws == Jaws::Open);
    bench.grip(20.0).expect("taken over");
    bench.until(3000, |state| state.jaws == Jaws::Holding);
}

#[test]
fn a_command_overtaken_before_it_was_sent_is_never_sent() {
    let mut bench = Bench::holding("wsg50", allowing(), "late=100", 20.0);
    for force_n in [30.0, 31.0, 32.0, 33.0] {
        bench.grip(force_n).expect("taken over");
    }
    bench.run(1500);
    let limits: Vec<_> = sent(&bench, 0x32);
    assert_eq!(limits[1..], [30f32.to_le_bytes(), 33f32.to_le_bytes()]);
    assert!((bench.plant.force_n - 33.0).abs() < 0.1);
}

#[test]
fn a_release_overtakes_a_grasp_under_way() {
    let mut bench = Bench::of("wsg50", "");
    bench.run(100);
    bench.grip(20.0).expect("taken over");
    bench.run(500);
    bench.release().expect("taken over");
    bench.until(3000, |state| state.opening_mm.is_some_and(|mm| mm > 99.9));
    assert_eq!((bench.least_n, sent(&bench, 0x22).len()), (0.0, 1));
}

#[test]
fn a_grasp_overtakes_a_release_under_way() {
    let mut bench = Bench::holding("wsg50", config("wsg50"), "", 20.0);
    bench.release().expect("taken over");
    bench.run(300);
    bench.grip(20.0).expect("taken over");
    bench.until(3000, |state| state.jaws == Jaws::Holding);
    assert_eq!((sent(&bench, 0x26).len(), sent(&bench, 0x22).len(), sent(&bench, 0x25).len()), (1, 1, 2));
    assert!(bench.state().is_ok(), "nothing was refused");
}

#[test]
fn what_is_held_when_the_link_is_made_is_not_grasped_again() {
    let mut bench = Bench::holding("wsg50", config("wsg50"), "", 20.0);
    bench.request(Request::Leave).expect("taken over");
    bench.run(20);
    bench.cut("closed");
    bench.sent = Some(Vec::new());
    bench.connect();
    bench.run(200);
    bench.grip(30.0).expect("taken over");
    bench.run(1000);
    assert!((bench.plant.force_n - 30.0).abs() < 0.1, "{}", bench.plant.force_n);
    assert_eq!((sent(&bench, 0x32).len(), sent(&bench, 0x25).len()), (1, 0));
}

#[test]
fn silence_is_told_in_time_and_nothing_piles_up() {
    let mut bench = Bench::holding("wsg50", allowing(), "", 20.0);
    bench.is_delivering = false;
    let from_ns = bench.now_ns();
    bench.grip(30.0).expect("taken over");
    let message = bench.until_error(600).to_string();
    assert!((500 * MS..525 * MS).contains(&(bench.now_ns() - from_ns)));
    assert!(message.starts_with("wsg50://bench: expected a sign of life every 500 ms, got none for 50"), "{message}");
    bench.run(20_000);
    assert!(bench.driver.outgoing().len() < 1200, "{} bytes wait for a dead link", bench.driver.outgoing().len());
    assert!((bench.plant.force_n - 20.0).abs() < 0.1);
}

#[test]
fn an_unanswered_limit_is_sent_three_times_and_then_told() {
    let mut driver = Driver::new("wsg50://hand", config("wsg50"), Wsg50::default());
    let tell = |driver: &mut Driver<Wsg50>, now_ns, id, rest: &[u8]| {
        let mut bytes = Vec::new();
        frame::write(&mut bytes, id, &[&[0, 0], rest].concat());
        driver.receive(now_ns, &bytes);
    };
    driver.linked(0);
    tell(&mut driver, 1, 0x40, &[1, 0, 0, 0]);
    tell(&mut driver, 1, 0x41, &[4]);
    tell(&mut driver, 1, 0x33, &20f32.to_le_bytes());
    driver.outgoing().clear();
    let command = GripCommand::Hold { force_n: 30.0 };
    driver.request(2, Request::Grip(command)).expect("taken over");
    let (mut errors, mut sent_count) = (Vec::new(), 0);
    for ms in 1..2000 {
        tell(&mut driver, ms * MS, 0x40, &[1, 0, 0, 0]);
        tell(&mut driver, ms * MS, 0x41, &[4]);
        tell(&mut driver, ms * MS, 0x45, &20f32.to_le_bytes());
        driver.tick(ms * MS);
        Parser::default().feed(&std::mem::take(driver.outgoing()), |frame| sent_count += usize::from(frame.id == 0x32));
        errors.extend(driver.state(ms * MS).err().map(|error| (ms, error.to_string())));
    }
    assert_eq!(sent_count, 3);
    assert_eq!(errors, [(1353, "wsg50://hand: expected an answer to set force limit within 450 ms, got none".into())]);
    assert_eq!(driver.state(2000 * MS).expect("there").target_n, Some(20.0));
}

/// NO_SENSOR, for example.
#[test]
fn a_state_that_it_can_no_longer_tell_is_not_known() {
    let mut driver = Driver::new("wsg50://hand", config("wsg50"), Wsg50::default());
    driver.linked(0);
    let mut tell = |ms: u64, id, rest: &[u8]| {
        let mut bytes = Vec::new();
        frame::write(&mut bytes, id, rest);
        driver.receive(ms * MS, &bytes);
        let state = driver.state(ms * MS).expect("it answers");
        (state.jaws, state.force_n, state.opening_mm)
    };
    tell(1, 0x40, &[0, 0, 1, 0, 0, 0]);
    tell(1, 0x41, &[0, 0, 4]);
    tell(1, 0x43, &[&[0, 0], &50f32.to_le_bytes()[..]].concat());
    let told = tell(1, 0x45, &[&[0, 0], &10f32.to_le_bytes()[..]].concat());
    assert_eq!(told, (Jaws::Holding, Some(10.0), Some(50.0)));
    assert_eq!(tell(2, 0x45, &[2, 0]), (Jaws::Holding, None, Some(50.0)));
    assert_eq!(tell(3, 0x43, &[2, 0]), (Jaws::Holding, None, None));
    assert_eq!(tell(4, 0x41, &[2, 0]), (Jaws::Unknown, None, None));
    assert_eq!(tell(5, 0x41, &[0, 0, 4]), (Jaws::Holding, None, None));
    assert_eq!(tell(6, 0x40, &[2, 0]), (Jaws::Unknown, None, None));
}

/// A grasp that is refused, or not answered, is not given again automatically, but when the same command comes again.
#[test]
fn a_grasp_that_was_not_accepted_is_given_again_when_it_is_asked_for_again() {
    for answer in [Some(14u16), Some(16), None] {
        let mut driver = Driver::new("wsg50://hand", config("wsg50"), Wsg50::default());
        let tell = |driver: &mut Driver<Wsg50>, ms: u64, id, rest: &[u8]| {
            let mut bytes = Vec::new();
            frame::write(&mut bytes, id, rest);
            driver.receive(ms * MS, &bytes);
        };
        let mut grasps_count = 0;
        let mut sent = |driver: &mut Driver<Wsg50>| {
            let bytes = std::mem::take(driver.outgoing());
            Parser::default().feed(&bytes, |frame| grasps_count += usize::from(frame.id == 0x25));
            grasps_count
        };
        driver.linked(0);
        tell(&mut driver, 1, 0x40, &[0, 0, 1, 0, 0, 0]);
        tell(&mut driver, 1, 0x41, &[0, 0, 0]);
        tell(&mut driver, 1, 0x33, &[&[0, 0], &20f32.to_le_bytes()[..]].concat());
        let command = Request::Grip(GripCommand::Hold { force_n: 20.0 });
        driver.request(2 * MS, command).expect("taken over");
        assert_eq!(sent(&mut driver), 1);
        if let Some(status) = answer {
            tell(&mut driver, 3, 0x25, &status.to_le_bytes());
        }
        let mut errors = Vec::new();
        for ms in 4..1500 {
            tell(&mut driver, ms, 0x40, &[0, 0, 1, 0, 0, 0]);
            tell(&mut driver, ms, 0x41, &[0, 0, 0]);
            tell(&mut driver, ms, 0x45, &[&[0, 0], &0f32.to_le_bytes()[..]].concat());
            driver.tick(ms * MS);
            errors.extend(driver.state(ms * MS).err().map(|error| error.to_string()));
            assert_eq!(sent(&mut driver), 1, "{answer:?}: given again by itself after {ms} ms");
        }
        assert!(errors.iter().any(|error| error.contains("grasp")), "{answer:?}: {errors:?}");
        driver.request(1500 * MS, command).expect("taken over");
        // Without an answer the limit is not known any more, and is set first.
        tell(&mut driver, 1501, 0x32, &[0, 0]);
        driver.tick(1502 * MS);
        assert_eq!(sent(&mut driver), 2, "{answer:?}");
    }
}

/// The end of the grasp is lost on the way, but the states report that it holds, and the force follows.
#[test]
fn where_the_end_of_a_grasp_is_lost_the_states_show_that_it_has_ended() {
    let mut driver = Driver::new("wsg50://hand", allowing(), Wsg50::default());
    let tell = |driver: &mut Driver<Wsg50>, ms: u64, id, rest: &[u8]| {
        let mut bytes = Vec::new();
        frame::write(&mut bytes, id, rest);
        driver.receive(ms * MS, &bytes);
    };
    let sent = |driver: &mut Driver<Wsg50>| {
        let mut ids = Vec::new();
        Parser::default().feed(&std::mem::take(driver.outgoing()), |frame| ids.push(frame.id));
        ids
    };
    let force = |force_n: f32| [&[0, 0], &force_n.to_le_bytes()[..]].concat();
    let hold = |force_n| Request::Grip(GripCommand::Hold { force_n });
    driver.linked(0);
    tell(&mut driver, 1, 0x40, &[0, 0, 1, 0, 0, 0]);
    tell(&mut driver, 1, 0x41, &[0, 0, 0]);
    tell(&mut driver, 1, 0x33, &force(20.0));
    assert_eq!(sent(&mut driver), [0x40, 0x41, 0x43, 0x45, 0x33]);
    driver.request(2 * MS, hold(20.0)).expect("taken over");
    assert_eq!(sent(&mut driver), [0x25]);
    tell(&mut driver, 3, 0x25, &26u16.to_le_bytes()); // in progress; its end never comes
    assert!(driver.is_busy());
    tell(&mut driver, 50, 0x41, &[0, 0, 4]);
    tell(&mut driver, 50, 0x45, &force(20.0));
    driver.request(60 * MS, hold(30.0)).expect("taken over");
    assert_eq!(sent(&mut driver), [0x32]);
    tell(&mut driver, 61, 0x32, &[0, 0]);
    tell(&mut driver, 90, 0x45, &force(29.0));
    assert!(!driver.is_busy(), "it holds, and the force has followed");
    driver.request(100 * MS, Request::Grip(GripCommand::Release)).expect("taken over");
    assert_eq!(sent(&mut driver), [0x26], "a release, no stop before it");
}

/// The end of an opening motion, and whether the next command to release gives it again.
#[test]
fn a_release_that_failed_under_way_is_given_again_and_one_that_somebody_aborted_is_not() {
    let release = Request::Grip(GripCommand::Release);
    for (end, is_fault, is_again) in
        [(Some(0u16), false, false), (Some(18), true, true), (Some(19), false, false), (None, true, true)]
    {
        let mut driver = Driver::new("wsg50://hand", config("wsg50"), Wsg50::default());
        let tell = |driver: &mut Driver<Wsg50>, ms: u64, id, rest: &[u8]| {
            let mut bytes = Vec::new();
            frame::write(&mut bytes, id, rest);
            driver.receive(ms * MS, &bytes);
        };
        let releases = |driver: &mut Driver<Wsg50>| {
            let mut count = 0;
            Parser::default().feed(&std::mem::take(driver.outgoing()), |frame| count += u32::from(frame.id == 0x26));
            count
        };
        driver.linked(0);
        tell(&mut driver, 1, 0x40, &[0, 0, 1, 0, 0, 0]);
        tell(&mut driver, 1, 0x41, &[0, 0, 4]); // it holds
        driver.request(2 * MS, release).expect("taken over");
        assert_eq!(releases(&mut driver), 1);
        tell(&mut driver, 3, 0x26, &26u16.to_le_bytes()); // in progress
        let end_ms = if end.is_some() { 100 } else { 10_000 };
        for ms in (10..end_ms).step_by(10) {
            tell(&mut driver, ms, 0x40, &[0, 0, 1, 0, 0, 0]);
            tell(&mut driver, ms, 0x41, &[0, 0, 4]);
            driver.tick(ms * MS);
            driver.request(ms * MS, release).expect("taken over");
        }
        if let Some(code) = end {
            tell(&mut driver, end_ms, 0x26, &code.to_le_bytes());
        }
        assert_eq!(releases(&mut driver), 0, "{end:?}: it is under way");
        driver.tick((end_ms + 5) * MS);
        assert_eq!(driver.state((end_ms + 5) * MS).is_err(), is_fault, "{end:?}");
        for ms in end_ms + 6..end_ms + 16 {
            driver.request(ms * MS, release).expect("taken over");
            driver.tick(ms * MS);
        }
        assert_eq!(releases(&mut driver), u32::from(is_again), "{end:?}");
    }
}

#[test]
fn two_runs_are_the_same_and_faster_than_real_time() {
    let from = std::time::Instant::now();
    let run = || {
        let mut bench = Bench::new("wsg50", allowing(), "late=13,corrupt=0.05,drop=0.02,seed=7");
        bench.run(100);
        let mut trace = Vec::new();
        for i in 0..100 {
            let _ = bench.grip(20.0 + f64::from(i % 7));
            bench.run(100);
            trace.push((bench.plant.force_n, bench.state().ok().and_then(|state| state.force_n)));
        }
        (trace, bench.sent().to_vec())
    };
    assert_eq!(run(), run());
    let real_s = from.elapsed().as_secs_f64();
    assert!(real_s < 10.0, "20 s of gripping took {real_s} s");
}
