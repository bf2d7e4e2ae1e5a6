//! A sensor file that does not match the image is not used for judging, and spots that are no markers are not tracked.

use slipbound::image::{Frame, Gray, Pixels, SizePx};
use slipbound::monitor::{Reason, RestBuilder, RestError, RestKind, Settings, SlipMonitor, SlipState};
use slipbound::plane::{Homography, Vec2};
use slipbound::sensor::{Flip, Polarity, Rectification, Sensor, Skin};

const SIZE: SizePx = SizePx::new(427, 320);
const PITCH_PX: f64 = 15.2;
const COLUMNS: usize = 20;
const ROWS: usize = 20;

/// A camera that looks at the gel from the side, as in the paper, and delivers its image upside down.
fn sensor(flip: Flip) -> Sensor {
    let homography = Homography([[0.798, -0.338, 41.2], [0.0367, 0.8436, -24.59], [-1.0276e-4, -1.43882e-3, 1.0]]);
    Sensor {
        name: "tilted".into(),
        description: String::new(),
        serial: None,
        image_px: SIZE,
        flip,
        grey_weights_rgb: [1.0 / 3.0; 3],
        polarity: Polarity::Dark,
        pitch_px: PITCH_PX,
        pitch_mm: None,
        gel_mm: None,
        marker_diameter_px: 5.4,
        skin: Skin::Smooth,
        bare_sharpness: None,
        edge_bands: vec![],
        rectification: Some(Rectification { homography, crop_px: [50, 0, 377, 320], distortion: None }),
        defects_px: vec![],
        shear: None,
    }
}

/// Where the markers are in the rectified image.
fn nodes() -> Vec<Vec2> {
    let node = |i: usize| Vec2::new((i % COLUMNS) as f64, (i / COLUMNS) as f64);
    (0..COLUMNS * ROWS).map(|i| node(i) * PITCH_PX + Vec2::new(14.0, 13.0)).collect()
}

/// The camera image of a finger with this flip, with dots at these places of its rectified image.
fn picture(flip: Flip, dots: &[Vec2]) -> Vec<u8> {
    let sensor = sensor(flip);
    let mut grey = vec![150.0f64; SIZE.area()];
    for dot in dots {
        let at = sensor.camera_from_rectified(*dot);
        let side = |by: Vec2| (sensor.camera_from_rectified(*dot + by) - at).length();
        let radius_px = 2.7 * (side(Vec2::new(1.0, 0.0)) * side(Vec2::new(0.0, 1.0))).sqrt();
        let (x, y) = (at.x.round() as isize, at.y.round() as isize);
        for (dx, dy) in (-9..=9).flat_map(|dy| (-9..=9).map(move |dx| (dx, dy))) {
            let (px, py) = (x + dx, y + dy);
            if (0..SIZE.width as isize).contains(&px) && (0..SIZE.height as isize).contains(&py) {
                let beyond_px = (Vec2::new(px as f64, py as f64) - at).length() - radius_px;
                let pixel = &mut grey[py as usize * SIZE.width + px as usize];
                *pixel = pixel.min(150.0 - 90.0 / (1.0 + (beyond_px / 0.5).exp()));
            }
        }
    }
    grey.iter().map(|v| v.round() as u8).collect()
}

fn frame(grey: &[u8], seq: u64) -> Frame<'_> {
    Frame { pixels: Pixels::Gray(Gray::new(grey, SIZE).expect("whole")), seq, time_ns: None }
}

fn monitor(sensor: &Sensor, settings: &Settings, at_rest: &[u8]) -> SlipMonitor {
    let mut builder = RestBuilder::new(sensor, settings, SIZE).expect("a sensor");
    builder.add(&frame(at_rest, 0)).expect("a frame");
    SlipMonitor::new(sensor, settings, builder.build(RestKind::Unloaded).expect("markers")).expect("a monitor")
}

