//! The force limit of a WSG-50: sent again where no answer comes, and not followed by the force.

use crate::bench::{Bench, MS, config, driver};
use slipbound::port::{DriverEvent, Jaws};
use slipbound_rig::gripper::Error;
use slipbound_rig::gripper::config::{Config, Lowering};

fn allowing() -> Config {
    Config { lowering: Lowering::Allow, ..config("wsg50") }
}

/// The link stalls for so long that the limit is sent again. Both are answered, and the second answer comes while the
/// next limit, which the gripper refuses, is in flight.
#[test]
fn the_second_answer_to_a_limit_that_was_sent_again_is_none_to_the_next_limit() {
    let beyond = Config { most_n: 200.0, ..allowing() };
    for most_bytes in [1, 10, 25, usize::MAX] {
        let mut bench = Bench::holding("wsg50", beyond.clone(), "stall=480@4000", 20.0);
        bench.most_bytes = most_bytes;
        bench.run(4000 - bench.now_ns() / MS);
        bench.grip(30.0).expect("taken over");
        bench.run(470);
        bench.grip(100.0).expect("not yet silent");
        let error = bench.until_error(500).to_string();
        assert!(error.contains("expected set force limit to be done, got status 28"), "{most_bytes} bytes: {error}");
        bench.run(1000);
        assert_eq!(bench.state().expect("there").target_n, Some(30.0), "{most_bytes} bytes");
        assert!((bench.plant.force_n - 30.0).abs() < 0.1, "{most_bytes} bytes: {} N", bench.plant.force_n);
        bench.grip(40.0).expect("taken over");
        bench.run(1000);
        assert!((bench.plant.force_n - 40.0).abs() < 0.1, "{most_bytes} bytes: {} N", bench.plant.force_n);
    }
}

/// The object was grasped by another program: no width is set here, so the grasp cannot be given again.
#[test]
fn without_a_width_a_force_that_does_not_follow_is_told_and_no_grasp_is_claimed() {
    let mut bench = Bench::holding("wsg50", allowing(), "fixed-limit,allow-regrasp", 20.0);
    bench.pair.driver = driver("wsg50", Config { part_width_mm: None, ..allowing() });
    bench.connect();
    bench.run(200);
    assert_eq!(bench.state().expect("there").jaws, Jaws::Holding);
    bench.grip(40.0).expect("taken over");
    let errors: Vec<Error> = (0..1000)
        .filter_map(|_| {
            bench.step();
            bench.state().err()
        })
        .collect();
    assert!(matches!(errors.as_slice(), [Error::Unset { key: "part_width_mm", .. }]), "{errors:?}");
    assert!(!bench.driver.is_busy());
    let path = bench.events.iter().find(|event| matches!(event, DriverEvent::ForcePath { .. }));
    assert_eq!(path, None);
    assert!(bench.least_n > 19.9, "{} N", bench.least_n);
}

/// The newest state says holding, but it is from before the release that was stopped.
#[test]
fn a_grasp_right_after_a_release_is_given_though_the_newest_state_still_says_holding() {
    for after_ms in (0..40).step_by(2) {
        let mut bench = Bench::holding("wsg50", allowing(), "", 20.0);
        bench.release().expect("taken over");
        bench.run(after_ms);
        bench.grip(20.0).expect("taken over");
        bench.run(3000);
        let state = bench.state().expect("there");
        assert_eq!(state.jaws, Jaws::Holding, "after {after_ms} ms: {state:?}");
        assert!((bench.plant.force_n - 20.0).abs() < 0.1, "after {after_ms} ms: {} N", bench.plant.force_n);
    }
}
