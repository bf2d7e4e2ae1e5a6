//! The object as a rigid body in the plane of the gel: its pose, its drive, its compliance.

use crate::layer::{above_zero, zero_or_above};
use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// Force in N that accelerates a mass of 1 kg by 1 mm/s2: tonnes per kilogram.
const TONNES_PER_KG: f64 = 1e-3;

/// Pose of the object.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Its reference point in mm, in gel coordinates.
    pub position_mm: Vec2,
    /// Its rotation in rad, positive from x to y.
    pub turn_rad: f64,
}

impl Pose {
    /// The same pose in axes that are turned by `turn_rad`.
    pub(crate) fn seen_turned(self, turn_rad: f64) -> Pose {
        let (s, c) = libm::sincos(turn_rad);
        let Vec2 { x, y } = self.position_mm;
        Pose { position_mm: Vec2::new(c * x + s * y, c * y - s * x), turn_rad: self.turn_rad - turn_rad }
    }
}

/// Force and torque in the plane.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wrench {
    /// Force in N.
    pub force_n: Vec2,
    /// Torque in N mm about the object's reference point, positive from x to y.
    pub torque_n_mm: f64,
}

impl Wrench {
    /// Force and torque together, multiplied by a number.
    pub fn scaled(self, factor: f64) -> Self {
        Wrench { force_n: self.force_n * factor, torque_n_mm: self.torque_n_mm * factor }
    }
}

/// Mass of the object.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inertia {
    /// Mass in kg, above 0.
    pub mass_kg: f64,
    /// Radius of gyration about the centre of mass in mm, above 0.
    pub gyration_radius_mm: f64,
    /// Centre of mass relative to the reference point, in mm.
    pub centre_of_mass_mm: Vec2,
}

/// A spring and a damper between the object and the hand or ground it is attached to, whose pose is commanded.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mount {
    /// Stiffness against translation in N/mm, 0 or above.
    pub stiffness_n_per_mm: f64,
    /// Stiffness against rotation in N mm/rad, 0 or above.
    pub stiffness_n_mm_per_rad: f64,
    /// Damping of translation in N s/mm, 0 or above.
    pub damping_n_s_per_mm: f64,
    /// Damping of rotation in N mm s/rad, 0 or above.
    pub damping_n_mm_s_per_rad: f64,
}

/// Springs and dampers of any kind between the object and the world, over (x in mm, y in mm, turn in rad). The spring
/// force at the object's present pose is part of the commanded wrench.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Springs {
    /// Increase of the force against a displacement, symmetric and not negative, in N/mm, N and N mm/rad.
    pub stiffness: [[f64; 3]; 3],
    /// Force against a velocity, the same in s.
    pub damping: [[f64; 3]; 3],
}

/// A degree of freedom r of an object that otherwise follows the commanded pose: a screw that turns in its thread. r is
/// counted from the commanded pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rail {
    /// Displacement in mm per unit of r.
    pub shift_mm: Vec2,
    /// Rotation in rad per unit of r.
    pub turn_rad: f64,
    /// How far the lowest point rolls over the object's skin per unit of r, in mm: opposite to the displacement where a
    /// round profile stays in place while its skin moves. Pressure on the profile then does no work on r.
    pub roll_mm: Vec2,
    /// Generalised force along r at r = 0, in addition to that of the gel.
    pub push: f64,
    /// Increase of the force against r, 0 or above.
    pub stiffness: f64,
    /// Force against the rate of r, in s, 0 or above; with the stiffness above 0.
    pub damping_s: f64,
}

/// What determines the motion of the object.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Drive {
    /// It follows the commanded pose exactly.
    #[default]
    Guided,
    /// The commanded wrench accelerates its mass.
    Free(Inertia),
    /// A spring pulls it to the commanded pose, and the commanded wrench acts on it too.
    Mounted(Mount, Option<Inertia>),
    /// The commanded wrench accelerates its mass; springs and dampers restrain it.
    Sprung(Springs, Inertia),
    /// It follows the commanded pose except along one degree of freedom.
    Railed(Rail),
}

