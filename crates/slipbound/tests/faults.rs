//! Frames that no camera should deliver: the monitor must neither panic nor lose its markers.

mod picture;

use picture::{Painter, Random, Touch, frame};
use slipbound::image::{Frame, Gray, Pixels, SizePx};
use slipbound::monitor::{Probe, Reason, RestBuilder, RestKind, Settings, SlipMonitor, SlipReport, SlipState, Step};
use slipbound::plane::Vec2;
use slipbound::sensor::{Polarity, Sensor, Skin};

const SIZE: SizePx = SizePx::new(320, 240);

fn monitor(painter: &Painter, settings: &Settings) -> SlipMonitor {
    let mut builder = RestBuilder::new(&painter.sensor, settings, SIZE).expect("valid");
    builder.add(&frame(&painter.paint(&painter.rest, None, 0), SIZE, 0)).expect("bright");
    SlipMonitor::new(&painter.sensor, settings, builder.build(RestKind::Unloaded).expect("markers")).expect("valid")
}

/// Noise, flat grey, white, a checkerboard of dots, half a frame, a frame shifted by half the image.
fn nonsense(kind: u64, seed: u64, good: &[u8]) -> Vec<u8> {
    let mut random = Random::new(seed);
    let bytes = 3 * SIZE.area();
    match kind % 6 {
        0 => (0..bytes).map(|_| (random.even() * 256.0) as u8).collect(),
        1 => vec![128; bytes],
        2 => vec![255; bytes],
        3 => (0..bytes).map(|i| if (i / 3 % 320 / 5 + i / 960 / 5) % 2 == 0 { 20 } else { 235 }).collect(),
        4 => good.iter().enumerate().map(|(i, &v)| if i > bytes / 2 { 200 } else { v }).collect(),
        _ => good.iter().cycle().skip(bytes / 2 + 480).take(bytes).copied().collect(),
    }
}

#[test]
fn after_any_nonsense_every_marker_is_back_within_five_frames() {
    for (skin, settings) in
        [(Skin::Smooth, Settings::default()), (Skin::Fabric, Settings::default()), (Skin::Fabric, Settings::paper())]
    {
        let painter = Painter::new(SIZE, 18.0, 6.0, skin, 0.5, 21);
        let touch = Touch { centre: Vec2::new(160.0, 120.0), radii_px: Vec2::new(90.0, 75.0), strength_levels: 30.0 };
        let good = painter.paint(&painter.rest, Some(&touch), 2);
        let mut monitor = monitor(&painter, &settings);
        // A pressed weave may hide a marker by itself.
        let hidden = (0..4).map(|i| monitor.step(&frame(&good, SIZE, i), None).markers.lost).last().expect("frames");
        assert!(hidden <= 2, "{skin:?}: {hidden} markers hidden by the weave");
        for kind in 0..12 {
            for i in 0..3 {
                let rgb = nonsense(kind, 10 * kind + i, &good);
                let report = monitor.step(&frame(&rgb, SIZE, kind), None);
                assert!(report.contact.quality.is_finite() && report.slip.max_pitch.is_finite(), "{report:?}");
            }
            let reports: Vec<_> = (0..5).map(|i| monitor.step(&frame(&good, SIZE, 100 + i), None)).collect();
            let last = reports.last().expect("frames");
            assert!(last.markers.lost <= hidden, "{skin:?}, after nonsense {kind}: {last:?}");
            for m in monitor.markers().iter().filter(|m| m.matched) {
                let off = m.now_from_rest().length();
                assert!(off < 0.2 * 18.0, "{skin:?}, after nonsense {kind}: marker {} is {off} px off", m.id);
            }
        }
    }
}

