//! Begin and end of contact, and the renewal of the reference: painted fingers, one letter per frame.

mod picture;

use picture::{Painter, Touch, frame};
use slipbound::finger_pipeline::rest_from;
use slipbound::image::{Frame, SizePx};
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor, SlipReport, SlipState};
use slipbound::plane::Vec2;
use slipbound::sensor::Skin;

const SIZE: SizePx = SizePx::new(320, 240);

fn finger(skin: Skin) -> (Painter, SlipMonitor) {
    finger_from(skin, None)
}

/// A finger whose rest frame shows it untouched, or already touched.
fn finger_from(skin: Skin, touched: Option<&Touch>) -> (Painter, SlipMonitor) {
    let mut painter = Painter::new(SIZE, 20.0, 7.0, skin, 0.0, 3);
    if touched.is_some() {
        // Edges visible at rest are not masked in this case: dots must make no edges.
        painter.contrast_levels = 22.0;
    }
    let mut builder = RestBuilder::new(&painter.sensor, &Settings::default(), SIZE).expect("valid");
    for i in 0..4 {
        builder.add(&frame(&painter.paint(&painter.rest, touched, 900 + i), SIZE, i)).expect("bright");
    }
    let kind = if touched.is_some() { RestKind::InContact } else { RestKind::Unloaded };
    let rest = builder.build(kind).expect("markers");
    let monitor = SlipMonitor::new(&painter.sensor, &Settings::default(), rest).expect("valid");
    (painter, monitor)
}

fn touch(radius_px: f64) -> Touch {
    Touch { centre: Vec2::new(160.0, 120.0), radii_px: Vec2::new(1.1, 0.9) * radius_px, strength_levels: 32.0 }
}

/// Contact, `#`, in a row of frames: `.` no touch, `o` a small one, `O` a large one.
fn contact_in(row: &str, skin: Skin) -> String {
    let (painter, mut monitor) = finger(skin);
    // A contact begins at 2255 px2 and lasts down to 440 px2.
    let touch = |shown| match shown {
        'o' => Some(touch(19.0)),
        'O' => Some(touch(55.0)),
        _ => None,
    };
    let step = |(i, shown): (usize, char)| {
        let rgb = painter.paint(&painter.rest, touch(shown).as_ref(), i as u64);
        let report = monitor.step(&frame(&rgb, SIZE, i as u64), None);
        let touches = report.state != SlipState::NoContact;
        assert_eq!(touches, report.contact.area_px2 > 0.0, "frame {i}: {report:?}");
        assert_eq!(report.contact.area_px2, monitor.contact_region().area_px2() as f64);
        if touches { '#' } else { '.' }
    };
    row.chars().enumerate().map(step).collect()
}

#[test]
fn a_contact_begins_with_the_fourth_frame_of_much_and_lasts_while_a_little_is_left() {
    for skin in [Skin::Smooth, Skin::Fabric] {
        let row = ".OOO.OOOOOooooo..OOOoooo";
        assert_eq!(contact_in(row, skin), "........#######.........", "{row} {skin:?}");
    }
}

/// A recording that starts in contact, lets go and grips again: evidence of the first contact does not apply to the
/// second.
#[test]
fn the_evidence_of_a_recording_that_starts_in_contact_ends_with_that_contact() {
    let (painter, mut monitor) = finger_from(Skin::Fabric, Some(&touch(70.0)));
    let mut seq = 0;
    let mut show = |shift_px: f64, touched: bool| {
        let moved = |&p: &Vec2| if touch(70.0).depth(p) < 1.0 { p + Vec2::new(shift_px, 0.0) } else { p };
        let places: Vec<Vec2> = painter.rest.iter().map(moved).collect();
        seq += 1;
        let rgb = painter.paint(&places, touched.then_some(&touch(70.0)), seq);
        monitor.step(&frame(&rgb, SIZE, seq), None)
    };
    let first = (0..10).map(|i| show(f64::from(i), true)).last().expect("frames");
    assert_eq!(first.evidence.expect("from the first frame on").reference_seq, 1);
    let between: Vec<_> = (0..6).map(|_| show(0.0, false)).collect();
    assert!(between[2..].iter().all(|r| r.state == SlipState::NoContact && r.evidence.is_none()), "{between:?}");
    let second = (0..12).map(|_| show(0.0, true)).last().expect("frames");
    let evidence = second.evidence.expect("in contact");
    assert!(evidence.reference_seq > 16, "counts from frame {}", evidence.reference_seq);
    assert!(evidence.relaxation < 0.05 && evidence.slide_score < 0.5, "nothing has moved: {evidence:?}");
}