#[test]
fn a_wrong_flip_is_not_judged_and_the_right_one_is_named() {
    for truth in Flip::ALL {
        let grey = picture(truth, &nodes());
        let right = monitor(&sensor(truth), &Settings::default(), &grey).step(&frame(&grey, 1), None);
        assert_eq!((right.state, right.reason), (SlipState::NoContact, None), "{truth}");
        // Top and bottom are seen from different distances: this flip can be detected from the spacing.
        let wrong = match truth {
            Flip::None => Flip::Vertical,
            Flip::Vertical => Flip::None,
            Flip::Horizontal => Flip::Both,
            Flip::Both => Flip::Horizontal,
        };
        let mut judged = monitor(&sensor(wrong), &Settings::default(), &grey);
        let report = judged.step(&frame(&grey, 1), None);
        assert_eq!(report.state, SlipState::Unjudged, "{truth} taken for {wrong}");
        let Some(Reason::MarkerSpacing { expected_px, got_px, fitting: Some((flip, px)) }) = report.reason else {
            panic!("{truth} taken for {wrong}: {:?}", report.reason);
        };
        assert_eq!((expected_px, flip), (PITCH_PX, truth), "{got_px}");
        assert!((px - PITCH_PX).abs() < 0.3, "{px}");
        let said = report.reason.expect("there").to_string();
        assert!(
            said.contains("markers expected on a grid of 15.2 px")
                && said.contains(&format!("with flip = \"{truth}\" they stand 15.")),
            "{said}"
        );
        assert_eq!(judged.refusal(), report.reason);
        let mut told = Settings::default();
        told.rest.check_spacing = false;
        let report = monitor(&sensor(wrong), &told, &grey).step(&frame(&grey, 1), None);
        assert_eq!((report.state, report.reason), (SlipState::NoContact, None), "the user knows better");
    }
}

#[test]
fn another_finger_is_not_judged_either() {
    let dots: Vec<Vec2> = nodes().iter().map(|p| *p * 1.4).collect();
    let grey = picture(Flip::None, &dots);
    let report = monitor(&sensor(Flip::None), &Settings::default(), &grey).step(&frame(&grey, 1), None);
    assert_eq!(report.state, SlipState::Unjudged);
    assert!(matches!(report.reason, Some(Reason::MarkerSpacing { fitting: None, .. })), "{:?}", report.reason);
}

/// A chain of highlights between the markers, like the reflection of a lamp.
fn highlights() -> Vec<Vec2> {
    (0..30).map(|i| Vec2::new(12.0 + 10.3 * f64::from(i), 172.6)).collect()
}

#[test]
fn glare_is_not_tracked_and_does_not_count_as_detected() {
    let sensor = sensor(Flip::Vertical);
    let clean = monitor(&sensor, &Settings::default(), &picture(Flip::Vertical, &nodes()));
    let markers_count = clean.markers().len();
    assert!(markers_count > 380, "{markers_count}");
    // Highlights midway between two rows.
    let with_glare: Vec<Vec2> = nodes().into_iter().chain(highlights()).collect();
    let grey = picture(Flip::Vertical, &with_glare);
    let mut judged = monitor(&sensor, &Settings::default(), &grey);
    assert_eq!(judged.markers().len(), markers_count, "markers at rest");
    let report = judged.step(&frame(&grey, 1), None);
    assert_eq!((report.markers.detected, report.markers.lost), (markers_count as u32, 0));
}

#[test]
fn dots_without_order_are_all_tracked() {
    // Painted by hand: each up to 0.45 pitch from its node, in both directions.
    let mut state = 7u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 16) / 65536.0 - 0.5
    };
    let dots: Vec<Vec2> = (0..100)
        .map(|i| Vec2::new(f64::from(i % 10), f64::from(i / 10)) * 30.0 + Vec2::new(20.0, 20.0))
        .map(|p| p + Vec2::new(next(), next()) * 14.0)
        .collect();
    let sensor = Sensor { pitch_px: 28.0, ..sensor(Flip::None) };
    let judged = monitor(&sensor, &Settings::default(), &picture(Flip::None, &dots));
    assert!((95..=100).contains(&judged.markers().len()), "{}", judged.markers().len());
    assert_eq!(judged.refusal(), None);
}

#[test]
fn as_many_markers_as_are_needed_are_enough() {
    let (sensor, grey) = (sensor(Flip::None), picture(Flip::None, &nodes()));
    let built = |least_count: u32| {
        let settings = Settings::default().with(|s| s.rest.markers_min_count = least_count);
        let mut builder = RestBuilder::new(&sensor, &settings, SIZE).expect("a sensor");
        builder.add(&frame(&grey, 0)).expect("a frame");
        builder.build(RestKind::Unloaded).map(|rest| rest.markers_count())
    };
    let got_count = built(9).expect("markers");
    let needed = got_count as u32;
    assert_eq!(built(needed), Ok(got_count));
    assert_eq!(built(needed + 1), Err(RestError::FewMarkers { expected_count: needed + 1, got_count }));
}
