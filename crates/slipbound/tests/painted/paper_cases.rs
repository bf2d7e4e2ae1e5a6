//! The cases drawn in the paper, on painted fingers: no slip where it sticks, slip at the rim where the rim lags.

use crate::picture::{Painter, Touch, frame};
use slipbound::image::SizePx;
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipKind, SlipMonitor, SlipReport, SlipRule, SlipState};
use slipbound::plane::{RigidMotion, Vec2};
use slipbound::sensor::Skin;

const SIZE: SizePx = SizePx::new(640, 480);
const PITCH_PX: f64 = 24.0;
const MIDDLE: Vec2 = Vec2::new(320.0, 240.0);

fn painter(skin: Skin) -> Painter {
    Painter::new(SIZE, PITCH_PX, 8.0, skin, 0.5, 11)
}

fn touch() -> Touch {
    Touch { centre: MIDDLE, radii_px: Vec2::new(6.5, 5.5) * PITCH_PX, strength_levels: 32.0 }
}

fn monitor(painter: &Painter) -> SlipMonitor {
    // Markers decide, because the painted fields follow no contact physics.
    let settings = Settings::default().with(|s| s.slip.rule = SlipRule::Markers);
    let mut builder = RestBuilder::new(&painter.sensor, &settings, SIZE).expect("valid");
    for i in 0..10 {
        builder.add(&frame(&painter.paint(&painter.rest, None, 500 + i), SIZE, i)).expect("bright");
    }
    SlipMonitor::new(&painter.sensor, &settings, builder.build(RestKind::Unloaded).expect("markers")).expect("valid")
}

/// Presses, then moves in `frames` steps; passes report and truth of every moving frame to `see`.
fn play(
    painter: &Painter,
    monitor: &mut SlipMonitor,
    frames: u64,
    now: impl Fn(Vec2, f64) -> Vec2,
    object: impl Fn(f64) -> Vec2,
    mut see: impl FnMut(&SlipReport, &SlipMonitor),
) {
    for i in 0..frames + 6 {
        let share = i.saturating_sub(5) as f64 / frames as f64;
        let markers: Vec<Vec2> = painter.rest.iter().map(|&p| now(p, share)).collect();
        let touch = Touch { centre: MIDDLE + object(share), ..touch() };
        let rgb = painter.paint(&markers, Some(&touch), i);
        let report = monitor.step(&frame(&rgb, SIZE, i), None);
        if i > 5 {
            see(&report, monitor);
        }
    }
}

#[test]
fn a_rigidly_moved_imprint_has_no_slip_over_a_pitch_and_a_half_and_15_deg() {
    for skin in [Skin::Smooth, Skin::Fabric] {
        let painter = painter(skin);
        let mut monitor = monitor(&painter);
        let motion = |share: f64| RigidMotion {
            reference: MIDDLE,
            translation: Vec2::new(1.2, -0.9) * (PITCH_PX * share), // 1.5 pitches
            rotation_rad: 15f64.to_radians() * share,
        };
        let (mut worst_pitch, mut judged) = (0.0f64, 0);
        play(
            &painter,
            &mut monitor,
            30,
            |p, share| motion(share).apply(p),
            |share| motion(share).translation,
            |report, monitor| {
                assert_eq!(report.state, SlipState::Stick, "{skin:?}, frame {}: {report:?}", report.seq);
                worst_pitch = worst_pitch.max(report.slip.max_pitch);
                judged += 1;
                let truth = motion((report.seq - 5) as f64 / 30.0);
                let fitted = report.motion.expect("in contact");
                let error_deg = (fitted.rotation_rad - truth.rotation_rad).to_degrees().abs();
                assert!(error_deg <= 0.05, "{skin:?}, frame {}: rotation {error_deg} deg off", report.seq);
                for m in monitor.markers().iter().filter(|m| m.matched) {
                    let there = truth.apply(m.rest);
                    let off = (m.now - there).length();
                    // The position of a marker cut by the border follows from its neighbours: within a tenth of the
                    // pitch.
                    let cut = there.x < 6.0 || there.y < 6.0 || there.x > 633.0 || there.y > 473.0;
                    let most = if cut { 0.1 * PITCH_PX } else { 0.4 };
                    assert!(off < most, "{skin:?}, frame {}, marker {} at {there:?}: {off} px off", report.seq, m.id);
                }
            },
        );
        println!("{skin:?}: {judged} frames stick, largest slip field {worst_pitch:.3} pitch (threshold 0.296)");
        assert_eq!(judged, 30);
    }
}

