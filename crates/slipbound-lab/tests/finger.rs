//! General properties of a finger: symmetry, memory, motion, flags, and the same bytes every time.

use slipbound::pixels::wide::{Vectors, with_vectors};
use slipbound::plane::Vec2;
use slipbound_lab::contact::shape::{Cylinder, FlatBox, Paraboloid, Shape, Sphere};
use slipbound_lab::contact::{
    Body, Command, Drive, Event, Finger, FingerSettings, Friction, GelEdge, Grid, Grip, Inertia, Law, Leg, LoadRecord,
    Mount, Path, Pose, Stop, Truth, Wrench,
};
use slipbound_lab::layer::{Creep, Gel, SoftObject};

const SPHERE: Sphere = Sphere { radius_mm: 15.0 };
const FLAT: FlatBox = FlatBox { length_mm: 16.0, width_mm: 12.0, edge_radius_mm: 1.0 };

fn run(settings: FingerSettings, shape: impl Shape + 'static, legs: Vec<Leg>) -> (Finger, Vec<Truth>) {
    let mut finger = Finger::new(settings, shape).expect("sound settings");
    let path = Path::new(legs).expect("a sound path");
    let truths = path.commands(settings.substep_s).map(|c| *finger.step(&c).expect("a sound command")).collect();
    (finger, truths)
}

/// The fast grid, solved down to rounding.
fn exact() -> FingerSettings {
    let stop = Stop { tolerance_fraction: 1e-9, most_iterations_count: 5000 };
    FingerSettings { normal_stop: stop, tangential_stop: stop, ..FingerSettings::fast() }
}

/// Pressure, traction, displacement and slip of all cells, as bits.
fn bits(finger: &Finger) -> Vec<u64> {
    let plane = |v: Vec2| [v.x.to_bits(), v.y.to_bits()];
    (0..finger.settings().grid.cells_count())
        .flat_map(|cell| {
            let moved = finger.displacement(cell);
            [plane(finger.traction_mpa(cell)), plane(moved.shift_mm), plane(finger.slip_mm(cell))]
                .concat()
                .into_iter()
                .chain([finger.pressure_mpa()[cell].to_bits(), moved.depth_mm.to_bits()])
        })
        .collect()
}

#[test]
fn the_same_bytes_twice_on_every_thread_and_with_vectors_of_any_width() {
    let go = || {
        let legs = vec![Leg::press(20.0, 0.1), Leg::shear_and_twist(0.6, 0.2, 0.05, 0.1)];
        bits(&run(FingerSettings::fast(), FLAT, legs).0)
    };
    let first = go();
    assert!(first == go());
    let threads = [Vectors::Avx512, Vectors::Avx2, Vectors::Baseline]
        .map(|widest| std::thread::spawn(move || with_vectors(widest, go)));
    for thread in threads {
        assert!(first == thread.join().expect("no panic"));
    }
}

