//! The line protocol, gripper and wrist, in lock-step.

use crate::bench::{Bench, MS, config, driver};
use slipbound::plant::Plant;
use slipbound::port::{GripCommand, Jaws, WristCommand, WristErrorKind, WristMotion};
use slipbound_rig::emulator::{Block, Emulator, Faults, by_name};
use slipbound_rig::gripper::config::{Config, Lowering};
use slipbound_rig::gripper::{self, Request};
use slipbound_rig::link::Endpoint;
use slipbound_rig::wrist::{Error, LineWrist};

/// -1, as some say that they do not know; a first command may not take it for what they hold with.
#[test]
fn a_negative_target_is_no_force_and_on_a_new_link_the_jaws_are_unknown_until_they_are_told() {
    let mut driver = driver("line", config("line"));
    driver.linked(0);
    driver.receive(0, b"HELLO slipbound-line 1\nGRIPPER jaws holding force_n 40 target_n -1 opening_mm 50\n");
    let state = driver.state(MS).expect("told");
    assert_eq!((state.jaws, state.force_n, state.target_n), (Jaws::Holding, Some(40.0), None));
    driver.linked(2 * MS);
    driver.receive(2 * MS, b"HELLO slipbound-line 1\n");
    let state = driver.state(3 * MS).expect("it is there");
    let known = (state.jaws, state.force_n, state.target_n, state.opening_mm);
    assert_eq!(known, (Jaws::Unknown, None, None, None));
}

#[test]
fn a_target_that_is_not_told_leaves_the_accepted_force() {
    let mut driver = driver("line", Config { lowering: Lowering::Refuse, ..config("line") });
    driver.linked(0);
    driver.receive(0, b"HELLO slipbound-line 1\n");
    let hold = |force_n| Request::Grip(GripCommand::Hold { force_n });
    let run = |driver: &mut gripper::Driver, from_ms: u64| {
        let mut sent = String::new();
        for ms in from_ms..from_ms + 1000 {
            driver.receive(ms * MS, b"GRIPPER jaws holding target_n -1\n");
            driver.tick(ms * MS);
            for line in String::from_utf8(std::mem::take(driver.outgoing())).expect("ASCII").lines() {
                let (number, words) = line.split_once(' ').expect("a number");
                driver.receive(ms * MS, format!("ACK {number} {words}\n").as_bytes());
                sent += words;
            }
        }
        (sent.matches("GRASP").count(), driver.state((from_ms + 1000) * MS).expect("there").target_n)
    };
    driver.permit_lowering(true);
    run(&mut driver, 1);
    driver.request(1001 * MS, hold(20.0)).expect("taken over");
    driver.permit_lowering(false);
    assert_eq!(run(&mut driver, 1001), (1, Some(20.0)));
    driver.request(2001 * MS, hold(20.0)).expect("the force it has");
    assert_eq!(run(&mut driver, 2001), (0, Some(20.0)));
    driver.request(3001 * MS, hold(30.0)).expect("more");
    assert_eq!(run(&mut driver, 3001), (1, Some(30.0)));
}

#[test]
fn a_block_is_gripped_and_released_by_these_lines() {
    for chunk in [1, usize::MAX] {
        let mut bench = Bench::of("line", "");
        bench.most_bytes = chunk;
        bench.run(100);
        bench.grip(20.0).expect("taken over");
        bench.until(3000, |state| state.jaws == Jaws::Holding);
        bench.grip(10.0).expect("the other side answers for what a lower force does");
        bench.run(1000);
        let state = bench.state().expect("there");
        assert_eq!((state.target_n, state.opening_mm), (Some(10.0), Some(50.0)));
        assert!((bench.plant.force_n - 10.0).abs() < 0.1);
        bench.release().expect("taken over");
        bench.until(3000, |state| state.opening_mm.is_some_and(|mm| mm > 99.9));
        bench.request(Request::Leave).expect("taken over");
        let text = String::from_utf8(bench.sent().to_vec()).expect("ASCII");
        let expected = "1 GRASP force_n 20.000000\n2 GRASP force_n 10.000000\n3 RELEASE opening_mm 100.000000\n4 BYE\n";
        assert_eq!(text, expected);
    }
}

