//! The scenes.

use super::keys::MOST_DEG_PER_S;
use super::load_profile::{LoadProfile, Pull};
use super::parameters::Parameters;
use super::scene::Scene;
use crate::contact::{Drive, Inertia, Leg, Mount, Path};
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// How long a scene continues after its last event, in s.
const TAIL_S: f64 = 0.2;

/// Damping of a pull at an object, in N s/mm: once it slides, it slides at some 30 mm/s for every N of excess force, as
/// in a hand, instead of flying off. Before that it takes 1 % or less off the load of a ramp of 1 s. Estimate.
const PULL_DAMPING_N_S_PER_MM: f64 = 0.03;

/// The same for rotation, in N mm s/rad: as if the damping acted 6 mm from the middle.
const PULL_DAMPING_N_MM_S_PER_RAD: f64 = 1.0;

/// All scenes.
pub const SCENES: [Scene; 12] = [
    Scene { name: "press", what: "pressed and held", defaults: &[("hold_s", "1")], profile: press },
    Scene {
        name: "press_release",
        what: "pressed, held, let go",
        defaults: &[("hold_s", "0.5")],
        profile: press_release,
    },
    Scene {
        name: "shear",
        what: "pressed, then moved sideways; most objects slide",
        defaults: &[("distance_mm", "3"), ("direction_deg", "0"), ("speed_mm_per_s", "3")],
        profile: shear,
    },
    Scene {
        name: "twist",
        what: "pressed, then turned; most objects slide",
        defaults: &[("angle_deg", "50"), ("speed_deg_per_s", "20")],
        profile: twist,
    },
    Scene {
        name: "shear_and_twist",
        what: "pressed, then moved and turned together",
        defaults: &[("distance_mm", "2.5"), ("direction_deg", "0"), ("angle_deg", "15"), ("speed_mm_per_s", "2.5")],
        profile: shear_and_twist,
    },
    Scene {
        name: "roll",
        what: "pressed, then rolled over the pad without being pulled",
        defaults: &[("distance_mm", "3"), ("direction_deg", "90"), ("speed_mm_per_s", "3")],
        profile: roll,
    },
    Scene {
        name: "quiet_grip_steps",
        what: "gripped harder step by step, nothing pulls",
        defaults: &[("force_n", "10"), ("step_n", "10"), ("most_n", "60"), ("hold_s", "0.5")],
        profile: quiet_grip_steps,
    },
    Scene {
        name: "vibration",
        what: "held while the hand shakes, too little to slide",
        defaults: &[("distance_mm", "0.03"), ("direction_deg", "0"), ("frequency_hz", "8"), ("hold_s", "2")],
        profile: vibration,
    },
    Scene {
        name: "ramp",
        what: "pulled and turned by a load that grows evenly until it slides",
        defaults: &[
            ("direction_deg", "0"),
            ("twist_fraction", "0"),
            ("ramp_s", "1"),
            ("peak_fraction", "1.8"),
            ("hold_s", "0.5"),
        ],
        profile: ramp,
    },
    Scene {
        name: "regrip",
        what: "pulled and turned by a load that grows evenly while the grip is changed in steps",
        defaults: &[
            ("direction_deg", "0"),
            ("twist_fraction", "0"),
            ("ramp_s", "1"),
            ("peak_fraction", "3.6"),
            ("hold_s", "0.2"),
            ("regrip_fraction", "2"),
            ("regrip_at_fraction", "0.8"),
            ("regrips", "3"),
        ],
        profile: regrip,
    },
    Scene {
        name: "fill",
        what: "a bottle lifted between two fingers and filled until it falls",
        defaults: &[
            ("object", "water_bottle"),
            ("force_n", "5"),
            ("mu", "0.35"),
            ("direction_deg", "0"),
            ("lift_s", "0.5"),
            ("fill_kg_per_s", "0.25"),
            ("most_kg", "1.5"),
            ("hold_s", "1"),
        ],
        profile: fill,
    },
    Scene {
        name: "tape_push",
        what: "a roll of tape pushed by a springy arm and let back",
        defaults: &[
            ("object", "tape_roll"),
            ("distance_mm", "2.5"),
            ("direction_deg", "90"),
            ("speed_mm_per_s", "2.5"),
            ("arm_n_per_mm", "20"),
        ],
        profile: tape_push,
    },
];

impl Scene {
    /// The scene of a name; the error lists the names.
    pub fn named(name: &str) -> Result<&'static Scene, SettingError> {
        SCENES
            .iter()
            .find(|scene| scene.name == name)
            .ok_or_else(|| SettingError::none_of("scene", name, &SCENES.map(|scene| scene.name)))
    }
}

