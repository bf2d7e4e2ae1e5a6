//! The scalar product of two traction or displacement vectors, each held as x + iy.

use num_complex::Complex64;

#[inline(always)]
pub(super) fn dot(a: Complex64, b: Complex64) -> f64 {
    a.re * b.re + a.im * b.im
}
