//! Several fingers as one hand: what is fused, what is separated, and what happens when a finger fails.

use slipbound::hand::{Allowed, Hand, HandReport, HandVector, Health, Mounting, Side, check_sides};
use slipbound::monitor::{
    ContactReport, Estimate, Estimates, MarkerCounts, Reason, ShearReport, SlipKind, SlipReport, SlipState, SlipSummary,
};
use slipbound::plane::Vec2;
use std::collections::BTreeSet;

const MS: u64 = 1_000_000;

/// A finger whose gel is dragged by the object by this many mm, in its own frame.
fn feels(seq: u64, shear_mm: Vec2, rotation_rad: f64) -> SlipReport {
    SlipReport {
        seq,
        time_ns: Some(33_333_333 * seq),
        state: SlipState::Stick,
        reason: None,
        contact: ContactReport { area_px2: 5000.0, area_mm2: Some(100.0 + 0.001 * seq as f64), quality: 0.8 },
        markers: MarkerCounts { detected: 390, matched: 388, lost: 3, inner: 20 },
        reference_seq: 0,
        grip_n: Some(10.0),
        motion: None,
        shear: Some(ShearReport { translation_px: shear_mm * 10.0, translation_mm: Some(shear_mm), rotation_rad }),
        slip: SlipSummary { markers_needed: 8, threshold_pitch: 0.3, max_mm: Some(0.1), ..SlipSummary::default() },
        estimates: Estimates::default(),
        evidence: None,
    }
}

/// The same finger with slip of the object in a direction of its own frame.
fn slips(seq: u64, direction_rad: f64) -> SlipReport {
    let mut report = feels(seq, Vec2::new(0.1, 0.2), 0.0);
    report.state = SlipState::Incipient;
    report.slip.markers_over = 9;
    report.slip.kind = Some(SlipKind::Translation);
    report.slip.direction_rad = Some(direction_rad);
    report
}

fn two() -> Hand {
    Hand::new(&[Mounting::on(Side::Left), Mounting::on(Side::Right)]).expect("two fingers")
}

fn fused(left: &SlipReport, right: &SlipReport) -> HandReport {
    let mut hand = two();
    hand.see(0, left);
    hand.see(1, right);
    hand.report(0)
}

#[test]
fn a_turned_cap_and_a_pull_are_told_apart_by_two_fingers_and_not_by_one() {
    let turn = fused(&feels(1, Vec2::new(0.0, 0.4), 0.0), &feels(1, Vec2::new(0.0, 0.4), 0.0));
    let shear = turn.shear_mm.expect("contact");
    assert!((shear.around - 0.4).abs() < 1e-12 && shear.across.abs() < 1e-12, "{shear:?}");

    let pull = fused(&feels(1, Vec2::new(0.1, -0.4), 0.0), &feels(1, Vec2::new(0.1, 0.4), 0.0));
    let shear = pull.shear_mm.expect("contact");
    assert!((shear.across - 0.4).abs() < 1e-12 && shear.around.abs() < 1e-12, "{shear:?}");
    assert!((shear.along - 0.1).abs() < 1e-12);
    assert!(pull.separated);

    let mut one = Hand::new(&[Mounting::on(Side::Left)]).expect("one finger");
    one.see(0, &feels(1, Vec2::new(0.0, 0.4), 0.0));
    let alone = one.report(0);
    assert!(!alone.separated && alone.shear_mm.expect("contact").across == alone.shear_mm.expect("contact").around);
}

/// Sets in a report: margin, friction, quality, area in mm2, longest slip in mm.
fn measures(report: &mut SlipReport, [margin, friction, quality, area_mm2, slip_mm]: [f64; 5]) {
    let estimate = |value| Some(Estimate { value, sd: 0.1, age_frames: 0 });
    report.estimates = Estimates { margin: estimate(margin), friction: estimate(friction), ..Estimates::default() };
    report.contact = ContactReport { area_px2: 5000.0, area_mm2: Some(area_mm2), quality };
    report.slip.max_mm = Some(slip_mm);
}

