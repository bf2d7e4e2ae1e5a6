//! The gel as a bonded elastic layer: the displacement of its surface under a traction of wave number k.
//!
//! ```text
//!   z = 0  ~~~~~~~~~~~~  tractions q (in plane) and p (pressure) act here
//!          shear modulus G, Poisson's ratio nu
//!   z = h  ############  bonded to a rigid lens
//! ```
//!
//! In Fourier space, with c = k/|k|, q_l = c.q and q_t = c x q, the surface displacement is
//! u_l = A_l q_l - i C p, u_t = A_t q_t, u_z = i C q_l + A_z p (docs/simulator.md, equations 1 to 5).
//! Layers of this kind: K. L. Johnson, Contact Mechanics (1985), section 5.8; del Alamo et al., PLoS ONE 8
//! (2013) e69850. A half-space pulls its surface inward under pressure (C < 0); a layer of nearly incompressible gel
//! pushes it outward (C > 0), so the coupling is never neglected.

use serde::{Deserialize, Serialize};
use slipbound::sensor::Shear;
use slipbound::setting::SettingError;

/// Poisson's ratio taken for the skin of [`Gel::membrane_n_per_mm`]: woven fabric, between 0.2 and 0.4. Assumed.
pub const MEMBRANE_POISSON: f64 = 0.3;

/// Refuses a number that is not finite and above zero.
pub(crate) fn above_zero(key: &str, value: f64) -> Result<(), SettingError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(SettingError { key: key.into(), got: value.to_string(), expected: "a finite number above 0".into() })
}

/// Refuses a number that is not finite and at least zero.
pub(crate) fn zero_or_above(key: &str, value: f64) -> Result<(), SettingError> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(SettingError { key: key.into(), got: value.to_string(), expected: "a finite number, 0 or above".into() })
}

fn poisson(key: &str, value: f64) -> Result<(), SettingError> {
    if (0.0..0.5).contains(&value) {
        return Ok(());
    }
    Err(SettingError { key: key.into(), got: value.to_string(), expected: "at least 0 and below 0.5".into() })
}

/// The four surface compliances of a body at one wave number, in mm/MPa.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Compliance {
    /// A_l: in-plane displacement along k by in-plane traction along k. Above 0.
    pub along_mm_per_mpa: f64,
    /// A_t: in-plane displacement across k by in-plane traction across k. Above 0.
    pub across_mm_per_mpa: f64,
    /// A_z: displacement into the body by pressure. At least 0; 0 at k = 0 when nu is 0.5.
    pub normal_mm_per_mpa: f64,
    /// C: coupling of pressure and in-plane displacement. Either sign.
    pub coupling_mm_per_mpa: f64,
}

/// sinh x - x without cancellation at small x.
fn sinh_less_x(x: f64) -> f64 {
    if x.abs() > 1.0 {
        return libm::sinh(x) - x;
    }
    let x2 = x * x;
    let mut term = x * x2 / 6.0;
    let mut sum = 0.0;
    for n in 2..14 {
        sum += term;
        term *= x2 / f64::from(2 * n * (2 * n + 1));
    }
    sum
}

/// cosh x - 1 - x^2/2 without cancellation at small x.
fn cosh_less_parabola(x: f64) -> f64 {
    if x.abs() > 1.0 {
        return libm::cosh(x) - 1.0 - 0.5 * x * x;
    }
    let x2 = x * x;
    let mut term = x2 * x2 / 24.0;
    let mut sum = 0.0;
    for n in 2..14 {
        sum += term;
        term *= x2 / f64::from((2 * n + 1) * (2 * n + 2));
    }
    sum
}

/// Compliance of a half-space at `k_rad_per_mm` > 0 (Boussinesq and Cerruti in Fourier space; equation 5).
/// Shear modulus in MPa, Poisson's ratio in 0..=0.5.
pub fn half_space_compliance(shear_modulus_mpa: f64, poisson: f64, k_rad_per_mm: f64) -> Compliance {
    let gk = shear_modulus_mpa * k_rad_per_mm;
    Compliance {
        along_mm_per_mpa: (1.0 - poisson) / gk,
        across_mm_per_mpa: 1.0 / gk,
        normal_mm_per_mpa: (1.0 - poisson) / gk,
        coupling_mm_per_mpa: -(1.0 - 2.0 * poisson) / (2.0 * gk),
    }
}

