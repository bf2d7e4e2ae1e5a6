//! First-order filter: time since the last value, time constant -> weight of the new value.
//!
//! ```text
//!   mean <- mean + weight (value - mean),   weight = 1 - exp(-elapsed / time constant)
//! ```
//!
//! The mean follows a step in the same time at every frame rate.

/// Weight of the new value against the mean before, 0 to 1. `time_constant_s` is above 0.
pub(crate) fn weight(elapsed_s: f64, time_constant_s: f64) -> f64 {
    1.0 - libm::exp(-elapsed_s / time_constant_s)
}