#[test]
fn of_several_fingers_the_worst_counts_and_areas_are_averaged() {
    let (mut left, mut right) = (feels(1, Vec2::ZERO, 0.0), feels(1, Vec2::ZERO, 0.0));
    measures(&mut left, [0.3, 0.9, 0.8, 100.0, 0.1]);
    measures(&mut right, [0.5, 0.4, 0.6, 60.0, 0.3]);
    for (left, right) in [(&left, &right), (&right, &left)] {
        let hand = fused(left, right);
        assert_eq!((hand.margin, hand.friction, hand.quality), (Some(0.3), Some(0.4), 0.6));
        assert_eq!((hand.contact_area_mm2, hand.slip_max_mm), (Some(80.0), Some(0.3)));
    }
    // A value missing in one finger is taken from the other, but no mean is made of half.
    (right.estimates, right.contact.area_mm2, right.slip.max_mm) = (Estimates::default(), None, None);
    let hand = fused(&left, &right);
    assert_eq!((hand.margin, hand.friction), (Some(0.3), Some(0.9)));
    assert_eq!((hand.contact_area_mm2, hand.slip_max_mm), (None, None));
    // A finger without contact has no area and no slip, but it is live.
    let away = SlipReport { shear: None, state: SlipState::NoContact, ..right };
    let hand = fused(&left, &away);
    assert_eq!((hand.contact_area_mm2, hand.slip_max_mm, hand.quality), (Some(100.0), Some(0.1), 0.6));
    assert_eq!((hand.live_count, hand.state), (2, SlipState::Stick));
    // Where nothing is touched or seen, nothing is measured: that is not a slip of 0 mm.
    let blind = SlipReport { state: SlipState::Unjudged, ..left };
    for hand in [fused(&away, &away), fused(&blind, &blind)] {
        assert_eq!((hand.contact_area_mm2, hand.slip_max_mm), (None, None));
    }
}

#[test]
fn what_any_finger_sees_goes_before_what_the_others_do_not() {
    use SlipState::*;
    let seen = |state| SlipReport { state, ..feels(1, Vec2::ZERO, 0.0) };
    // In ascending order: the hand reports whichever of two is further to the right.
    let order = [NoContact, Unsure, Stick, Incipient, Gross];
    for (i, &one) in order.iter().enumerate() {
        for (j, &other) in order.iter().enumerate() {
            assert_eq!(fused(&seen(one), &seen(other)).state, order[i.max(j)], "{one:?} and {other:?}");
        }
    }
}

#[test]
fn an_object_that_pivots_turns_the_two_pictures_opposite_ways() {
    let report = fused(&feels(1, Vec2::ZERO, -0.1), &feels(1, Vec2::ZERO, 0.1));
    assert!((report.pivot_rad.expect("contact") - 0.1).abs() < 1e-12);
    let cap = fused(&feels(1, Vec2::ZERO, 0.1), &feels(1, Vec2::ZERO, 0.1));
    assert!(cap.pivot_rad.expect("contact").abs() < 1e-12, "both the same way is no pivot");
}

#[test]
fn a_finger_mounted_askew_says_the_same() {
    let askew = Mounting { side: Side::Right, turn_rad: 0.5 };
    let mut hand = Hand::new(&[Mounting::on(Side::Left), askew]).expect("two fingers");
    let shear_mm = Vec2::new(0.1, 0.4);
    hand.see(0, &feels(1, shear_mm, 0.0));
    hand.see(1, &feels(1, shear_mm.rotated(0.5), 0.0));
    let shear = hand.report(0).shear_mm.expect("contact");
    assert!((shear.around - 0.4).abs() < 1e-12 && (shear.along - 0.1).abs() < 1e-12, "{shear:?}");
}

#[test]
fn two_fingers_that_each_see_half_of_a_slip_see_one() {
    let half = |over| {
        let mut report = feels(1, Vec2::ZERO, 0.0);
        report.slip.markers_over = over;
        report
    };
    assert_eq!(fused(&half(4), &half(4)).state, SlipState::Incipient);
    assert_eq!(fused(&half(4), &half(3)).state, SlipState::Stick);
    assert_eq!(fused(&half(7), &half(0)).state, SlipState::Stick, "one finger alone needs all of it");
    assert_eq!(fused(&slips(1, 0.0), &half(0)).state, SlipState::Incipient, "and then it is believed");
}

/// Contact quality: a contact that is too faint raises no alarm, however many markers seem to slip.
#[test]
fn a_contact_too_faint_to_tell_raises_no_alarm() {
    let faint = SlipReport { state: SlipState::Unsure, reason: Some(Reason::ContactQuality), ..slips(1, 0.0) };
    let stick = feels(1, Vec2::ZERO, 0.0);
    let report = fused(&faint, &stick);
    assert_eq!((report.state, report.slip), (SlipState::Stick, None));
    assert_eq!(fused(&faint, &faint).state, SlipState::Unsure);
}