#[test]
fn nothing_touches_beyond_the_edge_of_the_gel() {
    let edge = GelEdge { half_mm: Vec2::new(7.0, 5.0), radius_mm: 1.5 };
    let ending = FingerSettings { edge: Some(edge), ..exact() };
    let legs = || vec![Leg::press(8.0, 0.1), Leg::shear(0.4, 0.2, 0.05)];
    let (finger, truths) = run(ending, FLAT, legs());
    let (endless, before) = run(exact(), FLAT, legs());
    let ([ends, all], grid) = ([truths, before].map(|t| t[t.len() - 1]), exact().grid);
    for cell in (0..grid.cells_count()).filter(|&cell| finger.contact()[cell]) {
        let at = grid.centre_mm(cell);
        assert!(at.x.abs() < 7.0 && at.y.abs() < 5.0, "{at:?}");
    }
    // A plate of 16 x 12 mm covers all of a gel of 14 x 10 except its rounded edge.
    assert!((0.75 * 140.0..140.0).contains(&ends.contact_area_mm2), "{} mm2", ends.contact_area_mm2);
    assert!(all.contact_area_mm2 > 1.3 * ends.contact_area_mm2 && ends.depth_mm > all.depth_mm, "{all:?} {ends:?}");
    assert!((ends.grip_force_n - 8.0).abs() < 1e-3, "{}", ends.grip_force_n);
    // Pressure falls towards the edge; on an endless gel it is largest at the rim of the plate.
    let share =
        |finger: &Finger, x: f64| finger.pressure_mpa()[cell_at(&grid, x)] / finger.pressure_mpa()[cell_at(&grid, 0.0)];
    assert!(
        share(&finger, 6.5) < 0.5 && share(&endless, 6.5) > 0.9,
        "{} {}",
        share(&finger, 6.5),
        share(&endless, 6.5)
    );
    // An object well inside is not affected by the edge.
    let small = |settings| run(settings, Sphere { radius_mm: 6.0 }, vec![Leg::press(1.0, 0.1)]).0;
    let (ends, endless) = (small(ending), small(exact()));
    let most = endless.pressure_mpa().iter().copied().fold(0.0, f64::max);
    let apart = ends.pressure_mpa().iter().zip(endless.pressure_mpa()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-6 * most, "a sphere in the middle: {apart} of {most} MPa");
    for (radius_mm, key) in [(5.5, "edge.radius_mm"), (0.0, "edge.radius_mm"), (f64::NAN, "edge.radius_mm")] {
        let edge = Some(GelEdge { radius_mm, ..edge });
        assert_eq!(Finger::new(FingerSettings { edge, ..exact() }, FLAT).expect_err("refused").key, key);
    }
}

fn cell_at(grid: &Grid, x_mm: f64) -> usize {
    let near = |cell: usize| (grid.centre_mm(cell) - Vec2::new(x_mm, 0.0)).length();
    (0..grid.cells_count()).min_by(|&a, &b| near(a).total_cmp(&near(b))).expect("cells")
}

#[test]
fn mirrored_in_mirrored_out() {
    let (right, up) = run(exact(), FLAT, vec![Leg::press(15.0, 0.1), Leg::shear_and_twist(0.5, 0.2, 0.04, 0.1)]);
    let (left, down) = run(exact(), FLAT, vec![Leg::press(15.0, 0.1), Leg::shear_and_twist(-0.5, 0.2, -0.04, 0.1)]);
    let (a, b) = (up[up.len() - 1], down[down.len() - 1]);
    assert!((a.wrench.force_n.x + b.wrench.force_n.x).abs() < 1e-6 * a.wrench.force_n.x);
    assert!((a.wrench.torque_n_mm + b.wrench.torque_n_mm).abs() < 1e-6 * a.wrench.torque_n_mm);
    assert_eq!(a.stick_ratio, b.stick_ratio);
    for at in [Vec2::new(3.0, 2.0), Vec2::new(-9.0, 4.0), Vec2::new(12.0, -7.0)] {
        let (p, q) = (right.displacement_at(at).shift_mm, left.displacement_at(Vec2::new(-at.x, at.y)).shift_mm);
        assert!((p.x + q.x).abs() < 1e-7 && (p.y - q.y).abs() < 1e-7, "{p:?} {q:?}");
    }
}

#[test]
fn a_bonded_gel_is_squeezed_outward_and_a_compressible_one_inward() {
    let press = |poisson_ratio: f64| {
        let gel = Gel { poisson_ratio, thickness_mm: 20.0, ..Gel::default() };
        // With hardly any friction the surface moves freely.
        let settings = FingerSettings { gel, friction: Friction::constant(1e-6), ..FingerSettings::fast() };
        run(settings, SPHERE, vec![Leg::press(5.0, 0.05)]).0.displacement_at(Vec2::new(1.5, 0.0)).shift_mm.x
    };
    assert!(press(0.0) < -1e-3, "{}", press(0.0));
    let (thin, _) = run(FingerSettings::standard(), SPHERE, vec![Leg::press(20.0, 0.25)]);
    let right_mm = thin.displacement_at(Vec2::new(4.0, 0.0)).shift_mm.x;
    assert!((0.1..0.35).contains(&right_mm), "{right_mm}");
}