/// A gel that is rotated by more than a pitch at its rim, then hidden for a while, and untouched when it is visible
/// again.
#[test]
fn markers_that_sprang_back_unseen_are_found_at_rest() {
    for skin in [Skin::Smooth, Skin::Fabric] {
        let painter = Painter::new(SIZE, 18.0, 6.0, skin, 0.5, 23);
        let mut monitor = monitor(&painter, &Settings::default());
        let middle = Vec2::new(160.0, 120.0);
        let touch = Touch { centre: middle, radii_px: Vec2::new(150.0, 110.0), strength_levels: 30.0 };
        let turned = |deg: f64| -> Vec<Vec2> {
            painter.rest.iter().map(|rest| middle + (*rest - middle).rotated(deg.to_radians())).collect()
        };
        for i in 0..=20u64 {
            let rgb = painter.paint(&turned(i as f64), Some(&touch), 3 + i);
            monitor.step(&frame(&rgb, SIZE, i), None);
        }
        let furthest = |monitor: &SlipMonitor| {
            let found = monitor.markers().iter().filter(|marker| marker.matched);
            found.map(|marker| marker.now_from_rest().length()).fold(0.0, f64::max)
        };
        assert!(furthest(&monitor) > 1.2 * 18.0, "{skin:?}: followed for {} px", furthest(&monitor));
        for i in 21..29u64 {
            let rgb = nonsense(0, i, &[]);
            monitor.step(&frame(&rgb, SIZE, i), None);
        }
        let rest = painter.paint(&painter.rest, Some(&touch), 40);
        let last = (29..34u64).map(|i| monitor.step(&frame(&rest, SIZE, i), None)).last().expect("frames");
        assert!(
            last.markers.lost <= 2 && furthest(&monitor) < 0.2 * 18.0,
            "{skin:?}: {} px, {last:?}",
            furthest(&monitor)
        );
    }
}

#[test]
fn a_picture_that_repeats_gives_the_same_report_whatever_the_search_remembers() {
    for skin in [Skin::Smooth, Skin::Fabric] {
        let painter = Painter::new(SIZE, 18.0, 6.0, skin, 0.5, 21);
        let touch = Touch { centre: Vec2::new(160.0, 120.0), radii_px: Vec2::new(90.0, 75.0), strength_levels: 30.0 };
        let pulled = |n: u64| -> Vec<Vec2> {
            let pull =
                |p: &Vec2| *p + Vec2::new(0.7 * n as f64, 0.0) * libm::exp(-(*p - touch.centre).length() / 120.0);
            painter.rest.iter().map(pull).collect()
        };
        let mut monitor = monitor(&painter, &Settings::default());
        for n in 1..8 {
            monitor.step(&frame(&painter.paint(&pulled(n), Some(&touch), n), SIZE, n), None);
        }
        let hung = painter.paint(&pulled(8), Some(&touch), 8);
        let reports: Vec<_> = (8..14).map(|n| monitor.step(&frame(&hung, SIZE, n), None)).collect();
        for pair in reports[2..].windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|r| (r.shear, r.contact, r.markers));
            assert!(a.0.is_some() && a == b, "{skin:?}: {a:?} {b:?}");
        }
    }
}

#[test]
fn what_cannot_be_judged_says_why() {
    let painter = Painter::new(SIZE, 18.0, 6.0, Skin::Smooth, 0.5, 21);
    let mut monitor = monitor(&painter, &Settings::default());
    let small = vec![100; 100];
    let got = SizePx::new(10, 10);
    let pixels = Pixels::Gray(Gray::new(&small, got).expect("whole"));
    let report = monitor.step(&Frame { pixels, seq: 4, time_ns: Some(7) }, None);
    assert_eq!((report.state, report.seq, report.time_ns), (SlipState::Unjudged, 4, Some(7)));
    assert_eq!(report.reason, Some(Reason::FrameSize { expected: SIZE, got }));
    let black = vec![3u8; 3 * SIZE.area()];
    let report = monitor.step(&frame(&black, SIZE, 5), None);
    assert_eq!(report.reason, Some(Reason::Dark { mean_levels: 3.0 }));
    let flat = vec![128u8; 3 * SIZE.area()];
    let report = monitor.step(&frame(&flat, SIZE, 6), None);
    assert_eq!((report.state, report.reason), (SlipState::Unjudged, Some(Reason::MarkersLost)));
    assert_eq!(monitor.torn(9, None).reason, Some(Reason::Torn));
}