#[test]
fn a_blind_finger_leaves_the_other_and_the_report_says_so() {
    let mut hand = two();
    hand.see(0, &feels(1, Vec2::new(0.0, 0.4), 0.0));
    let torn =
        SlipReport { state: SlipState::Unjudged, reason: Some(Reason::Torn), shear: None, ..feels(1, Vec2::ZERO, 0.0) };
    hand.see(1, &torn);
    let report = hand.report(0);
    assert_eq!((report.state, report.live_count), (SlipState::Stick, 1));
    assert_eq!(report.health[..3], [Health::Live, Health::Blind, Health::Absent]);
    assert!(!report.separated);
    hand.missed(0);
    let report = hand.report(0);
    assert_eq!((report.state, report.live_count, report.quality), (SlipState::Unjudged, 0, 0.0));
}

#[test]
fn a_picture_that_never_changes_is_a_frozen_one_and_only_in_contact() {
    let mut hand = two();
    let still = feels(7, Vec2::new(0.0, 0.4), 0.0);
    for seq in 7..12 {
        hand.see(0, &SlipReport { seq, time_ns: feels(seq, Vec2::ZERO, 0.0).time_ns, ..still });
        hand.see(1, &feels(seq, Vec2::new(0.0, 0.4 + 0.001 * seq as f64), 0.0));
        let expected = if seq < 10 { Health::Live } else { Health::Frozen };
        assert_eq!(hand.report(33 * MS * seq).health[0], expected, "frame {seq}");
        assert_eq!(hand.report(33 * MS * seq).health[1], Health::Live);
    }
    hand.see(0, &feels(12, Vec2::new(0.0, 0.5), 0.0));
    assert_eq!(hand.report(33 * MS * 12).health[0], Health::Live, "it came back");

    let mut hand = two();
    let open = SlipReport { shear: None, state: SlipState::NoContact, ..still };
    for seq in 7..20 {
        hand.see(0, &SlipReport { seq, ..open });
    }
    assert_eq!(hand.report(0).health[0], Health::Live, "a finger that touches nothing measures nothing");
}

/// A loop faster than the cameras receives each frame several times.
#[test]
fn a_frame_that_comes_again_is_no_new_one() {
    let mut hand = two();
    let still = feels(7, Vec2::new(0.0, 0.4), 0.0);
    for seq in 7..12 {
        for _ in 0..3 {
            hand.see(0, &SlipReport { seq, time_ns: feels(seq, Vec2::ZERO, 0.0).time_ns, ..still });
        }
    }
    assert_eq!(hand.report(0).health[0], Health::Frozen, "three times the same frozen picture is frozen");
    let last = feels(12, Vec2::new(0.0, 0.5), 0.0);
    hand.see(0, &last);
    hand.missed(0);
    hand.see(0, &last);
    assert_eq!(hand.report(0).health[0], Health::Blind, "what was seen before it was missed brings nobody back");
}

/// Two cameras may use different frame numbers.
#[test]
fn the_hands_frame_is_the_one_that_came_last_whatever_its_number() {
    let mut hand = two();
    hand.see(0, &feels(5000, Vec2::new(0.0, 0.4), 0.0));
    assert_eq!(hand.report(0).seq, 5000);
    hand.see(1, &feels(10, Vec2::new(0.0, 0.4), 0.0));
    let report = hand.report(33 * MS);
    assert_eq!((report.live_count, report.seq, report.time_ns), (2, 10, Some(333_333_330)));
}

/// Allowed along the thread, not around it.
#[test]
fn slip_along_the_thread_is_let_pass_and_around_it_is_not() {
    let thread = Allowed { along: true, ..Allowed::default() };
    let right = std::f64::consts::FRAC_PI_2;
    let filtered = |direction_rad: f64| thread.filter(&fused(&slips(1, direction_rad), &slips(1, direction_rad)));
    assert_eq!(filtered(0.0).state, SlipState::Stick);
    assert_eq!(filtered(std::f64::consts::PI).state, SlipState::Stick);
    assert_eq!(filtered(right).state, SlipState::Incipient);
    assert_eq!(filtered(-right).state, SlipState::Incipient);
    assert_eq!(filtered(20f64.to_radians()).state, SlipState::Stick, "within 30 deg of the thread");
    assert_eq!(filtered(40f64.to_radians()).state, SlipState::Incipient);

    let mut pivoting = slips(1, 0.0);
    pivoting.slip.kind = Some(SlipKind::Rotation);
    pivoting.slip.direction_rad = None;
    let report = fused(&pivoting, &pivoting);
    assert_eq!(thread.filter(&report).state, SlipState::Incipient);
    assert_eq!(Allowed { pivot: true, ..thread }.filter(&report).state, SlipState::Stick);

    // The slip direction is unknown: no task allows that, and it does not indicate a touch.
    let mut unknown = pivoting;
    (unknown.state, unknown.slip.kind) = (SlipState::Gross, None);
    let report = fused(&unknown, &unknown);
    assert!(report.slip.is_some_and(|slip| !slip.pivots), "{report:?}");
    assert_eq!(Allowed { pivot: true, ..thread }.filter(&report).state, SlipState::Gross);
}

