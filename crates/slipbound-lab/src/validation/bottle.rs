//! A bottle held by two fingers and filled until it falls.

use super::row::Row;
use crate::contact::shape::Cylinder;
use crate::contact::{Body, Command, Drive, Event, Finger, FingerSettings, Friction, Grip, Inertia, Pose, Wrench};
use slipbound::plane::Vec2;

/// Rounded, not [`GRAVITY_MM_PER_S2`](crate::scenes::GRAVITY_MM_PER_S2): the masses in docs/simulator.md were computed with
/// it, and differ in the fourth digit from those of the standard value.
const ROUND_GRAVITY_MM_PER_S2: f64 = 9_810.0;

/// The mass at which the bottle slides against 2 mu P / g.
pub fn filling_bottle() -> Vec<Row> {
    const MU: f64 = 0.5;
    const FORCE_N: f64 = 10.0;
    let bottle = |mass_kg: f64| Body {
        drive: Drive::Free(Inertia { mass_kg, gyration_radius_mm: 60.0, centre_of_mass_mm: Vec2::ZERO }),
        fingers_count: 2,
    };
    let settings =
        FingerSettings { friction: Friction::constant(MU), body: bottle(0.05), ..FingerSettings::standard() };
    let shape = Cylinder { radius_mm: 32.0, length_mm: 30.0, edge_radius_mm: 1.0 };
    let mut finger = Finger::new(settings, shape).expect("sound settings");
    let (press_s, rate_kg_per_s) = (0.1, 0.25);
    let steps = (6.0 / settings.substep_s) as u32;
    let mut fell_kg = f64::NAN;
    for n in 1..=steps {
        let time_s = f64::from(n) * settings.substep_s;
        let mass_kg = 0.05 + rate_kg_per_s * (time_s - press_s).max(0.0);
        finger.set_body(bottle(mass_kg)).expect("a sound mass");
        let weight_n = if time_s > press_s { mass_kg * 1e-3 * ROUND_GRAVITY_MM_PER_S2 } else { 0.0 };
        let truth = finger
            .step(&Command {
                grip: Grip::ForceN(FORCE_N * (time_s / press_s).min(1.0)),
                pose: Pose::default(),
                roll_mm: Vec2::ZERO,
                wrench: Wrench { force_n: Vec2::new(weight_n, 0.0), torque_n_mm: 0.0 },
            })
            .expect("a sound command");
        if time_s > press_s && truth.events.contains(Event::Gross) {
            fell_kg = mass_kg;
            break;
        }
    }
    let theory_kg = 2.0 * MU * FORCE_N / (ROUND_GRAVITY_MM_PER_S2 * 1e-3);
    vec![Row::relative("filling bottle, two fingers: mass at gross slip", theory_kg, fell_kg, "kg", 0.02)]
}
