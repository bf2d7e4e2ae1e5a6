//! CPU time of a frame, part by part: a sphere at 20 N, sheared, GelSlim, JPEG 85.
//! `cargo run --release -p slipbound-lab --example frame_cost`; results in bench/lab-render.md.
//!
//! The mean is of CPU time (Linux: /proc/thread-self/schedstat), which excludes the time that other processes use, but
//! not the effect of their cache evictions. Beside it is the quickest tenth of the frames by the clock.

use slipbound::port::FrameBuffer;
use slipbound_lab::contact::shape::Sphere;
use slipbound_lab::contact::{Displacement, Finger, FingerSettings, Grid, Leg, Path};
use slipbound_lab::jpeg::Codec;
use slipbound_lab::render::{Renderer, Surface};
use std::time::{Duration, Instant};

type Failure = Box<dyn std::error::Error + Send + Sync>;

const STEPS_A_FRAME: usize = 4;
const ROUNDS_COUNT: usize = 10;

/// CPU time of this thread; wall-clock time if the system does not provide it.
struct Stopwatch {
    start: Instant,
}

impl Stopwatch {
    fn ran(&self) -> Duration {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
        let told = text.split_whitespace().next().and_then(|first| first.parse().ok());
        told.map_or_else(|| self.start.elapsed(), Duration::from_nanos)
    }
}

fn main() -> Result<(), Failure> {
    let watch = Stopwatch { start: Instant::now() };
    for (name, grid) in [("96 x 72", Grid::standard()), ("64 x 48", Grid::fast())] {
        let settings = FingerSettings { grid, ..FingerSettings::standard() };
        let path = Path::new(vec![Leg::press(20.0, 0.25), Leg::shear(2.0, 0.0, 1.0)])?;
        let mut camera = Renderer::gelslim(1);
        let codec = Codec::new(camera.size(), 85);
        let mut displacement = vec![Displacement::default(); grid.cells_count()];
        let mut rgb = vec![0; 3 * camera.size().area()];
        let mut frame = FrameBuffer::default();
        let (mut costs, mut ran_ms): ([Vec<f64>; 4], _) = (Default::default(), [0.0; 4]);
        for round in 0..ROUNDS_COUNT {
            let mut finger = Finger::new(settings, Sphere { radius_mm: 15.0 })?;
            let commands: Vec<_> = path.commands(finger.settings().substep_s).collect();
            for (i, steps) in commands.chunks(STEPS_A_FRAME).enumerate() {
                let (mut ran, mut at) = (watch.ran(), Instant::now());
                let mut part = |part: usize| {
                    costs[part].push(1e3 * at.elapsed().as_secs_f64());
                    let now = watch.ran();
                    ran_ms[part] += 1e3 * (now - ran).as_secs_f64();
                    (ran, at) = (now, Instant::now());
                };
                for command in steps {
                    finger.step(command)?;
                }
                displacement.iter_mut().enumerate().for_each(|(cell, out)| *out = finger.displacement(cell));
                part(0);
                let surface = Surface { grid: &grid, displacement: &displacement, pressure_mpa: finger.pressure_mpa() };
                camera.render(&surface, (round * commands.len() + i) as u64, &mut rgb);
                part(1);
                codec.encode(&rgb, &mut frame.encoded)?;
                part(2);
                codec.decode(&mut frame)?;
                part(3);
            }
        }
        println!("| {name} | mean, ms | quickest tenth, ms |\n|---|---|---|");
        let (mut all, mut best) = (0.0, 0.0);
        let parts = ["contact", "render", "JPEG encode", "JPEG decode"];
        for ((name, cost), ran_ms) in parts.iter().zip(&mut costs).zip(ran_ms) {
            cost.sort_by(f64::total_cmp);
            let mean = ran_ms / cost.len() as f64;
            let quick = &cost[..cost.len() / 10];
            let quick = quick.iter().sum::<f64>() / quick.len() as f64;
            (all, best) = (all + mean, best + quick);
            println!("| {name} | {mean:.2} | {quick:.2} |");
        }
        println!("| all | {all:.2} | {best:.2} |\n");
    }
    Ok(())
}
