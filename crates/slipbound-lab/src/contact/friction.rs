//! How much in-plane traction a cell can carry before it slides.

use crate::layer::{above_zero, zero_or_above};
use serde::{Deserialize, Serialize};
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
    /// mu_k + (mu_s - mu_k) exp(-slip / D_c), times p: a contact that has slipped holds less; gives stick-slip.
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
    /// What bounds the traction.
    pub law: Law,
    /// l_c in mm, 0 or above: how far a cell gives elastically before it slides (compliance l_c / bound). Rough
    /// contacts show it (Prevost, Scheibert and Debregeas, arXiv 0809.3188); 0.01 to 0.05 are estimates.
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
        if pressure_mpa <= 0.0 {
            return 0.0;
        }
        match self.law {
            Law::Constant { mu } => mu * pressure_mpa,
            Law::SlipWeakening { mu_static, mu_kinetic, distance_mm } => {
                (mu_kinetic + (mu_static - mu_kinetic) * (-slipped_mm / distance_mm).exp()) * pressure_mpa
            }
            Law::PressureDependent { adhesion_mpa, slope, cap_mpa } => {
                (adhesion_mpa + slope * pressure_mpa).min(cap_mpa)
            }
        }
    }
}
