//! Frames of the simulated GelSlim side by side, into out/camera:
//! `cargo run --release -p slipbound-lab --example camera`. docs/simulator-camera.jpg consists of these.

use slipbound::image::SizePx;
use slipbound::plane::Vec2;
use slipbound::sensor::{Flip, Sensor};
use slipbound_lab::contact::shape::{Cylinder, FlatBox, Shape, Sphere};
use slipbound_lab::contact::{Command, Displacement, Finger, FingerSettings, Grip, Pose, Wrench};
use slipbound_lab::jpeg::Codec;
use slipbound_lab::render::{Renderer, Surface};
use std::path::Path;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// The camera's image of a shape that is pressed on and shifted.
fn picture(
    camera: &mut Renderer,
    shape: impl Shape + 'static,
    force_n: f64,
    shift_mm: Vec2,
) -> Result<Vec<u8>, Failure> {
    let mut finger = Finger::new(FingerSettings::standard(), shape)?;
    for i in 0..32 {
        let pose = Pose { position_mm: shift_mm * ((f64::from(i) - 14.0) / 16.0).clamp(0.0, 1.0), turn_rad: 0.0 };
        let grip = Grip::ForceN(force_n * (f64::from(i) / 12.0).min(1.0));
        finger.step(&Command { grip, pose, roll_mm: Vec2::ZERO, wrench: Wrench::default() })?;
    }
    let grid = finger.settings().grid;
    let displacement: Vec<Displacement> = (0..grid.cells_count()).map(|cell| finger.displacement(cell)).collect();
    let surface = Surface { grid: &grid, displacement: &displacement, pressure_mpa: finger.pressure_mpa() };
    let mut rgb = vec![0; 3 * camera.size().area()];
    camera.render(&surface, 7, &mut rgb);
    Ok(rgb)
}

/// The rectified view of an image, nearest pixels.
fn rectified(sensor: &Sensor, rgb: &[u8]) -> (SizePx, Vec<u8>) {
    let (from, to) = (sensor.image_px, sensor.rectified_px());
    let mut out = vec![0; 3 * to.area()];
    for i in 0..to.area() {
        let at = sensor.upright_from_rectified(Vec2::new((i % to.width) as f64, (i / to.width) as f64));
        let (x, mut y) = (at.x.round(), at.y.round());
        if sensor.flip == Flip::Vertical {
            y = (from.height - 1) as f64 - y;
        }
        if x >= 0.0 && y >= 0.0 && (x as usize) < from.width && (y as usize) < from.height {
            let pixel = 3 * (y as usize * from.width + x as usize);
            out[3 * i..3 * i + 3].copy_from_slice(&rgb[pixel..pixel + 3]);
        }
    }
    (to, out)
}

/// Copies an image into a larger one.
fn paste(board: &mut [u8], board_px: SizePx, (size, rgb): (SizePx, &[u8]), [left, top]: [usize; 2]) {
    for (y, row) in rgb.chunks_exact(3 * size.width).enumerate() {
        board[3 * ((top + y) * board_px.width + left)..][..row.len()].copy_from_slice(row);
    }
}

fn main() -> Result<(), Failure> {
    let folder = Path::new("out/camera");
    std::fs::create_dir_all(folder)?;
    let mut camera = Renderer::gelslim(1);
    let (sensor, size) = (camera.sensor(), camera.size());
    let cap = Cylinder { radius_mm: 14.0, length_mm: 12.0, edge_radius_mm: 0.5 };
    let face = FlatBox { length_mm: 24.0, width_mm: 18.0, edge_radius_mm: 1.0 };
    let sphere = Sphere { radius_mm: 15.0 };
    let pictures = [
        picture(&mut camera, sphere, 0.0, Vec2::ZERO)?,
        picture(&mut camera, cap, 20.0, Vec2::ZERO)?,
        picture(&mut camera, sphere, 10.0, Vec2::ZERO)?,
        picture(&mut camera, face, 60.0, Vec2::ZERO)?,
        picture(&mut camera, sphere, 20.0, Vec2::new(0.9, 0.3))?,
    ];
    // Above as delivered, below rectified.
    let rectified_px = sensor.rectified_px();
    let board_px = SizePx::new(size.width * pictures.len(), size.height + rectified_px.height);
    let mut board = vec![0; 3 * board_px.area()];
    for (i, rgb) in pictures.iter().enumerate() {
        let left = i * size.width;
        paste(&mut board, board_px, (size, rgb), [left, 0]);
        let (flat_px, flat) = rectified(&sensor, rgb);
        paste(&mut board, board_px, (flat_px, &flat), [left + (size.width - flat_px.width) / 2, size.height]);
    }
    let file = folder.join("camera.jpg");
    let mut jpeg = Vec::new();
    Codec::new(board_px, 90).encode(&board, &mut jpeg)?;
    std::fs::write(&file, jpeg)?;
    println!("{}", file.display());

    Ok(())
}