/// Compliance of a layer of `thickness_mm` bonded to a rigid base (equations 1 to 4). Safe for every k >= 0 and
/// Poisson's ratio in 0..=0.5: series where numerators cancel, scaled exponentials where they overflow.
pub fn layer_compliance(shear_modulus_mpa: f64, poisson: f64, thickness_mm: f64, k_rad_per_mm: f64) -> Compliance {
    let (g, nu, h) = (shear_modulus_mpa, poisson, thickness_mm);
    let flat = k_rad_per_mm * h; // H
    if flat < 1e-9 {
        return Compliance {
            along_mm_per_mpa: h / g,
            across_mm_per_mpa: h / g,
            normal_mm_per_mpa: h * (1.0 - 2.0 * nu) / (2.0 * g * (1.0 - nu)),
            coupling_mm_per_mpa: 0.0,
        };
    }
    // 4 H^2 exp(-2H) is below the rounding of the rest from here on.
    if flat > 22.0 {
        return half_space_compliance(g, nu, k_rad_per_mm);
    }
    let kappa = 3.0 - 4.0 * nu;
    let gk = g * k_rad_per_mm;
    let x = 2.0 * flat;
    let h2 = flat * flat;
    let d = 2.0 * kappa * libm::cosh(x) + 4.0 * h2 + 1.0 + kappa * kappa; // Eq. 1
    let odd = 2.0 * kappa * sinh_less_x(x);
    // 2 kappa sinh 2H + 4H and 2 kappa sinh 2H - 4H, with sinh 2H = (sinh 2H - 2H) + 2H
    let along = odd + 4.0 * flat * (kappa + 1.0); // Eq. 2
    let normal = odd + 8.0 * flat * (1.0 - 2.0 * nu); // Eq. 3
    // 2H^2 - kappa (1 - 2 nu)(cosh 2H - 1), with cosh 2H - 1 = (cosh 2H - 1 - 2H^2) + 2H^2
    let stiff = kappa * (1.0 - 2.0 * nu);
    let coupling = 4.0 * h2 * (4.0 * nu - 1.0) * (1.0 - nu) - stiff * cosh_less_parabola(x); // Eq. 4
    Compliance {
        along_mm_per_mpa: (1.0 - nu) * along / (gk * d),
        across_mm_per_mpa: libm::tanh(flat) / gk,
        normal_mm_per_mpa: (1.0 - nu) * normal / (gk * d),
        coupling_mm_per_mpa: coupling / (gk * d),
    }
}

/// Creep of the gel: du_v/dt = (share A q - u_v)/time (a standard linear solid, diagonal in Fourier space). Share 0.05
/// to 0.15 and time 0.2 to 2 s are estimates, not measurements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Creep {
    /// Final additional displacement, as a share of the immediate one. At least 0.
    pub share_fraction: f64,
    /// Time constant in seconds, above 0.
    pub time_s: f64,
}

/// The gel pad.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gel {
    /// Young's modulus in MPa, above 0; gels of tactile fingers lie in 0.15 to 0.6.
    pub modulus_mpa: f64,
    /// Poisson's ratio, at least 0 and below 0.5.
    pub poisson_ratio: f64,
    /// Thickness in mm, above 0; 2 to 4 in tactile fingers.
    pub thickness_mm: f64,
    /// E_f t of a thin skin in N/mm, 0 for none. Valid for k up to 1 rad/mm; above that it is too stiff.
    pub membrane_n_per_mm: f64,
    /// Viscoelastic part, if any.
    pub creep: Option<Creep>,
}

impl Default for Gel {
    /// 3 mm of a Shore A 15 silicone: 0.5 MPa by Gent's formula, nu 0.485. Neither is measured on a GelSlim.
    fn default() -> Self {
        Gel { modulus_mpa: 0.5, poisson_ratio: 0.485, thickness_mm: 3.0, membrane_n_per_mm: 0.0, creep: None }
    }
}

impl Gel {
    /// G = E / (2 (1 + nu)) in MPa.
    pub fn shear_modulus_mpa(&self) -> f64 {
        self.modulus_mpa / (2.0 * (1.0 + self.poisson_ratio))
    }

    /// Shear stiffness of the gel as in a sensor file: the force on the patch around a marker that is displaced by one
    /// pitch, from G/h of a wide layer.
    pub fn shear_of_marker(&self, pitch_mm: f64) -> Shear {
        Shear {
            stiffness_n_per_pitch: self.shear_modulus_mpa() / self.thickness_mm * pitch_mm * pitch_mm * pitch_mm,
            provenance: "simulator: shear modulus over thickness of the gel".into(),
        }
    }

    /// Refuses numbers outside the ranges of the fields.
    pub fn check(&self) -> Result<(), SettingError> {
        above_zero("gel.modulus_mpa", self.modulus_mpa)?;
        poisson("gel.poisson_ratio", self.poisson_ratio)?;
        above_zero("gel.thickness_mm", self.thickness_mm)?;
        zero_or_above("gel.membrane_n_per_mm", self.membrane_n_per_mm)?;
        if let Some(creep) = self.creep {
            zero_or_above("gel.creep.share_fraction", creep.share_fraction)?;
            above_zero("gel.creep.time_s", creep.time_s)?;
        }
        Ok(())
    }

