//! The same seed gives the same bytes on every machine: checksums over the encoded frames, over their pixels and over
//! the ground truth, with every vector width of this CPU; `testdata/simulated.txt` has those of every other machine. A
//! change of the simulator appears there: `REGENERATE=1 cargo test -p slipbound-lab --test same_bytes`.

use slipbound::pixels::wide::{Vectors, with_vectors};
use slipbound::port::{FrameBuffer, FrameSource};
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use std::path::Path;

/// A soft object, a profile, edges, both cameras, surroundings; every solver.
const SCENES: [&str; 5] = [
    "shear?object=bottle_cap&grid=fast&seed=3",
    "twist?object=crayons_box&grid=fast&seed=4",
    "ramp?object=scrub_sponge&grid=fast&seed=6&surroundings=dirt",
    "roll?object=bottle_cap&grid=fast&seed=7&surroundings=housing",
    "vibration?camera=gelsight_mini&grid=fast&seed=8",
];

/// The ground truth of all of these is summed, and every `PICTURED`-th image.
const FRAMES_COUNT: u64 = 48;
const PICTURED: u64 = 8;

/// FNV-1a, continued from `sum`.
fn fnv(sum: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(sum, |sum, byte| (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3))
}

fn sums(scene: &str) -> String {
    let mut world = World::new(&Trial::parse(scene).expect("a scene")).expect("a world");
    let (mut frame, mut sums) = (FrameBuffer::default(), [0xCBF2_9CE4_8422_2325; 3]);
    for n in 1..=FRAMES_COUNT {
        if n % PICTURED == 0 {
            world.next(&mut frame).expect("a frame");
            sums[0] = fnv(sums[0], &frame.encoded);
            sums[1] = fnv(sums[1], &frame.pixels);
        } else {
            world.advance().expect("a step");
        }
        sums[2] = fnv(sums[2], serde_json::to_string(world.truth()).expect("numbers").as_bytes());
    }
    let [encoded, pixels, truth] = sums;
    format!("{encoded:016x} {pixels:016x} {truth:016x} {scene}\n")
}

#[test]
fn the_same_frames_and_truth_on_every_machine() {
    let head = "# sums over the JPEGs, the pixels and the truth of frames of a scene; written by the test same_bytes\n";
    let [widest, narrower, plain] = [Vectors::Avx512, Vectors::Avx2, Vectors::Baseline]
        .map(|widest| std::thread::spawn(move || with_vectors(widest, || SCENES.map(sums))))
        .map(|thread| head.to_owned() + &thread.join().expect("no panic").concat());
    assert_eq!(widest, narrower, "AVX-512 and AVX2, where there are any");
    assert_eq!(widest, plain, "the widest vectors of this CPU and those of every CPU");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/simulated.txt");
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(&path, &widest).expect("testdata can be written");
    }
    let expected = std::fs::read_to_string(&path).expect("testdata/simulated.txt is there");
    assert_eq!(widest, expected, "other machines, or the last state");
}
