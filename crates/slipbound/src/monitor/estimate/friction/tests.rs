//! Friction from hand-made frames: what is estimated, kept and discarded.

use super::*;

fn used(value: f64) -> Estimate {
    Estimate { value, sd: 0.1, age_frames: 0 }
}

/// A frame of this load, and the standard deviation of its log used fraction.
fn shown(per_grip: f64, grip_n: f64, log_used_sd: f64) -> FrictionSample {
    FrictionSample { at_s: 0.0, per_grip, grip_n, gain: 1.0, imprint_slides: false, log_used_sd }
}

/// Loaded up to a used fraction of 0.8 at 10 N.
fn loaded(mu: f64) -> Friction {
    let mut friction = Friction::default();
    for step in 1..=24 {
        let f = f64::from(step) / 30.0;
        friction.see(&shown(mu * f, 10.0, (0.55 - 0.55 * f).max(0.1)), used(f));
    }
    friction
}

/// Friction after a frame with this used fraction.
fn told(friction: &mut Friction, shown: &FrictionSample, fraction: f64) -> f64 {
    friction.see(shown, used(fraction)).0.expect("told").value
}

#[test]
fn it_is_load_over_grip_over_what_is_used_of_it_and_who_knows_it_better_counts_for_more() {
    let after = |frames: &[(f64, f64, f64)]| {
        let mut friction = Friction::default();
        let see = |&(per_grip, f, sd): &(f64, f64, f64)| friction.see(&shown(per_grip, 10.0, sd), used(f)).0;
        frames.iter().map(see).last().flatten()
    };
    assert_eq!(
        after(&[(0.0, 0.02, 0.6), (0.1, 0.2, 0.54)]),
        None,
        "nothing pulls, or all of it is what any contact has"
    );
    assert_eq!(after(&[(0.4, 0.5, 0.2)]), None, "one frame is not enough");
    let first = after(&[(0.4, 0.5, 0.1)]).expect("told");
    assert!((0.65..0.8).contains(&first.value) && first.sd < 0.4 * first.value, "between any and 0.8: {first:?}");
    let long = after(&[(0.4, 0.5, 0.1); 60]).expect("told");
    assert!((long.value - 0.76).abs() < 0.03 && long.sd < 0.2 * 0.8, "{long:?}");
    let [worse, better] = [0.3, 0.04].map(|sd| after(&[(0.4, 0.5, 0.1), (0.4, 0.8, sd)]).expect("told"));
    assert!(worse.value > 0.6 && better.value < 0.55 && better.sd < worse.sd, "{worse:?} {better:?}");
    let quick = after(&[(0.1, 0.2, 0.3), (0.2, 0.4, 0.3), (0.3, 0.6, 0.3)]).expect("told");
    let slow = after(&[(0.29, 0.58, 0.3), (0.29, 0.58, 0.3), (0.3, 0.6, 0.3)]);
    assert!(
        quick.sd < 0.3 && slow.is_none(),
        "as the load grows every frame tells something of its own: {quick:?} {slow:?}"
    );
    let by_and_by: Vec<_> = (0..12).map(|step| 0.2 * 1.04f64.powi(step)).map(|load| (load, 2.0 * load, 0.3)).collect();
    let by_and_by = after(&by_and_by).expect("told");
    assert!(by_and_by.sd < 0.22 * by_and_by.value, "so does every third of a load that grows slowly: {by_and_by:?}");
    let mut deep_friction = Friction::default();
    let deep = FrictionSample { gain: 1.25, ..shown(0.5, 10.0, 0.1) };
    let deep = (0..60).filter_map(|_| deep_friction.see(&deep, used(0.5)).0).last().expect("frames");
    assert!((deep.value - 0.76).abs() < 0.03, "{deep:?}");
}

#[test]
fn what_hardly_pulls_tells_nothing_however_long_it_stands() {
    let mut friction = Friction::default();
    for frame in 0..600 {
        let noise = 0.001 + 0.0005 * f64::from(frame % 3);
        // Below the loads of their fit, trees return the smallest value they know, with its standard deviation.
        assert_eq!(friction.see(&shown(noise, 20.0, 0.5), used(0.04)).0, None, "frame {frame}");
    }
    let told = (0..60).map(|_| friction.see(&shown(0.4, 20.0, 0.1), used(0.5)).0).last().flatten();
    assert!(told.is_some_and(|told| (told.value - 0.77).abs() < 0.05), "{told:?}");
}

