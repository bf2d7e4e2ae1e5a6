//! Two different pads, against statics and against two identical pads.

use slipbound::plant::Plant;
use slipbound_lab::hand::{HandScene, HandTruth, HandWorld};

const DEG: f64 = std::f64::consts::PI / 180.0;

/// A world that is pressed, turned and lowered step by step; the ground truth after every step.
fn run(scene: &str, force_n: f64, seconds_s: f64, rate_rad_per_s: f64, rate_mm_per_s: f64) -> Vec<HandTruth> {
    let scene = HandScene::parse(scene).expect("a sound scene");
    let mut world = HandWorld::new(&scene).expect("a sound world");
    let (press_s, mut truths) = (0.5, Vec::new());
    for step in 1..=((press_s + seconds_s) * 120.0) as u64 {
        let time_s = step as f64 / 120.0;
        let moved_s = (time_s - press_s).max(0.0);
        world.press(force_n * (time_s / 0.3).min(1.0));
        world.place_wrist(rate_rad_per_s * moved_s, rate_mm_per_s * moved_s);
        world.advance_to((step * 1_000_000_000).div_ceil(120));
        assert_eq!(world.error(), None, "{scene}");
        truths.push(world.truth().clone());
    }
    assert!(truths.iter().all(|truth| truth.converged), "{scene}");
    truths
}

/// With equal properties the right pad is solved separately and equals the image of the left one.
#[test]
fn two_equal_pads_solved_by_themselves_carry_what_one_and_its_image_do() {
    for (scene, mu, force_n, rate_rad_per_s, rate_mm_per_s) in [
        ("lift?start_kg=0.6&fill_kg_per_s=0.3&pulls=1&pull_n=5&fill_after_s=0.1", 0.6, 12.0, 0.0, -20.0),
        ("place?off_mm=10", 0.6, 15.0, 0.0, 0.0),
        ("screw?seal_deg=5&stop_deg=20", 0.6, 15.0, 20.0 * DEG, 0.0),
    ] {
        let alike = run(&format!("{scene}&mu={mu}"), force_n, 1.2, rate_rad_per_s, rate_mm_per_s);
        let apart = run(&format!("{scene}&mu={mu}&mu_right={mu}"), force_n, 1.2, rate_rad_per_s, rate_mm_per_s);
        let most_n = alike.iter().map(|truth| truth.wrench[0].force_n.length()).fold(0.0, f64::max);
        let most_n_mm = alike.iter().map(|truth| truth.wrench[0].torque_n_mm.abs()).fold(0.0, f64::max);
        assert!(most_n > 0.4, "{scene}: {most_n} N, {most_n_mm} N mm");
        for (a, b) in alike.iter().zip(&apart) {
            for finger in 0..2 {
                let (a_n, b_n) = (a.wrench[finger].force_n, b.wrench[finger].force_n);
                assert!((a_n - b_n).length() < 0.005 * most_n, "{scene}: finger {finger}, {a_n:?} and {b_n:?}");
                let missed_n_mm = (a.wrench[finger].torque_n_mm - b.wrench[finger].torque_n_mm).abs();
                let bound_n_mm = 0.005 * most_n_mm.max(most_n); // for a pure force: at 1 mm
                assert!(missed_n_mm < bound_n_mm, "{scene}: finger {finger}, {missed_n_mm} of {most_n_mm} N mm");
            }
            assert!((a.required_n - b.required_n).abs() < 0.005 * force_n, "{scene}");
            assert!((a.pose.position_mm - b.pose.position_mm).length() < 0.01, "{scene}");
        }
        let [a, b] = [&alike, &apart].map(|truths| truths.last().expect("steps"));
        assert_eq!((a.gross, a.pads.is_some(), b.pads.is_some()), (b.gross, false, true), "{scene}");
    }
}

const BOTTLE: &str = "lift?object=water_bottle&start_kg=1&fill_kg_per_s=0&pulls=0";

/// 9.8 N on two pads of 15 N: the right one carries all that its friction allows and slides, the left one carries the
/// rest.
#[test]
fn the_pad_of_less_friction_slips_first_and_both_balance_the_load() {
    let truths = run(&format!("{BOTTLE}&mu=0.6&mu_right=0.25"), 15.0, 1.5, 0.0, -20.0);
    let first = truths.iter().find_map(|truth| {
        let [left, right] = truth.pads?.map(|pad| pad.stick_ratio.unwrap_or(1.0));
        (truth.time_ns > 500_000_000 && left.min(right) < 0.1).then_some((left, right))
    });
    let (left, right) = first.expect("a pad slips");
    assert!(right < 0.1 && left > 0.5, "the right one first: {left} and {right} stick");
    let last = truths.last().expect("steps");
    let [left_n, right_n] = last.wrench.map(|wrench| wrench.force_n.x);
    let load_n = last.bottle.expect("a bottle").load_n;
    assert!((left_n + right_n - load_n).abs() < 0.01 * load_n, "{left_n} and {right_n} of {load_n}");
    // A part of its friction still holds the gel that was spread by the press.
    assert!((0.85..1.02).contains(&(right_n / (0.25 * 15.0))), "what 15 N hold at 0.25: {right_n}");
    assert!(!last.gross && last.slid_mm == 0.0, "the left one holds");
    assert!(last.required_n > 9.0 && last.required_n < 15.0, "{}", last.required_n);
    // Too much even for both together: it slides over both.
    let falls = run(&format!("{BOTTLE}&mu=0.3&mu_right=0.2"), 15.0, 1.5, 0.0, -20.0);
    assert!(falls.last().is_some_and(|truth| truth.first_gross_ns.is_some()));
}

#[test]
fn a_stiffer_pad_carries_more_and_a_turned_one_feels_the_load_turned() {
    let carried = |more: &str| {
        let truths = run(&format!("{BOTTLE}&mu=1&mu_right=1{more}"), 20.0, 1.0, 0.0, -20.0);
        truths.last().expect("steps").wrench.map(|wrench| wrench.force_n)
    };
    let [left_n, right_n] = carried("&stiffness_right_fraction=2");
    let ratio = right_n.x / left_n.x;
    assert!((1.3..2.0).contains(&ratio), "twice as stiff under a smaller contact: {ratio}");
    let [left_n, right_n] = carried("&turn_right_deg=10");
    assert!((right_n.length() / left_n.length() - 1.0).abs() < 0.02, "{left_n:?} {right_n:?}");
    let turned_deg = libm::atan(right_n.y / right_n.x) / DEG;
    assert!((turned_deg + 10.0).abs() < 1.0, "{turned_deg} deg: the pad is turned, the load stays");
}

#[test]
fn the_right_pad_is_told_only_where_it_differs() {
    let scene = HandScene::parse("lift?mu=0.7").expect("sound");
    assert!(!scene.to_string().contains("right"), "{scene}");
    let differs = HandScene::parse("lift?mu=0.7&mu_right=0.4").expect("sound");
    assert!(differs.to_string().contains("&mu_right=0.4") && !differs.to_string().contains("turn_right"), "{differs}");
    assert_eq!(HandScene::parse(&differs.to_string()), Ok(differs));
    assert!(HandScene::parse("lift?turn_right_deg=40").is_err());
}
