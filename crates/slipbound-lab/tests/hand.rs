//! The simulated hand against statics: caps, bottles and tools, held by two soft fingers.

use slipbound::plant::Plant;
use slipbound_lab::hand::{HandScene, HandTruth, HandWorld};

const DEG: f64 = std::f64::consts::PI / 180.0;

fn world(scene: &str) -> HandWorld {
    HandWorld::new(&HandScene::parse(scene).expect("a sound scene")).expect("a sound world")
}

/// A world that is pressed and moved at will, in steps of 1/120 s.
struct Bench {
    world: HandWorld,
    steps: u64,
    angle_rad: f64,
    lowered_mm: f64,
    force_n: f64,
}

impl Bench {
    fn new(scene: &str) -> Self {
        Bench { world: world(scene), steps: 0, angle_rad: 0.0, lowered_mm: 0.0, force_n: 0.0 }
    }

    fn run(&mut self, seconds_s: f64, rate_rad_per_s: f64, rate_mm_per_s: f64, force_to_n: f64) -> &HandTruth {
        let steps = (seconds_s * 120.0).round();
        let force_step_n = (force_to_n - self.force_n) / steps;
        for _ in 0..steps as u64 {
            self.steps += 1;
            self.angle_rad += rate_rad_per_s / 120.0;
            self.lowered_mm += rate_mm_per_s / 120.0;
            self.force_n = (self.force_n + force_step_n).max(0.0);
            self.world.press(self.force_n);
            self.world.place_wrist(self.angle_rad, self.lowered_mm);
            self.world.advance_to((self.steps * 1_000_000_000).div_ceil(120));
            assert_eq!(self.world.error(), None);
        }
        self.world.truth()
    }

    fn press(&mut self, force_n: f64) -> &HandTruth {
        self.run(0.3, 0.0, 0.0, force_n);
        self.run(0.2, 0.0, 0.0, force_n)
    }
}

#[test]
fn a_long_object_touches_no_more_than_the_gel_of_the_camera() {
    let area_mm2 = |camera: &str| {
        let scene = format!("lift?object=scrub_sponge&seed=1&camera={camera}");
        Bench::new(&scene).run(0.6, 0.0, 0.0, 40.0).contact_area_mm2
    };
    let (slim_mm2, mini_mm2) = (area_mm2("gelslim"), area_mm2("gelsight_mini"));
    println!("a sponge touches {slim_mm2:.0} mm2 of a GelSlim, {mini_mm2:.0} of a Mini of 524");
    assert!(mini_mm2 > 350.0 && mini_mm2 < 25.25 * 20.75 && slim_mm2 > 1.1 * mini_mm2, "{slim_mm2} {mini_mm2}");
}

#[test]
fn a_free_cap_follows_the_wrist_against_its_running_torque() {
    let mut bench = Bench::new("screw?mu=0.6&seal_deg=400&stop_deg=400&thread_mm_per_turn=0");
    bench.press(20.0);
    let rate = 20.0 * DEG;
    let truth = bench.run(1.5, rate, 0.0, 20.0).clone();
    let cap = truth.cap.expect("a cap");
    assert!((cap.torque_n_mm - 45.0).abs() < 0.5, "40 N mm and 5 of the viscous term: {}", cap.torque_n_mm);
    let behind_mm = 14.0 * (truth.angle_rad - cap.angle_rad);
    assert!((0.0..0.2).contains(&behind_mm), "{behind_mm} mm");
    assert!(cap.yields && !truth.gross && truth.slid_mm == 0.0);
    // It never springs back: the wrist turns back, the cap does not move.
    let back = bench.run(0.2, -rate, 0.0, 20.0).cap.expect("a cap");
    assert!((back.angle_rad - cap.angle_rad).abs() < 1e-3 && back.torque_n_mm < 0.0, "{back:?}");
}

