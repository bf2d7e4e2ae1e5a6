//! After the first frame a monitor allocates nothing.

mod picture;

use assert_no_alloc::{AllocDisabler, assert_no_alloc, reset_violation_count, violation_count};
use picture::{Painter, Touch};
use slipbound::image::{ByteOrder, Frame, Gray, Pixels, Rgb, SizePx};
use slipbound::monitor::{Reason, RestBuilder, RestKind, Settings, SlipMonitor, SlipReport, SlipRule, SlipState};
use slipbound::plane::{Homography, Vec2};
use slipbound::port::GripSample;
use slipbound::sensor::{Flip, Rectification, Shear, Skin};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

const SIZE: SizePx = SizePx::new(320, 240);
const TOUCH: Touch = Touch { centre: Vec2::new(160.0, 120.0), radii_px: Vec2::new(90.0, 75.0), strength_levels: 32.0 };

/// Layout of the pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Layout {
    Rgb,
    Bgr,
    Gray,
    /// Red, green, blue, with a gap between rows.
    Padded,
}

const GAP_BYTES: usize = 7;

impl Layout {
    fn bytes(self, rgb: &[u8]) -> Vec<u8> {
        match self {
            Layout::Rgb => rgb.to_vec(),
            Layout::Bgr => rgb.chunks(3).flat_map(|p| [p[2], p[1], p[0]]).collect(),
            Layout::Gray => rgb.chunks(3).map(|p| p[1]).collect(),
            Layout::Padded => {
                rgb.chunks(3 * SIZE.width).flat_map(|row| row.iter().copied().chain([9; GAP_BYTES])).collect()
            }
        }
    }

    fn frame(self, bytes: &[u8], seq: u64, time_ns: Option<u64>) -> Frame<'_> {
        let pixels = match self {
            Layout::Rgb => Pixels::Rgb(Rgb::new(bytes, SIZE).expect("whole")),
            Layout::Bgr => Pixels::Rgb(Rgb::new(bytes, SIZE).expect("whole").in_order(ByteOrder::Bgr)),
            Layout::Gray => Pixels::Gray(Gray::new(bytes, SIZE).expect("whole")),
            Layout::Padded => Pixels::Rgb(Rgb::with_stride(bytes, SIZE, 3 * SIZE.width + GAP_BYTES).expect("whole")),
        };
        Frame { pixels, seq, time_ns }
    }
}

/// A finger, and how its frames are given.
struct Case {
    skin: Skin,
    settings: Settings,
    layout: Layout,
    rectified: bool,
    grip_n: Option<f64>,
    rate_hz: Option<u64>,
}

impl Case {
    /// The reports of no contact, a press, a drag, an imprint that moves, a release, lost markers, a second press, a dark
    /// frame, a gap, a frame of another size, a torn one.
    fn reports(&self) -> Vec<SlipReport> {
        let mut painter = Painter::new(SIZE, 16.0, 5.5, self.skin, 0.5, 4);
        painter.sensor.pitch_mm = Some(1.5);
        painter.sensor.shear = Some(Shear { stiffness_n_per_pitch: 0.2, provenance: "assumed".into() });
        if self.rectified {
            let homography = Homography([[0.98, 0.03, -3.0], [-0.02, 1.01, 4.0], [1e-5, 2e-5, 1.0]]);
            let crop_px = [4, 3, SIZE.width - 4, SIZE.height - 3];
            painter.sensor.rectification = Some(Rectification { homography, crop_px, distortion: None });
            painter.sensor.flip = Flip::Horizontal;
        }
        let paint = |now: &[Vec2], touch: Option<Touch>, seed: u64| {
            self.layout.bytes(&painter.paint(now, touch.as_ref(), seed))
        };
        let mut pictures: Vec<Vec<u8>> = (0..60u32)
            .map(|i| {
                let touched = (2..44).contains(&i) || i >= 50;
                let shift = Vec2::new(1.6 * f64::from(i.clamp(14, 26) - 14), 0.0);
                let moved = |&p: &Vec2| if touched && TOUCH.depth(p) < 0.7 { p + shift } else { p };
                let now: Vec<Vec2> = painter.rest.iter().map(moved).collect();
                let gone = if i == 20 || i == 48 { &now[..now.len() / 3] } else { &now[..] };
                let slid = Vec2::new(3.0 * f64::from(i.clamp(26, 44) - 26), 0.0);
                let touch = Touch { centre: TOUCH.centre + slid, ..TOUCH };
                paint(gone, touched.then_some(touch), u64::from(i))
            })
            .collect();
        pictures.push(vec![0; pictures[0].len()]);
        let last = pictures[59].clone();
        pictures.push(last);
        let frame = |i: usize, seq: u64| {
            let late_ns = if i == 61 { 900_000_000 } else { 0 };
            self.layout.frame(&pictures[i], seq, self.rate_hz.map(|hz| late_ns + seq * 1_000_000_000 / hz))
        };
        let mut builder = RestBuilder::new(&painter.sensor, &self.settings, SIZE).expect("valid");
        builder.add(&frame(0, 0)).expect("bright");
        let rest = builder.build(RestKind::Unloaded).expect("markers");
        let mut monitor = SlipMonitor::new(&painter.sensor, &self.settings, rest).expect("valid");
        monitor.step(&frame(0, 0), None);
        let (grip, mut reports) = (self.grip_n.map(|force_n| GripSample { force_n }), Vec::with_capacity(80));
        let small = [100; 3];
        reset_violation_count();
        for i in 0..pictures.len() {
            let frame = frame(i, if i == 61 { 90 } else { i as u64 });
            reports.push(assert_no_alloc(|| monitor.step(&frame, grip)));
        }
        let small = Pixels::Rgb(Rgb::new(&small, SizePx::new(1, 1)).expect("whole"));
        let small = Frame { pixels: small, seq: 91, time_ns: None };
        reports.push(assert_no_alloc(|| monitor.step(&small, grip)));
        reports.push(assert_no_alloc(|| monitor.torn(99, None)));
        assert_no_alloc(|| monitor.rebase(99));
        assert_eq!(violation_count(), 0, "the frames before allocated");
        reports
    }
}

