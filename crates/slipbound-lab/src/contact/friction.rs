//! The largest in-plane traction of a cell before it slides.

use crate::layer::{above_zero, zero_or_above};
use serde::{Deserialize, Serialize};
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// The law of friction, per cell and isotropic.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Law {
    /// Coulomb: the bound is mu p.
    Constant {
        /// Coefficient mu, above 0; elastomers lie in 0.35 to 1.2.
        mu: f64,
    },
    /// mu_k + (mu_s - mu_k) exp(-slip / D_c), times p: the friction of a contact decreases with slip; gives stick-slip.
    SlipWeakening {
        /// mu_s before any slip, above 0.
        mu_static: f64,
        /// mu_k after long slip, above 0 and at most mu_s.
        mu_kinetic: f64,
        /// D_c in mm, above 0; 0.03 to 0.1 are estimates.
        distance_mm: f64,
    },
    /// min(tau_0 + alpha p, tau_max): adhesion at low pressure, a cap at high pressure.
    PressureDependent {
        /// tau_0 in MPa, 0 or above; it acts only where p > 0.
        adhesion_mpa: f64,
        /// alpha, above 0.
        slope: f64,
        /// tau_max in MPa, above 0.
        cap_mpa: f64,
    },
}

/// Friction of the interface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// Bound of the traction.
    pub law: Law,
    /// l_c in mm, 0 or above: elastic displacement of a cell before it slides (compliance l_c / bound). Rough contacts
    /// show it (Prevost, Scheibert and Debregeas, arXiv 0809.3188); 0.01 to 0.05 are estimates.
    pub yield_mm: f64,
}

impl Friction {
    /// Coulomb friction without interface compliance.
    pub fn constant(mu: f64) -> Self {
        Friction { law: Law::Constant { mu }, yield_mm: 0.0 }
    }

    /// Refuses numbers outside the ranges of the fields.
    pub fn check(&self) -> Result<(), SettingError> {
        match self.law {
            Law::Constant { mu } => above_zero("friction.mu", mu)?,
            Law::SlipWeakening { mu_static, mu_kinetic, distance_mm } => {
                above_zero("friction.mu_static", mu_static)?;
                above_zero("friction.mu_kinetic", mu_kinetic)?;
                above_zero("friction.distance_mm", distance_mm)?;
                if mu_kinetic > mu_static {
                    return Err(SettingError {
                        key: "friction.mu_kinetic".into(),
                        got: mu_kinetic.to_string(),
                        expected: format!("at most mu_static, {mu_static}"),
                    });
                }
            }
            Law::PressureDependent { adhesion_mpa, slope, cap_mpa } => {
                zero_or_above("friction.adhesion_mpa", adhesion_mpa)?;
                above_zero("friction.slope", slope)?;
                above_zero("friction.cap_mpa", cap_mpa)?;
            }
        }
        zero_or_above("friction.yield_mm", self.yield_mm)
    }

    /// Largest in-plane traction in MPa of a cell under `pressure_mpa` >= 0 that has slipped `slipped_mm` >= 0
    /// since it came into contact. 0 without pressure.
    pub fn bound_mpa(&self, pressure_mpa: f64, slipped_mm: f64) -> f64 {
        self.bound_on_slope_mpa(pressure_mpa, slipped_mm, Vec2::ZERO, Vec2::ZERO)
    }