#[test]
fn a_blocked_cap_saturates_at_two_mu_p_r_and_then_slides_as_the_wrist_turns() {
    for (mu, force_n) in [(0.6, 20.0), (0.4, 40.0)] {
        let mut bench = Bench::new(&format!("screw?mu={mu}&run_n_mm=1e6"));
        bench.press(force_n);
        bench.run(0.5, 20.0 * DEG, 0.0, force_n);
        let before = bench.run(0.5, 20.0 * DEG, 0.0, force_n).clone();
        let after = bench.run(1.0, 20.0 * DEG, 0.0, force_n).clone();
        let (cap, limit_n_mm) = (after.cap.expect("a cap"), 2.0 * mu * force_n * 14.0);
        assert!((cap.limit_n_mm / limit_n_mm - 1.0).abs() < 0.01);
        // Statics of a flat face; the gel that a round one drags in front of it increases the torque.
        assert!((1.0..1.2).contains(&(cap.torque_n_mm / limit_n_mm)), "{} of {limit_n_mm}", cap.torque_n_mm);
        assert!(after.gross && !cap.yields && cap.angle_rad == 0.0);
        assert!((after.required_n / force_n - 1.0).abs() < 0.02, "{}", after.required_n);
        let way_mm = 14.0 * 20.0 * DEG;
        let slid_mm = after.slid_mm - before.slid_mm;
        assert!((slid_mm / way_mm - 1.0).abs() < 0.02, "{slid_mm} mm of {way_mm} mm");
        // Its skin has moved 10 mm, its round profile is still in the middle of the pad.
        let finger = bench.world.finger(0);
        let grid = finger.settings().grid;
        let touched = (0..grid.cells_count()).filter(|&cell| finger.contact()[cell]);
        let places: Vec<f64> = touched.map(|cell| grid.centre_mm(cell).y).collect();
        let middle_mm = places.iter().sum::<f64>() / places.len() as f64;
        assert!(middle_mm.abs() < 3.0 && after.pose.position_mm.y > 9.0, "{middle_mm} {:?}", after.pose);
    }
}

#[test]
fn a_cap_screws_home_as_far_as_friction_turns_it() {
    // Through run, seal and stop: T = 40 + 600 (phi - 60 deg) + 12000 (phi - 75 deg), which friction carries up to 2 mu
    // P R. The hand follows the travel along the thread, like a wrist that knows it.
    for (mu, force_n) in [(0.6, 20.0), (0.9, 40.0)] {
        let mut bench = Bench::new(&format!("screw?mu={mu}"));
        bench.press(force_n);
        let truth = bench.run(6.0, 20.0 * DEG, 3.0 * 20.0 / 360.0, force_n).clone();
        let cap = truth.cap.expect("a cap");
        let limit_n_mm = 2.0 * mu * force_n * 14.0;
        let home_rad = |torque_n_mm: f64| 75.0 * DEG + (torque_n_mm - 40.0 - 600.0 * 15.0 * DEG) / 12_600.0;
        let [least_rad, most_rad] = [1.0, 1.2].map(|share| home_rad(share * limit_n_mm));
        assert!((least_rad..most_rad).contains(&cap.angle_rad), "{} of {least_rad}", cap.angle_rad);
        assert!(truth.gross, "{:?} {:?}", truth.friction_used_fraction, truth.stick_ratio);
        assert!(cap.torque_n_mm <= 1.2 * limit_n_mm, "{cap:?}");
        // The pads push through its middle, however far its skin has moved.
        assert!(truth.wrench[0].torque_n_mm.abs() < 1.0 && truth.wrench[0].force_n.x < -0.3, "{:?}", truth.wrench);
        // It moves down in its thread, the hand moves down by itself; the difference is over the pads.
        let down_mm = 3.0 / 360.0 * (cap.angle_rad / DEG - 120.0);
        assert!((truth.pose.position_mm.x - down_mm).abs() < 1e-9, "{:?} {down_mm}", truth.pose);
    }
}

#[test]
fn a_cap_breaks_loose_just_when_what_the_pads_can_carry_is_more_than_holds_it() {
    for (mu, force_n) in [(0.6, 20.0), (0.8, 30.0)] {
        // Their largest torque: on a cap that never breaks loose.
        let mut blocked = Bench::new(&format!("unscrew?mu={mu}&break_n_mm=1e6&thread_mm_per_turn=0"));
        blocked.press(force_n);
        let mut limit_n_mm = 0.0f64;
        for _ in 0..150 {
            limit_n_mm = limit_n_mm.max(blocked.run(0.01, -20.0 * DEG, 0.0, force_n).cap.expect("a cap").torque_n_mm);
        }
        assert!((1.0..1.2).contains(&(limit_n_mm / (2.0 * mu * force_n * 14.0))), "{limit_n_mm}");
        for (share, loose) in [(0.98, true), (1.02, false)] {
            let break_n_mm = share * limit_n_mm;
            let mut bench = Bench::new(&format!("unscrew?mu={mu}&break_n_mm={break_n_mm}&thread_mm_per_turn=0"));
            bench.press(force_n);
            let truth = bench.run(1.5, -20.0 * DEG, 0.0, force_n);
            let cap = truth.cap.expect("a cap");
            assert_eq!(cap.angle_rad > 2.0 * DEG, loose, "{share}: {cap:?}");
            assert!(loose || cap.angle_rad == 0.0, "{cap:?}");
            assert!(!loose || (cap.torque_n_mm - 45.0).abs() < 3.0, "{cap:?}");
        }
    }
}