#[test]
fn jaws_whose_supply_fails_on_their_way_stay_where_they_are() {
    let mut bench = Bench::of("line", "power-cycle@300");
    bench.run(100);
    bench.grip(20.0).expect("taken over");
    bench.run(300);
    assert!(!bench.is_connected());
    bench.connect();
    bench.run(100);
    let opening_mm = |bench: &mut Bench| bench.state().expect("there").opening_mm.expect("known");
    let stopped_mm = opening_mm(&mut bench);
    assert!((51.0..109.0).contains(&stopped_mm), "on their way: {stopped_mm}");
    bench.run(1000);
    assert_eq!(opening_mm(&mut bench), stopped_mm);
}

#[test]
fn a_refusal_a_wrong_echo_and_a_wrong_version_are_told() {
    let mut bench = Bench::of("line", "refuse-force");
    bench.run(100);
    bench.grip(20.0).expect("sent");
    let message = bench.until_error(200).to_string();
    assert!(message.contains("`force_n may be 5 to 80`"), "{message}");

    let mut bench = Bench::of("line", "");
    bench.run(100);
    bench.is_delivering = false;
    bench.grip(20.0).expect("sent");
    let now_ns = bench.now_ns();
    bench.pair.driver.receive(now_ns, b"ACK 1 GRASP force_n 28.000000\n");
    let message = bench.state().expect_err("another force").to_string();
    assert!(message.contains("28.000000` taken over instead of `GRASP force_n 20.000000`"), "{message}");
    assert_eq!(bench.state().expect("there").target_n, None);
    bench.pair.driver.receive(now_ns, b"HELLO slipbound-line 2\n");
    assert!(bench.state().expect_err("a version").to_string().contains("version 2, expected 1"));
}

/// Another program has changed it, or the device took it over in words only.
#[test]
fn a_force_that_the_other_side_no_longer_has_is_told_and_sent_again_when_it_is_asked_for_again() {
    let mut driver = driver("line", config("line"));
    let hold = Request::Grip(GripCommand::Hold { force_n: 20.0 });
    let state = |target_n: f64| format!("GRIPPER jaws holding target_n {target_n:.2} opening_mm 50.00\n");
    driver.linked(0);
    driver.receive(MS, b"HELLO slipbound-line 1\nGRIPPER jaws holding target_n 5.00 opening_mm 50.00\n");
    driver.request(2 * MS, hold).expect("taken over");
    driver.receive(3 * MS, b"ACK 1 GRASP force_n 20.000000\n");
    driver.outgoing().clear();
    for ms in (20..2000).step_by(20) {
        // Late at first, then rounded to its steps, then another.
        let target_n = match ms {
            0..400 => 5.0,
            400..1000 => 20.4,
            _ => 5.0,
        };
        driver.receive(ms * MS, state(target_n).as_bytes());
        if ms == 1000 {
            assert_eq!(driver.state(ms * MS).expect("there").target_n, Some(20.0));
        }
    }
    assert_eq!(driver.state(2000 * MS).expect("there").target_n, Some(5.0));
    assert_eq!(driver.outgoing(), b"", "nothing closes by itself");
    driver.request(2000 * MS, hold).expect("taken over");
    assert_eq!(driver.outgoing(), b"2 GRASP force_n 20.000000\n");
}

/// Another program opens them, and the device tells no opening.
#[test]
fn jaws_that_were_opened_are_not_closed_by_the_same_force_asked_for_again() {
    let mut driver = driver("line", config("line"));
    let hold = Request::Grip(GripCommand::Hold { force_n: 20.0 });
    driver.linked(0);
    driver.receive(MS, b"HELLO slipbound-line 1\nGRIPPER jaws holding target_n 5.00\n");
    driver.request(2 * MS, hold).expect("taken over");
    driver.receive(3 * MS, b"ACK 1 GRASP force_n 20.000000\n");
    driver.outgoing().clear();
    for ms in (20..2000).step_by(20) {
        let line = if ms < 400 { "GRIPPER jaws holding target_n 20.00\n" } else { "GRIPPER jaws open target_n 0.00\n" };
        driver.receive(ms * MS, line.as_bytes());
        driver.request(ms * MS, hold).expect("taken over");
        assert_eq!(driver.outgoing(), b"", "at {ms} ms");
    }
}

