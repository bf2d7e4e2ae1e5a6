//! WSG-50, text interface, in lock-step.

use crate::bench::{Bench, config};
use slipbound::port::Jaws;
use slipbound_rig::gripper::config::{Config, Lowering};
use slipbound_rig::gripper::{Error, Request};

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