const GRAVITY_M_PER_S2: f64 = 9.80665;

#[test]
fn a_bottle_falls_just_when_its_weight_is_more_than_two_mu_p() {
    for (mu, force_n) in [(0.5, 10.0), (0.35, 20.0)] {
        let limit_kg = 2.0 * mu * force_n / GRAVITY_M_PER_S2;
        // Pressure on the rims carries a part of it, too: by statics it would fall above 1.
        for (share, falls) in [(0.98, false), (1.06, true)] {
            let mut bench = Bench::new(&format!(
                "lift?mu={mu}&most_kg={}&fill_kg_per_s=0.5&fill_after_s=0.2&pulls=0",
                share * limit_kg
            ));
            bench.press(force_n);
            let lifted = bench.run(1.0, 0.0, -20.0, force_n).bottle.expect("a bottle");
            assert!(lifted.lifted_at_s.is_some() && lifted.table_n == 0.0 && lifted.above_table_mm > 15.0);
            let truth = bench.run(3.5, 0.0, 0.0, force_n).clone();
            let bottle = truth.bottle.expect("a bottle");
            assert_eq!(bottle.dropped, falls, "{bottle:?}");
            assert_eq!(bench.world.width_mm().is_none(), falls);
            if !falls {
                assert!((bottle.mass_kg - share * limit_kg).abs() < 1e-9, "full");
                let carried_n = truth.wrench[0].force_n.x + truth.wrench[1].force_n.x;
                assert!((carried_n / bottle.load_n - 1.0).abs() < 1e-3, "{carried_n} N of {} N", bottle.load_n);
                let required = truth.required_n / (share * force_n);
                assert!((0.96..1.01).contains(&required), "{}", truth.required_n);
            }
        }
    }
}

#[test]
fn a_tool_in_the_air_is_held_against_its_weight_and_its_lever() {
    for (tilt_deg, off_mm) in [(20.0, 5.0), (-10.0, 8.0), (0.0, -5.0)] {
        let mut bench = Bench::new(&format!("place?tilt_deg={tilt_deg}&off_mm={off_mm}"));
        bench.press(10.0);
        let truth = bench.run(0.6, 0.0, 0.0, 10.0).clone();
        let ground = truth.ground.expect("a tool");
        assert!(!ground.on_stand && ground.force_n == 0.0 && !truth.gross);
        assert!((ground.tilt_rad - tilt_deg * DEG).abs() < 0.5 * DEG, "{ground:?}");
        let [left, right] = truth.wrench;
        let carried_n = left.force_n.x + right.force_n.x;
        assert!((carried_n / ground.weight_n - 1.0).abs() < 0.005, "to the solver's tolerance: {carried_n}");
        // About Z of the hand, which is z of the right finger: the centre of mass is off along Y, its weight along X.
        let expected_n_mm = -off_mm * libm::cos(tilt_deg * DEG) * ground.weight_n;
        let torque_n_mm = right.torque_n_mm - left.torque_n_mm;
        assert!((torque_n_mm / expected_n_mm - 1.0).abs() < 0.02, "{torque_n_mm} of {expected_n_mm}");
        assert_eq!((left.force_n.x, left.force_n.y), (right.force_n.x, -right.force_n.y));
    }
}