/// An object that was held in the first frame, with an imprint too faint for a region: that is known until the image
/// differs from the first one.
#[test]
fn an_object_held_from_the_start_that_is_too_faint_for_a_region_is_unsure_until_the_image_changes() {
    let faint = Touch { strength_levels: 5.0, ..touch(55.0) };
    let fainter = Touch { strength_levels: 3.5, ..touch(55.0) };
    for (skin, held, while_faint) in [
        (Skin::Smooth, true, SlipState::Unsure),
        (Skin::Smooth, false, SlipState::NoContact),
        (Skin::Fabric, true, SlipState::NoContact),
    ] {
        let (painter, mut monitor) = finger_from(skin, held.then_some(&faint));
        let mut seq = 0;
        let mut show = |touch: Option<&Touch>| {
            let rgb = painter.paint(&painter.rest, touch, seq);
            seq += 1;
            monitor.step(&frame(&rgb, SIZE, seq), None)
        };
        let first: Vec<_> = (0..10).map(|i| show(Some(if i < 5 { &faint } else { &fainter }))).collect();
        for report in &first[1..] {
            assert_eq!(report.state, while_faint, "{skin:?} {held}: {report:?}");
            assert_eq!((report.contact.area_px2, report.estimates.margin), (0.0, None));
        }
        let open: Vec<_> = (0..4).map(|_| show(None)).collect();
        assert!(open.iter().all(|r| r.state == SlipState::NoContact), "{skin:?} {held}: {open:?}");
        if skin == Skin::Smooth {
            assert!(open.iter().all(|r| r.evidence.is_none()), "it ends with the contact: {open:?}");
        }
        let again: Vec<_> = (0..4).map(|_| show(Some(&faint))).collect();
        assert!(again.iter().all(|r| r.state == SlipState::NoContact), "as in the first frame, by chance: {again:?}");
    }
}

/// An imprint near the limit shows no region in some frames.
#[test]
fn an_object_held_from_the_start_is_held_though_its_region_is_missed_in_a_frame() {
    let strong = Touch { strength_levels: 7.5, ..touch(55.0) };
    let faint = Touch { strength_levels: 5.0, ..touch(55.0) };
    let (painter, mut monitor) = finger_from(Skin::Smooth, Some(&strong));
    let mut show = |seq: u64, touch: Option<&Touch>| {
        let report = monitor.step(&frame(&painter.paint(&painter.rest, touch, seq), SIZE, seq), None);
        (report.contact.area_px2, report.state)
    };
    let held: Vec<_> = (0..30).map(|i| show(i, Some(if i % 8 < 6 { &strong } else { &faint }))).collect();
    let (on_px2, off_px2) = (0.0294 * SIZE.area() as f64, 0.0057 * SIZE.area() as f64);
    assert!(held[..6].iter().all(|(area_px2, _)| *area_px2 > on_px2), "a region: {held:?}");
    assert!(held.iter().any(|(area_px2, _)| *area_px2 < off_px2), "none in some: {held:?}");
    assert!(held.iter().all(|(_, state)| *state != SlipState::NoContact), "{held:?}");
    let free: Vec<_> = (30..40).map(|i| show(i, None)).collect();
    assert!(free[2..].iter().all(|(_, state)| *state == SlipState::NoContact), "{free:?}");
}