#[test]
fn frames_are_judged_without_an_allocation() {
    let default = Settings::default;
    let by_markers = || Settings::default().with(|s| s.slip.rule = SlipRule::Markers);
    use Layout::{Bgr, Gray as GrayLayout, Padded, Rgb as RgbLayout};
    let mut frictions = 0;
    // At 90 Hz some frames are searched, others tracked.
    for (skin, settings, layout, rectified, grip_n, rate_hz) in [
        (Skin::Smooth, default(), RgbLayout, false, Some(5.0), Some(90)),
        (Skin::Smooth, default(), Bgr, true, None, Some(90)),
        (Skin::Smooth, default(), GrayLayout, false, Some(f64::NAN), Some(30)),
        (Skin::Smooth, by_markers(), Padded, true, Some(5.0), None),
        (Skin::Fabric, default(), Padded, false, Some(5.0), Some(90)),
        (Skin::Fabric, default(), GrayLayout, true, None, None),
        (Skin::Fabric, Settings::paper(), Bgr, true, Some(5.0), Some(90)),
    ] {
        let case = Case { skin, settings, layout, rectified, grip_n, rate_hz };
        let name = format!("{skin:?} {layout:?}, rectified {rectified}, grip {grip_n:?}, rate {rate_hz:?}");
        let reports = case.reports();
        let of = |state: SlipState| reports.iter().filter(|report| report.state == state).count();
        for state in [SlipState::NoContact, SlipState::Stick, SlipState::Unjudged] {
            assert!(of(state) > 0, "{name}: no frame was {state:?}");
        }
        let knows_grip = grip_n.is_some_and(f64::is_finite);
        assert!(of(SlipState::Incipient) > 0 || !knows_grip, "{name}: no incipient slip");
        assert!(reports[44..50].iter().any(|report| report.state == SlipState::NoContact), "{name}: never released");
        assert!(reports[50..60].iter().any(|report| report.contact.area_px2 > 0.0), "{name}: no second contact");
        for is_reason in [
            |reason| matches!(reason, Reason::MarkersLost),
            |reason| matches!(reason, Reason::Dark { .. }),
            |reason| matches!(reason, Reason::FrameSize { .. }),
            |reason| matches!(reason, Reason::Torn),
        ] {
            assert!(reports.iter().filter_map(|report| report.reason).any(is_reason), "{name}: {reports:?}");
        }
        let margins = reports.iter().filter(|report| report.estimates.margin.is_some()).count();
        assert!(margins > 5, "{name}: {margins} frames had a margin");
        frictions += reports.iter().filter(|report| report.estimates.friction.is_some()).count();
    }
    assert!(frictions > 20, "{frictions} frames had a friction");
}

/// An object that is held from the first frame on, and slides.
#[test]
fn gross_slip_is_judged_without_an_allocation() {
    let mut painter = Painter::new(SIZE, 20.0, 7.0, Skin::Smooth, 0.0, 3);
    painter.contrast_levels = 22.0;
    let touch = Touch { radii_px: Vec2::new(60.5, 49.5), strength_levels: 5.0, ..TOUCH };
    let pictures: Vec<Vec<u8>> = (0..24)
        .map(|seq| {
            // It drags the gel along by half; then the gel springs back.
            let at = f64::from(seq - 5).max(0.0);
            let gel_px = at.min(6.0) - 0.8 * (at - 6.0).clamp(0.0, 6.0);
            let near = |p: Vec2| libm::exp(-(p - TOUCH.centre).length_squared() / 3600.0);
            let places: Vec<Vec2> = painter.rest.iter().map(|&p| p + Vec2::new(gel_px, 0.0) * near(p)).collect();
            let object = Touch { centre: TOUCH.centre + Vec2::new(2.0 * at, 0.0), ..touch };
            painter.paint(&places, Some(&object), seq as u64)
        })
        .collect();
    let mut builder = RestBuilder::new(&painter.sensor, &Settings::default(), SIZE).expect("valid");
    for seed in 0..4 {
        let rgb = painter.paint(&painter.rest, Some(&touch), 900 + seed);
        builder.add(&Layout::Rgb.frame(&rgb, seed, None)).expect("bright");
    }
    let rest = builder.build(RestKind::InContact).expect("markers");
    let mut monitor = SlipMonitor::new(&painter.sensor, &Settings::default(), rest).expect("valid");
    let mut gross = 0;
    reset_violation_count();
    for (seq, rgb) in pictures.iter().enumerate() {
        let frame = Layout::Rgb.frame(rgb, seq as u64, None);
        gross += u32::from(assert_no_alloc(|| monitor.step(&frame, None)).state == SlipState::Gross);
    }
    assert_eq!(violation_count(), 0, "the frames before allocated");
    assert!(gross > 5, "{gross} frames were gross slip");
}

#[test]
fn an_allocation_would_be_seen() {
    reset_violation_count();
    assert_no_alloc(|| drop(std::hint::black_box(vec![1u8; 64])));
    assert!(violation_count() > 0);
}
