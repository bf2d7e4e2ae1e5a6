//! Invalid settings and commands are refused by name, with the expected and the received value.

use slipbound::plane::Vec2;
use slipbound::setting::SettingError;
use slipbound_lab::contact::shape::{Cylinder, FlatBox, Shape, Sphere};
use slipbound_lab::contact::{
    Body, Change, Command, Drive, Finger, FingerSettings, Friction, Grip, Inertia, Law, Leg, Mount, Path, Pose, Rail,
    Springs, Wrench,
};
use slipbound_lab::layer::{Creep, Gel, SoftObject};

const SPHERE: Sphere = Sphere { radius_mm: 15.0 };

fn refused(settings: FingerSettings, shape: impl Shape + 'static) -> SettingError {
    Finger::new(settings, shape).expect_err("refused")
}

#[test]
fn settings_out_of_range() {
    let plain = FingerSettings::fast();
    let gel = |gel: Gel| FingerSettings { gel, ..plain };
    let friction = |law: Law| FingerSettings { friction: Friction { law, yield_mm: 0.0 }, ..plain };
    let body = |drive: Drive| FingerSettings { body: Body { drive, fingers_count: 1 }, ..plain };
    let still = Mount {
        stiffness_n_per_mm: 0.0,
        stiffness_n_mm_per_rad: 0.0,
        damping_n_s_per_mm: 0.0,
        damping_n_mm_s_per_rad: 0.0,
    };
    let weightless = Inertia { mass_kg: 0.0, gyration_radius_mm: 1.0, centre_of_mass_mm: Vec2::ZERO };
    let brick = Inertia { mass_kg: 1.0, gyration_radius_mm: 1.0, centre_of_mass_mm: Vec2::ZERO };
    let springs = |stiffness: [[f64; 3]; 3]| body(Drive::Sprung(Springs { stiffness, ..Springs::default() }, brick));
    let rail = Rail {
        shift_mm: Vec2::new(0.0, 14.0),
        turn_rad: 0.0,
        roll_mm: Vec2::ZERO,
        push: -40.0,
        stiffness: 0.0,
        damping_s: 14.0,
    };
    let soft = SoftObject { modulus_mpa: 0.1, poisson_ratio: 0.5, thickness_mm: 1.0 };
    let mut odd = plain;
    odd.grid.padded_width_cells = 97;
    let mut narrow = plain;
    narrow.grid.padded_height_cells = 40;
    let mut tiny = plain;
    tiny.grid.width_cells = 4;
    for (settings, key, got) in [
        (friction(Law::Constant { mu: 0.0 }), "friction.mu", "0"),
        (friction(Law::Constant { mu: -0.3 }), "friction.mu", "-0.3"),
        (friction(Law::Constant { mu: f64::NAN }), "friction.mu", "NaN"),
        (
            friction(Law::SlipWeakening { mu_static: 0.5, mu_kinetic: 0.6, distance_mm: 0.1 }),
            "friction.mu_kinetic",
            "0.6",
        ),
        (
            friction(Law::PressureDependent { adhesion_mpa: -1.0, slope: 0.5, cap_mpa: 0.1 }),
            "friction.adhesion_mpa",
            "-1",
        ),
        (
            FingerSettings { friction: Friction { yield_mm: -0.1, ..plain.friction }, ..plain },
            "friction.yield_mm",
            "-0.1",
        ),
        (gel(Gel { poisson_ratio: 0.5, ..plain.gel }), "gel.poisson_ratio", "0.5"),
        (gel(Gel { poisson_ratio: -0.1, ..plain.gel }), "gel.poisson_ratio", "-0.1"),
        (gel(Gel { modulus_mpa: f64::INFINITY, ..plain.gel }), "gel.modulus_mpa", "inf"),
        (gel(Gel { thickness_mm: 0.0, ..plain.gel }), "gel.thickness_mm", "0"),
        (gel(Gel { membrane_n_per_mm: -1.0, ..plain.gel }), "gel.membrane_n_per_mm", "-1"),
        (gel(Gel { creep: Some(Creep { share_fraction: 0.1, time_s: 0.0 }), ..plain.gel }), "gel.creep.time_s", "0"),
        (FingerSettings { soft_object: Some(soft), ..plain }, "soft_object.poisson_ratio", "0.5"),
        (FingerSettings { substep_s: 0.0, ..plain }, "substep_s", "0"),
        (FingerSettings { body: Body { fingers_count: 0, ..plain.body }, ..plain }, "body.fingers_count", "0"),
        (body(Drive::Free(weightless)), "body.mass_kg", "0"),
        (body(Drive::Mounted(still, None)), "body.stiffness_n_per_mm + damping_n_s_per_mm of a body without mass", "0"),
        (
            springs([[0.0, 1.0, 0.0], [0.0; 3], [0.0; 3]]),
            "body.stiffness",
            "[[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]",
        ),
        (
            springs([[-1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]]),
            "body.stiffness",
            "[[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]",
        ),
        (body(Drive::Sprung(Springs::default(), weightless)), "body.mass_kg", "0"),
        (body(Drive::Railed(Rail { shift_mm: Vec2::ZERO, ..rail })), "body.shift_mm + turn_rad of a rail", "0"),
        (body(Drive::Railed(Rail { push: f64::NAN, ..rail })), "body.push of a rail, its size", "NaN"),
        (body(Drive::Railed(Rail { damping_s: 0.0, ..rail })), "body.stiffness + damping_s of a rail", "0"),
        (odd, "grid.padded_width_cells", "97"),
        (narrow, "grid.padded_height_cells", "40"),
        (tiny, "grid.width_cells", "4"),
    ] {
        let error = refused(settings, SPHERE);
        assert_eq!((error.key.as_str(), error.got.as_str()), (key, got), "{error}");
        assert!(!error.expected.is_empty());
    }
}

