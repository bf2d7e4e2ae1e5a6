//! A simulated value and its exact value.

use std::fmt;

/// A simulated value and its exact value.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The comparison, and the source of the theory.
    pub case: String,
    /// The exact value, in `unit`.
    pub theory: f64,
    /// The simulator's value, in `unit`.
    pub measured: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// Signed error as a fraction of the theory, or as defined by the case; NaN is never within tolerance.
    pub error_fraction: f64,
    /// Largest error allowed, as a fraction.
    pub tolerance_fraction: f64,
}

impl Row {
    /// A value and its exact value; the error is relative.
    pub(super) fn relative(
        case: impl Into<String>,
        theory: f64,
        measured: f64,
        unit: &'static str,
        tolerance: f64,
    ) -> Self {
        let error_fraction = measured / theory - 1.0;
        Row { case: case.into(), theory, measured, unit, error_fraction, tolerance_fraction: tolerance }
    }

    /// A deviation that should be 0 and is itself a fraction.
    pub(super) fn deviation(case: impl Into<String>, measured: f64, tolerance: f64) -> Self {
        Row {
            case: case.into(),
            theory: 0.0,
            measured,
            unit: "",
            error_fraction: measured,
            tolerance_fraction: tolerance,
        }
    }

    /// A number that should be `theory` or more; only a shortfall counts as an error.
    pub(super) fn at_least(case: impl Into<String>, theory: f64, measured: f64) -> Self {
        let missing = (measured - theory).min(0.0);
        let error_fraction = if measured.is_nan() { f64::NAN } else { missing / theory };
        Row { case: case.into(), theory, measured, unit: "", error_fraction, tolerance_fraction: 0.0 }
    }

    /// Whether the error is within the tolerance.
    pub fn holds(&self) -> bool {
        self.error_fraction.abs() <= self.tolerance_fraction
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |fraction: f64| {
            if fraction == 0.0 || fraction.abs() >= 1e-6 {
                format!("{:.3} %", 100.0 * fraction)
            } else {
                format!("{fraction:.1e}")
            }
        };
        write!(
            f,
            "| {} | {} | {} | {} | {} | {} |",
            self.case,
            with_unit(self.theory, self.unit),
            with_unit(self.measured, self.unit),
            percent(self.error_fraction),
            percent(self.tolerance_fraction),
            if self.holds() { "holds" } else { "FAILS" }
        )
    }
}

fn with_unit(value: f64, unit: &str) -> String {
    if unit.is_empty() {
        return if value.abs() < 1e-4 && value != 0.0 { format!("{value:.1e}") } else { format!("{value:.5}") };
    }
    format!("{value:.5} {unit}")
}
