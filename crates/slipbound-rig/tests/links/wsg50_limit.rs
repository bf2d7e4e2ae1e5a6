//! The force limit of a WSG-50: sent again where no answer comes, and not followed by the force.

use crate::bench::{Bench, config, driver};
use slipbound::port::{DriverEvent, Jaws};
use slipbound_rig::gripper::Error;
use slipbound_rig::gripper::config::{Config, Lowering};

fn allowing() -> Config {
    Config { lowering: Lowering::Allow, ..config("wsg50") }
}

/// What is held was grasped by somebody else: no width is set here, so the grasp cannot be given again.
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