#[test]
fn a_slow_ramp_sticks_then_slips_from_the_rim() {
    let (finger, truths) = run(FingerSettings::fast(), FLAT, vec![Leg::press(10.0, 0.1), Leg::shear(0.45, 0.0, 0.3)]);
    let last = truths[truths.len() - 1];
    let picture: Vec<String> = (14..34)
        .map(|row| {
            (16..48)
                .map(|column| {
                    let cell = row * 64 + column;
                    match (finger.contact()[cell], finger.stick()[cell]) {
                        (false, _) => '.',
                        (true, false) => 'o',
                        (true, true) => '#',
                    }
                })
                .collect()
        })
        .collect();
    let text = picture.join("\n");
    // Stuck inside and at the front, where the object drags the gel; slipping behind and at the sides.
    assert!((0.1..0.9).contains(&last.stick_ratio.expect("contact")), "{last:?}\n{text}");
    for row in picture.iter().filter(|row| row.contains('#')) {
        let trimmed = row.trim_matches('.');
        assert!(trimmed.starts_with('o'), "\n{text}");
    }
    assert!(!picture[1].contains('#') && !picture[18].contains('#'), "\n{text}");
    // The object slides in the direction of the push.
    let slid =
        finger.slip_mm((0..finger.contact().len()).find(|&c| finger.contact()[c] && !finger.stick()[c]).expect("slip"));
    assert!(slid.x > 0.0, "{slid:?}");
}

#[test]
fn rolling_moves_the_contact_and_does_not_slide() {
    let shape = Sphere { radius_mm: 15.0 };
    let (finger, truths) = run(FingerSettings::fast(), shape, vec![Leg::press(5.0, 0.1), Leg::roll(4.0, 0.0, 0.4)]);
    let last = truths[truths.len() - 1];
    let grid = finger.settings().grid;
    let (mut middle, mut load) = (Vec2::ZERO, 0.0);
    for (cell, &pressure) in finger.pressure_mpa().iter().enumerate() {
        middle += grid.centre_mm(cell) * pressure;
        load += pressure;
    }
    assert!((middle.x / load - 4.0).abs() < 0.3, "{middle:?}");
    assert!(last.stick_ratio.expect("contact") > 0.5, "{last:?}");
    assert!(last.wrench.force_n.x.abs() < 0.3 * 0.8 * 5.0, "{last:?}");
}

#[test]
fn a_contact_that_jumps_is_found_where_it_went() {
    let settings = FingerSettings { friction: Friction::constant(1e-6), ..exact() };
    let there = Command {
        grip: Grip::ForceN(5.0),
        pose: Pose::default(),
        roll_mm: Vec2::new(12.5, 0.0),
        wrench: Wrench::default(),
    };
    let (mut jumped, _) = run(settings, SPHERE, vec![Leg::press(5.0, 1.0 / 120.0)]);
    let mut fresh = Finger::new(settings, SPHERE).expect("sound settings");
    for finger in [&mut jumped, &mut fresh] {
        (0..3).for_each(|_| assert!(finger.step(&there).expect("a sound command").converged));
    }
    for (a, b) in jumped.pressure_mpa().iter().zip(fresh.pressure_mpa()) {
        assert!((a - b).abs() < 2e-3, "{a} {b} MPa");
    }
}

#[test]
fn letting_go_leaves_a_flat_gel() {
    let (finger, truths) =
        run(FingerSettings::fast(), SPHERE, vec![Leg::press(20.0, 0.1), Leg::shear(0.5, 0.0, 0.1), Leg::release(0.1)]);
    let last = truths[truths.len() - 1];
    assert_eq!((last.stick_ratio, last.grip_force_n), (None, 0.0));
    assert!(last.events.contains(Event::Parted), "{last:?}");
    assert!((0..finger.contact().len()).all(|cell| finger.displacement(cell).shift_mm.length() < 1e-12));
    assert!((0..finger.contact().len()).all(|cell| finger.slip_mm(cell) == Vec2::ZERO && !finger.stick()[cell]));
}

#[test]
fn a_press_to_a_depth_carries_the_force_that_gives_that_depth() {
    // With hardly any friction and after the creep, only the last depth matters.
    let settings = FingerSettings { friction: Friction::constant(1e-6), ..FingerSettings::fast() };
    let shape = Paraboloid { radius_mm: 15.0 };
    let (_, forced) = run(settings, shape, vec![Leg::press(10.0, 0.1), Leg::hold(0.1)]);
    let depth_mm = forced[forced.len() - 1].depth_mm;
    let (_, deep) = run(settings, shape, vec![Leg::press_to_depth(depth_mm, 0.1), Leg::hold(0.1)]);
    let force_n = deep[deep.len() - 1].grip_force_n;
    assert!((force_n / 10.0 - 1.0).abs() < 1e-3, "{force_n} N at {depth_mm} mm");
}