/// A gel that is dragged by two thirds of the view: markers that have left the view are not lost, covered ones are.
#[test]
fn markers_that_left_the_view_are_not_lost_and_covered_ones_are() {
    let painter = Painter::new(SIZE, 18.0, 6.0, Skin::Smooth, 0.5, 22);
    let mut watching = monitor(&painter, &Settings::default());
    let moved = |by_px: f64| -> Vec<Vec2> { painter.rest.iter().map(|&p| p + Vec2::new(by_px, 0.0)).collect() };
    let mut report = None;
    for step in 0..=52u64 {
        let picture = painter.paint(&moved(4.0 * step as f64), None, step);
        let told = watching.step(&frame(&picture, SIZE, step), None);
        assert_ne!(told.state, SlipState::Unjudged, "moved by {} px: {:?}", 4 * step, told.markers);
        report = Some(told);
    }
    let all = painter.rest.len() as u32;
    let report = report.expect("frames");
    assert!(2 * report.markers.matched < all && 4 * report.markers.matched > all, "{:?}", report.markers);
    // Three of five of the remaining markers are covered.
    let mut covered = moved(208.0);
    covered.retain(|p| p.y < 95.0);
    let told = watching.step(&frame(&painter.paint(&covered, None, 60), SIZE, 53), None);
    assert_eq!((told.state, told.reason), (SlipState::Unjudged, Some(Reason::MarkersLost)), "{:?}", told.markers);
    // Moved further, less than a quarter of all markers remains.
    let mut watching = monitor(&painter, &Settings::default());
    let last = (0..=66u64).map(|step| {
        let picture = painter.paint(&moved(4.0 * step as f64), None, step);
        watching.step(&frame(&picture, SIZE, step), None)
    });
    let last = last.last().expect("frames");
    assert_eq!((last.state, last.reason), (SlipState::Unjudged, Some(Reason::MarkersLost)), "{:?}", last.markers);
}

#[test]
fn settings_that_cannot_be_are_refused_by_key() {
    let painter = Painter::new(SIZE, 18.0, 6.0, Skin::Smooth, 0.5, 21);
    let refused = |change: &dyn Fn(&mut Settings)| {
        let mut settings = Settings::default();
        change(&mut settings);
        RestBuilder::new(&painter.sensor, &settings, SIZE).expect_err("refused").to_string()
    };
    let negative = refused(&|s| s.slip.threshold_pitch = -0.3);
    assert_eq!(negative, "slip.threshold_pitch: expected a number from 0.001 to 10, got -0.3");
    assert!(refused(&|s| s.contact.change_levels = f64::NAN).starts_with("contact.change_levels"));
    assert!(refused(&|s| s.contact.off_area_fraction = 0.5).starts_with("contact.off_area_fraction"));
    assert!(refused(&|s| s.markers.match_within_pitch = 0.6).starts_with("markers.match_within_pitch"));
    let bright = Sensor { polarity: Polarity::Bright, ..painter.sensor.clone() };
    let finder = RestBuilder::new(&bright, &Settings::paper(), SIZE).expect_err("refused").to_string();
    assert!(finder.starts_with("markers.finder"), "{finder}");
    let shape = RestBuilder::new(&painter.sensor, &Settings::default(), SizePx::new(320, 320)).expect_err("refused");
    assert!(shape.to_string().starts_with("image_px: expected 320x240"), "{shape}");
}

