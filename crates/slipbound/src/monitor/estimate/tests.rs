//! Parts of step 6 on hand-made fields; against simulated physics: `slipbound-lab/tests/estimates.rs`.

use super::field::{FieldFacts, features};
use super::rigid_fit::{Point, fit};
use super::window::{Sample, Stretches, Window};
use super::*;
use crate::sensor::Shear;
use crate::sensor::tests::smooth;

mod cut;

/// A finger of 12 x 9 markers at 30 px, whose stiffness is 0.1 N per marker and pitch.
fn finger(scale: f64) -> (Sensor, Vec<Marker>) {
    let mut sensor = smooth();
    sensor.pitch_px *= scale;
    sensor.shear = Some(Shear { stiffness_n_per_pitch: 0.1, provenance: "made".into() });
    let place = |i: u32| Vec2::new(15.0 + 30.0 * f64::from(i % 12), 15.0 + 30.0 * f64::from(i / 12)) * scale;
    (sensor, (0..108).map(|id| Marker::at_rest(id, place(id))).collect())
}

const AREA_PX2: f64 = 25_000.0;

/// A disc in contact under a push along x that grows to `far_pitch`; its rim beyond `stick` of the radius follows by
/// half of that.
fn push(scale: f64, grip_n: Option<f64>, far_pitch: f64, stick: f64) -> Estimator {
    let (sensor, mut markers) = finger(scale);
    let middle = Vec2::new(180.0, 135.0) * scale;
    let mut estimator = Estimator::new(&sensor, &markers, false);
    for frame in 0..30u64 {
        let share = (frame.max(10) - 10) as f64 / 19.0;
        for m in &mut markers {
            let depth = (m.rest - middle).length() / (90.0 * scale);
            m.in_contact = depth < 1.0;
            let follows = if depth < stick {
                1.0
            } else if depth < 1.0 {
                0.5
            } else {
                0.0
            };
            m.now = m.rest + Vec2::new(far_pitch * share * follows * sensor.pitch_px, 0.0);
        }
        let grip = grip_n.map(|force_n| GripSample { force_n });
        estimator.see(Some(frame * 33_333_333), grip, AREA_PX2 * scale * scale, None, &markers);
    }
    estimator
}

#[test]
fn the_shipped_table_is_whole_and_a_torn_one_is_refused() {
    let text = include_str!("trees.txt");
    let trees = Trees::parse(text).expect("the table");
    assert!(trees.counts().iter().all(|count| *count >= 30), "{:?}", trees.counts());
    assert!(Trees::parse(&text[..text.len() - 40]).is_none(), "cut");
    assert!(Trees::parse(&text.replacen(':', ":x", 1)).is_none(), "a threshold that is no number");
    assert!(Trees::parse(&text.replacen("ensemble stick ", "ensemble stuck ", 1)).is_none());
}

#[test]
fn twice_the_pixels_change_no_feature() {
    let (small, large) = (push(1.0, Some(10.0), 0.6, 0.6), push(2.0, Some(10.0), 0.6, 0.6));
    let (small, large) = (small.features.expect("a contact"), large.features.expect("a contact"));
    for (name, (a, b)) in FEATURE_NAMES.iter().zip(small.iter().zip(large)) {
        assert!((a - b).abs() <= 1e-6 * (1.0 + a.abs()), "{name}: {a} and {b}");
    }
}

#[test]
fn the_load_is_the_sum_over_all_markers() {
    let estimator = push(1.0, Some(10.0), 0.6, 1.0);
    let pressed = estimator.points.len() as f64;
    let shear_n = estimator.estimates.shear_n.expect("stiffness known");
    assert!((shear_n.value - 0.1 * 0.6 * pressed).abs() < 1e-9, "{shear_n:?} of {pressed} markers");
    assert!(estimator.estimates.torque_nmm.expect("pitch known").value.abs() < 1e-6);
    assert!(estimator.estimates.friction.is_some());
}