#[test]
fn a_tool_pivots_on_its_lower_foot_then_stands_with_its_weight() {
    let mut bench = Bench::new("place");
    bench.press(8.0);
    bench.run(0.5, 0.0, 0.0, 8.0);
    let pivots = bench.run(2.0, 0.0, 10.0, 8.0).clone();
    let ground = pivots.ground.expect("a tool");
    assert!(ground.feet_gap_mm[0] < 0.0 && ground.feet_gap_mm[1] > 30.0, "{ground:?}");
    let carried_n = pivots.wrench[0].force_n.x + pivots.wrench[1].force_n.x;
    assert!((carried_n + ground.force_n - ground.weight_n).abs() < 0.01, "{carried_n} N, {ground:?}");
    assert!(pivots.required_n > 0.95 * 8.0, "the pads turn: {}", pivots.required_n);
    // The hand stops and continues: the force of the ground continues as before.
    for n in 0..48 {
        let rate_mm_per_s = if n < 24 { 0.0 } else { 10.0 };
        let now = bench.run(1.0 / 120.0, 0.0, rate_mm_per_s, 8.0).ground.expect("a tool");
        assert!((now.force_n / ground.force_n - 1.0).abs() < 0.2, "{n}: {now:?} after {ground:?}");
    }
    // Down until both feet stand, and no further.
    while bench.world.truth().ground.expect("a tool").feet_gap_mm[1] > 0.0 {
        bench.run(1.0 / 120.0, 0.0, 10.0, 8.0);
    }
    let peak_n = bench.run(0.3, 0.0, 0.0, 8.0).ground.expect("a tool").peak_force_n;
    bench.run(1.0 / 120.0, 0.0, 0.0, 0.0);
    let stands = bench.run(0.5, 0.0, 0.0, 0.0).clone();
    let ground = stands.ground.expect("a tool");
    assert!((ground.force_n / ground.weight_n - 1.0).abs() < 1e-6, "{ground:?}");
    assert!(ground.tilt_rad.abs() < 1e-3 && ground.free_drop_mm.expect("let go") < 0.1, "{ground:?}");
    assert!(peak_n > ground.force_n * 0.8 && ground.peak_force_n == peak_n, "{ground:?}");
}

#[test]
fn a_tool_let_go_above_the_ground_falls_as_far_as_its_higher_foot_was_above_it() {
    let mut bench = Bench::new("place?tilt_deg=3&height_mm=2");
    let on_stand = bench.run(0.15, 0.0, 0.0, 8.0).clone();
    assert!(on_stand.ground.expect("a tool").on_stand && on_stand.wrench[0].force_n.x.abs() < 0.05, "{on_stand:?}");
    bench.press(8.0);
    let held = bench.run(0.5, 0.0, 0.0, 8.0).ground.expect("a tool");
    assert_eq!(held.free_drop_mm, None);
    bench.run(1.0 / 120.0, 0.0, 0.0, 0.0);
    let stands = bench.run(1.0, 0.0, 0.0, 0.0).ground.expect("a tool");
    let higher_mm = held.feet_gap_mm[0].max(held.feet_gap_mm[1]);
    assert!((stands.free_drop_mm.expect("let go") - higher_mm).abs() < 0.01, "{held:?} {stands:?}");
    assert!((stands.force_n / stands.weight_n - 1.0).abs() < 1e-3 && stands.tilt_rad.abs() < 1e-3, "{stands:?}");
    assert_eq!(stands.peak_force_n, 0.0, "the ground pushed only after the pads had let go");
}

#[test]
fn a_squeeze_without_load_is_no_gross_slip() {
    // With hardly any friction every cell of a press slips outward, although nothing slides as a whole.
    let slippery = ["unscrew?mu=0.05&object=screwdriver", "lift?mu=0.05&object=toy_duck&start_kg=0.01"];
    for scene in ["screw", "unscrew?mu=0.3", "place?mu=0.4", "lift?mu=0.3&start_kg=0.01"].into_iter().chain(slippery) {
        let mut bench = Bench::new(scene);
        for force_n in [10.0, 40.0, 60.0, 5.0, 80.0, 0.0, 30.0] {
            for n in (0..24).rev() {
                // Closer by a tenth of the remaining force per step, as jaws press.
                let next_n = if n == 0 { force_n } else { bench.force_n + 0.1 * (force_n - bench.force_n) };
                let truth = bench.run(1.0 / 120.0, 0.0, 0.0, next_n);
                assert!(!truth.gross && truth.slid_mm == 0.0, "{scene} at {force_n} N: {truth:?}");
            }
        }
    }
}

