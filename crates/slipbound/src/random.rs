//! Random numbers of unit tests, the same in every run: a linear congruential generator, whose high bits are good.

/// The state after this one. Any state may be the first.
pub(crate) fn next(state: u64) -> u64 {
    state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407)
}
