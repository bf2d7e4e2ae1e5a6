//! Images of one finger: drawn from a surface, encoded and decoded as JPEG, and with the physics of a 30 Hz frame
//! before.
//! `cargo bench -p slipbound-lab --bench render`; results with machine and settings in bench/lab-render.md.

use criterion::{Criterion, criterion_group, criterion_main};
use slipbound_lab::contact::shape::Sphere;
use slipbound_lab::contact::{Command, Displacement, Finger, FingerSettings, Grid, Leg, Path};
use slipbound_lab::jpeg::Codec;
use slipbound_lab::render::{Renderer, Surface};
use std::hint::black_box;
use zune_jpeg::zune_core::bytestream::ZCursor;

const STEPS_A_FRAME: usize = 4;

/// A sphere at 20 N, half way to full slip, and the commands that follow.
fn pressed(grid: Grid) -> (Finger, Vec<Command>) {
    let settings = FingerSettings { grid, ..FingerSettings::standard() };
    let path = Path::new(vec![Leg::press(20.0, 0.25), Leg::shear(2.0, 0.0, 1.0)]).expect("a sound path");
    let mut finger = Finger::new(settings, Sphere { radius_mm: 15.0 }).expect("sound settings");
    let mut commands: Vec<_> = path.commands(settings.substep_s).collect();
    let middle = 30 + (commands.len() - 30) / 2;
    for command in &commands[..middle] {
        finger.step(command).expect("a sound command");
    }
    commands.drain(..middle);
    (finger, commands)
}

/// The camera's input from the finger, copied.
struct Copied {
    grid: Grid,
    displacement: Vec<Displacement>,
    pressure_mpa: Vec<f64>,
}

impl Copied {
    fn of(grid: Grid) -> Self {
        let cells = grid.cells_count();
        Copied { grid, displacement: vec![Displacement::default(); cells], pressure_mpa: vec![0.0; cells] }
    }

    fn take(&mut self, finger: &Finger) {
        self.displacement.iter_mut().enumerate().for_each(|(cell, out)| *out = finger.displacement(cell));
        self.pressure_mpa.copy_from_slice(finger.pressure_mpa());
    }

    fn surface(&self) -> Surface<'_> {
        Surface { grid: &self.grid, displacement: &self.displacement, pressure_mpa: &self.pressure_mpa }
    }
}

fn render(criterion: &mut Criterion) {
    let cameras = [("gelslim", Renderer::gelslim(1)), ("gelsight mini", Renderer::gelsight_mini(1))];
    for (size, grid) in [("96x72", Grid::standard()), ("64x48", Grid::fast())] {
        let (finger, commands) = pressed(grid);
        let mut copied = Copied::of(grid);
        copied.take(&finger);
        for (name, camera) in &cameras {
            let mut camera = camera.clone();
            let mut rgb = vec![0; 3 * camera.size().area()];
            criterion.bench_function(&format!("render/{size}/{name}"), |bencher| {
                let mut seed = 0;
                bencher.iter(|| {
                    seed += 1;
                    camera.render(&copied.surface(), black_box(seed), &mut rgb);
                });
            });
        }
        let mut camera = Renderer::gelslim(1);
        let mut rgb = vec![0; 3 * camera.size().area()];
        criterion.bench_function(&format!("physics and render/{size}/gelslim"), |bencher| {
            // Eight frames of the ramp, then the same ones again.
            let (mut now, mut frame) = (finger.clone(), 0);
            bencher.iter(|| {
                if frame == 8 {
                    (now, frame) = (finger.clone(), 0);
                }
                for command in &commands[frame * STEPS_A_FRAME..][..STEPS_A_FRAME] {
                    now.step(command).expect("a sound command");
                }
                frame += 1;
                copied.take(&now);
                camera.render(&copied.surface(), frame as u64, &mut rgb);
            });
        });
    }
}

/// As in a recorded scene: quality 85, 4:2:2.
fn jpeg(criterion: &mut Criterion) {
    let (finger, _) = pressed(Grid::standard());
    let mut copied = Copied::of(Grid::standard());
    copied.take(&finger);
    let mut camera = Renderer::gelslim(1);
    let size = camera.size();
    let mut rgb = vec![0; 3 * size.area()];
    camera.render(&copied.surface(), 1, &mut rgb);
    let mut encoded = Vec::new();
    let codec = Codec::new(size, 85);
    let encode = |rgb: &[u8], into: &mut Vec<u8>| codec.encode(rgb, into).expect("encodes");
    criterion.bench_function("jpeg/encode", |bencher| bencher.iter(|| encode(black_box(&rgb), &mut encoded)));
    encode(&rgb, &mut encoded);
    criterion.bench_function("jpeg/decode", |bencher| {
        bencher.iter(|| {
            let mut decoder = zune_jpeg::JpegDecoder::new(ZCursor::new(black_box(encoded.as_slice())));
            decoder.decode_into(&mut rgb).expect("decodes");
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(40).measurement_time(std::time::Duration::from_secs(3));
    targets = render, jpeg
}
criterion_main!(benches);