    /// Immediate compliance of the gel with its skin at `k_rad_per_mm` >= 0; without creep.
    pub fn compliance(&self, k_rad_per_mm: f64) -> Compliance {
        let bare = layer_compliance(self.shear_modulus_mpa(), self.poisson_ratio, self.thickness_mm, k_rad_per_mm);
        if self.membrane_n_per_mm == 0.0 {
            return bare;
        }
        // The skin adds a stiffness m = E_f t k^2/(1 - nu^2) to the inverse of [[A_l, C], [C, A_z]] at (l, l) and
        // G_f t k^2 to 1/A_t; the rank-one change of the inverse in closed form.
        let k2 = k_rad_per_mm * k_rad_per_mm;
        let along = self.membrane_n_per_mm * k2 / (1.0 - MEMBRANE_POISSON * MEMBRANE_POISSON);
        let across = self.membrane_n_per_mm * k2 / (2.0 * (1.0 + MEMBRANE_POISSON));
        let (a, c) = (bare.along_mm_per_mpa, bare.coupling_mm_per_mpa);
        let relief = 1.0 + along * a;
        Compliance {
            along_mm_per_mpa: a / relief,
            across_mm_per_mpa: bare.across_mm_per_mpa / (1.0 + across * bare.across_mm_per_mpa),
            normal_mm_per_mpa: bare.normal_mm_per_mpa - along * c * c / relief,
            coupling_mm_per_mpa: c / relief,
        }
    }
}

/// A soft object in series with the gel: a layer on a rigid core. Only its local compliance is modelled; markers move
/// with the gel's part alone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SoftObject {
    /// Young's modulus in MPa, above 0.
    pub modulus_mpa: f64,
    /// Poisson's ratio, at least 0 and below 0.5.
    pub poisson_ratio: f64,
    /// Thickness of the soft part in mm, above 0; large values approach a half-space.
    pub thickness_mm: f64,
}

impl SoftObject {
    /// Refuses numbers outside the ranges of the fields.
    pub fn check(&self) -> Result<(), SettingError> {
        above_zero("soft_object.modulus_mpa", self.modulus_mpa)?;
        poisson("soft_object.poisson_ratio", self.poisson_ratio)?;
        above_zero("soft_object.thickness_mm", self.thickness_mm)
    }

    /// Contribution of the object to the compliance of the interface. Its z axis points the other way, so its coupling
    /// counts with the other sign.
    pub fn compliance(&self, k_rad_per_mm: f64) -> Compliance {
        let g = self.modulus_mpa / (2.0 * (1.0 + self.poisson_ratio));
        let own = layer_compliance(g, self.poisson_ratio, self.thickness_mm, k_rad_per_mm);
        Compliance { coupling_mm_per_mpa: -own.coupling_mm_per_mpa, ..own }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_skin_adds_its_stiffness_to_the_inverse() {
        let bare = Gel::default();
        let skin = Gel { membrane_n_per_mm: 0.6, ..bare };
        for k in [0.1, 0.5, 1.0, 4.0] {
            let (a, b) = (bare.compliance(k), skin.compliance(k));
            let stiffness = |c: &Compliance| {
                let det = c.along_mm_per_mpa * c.normal_mm_per_mpa - c.coupling_mm_per_mpa * c.coupling_mm_per_mpa;
                [c.normal_mm_per_mpa / det, c.along_mm_per_mpa / det, c.coupling_mm_per_mpa / det]
            };
            let ([along, normal, mixed], [along_skin, normal_skin, mixed_skin]) = (stiffness(&a), stiffness(&b));
            let stretch = 0.6 * k * k / (1.0 - MEMBRANE_POISSON * MEMBRANE_POISSON);
            let shear = 0.6 * k * k / (2.0 * (1.0 + MEMBRANE_POISSON));
            assert!((along_skin - along - stretch).abs() < 1e-10 * along, "{k}");
            assert!((normal_skin - normal).abs() < 1e-10 * normal && (mixed_skin - mixed).abs() < 1e-10 * along, "{k}");
            assert!((1.0 / b.across_mm_per_mpa - 1.0 / a.across_mm_per_mpa - shear).abs() < 1e-10 * along, "{k}");
        }
    }

    #[test]
    fn equal_bodies_pressed_together_do_not_couple() {
        let gel = Gel::default();
        let twin = SoftObject { modulus_mpa: 0.5, poisson_ratio: 0.485, thickness_mm: 3.0 };
        for k in [0.0, 0.1, 1.0, 10.0] {
            let (a, b) = (gel.compliance(k), twin.compliance(k));
            assert_eq!(a.coupling_mm_per_mpa + b.coupling_mm_per_mpa, 0.0);
            assert_eq!(a.normal_mm_per_mpa, b.normal_mm_per_mpa);
        }
    }
}