/// The imprint has moved and is no longer as at the start; then it is too small for a region in some frames.
#[test]
fn an_object_held_from_the_start_that_has_moved_is_held_until_its_imprint_is_gone() {
    let strong = Touch { strength_levels: 7.5, ..touch(55.0) };
    let (painter, mut monitor) = finger_from(Skin::Smooth, Some(&strong));
    let show = |monitor: &mut SlipMonitor, seq: u64, strength_levels: f64, shift_px: f64| {
        let centre = strong.centre + Vec2::new(shift_px, 0.0);
        let object = Touch { strength_levels, centre, ..strong };
        let rgb = painter.paint(&painter.rest, (strength_levels > 0.0).then_some(&object), seq);
        monitor.step(&frame(&rgb, SIZE, seq), None)
    };
    let reports: Vec<_> = (0..40)
        .map(|seq| match seq {
            0..10 => show(&mut monitor, seq, 7.5, if seq < 5 { 0.0 } else { 12.0 }),
            _ => show(&mut monitor, seq, if seq % 3 == 0 { 5.4 } else { 7.5 }, 12.0),
        })
        .collect();
    assert!(reports.iter().any(|r| r.contact.area_px2 == 0.0), "none in some: {reports:?}");
    for report in &reports {
        assert_ne!(report.state, SlipState::NoContact, "{report:?}");
        assert_eq!(report.evidence.map(|e| e.reference_seq), Some(0), "{report:?}");
    }
    let free: Vec<_> = (40..44).map(|seq| show(&mut monitor, seq, 0.0, 12.0).state).collect();
    assert_eq!(free, [SlipState::NoContact; 4], "at once");
}

/// The slide score needs no contact region. The object slides on, or stops after four frames.
#[test]
fn an_object_held_from_the_start_that_slides_is_gross_though_it_is_too_faint_for_a_region() {
    let states_of = |stops_at: f64| -> Vec<(SlipState, f64)> {
        let (painter, mut monitor) = finger_from(Skin::Smooth, Some(&Touch { strength_levels: 5.0, ..touch(55.0) }));
        let mut show = |seq: u64| {
            // It is dragged along by half for six frames; then the gel springs back while the object slides on.
            let at = (seq as f64 - 5.0).clamp(0.0, stops_at);
            let (gel_px, object_px) = (at.min(6.0) - 0.8 * (at - 6.0).clamp(0.0, 6.0), 2.0 * at);
            let near = |p: Vec2| libm::exp(-(p - Vec2::new(160.0, 120.0)).length_squared() / 3600.0);
            let places: Vec<Vec2> = painter.rest.iter().map(|&p| p + Vec2::new(gel_px, 0.0) * near(p)).collect();
            let centre = touch(55.0).centre + Vec2::new(object_px, 0.0);
            let object = Touch { centre, strength_levels: 5.0, ..touch(55.0) };
            let report = monitor.step(&frame(&painter.paint(&places, Some(&object), seq), SIZE, seq), None);
            (report.state, report.contact.area_px2)
        };
        (0..30).map(&mut show).collect()
    };
    let reports = states_of(f64::INFINITY);
    let states: Vec<SlipState> = reports.iter().map(|(state, _)| *state).collect();
    assert!(states[..6].iter().all(|state| *state == SlipState::Unsure), "{states:?}");
    assert_eq!(reports[8], (SlipState::Gross, 0.0));
    assert!(states[8..24].iter().all(|state| *state == SlipState::Gross), "it goes on: {states:?}");
    let reports = states_of(4.0);
    assert!(reports.contains(&(SlipState::Gross, 0.0)), "{reports:?}");
    let ended = reports[9..].iter().position(|(state, _)| *state != SlipState::Gross).map(|frames| 9 + frames);
    assert!(ended.is_some_and(|ended| ended < 26), "0.3 s after the last motion, and its noise: {reports:?}");
}