#[test]
fn events_come_in_order_and_the_load_fraction_ends_at_1() {
    let (_, truths) = run(FingerSettings::fast(), FLAT, vec![Leg::press(10.0, 0.1), Leg::shear(1.5, 0.0, 0.5)]);
    let seen: Vec<Event> = truths.iter().flat_map(|truth| truth.events.iter()).collect();
    assert_eq!(seen, [Event::FirstContact, Event::StickBelow80, Event::StickBelow50, Event::Gross]);
    let mut record = LoadRecord::default();
    assert!(record.fractions().is_none());
    for truth in truths.iter().filter(|truth| truth.time_s > 0.1 + 1e-9) {
        record.push(truth.wrench.force_n.x, truth.friction_used_fraction);
    }
    let gross = record.gross_step().expect("gross slip");
    let fractions: Vec<f64> = record.fractions().expect("gross slip").collect();
    assert_eq!(fractions[gross], 1.0);
    assert!(fractions[..gross].iter().all(|&f| (0.0..1.001).contains(&f)));
    // The same load, by statics: friction mu P, and the contribution of pressure on the slopes of the edges.
    let gross = truths.iter().find(|truth| truth.events.contains(Event::Gross)).expect("gross");
    let (gross_n, friction_n) = (gross.wrench.force_n.x, gross.friction.force_n.x);
    assert!((friction_n / 8.0 - 1.0).abs() < 0.02, "{friction_n} N against mu P = 8 N");
    assert!((1.0..1.05).contains(&(gross_n / friction_n)), "{gross_n} N with friction of {friction_n} N");
}

#[test]
fn a_clone_is_a_branch() {
    let (mut finger, _) = run(FingerSettings::fast(), SPHERE, vec![Leg::press(10.0, 0.1)]);
    let before = bits(&finger);
    let mut branch = finger.clone();
    let hold =
        Command { grip: Grip::ForceN(10.0), pose: Pose::default(), roll_mm: Vec2::ZERO, wrench: Wrench::default() };
    let aside = Command { pose: Pose { position_mm: Vec2::new(0.2, 0.0), turn_rad: 0.0 }, ..hold };
    branch.step(&aside).expect("a sound command");
    assert!(bits(&finger) == before);
    finger.step(&aside).expect("a sound command");
    assert!(bits(&finger) == bits(&branch));
}

#[test]
fn an_object_in_free_fall_falls() {
    let inertia = Inertia { mass_kg: 0.2, gyration_radius_mm: 20.0, centre_of_mass_mm: Vec2::ZERO };
    let body = Body { drive: Drive::Free(inertia), fingers_count: 2 };
    let settings = FingerSettings { body, ..FingerSettings::fast() };
    let weight = Wrench { force_n: Vec2::new(0.2 * 9.81, 0.0), torque_n_mm: 0.0 };
    let mut finger = Finger::new(settings, SPHERE).expect("sound settings");
    let command = Command { grip: Grip::ForceN(0.0), pose: Pose::default(), roll_mm: Vec2::ZERO, wrench: weight };
    for _ in 0..12 {
        finger.step(&command).expect("a sound command");
    }
    // Implicit Euler: g dt^2 n (n + 1) / 2.
    let fallen = 9810.0 * settings.substep_s * settings.substep_s * 78.0;
    assert!((finger.truth().pose.position_mm.x / fallen - 1.0).abs() < 1e-9);
}