/// Clocks of cameras may start anywhere, and may be set.
#[test]
fn a_clock_at_either_end_of_its_range_is_a_new_clock() {
    let mut hand = two();
    for (cycle, time_ns) in [0, u64::MAX, 1, u64::MAX, u64::MAX / 2].into_iter().enumerate() {
        for finger in 0..2 {
            hand.see(finger, &SlipReport { time_ns: Some(time_ns), ..feels(cycle as u64, Vec2::new(0.1, 0.0), 0.0) });
        }
        assert_eq!(hand.report(33 * MS * (cycle as u64 + 1)).live_count, 2, "{time_ns}");
    }
}

#[test]
fn a_hand_has_one_to_four_fingers() {
    assert!(Hand::new(&[]).is_err());
    assert!(Hand::new(&[Mounting::on(Side::Left); 5]).is_err());
    let error = Hand::new(&[Mounting { side: Side::Left, turn_rad: f64::NAN }]).expect_err("NaN");
    assert_eq!(error.key, "hand.fingers.turn_rad");
}

#[test]
fn a_hand_that_is_to_hold_has_fingers_on_both_sides_or_one() {
    let check = |sides: &[Side]| check_sides(&sides.iter().copied().map(Mounting::on).collect::<Vec<_>>());
    for sides in [&[][..], &[Side::Left], &[Side::Right, Side::Left], &[Side::Left, Side::Left, Side::Right]] {
        assert_eq!(check(sides), Ok(()), "{sides:?}");
    }
    let told = check(&[Side::Right, Side::Right]).expect_err("one side").to_string();
    assert_eq!(told, "fingers[1].side: expected fingers on both sides, got `right` for all 2");
}

/// Two fingers with a frame every 33 ms; `frame` gives the report of each in a cycle, None for no frame.
fn watched(cycles_count: u64, frame: impl Fn(usize, u64) -> Option<SlipReport>) -> (Hand, HandReport) {
    let mut hand = two();
    let mut report = hand.report(0);
    for cycle in 1..=cycles_count {
        for finger in 0..2 {
            if let Some(frame) = frame(finger, cycle) {
                hand.see(finger, &frame);
            }
        }
        report = hand.report(33 * MS * cycle);
    }
    (hand, report)
}

#[test]
fn a_finger_without_new_frames_is_blind_after_a_tenth_of_a_second_and_pins_neither_number_nor_time() {
    let shows = |seq: u64| Some(feels(seq, Vec2::new(0.0, 0.4 + 0.001 * seq as f64), 0.0));
    for dead in [0, 1] {
        // No frame arrives, and this is not reported.
        let (_, report) = watched(1000, |finger, cycle| if finger == dead && cycle > 2 { None } else { shows(cycle) });
        assert_eq!((report.health[dead], report.live_count, report.seq), (Health::Blind, 1, 1000));
        assert_eq!(report.time_ns, Some(33_333_333 * 1000));
        // The same frame arrives again and again, and its number is the largest of all.
        let stuck = shows(5000).map(|frame| SlipReport { time_ns: Some(7), ..frame });
        let (_, report) = watched(1000, |finger, cycle| if finger == dead { stuck } else { shows(cycle) });
        assert_eq!((report.health[dead], report.health[1 - dead], report.seq), (Health::Blind, Health::Live, 1000));
    }
    // A tenth of a second is tolerated.
    let (mut hand, _) = watched(10, |_, cycle| shows(cycle));
    assert_eq!(hand.report(430 * MS).live_count, 2);
    let report = hand.report(431 * MS);
    assert_eq!((report.live_count, report.state, report.seq), (0, SlipState::Unjudged, 10));
}

