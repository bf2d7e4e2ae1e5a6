//! Images of the simulated fingers in contact, into out/gallery:
//! `cargo run --release -p slipbound-lab --example gallery`.

use slipbound::image::SizePx;
use slipbound::plane::Vec2;
use slipbound_lab::contact::shape::{Cylinder, FlatBox, Shape, Sphere};
use slipbound_lab::contact::{Command, Displacement, Finger, FingerSettings, Grip, Pose, Wrench};
use slipbound_lab::jpeg::Codec;
use slipbound_lab::render::{Renderer, Surface};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let folder = Path::new("out/gallery");
    std::fs::create_dir_all(folder)?;
    let flat = || FlatBox { length_mm: 24.0, width_mm: 18.0, edge_radius_mm: 1.0 };
    type Make = Box<dyn Fn(FingerSettings) -> Result<Finger, slipbound::setting::SettingError>>;
    fn of(shape: impl Shape + Clone + 'static) -> Option<Make> {
        Some(Box::new(move |settings| Finger::new(settings, shape.clone())))
    }
    let touches: Vec<(&str, Option<Make>, f64, Vec2)> = vec![
        ("empty", None, 0.0, Vec2::ZERO),
        ("cap_20n", of(Cylinder { radius_mm: 14.0, length_mm: 12.0, edge_radius_mm: 0.5 }), 20.0, Vec2::ZERO),
        ("sphere_20n", of(Sphere { radius_mm: 15.0 }), 20.0, Vec2::ZERO),
        ("sphere_20n_sheared", of(Sphere { radius_mm: 15.0 }), 20.0, Vec2::new(0.6, 0.2)),
        ("box_30n", of(flat()), 30.0, Vec2::ZERO),
        ("box_60n", of(flat()), 60.0, Vec2::ZERO),
    ];
    for (name, shape, force_n, shift_mm) in touches {
        let settings = FingerSettings::standard();
        let grid = settings.grid;
        let mut displacement = vec![Displacement::default(); grid.cells_count()];
        let mut pressure_mpa = vec![0.0; grid.cells_count()];
        if let Some(make) = shape {
            let mut finger = make(settings)?;
            for i in 0..16 {
                let pressed = (f64::from(i) / 6.0).min(1.0);
                let sheared = ((f64::from(i) - 7.0) / 8.0).clamp(0.0, 1.0);
                let pose = Pose { position_mm: shift_mm * sheared, turn_rad: 0.0 };
                let grip = Grip::ForceN(force_n * pressed);
                finger.step(&Command { grip, pose, roll_mm: Vec2::ZERO, wrench: Wrench::default() })?;
            }
            for (cell, out) in displacement.iter_mut().enumerate() {
                *out = finger.displacement(cell);
            }
            pressure_mpa.copy_from_slice(finger.pressure_mpa());
        }
        let surface = Surface { grid: &grid, displacement: &displacement, pressure_mpa: &pressure_mpa };
        for (camera, mut renderer) in [("gelslim", Renderer::gelslim(1)), ("mini", Renderer::gelsight_mini(1))] {
            let SizePx { width, height } = renderer.size();
            let mut rgb = vec![0; 3 * width * height];
            renderer.render(&surface, 7, &mut rgb);
            let file = folder.join(format!("{camera}_{name}.jpg"));
            let mut jpeg = Vec::new();
            Codec::new(SizePx::new(width, height), 92).encode(&rgb, &mut jpeg)?;
            std::fs::write(&file, jpeg)?;
            let mut least_s = f64::MAX;
            for i in 0..100 {
                let start = std::time::Instant::now();
                renderer.render(&surface, i, &mut rgb);
                least_s = least_s.min(start.elapsed().as_secs_f64());
            }
            println!("{}: {:.1} ms a picture at best", file.display(), 1e3 * least_s);
        }
    }
    Ok(())
}
