//! Evidence of sliding: imprint and markers when both move together, and when only one of them moves.

use crate::picture::{Painter, Touch, frame};
use slipbound::image::SizePx;
use slipbound::monitor::{EvidenceReport, RestBuilder, RestKind, Settings, SlipMonitor, SlipReport, SlipState};
use slipbound::plane::Vec2;
use slipbound::sensor::Skin;

/// Frames in which the contact is made and settles.
const SETTLE_FRAMES: usize = 12;

/// A finger on which the object moves by `object(i)` and the gel under it by `gel(i)`, both in pitches along x.
fn judge(
    scale: f64,
    skin: Skin,
    settings: &Settings,
    object: impl Fn(usize) -> f64,
    gel: impl Fn(usize) -> f64,
    frames: usize,
) -> Vec<SlipReport> {
    let size = SizePx::new((480.0 * scale) as usize, (360.0 * scale) as usize);
    let pitch_px = 26.0 * scale;
    let painter = Painter::new(size, pitch_px, 9.0 * scale, skin, 0.5, 4);
    let mut builder = RestBuilder::new(&painter.sensor, settings, size).expect("valid");
    builder.add(&frame(&painter.paint(&painter.rest, None, 0), size, 0)).expect("bright");
    let mut monitor = SlipMonitor::new(&painter.sensor, settings, builder.build(RestKind::Unloaded).expect("markers"))
        .expect("valid");
    let middle = Vec2::new(size.width as f64, size.height as f64) / 2.0;
    (0..frames + SETTLE_FRAMES)
        .map(|i| {
            let n = i.saturating_sub(SETTLE_FRAMES);
            let (object_px, gel_px) = (object(n) * pitch_px, gel(n) * pitch_px);
            let radii_px = Vec2::new(95.0, 75.0) * scale;
            let touch = Touch { centre: middle + Vec2::new(object_px, 0.0), radii_px, strength_levels: 40.0 };
            // The gel around the contact is dragged along, less with distance.
            let moved = |&p: &Vec2| {
                let away = (p - middle) / (170.0 * scale);
                p + Vec2::new(gel_px * libm::exp(-away.length_squared().powi(2)), 0.0)
            };
            let now: Vec<Vec2> = painter.rest.iter().map(moved).collect();
            let rgb = painter.paint(&now, (i > 1).then_some(&touch), i as u64);
            monitor.step(&frame(&rgb, size, i as u64), None)
        })
        .collect()
}

fn evidence(report: &SlipReport) -> EvidenceReport {
    report.evidence.expect("evidence of a settled contact")
}

/// Whether the imprint slides over the gel. The state `gross` also needs the estimates, which are not valid for painted
/// gels.
fn slides(report: &SlipReport) -> bool {
    report.evidence.is_some_and(|evidence| evidence.slides)
}

/// Sheared by half a pitch over ten frames, then held.
fn shear(i: usize) -> f64 {
    0.05 * i.min(10) as f64
}

/// Continues to move after that.
fn slide(i: usize) -> f64 {
    0.05 * i as f64
}

#[test]
fn an_imprint_that_is_carried_with_the_markers_has_not_changed() {
    for skin in [Skin::Smooth, Skin::Fabric] {
        let reports = judge(1.0, skin, &Settings::default(), shear, shear, 25);
        let last = evidence(&reports[reports.len() - 1]);
        assert!(last.imprint_change.expect("an imprint") < 0.2, "{skin:?}: {last:?}");
        assert!(last.relaxation < 0.1, "{skin:?}: {last:?}");
        assert!(reports.iter().all(|r| r.state != SlipState::Gross && !slides(r)), "{skin:?}");
    }
}

#[test]
fn an_imprint_that_goes_on_without_them_slides() {
    for skin in [Skin::Smooth, Skin::Fabric] {
        let reports = judge(1.0, skin, &Settings::default(), slide, shear, 40);
        let first = reports.iter().position(slides).expect("a slide");
        let slid = first - SETTLE_FRAMES - 10;
        assert!((1..=9).contains(&slid), "{skin:?}: after {slid} frames of 0.05 pitch");
        let held = reports[first..].iter().filter(|r| slides(r)).count();
        assert!(20 * held >= 19 * (reports.len() - first), "{skin:?}: kept in {held} of {}", reports.len() - first);
        let last = evidence(&reports[reports.len() - 1]);
        // 30 frames of 0.05 pitch over the gel. A plain dome in noise has few edges to register: its motion is
        // underestimated, the usual bias of noise on a slope.
        let slid_pitch = last.slide_px.x / 26.0;
        assert!((0.75..2.1).contains(&slid_pitch), "{skin:?}: {slid_pitch} pitches of 1.5");
    }
}

#[test]
fn twice_the_pixels_change_no_evidence() {
    let settings = Settings::default();
    let small = judge(1.0, Skin::Smooth, &settings, slide, shear, 30);
    let large = judge(2.0, Skin::Smooth, &settings, slide, shear, 30);
    let (small_last, large_last) = (evidence(&small[41]), evidence(&large[41]));
    assert!((small_last.slide_score - large_last.slide_score).abs() < 0.3, "{small_last:?} {large_last:?}");
    assert!((2.0 * small_last.slide_px.x / large_last.slide_px.x - 1.0).abs() < 0.25, "{small_last:?} {large_last:?}");
    let first = |reports: &[SlipReport]| reports.iter().position(slides).expect("a slide");
    assert!(first(&small).abs_diff(first(&large)) <= 2);
}

#[test]
fn displacement_that_springs_back_is_relaxation() {
    let back = |i: usize| if i < 10 { 0.05 * i as f64 } else { 0.1 };
    let reports = judge(1.0, Skin::Smooth, &Settings::default(), shear, back, 20);
    let last = evidence(&reports[reports.len() - 1]);
    assert!((last.relaxation - 0.75).abs() < 0.12, "{last:?}");
}

#[test]
fn the_paper_as_written_has_no_evidence_and_says_no_gross() {
    let reports = judge(1.0, Skin::Fabric, &Settings::paper(), slide, shear, 30);
    assert!(reports.iter().all(|r| r.evidence.is_none() && r.state != SlipState::Gross));
}