/// Nothing of an object is visible in the first frames. Only the setting `held` makes them a contact.
#[test]
fn a_rest_frame_in_which_an_object_is_known_to_be_held_is_in_contact_though_nothing_shows() {
    let painter = Painter::new(SIZE, 20.0, 7.0, Skin::Smooth, 0.0, 3);
    let pictures: Vec<Vec<u8>> = (0..4).map(|i| painter.paint(&painter.rest, None, i)).collect();
    let frames: Vec<_> = pictures.iter().zip(0..).map(|(rgb, seq)| frame(rgb, SIZE, seq)).collect();
    for (held, kind) in [(false, RestKind::Unloaded), (true, RestKind::InContact)] {
        let mut settings = Settings::default();
        settings.rest.held = held;
        let builder = RestBuilder::new(&painter.sensor, &settings, SIZE).expect("valid");
        assert_eq!(rest_from(builder, &frames).expect("markers").kind(), kind);
    }
}

/// However near to each other the markers are, in cells of the image.
#[test]
fn a_gel_that_is_touched_in_its_first_frames_is_known_to_be_so() {
    for (width, height, pitch_px, diameter_px) in [
        (320, 240, 15.2, 5.3),
        (320, 240, 20.0, 7.0),
        (320, 240, 30.8, 11.0),
        (640, 480, 26.5, 8.4),
        (640, 480, 40.0, 14.0),
    ] {
        let size = SizePx::new(width, height);
        let mut painter = Painter::new(size, pitch_px, diameter_px, Skin::Smooth, 0.0, 3);
        let (middle, radius_px) = (Vec2::new(width as f64, height as f64) / 2.0, 0.25 * height as f64);
        let object = Touch { centre: middle, radii_px: Vec2::new(1.1, 0.9) * radius_px, strength_levels: 40.0 };
        let mut look_at = |bare: Option<f64>, touched: Option<&Touch>, seed: u64| {
            painter.sensor.bare_sharpness = bare;
            let mut builder = RestBuilder::new(&painter.sensor, &Settings::default(), size).expect("valid");
            builder.look(&frame(&painter.paint(&painter.rest, touched, seed), size, 0))
        };
        let finger = format!("{size}, pitch {pitch_px} px, dots of {diameter_px} px");
        let bare = look_at(None, None, 1);
        assert!(bare.sharpness > 0.1 && !bare.touched, "{finger}: {bare:?}");
        let own = Some(bare.sharpness);
        assert!(!look_at(own, None, 2).touched && look_at(own, Some(&object), 3).touched, "{finger}");
    }
}

/// Of 640x480 px, where wide cells would all be covered by markers.
#[test]
fn a_press_between_large_markers_is_a_contact() {
    let size = SizePx::new(640, 480);
    for (pitch_px, diameter_px) in [(22.8, 13.6), (24.0, 15.0), (26.0, 15.6)] {
        let painter = Painter::new(size, pitch_px, diameter_px, Skin::Smooth, 0.0, 3);
        let object =
            Touch { centre: Vec2::new(320.0, 240.0), radii_px: Vec2::new(160.0, 140.0), strength_levels: 32.0 };
        let mut builder = RestBuilder::new(&painter.sensor, &Settings::default(), size).expect("valid");
        builder.add(&frame(&painter.paint(&painter.rest, None, 900), size, 0)).expect("bright");
        let rest = builder.build(RestKind::Unloaded).expect("markers");
        let mut monitor = SlipMonitor::new(&painter.sensor, &Settings::default(), rest).expect("valid");
        let shown: Vec<Vec<u8>> = (0..8).map(|i| painter.paint(&painter.rest, Some(&object), i)).collect();
        let report = shown.iter().zip(1..).map(|(rgb, seq)| monitor.step(&frame(rgb, size, seq), None)).last();
        let share = report.expect("frames").contact.area_px2 / (std::f64::consts::PI * 160.0 * 140.0);
        assert!((0.75..1.25).contains(&share), "pitch {pitch_px} px: {share} of the touched area");
    }
}