#[test]
fn a_frame_that_knows_less_than_is_known_of_any_contact_is_not_believed() {
    let said = |sd: f64| Friction::default().see(&shown(0.1, 10.0, sd), used(0.8)).1.value;
    assert!((said(0.3) - 0.8).abs() < 1e-9 && (said(0.53) - 0.8).abs() < 1e-9, "it knows something");
    // By the prior, a load of 0.1 uses 0.196.
    assert!(said(0.8) < 0.4 && said(0.8) > said(1.6) && said(1.6) > 0.196, "{} {}", said(0.8), said(1.6));
    let memory = loaded(0.8).information;
    let mut friction = loaded(0.8);
    friction.see(&shown(0.1, 10.0, 0.8), used(0.8));
    assert!(friction.information <= memory, "nor does it tell anything");
}

#[test]
fn what_leans_towards_any_contact_is_not_taken_for_a_slippery_one() {
    // A rough contact at a tenth of the load it holds: a frame estimates a sixth, as by the prior, and hardly more
    // surely.
    let mut friction = Friction::default();
    for _ in 0..60 {
        friction.see(&shown(0.09, 10.0, 0.5), used(0.16));
    }
    let (told, _) = friction.see(&shown(0.9, 10.0, 0.1), used(0.9));
    assert!(told.is_some_and(|told| told.value > 0.7), "one frame that knows outweighs them: {told:?}");
    // Many frames that are biased half way to the prior still give the friction.
    let mut friction = Friction::default();
    let leans = |mu: f64| (PRIOR_LOG_MU + mu.ln()) / 2.0;
    let mut rough = 0.0;
    for _ in 0..200 {
        let lean = (0.5f64).ln() - leans(1.0);
        rough = friction.see(&shown(0.5, 10.0, 0.38), used(lean.exp())).0.map_or(0.0, |told| told.value);
    }
    assert!((rough - 1.0).abs() < 0.1, "{rough}");
}

#[test]
fn what_frames_near_the_slide_told_is_not_forgotten_over_many_that_tell_little() {
    let mut friction = loaded(0.8);
    // Unloaded to a quarter; a frame then estimates medium friction for any contact.
    let kept = (0..90).map(|_| told(&mut friction, &shown(0.2, 10.0, 0.5), 0.45)).last().expect("frames");
    assert!((0.68..=0.82).contains(&kept), "{kept}");
}

#[test]
fn a_frame_that_only_stands_there_tells_nothing_anew() {
    let [moving, standing] = [0, 3].map(|age_frames| {
        let mut friction = loaded(0.5);
        let stands = Estimate { age_frames, ..used(0.5) };
        (0..90).map(|_| friction.see(&shown(0.4, 10.0, 0.2), stands).0.expect("told").value).last()
    });
    assert!(moving > Some(0.65) && standing < Some(0.53), "{moving:?} {standing:?}");
}

#[test]
fn what_holds_a_load_has_the_friction_for_it() {
    let mut friction = loaded(0.4);
    let held = told(&mut friction, &shown(0.9, 10.0, 0.2), 0.6);
    assert!(held >= 0.85, "{held}");
    let after = told(&mut friction, &shown(0.2, 10.0, 0.2), 0.5);
    assert!((after - 0.4).abs() < 0.07, "a reading that was half of the grip is forgotten: {after}");
    let indented = told(&mut loaded(0.4), &FrictionSample { gain: 1.5, ..shown(0.9, 10.0, 0.2) }, 0.6);
    assert!((0.56..0.65).contains(&indented), "the far side bears a third of it: {indented}");
}

#[test]
fn right_after_a_regrip_a_frame_says_nothing_and_soon_it_counts_beside_what_was_known() {
    let mut friction = loaded(0.5);
    friction.see(&shown(0.3, 12.0, 0.2), used(0.6));
    friction.regripped();
    let (told, now) = friction.see(&shown(0.3, 12.0, 0.3), used(0.2));
    assert!((now.value - 0.6).abs() < 0.05, "its field is empty: {now:?}");
    let told = told.expect("told");
    assert!((told.value - 0.5).abs() < 0.04, "{told:?}");
    assert!((now.sd / now.value - told.sd / told.value).abs() < 1e-9, "as sure as the friction: {now:?} {told:?}");
    let later = FrictionSample { at_s: 0.3, ..shown(0.3, 12.0, 0.3) };
    let now = friction.see(&later, used(0.3)).1;
    assert!((0.35..0.58).contains(&now.value) && now.sd < 0.1, "between both, and surer than each: {now:?}");
    let sure = friction.see(&FrictionSample { at_s: 0.3, ..shown(0.3, 12.0, 0.01) }, used(0.9)).1;
    assert!((sure.value - 0.9).abs() < 0.02, "what a frame is sure of counts: {sure:?}");
}