/// The object as a body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// What drives it.
    pub drive: Drive,
    /// How many identical fingers hold it, 1 or more; only one of them is computed.
    pub fingers_count: u32,
}

impl Default for Body {
    /// One finger, guided.
    fn default() -> Self {
        Body { drive: Drive::Guided, fingers_count: 1 }
    }
}

impl Body {
    /// Fails for numbers outside the ranges of the fields, and for mounts without stiffness and without mass.
    pub fn check(&self) -> Result<(), SettingError> {
        let bad = |key: &str, got: String, expected: &str| {
            Err(SettingError { key: key.into(), got, expected: expected.into() })
        };
        if self.fingers_count == 0 {
            return bad("body.fingers_count", "0".into(), "1 or more");
        }
        let check_inertia = |inertia: &Inertia| {
            above_zero("body.mass_kg", inertia.mass_kg)?;
            above_zero("body.gyration_radius_mm", inertia.gyration_radius_mm)?;
            if inertia.centre_of_mass_mm.is_finite() {
                return Ok(());
            }
            bad("body.centre_of_mass_mm", format!("{:?}", inertia.centre_of_mass_mm), "finite numbers")
        };
        match &self.drive {
            Drive::Guided => Ok(()),
            Drive::Free(inertia) => check_inertia(inertia),
            Drive::Sprung(springs, inertia) => {
                for (key, matrix) in [("body.stiffness", &springs.stiffness), ("body.damping", &springs.damping)] {
                    let sound = |i: usize, j: usize| matrix[i][j].is_finite() && matrix[i][j] == matrix[j][i];
                    if !(0..3).all(|i| (0..3).all(|j| sound(i, j)) && matrix[i][i] >= 0.0) {
                        return bad(key, format!("{matrix:?}"), "a symmetric matrix that is not negative");
                    }
                }
                check_inertia(inertia)
            }
            Drive::Railed(rail) => {
                let along = rail.shift_mm.length() + rail.turn_rad.abs();
                above_zero("body.shift_mm + turn_rad of a rail", along)?;
                zero_or_above("body.push of a rail, its size", rail.push.abs())?;
                zero_or_above("body.stiffness of a rail", rail.stiffness)?;
                zero_or_above("body.damping_s of a rail", rail.damping_s)?;
                above_zero("body.stiffness + damping_s of a rail", rail.stiffness + rail.damping_s)
            }
            Drive::Mounted(mount, inertia) => {
                zero_or_above("body.stiffness_n_per_mm", mount.stiffness_n_per_mm)?;
                zero_or_above("body.stiffness_n_mm_per_rad", mount.stiffness_n_mm_per_rad)?;
                zero_or_above("body.damping_n_s_per_mm", mount.damping_n_s_per_mm)?;
                zero_or_above("body.damping_n_mm_s_per_rad", mount.damping_n_mm_s_per_rad)?;
                match inertia {
                    Some(inertia) => check_inertia(inertia),
                    None => {
                        above_zero(
                            "body.stiffness_n_per_mm + damping_n_s_per_mm of a body without mass",
                            mount.stiffness_n_per_mm + mount.damping_n_s_per_mm,
                        )?;
                        above_zero(
                            "body.stiffness_n_mm_per_rad + damping_n_mm_s_per_rad of a body without mass",
                            mount.stiffness_n_mm_per_rad + mount.damping_n_mm_s_per_rad,
                        )
                    }
                }
            }
        }
    }