/// A strobed light: of a camera of 90 Hz every third frame is dark, as often as the contact region is due.
#[test]
fn a_contact_ends_though_frames_are_dark_in_step_with_the_schedule() {
    for skin in [Skin::Smooth, Skin::Fabric] {
        let (painter, mut monitor) = finger(skin);
        let dark = vec![0; 3 * SIZE.area()];
        let mut state = |i: u64| {
            let object = touch(55.0);
            let rgb = painter.paint(&painter.rest, (6..30).contains(&i).then_some(&object), i);
            let is_dark = i >= 18 && i.is_multiple_of(3);
            let mut frame = frame(if is_dark { &dark } else { &rgb }, SIZE, i);
            frame.time_ns = Some(i * 11_111_111);
            monitor.step(&frame, None).state
        };
        let states: Vec<SlipState> = (0..48).map(&mut state).collect();
        assert!(states[17] != SlipState::NoContact && states[18] == SlipState::Unjudged, "{skin:?}: {states:?}");
        let is_free = |state: &SlipState| matches!(state, SlipState::NoContact | SlipState::Unjudged);
        assert!(states[38..].iter().all(is_free), "{skin:?}: {states:?}");
    }
}

/// Times in milliseconds or microseconds say nothing: every frame gets every step.
#[test]
fn a_contact_ends_though_times_are_in_another_unit() {
    for frame_ns in [33, 33_333] {
        let (painter, mut monitor) = finger(Skin::Smooth);
        let mut touches = |i: u64| {
            let rgb = painter.paint(&painter.rest, (6..20).contains(&i).then_some(&touch(55.0)), i);
            monitor.step(&Frame { time_ns: Some(i * frame_ns), ..frame(&rgb, SIZE, i) }, None).contact.area_px2 > 0.0
        };
        let row: String = (0..30).map(|i| if touches(i) { '#' } else { '.' }).collect();
        assert_eq!(row, ".........###########..........", "{frame_ns} a frame");
    }
}

/// The rest frame shows a touched and sheared finger: when released, its markers spring back to positions not seen
/// before.
#[test]
fn a_finger_that_was_sheared_at_rest_is_free_once_it_is_let_go() {
    for skin in [Skin::Smooth, Skin::Fabric] {
        let (painter, mut monitor) = finger_from(skin, Some(&touch(55.0)));
        let mut seq = 0;
        let mut show = |shift_px: f64, touched: bool| {
            let far = |p: Vec2| (p - Vec2::new(160.0, 120.0)).length_squared() / 3600.0;
            let places: Vec<Vec2> =
                painter.rest.iter().map(|&p| p + Vec2::new(shift_px, 0.0) * (-far(p)).exp()).collect();
            let rgb = painter.paint(&places, touched.then_some(&touch(55.0)), seq);
            seq += 1;
            monitor.step(&frame(&rgb, SIZE, seq), None)
        };
        let held: Vec<_> = (0..10).map(|_| show(0.0, true)).collect();
        assert!(held.iter().all(|r| r.state != SlipState::NoContact), "{skin:?}: {held:?}");
        let free: Vec<_> = (0..20).map(|_| show(-4.0, false)).collect();
        assert!(free[2..].iter().all(|r| r.state == SlipState::NoContact), "{skin:?}: {free:?}");
        let again = (0..20).map(|_| show(-4.0, true)).last().expect("frames");
        let sheared_px = again.shear.expect("a contact").translation_px.length();
        assert!(again.state == SlipState::Stick && sheared_px < 0.6, "{skin:?}: {again:?}");
        let free: Vec<_> = (0..6).map(|_| show(-4.0, false)).collect();
        assert!(free[2..].iter().all(|r| r.state == SlipState::NoContact), "{skin:?}: {free:?}");
    }
}

/// A stain that is no contact by itself does not prolong a contact after its shear has ended.
#[test]
fn a_stain_does_not_keep_a_contact_that_only_displacement_shows() {
    let (painter, mut monitor) = finger(Skin::Smooth);
    let stain = Touch { centre: Vec2::new(60.0, 60.0), radii_px: Vec2::new(14.0, 14.0), strength_levels: 40.0 };
    let mut show = |seq: u64| {
        let shift = if (5..15).contains(&seq) { Vec2::new(3.0, 0.0) } else { Vec2::ZERO };
        let places: Vec<Vec2> = painter.rest.iter().map(|&p| p + shift).collect();
        monitor.step(&frame(&painter.paint(&places, Some(&stain), seq), SIZE, seq), None).state
    };
    let states: Vec<SlipState> = (0..30).map(&mut show).collect();
    assert_ne!(states[14], SlipState::NoContact, "{states:?}");
    assert!(states[18..].iter().all(|state| *state == SlipState::NoContact), "{states:?}");
}