/// The legs that begin every scene, and their end time.
fn begin(set: &Parameters) -> (Vec<Leg>, f64) {
    let (press_s, settle_s) = (set.number("press_s"), set.number("settle_s"));
    (vec![Leg::press(set.number("force_n"), press_s), Leg::hold(settle_s)], press_s + settle_s)
}

/// A guided object without load.
fn unloaded(legs: Vec<Leg>) -> Result<LoadProfile, SettingError> {
    Ok(LoadProfile {
        path: Path::new(legs)?,
        pull: Pull::None,
        drive: Drive::Guided,
        fingers_count: 1,
        load_from_s: None,
        along: (Vec2::ZERO, 0.0),
    })
}

/// A guided object moved after pressing.
fn moved(set: &Parameters, shift_mm: Vec2, turn_rad: f64, seconds_s: f64) -> Result<LoadProfile, SettingError> {
    let (mut legs, begin_s) = begin(set);
    legs.push(Leg::shear_and_twist(shift_mm.x, shift_mm.y, turn_rad, seconds_s));
    legs.push(Leg::hold(TAIL_S));
    Ok(LoadProfile { load_from_s: Some(begin_s), along: (shift_mm, turn_rad), ..unloaded(legs)? })
}

fn direction_rad(set: &Parameters) -> f64 {
    set.number("direction_deg").to_radians()
}

/// `distance_mm` towards `direction_deg`, and its duration at the requested speed.
fn way(set: &Parameters) -> (Vec2, f64) {
    let (s, c) = libm::sincos(direction_rad(set));
    let distance_mm = set.number("distance_mm");
    let seconds_s = (distance_mm / set.number("speed_mm_per_s")).max(1.0 / 30.0);
    (Vec2::new(c, s) * distance_mm, seconds_s)
}

fn press(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let (mut legs, _) = begin(set);
    legs.push(Leg::hold(set.number("hold_s")));
    unloaded(legs)
}

fn press_release(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let (mut legs, _) = begin(set);
    legs.extend([Leg::hold(set.number("hold_s")), Leg::release(set.number("press_s")), Leg::hold(TAIL_S)]);
    unloaded(legs)
}

fn shear(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let (shift_mm, seconds_s) = way(set);
    moved(set, shift_mm, 0.0, seconds_s)
}

fn twist(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let angle_deg = set.number("angle_deg");
    let seconds_s = (angle_deg.abs() / set.number("speed_deg_per_s")).max(1.0 / 30.0);
    moved(set, Vec2::ZERO, angle_deg.to_radians(), seconds_s)
}

fn shear_and_twist(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let (shift_mm, seconds_s) = way(set);
    let angle_deg = set.number("angle_deg");
    let deg_per_s = angle_deg.abs() / seconds_s;
    if deg_per_s > MOST_DEG_PER_S {
        // The rotation takes as long as the motion.
        return Err(SettingError {
            key: "distance_mm, speed_mm_per_s, angle_deg".into(),
            got: format!("{angle_deg} deg in {seconds_s:.3} s, the time of the motion"),
            expected: format!("a rotation by at most {MOST_DEG_PER_S} deg/s"),
        });
    }
    moved(set, shift_mm, angle_deg.to_radians(), seconds_s)
}

fn roll(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let (shift_mm, seconds_s) = way(set);
    let (mut legs, _) = begin(set);
    legs.extend([Leg::roll(shift_mm.x, shift_mm.y, seconds_s), Leg::hold(TAIL_S)]);
    unloaded(legs)
}

fn quiet_grip_steps(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let (mut legs, _) = begin(set);
    let (mut force_n, most_n) = (set.number("force_n"), set.number("most_n"));
    if most_n < force_n {
        return Err(SettingError {
            key: "most_n".into(),
            got: most_n.to_string(),
            expected: format!("at least force_n, {force_n}"),
        });
    }
    while force_n < most_n {
        force_n = (force_n + set.number("step_n")).min(most_n);
        legs.extend([Leg::hold(set.number("hold_s")), Leg::press(force_n, 0.1)]);
    }
    legs.push(Leg::hold(set.number("hold_s")));
    unloaded(legs)
}

fn vibration(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let (mut legs, _) = begin(set);
    let (s, c) = libm::sincos(direction_rad(set));
    let far_mm = Vec2::new(c, s) * set.number("distance_mm");
    // Back and forth in straight legs: a triangle wave of the requested frequency, starting and ending in the middle.
    let quarter_s = 0.25 / set.number("frequency_hz");
    let there = |way: f64, seconds_s: f64| Leg::shear(way * far_mm.x, way * far_mm.y, seconds_s);
    for _ in 0..(set.number("hold_s") / (4.0 * quarter_s)).ceil() as u32 {
        legs.extend([there(1.0, quarter_s), there(-2.0, 2.0 * quarter_s), there(1.0, quarter_s)]);
    }
    unloaded(legs)
}