    /// One implicit Euler step of the body: (M/dt^2 + D/dt + K) dd = M v/dt + K (target - pose) + F - n Q, hence dd =
    /// free - W n Q. `area` converts sums of tractions to forces; `on_profile` is the sum over the cells of the
    /// in-plane traction that pressure exerts on the profile.
    pub(crate) fn step(
        &self,
        (pose, target): (Pose, Pose),
        wrench: Wrench,
        velocity: Motion,
        dt: f64,
        area: f64,
        on_profile: Complex64,
    ) -> (Motion, Option<Resistance>) {
        let away =
            Motion { shift: complex(target.position_mm - pose.position_mm), turn: target.turn_rad - pose.turn_rad };
        let share = area * f64::from(self.fingers_count);
        let (mount, springs, inertia) = match self.drive {
            Drive::Guided => return (away, None),
            Drive::Free(inertia) => (None, None, Some(inertia)),
            Drive::Mounted(mount, inertia) => (Some(mount), None, inertia),
            Drive::Sprung(springs, inertia) => (None, Some(springs), Some(inertia)),
            Drive::Railed(rail) => return rail.step(away, dt, share, on_profile),
        };
        let mut stiff = [[0.0; 3]; 3];
        let mut push = [wrench.force_n.x, wrench.force_n.y, wrench.torque_n_mm];
        if let Some(mount) = mount {
            for (i, (k, d, away)) in [
                (mount.stiffness_n_per_mm, mount.damping_n_s_per_mm, away.shift.re),
                (mount.stiffness_n_per_mm, mount.damping_n_s_per_mm, away.shift.im),
                (mount.stiffness_n_mm_per_rad, mount.damping_n_mm_s_per_rad, away.turn),
            ]
            .into_iter()
            .enumerate()
            {
                stiff[i][i] += k + d / dt;
                push[i] += k * away;
            }
        }
        if let Some(springs) = springs {
            for (stiff, (k, d)) in stiff.iter_mut().zip(springs.stiffness.iter().zip(&springs.damping)) {
                for (stiff, (k, d)) in stiff.iter_mut().zip(k.iter().zip(d)) {
                    *stiff += k + d / dt;
                }
            }
        }
        // The rotation of this step is known only after the solution; a second pass uses it, but without the action of
        // the gel.
        let mut turn = velocity.turn * dt;
        if let Some(inertia) = inertia.filter(|inertia| inertia.centre_of_mass_mm != Vec2::ZERO) {
            let (mut stiff, mut push) = (stiff, push);
            inertia.resist(pose.turn_rad, turn, velocity, dt, &mut stiff, &mut push);
            turn = times(&inverse(&stiff), push)[2];
        }
        if let Some(inertia) = inertia {
            inertia.resist(pose.turn_rad, turn, velocity, dt, &mut stiff, &mut push);
        }
        let compliance = inverse(&stiff);
        let free = times(&compliance, push);
        let compliance = compliance.map(|row| row.map(|entry| entry * share));
        (Motion { shift: Complex64::new(free[0], free[1]), turn: free[2] }, Some(Resistance { compliance }))
    }
}

impl Inertia {
    /// Adds M/dt^2 to the stiffness of a step and M v/dt to the load. Force accelerates the centre of mass, torque
    /// about it the rotation. The centre of mass moves on an arc about the reference point: over a step it moves by
    /// turn times its lever at half the turn, to third order. That lever is used for this step, with a turn of
    /// `next_rad`, and for the last one. The difference of the two levers gives the centripetal force.
    fn resist(
        &self,
        turn_rad: f64,
        next_rad: f64,
        velocity: Motion,
        dt: f64,
        stiff: &mut [[f64; 3]; 3],
        push: &mut [f64; 3],
    ) {
        let m = self.mass_kg * TONNES_PER_KG;
        let spin = m * self.gyration_radius_mm * self.gyration_radius_mm;
        let lever = |turn_rad: f64| rotation(turn_rad) * complex(self.centre_of_mass_mm);
        let (last, e) = (lever(turn_rad - 0.5 * velocity.turn * dt), lever(turn_rad + 0.5 * next_rad));
        let momentum = velocity.at(last) * m;
        let mass = [[m, 0.0, -m * e.im], [0.0, m, m * e.re], [-m * e.im, m * e.re, spin + m * e.norm_sqr()]];
        for (row, line) in mass.iter().enumerate() {
            for (column, entry) in line.iter().enumerate() {
                stiff[row][column] += entry / (dt * dt);
            }
        }
        push[0] += momentum.re / dt;
        push[1] += momentum.im / dt;
        push[2] += (spin * velocity.turn + e.re * momentum.im - e.im * momentum.re) / dt;
    }
}

