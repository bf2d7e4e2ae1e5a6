//! The same kernel twice: for any CPU of the architecture, and for those with wide vectors, chosen while the program runs.
//!
//! ```text
//!   wide! { fn kernel(..) { body } }   --->   fn kernel(..)   AVX2 here?  yes: the body, compiled for AVX2
//!                                                                        no:  the body, compiled for the baseline
//! ```
//! Both are one body in Rust, in integers or in floats whose order it fixes (nothing is contracted or reordered), so they give the same
//! bits; [`without_wide_vectors`] lets tests see that. On other architectures than x86-64 there is the one body only. The simulator
//! draws its pictures by such kernels, too.

use std::cell::Cell;

thread_local! {
    static FORBIDDEN: Cell<bool> = const { Cell::new(false) };
}

/// Whether kernels may use AVX2 on this machine.
#[cfg(target_arch = "x86_64")]
#[doc(hidden)]
#[inline]
pub fn has_avx2() -> bool {
    std::arch::is_x86_feature_detected!("avx2") && !FORBIDDEN.get()
}

/// Runs `work` with the kernels as compiled for the baseline of the architecture, on this thread: for tests and benches that compare
/// the two.
#[doc(hidden)]
pub fn without_wide_vectors<T>(work: impl FnOnce() -> T) -> T {
    let before = FORBIDDEN.replace(true);
    let result = work();
    FORBIDDEN.set(before);
    result
}

/// Declares kernels that are compiled twice, see [`crate::pixels::wide`]. What they call must be `#[inline(always)]` or small, or it
/// is compiled for the baseline.
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
            if $crate::pixels::wide::has_avx2() {
                // SAFETY: the CPU this runs on has just been found to have AVX2, the one feature `avx2` needs.
                #[allow(unsafe_code)]
                return unsafe { avx2 $(::<$constant>)? ($($argument),*) };
            }
            plain $(::<$constant>)? ($($argument),*)
        }
    )+};
}
#[doc(hidden)]
pub use wide;