#[test]
fn pull_and_turn_stand_to_each_other_as_shift_and_rotation_of_the_arm() {
    // A disc, and a strip with a smaller ratio of arm to lever; neither at the border of the view.
    for half in [Vec2::new(90.0, 90.0), Vec2::new(150.0, 20.0)] {
        let (sensor, mut markers) = finger(1.0);
        let middle = Vec2::new(180.0, 135.0);
        let mut estimator = Estimator::new(&sensor, &markers, false);
        let inside = |m: &Marker| {
            let from = m.rest - middle;
            (from.x / half.x).powi(2) + (from.y / half.y).powi(2) < 1.0
        };
        let distances: Vec<f64> = markers.iter().filter(|m| inside(m)).map(|m| (m.rest - middle).length()).collect();
        let arm_px = distances.iter().sum::<f64>() / distances.len() as f64;
        let (shift_px, turn_rad) = (6.0, -3.0 / arm_px);
        for frame in 0..30u64 {
            let share = (frame.max(10) - 10) as f64 / 19.0;
            for m in &mut markers {
                let from = m.rest - middle;
                m.in_contact = inside(m);
                let moved = Vec2::new(0.0, shift_px) + Vec2::new(-from.y, from.x) * turn_rad;
                m.now = if m.in_contact { m.rest + moved * share } else { m.rest };
            }
            let grip = Some(GripSample { force_n: 10.0 });
            estimator.see(Some(frame * 33_333_333), grip, AREA_PX2, None, &markers);
        }
        let (pull, turn) = estimator.pull_and_turn_px3();
        assert!((turn / pull.y + 0.5).abs() < 0.02, "{half:?}: {turn} beside {pull:?}");
    }
}

/// Reported and true torque, both N mm, of a disc that a press spreads and that then turns by `turn_rad` and is pulled,
/// while the middle of its region is `region_off_px` from the mean of its markers.
fn turned(spread: f64, turn_rad: f64, pull_px: Vec2, region_off_px: Vec2) -> (f64, f64) {
    let (sensor, mut markers) = finger(1.0);
    let (middle, mut torque) = (Vec2::new(180.0, 135.0), 0.0);
    let mut estimator = Estimator::new(&sensor, &markers, false);
    let per_px2 = 0.1 / 30.0 * sensor.mm_per_px().expect("pitch known");
    for frame in 0..60u64 {
        let (pressed, share) = ((frame as f64 / 4.0).min(1.0), (frame.max(10) - 10) as f64 / 49.0);
        torque = 0.0;
        for m in &mut markers {
            let from = m.rest - middle;
            m.in_contact = from.length() < 90.0;
            if m.in_contact {
                let spread = from * (1.0 + spread * pressed);
                let moved = (Vec2::new(-spread.y, spread.x) * turn_rad + pull_px) * share;
                m.now = middle + spread + moved;
                torque += per_px2 * (spread - region_off_px / 2.0).cross(moved);
            }
        }
        let (region, force_n) = (middle + pull_px * share + region_off_px, 10.0 * pressed);
        estimator.see(Some(frame * 33_333_333), Some(GripSample { force_n }), AREA_PX2, Some(region), &markers);
    }
    (estimator.estimates.torque_nmm.expect("stiffness known").value, torque)
}

#[test]
fn a_torque_is_that_of_the_gel_as_the_press_has_spread_it() {
    let ((flat, truth), (spread, spread_truth)) =
        (turned(0.0, 0.1, Vec2::ZERO, Vec2::ZERO), turned(0.1, 0.1, Vec2::ZERO, Vec2::ZERO));
    assert!((flat / truth - 1.0).abs() < 0.01, "{flat} N mm of {truth}");
    assert!((spread / spread_truth - 1.0).abs() < 0.01, "{spread} N mm of {spread_truth}");
    assert!(spread / flat > 1.15, "the square of the lever: {}", spread / flat);
}

#[test]
fn a_pull_makes_a_torque_about_the_mean_of_the_middles_of_markers_and_region() {
    let off = Vec2::new(0.0, 6.0);
    let ((told, truth), (straight, _)) =
        (turned(0.0, 0.0, Vec2::new(20.0, 0.0), off), turned(0.0, 0.0, Vec2::new(20.0, 0.0), Vec2::ZERO));
    assert!(straight.abs() < 0.01 * truth.abs(), "{straight} N mm where both are the same");
    assert!((told / truth - 1.0).abs() < 0.02, "{told} N mm of {truth}");
}