#[test]
fn the_centre_of_rotation_is_within_half_a_pixel_at_3_deg() {
    let painter = painter(Skin::Smooth);
    let centre = Vec2::new(352.0, 221.0);
    let mut monitor = monitor(&painter);
    let turn = |share: f64| RigidMotion {
        reference: centre,
        translation: Vec2::ZERO,
        rotation_rad: 3f64.to_radians() * share.min(1.0),
    };
    let (mut worst_px, mut worst_deg) = (0.0f64, 0.0f64);
    play(
        &painter,
        &mut monitor,
        12,
        |p, share| turn(share * 1.5).apply(p),
        |share| turn(share * 1.5).displacement(MIDDLE),
        |report, _| {
            let fitted = report.motion.expect("in contact");
            if report.seq >= 13 {
                worst_px = worst_px.max((fitted.icr_px.expect("turns") - centre).length());
                worst_deg = worst_deg.max((fitted.rotation_rad.to_degrees() - 3.0).abs());
            }
        },
    );
    println!("at 3 deg: centre of rotation at most {worst_px:.3} px off, rotation {worst_deg:.4} deg");
    assert!(worst_px <= 0.5, "{worst_px} px");
    assert!(worst_deg <= 0.05, "{worst_deg} deg");
    assert_eq!(monitor.sensor().pitch_mm, Some(1.5));
}

/// The object shifts along x; markers at the rim of the contact lag behind it by `lag_mm`.
fn rim(lag_mm: f64, mirrored: bool) -> (Vec<(u32, bool, bool)>, SlipReport) {
    let painter = painter(Skin::Smooth);
    let mut monitor = monitor(&painter);
    let lag_px = lag_mm / 1.5 * PITCH_PX;
    let sign = if mirrored { -1.0 } else { 1.0 };
    let at_rim = |p: Vec2| touch().depth(p) > 0.72;
    let step = |share: f64| Vec2::new(1.2 * lag_px * share * sign, 0.0);
    let now = |p: Vec2, share: f64| {
        p + step(share) - if at_rim(p) { Vec2::new(lag_px * share * sign, 0.0) } else { Vec2::ZERO }
    };
    let mut last = None;
    play(&painter, &mut monitor, 8, now, step, |report, monitor| {
        if last.as_ref().is_none_or(|(r, _): &(SlipReport, Vec<_>)| r.state == SlipState::Stick) {
            let markers = monitor.markers().iter().filter(|m| m.in_contact);
            last = Some((*report, markers.map(|m| (m.id, at_rim(m.rest), m.over)).collect()));
        }
    });
    let (report, markers) = last.expect("moved");
    (markers, report)
}

#[test]
fn a_rim_that_lags_0_6_mm_slips_exactly_there_and_0_3_mm_nowhere() {
    let (markers, report) = rim(0.6, false);
    assert_eq!(report.state, SlipState::Incipient);
    assert_eq!(report.slip.kind, Some(SlipKind::Translation));
    assert!(markers.iter().filter(|m| m.1).count() > 20, "a rim of {} markers", markers.len());
    for (id, lags, over) in &markers {
        // At the first alarm the lag has just passed the threshold: only rim markers slip, and nearly all of them.
        assert!(*lags || !over, "marker {id} moves with the object and is called slipping");
    }
    let direction_rad = report.slip.direction_rad.expect("a translation");
    assert!(direction_rad.abs() < 0.05, "the object slides along x: {direction_rad}");
    let (markers, report) = rim(0.3, false);
    assert_eq!(report.state, SlipState::Stick);
    assert_eq!(markers.iter().filter(|m| m.2).count(), 0);
}

#[test]
fn the_whole_lag_at_once_marks_the_whole_rim() {
    let painter = painter(Skin::Smooth);
    let mut monitor = monitor(&painter);
    let lag_px = 0.6 / 1.5 * PITCH_PX;
    let at_rim = |p: Vec2| touch().depth(p) > 0.72;
    // The object jumps in one frame (0.48 pitch); until then it is at rest.
    let jump = |share: f64| if share > 0.9 { Vec2::new(1.2 * lag_px, 0.0) } else { Vec2::ZERO };
    let now = |p: Vec2, share: f64| if at_rim(p) { p + jump(share) / 6.0 } else { p + jump(share) };
    let mut marked = Vec::new();
    play(&painter, &mut monitor, 4, now, jump, |report, monitor| {
        if report.state == SlipState::Incipient {
            marked = monitor.markers().iter().filter(|m| m.in_contact).map(|m| (at_rim(m.rest), m.over)).collect();
        }
    });
    let count = |lags: bool, over: bool| marked.iter().filter(|m| **m == (lags, over)).count();
    println!(
        "rim over {}, rim not {}, core over {}, core not {}",
        count(true, true),
        count(true, false),
        count(false, true),
        count(false, false)
    );
    assert!(count(true, true) > 20);
    assert_eq!((count(true, false), count(false, true)), (0, 0), "exactly the rim");
}

#[test]
fn mirrored_in_mirrored_out() {
    let (_, report) = rim(0.6, false);
    let (_, mirror) = rim(0.6, true);
    assert_eq!((report.state, report.seq), (mirror.state, mirror.seq));
    let (a, b) = (report.motion.expect("moves"), mirror.motion.expect("moves"));
    assert!((a.translation_px.x + b.translation_px.x).abs() < 0.05, "{a:?} {b:?}");
    let along = |r: &SlipReport| libm::cos(r.slip.direction_rad.expect("slides"));
    assert!(along(&report) > 0.99 && along(&mirror) < -0.99);
}