/// The times between the steps are then those of the whole frame.
#[test]
fn every_frame_ends_with_the_verdict_also_one_that_cannot_be_judged() {
    struct Steps(Vec<Step>);
    impl Probe for Steps {
        fn after(&mut self, step: Step, _: &SlipMonitor) {
            self.0.push(step);
        }
    }
    let painter = Painter::new(SIZE, 18.0, 6.0, Skin::Smooth, 0.5, 21);
    let mut monitor = monitor(&painter, &Settings::default());
    let mut steps_of = |rgb: &[u8], seq| {
        let mut steps = Steps(Vec::new());
        let report = monitor.step_probed(&frame(rgb, SIZE, seq), None, &mut steps);
        (report.state, steps.0)
    };
    use Step::*;
    let (state, steps) = steps_of(&painter.paint(&painter.rest, None, 1), 1);
    assert_eq!(
        (state, steps),
        (SlipState::NoContact, vec![Imprint, Contact, Markers, Motion, Slip, Evidence, Verdict])
    );
    let (state, steps) = steps_of(&vec![0; 3 * SIZE.area()], 2);
    assert_eq!((state, steps), (SlipState::Unjudged, vec![Imprint, Verdict]));
    let (state, steps) = steps_of(&vec![255; 3 * SIZE.area()], 3);
    assert_eq!((state, steps), (SlipState::Unjudged, vec![Imprint, Contact, Markers, Verdict]));
}

/// A contact with a smooth finger that is held from the first frame on, and with fabric that is touched later; the gel
/// is sheared. White, and half covered, in frame 16.
#[test]
fn a_frame_that_shows_nothing_of_the_finger_changes_nothing_that_is_known_of_its_contact() {
    let touch = Touch { centre: Vec2::new(160.0, 120.0), radii_px: Vec2::new(90.0, 75.0), strength_levels: 30.0 };
    for (skin, kind) in [(Skin::Smooth, RestKind::InContact), (Skin::Fabric, RestKind::Unloaded)] {
        let painter = Painter::new(SIZE, 18.0, 6.0, skin, 0.5, 21);
        let reports_with = |spoil: &dyn Fn(&mut [u8])| -> Vec<SlipReport> {
            let paint = |seq: u64, touched: bool| {
                let shift = Vec2::new(0.2 * seq.saturating_sub(6) as f64, 0.0);
                let moved = |&p: &Vec2| if touched && touch.depth(p) < 1.0 { p + shift } else { p };
                painter.paint(&painter.rest.iter().map(moved).collect::<Vec<_>>(), touched.then_some(&touch), seq)
            };
            let held = kind == RestKind::InContact;
            let mut builder = RestBuilder::new(&painter.sensor, &Settings::default(), SIZE).expect("valid");
            builder.add(&frame(&paint(0, held), SIZE, 0)).expect("bright");
            let rest = builder.build(kind).expect("markers");
            let mut monitor = SlipMonitor::new(&painter.sensor, &Settings::default(), rest).expect("valid");
            (1..30)
                .map(|seq| {
                    let mut rgb = paint(seq, held || seq > 2);
                    if seq == 16 {
                        spoil(&mut rgb);
                    }
                    monitor.step(&frame(&rgb, SIZE, seq), None)
                })
                .collect()
        };
        let whole = reports_with(&|_| {});
        let white = reports_with(&|rgb| rgb.fill(255));
        let covered = reports_with(&|rgb| {
            let from = rgb.len() / 5;
            rgb[from..].fill(120);
        });
        // A part of the image that did not arrive.
        let cut = reports_with(&|rgb| {
            let from = rgb.len() * 3 / 5;
            rgb[from..].fill(128);
        });
        for spoilt in [white, covered, cut] {
            assert_eq!(spoilt[15].reason, Some(Reason::MarkersLost), "{skin:?}");
            assert_eq!(spoilt[15].markers.inner, 0, "{skin:?}: no motion was fitted");
            for (a, b) in whole.iter().zip(&spoilt).filter(|(_, b)| b.seq != 16) {
                assert_eq!((a.state, a.reference_seq), (b.state, b.reference_seq), "{skin:?}, frame {}", a.seq);
                let of = |r: &SlipReport| r.evidence.map(|e| (e.reference_seq, (50.0 * e.slide_score).round()));
                assert_eq!(of(a), of(b), "{skin:?}, frame {}", a.seq);
            }
        }
    }
}