impl Rail {
    /// (K + D/dt) r = push - n a . Q - n roll . S and dd = away + a r, with a the direction of the rail and S the
    /// in-plane traction of the pressure on the profile. `share` converts sums of tractions of one finger to the forces
    /// of all.
    fn step(&self, away: Motion, dt: f64, share: f64, on_profile: Complex64) -> (Motion, Option<Resistance>) {
        let rail_compliance = 1.0 / (self.stiffness + self.damping_s / dt);
        let along = [self.shift_mm.x, self.shift_mm.y, self.turn_rad];
        let rolled = self.roll_mm.x * on_profile.re + self.roll_mm.y * on_profile.im;
        let far = (self.push - share * rolled) * rail_compliance;
        let free = Motion { shift: away.shift + complex(self.shift_mm) * far, turn: away.turn + self.turn_rad * far };
        let compliance = along.map(|row| along.map(|column| row * column * rail_compliance * share));
        (free, Some(Resistance { compliance }))
    }
}

/// A plane vector as a complex number.
pub(crate) fn complex(v: Vec2) -> Complex64 {
    Complex64::new(v.x, v.y)
}

/// The factor that rotates a plane vector by `turn_rad`.
pub(super) fn rotation(turn_rad: f64) -> Complex64 {
    let (s, c) = libm::sincos(turn_rad);
    Complex64::new(c, s)
}

/// Length of a plane vector.
pub(super) fn length(z: Complex64) -> f64 {
    z.norm_sqr().sqrt()
}

/// A complex number as a plane vector.
pub(crate) fn plane(z: Complex64) -> Vec2 {
    Vec2::new(z.re, z.im)
}

/// A small rigid displacement of the object, or its conjugate: force and torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motion {
    pub shift: Complex64,
    pub turn: f64,
}

impl Motion {
    pub const ZERO: Motion = Motion { shift: Complex64::ZERO, turn: 0.0 };

    /// B dd at a lever: translation and, to first order, rotation.
    #[inline(always)]
    pub fn at(self, lever: Complex64) -> Complex64 {
        self.shift + Complex64::new(-self.turn * lever.im, self.turn * lever.re)
    }

    /// Adds a traction at a lever to a load.
    #[inline(always)]
    pub fn add(&mut self, lever: Complex64, traction: Complex64) {
        self.shift += traction;
        self.turn += lever.re * traction.im - lever.im * traction.re;
    }

    /// The wrench of a load that is a sum of tractions over cells of an area in mm2.
    pub fn wrench(self, area: f64) -> Wrench {
        Wrench { force_n: plane(self.shift) * area, torque_n_mm: self.turn * area }
    }
}

/// W: compliance of the body to the load on the gel, per sum of tractions over cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Resistance {
    compliance: [[f64; 3]; 3],
}

impl Resistance {
    pub fn retreat(&self, load: Motion) -> Motion {
        let [x, y, turn] = times(&self.compliance, [load.shift.re, load.shift.im, load.turn]);
        Motion { shift: Complex64::new(x, y), turn }
    }
}

fn times(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Inverse of a regular matrix.
pub(crate) fn inverse(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |i: usize, j: usize| {
        let (r, s, t, u) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[r][t] * m[s][u] - m[r][u] * m[s][t]
    };
    let det: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i) / det))
}