/// A camera's clock that is set while its frames keep arriving is no lag, for either finger; nor is the drift during a
/// long absence.
#[test]
fn a_clock_that_is_set_or_drifts_while_its_finger_is_away_blinds_nobody() {
    for finger in [0, 1] {
        for step_ms in [-900i64, -300, -150, 150, 300, 900] {
            let shows = |at: usize, cycle: u64| {
                let set_ms = if at == finger && cycle >= 300 { step_ms } else { 0 };
                let time_ns = Some(5000 * MS + 33 * MS * cycle + 977 * at as u64)
                    .map(|ns| ns.wrapping_add_signed(set_ms * MS as i64));
                Some(SlipReport { time_ns, ..feels(cycle, Vec2::new(0.0, 0.4 + 0.001 * cycle as f64), 0.0) })
            };
            for cycles_count in [303, 320, 600] {
                let live_count = watched(cycles_count, shows).1.live_count;
                assert_eq!(live_count, 2, "finger {finger} by {step_ms} ms, after {cycles_count} cycles");
            }
        }
        // Absent for ten minutes; its clock gains 100 us per second.
        let away = |at: usize, cycle: u64| {
            let drift_ns = if at == finger { 33 * MS * cycle / 10_000 } else { 0 };
            let time_ns = Some(5000 * MS + 33 * MS * cycle + drift_ns);
            let frame = SlipReport { time_ns, ..feels(cycle, Vec2::new(0.0, 0.4 + 0.001 * cycle as f64), 0.0) };
            (at != finger || !(300..18_300).contains(&cycle)).then_some(frame)
        };
        assert_eq!(watched(18_400, away).1.live_count, 2, "finger {finger} was away");
    }
}

/// Three cameras, each with a clock of its own. The first one delivers nothing for a second; until then the others are
/// compared with each other.
#[test]
fn a_first_finger_that_wakes_late_is_compared_by_its_own_clock() {
    let sides = [Side::Left, Side::Right, Side::Left];
    let mut hand = Hand::new(&sides.map(Mounting::on)).expect("three fingers");
    for cycle in 0..90u64 {
        let now_ns = cycle * 33_333_333;
        for (finger, offset_ns) in [0, 7_000 * MS, 3_000 * MS].into_iter().enumerate() {
            match finger == 0 && cycle < 30 {
                true => hand.missed(0),
                false => hand.see(
                    finger,
                    &SlipReport {
                        time_ns: Some(now_ns + offset_ns),
                        ..feels(cycle, Vec2::new(0.01 * cycle as f64, finger as f64), 0.0)
                    },
                ),
            }
        }
        let expected_count = if cycle < 30 { 2 } else { 3 };
        let report = hand.report(now_ns);
        assert_eq!(report.live_count, expected_count, "cycle {cycle}: {:?}", report.health);
    }
}

/// The time of a torn frame may be of another clock; a frame that was late before is late after it.
#[test]
fn a_torn_frame_does_not_hide_that_its_finger_is_late() {
    for late in [0, 1] {
        let shows = |at: usize, cycle: u64| {
            let lag_ms = if at == late { (5 * cycle.saturating_sub(100)).min(300) } else { 0 };
            let time_ns = Some(1000 * MS + 33 * MS * cycle - lag_ms * MS);
            let frame = SlipReport { time_ns, ..feels(cycle, Vec2::new(0.0, 0.4 + 0.001 * cycle as f64), 0.0) };
            let torn = SlipReport { state: SlipState::Unjudged, time_ns: Some(1_700_000_000_000 * MS), ..frame };
            Some(if at == late && cycle.is_multiple_of(50) { torn } else { frame })
        };
        for cycles_count in [199, 201, 252, 340] {
            assert_eq!(watched(cycles_count, shows).1.health[late], Health::Blind, "finger {late}, {cycles_count}");
        }
        assert_eq!(watched(90, shows).1.live_count, 2, "not late yet");
    }
}