/// A compliant body is no harder to solve than a path: on flat boxes of 0.1 kg, pulled nearly until they slide, no
/// frame of four steps takes more than 60 iterations. And the load of the gel at the end equals the pull, a torque
/// taken at the radius of gyration, to a tenth of the tolerance of one traction.
#[test]
fn a_free_box_is_solved_in_few_iterations_and_carries_what_pulls_on_it() {
    let inertia = Inertia { mass_kg: 0.1, gyration_radius_mm: 20.0, centre_of_mass_mm: Vec2::ZERO };
    let body = Body { drive: Drive::Free(inertia), fingers_count: 1 };
    let settings = FingerSettings { body, ..FingerSettings::fast() };
    let wide = FlatBox { length_mm: 36.0, width_mm: 26.0, edge_radius_mm: 1.0 };
    let pull = Wrench { force_n: Vec2::new(14.0, 4.0), torque_n_mm: 14.0 };
    for (shape, pull) in [(FLAT, pull.scaled(0.9)), (wide, pull)] {
        let (_, held) = run(settings, shape, vec![Leg::press(20.0, 0.25), Leg::pull(pull, 1.0), Leg::hold(0.2)]);
        assert!(held.iter().all(|truth| truth.converged));
        let of_a_frame = |steps: &[Truth]| steps.iter().map(|truth| truth.tangential_iterations_count).sum();
        let frames: Vec<u32> = held.chunks(4).map(of_a_frame).collect();
        assert!(frames.iter().all(|&iterations| iterations <= 60), "{frames:?}");
        let least_stuck = held.iter().filter_map(|truth| truth.stick_ratio).fold(1.0, f64::min);
        assert!((0.05..0.9).contains(&least_stuck), "{least_stuck} at the least stuck");
        let wrench = held[held.len() - 1].wrench;
        let missed_n = (wrench.force_n - pull.force_n).length()
            + (wrench.torque_n_mm - pull.torque_n_mm).abs() / inertia.gyration_radius_mm;
        let most_n = 0.1 * settings.tangential_stop.tolerance_fraction * pull.force_n.length();
        assert!(missed_n <= most_n, "{missed_n:e} N of {wrench:?}");
    }
}

#[test]
fn two_fingers_hold_what_statics_says_and_a_mount_pulls() {
    let inertia = Inertia { mass_kg: 0.3, gyration_radius_mm: 30.0, centre_of_mass_mm: Vec2::new(0.0, 10.0) };
    let body = Body { drive: Drive::Free(inertia), fingers_count: 2 };
    let settings = FingerSettings { body, ..FingerSettings::fast() };
    // The weight acts at the centre of mass: -e_y m g about the reference point.
    let weight = Wrench { force_n: Vec2::new(2.943, 0.0), torque_n_mm: -29.43 };
    let (_, held) = run(settings, FLAT, vec![Leg::press(15.0, 0.1), Leg::pull(weight, 0.2), Leg::hold(0.3)]);
    let last = held[held.len() - 1];
    assert!((last.wrench.force_n.x / (0.5 * 2.943) - 1.0).abs() < 2e-3, "{last:?}");
    assert!((last.wrench.torque_n_mm / (-0.5 * 29.43) - 1.0).abs() < 2e-3, "{last:?}");

    let mount = Mount {
        stiffness_n_per_mm: 20.0,
        stiffness_n_mm_per_rad: 2e4,
        damping_n_s_per_mm: 0.0,
        damping_n_mm_s_per_rad: 0.0,
    };
    let settings = FingerSettings {
        body: Body { drive: Drive::Mounted(mount, None), fingers_count: 1 },
        ..FingerSettings::fast()
    };
    let (_, pulled) = run(settings, FLAT, vec![Leg::press(15.0, 0.1), Leg::shear(0.3, 0.0, 0.1)]);
    let last = pulled[pulled.len() - 1];
    let spring_n = 20.0 * (0.3 - last.pose.position_mm.x);
    assert!(last.wrench.force_n.x > 1.0 && (last.wrench.force_n.x / spring_n - 1.0).abs() < 1e-3, "{last:?}");
}

