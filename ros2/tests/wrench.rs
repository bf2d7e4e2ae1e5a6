//! Signs and size of the wrench against the simulated force of the object on the gel.

use slipbound::finger_pipeline::RestFinder;
use slipbound::monitor::{Settings, SlipMonitor, SlipReport};
use slipbound::port::{FrameBuffer, FrameSource as _, GripSample, Next};
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use slipbound_ros2::msg::{self, Header, Time, WrenchStamped};
use slipbound_ros2::wrench::wrench;

const AT: Time = Time { sec: 1, nanosec: 2 };

/// The last wrench of a scene that ends in contact, the load of the object (force N, torque N mm), and the report.
fn last(scene: &str) -> (WrenchStamped, [f64; 2], f64, SlipReport) {
    let settings = Settings::default();
    let mut world = World::new(&Trial::parse(scene).expect("a scene")).expect("a world");
    let sensor = world.sensor();
    let mut frame = FrameBuffer::default();
    let (mut finder, mut monitor): (Option<RestFinder>, Option<SlipMonitor>) = (None, None);
    let mut last = None;
    while world.next(&mut frame).expect("simulates") == Next::Frame {
        slipbound_rig::source::decode_image(&mut frame).expect("whole");
        if let Some(monitor) = &mut monitor {
            let truth = world.truth();
            let report =
                monitor.step(&frame.frame().expect("a frame"), Some(GripSample { force_n: truth.grip_force_n }));
            let load = truth.wrench;
            last = wrench(AT, "left_gel", &report)
                .map(|w| (w, [load.force_n.x, load.force_n.y], load.torque_n_mm, report));
            continue;
        }
        let looking = finder.get_or_insert_with(|| RestFinder::new(&sensor, &settings, frame.size).expect("fits"));
        looking.see(&frame).expect("seen");
        if looking.is_full() {
            let rest = finder.take().expect("there").find().expect("at rest").rest;
            monitor = Some(SlipMonitor::new(&sensor, &settings, rest).expect("a monitor"));
        }
    }
    last.expect("a wrench in the last frame")
}

#[test]
fn the_force_is_that_of_the_object_on_the_gel() {
    for direction_deg in [0, 90, 210] {
        let scene = format!("shear?distance_mm=1.5&direction_deg={direction_deg}&grid=fast&rest_frames=24");
        let (got, [x, y], _, report) = last(&scene);
        assert_eq!((got.header.frame_id.as_str(), got.header.stamp.nanosec), ("left_gel", 2));
        let force = got.wrench.force;
        let off = f64::hypot(force.x - x, force.y - y) / f64::hypot(x, y);
        assert!(off < 0.25, "towards {direction_deg} degrees: {force:?}, expected ({x:.2}, {y:.2})");
        assert!(force.z > 0.0, "pressed into the gel: {force:?}");
        for grip_n in [Some(0.0), Some(-0.1), None] {
            let unknown = SlipReport { grip_n, ..report };
            let force = wrench(AT, "left_gel", &unknown).expect("shear is known").wrench.force;
            assert!(force.z.is_nan(), "at {grip_n:?} N: {force:?}");
            assert!(msg::SlipReport::of(Header::default(), "left", 0, &unknown).grip_n.is_nan());
        }
    }
}

#[test]
fn the_torque_is_positive_from_x_to_y() {
    for angle_deg in [6, -6] {
        let (got, _, torque_nmm, _) = last(&format!("twist?angle_deg={angle_deg}&grid=fast&rest_frames=24"));
        let torque = got.wrench.torque;
        assert!(torque_nmm.signum() == f64::from(angle_deg).signum());
        let off = (torque.z * 1e3 / torque_nmm - 1.0).abs();
        assert!(off < 0.4, "{angle_deg} degrees: {torque:?}, expected {torque_nmm:.1} N mm about z");
        assert_eq!((torque.x, torque.y), (0.0, 0.0));
    }
}
