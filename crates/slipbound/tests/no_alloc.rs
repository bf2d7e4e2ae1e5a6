//! After the first frame a monitor allocates nothing.

mod picture;

use assert_no_alloc::{AllocDisabler, assert_no_alloc, reset_violation_count, violation_count};
use picture::{Painter, Touch, frame};
use slipbound::image::{Frame, SizePx};
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor, SlipRule, SlipState};
use slipbound::plane::Vec2;
use slipbound::port::GripSample;
use slipbound::sensor::{Shear, Skin};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

#[test]
fn frames_are_judged_without_an_allocation() {
    let size = SizePx::new(320, 240);
    let by_markers = Settings::default().with(|s| s.slip.rule = SlipRule::Markers);
    let mut frictions = 0;
    for (skin, settings) in [
        (Skin::Smooth, Settings::default()),
        (Skin::Fabric, Settings::default()),
        (Skin::Smooth, by_markers),
        (Skin::Fabric, Settings::paper()),
    ] {
        let mut painter = Painter::new(size, 16.0, 5.5, skin, 0.5, 4);
        painter.sensor.pitch_mm = Some(1.5);
        painter.sensor.shear = Some(Shear { stiffness_n_per_pitch: 0.2, provenance: "assumed".into() });
        let mut builder = RestBuilder::new(&painter.sensor, &settings, size).expect("valid");
        builder.add(&frame(&painter.paint(&painter.rest, None, 0), size, 0)).expect("bright");
        let rest = builder.build(RestKind::Unloaded).expect("markers");
        let mut monitor = SlipMonitor::new(&painter.sensor, &settings, rest).expect("valid");
        // No contact, a press, a shift of the middle past the threshold, markers lost in noise, a torn frame.
        let centre = Vec2::new(160.0, 120.0);
        let touch = Touch { centre, radii_px: Vec2::new(90.0, 75.0), strength_levels: 32.0 };
        let pictures: Vec<Vec<u8>> = (0..44)
            .map(|i| {
                let shift = Vec2::new(1.6 * f64::from(i.max(14) - 14), 0.0);
                let moved = |&p: &Vec2| if touch.depth(p) < 0.7 { p + shift } else { p };
                let now: Vec<Vec2> = painter.rest.iter().map(moved).collect();
                let gone = if i == 20 { &now[..now.len() / 3] } else { &now[..] };
                painter.paint(gone, (i > 1).then_some(&touch), i as u64)
            })
            .collect();
        monitor.step(&frame(&pictures[0], size, 0), None);
        reset_violation_count();
        let (mut states, mut margins) = (Vec::with_capacity(pictures.len()), 0);
        for (seq, rgb) in pictures.iter().enumerate() {
            // A fast camera: some frames are searched, others tracked.
            let frame = Frame { time_ns: Some(seq as u64 * 1_000_000_000 / 90), ..frame(rgb, size, seq as u64) };
            let report = assert_no_alloc(|| monitor.step(&frame, Some(GripSample { force_n: 5.0 })));
            states.push(report.state);
            margins += u32::from(report.estimates.margin.is_some());
            frictions += u32::from(report.estimates.friction.is_some());
        }
        states.push(assert_no_alloc(|| monitor.torn(99, None)).state);
        assert_eq!(violation_count(), 0, "{skin:?}: the frames before allocated");
        assert!(margins > 5, "{skin:?}: {margins} frames had a margin");
        for state in [SlipState::NoContact, SlipState::Stick, SlipState::Incipient, SlipState::Unjudged] {
            assert!(states.contains(&state), "{skin:?}: no frame was {state:?}: {states:?}");
        }
    }
    assert!(frictions > 20, "{frictions} frames had a friction");
}

#[test]
fn an_allocation_would_be_seen() {
    reset_violation_count();
    assert_no_alloc(|| drop(std::hint::black_box(vec![1u8; 64])));
    assert!(violation_count() > 0);
}