#[test]
fn an_object_larger_than_the_pad() {
    let plain = FingerSettings::fast(); // 40 x 30 mm
    let error = refused(plain, FlatBox { length_mm: 60.0, width_mm: 20.0, edge_radius_mm: 1.0 });
    assert_eq!(
        error.to_string(),
        "shape: expected at most 38.75 x 28.75 mm, the pad less a cell all round, \
         got an object of 60.00 x 20.00 mm about the middle of the pad"
    );
    // It fits along the pad, but not across it, and not at its rim.
    let bar = Cylinder { radius_mm: 10.0, length_mm: 36.0, edge_radius_mm: 1.0 };
    assert!(Finger::new(plain, bar).is_ok());
    let across = Pose { turn_rad: std::f64::consts::FRAC_PI_2, ..Pose::default() };
    assert_eq!(refused(FingerSettings { shape_in_object: across, ..plain }, bar).key, "shape");
    let aside = Pose { position_mm: Vec2::new(5.0, 0.0), ..Pose::default() };
    assert_eq!(refused(FingerSettings { shape_in_object: aside, ..plain }, bar).key, "shape");
}

#[test]
fn shapes_out_of_range() {
    let plain = FingerSettings::fast();
    assert_eq!(refused(plain, Sphere { radius_mm: -1.0 }).key, "sphere.radius_mm");
    assert_eq!(refused(plain, Sphere { radius_mm: f64::NAN }).key, "sphere.radius_mm");
    let blunt = FlatBox { length_mm: 10.0, width_mm: 4.0, edge_radius_mm: 3.0 };
    assert_eq!(refused(plain, blunt).to_string(), "flat_box.edge_radius_mm: expected at most 2, got 3");
}

#[test]
fn commands_that_make_no_sense_change_nothing() {
    let mut finger = Finger::new(FingerSettings::fast(), SPHERE).expect("sound settings");
    let sound =
        Command { grip: Grip::ForceN(5.0), pose: Pose::default(), roll_mm: Vec2::ZERO, wrench: Wrench::default() };
    finger.step(&sound).expect("a sound command");
    let before = *finger.truth();
    let nan = Vec2::new(f64::NAN, 0.0);
    for (command, key) in [
        (Command { grip: Grip::ForceN(-5.0), ..sound }, "grip.force_n"),
        (Command { grip: Grip::ForceN(f64::INFINITY), ..sound }, "grip.force_n"),
        (Command { grip: Grip::DepthMm(f64::NAN), ..sound }, "grip.depth_mm"),
        (Command { pose: Pose { position_mm: nan, turn_rad: 0.0 }, ..sound }, "command.pose"),
        (Command { roll_mm: nan, ..sound }, "command.roll_mm, command.wrench"),
        (Command { wrench: Wrench { force_n: nan, torque_n_mm: 0.0 }, ..sound }, "command.roll_mm, command.wrench"),
    ] {
        assert_eq!(finger.step(&command).expect_err("refused").key, key);
        assert_eq!(*finger.truth(), before);
    }
}

#[test]
fn paths_that_make_no_sense() {
    let key = |legs: Vec<Leg>| Path::new(legs).expect_err("refused").key;
    assert_eq!(key(vec![Leg::press(-5.0, 0.1)]), "path[0].grip_to_n");
    assert_eq!(key(vec![Leg::press(5.0, 0.1), Leg::hold(0.0)]), "path[1].seconds_s");
    assert_eq!(key(vec![Leg::twist(f64::NAN, 0.1)]), "path[0].turn_rad");
    let both = Change { grip_to_n: Some(1.0), grip_to_depth_mm: Some(1.0), ..Change::default() };
    assert_eq!(key(vec![Leg { seconds_s: 1.0, change: both }]), "path[0].grip_to_depth_mm");
}
