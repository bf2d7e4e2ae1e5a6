//! Compiles a kernel three times: for any CPU of the architecture, and for two wider vector widths, selected at run
//! time.
//!
//! ```text
//!   wide! { fn kernel(..) { body } }   --->   fn kernel(..)   AVX-512 here?  the body, compiled for it
//!                                                             AVX2 here?     the body, compiled for it
//!                                                             else           the body, compiled for the baseline
//! ```
//! All have one body in Rust, in integers or in floats in a fixed order (nothing is contracted or reordered), so they
//! give the same bits; [`with_vectors`] lets tests check that. On architectures other than x86-64 there is only one
//! version. The simulator renders its images with such kernels, too.

use std::cell::Cell;

/// Vector width of a kernel, the widest last.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Vectors {
    /// Available on every CPU of the architecture.
    Baseline,
    /// AVX2.
    Avx2,
    /// AVX-512 with its instructions for bytes, words and double words, on vectors of any length.
    Avx512,
    /// And with those that permute bytes (VBMI) and that add up products (VNNI): Ice Lake, Zen 4 and later. Kernels of
    /// [`wide!`] are the same as for `Avx512`.
    Avx512Vnni,
}

thread_local! {
    static WIDEST: Cell<Vectors> = Cell::new(of_this_machine());
}

/// The widest vectors that kernels may use on this thread.
#[doc(hidden)]
#[inline]
pub fn vectors() -> Vectors {
    WIDEST.get()
}

#[cfg(target_arch = "x86_64")]
fn of_this_machine() -> Vectors {
    use std::arch::is_x86_feature_detected as has;
    let avx512 = has!("avx512f") && has!("avx512bw") && has!("avx512dq") && has!("avx512vl");
    match () {
        _ if avx512 && has!("avx512vbmi") && has!("avx512vnni") => Vectors::Avx512Vnni,
        _ if avx512 => Vectors::Avx512,
        _ if has!("avx2") => Vectors::Avx2,
        _ => Vectors::Baseline,
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn of_this_machine() -> Vectors {
    Vectors::Baseline
}

/// Runs `work` with kernels whose vectors are at most this wide, on this thread: for tests and benches that compare
/// them.
#[doc(hidden)]
pub fn with_vectors<T>(widest: Vectors, work: impl FnOnce() -> T) -> T {
    let before = WIDEST.replace(widest.min(of_this_machine()));
    let result = work();
    WIDEST.set(before);
    result
}

/// Declares kernels that are compiled for each vector width, see [`crate::pixels::wide`]. Functions they call must be
/// `#[inline(always)]` or small, or they are compiled for the baseline.
#[doc(hidden)]
#[macro_export]
macro_rules! wide {
    ($($(#[$meta:meta])* $vis:vis fn $name:ident $(<const $constant:ident: $kind:ty>)? (
        $($argument:ident: $type:ty),* $(,)?
    ) $(-> $result:ty)? $body:block)+) => {$(
        $(#[$meta])*
        $vis fn $name $(<const $constant: $kind>)? ($($argument: $type),*) $(-> $result)? {
            #[inline(always)]
            #[allow(clippy::too_many_arguments)]
            fn plain $(<const $constant: $kind>)? ($($argument: $type),*) $(-> $result)? $body
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            #[allow(clippy::too_many_arguments)]
            fn avx2 $(<const $constant: $kind>)? ($($argument: $type),*) $(-> $result)? {
                plain $(::<$constant>)? ($($argument),*)
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
            #[allow(clippy::too_many_arguments)]
            fn avx512 $(<const $constant: $kind>)? ($($argument: $type),*) $(-> $result)? {
                plain $(::<$constant>)? ($($argument),*)
            }
            match $crate::pixels::wide::vectors() {
                // SAFETY: `vectors` has found that this CPU has the four features that `avx512` needs.
                #[cfg(target_arch = "x86_64")]
                #[allow(unsafe_code)]
                $crate::pixels::wide::Vectors::Avx512 | $crate::pixels::wide::Vectors::Avx512Vnni => unsafe { avx512 $(::<$constant>)? ($($argument),*) },
                // SAFETY: the same of AVX2, the one feature that `avx2` needs.
                #[cfg(target_arch = "x86_64")]
                #[allow(unsafe_code)]
                $crate::pixels::wide::Vectors::Avx2 => unsafe { avx2 $(::<$constant>)? ($($argument),*) },
                _ => plain $(::<$constant>)? ($($argument),*),
            }
        }
    )+};
}
#[doc(hidden)]
pub use wide;
