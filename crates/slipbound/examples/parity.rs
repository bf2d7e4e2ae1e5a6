//! Runs the pixel kernels on requests from standard input, for `bench/parity/parity.py`.
//!
//! A request is a line `kernel width height numbers...` followed by the raw bytes of its image (three bytes per pixel
//! for `grey`, two images for `below_levels` and `flatten`, otherwise one; a mask is an image of 0 and 255). The answer
//! is raw bytes: one image of bytes or of little-endian f32; for `components` a count, then rows of seven numbers, all
//! little-endian f64; for `rigid_fit`, whose points are its numbers, three f64; for `markers` a count, then for each
//! marker found by the monitor its place at rest and in the judged frame, four f64.

use slipbound::image::{Frame, Gray, Mask, Pixels, Rgb, SizePx};
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor, fit_most, fit_rigid, fit_similarity};
use slipbound::pixels::background::Background;
use slipbound::pixels::canny::Canny;
use slipbound::pixels::components::Components;
use slipbound::pixels::flatten::Flatten;
use slipbound::pixels::gaussian::Gaussian;
use slipbound::pixels::grey::{GreyWeights, grey_from_rgb};
use slipbound::pixels::morphology::{Element, Morphology};
use slipbound::pixels::threshold::{below_level, below_levels};
use slipbound::pixels::warp::WarpTable;
use slipbound::plane::{Homography, Vec2};
use slipbound::sensor::{Flip, Polarity, Sensor, Skin};
use std::error::Error;
use std::io::{BufRead, Read, Write};

fn main() -> Result<(), Box<dyn Error>> {
    let (mut requests, mut answers) = (std::io::stdin().lock(), std::io::stdout().lock());
    let mut line = String::new();
    while requests.read_line(&mut line)? > 0 {
        let mut words = line.split_whitespace();
        let kernel = words.next().ok_or("an empty request")?;
        let numbers = words.map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let [width, height, numbers @ ..] = &numbers[..] else {
            return Err(format!("{kernel}: expected a width and a height").into());
        };
        let size = SizePx::new(*width as usize, *height as usize);
        let bytes_per_px = match kernel {
            "grey" => 3,
            "below_levels" | "flatten" => 2,
            _ => 1,
        };
        let mut picture = vec![0; size.area() * bytes_per_px];
        requests.read_exact(&mut picture)?;
        answers.write_all(&answer(kernel, size, numbers, &picture)?)?;
        answers.flush()?;
        line.clear();
    }
    Ok(())
}