#[test]
fn a_second_tells_as_much_at_every_frame_rate() {
    let after_a_second = |frames_per_s: u32| {
        let mut friction = Friction::default();
        let frames = (0..frames_per_s).map(|i| {
            let at_s = f64::from(i) / f64::from(frames_per_s);
            friction.see(&FrictionSample { at_s, ..shown(0.2, 20.0, 0.4) }, used(0.5)).0
        });
        frames.last().flatten().expect("told")
    };
    let usual = after_a_second(30);
    for frames_per_s in [10, 90, 240] {
        let told = after_a_second(frames_per_s);
        assert!((told.sd / usual.sd - 1.0).abs() < 0.15, "{frames_per_s} Hz: {told:?}, at 30 {usual:?}");
    }
}

#[test]
fn a_hand_that_opens_tells_of_no_friction_that_there_is_not() {
    let mut friction = Friction::default();
    let frames = (0..60).map(|i| {
        let grip_n = if i < 45 { 20.0 } else { 0.1 };
        let shown = FrictionSample { at_s: f64::from(i) / 30.0, ..shown(2.0 / grip_n, grip_n, 0.3) };
        friction.see(&shown, used(0.5)).0
    });
    let most = frames.flatten().map(|told| told.value).fold(0.0, f64::max);
    assert!((0.4..=MOST_FRICTION).contains(&most), "{most}");
}

#[test]
fn what_letting_go_leaves_in_the_field_is_not_taken_for_slip() {
    // Pressed, pulled a little, and released to a tenth: the field of the large contact remains, and looks like half of
    // the friction.
    let mut friction = Friction::default();
    for _ in 0..60 {
        friction.see(&shown(0.06, 60.0, 0.2), used(0.1));
    }
    let (_, carried) = { friction }.see(&FrictionSample { at_s: 1.0, ..shown(0.55, 6.0, 0.2) }, used(0.5));
    assert!(carried.value > 0.55, "a load that is still carried leaves what was known counted, too: {carried:?}");
    let let_go = |friction: &mut Friction, per_grip, grip_n, fraction| {
        let shown = FrictionSample { at_s: 1.0, ..shown(per_grip, grip_n, 0.2) };
        let frames = (0..90).map(|_| friction.see(&shown, used(fraction)));
        frames.last().map(|(told, used)| (told.expect("told").value, used.value)).expect("frames")
    };
    let (mu, now) = let_go(&mut friction, 0.1, 6.0, 0.5);
    assert!((mu - 0.58).abs() < 0.06 && now < 0.3, "what was known counts: {mu} {now}");
    let (_, loaded_now) = let_go(&mut friction, 0.55, 6.0, 0.95);
    assert!(loaded_now > 0.85, "under a load it matters less: {loaded_now}");
    let (_, before) = let_go(&mut friction, 0.1, 6.0, 0.5);
    friction.slip_counts_anew();
    let (_, lighter) = let_go(&mut friction, 0.1, 6.0, 0.5);
    assert!((lighter - before).abs() < 0.02, "what was squeezed stays where slip counts anew: {lighter} {before}");
    (friction.now_s, friction.regripped_s) = (0.0, None);
    friction.regripped();
    let (_, anew) = let_go(&mut friction, 0.1, 6.0, 0.5);
    assert!(anew > before + 0.05, "the field has begun anew: {anew} {before}");
    let mut friction = loaded(0.2);
    let (mu, now) = let_go(&mut friction, 0.2, 8.0, 0.5);
    assert!(mu > 0.25 && (now - 0.5).abs() < 1e-9, "a little less grip leaves nothing: {mu} {now}");
}

