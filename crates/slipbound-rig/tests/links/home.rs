//! Homing moves the jaws: no driver sends it while something is, or may be, between them. A release makes way for it.

use crate::bench::{Bench, config, driver};
use slipbound::port::Jaws;
use slipbound_rig::emulator::NAMES;
use slipbound_rig::gripper::config::Config;
use slipbound_rig::gripper::{Error, Request};

#[test]
fn home_is_refused_from_the_first_touch_on() {
    let accepting: Vec<&str> = NAMES
        .into_iter()
        .filter(|name| {
            let mut bench = Bench::of(name, "");
            bench.run(200);
            bench.grip(40.0).expect("taken over");
            while bench.plant.force_n == 0.0 {
                bench.step();
            }
            bench.run(40); // until the newest state has been heard
            assert!((1.0..39.0).contains(&bench.plant.force_n), "{name}: {} N", bench.plant.force_n);
            bench.request(Request::Home).is_ok()
        })
        .collect();
    assert_eq!(accepting, [""; 0]);
}

/// The link is new, and the answers are on their way.
#[test]
fn home_is_refused_as_long_as_it_is_not_known_whether_something_is_held() {
    let accepting: Vec<&str> = NAMES
        .into_iter()
        .filter(|name| {
            let mut bench = Bench::holding(name, config(name), "late=30", 40.0);
            bench.request(Request::Leave).expect("taken over");
            bench.run(100);
            bench.cut("closed");
            bench.connect();
            let home = bench.request(Request::Home);
            bench.run(2000);
            let is_refused = matches!(home, Err(Error::NotReady { .. } | Error::Refused { .. }));
            assert_eq!(is_refused, bench.least_n > 39.0, "{name}: {home:?}, {} N", bench.least_n);
            assert!(!is_refused || bench.state().is_ok_and(|state| state.jaws == Jaws::Holding), "{name}");
            !is_refused
        })
        .collect();
    assert_eq!(accepting, [""; 0]);
}

/// After a fast stop and its acknowledgement a gripper presses, and reports itself idle.
#[test]
fn home_is_refused_where_the_jaws_press_as_wide_as_a_release_would_leave_them() {
    let accepting: Vec<&str> = ["wsg50", "gcl"]
        .into_iter()
        .filter(|name| {
            let mut bench = Bench::holding(name, config(name), "fast-stop@4000", 40.0);
            bench.run(2000);
            bench.request(Request::Acknowledge).expect("taken over");
            bench.run(100);
            bench.request(Request::Leave).expect("taken over");
            bench.run(100);
            bench.cut("closed");
            bench.pair.driver = driver(name, Config { part_width_mm: None, open_mm: 45.0, ..config(name) });
            bench.connect();
            bench.run(300);
            assert_eq!(bench.state().expect("there").jaws, Jaws::Open, "{name}");
            let home = bench.request(Request::Home);
            for _ in 0..2 {
                bench.release().expect("taken over");
                bench.run(2000);
                assert!(bench.plant.force_n == 0.0 && bench.state().is_ok(), "{name}: {:?}", bench.state());
                bench.request(Request::Leave).expect("linked");
                bench.run(100);
                bench.cut("closed");
                bench.connect(); // so that the second release is given, and closes nothing
                bench.run(300);
            }
            bench.request(Request::Home).expect("open jaws hold nothing");
            home.is_ok()
        })
        .collect();
    assert_eq!(accepting, [""; 0]);
}

#[test]
fn a_release_opens_wider_than_what_is_held_whatever_the_settings_say() {
    let weiss = [("wsg50", 104.0, 100.0), ("gcl", 104.0, 100.0), ("gcl", 106.004, 110.0), ("wsg50", 106.004, 110.0)];
    for (name, width_mm, open_mm) in NAMES.map(|name| (name, 66.0, 60.0)).into_iter().chain(weiss) {
        let mut bench = Bench::new(name, Config { part_width_mm: Some(width_mm), open_mm, ..config(name) }, "");
        bench.plant.width_mm = Some(width_mm);
        bench.run(200);
        bench.grip(40.0).expect("taken over");
        bench.until(5000, |state| state.jaws == Jaws::Holding);
        for _ in 0..60 {
            bench.release().expect("taken over"); // a controller repeats it with every frame
            bench.run(32);
        }
        let state = bench.state().expect("there");
        let opened_mm = state.opening_mm.expect("told") - width_mm;
        assert!(opened_mm > 3.5 && bench.plant.force_n == 0.0, "{name}, {width_mm} mm: {state:?}");
        bench.request(Request::Home).expect("open jaws hold nothing");
    }
    // How far the jaws of a line gripper go is known from the setting only.
    let mut bench = Bench::new("line", Config { open_mm: 50.0, ..config("line") }, "");
    bench.plant.width_mm = Some(46.0);
    bench.run(200);
    bench.grip(40.0).expect("taken over");
    bench.until(5000, |state| state.jaws == Jaws::Holding);
    bench.release().expect("taken over");
    bench.run(2000);
    assert_eq!(bench.state().expect("there").opening_mm, Some(50.0));
}
