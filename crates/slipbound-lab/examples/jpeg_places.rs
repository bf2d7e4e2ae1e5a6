//! A frame at rest for decoders other than ours, into out/jpeg: the pixels (rest.ppm), the JPEG made of them (rest.jpg)
//! and the positions of its markers (markers.csv). `bench/jpeg_places.py` measures the shift caused by JPEG.
//! `cargo run --release -p slipbound-lab --example jpeg_places`

use slipbound_lab::contact::{Displacement, FingerSettings};
use slipbound_lab::jpeg::Codec;
use slipbound_lab::render::{CameraSettings, Renderer, Surface};
use std::fmt::Write;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let folder = Path::new("out/jpeg");
    std::fs::create_dir_all(folder)?;
    let settings = CameraSettings { noise_levels: 0.0, stuck_pixels_count: 0, ..CameraSettings::gelslim() };
    let mut camera = Renderer::new(settings, 1);
    let size = camera.size();
    let grid = FingerSettings::standard().grid;
    let displacement = vec![Displacement::default(); grid.cells_count()];
    let pressure_mpa = vec![0.0; grid.cells_count()];
    let untouched = Surface { grid: &grid, displacement: &displacement, pressure_mpa: &pressure_mpa };
    let mut rgb = vec![0; 3 * size.area()];
    camera.render(&untouched, 1, &mut rgb);
    let mut jpeg = Vec::new();
    Codec::new(size, 85).encode(&rgb, &mut jpeg)?;
    std::fs::write(folder.join("rest.jpg"), jpeg)?;
    let mut ppm = format!("P6\n{} {}\n255\n", size.width, size.height).into_bytes();
    ppm.extend_from_slice(&rgb);
    std::fs::write(folder.join("rest.ppm"), ppm)?;
    let mut markers = String::from("x_px,y_px\n");
    for marker in 0..camera.markers_at_rest_mm().len() {
        let at = camera.marker_px(marker, &untouched);
        writeln!(markers, "{:.4},{:.4}", at.x, at.y)?;
    }
    std::fs::write(folder.join("markers.csv"), markers)?;
    println!("{}", folder.display());
    Ok(())
}