#[test]
fn a_load_that_begins_before_the_reading_of_the_grip_has_settled_is_no_squeeze() {
    let (sensor, mut markers) = finger(1.0);
    let mut estimator = Estimator::new(&sensor, &markers, false);
    for frame in 0..30u64 {
        // The squeeze is settled from frame 4 on, the gripper's reading from frame 6 on; loaded from frame 9 on.
        let pressed = (frame as f64 / 4.0).min(1.0);
        let force_n = 10.0 * (frame as f64 / 6.0).min(1.0);
        let shear_pitch = 0.02 * (frame.max(9) - 9) as f64;
        for m in &mut markers {
            let from_middle = m.rest - Vec2::new(180.0, 135.0);
            m.in_contact = from_middle.length() < 90.0;
            m.now = m.rest + from_middle * (0.01 * pressed) + Vec2::new(shear_pitch * 30.0, 0.0);
        }
        estimator.see(Some(frame * 33_333_333), Some(GripSample { force_n }), AREA_PX2, None, &markers);
    }
    let shear_n = estimator.estimates.shear_n.expect("stiffness known").value;
    // Markers at the border also represent the gel beyond it.
    let all_n = estimator.stiffness_n_per_px3.expect("known") * 0.4 * 30.0 * estimator.load.area_px2();
    assert!((shear_n / all_n - 1.0).abs() < 0.01, "{shear_n} of {all_n} N");
}

/// Share of markers that seem to have slipped after the grip falls from 10 N to 5 N while a pull displaces all of them
/// by `pull_pitch`; their squeeze does not change.
fn left_by_a_lighter_grip(pull_pitch: f64) -> f64 {
    let (sensor, mut markers) = finger(1.0);
    let mut estimator = Estimator::new(&sensor, &markers, false);
    for frame in 0..60u64 {
        let pulled = ((frame.max(15) - 15) as f64 / 10.0).min(1.0);
        let force_n = 10.0 - 5.0 * ((frame.max(30) - 30) as f64 / 20.0).min(1.0);
        for m in &mut markers {
            let from_middle = m.rest - Vec2::new(180.0, 135.0);
            m.in_contact = from_middle.length() < 90.0;
            let moved = from_middle * 0.1 + Vec2::new(pull_pitch * pulled * sensor.pitch_px, 0.0);
            m.now = if m.in_contact { m.rest + moved } else { m.rest };
        }
        estimator.see(Some(frame * 33_333_333), Some(GripSample { force_n }), AREA_PX2, None, &markers);
    }
    let slipped = FEATURE_NAMES.iter().position(|name| *name == "over_twentieth").expect("named");
    estimator.features.expect("a contact")[slipped]
}

#[test]
fn what_a_lighter_grip_leaves_at_the_rim_is_slip_only_under_a_load() {
    let [unloaded, hardly, loaded] = [0.0, 0.08, 0.6].map(left_by_a_lighter_grip);
    assert!(unloaded < 0.05 && hardly < 0.05, "{unloaded} {hardly}");
    assert!(loaded > 0.3, "what has slipped meanwhile is not forgotten: {loaded}");
}

#[test]
fn more_load_leaves_less_margin() {
    let margin = |far_pitch| push(1.0, Some(10.0), far_pitch, 0.6).estimates.margin.expect("a contact").value;
    let (light, heavy) = (margin(0.4), margin(1.2));
    assert!(light > heavy + 0.2, "{light} and {heavy}");
    let features = push(1.0, None, 0.6, 0.4).features.expect("a contact");
    assert!(features[GEOMETRIC_COUNT..].iter().all(|value| *value == 0.0), "no grip, no load over grip: {features:?}");
}