/// Markers cut by the border when the reference was taken have no displacement from it: they are ignored until the next
/// one.
#[test]
fn markers_that_were_cut_when_the_reference_was_taken_are_not_in_it() {
    let (painter, mut monitor) = finger(Skin::Smooth);
    let mut seq = 0;
    let mut show = |monitor: &mut SlipMonitor, shift: Vec2, touched: bool| -> SlipReport {
        let places: Vec<Vec2> = painter.rest.iter().map(|&p| p + shift).collect();
        let rgb = painter.paint(&places, touched.then_some(&touch(85.0)), seq);
        seq += 1;
        monitor.step(&frame(&rgb, SIZE, seq), None)
    };
    for _ in 0..6 {
        show(&mut monitor, Vec2::ZERO, true);
    }
    // All move by nearly a pitch: the last column leaves the image.
    let away = Vec2::new(18.0, 0.0);
    for i in 1..=6 {
        show(&mut monitor, away * (f64::from(i) / 6.0), true);
    }
    let cut = |m: &slipbound::monitor::Marker| m.rest.x > 298.0;
    assert!(monitor.markers().iter().all(|m| m.in_reference && (m.whole != cut(m))), "the last column is cut");
    monitor.rebase(12);
    let report = (0..2).map(|_| show(&mut monitor, away, true)).last().expect("frames");
    assert_eq!(report.reference_seq + 2, report.seq);
    for m in monitor.markers() {
        assert_eq!(m.in_reference, !cut(m), "marker {}", m.id);
        assert!(cut(m) || m.now_from_reference().length() < 0.3, "marker {}: {m:?}", m.id);
    }
    // Back in view, a column without a known displacement has no slip and does not contribute to the motion, though it
    // is touched.
    let back = |i: u32| away * (1.0 - f64::from(i) / 6.0);
    let report = (1..=6).map(|i| show(&mut monitor, back(i), true)).last().expect("frames");
    for m in monitor.markers().iter().filter(|m| cut(m)) {
        assert!(m.whole && !m.in_reference && !m.inner && !m.over, "{m:?}");
    }
    assert!(report.motion.expect("in contact").translation_px.x < -17.0);
    // No contact: all displacements count from rest again.
    for _ in 0..4 {
        show(&mut monitor, Vec2::ZERO, false);
    }
    assert!(monitor.markers().iter().all(|m| m.in_reference && m.reference == m.rest));
}

/// A patch beside a firm contact: brighter by some levels within some px of a place.
#[test]
fn a_patch_that_is_small_or_faint_beside_the_contact_is_none() {
    let patch = Vec2::new(60.0, 60.0);
    let seen = |levels: f64, radius_px: f64| {
        let (painter, mut monitor) = finger(Skin::Smooth);
        for i in 0..6u64 {
            let mut rgb =
                painter.paint(&painter.rest, Some(&Touch { centre: Vec2::new(210.0, 140.0), ..touch(55.0) }), i);
            for (at, value) in rgb.iter_mut().enumerate() {
                let place = Vec2::new((at / 3 % 320) as f64, (at / 3 / 320) as f64);
                let share = 0.5 * libm::erfc(((place - patch).length() - radius_px) / 3.0);
                *value = (f64::from(*value) + levels * share).round().clamp(0.0, 255.0) as u8;
            }
            monitor.step(&frame(&rgb, SIZE, i), None);
        }
        assert!(monitor.contact_region().get(210, 140), "the contact itself");
        monitor.contact_region().get(60, 60)
    };
    assert!(seen(30.0, 25.0), "large and strong: a contact, too");
    assert!(!seen(30.0, 5.0), "as strong, but small");
    assert!(!seen(9.0, 25.0), "as large, but less than half as strong as the contact");
}