/// Inertia of the object in the scene.
fn inertia(set: &Parameters) -> Inertia {
    let object = set.object();
    Inertia { mass_kg: object.mass_kg, gyration_radius_mm: object.gyration_radius_mm, centre_of_mass_mm: Vec2::ZERO }
}

/// How long a step of the grip takes, in s.
const REGRIP_S: f64 = 0.1;

/// A ramp during which the grip changes: evenly spaced steps by the same factor, until the load has reached the unit
/// that holds at the last grip.
fn regrip(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let mut profile = ramp(set)?;
    let (mut legs, _) = begin(set);
    let (last_fraction, steps) = (set.number("regrip_fraction"), set.number("regrips"));
    let whole_s = set.number("ramp_s") * set.number("peak_fraction") + set.number("hold_s");
    let span_s = set.number("regrip_at_fraction") * set.number("ramp_s") * last_fraction.max(1.0);
    let wait_s = (span_s / steps - REGRIP_S).max(0.02);
    for step in 1..=steps as u32 {
        let force_n = set.number("force_n") * libm::pow(last_fraction, f64::from(step) / steps);
        legs.extend([Leg::hold(wait_s), Leg::press(force_n, REGRIP_S)]);
    }
    legs.push(Leg::hold((whole_s - steps * (wait_s + REGRIP_S)).max(0.1)));
    profile.path = Path::new(legs)?;
    Ok(profile)
}

fn ramp(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let (mut legs, begin_s) = begin(set);
    let (ramp_s, peak_fraction) = (set.number("ramp_s"), set.number("peak_fraction"));
    legs.push(Leg::hold(ramp_s * peak_fraction + set.number("hold_s")));
    let mount = Mount {
        stiffness_n_per_mm: 0.0,
        stiffness_n_mm_per_rad: 0.0,
        damping_n_s_per_mm: PULL_DAMPING_N_S_PER_MM,
        damping_n_mm_s_per_rad: PULL_DAMPING_N_MM_S_PER_RAD,
    };
    let pull = Pull::Ramp {
        direction_rad: direction_rad(set),
        twist_fraction: set.number("twist_fraction"),
        ramp_s,
        peak_fraction,
    };
    Ok(LoadProfile {
        pull,
        drive: Drive::Mounted(mount, Some(inertia(set))),
        load_from_s: Some(begin_s),
        ..unloaded(legs)?
    })
}

fn fill(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let (mut legs, begin_s) = begin(set);
    let inertia = inertia(set);
    let (lift_s, fill_kg_per_s, most_kg) = (set.number("lift_s"), set.number("fill_kg_per_s"), set.number("most_kg"));
    if most_kg < inertia.mass_kg {
        return Err(SettingError {
            key: "most_kg".into(),
            got: most_kg.to_string(),
            expected: format!("at least the mass of the object, {} kg", inertia.mass_kg),
        });
    }
    let filling_s = (most_kg - inertia.mass_kg) / fill_kg_per_s;
    legs.push(Leg::hold(lift_s + filling_s + set.number("hold_s")));
    let pull =
        Pull::Weight { direction_rad: direction_rad(set), lift_s, mass_kg: inertia.mass_kg, fill_kg_per_s, most_kg };
    Ok(LoadProfile {
        pull,
        drive: Drive::Free(inertia),
        fingers_count: 2,
        load_from_s: Some(begin_s),
        ..unloaded(legs)?
    })
}

fn tape_push(set: &Parameters) -> Result<LoadProfile, SettingError> {
    let (shift_mm, seconds_s) = way(set);
    let (mut legs, begin_s) = begin(set);
    let there = |way: f64| Leg::shear(way * shift_mm.x, way * shift_mm.y, seconds_s);
    legs.extend([there(1.0), Leg::hold(TAIL_S), there(-1.0), Leg::hold(TAIL_S)]);
    let stiffness_n_per_mm = set.number("arm_n_per_mm");
    let mount = Mount {
        stiffness_n_per_mm,
        stiffness_n_mm_per_rad: 1000.0 * stiffness_n_per_mm,
        damping_n_s_per_mm: 0.01,
        damping_n_mm_s_per_rad: 10.0,
    };
    let drive = Drive::Mounted(mount, Some(inertia(set)));
    Ok(LoadProfile { drive, load_from_s: Some(begin_s), along: (shift_mm, 0.0), ..unloaded(legs)? })
}