#[test]
fn a_harder_grip_holds_what_has_slipped_where_it_is() {
    let (_, mut markers) = finger(1.0);
    let mut estimator = push(1.0, Some(10.0), 0.6, 0.4);
    let middle = Vec2::new(180.0, 135.0);
    let residual = |estimator: &Estimator| estimator.features.expect("a contact")[0];
    let before = residual(&estimator);
    for m in &mut markers {
        let depth = (m.rest - middle).length() / 90.0;
        m.in_contact = depth < 1.0;
        let follows = if depth < 0.4 {
            1.0
        } else if depth < 1.0 {
            0.5
        } else {
            0.0
        };
        m.now = m.rest + Vec2::new(0.6 * follows * 30.0, 0.0);
    }
    for frame in 30..50u64 {
        estimator.see(Some(frame * 33_333_333), Some(GripSample { force_n: 10.0 }), AREA_PX2, None, &markers);
    }
    assert!((residual(&estimator) - before).abs() < 0.05 * before, "the same grip forgets nothing");
    for frame in 50..60u64 {
        estimator.see(Some(frame * 33_333_333), Some(GripSample { force_n: 14.0 }), AREA_PX2, None, &markers);
    }
    assert!(residual(&estimator) < 0.2 * before, "{} of {before}", residual(&estimator));
    let shear_n = estimator.estimates.shear_n.expect("known").value;
    assert!(shear_n > 0.1 * 0.3 * estimator.points.len() as f64, "the load stays: {shear_n}");
}

/// A disc whose rim has slipped under a pull, held with 20 N for a second and then with these readings; the margin
/// after each of them.
fn margins_of(readings_n: &[Option<f64>]) -> Vec<f64> {
    let (_, mut markers) = finger(1.0);
    let mut estimator = push(1.0, Some(20.0), 0.6, 0.4);
    for m in &mut markers {
        let depth = (m.rest - Vec2::new(180.0, 135.0)).length() / 90.0;
        m.in_contact = depth < 1.0;
        let follows = if depth < 0.4 { 1.0 } else { 0.5 };
        m.now = m.rest + if depth < 1.0 { Vec2::new(18.0 * follows, 0.0) } else { Vec2::ZERO };
    }
    let mut frame = 30u64;
    let mut see = |reading_n: Option<f64>| {
        let grip = reading_n.map(|force_n| GripSample { force_n });
        estimator.see(Some(frame * 33_333_333), grip, AREA_PX2, None, &markers);
        frame += 1;
        estimator.estimates.margin.expect("a contact").value
    };
    (0..10).for_each(|_| _ = see(Some(20.0)));
    readings_n.iter().map(|reading_n| see(*reading_n)).collect()
}

#[test]
fn a_wrong_reading_of_the_grip_forgets_no_slip_and_none_is_not_no_force() {
    let usual = margins_of(&[Some(20.0)])[0];
    for wrong_n in [0.0, -20.0, 14.0, 60.0] {
        let told = margins_of(&[&[Some(wrong_n)][..], &[Some(20.0); 20]].concat());
        // 14 N for one frame may be true, and then shows more of the friction.
        let most = if wrong_n == 14.0 { 0.05 } else { 0.001 };
        assert!((told[20] - usual).abs() < most, "{wrong_n} N: {} for {usual}", told[20]);
        assert!(wrong_n == 14.0 || (told[0] - usual).abs() < most, "{wrong_n} N: at once {} for {usual}", told[0]);
    }
    // A gripper that reads nothing but 0 N says nothing: by images alone.
    let (zeros, nothing) = (margins_of(&[Some(0.0); 30]), margins_of(&[None; 30]));
    assert_eq!(zeros, nothing);
    assert!(zeros.iter().all(|margin| (-0.2..=1.0).contains(margin)), "{zeros:?}");
}