/// It has steps of 1.6 N and confirms what it was asked for. At 3 s another program sets another force.
#[test]
fn a_force_that_the_gripper_rounds_is_sent_again_once_and_told_as_it_is() {
    let mut driver = driver("line", config("line"));
    let hold = Request::Grip(GripCommand::Hold { force_n: 20.0 });
    driver.linked(0);
    driver.receive(MS, b"HELLO slipbound-line 1\nGRIPPER jaws holding target_n 5.00\n");
    let (mut target_n, mut counts) = (5.0, Vec::new());
    for ms in (20..6000).step_by(20) {
        if ms == 3000 {
            assert_eq!(driver.state(ms * MS).expect("there").target_n, Some(20.8));
            target_n = 12.8;
        }
        driver.receive(ms * MS, format!("GRIPPER jaws holding target_n {target_n:.2}\n").as_bytes());
        driver.request(ms * MS, hold).expect("taken over");
        let sent = String::from_utf8(std::mem::take(driver.outgoing())).expect("ASCII");
        if let Some(line) = sent.lines().next() {
            counts.push(ms / 3000);
            target_n = 20.8;
            driver.receive(ms * MS, format!("ACK {line}\n").as_bytes());
        }
    }
    assert_eq!(counts, [0, 0, 1, 1]);
    assert_eq!(driver.state(6000 * MS).expect("there").target_n, Some(20.8));
}

/// A wrist and its emulator, stepped by 2 ms.
struct Arm {
    wrist: LineWrist,
    emulator: Emulator,
    plant: Block,
    now_ns: u64,
    sent: Vec<u8>,
    is_delivering: bool,
}

impl Arm {
    fn new(faults: &str) -> Self {
        let faults: Faults = faults.parse().expect("faults");
        let emulator = by_name("line").expect("a name").with_faults(faults);
        let wrist = LineWrist::new("line://arm");
        let mut arm =
            Arm { wrist, emulator, plant: Block::new(50.0), now_ns: 0, sent: Vec::new(), is_delivering: true };
        arm.emulator.connected(0);
        arm.wrist.linked(0);
        arm.run(50);
        arm
    }

    fn run(&mut self, ms: u64) {
        for _ in 0..ms / 2 {
            self.now_ns += 2 * MS;
            self.emulator.tick(self.now_ns, &mut self.plant);
            self.plant.advance_to(self.now_ns);
            self.wrist.tick(self.now_ns);
            for _ in 0..if self.is_delivering { 4 } else { 0 } {
                let ours = std::mem::take(self.wrist.outgoing());
                self.sent.extend(&ours);
                self.emulator.receive(self.now_ns, &ours);
                let theirs = std::mem::take(self.emulator.outgoing());
                self.wrist.receive(self.now_ns, &theirs);
            }
        }
    }

    fn command(&mut self, motion: WristMotion) -> Result<(), Error> {
        self.wrist.command(self.now_ns, WristCommand::new(motion))
    }
}

/// The jaws of one that says where its wrist is, answers, and says no more of its gripper.
#[test]
fn a_gripper_that_says_nothing_of_its_jaws_is_silent_whatever_else_it_says() {
    let mut driver = driver("line", config("line"));
    driver.linked(0);
    driver.receive(0, b"HELLO slipbound-line 1\nGRIPPER jaws holding force_n 10 target_n 10\n");
    let told: Vec<_> = (1..=60u64)
        .map(|i| {
            let lines =
                format!("WRIST angle_rad 0 lowered_mm 0\nACK {i} GRASP force_n 20.000000\nHELLO slipbound-line 1\n");
            driver.receive(10 * i * MS, lines.as_bytes());
            driver.state(10 * i * MS)
        })
        .collect();
    assert!(told[..50].iter().all(Result::is_ok), "{told:?}");
    assert!(told[50..].iter().all(|told| matches!(told, Err(gripper::Error::Silent { .. }))), "{told:?}");
}