#[test]
fn what_a_larger_load_has_left_at_the_rim_is_not_taken_for_slip_of_a_smaller_one() {
    // A bottle is pushed up: its load halves within two frames, and the rim still lags as under the full load.
    let mut friction = loaded(0.8);
    let ((before, _), mut now) = (friction.see(&shown(0.64, 10.0, 0.1), used(0.8)), used(0.0));
    for load in [0.45, 0.32, 0.31, 0.32] {
        now = friction.see(&shown(load, 10.0, 0.2), used(0.75)).1;
    }
    let (after, later) = friction.see(&shown(0.6, 10.0, 0.15), used(0.75));
    let [before, after] = [before, after].map(|told| told.expect("told").value);
    assert!((before - after).abs() < 0.02, "it tells nothing of the friction: {before} {after}");
    assert!((0.32 / 0.8 - 0.05..0.5).contains(&now.value), "what was known counts: {now:?}");
    assert!((later.value - 0.75).abs() < 1e-9, "nearly as much as before is as good as any: {later:?}");
    let mut sliding = loaded(0.8);
    sliding.see(&shown(0.64, 10.0, 0.1), used(0.8));
    let falls = FrictionSample { imprint_slides: true, ..shown(0.32, 10.0, 0.2) };
    assert!((sliding.see(&falls, used(0.95)).1.value - 0.95).abs() < 1e-9, "it slides, and its load falls with that");
    // After a regrip nothing of it is left.
    friction.regripped();
    let anew = FrictionSample { at_s: 1.0, ..shown(0.32, 12.0, 0.02) };
    assert!((friction.see(&anew, used(0.75)).1.value - 0.75).abs() < 0.02);
    // Without information on the contact, the prior.
    let mut friction = Friction::default();
    let _ = friction.see(&shown(0.4, 10.0, 0.5), used(0.7));
    let now = friction.see(&shown(0.1, 10.0, 0.2), used(0.7)).1;
    assert!((0.15..0.4).contains(&now.value), "{now:?}");
}

#[test]
fn the_load_that_slides_tells_the_friction_whatever_frames_said() {
    let mut friction = Friction::default();
    friction.set_slides(true);
    assert_eq!(friction.see(&shown(0.3, 10.0, 0.4), used(0.45)).0, None, "no frame, no slide");
    // Estimated as rough: more than half of it is out of view. The load falls during the slide.
    let slid = |frames: u32, period_s: f64| {
        let mut friction = Friction::default();
        for _ in 0..60 {
            friction.see(&shown(0.3, 5.0, 0.2), used(0.5));
            friction.set_slides(false);
        }
        for frame in 0..frames {
            let (per_grip, f) = if frame == 0 { (0.3, 0.5) } else { (0.2, 0.6) };
            let at_s = period_s * f64::from(frame);
            friction.see(&FrictionSample { at_s, imprint_slides: true, ..shown(per_grip, 5.0, 0.4) }, used(f));
            friction.set_slides(true);
        }
        friction
    };
    let told = |mut friction: Friction| {
        friction.regripped();
        let (told, now) = friction.see(&shown(0.15, 10.0, 0.2), used(0.22));
        (told.expect("told").value, now.value)
    };
    let (mu, now) = told(slid(3, 1.0 / 30.0));
    assert!((0.28..0.42).contains(&mu) && (0.36..0.55).contains(&now), "{mu} {now}");
    let longer = told(slid(12, 1.0 / 30.0)).0;
    assert!((0.34..0.42).contains(&longer), "taken once, of its first frame: {longer}");
    for (frames, period_s) in [(2, 0.06), (5, 0.01)] {
        let mu = told(slid(frames, period_s)).0;
        assert!(mu > 0.45, "a slide of {frames} frames of {period_s} s may be none: {mu}");
    }
    let mut twice = slid(2, 1.0 / 30.0);
    twice.set_slides(false);
    twice.see(&FrictionSample { at_s: 0.1, ..shown(0.2, 5.0, 0.2) }, used(0.5));
    twice.set_slides(true);
    assert!(told(twice).0 > 0.45, "each counts from its own beginning");
}

#[test]
fn at_another_grip_less_is_known_of_it() {
    let sd = |grip_n: f64| {
        let mut friction = loaded(0.5);
        friction.see(&shown(0.3, 10.0, 0.2), used(0.6));
        friction.regripped();
        friction.see(&shown(0.3, grip_n, 0.5), used(0.6)).1.sd
    };
    assert!(sd(60.0) > 1.2 * sd(10.0), "{} {}", sd(60.0), sd(10.0));
}