/// The reports of 29 frames: as they are, and with one that shows nothing of the finger or four fifths less of it.
fn whole_and_spoilt(
    painter: &Painter,
    kind: RestKind,
    spoilt_seq: u64,
    paint: impl Fn(u64) -> Vec<u8>,
) -> [Vec<SlipReport>; 3] {
    [None, Some((0, 255)), Some((5, 120))].map(|spoilt: Option<(usize, u8)>| {
        let mut builder = RestBuilder::new(&painter.sensor, &Settings::default(), SIZE).expect("valid");
        builder.add(&frame(&paint(0), SIZE, 0)).expect("bright");
        let rest = builder.build(kind).expect("markers");
        let mut monitor = SlipMonitor::new(&painter.sensor, &Settings::default(), rest).expect("valid");
        (1..30)
            .map(|seq| {
                let (mut rgb, spoilt) = (paint(seq), spoilt.filter(|_| seq == spoilt_seq));
                if let Some((whole_parts, level)) = spoilt {
                    let from = rgb.len().checked_div(whole_parts).unwrap_or(0);
                    rgb[from..].fill(level);
                }
                let report = monitor.step(&frame(&rgb, SIZE, seq), None);
                assert_eq!(report.reason == Some(Reason::MarkersLost), spoilt.is_some(), "{report:?}");
                report
            })
            .collect()
    })
}

/// A flat face over the whole pad: the image shows no contact, only the markers do. What is covered looks like an imprint.
#[test]
fn a_frame_that_shows_nothing_of_the_finger_does_not_end_a_contact_that_only_displacement_shows() {
    let painter = Painter::new(SIZE, 18.0, 6.0, Skin::Smooth, 0.5, 21);
    let dragged = |seq: u64| {
        let shift = Vec2::new(0.2 * seq.saturating_sub(3) as f64, 0.0);
        let now: Vec<_> = painter.rest.iter().map(|&p| p + shift).collect();
        painter.paint(&now, None, seq)
    };
    let [whole, white, covered] = whole_and_spoilt(&painter, RestKind::Unloaded, 16, dragged);
    assert!(whole[..2].iter().all(|r| r.state == SlipState::NoContact), "{whole:?}");
    assert!(whole[12..].iter().all(|r| r.state != SlipState::NoContact && r.contact.area_px2 > 0.0), "{whole:?}");
    for spoilt in [white, covered] {
        for (a, b) in whole.iter().zip(&spoilt).filter(|(_, b)| b.seq != 16) {
            assert_eq!((a.state, a.reference_seq), (b.state, b.reference_seq), "frame {}", a.seq);
            // The frame after it has the region of the one before.
            let off_px2 = (a.contact.area_px2 - b.contact.area_px2).abs();
            assert!(off_px2 <= if b.seq == 17 { 50.0 } else { 0.0 }, "frame {}: {off_px2} px2", b.seq);
        }
    }
}

/// An imprint too faint for a region is known to be held while the image is as in the first frame, which is none that
/// shows no finger.
#[test]
fn a_covered_first_frame_is_not_how_a_held_finger_looked_at_the_start() {
    let painter = Painter::new(SIZE, 18.0, 6.0, Skin::Smooth, 0.5, 21);
    let faint = Touch { centre: Vec2::new(160.0, 120.0), radii_px: Vec2::new(55.0, 55.0), strength_levels: 5.0 };
    let held = |seq: u64| painter.paint(&painter.rest, (seq < 20).then_some(&faint), seq);
    let [whole, white, covered] = whole_and_spoilt(&painter, RestKind::InContact, 1, held);
    assert!(whole[..18].iter().all(|r| r.state == SlipState::Unsure), "{whole:?}");
    assert!(whole[22..].iter().all(|r| r.state == SlipState::NoContact), "{whole:?}");
    for spoilt in [white, covered] {
        for (a, b) in whole.iter().zip(&spoilt).filter(|(_, b)| b.seq != 1) {
            assert_eq!((a.state, a.contact), (b.state, b.contact), "frame {}", a.seq);
        }
    }
}