/// Settled at 10 N, then gripped with 40 N, then without readings: the gel is squeezed as before.
#[test]
fn readings_that_fail_change_neither_squeeze_nor_load() {
    let (sensor, mut markers) = finger(1.0);
    let middle = Vec2::new(180.0, 135.0);
    let mut estimator = Estimator::new(&sensor, &markers, false);
    let (mut shears_n, mut lags) = (Vec::new(), Vec::new());
    for frame in 0..90u64 {
        let force_n = 10.0 + 3.0 * (frame.max(30) - 30).min(10) as f64;
        let times = libm::pow(force_n / 10.0, 0.85);
        for m in &mut markers {
            m.in_contact = (m.rest - middle).length() < 90.0;
            // The squeeze is not the same on both sides.
            let squeeze = (m.rest - middle) * 0.03 + Vec2::new(0.6, 0.0);
            m.now = if m.in_contact { m.rest + squeeze * times } else { m.rest };
        }
        let grip = (frame < 60).then_some(GripSample { force_n });
        estimator.see(Some(frame * 33_333_333), grip, AREA_PX2, None, &markers);
        shears_n.push(estimator.estimates.shear_n.map(|shear_n| shear_n.value));
        lags.push(estimator.features.map(|features| features[0]));
    }
    let (with_n, without_n) = (shears_n[59].expect("settled"), shears_n[89].expect("settled"));
    assert!((with_n - without_n).abs() < 0.01, "{with_n} and {without_n} N");
    let (with, without) = (lags[59].expect("settled"), lags[89].expect("settled"));
    assert!((with - without).abs() < 0.001, "{with} and {without}");
}

/// A camera three times as fast as the gripper.
#[test]
fn frames_between_two_readings_have_the_grip_of_the_last_one() {
    let taken = |is_read: fn(u64) -> bool| {
        let (sensor, mut markers) = finger(1.0);
        let mut estimator = Estimator::new(&sensor, &markers, false);
        let mut taken_at = None;
        for frame in 0..120u64 {
            // The area stands from the first frame on; the force is reached after half a second.
            let force_n = 20.0 * (frame as f64 / 45.0).min(1.0);
            for m in &mut markers {
                let from_middle = m.rest - Vec2::new(180.0, 135.0);
                m.in_contact = from_middle.length() < 90.0;
                m.now = m.rest + from_middle * (0.001 * force_n);
            }
            let grip = is_read(frame).then_some(GripSample { force_n });
            estimator.see(Some(frame * 11_111_111), grip, AREA_PX2, None, &markers);
            if estimator.has_reference() && taken_at.is_none() {
                taken_at = Some(frame);
            }
        }
        (taken_at.expect("taken"), estimator.reference.taken_grip_n().expect("known"))
    };
    let ((all_at, all_n), (some_at, some_n)) = (taken(|_| true), taken(|frame| frame.is_multiple_of(3)));
    assert!(
        some_at.abs_diff(all_at) <= 4 && (some_n - all_n).abs() < 0.3,
        "{some_at} for {all_at}, {some_n} for {all_n}"
    );
}

#[test]
fn a_squeeze_is_no_load_and_grows_with_the_grip() {
    let (sensor, mut markers) = finger(1.0);
    let middle = Vec2::new(180.0, 135.0);
    let mut estimator = Estimator::new(&sensor, &markers, false);
    for frame in 0..60u64 {
        // 10 N, then in steps of 1 N to 20 N.
        let force_n = 10.0 + (frame.max(30) - 30).min(10) as f64;
        let spread = 0.03 * libm::pow(force_n / 10.0, 0.85);
        for m in &mut markers {
            m.in_contact = (m.rest - middle).length() < 90.0;
            m.now = m.rest + (m.rest - middle) * spread;
        }
        estimator.see(Some(frame * 33_333_333), Some(GripSample { force_n }), AREA_PX2, None, &markers);
    }
    let margin = estimator.estimates.margin.expect("settled").value;
    assert!(margin > 0.85, "{margin}");
    assert!(estimator.estimates.shear_n.expect("known").value < 0.05);
}