/// A wrist that stands at 0.06 rad and 1 mm, and from then on says less than where it is, beside the lines of a gripper
/// and answers.
#[test]
fn a_wrist_that_does_not_say_where_it_is_is_a_fault_whatever_else_it_says() {
    let told = |greeting: &str, first: &str, wrist_line: &str| {
        let mut wrist = LineWrist::new("line://arm");
        wrist.linked(0);
        wrist.receive(0, format!("{greeting}{first}").as_bytes());
        (1..=40u64)
            .map(|i| {
                let lines = format!("{wrist_line}GRIPPER jaws open\nACK {i} PAUSE\n{greeting}");
                wrist.receive(10 * i * MS, lines.as_bytes());
                wrist.report(10 * i * MS).map_err(|error| error.to_string())
            })
            .collect::<Vec<_>>()
    };
    let (greeting, whole) = ("HELLO slipbound-line 1\n", "WRIST angle_rad 0.06 lowered_mm 1\n");
    for first in ["", whole] {
        let silent = told(greeting, first, "");
        assert!(silent[29].is_ok() && silent[30..].iter().all(|told| told.is_err()), "{silent:?}");
        assert!(silent[30].as_ref().is_err_and(|text| text.contains("got no WRIST line for 310 ms")), "{silent:?}");
        for line in ["WRIST lowered_mm 1 moving 0", "WRIST angle_rad 0.06", "WRIST angle_rad nan lowered_mm 1"] {
            let quotes = format!("expected angle_rad and lowered_mm in every WRIST line, got `{line}`");
            let lacking = told(greeting, first, &format!("{line}\n"));
            assert!(lacking.iter().all(|told| told.as_ref().is_err_and(|text| text.contains(&quotes))), "{lacking:?}");
        }
    }
    let other = told("HELLO slipbound-line 2\n", "", whole);
    assert!(other.iter().all(|told| told.as_ref().is_err_and(|text| text.contains("expected version 1"))), "{other:?}");
}

/// A new link to a wrist that stands at 0.06 rad and has not said so yet.
#[test]
fn a_wrist_on_a_new_link_is_nowhere_until_it_says_where() {
    let mut arm = Arm::new("");
    arm.command(turn(0.3, 1.0)).expect("taken over");
    arm.run(1000);
    let before_rad = arm.wrist.report(arm.now_ns).expect("there").angle_rad;
    assert!(before_rad > 0.05);
    arm.wrist.unlinked(arm.now_ns, "cut");
    arm.wrist.linked(arm.now_ns);
    arm.wrist.receive(arm.now_ns, b"HELLO slipbound-line 1\n");
    let error = arm.wrist.report(arm.now_ns).expect_err("not 0");
    assert!(matches!(error, Error::Unstated { .. }), "{error}");
    assert_eq!(error.kind(), WristErrorKind::Link);
    arm.run(200);
    assert_eq!(arm.wrist.report(arm.now_ns).expect("there").angle_rad, before_rad);
}

/// The wrist stands at 0.06 rad and 3 mm when the link is cut, with two motions on their way. On the new one it reports
/// another position.
#[test]
fn a_wrist_that_counts_from_a_new_zero_is_a_fault_until_it_is_where_it_was() {
    let mut arm = Arm::new("");
    arm.command(turn(0.3, 1.0)).expect("taken over");
    arm.run(1000);
    arm.command(WristMotion::Lower { rate_mm_per_s: 15.0, most_mm: 3.0 }).expect("taken over");
    arm.run(1000);
    arm.command(turn(0.3, 1.0)).expect("taken over");
    arm.command(WristMotion::Lower { rate_mm_per_s: 15.0, most_mm: 3.0 }).expect("taken over");
    let relinked = |arm: &mut Arm, angle_rad: f64, lowered_mm: f64| {
        arm.wrist.unlinked(arm.now_ns, "cut");
        arm.wrist.linked(arm.now_ns);
        let line = format!("WRIST angle_rad {angle_rad} lowered_mm {lowered_mm} moving 0\n");
        arm.wrist.receive(arm.now_ns, line.as_bytes());
        arm.wrist.report(arm.now_ns).map(|state| (state.angle_rad, state.lowered_mm))
    };
    // At 0.3 rad/s and 15 mm/s it goes 0.15 rad and 7.5 mm while nobody hears of it.
    let error = relinked(&mut arm, 0.06, -6.0).expect_err("9 mm away");
    let text = error.to_string();
    assert!(text.contains("lowered_mm within 8.5 of 3") && text.contains("got -6: does it count"), "{text}");
    assert_eq!(error.kind(), WristErrorKind::Other);
    assert!(arm.wrist.report(arm.now_ns).is_err(), "for as long as it says so");
    let text = relinked(&mut arm, 0.3, 3.0).expect_err("0.24 rad away").to_string();
    assert!(text.contains("angle_rad within 0.2 of 0.06"), "{text}");
    assert_eq!(relinked(&mut arm, 0.2, 9.0).expect("where its last motion may have ended"), (0.2, 9.0));
    assert_eq!(relinked(&mut arm, 0.3, 9.0).expect("from there"), (0.3, 9.0));
    // A slower motion that may not have arrived leaves the faster one before it.
    arm.is_delivering = false;
    arm.command(WristMotion::Lower { rate_mm_per_s: 0.5, most_mm: 3.0 }).expect("taken over");
    assert_eq!(relinked(&mut arm, 0.3, 15.0).expect("where the faster one may have ended"), (0.3, 15.0));
    arm.is_delivering = true;
    assert_eq!(relinked(&mut arm, 0.3, 9.0).expect("back"), (0.3, 9.0));
    // A link on which it said nothing.
    arm.wrist.unlinked(arm.now_ns, "cut");
    arm.wrist.linked(arm.now_ns);
    arm.wrist.receive(arm.now_ns, b"HELLO slipbound-line 1\n");
    assert!(relinked(&mut arm, 0.3, -9.0).is_err(), "it still counts from the last position that it said");
}