fn answer(kernel: &str, size: SizePx, numbers: &[f64], picture: &[u8]) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut out = vec![0; size.area()];
    let mut mask = Mask::new(size);
    match (kernel, numbers) {
        ("grey", &[r, g, b, flip]) => {
            let flip = [Flip::None, Flip::Vertical, Flip::Horizontal, Flip::Both][flip as usize];
            grey_from_rgb(Rgb::new(picture, size)?, &GreyWeights::new([r, g, b]), flip, &mut out);
        }
        ("warp", &[out_width, out_height, ref h @ ..]) => {
            // The homography from output to source, row by row.
            let h: &[f64; 9] = h.try_into()?;
            let map = Homography([[h[0], h[1], h[2]], [h[3], h[4], h[5]], [h[6], h[7], h[8]]]);
            let out_size = SizePx::new(out_width as usize, out_height as usize);
            out.resize(out_size.area(), 0);
            WarpTable::new(out_size, size, |p| map.apply(p)).apply(picture, &mut out);
        }
        ("gaussian", &[kernel_width, kernel_height, sigma_px]) => {
            let kernel_px = [kernel_width as usize, kernel_height as usize];
            Gaussian::new(size, kernel_px, sigma_px).to_u8(picture, &mut out);
        }
        ("gaussian_f32", &[kernel_width, kernel_height, sigma_px]) => {
            let kernel_px = [kernel_width as usize, kernel_height as usize];
            let mut levels = vec![0.0; size.area()];
            Gaussian::new(size, kernel_px, sigma_px).to_f32(picture, &mut levels);
            return Ok(levels.into_iter().flat_map(f32::to_le_bytes).collect());
        }
        ("background", &[sigma_px]) => Background::new(size, sigma_px).apply(picture, &mut out),
        ("flatten", &[offset, gain, bias]) => {
            let (grey, background) = picture.split_at(size.area());
            out.copy_from_slice(background);
            Flatten::new(offset, gain, bias).over_u8(grey, &mut out);
        }
        ("flatten_gaussian", &[kernel_width, kernel_height, sigma_px, offset, gain, bias]) => {
            let kernel_px = [kernel_width as usize, kernel_height as usize];
            let mut background = vec![0.0; size.area()];
            Gaussian::new(size, kernel_px, sigma_px).to_f32(picture, &mut background);
            Flatten::new(offset, gain, bias).from_f32(picture, &background, &mut out);
        }
        ("canny", &[first_row, end_row, low, high]) => {
            let rows = first_row as usize..end_row as usize;
            Canny::new(size).run(picture, rows, low as u16, high as u16, &mut mask);
            out = bytes_of(&mask);
        }
        ("dilate" | "erode" | "close" | "open", &[round, width, height]) => {
            let side = (width as usize, height as usize);
            let element = if round != 0.0 { Element::ellipse(side.0, side.1) } else { Element::rect(side.0, side.1) };
            let (src, mut morphology) = (mask_of(picture, size), Morphology::new(size));
            match kernel {
                "dilate" => morphology.dilate(&src, &element, &mut mask),
                "erode" => morphology.erode(&src, &element, &mut mask),
                "close" => morphology.close(&src, &element, &mut mask),
                _ => morphology.open(&src, &element, &mut mask),
            }
            out = bytes_of(&mask);
        }
        ("components", &[]) => {
            let mut components = Components::new(size);
            let found = components.label(&mask_of(picture, size));
            let mut numbers = vec![found.len() as f64];
            for c in found {
                numbers.extend([c.area_px2, c.left_px, c.top_px, c.right_px, c.bottom_px].map(|n| n as f64));
                numbers.extend([c.centroid_px.x, c.centroid_px.y]);
            }
            return Ok(numbers.into_iter().flat_map(f64::to_le_bytes).collect());
        }
        ("rigid_fit", &[variant, pitch_px, ref p @ ..]) => {
            // Pairs x, y, x', y'; the answer: displacement at the mean of the first points, and the angle.
            let pairs = p.chunks_exact(4).map(|c| (Vec2::new(c[0], c[1]), Vec2::new(c[2], c[3])));
            let motion = match variant as u8 {
                0 => fit_rigid(pairs),
                1 => fit_similarity(pairs),
                _ => fit_most(pairs, pitch_px),
            };
            let m = motion.ok_or("no points")?;
            let numbers = [m.translation.x, m.translation.y, m.rotation_rad];
            return Ok(numbers.into_iter().flat_map(f64::to_le_bytes).collect());
        }
        ("markers", &[paper, pitch_px, diameter_px]) => {
            let settings = if paper != 0.0 { Settings::paper() } else { Settings::default() };
            return markers(&settings, &straight(size, pitch_px, diameter_px), Gray::new(picture, size)?);
        }
        ("fill_holes", &[]) => {
            mask = mask_of(picture, size);
            Components::new(size).fill_holes(&mut mask);
            out = bytes_of(&mask);
        }
        ("remove_small", &[min_area_px2]) => {
            mask = mask_of(picture, size);
            Components::new(size).remove_small(&mut mask, min_area_px2 as usize);
            out = bytes_of(&mask);
        }
        ("below_level", &[level]) => {
            below_level(picture, level as u8, &mut mask);
            out = bytes_of(&mask);
        }
        ("below_levels", &[]) => {
            let (grey, levels) = picture.split_at(size.area());
            below_levels(grey, levels, &mut mask);
            out = bytes_of(&mask);
        }
        _ => return Err(format!("no kernel {kernel} with {} numbers", numbers.len()).into()),
    }
    Ok(out)
}

/// Facts of a finger whose camera looks perpendicularly at a smooth gel with dark dots.
fn straight(image_px: SizePx, pitch_px: f64, marker_diameter_px: f64) -> Sensor {
    Sensor {
        name: "straight".into(),
        description: String::new(),
        serial: None,
        image_px,
        flip: Flip::None,
        grey_weights_rgb: [0.5, 0.5, 0.0],
        polarity: Polarity::Dark,
        pitch_px,
        pitch_mm: None,
        gel_mm: None,
        marker_diameter_px,
        skin: Skin::Smooth,
        bare_sharpness: None,
        edge_bands: Vec::new(),
        rectification: None,
        defects_px: Vec::new(),
        shear: None,
    }
}

/// The markers of an image that is both rest frame and judged frame.
fn markers(settings: &Settings, sensor: &Sensor, grey: Gray<'_>) -> Result<Vec<u8>, Box<dyn Error>> {
    let frame = Frame { pixels: Pixels::Gray(grey), seq: 0, time_ns: None };
    let mut builder = RestBuilder::new(sensor, settings, grey.size())?;
    builder.add(&frame)?;
    let mut monitor = SlipMonitor::new(sensor, settings, builder.build(RestKind::Unloaded)?)?;
    monitor.step(&frame, None);
    let seen = monitor.markers();
    let rows = seen.iter().flat_map(|m| [m.rest.x, m.rest.y, m.now.x, m.now.y]);
    Ok([seen.len() as f64].into_iter().chain(rows).flat_map(f64::to_le_bytes).collect())
}

fn mask_of(picture: &[u8], size: SizePx) -> Mask {
    let mut mask = Mask::new(size);
    for (i, &level) in picture.iter().enumerate() {
        mask.set(i % size.width, i / size.width, level != 0);
    }
    mask
}

fn bytes_of(mask: &Mask) -> Vec<u8> {
    let SizePx { width, height } = mask.size();
    let at = |i: usize| mask.get((i % width) as isize, (i / width) as isize);
    (0..width * height).map(|i| if at(i) { 255 } else { 0 }).collect()
}