#[test]
fn creep_goes_on_under_a_constant_force_and_comes_back() {
    let gel = Gel { creep: Some(Creep { share_fraction: 0.15, time_s: 0.1 }), ..Gel::default() };
    let settings = FingerSettings { gel, ..FingerSettings::fast() };
    let legs = || vec![Leg::press(10.0, 0.01), Leg::hold(1.0), Leg::release(0.01), Leg::hold(1.5)];
    let (finger, creeping) = run(settings, SPHERE, legs());
    let (_, plain) = run(FingerSettings::fast(), SPHERE, legs());
    // The gel finally softens by 1.15: depth grows with the 2/3 power or less of the compliance.
    let at = |truths: &[Truth], time_s: f64| truths[(time_s * 120.0) as usize].depth_mm;
    let (early, late) = (at(&creeping, 0.02), at(&creeping, 0.95));
    assert!(late / early > 1.03 && late / early < 1.15, "{early} {late}");
    assert!((late / at(&plain, 0.95)) > 1.04, "{late}");
    let rest = finger.displacement_at(Vec2::ZERO).depth_mm;
    assert!(rest.abs() < 1e-4, "{rest}");
}

#[test]
fn options_change_what_they_should() {
    let legs = || vec![Leg::press(10.0, 0.1), Leg::shear(0.4, 0.0, 0.1)];
    let end = |settings| {
        let (_, truths) = run(settings, SPHERE, legs());
        truths[truths.len() - 1]
    };
    let plain = FingerSettings::fast();
    let base = end(plain);
    let skin = end(FingerSettings { gel: Gel { membrane_n_per_mm: 0.6, ..plain.gel }, ..plain });
    assert!(skin.wrench.force_n.x > 1.02 * base.wrench.force_n.x, "a skin stiffens: {skin:?}");
    let soft = SoftObject { modulus_mpa: 0.2, poisson_ratio: 0.4, thickness_mm: 10.0 };
    let yielding = end(FingerSettings { soft_object: Some(soft), ..plain });
    assert!(yielding.depth_mm > 1.5 * base.depth_mm, "a soft object sinks in: {yielding:?}");
    assert!(yielding.contact_area_mm2 > 1.3 * base.contact_area_mm2, "{yielding:?}");
    let rough = end(FingerSettings { friction: Friction { yield_mm: 0.1, ..plain.friction }, ..plain });
    assert!(rough.wrench.force_n.x < 0.99 * base.wrench.force_n.x, "asperities give: {rough:?}");
    let law = Law::PressureDependent { adhesion_mpa: 0.0, slope: 0.8, cap_mpa: 0.04 };
    let capped = end(FingerSettings { friction: Friction { law, yield_mm: 0.0 }, ..plain });
    assert!(capped.wrench.force_n.x < 0.04 * capped.contact_area_mm2 * 1.001, "{capped:?}");
    let law = Law::SlipWeakening { mu_static: 0.8, mu_kinetic: 0.4, distance_mm: 0.02 };
    let long = vec![Leg::press(10.0, 0.1), Leg::shear(2.5, 0.0, 0.5)];
    let (_, weak) = run(FingerSettings { friction: Friction { law, yield_mm: 0.0 }, ..plain }, FLAT, long);
    let most = weak.iter().fold(0.0f64, |most, truth| most.max(truth.wrench.force_n.x));
    let last_n = weak[weak.len() - 1].wrench.force_n.x;
    assert!(most > 1.1 * last_n && (last_n / 4.0 - 1.0).abs() < 0.08, "peak {most}, then {last_n}");
}

#[test]
fn beyond_the_linear_range_is_flagged_and_never_nan() {
    let (finger, truths) = run(
        FingerSettings { friction: Friction::constant(1.2), ..FingerSettings::fast() },
        Cylinder { radius_mm: 4.0, length_mm: 6.0, edge_radius_mm: 0.0 },
        vec![
            Leg::press(80.0, 0.1),
            Leg::shear_and_twist(30.0, 5.0, 2.0, 0.3),
            Leg::roll(40.0, 0.0, 0.1),
            Leg::release(0.05),
        ],
    );
    assert!(truths.iter().any(|truth| truth.beyond_linear));
    for truth in &truths {
        assert_eq!(truth.beyond_linear, truth.largest_strain_fraction > 0.3);
        let numbers = [
            truth.depth_mm,
            truth.grip_force_n,
            truth.wrench.force_n.x,
            truth.wrench.force_n.y,
            truth.wrench.torque_n_mm,
            truth.largest_strain_fraction,
            truth.dissipated_n_mm,
            truth.stick_ratio.unwrap_or(0.0),
        ];
        assert!(numbers.iter().all(|number| number.is_finite()), "{truth:?}");
    }
    assert!((0..finger.contact().len()).all(|cell| finger.displacement(cell).shift_mm.is_finite()));
    assert!(truths.iter().any(|truth| truth.at_border), "it was pushed off the pad");
    let (_, gentle) = run(FingerSettings::fast(), FLAT, vec![Leg::press(2.0, 0.1)]);
    assert!(gentle.iter().all(|truth| !truth.beyond_linear && !truth.at_border));
}