/// A fast motion has expired a second ago, while the wrist told where it is.
#[test]
fn how_far_a_wrist_may_have_gone_unheard_does_not_count_from_a_motion_long_over() {
    let mut arm = Arm::new("");
    arm.command(WristMotion::Lower { rate_mm_per_s: 40.0, most_mm: 3.0 }).expect("taken over");
    arm.run(1000);
    arm.command(WristMotion::Lower { rate_mm_per_s: 2.0, most_mm: 3.0 }).expect("taken over");
    arm.run(100);
    let from_mm = arm.wrist.report(arm.now_ns).expect("there").lowered_mm;
    arm.wrist.unlinked(arm.now_ns, "cut");
    arm.wrist.linked(arm.now_ns);
    arm.wrist.receive(arm.now_ns, format!("WRIST angle_rad 0 lowered_mm {}\n", from_mm - 10.0).as_bytes());
    let text = arm.wrist.report(arm.now_ns).expect_err("10 mm away").to_string();
    assert!(text.contains("lowered_mm within 2 of"), "{text}");
}

fn turn(rate_rad_per_s: f64, most_rad: f64) -> WristMotion {
    WristMotion::Turn { rate_rad_per_s, most_rad }
}

#[test]
fn a_turn_that_is_not_renewed_pauses_and_one_that_is_goes_on_to_its_bound() {
    let mut arm = Arm::new("");
    arm.command(turn(0.3, 1.0)).expect("taken over");
    arm.run(1000);
    let state = arm.wrist.report(arm.now_ns).expect("there");
    assert!((state.angle_rad - 0.06).abs() < 1e-3 && !state.moving, "{state:?}");
    assert!((arm.plant.angle_rad - state.angle_rad).abs() < 1e-6);
    for _ in 0..20 {
        arm.command(turn(-0.3, 0.02)).expect("taken over");
        arm.run(50);
    }
    let before_rad = arm.plant.angle_rad;
    assert!((before_rad - (0.06 - 20.0 * 0.015)).abs() < 1e-3, "{before_rad}");
    arm.command(turn(0.3, 0.01)).expect("taken over");
    arm.run(190);
    assert!((arm.plant.angle_rad - before_rad - 0.01).abs() < 1e-3, "{}", arm.plant.angle_rad);
    arm.command(WristMotion::Lower { rate_mm_per_s: 10.0, most_mm: 1.5 }).expect("taken over");
    arm.run(300);
    assert!((arm.plant.lowered_mm - 1.5).abs() < 1e-6, "{}", arm.plant.lowered_mm);
    let text = String::from_utf8(arm.sent.clone()).expect("ASCII");
    let first = text.lines().next();
    assert_eq!(first, Some("1 TURN rate_rad_per_s 0.300000 most_rad 1.000000 time_to_live_ms 200.000000"));
}