/// Features of a squeezed contact that moves over the gel, or drags the gel along, in two thirds of a second; its
/// middle is known or not.
fn moved(by_px: Vec2, drags: bool, told: bool) -> Features {
    let (sensor, mut markers) = finger(1.0);
    let mut estimator = Estimator::new(&sensor, &markers, false);
    for frame in 0..60u64 {
        let by = by_px * ((frame.max(20) - 20) as f64 / 20.0).min(1.0);
        let (dragged, rolled) = if drags { (by, Vec2::ZERO) } else { (Vec2::ZERO, by) };
        let middle = Vec2::new(165.0, 135.0) + rolled;
        for m in &mut markers {
            let from_middle = m.rest - middle;
            m.in_contact = from_middle.length() < 80.0;
            let squeeze = from_middle * (0.1 * (-from_middle.length_squared() / 5000.0).exp());
            m.now = m.rest + squeeze + if m.in_contact { dragged } else { Vec2::ZERO };
        }
        let middle_px = told.then_some(middle + dragged);
        estimator.see(Some(frame * 33_333_333), Some(GripSample { force_n: 10.0 }), AREA_PX2, middle_px, &markers);
    }
    estimator.features.expect("a contact")
}

#[test]
fn a_contact_that_rolls_leaves_no_slip_behind_and_one_that_drags_the_gel_along_has_not_rolled() {
    let slip = FEATURE_NAMES.iter().position(|name| *name == "residual_shear").expect("named");
    let roll = Vec2::new(45.0, 20.0);
    let (with, without) = (moved(roll, false, true)[slip], moved(roll, false, false)[slip]);
    assert!(with < 0.6 * without, "{with} and {without}");
    assert_eq!(moved(roll, true, true), moved(roll, true, false));
}

#[test]
fn the_fit_goes_on_from_those_that_stuck() {
    // Two thirds slip together: without an earlier motion the fit follows them; with one it stays with the sticking
    // markers.
    let point = |i: u32| {
        let rest = Vec2::new(f64::from(i % 6) * 30.0, f64::from(i / 6) * 30.0);
        let moved = if i.is_multiple_of(3) { 20.0 } else { 2.0 };
        Point { id: i, rest, displacement: Vec2::new(moved, 0.0), ..Point::default() }
    };
    let points: Vec<Point> = (0..36).map(point).collect();
    let stuck = RigidMotion { reference: Vec2::ZERO, translation: Vec2::new(19.5, 0.0), rotation_rad: 0.0 };
    let goes_on = fit(&points, Some(&stuck), 30.0).expect("points");
    assert!((goes_on.displacement(Vec2::ZERO).x - 20.0).abs() < 1.0, "{goes_on:?}");
    let anew = fit(&points, None, 30.0).expect("points");
    assert!((anew.displacement(Vec2::new(75.0, 130.0)).x - 2.0).abs() < 1.0, "{anew:?}");
}

#[test]
fn a_window_knows_a_change_only_once_it_is_full() {
    let mut window = Window::new();
    for i in 0..14u32 {
        let grip_n = Some(if i < 6 { 10.0 + f64::from(i) } else { 16.0 });
        window.push(Sample { at_s: f64::from(i) / 30.0, grip_n, ..Sample::default() });
        let change = window.change(|s| s.grip_n);
        assert_eq!(change.is_some(), i >= 5, "frame {i}");
        if i == 5 {
            assert_eq!(change, Some((3.0, 12.5)));
        }
    }
    assert_eq!(window.change(|s| s.grip_n), Some((0.0, 16.0)));
    assert!(window.oldest().expect("some").at_s > 0.15, "what is older than 0.18 s is forgotten");
}

#[test]
fn a_patch_at_the_border_is_called_cut() {
    let point =
        |i: u32| Point { id: i, rest: Vec2::new(f64::from(i) * 10.0, 5.0), radius: f64::from(i), ..Point::default() };
    let mut points: Vec<Point> = (0..10).map(point).collect();
    let facts = FieldFacts {
        pitch_px: 30.0,
        area_px2: 900.0,
        hidden_fraction: 0.0,
        drag_width_px: 38.0,
        force_px3: Vec2::ZERO,
        moment_px4: 0.0,
        stiffness_over_grip_per_px3: None,
        inside: (Vec2::new(25.0, 0.0), Vec2::new(1000.0, 1000.0)),
        before: None,
        stiffest_px2: 0.0,
    };
    let still = RigidMotion { reference: Vec2::ZERO, translation: Vec2::ZERO, rotation_rad: 0.0 };
    let learned = features(&mut points, &still, &facts, &mut Stretches::default(), &mut [0.0; 10]);
    let cut = FEATURE_NAMES.iter().position(|name| *name == "cut").expect("named");
    assert!((learned.features[cut] - 0.3).abs() < 1e-12, "{:?}", learned.features);
    assert!(learned.features.iter().all(|value| value.is_finite()));
}