#[test]
fn displacement_between_cells_is_bilinear_and_held_at_the_border() {
    let (finger, _) = run(FingerSettings::fast(), SPHERE, vec![Leg::press(10.0, 0.05)]);
    let grid: Grid = finger.settings().grid;
    let cell = 24 * 64 + 40;
    let (a, b) = (finger.displacement(cell), finger.displacement(cell + 1));
    let half = finger.displacement_at(grid.centre_mm(cell) + Vec2::new(0.5 * grid.cell_mm, 0.0));
    assert!((half.depth_mm - 0.5 * (a.depth_mm + b.depth_mm)).abs() < 1e-12);
    assert_eq!(finger.displacement_at(Vec2::new(-999.0, -999.0)), finger.displacement(0));
    assert_eq!(finger.displacement_at(Vec2::new(999.0, 999.0)), finger.displacement(grid.cells_count() - 1));
}

#[test]
fn a_step_takes_no_memory() {
    let gel = Gel { creep: Some(Creep { share_fraction: 0.1, time_s: 0.5 }), ..Gel::default() };
    let inertia = Inertia { mass_kg: 0.1, gyration_radius_mm: 20.0, centre_of_mass_mm: Vec2::ZERO };
    let body = Body { drive: Drive::Free(inertia), fingers_count: 1 };
    let aside = Wrench { force_n: Vec2::new(10.0, 0.0), torque_n_mm: 20.0 };
    let plain = FingerSettings::fast();
    for settings in [plain, FingerSettings { gel, ..plain }, FingerSettings { body, ..plain }] {
        let mut finger = Finger::new(settings, SPHERE).expect("sound settings");
        let legs = vec![Leg::press(20.0, 0.1), Leg::shear(2.0, 0.0, 0.2), Leg::pull(aside, 0.2), Leg::release(0.1)];
        let path = Path::new(legs).expect("sound");
        let info = allocation_counter::measure(|| {
            for command in path.commands(settings.substep_s) {
                finger.step(&command).expect("a sound command");
            }
        });
        assert_eq!(info.count_total, 0, "{info:?}");
    }
}

/// Data cached for a gel is used only by fingers with that gel.
#[test]
fn fingers_of_many_gels_do_not_get_into_each_other() {
    let plain = FingerSettings::fast();
    let of_gel = |gel: Gel| FingerSettings { gel, ..plain };
    let soft = SoftObject { modulus_mpa: 0.5, poisson_ratio: 0.485, thickness_mm: 3.0 };
    let depth_mm = |settings: FingerSettings| {
        let mut finger = Finger::new(settings, SPHERE).expect("sound settings");
        let grip = Grip::ForceN(10.0);
        let (pose, roll_mm, wrench) = (Pose::default(), Vec2::ZERO, Wrench::default());
        finger.step(&Command { grip, pose, roll_mm, wrench }).expect("a sound command").depth_mm
    };
    let first_mm = depth_mm(plain);
    let creeping = Gel { creep: Some(Creep { share_fraction: 0.5, time_s: 0.01 }), ..Gel::default() };
    let others = [
        FingerSettings { soft_object: Some(soft), ..plain },
        of_gel(creeping),
        of_gel(Gel { modulus_mpa: 0.3, ..Gel::default() }),
        FingerSettings { grid: Grid::padded(64, 48, 0.4, 12.0), ..plain },
    ];
    for other in others {
        assert_ne!(depth_mm(other), first_mm, "{other:?}");
    }
    // More than the cache holds.
    for n in 0..12 {
        let thicker_mm = depth_mm(of_gel(Gel { thickness_mm: 3.0 + 0.1 * f64::from(n), ..Gel::default() }));
        assert!(n == 0 || thicker_mm > first_mm, "{n}");
    }
    assert_eq!(depth_mm(plain), first_mm);
}