#[test]
fn a_pause_waits_for_nothing_and_a_cut_link_pauses() {
    let mut arm = Arm::new("late=60");
    arm.command(turn(0.3, 1.0)).expect("taken over");
    arm.run(20);
    arm.command(turn(0.3, 1.0)).expect("taken over, to be sent after the answer");
    arm.command(WristMotion::Pause).expect("taken over");
    arm.run(20);
    let angle_rad = arm.plant.angle_rad;
    arm.run(500);
    assert_eq!(arm.plant.angle_rad, angle_rad);

    let mut arm = Arm::new("");
    arm.command(turn(0.3, 1.0)).expect("taken over");
    arm.run(50);
    arm.is_delivering = false;
    arm.run(1000);
    assert!(arm.plant.angle_rad < 0.3 * 0.21, "{}", arm.plant.angle_rad);
    let message = arm.wrist.report(arm.now_ns).expect_err("silent").to_string();
    assert!(message.contains("a sign of life every 300 ms"), "{message}");
    assert!(matches!(arm.command(turn(0.3, 1.0)), Err(Error::Silent { .. })));
}

#[test]
fn motions_that_cannot_be_are_refused_here_or_there() {
    let mut arm = Arm::new("");
    for (motion, said) in [
        (turn(f64::NAN, 1.0), "rate_rad_per_s a number, got NaN"),
        (turn(0.1, f64::INFINITY), "most_rad a number not below 0, got inf"),
        (WristMotion::Lower { rate_mm_per_s: 1.0, most_mm: -1.0 }, "most_mm a number not below 0, got -1"),
    ] {
        let message = arm.command(motion).expect_err("refused").to_string();
        assert!(message.contains(said), "{message}");
    }
    let too_long = WristCommand { motion: WristMotion::Pause, time_to_live_ns: 201 * MS };
    let message = arm.wrist.command(arm.now_ns, too_long).expect_err("refused").to_string();
    assert!(message.contains("time_to_live_ms at most 200, got 201"), "{message}");
    arm.command(turn(50.0, 1.0)).expect("sent");
    arm.run(20);
    let message = arm.wrist.report(arm.now_ns).expect_err("refused").to_string();
    assert!(message.contains("expected `TURN rate_rad_per_s 50.000000") && message.contains("too high"), "{message}");
    assert_eq!(arm.plant.angle_rad, 0.0);
}

/// The protocol lets the other side choose what it reports of a gripper: here the jaws alone.
fn run_terse(bench: &mut Bench, ms: u64) {
    bench.is_delivering = false;
    let until_ns = bench.now_ns() + ms * MS;
    while bench.now_ns() < until_ns {
        bench.step();
        let now_ns = bench.now_ns();
        let ours = std::mem::take(bench.driver.outgoing());
        bench.emulator.receive(now_ns, &ours);
        let theirs = String::from_utf8(std::mem::take(bench.emulator.outgoing())).expect("ASCII");
        let jaws_of = |line: &str| match line.split_once(" force_n") {
            Some((jaws, _)) if line.starts_with("GRIPPER") => format!("{jaws}\n"),
            _ => line.into(),
        };
        let terse: String = theirs.split_inclusive('\n').map(jaws_of).collect();
        bench.pair.driver.receive(now_ns, terse.as_bytes());
    }
    bench.is_delivering = true;
}

#[test]
fn jaws_that_tell_no_opening_are_open_when_they_say_so() {
    let mut bench = Bench::of("line", "");
    run_terse(&mut bench, 200);
    bench.grip(20.0).expect("taken over");
    run_terse(&mut bench, 3000);
    let state = bench.state().expect("there");
    assert_eq!((state.jaws, state.opening_mm, state.force_n), (Jaws::Holding, None, None));
    assert!(bench.request(Request::Home).is_err(), "it holds");
    bench.release().expect("taken over");
    run_terse(&mut bench, 3000);
    bench.request(Request::Home).expect("nothing is held");
    // Nor is a grasp on open jaws a lower force on what they hold.
    let mut bench = Bench::new("line", Config { lowering: Lowering::Refuse, ..config("line") }, "");
    run_terse(&mut bench, 200);
    for force_n in [20.0, 10.0] {
        bench.grip(force_n).unwrap_or_else(|error| panic!("{force_n} N: {error}"));
        run_terse(&mut bench, 3000);
        assert_eq!(bench.state().expect("there").jaws, Jaws::Holding);
        bench.release().expect("taken over");
        run_terse(&mut bench, 3000);
    }
}