#[test]
fn a_hand_that_rises_faster_makes_a_bottle_heavier_and_pulls_add_to_its_weight() {
    let mut bench = Bench::new("lift?start_kg=0.5&fill_kg_per_s=0&pulls=3&seed=5&pull_n=4");
    bench.press(40.0);
    let (mut most_n, mut least_n, weight_n) = (0.0f64, f64::MAX, 0.5 * GRAVITY_M_PER_S2);
    for n in 0..24 {
        let rate_mm_per_s = if n < 12 { -100.0 } else { 0.0 };
        let load_n = bench.run(1.0 / 120.0, 0.0, rate_mm_per_s, 40.0).bottle.expect("a bottle").load_n;
        (most_n, least_n) = (most_n.max(load_n), least_n.min(load_n));
    }
    // 100 mm/s reached within 50 ms: 1.7 m/s2 in the first step, and as much in the opposite direction at the end.
    assert!((most_n - weight_n - 0.5 * 1.714).abs() < 0.05, "{most_n}");
    assert!(least_n < weight_n - 0.5, "{least_n}");
    let (mut pulled_s, mut from_pads_n) = (0.0, 0.0f64);
    for _ in 0..8 * 120 {
        let truth = bench.run(1.0 / 120.0, 0.0, 0.0, 40.0);
        let bottle = truth.bottle.expect("a bottle");
        assert!(!bottle.dropped && bottle.pull_n <= 4.0);
        pulled_s += if bottle.pull_n > 0.0 { 1.0 / 120.0 } else { 0.0 };
        let [left, right] = truth.wrench;
        from_pads_n =
            from_pads_n.max(libm::hypot(left.force_n.x + right.force_n.x - weight_n, left.force_n.y - right.force_n.y));
    }
    assert!((0.15..0.65).contains(&pulled_s), "3 pulls of 50 to 200 ms: {pulled_s} s");
    assert!((2.5..6.0).contains(&from_pads_n), "the pads feel a pull of 4 N: {from_pads_n} N");
}

#[test]
fn a_pull_across_is_felt_mirrored_and_a_pull_down_alike() {
    // A pull across the pads, whose direction this seed draws; the bottle's weight is negligible.
    let hand = |seed: u64| {
        let mut bench = Bench::new(&format!("lift?start_kg=0.02&fill_kg_per_s=0&pulls=1&pull_n=8&seed={seed}"));
        bench.press(30.0);
        bench.run(0.5, 0.0, -20.0, 30.0);
        for _ in 0..8 * 120 {
            let truth = bench.run(1.0 / 120.0, 0.0, 0.0, 30.0);
            if truth.bottle.expect("a bottle").pull_n > 6.0 && truth.wrench[0].force_n.length() > 2.0 {
                return truth.wrench;
            }
        }
        panic!("nothing pulled");
    };
    let mut across = 0;
    for seed in 0..2 {
        let [left, right] = hand(seed);
        assert_eq!(
            (left.force_n.x, left.force_n.y, left.torque_n_mm),
            (right.force_n.x, -right.force_n.y, -right.torque_n_mm)
        );
        across += usize::from(left.force_n.y.abs() > 1.0);
    }
    assert!(across > 0, "one of them pulls across");
}

#[test]
fn a_wrist_placed_once_a_frame_moves_evenly_between() {
    let pressed = || {
        let mut world = world("screw?run_n_mm=1e6");
        world.press(20.0);
        world.advance_to(300_000_000);
        world
    };
    let (mut once, mut often) = (pressed(), pressed());
    once.place_wrist(0.04, 0.0);
    once.advance_to(333_333_334);
    for n in 1..=4u64 {
        often.place_wrist(0.01 * n as f64, 0.0);
        often.advance_to(300_000_000 + n * 8_333_334);
    }
    assert_eq!(once.truth().time_ns, often.truth().time_ns);
    assert!((once.truth().pose.position_mm.y - 14.0 * 0.04).abs() < 1e-9, "{:?}", once.truth().pose);
    let apart_n = (once.truth().wrench[0].force_n - often.truth().wrench[0].force_n).length();
    assert!(apart_n < 1e-6, "{apart_n} N");
}

#[test]
fn a_force_that_is_no_number_stops_the_run_with_its_name() {
    let mut world = world("screw");
    world.press(f64::NAN);
    world.advance_to(1_000_000_000);
    let error = world.error().expect("refused");
    assert!(error.got == "NaN", "{error}");
    let stopped_ns = world.now_ns();
    world.press(10.0);
    world.advance_to(2_000_000_000);
    assert_eq!(world.now_ns(), stopped_ns, "nothing goes on");
}