#[test]
fn the_tangent_is_that_of_the_last_stretch_and_stays_while_nothing_moves() {
    let mut stretches = Stretches::default();
    assert_eq!(stretches.see(100.0, 0.3, 0.5), None, "less than noise");
    let mut tangent = 0.0;
    for step in 1..=40 {
        let rigid_px = f64::from(step);
        // 100 px2 up to 20 px, 20 px2 from there on.
        let load_px3 = 100.0 * rigid_px.min(20.0) + 20.0 * (rigid_px - 20.0).max(0.0);
        tangent = stretches.see(load_px3, rigid_px, 0.5).expect("it moves");
        if step <= 20 {
            assert!((tangent - 100.0).abs() < 1e-9, "{step}: {tangent}");
        }
    }
    assert!((tangent - 20.0).abs() < 1e-9, "what was before the last fifths is forgotten: {tangent}");
    for frame in 0..100 {
        let jitter_px = 0.1 * f64::from(frame % 3 - 1);
        let held = stretches.see(2400.0 + 10.0 * jitter_px, 40.0 + jitter_px, 0.5).expect("it has moved");
        assert!((held - tangent).abs() < 2.0, "frame {frame}: {held}");
    }
    stretches.restart(2000.0, 30.0);
    assert_eq!(
        stretches.see(2010.0, 30.1, 0.5).map(|t| (t - tangent).abs() < 2.0),
        Some(true),
        "a new grip tells nothing"
    );
    let stiff = stretches.see(2100.0, 31.0, 0.5).expect("moved on");
    assert!((stiff - 100.0).abs() < 1e-9, "counts from the new grip: {stiff}");
}

#[test]
fn motion_is_told_from_standing() {
    let moving = FEATURE_NAMES.iter().position(|name| *name == "moving").expect("named");
    let tangent = FEATURE_NAMES.iter().position(|name| *name == "tangent").expect("named");
    let (sensor, mut markers) = finger(1.0);
    let middle = Vec2::new(180.0, 135.0);
    let mut estimator = Estimator::new(&sensor, &markers, false);
    let mut seen = [[0.0; FEATURES_COUNT]; 60];
    for frame in 0..60u64 {
        // Settles, is pulled from frame 20 to 40, then stands still.
        let pulled_px = (frame.clamp(20, 40) - 20) as f64 * 0.6;
        for m in &mut markers {
            m.in_contact = (m.rest - middle).length() < 90.0;
            m.now = m.rest + Vec2::new(if m.in_contact { pulled_px } else { 0.0 }, 0.0);
        }
        estimator.see(Some(frame * 33_333_333), Some(GripSample { force_n: 10.0 }), AREA_PX2, None, &markers);
        seen[frame as usize] = estimator.features.unwrap_or([0.0; FEATURES_COUNT]);
    }
    // The pace of the pull does not show: three frames after its begin as at its end.
    assert!(
        seen[38][moving] == seen[23][moving] && seen[38][moving] > 0.0,
        "{} {}",
        seen[23][moving],
        seen[38][moving]
    );
    assert!(seen[55][moving].abs() < 1e-9, "{}", seen[55][moving]);
    let (pulled, stood) = (seen[40][tangent], seen[55][tangent]);
    assert!(pulled > 0.1 && (stood / pulled - 1.0).abs() < 0.05, "{pulled}, then {stood}");
}

#[test]
fn a_new_contact_has_no_pull_of_the_last() {
    let mut estimator = push(1.0, Some(10.0), 0.6, 0.6);
    assert!(estimator.pull_and_turn_px3().0.length() > 0.0);
    estimator.clear();
    assert_eq!(estimator.pull_and_turn_px3(), (Vec2::ZERO, 0.0));
}
