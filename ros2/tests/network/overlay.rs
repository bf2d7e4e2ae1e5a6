//! Overlay images on their topic.

use crate::node::{Bench, REST_COUNT, Shot, show, simulated};
use crate::process::{LONGEST_WAIT, next};
use slipbound::port::FrameBuffer;
use slipbound_rig::source::decode_image;
use slipbound_ros2::msg::CompressedImage;
use slipbound_ros2::ros::{Inbox, SENSOR_DATA};
use std::time::{Duration, Instant};

/// Share of the pixels of an overlay that are as bright as a finger.
fn bright_fraction(overlay: &CompressedImage) -> f64 {
    let mut frame = FrameBuffer { encoded: overlay.data.clone(), ..FrameBuffer::default() };
    decode_image(&mut frame).expect("whole");
    frame.pixels.iter().filter(|level| **level > 60).count() as f64 / frame.pixels.len() as f64
}

#[test]
fn the_overlay_of_a_torn_image_does_not_show_the_one_before() {
    /// Earlier than every image that is whole, so that its overlay is known by its stamp.
    const TORN_NS: u64 = 1_600_000_000_000_000_000;
    let mut bench = Bench::new(6, "overlay = true");
    let mut overlays: Inbox<CompressedImage> =
        bench.ros.inbox("/slipbound/left/overlay/compressed", &SENSOR_DATA).expect("an inbox");
    let _node = bench.node();
    bench.await_node();
    let mut at_rest = simulated().1.iter().take(REST_COUNT).cycle();
    let until = Instant::now() + LONGEST_WAIT;
    let whole = loop {
        assert!(Instant::now() < until, "no overlay");
        show(&bench, at_rest.next().expect("a cycle"));
        if let Some(overlay) = next(&mut overlays, Duration::ZERO) {
            break overlay;
        }
    };
    assert!(bright_fraction(&whole) > 0.5, "the image is in it: {}", bright_fraction(&whole));
    let until = Instant::now() + LONGEST_WAIT;
    let torn = loop {
        assert!(Instant::now() < until, "no overlay of a torn image");
        bench.send(&Shot { jpeg: Vec::new(), time_ns: TORN_NS });
        let overlay = next(&mut overlays, Duration::from_millis(100));
        if let Some(overlay) = overlay.filter(|overlay| overlay.header.stamp.ns() == Some(TORN_NS)) {
            break overlay;
        }
    };
    assert!(bright_fraction(&torn) < 0.2, "no image is in it: {}", bright_fraction(&torn));
}
