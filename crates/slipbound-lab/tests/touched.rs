//! When a finger is touched: a start in contact that ends, and light that changes.

use slipbound::image::{Frame, Pixels, Rgb};
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor, SlipState};
use slipbound::port::{FrameBuffer, FrameSource, Next};
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;

/// Of each frame whether an object touches in truth, and the state.
type Seen = Vec<(bool, SlipState)>;

/// From frame `from` on. The first `rest_count` frames give the rest frame, of this kind. The light grows by
/// `light_per_frame` of what it is at first.
fn states(scene: &str, light_per_frame: f64, from: u64, rest_count: u64, kind: RestKind) -> Seen {
    watch(scene, light_per_frame, from, rest_count, kind).0
}

/// The same, with the monitor after the last frame.
fn watch(scene: &str, light_per_frame: f64, from: u64, rest_count: u64, kind: RestKind) -> (Seen, SlipMonitor) {
    let trial = Trial::parse(&format!("{scene}&grid=fast")).expect("a trial");
    let mut world = World::new(&trial).expect("a sound trial");
    let (sensor, mut buffer) = (world.sensor(), FrameBuffer::default());
    let mut rest = Some(RestBuilder::new(&sensor, &Settings::default(), sensor.image_px).expect("valid"));
    let (mut monitor, mut states) = (None, Vec::new());
    while world.next(&mut buffer).expect("a frame") == Next::Frame {
        let light = 1.0 + light_per_frame * buffer.seq as f64;
        buffer.pixels.iter_mut().for_each(|level| *level = (f64::from(*level) * light).round().min(255.0) as u8);
        let frame: Frame<'_> = buffer.frame().expect("whole");
        if frame.seq < from {
            continue;
        }
        if let Some(rest) = rest.as_mut().filter(|_| frame.seq < from + rest_count) {
            rest.add(&frame).expect("bright");
            continue;
        }
        let monitor = monitor.get_or_insert_with(|| {
            let rest = rest.take().expect("once").build(kind).expect("markers");
            SlipMonitor::new(&sensor, &Settings::default(), rest).expect("valid")
        });
        // A white frame in a contact since the rest frame changes nothing.
        if kind == RestKind::InContact && states.len() == 5 {
            let white = vec![255; 3 * sensor.image_px.area()];
            let white = Frame { pixels: Pixels::Rgb(Rgb::new(&white, sensor.image_px).expect("its size")), ..frame };
            assert_eq!(monitor.step(&white, None).state, SlipState::Unjudged);
        }
        states.push((world.truth().grip_force_n > 0.0, monitor.step(&frame, None).state));
    }
    (states, monitor.expect("more frames than those at rest"))
}

/// The largest region, px2, and the last state, when the scene is shown to a monitor from its first frame on.
fn show_again(monitor: &mut SlipMonitor, scene: &str) -> (f64, SlipState) {
    let trial = Trial::parse(&format!("{scene}&grid=fast")).expect("a trial");
    let (mut world, mut buffer) = (World::new(&trial).expect("a sound trial"), FrameBuffer::default());
    let mut seen = (0.0f64, SlipState::Unjudged);
    while world.next(&mut buffer).expect("a frame") == Next::Frame {
        let frame = Frame { time_ns: None, ..buffer.frame().expect("whole") };
        let report = monitor.step(&frame, None);
        seen = (seen.0.max(report.contact.area_px2), report.state);
    }
    seen
}

#[test]
fn a_weave_that_was_pressed_in_the_first_frame_is_free_once_it_is_let_go() {
    for object in ["toy_duck", "screwdriver"] {
        let scene = format!("press_release?object={object}&hold_s=0.6&seed=3");
        let (seen, mut monitor) = watch(&scene, 0.0, 28, 3, RestKind::InContact);
        let held = seen.iter().take_while(|(touches, _)| *touches).count();
        assert!(held > 15 && seen.len() > held + 5, "{object}: {held} of {} frames held", seen.len());
        assert!(seen[..held - 3].iter().all(|(_, state)| *state == SlipState::Stick), "{object}: {seen:?}");
        assert!(seen[held + 3..].iter().all(|(_, state)| *state == SlipState::NoContact), "{object}: {seen:?}");
        // Gripped again, it is seen as by a finger that was free at first.
        let (_, mut free) = watch(&scene, 0.0, 0, 10, RestKind::Unloaded);
        let [again, expected] = [&mut monitor, &mut free].map(|monitor| show_again(monitor, &scene));
        assert!((again.0 / expected.0 - 1.0).abs() < 0.1, "{object}: {again:?}, expected {expected:?}");
        assert_eq!((again.1, expected.1), (SlipState::NoContact, SlipState::NoContact), "{object}");
    }
}

/// The light grows by a sixth before anything touches.
#[test]
fn light_that_grows_does_not_press_the_weave() {
    let scene = "press_release?object=bottle_cap&rest_frames=60&hold_s=0.3&seed=3";
    let seen = states(scene, 0.003, 0, 10, RestKind::Unloaded);
    let free = seen.iter().take_while(|(touches, _)| !touches).count();
    assert!(free > 45, "{free} frames untouched");
    assert!(seen[..free].iter().all(|(_, state)| *state == SlipState::NoContact), "{seen:?}");
    assert!(seen[free..].iter().any(|(_, state)| *state == SlipState::Stick), "{seen:?}");
}
