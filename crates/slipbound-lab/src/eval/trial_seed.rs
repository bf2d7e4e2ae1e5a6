//! Random numbers of a simulated trial: seed of the sweep, number of the trial -> its stream, the seed of its camera.

use crate::random::Random;

/// The random stream of a trial of an evaluation. Streams of the training split are drawn from their seeds directly,
/// these with one more draw, so no seed given here repeats one of those. The trials that fits take from a protocol
/// itself use a seed that [`simulated`](super::simulated) refuses.
pub fn stream(seed: u64, number: u64) -> Random {
    Random::of(Random::of(seed, 0xE7A1).next_u64(), number)
}

/// A seed for camera and noise of a trial.
pub fn camera_seed(random: &mut Random) -> u64 {
    random.next_u64() >> 16
}