    /// The same on an inclined surface: the bound of the friction part q of the in-plane traction.
    ///
    /// `pressure_mpa` is the vertical part p of the traction, `slope` g the gradient of the gap, `direction` e the
    /// direction of the friction on the gel, with a length from 0 to 1 by how much of the bound is used. Normal and
    /// tangential part of the traction (p g + q, p) are, per area of the plane,
    ///
    /// ```text
    ///   N = (p (1 + g^2) + g.q) / sqrt(1 + g^2)        T^2 = q^2 - (g.q)^2 / (1 + g^2)
    /// ```
    ///
    /// and T <= c + m N for q along e is a bound for |q|: mu p (1 + g^2) / (sqrt(1 + g^2 - (g.e)^2) - mu g.e) for
    /// Coulomb's law, which is tan(arctan mu +- the inclination) for a face that slides up or down, minus its slope. On
    /// a slope so steep that the gel would jam, the bound stops at 1.25 sqrt(1 + g^2) times that of the flat: 1.40
    /// times at 27 degrees.
    pub fn bound_on_slope_mpa(&self, pressure_mpa: f64, slipped_mm: f64, slope: Vec2, direction: Vec2) -> f64 {
        if pressure_mpa <= 0.0 {
            return 0.0;
        }
        let (adhesion_mpa, mu, cap_mpa) = match self.law {
            Law::Constant { mu } => (0.0, mu, f64::INFINITY),
            Law::SlipWeakening { mu_static, mu_kinetic, distance_mm } => {
                (0.0, mu_kinetic + (mu_static - mu_kinetic) * libm::exp(-slipped_mm / distance_mm), f64::INFINITY)
            }
            Law::PressureDependent { adhesion_mpa, slope, cap_mpa } => (adhesion_mpa, slope, cap_mpa),
        };
        let stretch = (1.0 + slope.length_squared()).sqrt();
        let along = slope.dot(direction) / stretch;
        let tangential = (1.0 - along * along).sqrt();
        let upright_mpa = adhesion_mpa + mu * pressure_mpa * stretch;
        (upright_mpa / (tangential - mu * along).max(1.0 / SLOPE_BOUND_LIMIT)).min(cap_mpa / tangential)
    }
}

/// Largest friction of a slope relative to that of its own area on the flat: at mu 0.8 that of a slope of 12.7 degrees.
/// With a larger factor the gel at the rims of a cap would repeatedly jam, store energy and snap free: at 1.6 a cap
/// pulled along its axis at 20 N and mu 1.2 never slides as a whole, at 1.25 it does.
const SLOPE_BOUND_LIMIT: f64 = 1.25;

#[cfg(test)]
mod tests {
    use super::*;

    /// Faces inclined by up to 15 degrees, sliding up, down and across, against the statics of a wedge.
    #[test]
    fn an_inclined_face_slides_as_statics_says() {
        let friction = Friction::constant(0.8);
        for degrees in [0.0f64, 1.0, 5.0, 12.0] {
            let rise = libm::tan(degrees.to_radians());
            let slope = Vec2::new(rise, 0.0);
            let of = |x: f64, y: f64| friction.bound_on_slope_mpa(0.1, 0.0, slope, Vec2::new(x, y)) / 0.1;
            assert!((rise + of(1.0, 0.0) - libm::tan(libm::atan(0.8) + degrees.to_radians())).abs() < 1e-12);
            assert!((of(-1.0, 0.0) - rise - libm::tan(libm::atan(0.8) - degrees.to_radians())).abs() < 1e-12);
            assert!((of(0.0, 1.0) - 0.8 / libm::cos(degrees.to_radians())).abs() < 1e-12);
        }
        let steep = friction.bound_on_slope_mpa(0.1, 0.0, Vec2::new(5.0, 0.0), Vec2::new(1.0, 0.0));
        assert!(steep.is_finite() && steep > 0.08, "{steep}");
        // Up a slope: the limit of the bound, and its value where edges are bevelled.
        let up = |degrees: f64| {
            let slope = Vec2::new(libm::tan(degrees.to_radians()), 0.0);
            friction.bound_on_slope_mpa(0.1, 0.0, slope, Vec2::new(1.0, 0.0)) / 0.08 * libm::cos(degrees.to_radians())
        };
        assert!(
            up(12.6) < SLOPE_BOUND_LIMIT
                && (up(12.7) - SLOPE_BOUND_LIMIT).abs() < 1e-12
                && (up(27.0) - SLOPE_BOUND_LIMIT).abs() < 1e-12
        );
        let at_edge = up(27.0) / libm::cos(27f64.to_radians());
        assert!((at_edge - 1.403).abs() < 5e-4, "{at_edge} times that of the flat");
    }
}
