//! Contacts that the view cuts: load, lever and features of what is out of view.

use super::*;
use crate::image::SizePx;

/// Estimates of a contact that the view cuts.
struct Cut {
    load_n: f64,
    hidden_px2: f64,
    /// Largest change of the load in a frame while a border marker enters and leaves contact.
    jump_n: f64,
    cut_fraction: f64,
    /// The features of these names.
    mean_shear: f64,
    hidden: f64,
}

/// A contact over the columns of markers from `first` on, pushed along x by 12 px for two seconds.
fn cut_by_the_view(gel_mm: Option<[f64; 2]>, first: u32) -> Cut {
    let (mut sensor, mut markers) = finger(1.0);
    (sensor.image_px, sensor.gel_mm) = (SizePx::new(360, 270), gel_mm);
    let mut estimator = Estimator::new(&sensor, &markers, true);
    let mut jump_n = 0.0f64;
    let mut last_n = None;
    for frame in 0..60u64 {
        for m in &mut markers {
            m.in_contact = m.id % 12 >= first && !(frame > 30 && m.id == 11 && frame % 2 == 0);
            m.now = m.rest + Vec2::new(if m.id % 12 >= first { 12.0 } else { 0.0 }, 0.0);
        }
        estimator.see(Some(frame * 33_333_333), Some(GripSample { force_n: 20.0 }), AREA_PX2, None, &markers);
        let now_n = estimator.estimates.shear_n.expect("stiffness known").value;
        if frame > 30 {
            jump_n = jump_n.max((now_n - last_n.unwrap_or(now_n)).abs());
            last_n = Some(now_n);
        }
    }
    let features = estimator.features.expect("a contact");
    let feature = |name| features[FEATURE_NAMES.iter().position(|known| *known == name).expect("named")];
    Cut {
        load_n: last_n.expect("frames"),
        hidden_px2: estimator.load.hidden_px2(),
        jump_n,
        cut_fraction: estimator.estimates.cut_fraction,
        mean_shear: feature("mean_shear"),
        hidden: feature("hidden"),
    }
}

#[test]
fn a_contact_that_the_view_cuts_goes_on_to_where_the_gel_ends() {
    // 0.1 N per marker and pitch of 30 px; the view of 360 x 270 px is 18 x 13.5 mm.
    let n_per_px2 = 0.1 * (12.0 / 30.0) / (30.0 * 30.0);
    let all = cut_by_the_view(Some([25.0, 20.0]), 0);
    let gel_px2 = (25.0 * 20.0) / (0.05 * 0.05);
    assert!((all.load_n / (n_per_px2 * gel_px2) - 1.0).abs() < 0.05, "{} N of {}", all.load_n, n_per_px2 * gel_px2);
    assert!((all.hidden_px2 / (gel_px2 - 360.0 * 270.0) - 1.0).abs() < 0.08, "{} px2", all.hidden_px2);
    assert!(all.jump_n < 0.05 * all.load_n, "a marker of the border that is in and out of contact: {} N", all.jump_n);
    // 38 of 108 markers are at the border.
    assert!((all.cut_fraction - 38.0 / 108.0).abs() < 0.01, "{}", all.cut_fraction);
    let free = cut_by_the_view(None, 0);
    assert!(free.load_n < 0.8 * all.load_n, "the length of the gel is not known: {} N", free.load_n);
    assert_eq!((free.hidden_px2, free.hidden, free.cut_fraction), (0.0, 0.0, all.cut_fraction));
    // The features are those of the whole contact, not of its visible part.
    let whole = (AREA_PX2 + all.hidden_px2) / AREA_PX2;
    assert!((all.mean_shear / free.mean_shear / whole - 1.0).abs() < 1e-6, "{} {}", all.mean_shear, free.mean_shear);
    assert!((all.hidden - (1.0 - 1.0 / whole)).abs() < 1e-9, "{}", all.hidden);
    // In contact over the right half only: the left border represents free gel, which does not move.
    let half = cut_by_the_view(Some([25.0, 20.0]), 6);
    assert!((half.load_n / all.load_n - 0.5).abs() < 0.03, "{} N", half.load_n);
    assert!((half.hidden_px2 / all.hidden_px2 - 0.5).abs() < 0.05, "{} px2", half.hidden_px2);
    // A gel that ends within the view has nothing beyond it.
    let small = cut_by_the_view(Some([10.0, 10.0]), 0);
    assert!(small.hidden_px2 == 0.0 && small.load_n <= free.load_n, "{} {}", small.load_n, small.hidden_px2);
}

/// Mean distance of a rectangle, px, from a point.
fn mean_radius_px(low: Vec2, high: Vec2, about: Vec2) -> f64 {
    let step = (high - low) / 200.0;
    let at = |i: usize| low + Vec2::new(step.x * ((i % 200) as f64 + 0.5), step.y * ((i / 200) as f64 + 0.5));
    (0..40_000).map(|i| (at(i) - about).length()).sum::<f64>() / 40_000.0
}