/// Frames that still arrive, but later and later: a queue that fills.
#[test]
fn a_finger_that_falls_behind_the_other_is_blind_whatever_their_clocks_say() {
    for late in [0, 1] {
        let run = |lag_ns: fn(u64) -> u64, offset_ns: u64| {
            watched(600, |finger, cycle| {
                let lag_ns = if finger == late { lag_ns(cycle) } else { 0 };
                let time_ns = Some(1000 * MS + 33 * MS * cycle + if finger == 1 { offset_ns } else { 0 } - lag_ns);
                Some(SlipReport { time_ns, ..feels(cycle, Vec2::new(0.0, 0.4 + 0.001 * cycle as f64), 0.0) })
            })
            .1
        };
        for offset_ns in [0, 3_600_000_000_000] {
            assert_eq!(run(|_| 0, offset_ns).live_count, 2, "clocks need not agree");
            assert_eq!(run(|cycle| cycle * 3300, offset_ns).live_count, 2, "nor run alike: 100 ppm");
            let behind = run(|cycle| cycle.saturating_sub(500) * 10 * MS, offset_ns);
            assert_eq!((behind.health[late], behind.health[1 - late]), (Health::Blind, Health::Live));
        }
        // Some of its first frames were late: 300 ms, then 10.
        assert_eq!(run(|cycle| if cycle < 4 { 300 * MS } else { 10 * MS }, 0).live_count, 2, "late at the start");
        // A camera that was plugged in again counts from 0.
        let again = watched(600, |finger, cycle| {
            let from = if finger == late && cycle > 300 { 300 } else { 0 };
            let time_ns = Some(33 * MS * (cycle - from));
            Some(SlipReport { time_ns, ..feels(cycle, Vec2::new(0.0, 0.4 + 0.001 * cycle as f64), 0.0) })
        });
        assert_eq!(again.1.live_count, 2);
    }
}

#[test]
fn of_two_live_fingers_one_that_touches_counts_once() {
    let away = SlipReport { shear: None, state: SlipState::NoContact, ..feels(1, Vec2::ZERO, 0.0) };
    let both = fused(&feels(1, Vec2::new(0.0, -0.4), 0.0), &feels(1, Vec2::new(0.0, 0.4), 0.0));
    let one = fused(&away, &feels(1, Vec2::new(0.0, 0.4), 0.0));
    assert!(both.separated && !one.separated);
    let (both_n, one_n) = (both.load_n(0.05).expect("contact"), one.load_n(0.05).expect("contact"));
    assert!((both_n - one_n).abs() < 1e-12, "{both_n} N and {one_n} N");
    // 25 deg from the thread counts as along it, for two fingers and for one alone.
    let thread = Allowed { along: true, ..Allowed::default() };
    let slipping = slips(1, 25f64.to_radians());
    for report in [fused(&slipping, &slipping), fused(&feels(1, Vec2::ZERO, 0.0), &slipping)] {
        let direction = report.slip.expect("slips").direction;
        assert!((direction.length() - 1.0).abs() < 1e-12 && (direction.along - 25f64.to_radians().cos()).abs() < 1e-12);
        assert_eq!(thread.filter(&report).state, SlipState::Stick);
    }
}

#[test]
fn directions_that_cancel_each_other_point_nowhere_and_are_none_that_is_allowed() {
    let report = fused(&slips(1, 0.0), &slips(1, std::f64::consts::PI - 0.01));
    assert_eq!(report.slip.expect("slips").direction, HandVector::default());
    for allowed in
        [Allowed { along: true, ..Allowed::default() }, Allowed { across: true, pivot: true, ..Allowed::default() }]
    {
        assert_eq!(allowed.filter(&report).state, SlipState::Incipient, "{allowed:?}");
    }
    let anything = Allowed { along: true, across: true, around: true, pivot: false };
    assert_eq!(anything.filter(&report).state, SlipState::Stick);
}

#[test]
fn one_bad_marker_a_finger_is_no_half_of_a_slip() {
    let bad = |over, needed| {
        let mut report = feels(1, Vec2::ZERO, 0.0);
        (report.slip.markers_over, report.slip.markers_needed) = (over, needed);
        report
    };
    assert_eq!(fused(&bad(1, 2), &bad(1, 2)).state, SlipState::Stick);
    assert_eq!(fused(&bad(2, 3), &bad(2, 3)).state, SlipState::Incipient);
}

/// The message is built in a separate workspace, whose tests are not run with these.
#[test]
fn the_ros_message_of_a_hand_has_the_fields_of_its_report() {
    let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../ros2/slipbound_msgs/msg/HandReport.msg"));
    let field = |line: &str| {
        let line = line.split('#').next()?.trim();
        let (_, name) = line.split_once(char::is_whitespace).filter(|_| !line.contains('='))?;
        Some(name.to_owned())
    };
    let mut of_message: BTreeSet<String> = text.lines().filter_map(field).collect();
    assert!(of_message.remove("header"));
    let json = serde_json::to_value(two().report(0)).expect("JSON");
    let of_report: BTreeSet<String> = json.as_object().expect("an object").keys().cloned().collect();
    assert_eq!(of_message, of_report);
}
