//! Checksums over every frame and its ground truth, scene by scene, and the time they took: equal before and after a
//! change that should leave the simulator's bytes unchanged.
//! `cargo run --release -p slipbound-lab --example frame_sums`.

use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use std::time::Instant;

const SCENES: [&str; 7] = [
    "shear?object=bottle_cap&grid=fast&seed=3",
    "twist?object=crayons_box&seed=4",
    "fill?object=water_bottle&grid=fast&seed=5",
    "ramp?object=scrub_sponge&grid=fast&seed=6",
    "roll?object=bottle_cap&seed=7&surroundings=housing&grid=fast",
    "vibration?camera=gelsight_mini&grid=fast&seed=8",
    "shear_and_twist?object=brain_foam&seed=9&surroundings=dirt",
];

/// FNV-1a, continued from `sum`.
fn fnv(sum: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(sum, |sum, byte| (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for scene in SCENES {
        let start = Instant::now();
        let mut world = World::new(&Trial::parse(scene)?)?;
        let made_s = start.elapsed().as_secs_f64();
        let (mut pictures, mut truths, mut jpeg) = (0xCBF2_9CE4_8422_2325, 0xCBF2_9CE4_8422_2325, Vec::new());
        let mut frames_count = 0;
        while world.advance()?.is_some() {
            frames_count += 1;
            world.render_jpeg(&mut jpeg)?;
            pictures = fnv(pictures, &jpeg);
            truths = fnv(truths, serde_json::to_string(world.truth())?.as_bytes());
        }
        let ran_s = start.elapsed().as_secs_f64();
        println!(
            "{pictures:016x} {truths:016x} {frames_count} frames, {made_s:.2} of {ran_s:.2} s before the first  {scene}"
        );
    }
    Ok(())
}