/// A flat object shows only its rim. Where the view cuts it, the contact includes the area that the rim encloses with
/// one side of the view or with two opposite ones. An area enclosed with two adjacent sides may be outside the contact.
#[test]
fn the_middle_of_a_contact_that_the_view_cuts_is_contact() {
    // Whether a place is contact when the image is brighter within some px of a line.
    let is_contact = |(x, y): (isize, isize), away_px: &dyn Fn(Vec2) -> f64| {
        let (painter, mut monitor) = finger(Skin::Smooth);
        for i in 0..6u64 {
            let mut rgb = painter.paint(&painter.rest, None, i);
            for (at, value) in rgb.iter_mut().enumerate() {
                let place = Vec2::new((at / 3 % 320) as f64, (at / 3 / 320) as f64);
                let share = 0.5 * libm::erfc((away_px(place).abs() - 7.0) / 3.0);
                *value = (f64::from(*value) + 30.0 * share).round().clamp(0.0, 255.0) as u8;
            }
            monitor.step(&frame(&rgb, SIZE, i), None);
        }
        monitor.contact_region().get(x, y)
    };
    let middle = (160, 120);
    let from_left_to_right = |p: Vec2| (p.y - 120.0).abs() - 50.0;
    assert!(is_contact(middle, &from_left_to_right) && !is_contact((160, 20), &from_left_to_right));
    let from_top_to_bottom = |p: Vec2| (p.x - 160.0).abs() - 50.0;
    assert!(is_contact(middle, &from_top_to_bottom) && !is_contact((20, 120), &from_top_to_bottom));
    let about = |x: f64, y: f64| move |p: Vec2| (p - Vec2::new(x, y)).length() - 80.0;
    for (x, y) in [(0isize, 120isize), (319, 120), (160, 0), (160, 239)] {
        let place = ((160 + 3 * x) / 4, (120 + 3 * y) / 4);
        assert!(is_contact(place, &about(x as f64, y as f64)), "at the side by {x}, {y}");
    }
    for (x, y) in [(0isize, 0isize), (319, 0), (0, 239), (319, 239)] {
        let place = ((160 + 5 * x) / 6, (120 + 5 * y) / 6);
        assert!(!is_contact(place, &about(x as f64, y as f64)), "in the corner by {x}, {y}");
    }
}

/// The last report of a finger pressed with this strength (None: not at all) under light brighter than at rest by this
/// gain.
fn lit(strength_levels: Option<f64>, gain: f64) -> SlipReport {
    let (painter, mut monitor) = finger(Skin::Smooth);
    let pressed = strength_levels.map(|strength_levels| Touch { strength_levels, ..touch(55.0) });
    let step = |i: u64| {
        let mut rgb = painter.paint(&painter.rest, pressed.as_ref(), i);
        rgb.iter_mut().for_each(|value| *value = (f64::from(*value) * gain).round().min(255.0) as u8);
        monitor.step(&frame(&rgb, SIZE, i), None)
    };
    (0..6).map(step).last().expect("frames")
}

#[test]
fn light_that_changes_as_a_whole_is_no_contact_and_hides_none() {
    for gain in [0.85, 1.15] {
        assert_eq!(lit(None, gain).state, SlipState::NoContact, "{gain}");
        let (pressed, usual) = (lit(Some(32.0), gain).contact.area_px2, lit(Some(32.0), 1.0).contact.area_px2);
        assert!((pressed / usual - 1.0).abs() < 0.1, "{gain}: {pressed} px2 instead of {usual}");
    }
}

#[test]
fn a_faint_contact_has_little_quality_however_many_markers_it_covers() {
    let (faint, firm) = (lit(Some(12.0), 1.0).contact, lit(Some(32.0), 1.0).contact);
    assert!(firm.quality > 0.9, "{firm:?}");
    assert!(faint.quality > 0.0 && faint.quality < 0.7 && faint.area_px2 > 0.7 * firm.area_px2, "{faint:?}");
}