/// [`Load::lever_gain`] of a contact over the columns of markers from `first` on, and over the rows up to `last`; and the
/// point it is about, px.
fn lever_gain_of(gel_mm: Option<[f64; 2]>, first: u32, last: u32) -> (f64, Vec2) {
    let (mut sensor, mut markers) = finger(1.0);
    (sensor.image_px, sensor.gel_mm) = (SizePx::new(360, 270), gel_mm);
    markers.iter_mut().for_each(|m| m.in_contact = m.id % 12 >= first && m.id / 12 <= last);
    let mut load = Load::new(&sensor, &markers, 0.0, (Vec2::new(33.0, 33.0), Vec2::new(327.0, 237.0)));
    (0..60).for_each(|_| load.sum(0.1, &markers));
    let touched: Vec<Vec2> = markers.iter().filter(|m| m.in_contact).map(|m| m.rest).collect();
    let about = touched.iter().fold(Vec2::ZERO, |sum, place| sum + *place) / touched.len() as f64;
    (load.lever_gain(&markers, about), about)
}

#[test]
fn a_contact_that_the_view_cuts_holds_torque_out_of_view() {
    let gel_mm = Some([25.0, 20.0]);
    let (all, middle) = lever_gain_of(gel_mm, 0, 8);
    // The view is of 360 x 270 px, the gel of 500 x 400.
    let of = |x: f64, y: f64| mean_radius_px(middle - Vec2::new(x, y), middle + Vec2::new(x, y), middle);
    let expected = of(250.0, 200.0) / of(180.0, 135.0);
    assert!((all / expected - 1.0).abs() < 0.03 && expected > 1.3, "{all} for {expected}");
    let (half, about) = lever_gain_of(gel_mm, 6, 8);
    let whole_px = mean_radius_px(Vec2::new(180.0, 134.5 - 200.0), Vec2::new(179.5 + 250.0, 134.5 + 200.0), about);
    let seen_px = mean_radius_px(Vec2::new(180.0, 0.0), Vec2::new(360.0, 270.0), about);
    assert!((half / (whole_px / seen_px) - 1.0).abs() < 0.05, "{half} for {}", whole_px / seen_px);
    assert_eq!(lever_gain_of(None, 0, 8).0, 1.0, "where the gel ends is not known");
    assert_eq!(lever_gain_of(gel_mm, 12, 8).0, 1.0, "no contact");
    // At the same friction, torque grows with the lever and a pull does not.
    let (sensor, markers) = finger(1.0);
    let estimator = Estimator::new(&sensor, &markers, true);
    let gain = |force: f64, turning: f64, lever_gain: f64| {
        let (force_px3, load_px3) = (Vec2::new(force, 0.0), libm::hypot(force, turning));
        let seen = FrameLoad { force_px3, torque_px4: 0.0, load_px3, middle, lever_gain, area_px2: AREA_PX2 };
        estimator.gain(1.0, 1.0, &seen)
    };
    assert!((gain(0.0, 7.0, 1.5) - 1.5).abs() < 1e-9 && (gain(7.0, 0.0, 1.5) / gain(7.0, 0.0, 1.0) - 1.0).abs() < 1e-9);
    let both = 5.0 / libm::hypot(3.0, 4.0 / 1.5);
    assert!((gain(3.0, 4.0, 1.5) / gain(3.0, 4.0, 1.0) - both).abs() < 1e-9);
}

/// All markers move equally; those of the right column are whole, then cut by the border, then lost.
#[test]
fn a_column_that_leaves_the_view_is_not_missing_from_the_load() {
    for gel_mm in [None, Some([25.0, 20.0])] {
        let (mut sensor, mut markers) = finger(1.0);
        (sensor.image_px, sensor.gel_mm) = (SizePx::new(360, 270), gel_mm);
        let mut estimator = Estimator::new(&sensor, &markers, true);
        let mut told_n = Vec::new();
        for frame in 0..90u64 {
            for m in &mut markers {
                let leaves = m.id % 12 == 11;
                (m.in_contact, m.now) = (true, m.rest + Vec2::new(12.0, 0.0));
                (m.whole, m.matched) = (!leaves || frame < 30, !leaves || frame < 60);
            }
            estimator.see(Some(frame * 33_333_333), Some(GripSample { force_n: 20.0 }), AREA_PX2, None, &markers);
            told_n.push(estimator.estimates.shear_n.expect("stiffness known").value);
        }
        assert!((told_n[59] / told_n[29] - 1.0).abs() < 0.01, "{gel_mm:?}: {} N of {} N", told_n[59], told_n[29]);
        assert!((told_n[89] / told_n[59] - 1.0).abs() < 0.01, "{gel_mm:?}: {} N of {} N", told_n[89], told_n[59]);
    }
}
