//! Statistics of the simulated GelSlim's frames at rest, as measured on real ones, after JPEG 85:
//! `cargo run --release -p slipbound-lab --example camera_numbers [SURROUNDINGS]`. The table is in docs/simulator.md.

use slipbound::image::{Frame, Pixels, Rgb, SizePx};
use slipbound::monitor::{RestBuilder, RestKind, Settings};
use slipbound::plane::Vec2;
use slipbound::port::FrameBuffer;
use slipbound::sensor::{Flip, Sensor};
use slipbound_lab::contact::{Displacement, FingerSettings};
use slipbound_lab::jpeg::Codec;
use slipbound_lab::render::{Renderer, Surface, Surroundings};

type Failure = Box<dyn std::error::Error + Send + Sync>;

const FRAMES_COUNT: u64 = 10;
const GREEN: usize = 1;

/// One channel of an image as numbers.
struct Plane {
    size: SizePx,
    levels: Vec<f64>,
}

impl Plane {
    fn of(size: SizePx, rgb: &[u8], channel: usize) -> Self {
        Plane { size, levels: rgb.chunks_exact(3).map(|pixel| f64::from(pixel[channel])).collect() }
    }

    fn at(&self, x: i64, y: i64) -> f64 {
        let inside = |at: i64, count: usize| at.clamp(0, count as i64 - 1) as usize;
        self.levels[inside(y, self.size.height) * self.size.width + inside(x, self.size.width)]
    }

    /// Bilinear.
    fn between(&self, at: Vec2) -> f64 {
        let (x, y) = (at.x.floor(), at.y.floor());
        let (fx, fy) = (at.x - x, at.y - y);
        let level = |dx, dy| self.at(x as i64 + dx, y as i64 + dy);
        (level(0, 0) * (1.0 - fx) + level(1, 0) * fx) * (1.0 - fy) + (level(0, 1) * (1.0 - fx) + level(1, 1) * fx) * fy
    }

    /// Blurred along x and along y.
    fn blurred(&self, sigma_px: f64) -> Self {
        let reach = (4.0 * sigma_px).ceil() as i64;
        let bell = |d: f64| libm::exp(-0.5 * d * d);
        let taps: Vec<f64> = (-reach..=reach).map(|d| bell(d as f64 / sigma_px)).collect();
        let sum: f64 = taps.iter().sum();
        let along = |from: &Plane, dx: i64, dy: i64| {
            let place = |i: usize| ((i % self.size.width) as i64, (i / self.size.width) as i64);
            let level = |i: usize| {
                let (x, y) = place(i);
                (-reach..=reach).zip(&taps).map(|(d, tap)| tap * from.at(x + d * dx, y + d * dy)).sum::<f64>() / sum
            };
            Plane { size: self.size, levels: (0..self.size.area()).map(level).collect() }
        };
        along(&along(self, 1, 0), 0, 1)
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn spread(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (values.len() - 1) as f64).sqrt()
}

/// Position in the camera image of a point of the rectified one.
fn camera_px(sensor: &Sensor, rectified: Vec2) -> Vec2 {
    let at = sensor.upright_from_rectified(rectified);
    match sensor.flip {
        Flip::Vertical => Vec2::new(at.x, (sensor.image_px.height - 1) as f64 - at.y),
        _ => at,
    }
}

fn main() -> Result<(), Failure> {
    let kind = std::env::args().nth(1);
    let kind = kind.as_deref().map_or(Some(Surroundings::Full), Surroundings::named).ok_or("no such surroundings")?;
    let mut camera = Renderer::gelslim(1).with_surroundings(kind);
    let (sensor, size) = (camera.sensor(), camera.size());
    let grid = FingerSettings::standard().grid;
    let displacement = vec![Displacement::default(); grid.cells_count()];
    let pressure_mpa = vec![0.0; grid.cells_count()];
    let untouched = Surface { grid: &grid, displacement: &displacement, pressure_mpa: &pressure_mpa };
    let (codec, mut rgb) = (Codec::new(size, 85), vec![0; 3 * size.area()]);
    let mut frames = Vec::new();
    for seed in 0..FRAMES_COUNT {
        let mut frame = FrameBuffer::default();
        camera.render(&untouched, seed, &mut rgb);
        codec.encode(&rgb, &mut frame.encoded)?;
        codec.decode(&mut frame)?;
        frames.push(frame.pixels);
    }
    let planes: Vec<Plane> = frames.iter().map(|frame| Plane::of(size, frame, GREEN)).collect();
    let green = &planes[0];
    let rectified_px = sensor.rectified_px();
    println!("surroundings {}, green after JPEG 85, {} x {} px", kind.name(), size.width, size.height);

    // Regions: squares of 50 px of the rectified image, and the whole image.
    for (name, share) in [
        ("top right", [0.9, 0.1]),
        ("top left", [0.1, 0.1]),
        ("middle right", [0.9, 0.5]),
        ("bottom", [0.5, 0.85]),
        ("last rows", [0.5, 0.995]),
    ] {
        let (x, y) = (share[0] * rectified_px.width as f64, share[1] * rectified_px.height as f64);
        let levels: Vec<f64> = (0..3)
            .map(|channel| {
                let plane = Plane::of(size, &frames[0], channel);
                let mut all: Vec<f64> = (-25..25)
                    .flat_map(|dy| (-25..25).map(move |dx| Vec2::new(x + f64::from(dx), y + f64::from(dy))))
                    .filter(|p| p.y < rectified_px.height as f64 && p.x < rectified_px.width as f64)
                    .map(|p| plane.between(camera_px(&sensor, p)))
                    .collect();
                median(&mut all)
            })
            .collect();
        println!("{name}: red, green, blue {levels:.0?}");
    }
    let dark = frames[0].chunks_exact(3).filter(|pixel| pixel.iter().all(|&level| level < 30)).count();
    println!("pixels below 30 in every colour: {:.1} %", 100.0 * dark as f64 / size.area() as f64);

    // Beyond the field of dots: farther than a pitch from every dot.
    let places: Vec<Vec2> =
        (0..camera.markers_at_rest_mm().len()).map(|marker| camera.marker_px(marker, &untouched)).collect();
    let seen = |at: &&Vec2| at.x > 0.0 && at.y > 0.0 && at.x < size.width as f64 && at.y < size.height as f64;
    println!("dots in the picture: {}", places.iter().filter(seen).count());
    let apart = |x: usize, y: usize| {
        places.iter().map(|at| (*at - Vec2::new(x as f64, y as f64)).length()).fold(f64::MAX, f64::min)
    };
    let mut outside: Vec<f64> = (0..size.area())
        .map(|i| (i % size.width, i / size.width))
        .filter(|&(x, y)| apart(x, y) > 35.0)
        .map(|(x, y)| green.at(x as i64, y as i64))
        .collect();
    println!("outside the dots: median green {:.0}", median(&mut outside));

    // In the middle: noise of a pixel over time, and the weave between sigma 0.8 and 6 px, without dots.
    let middle: Vec<(i64, i64)> = (180..300).flat_map(|y| (220..420).map(move |x| (x, y))).collect();
    let noise: Vec<f64> =
        middle.iter().map(|&(x, y)| spread(&planes.iter().map(|plane| plane.at(x, y)).collect::<Vec<_>>())).collect();
    println!("noise: {:.2} levels", noise.iter().sum::<f64>() / noise.len() as f64);
    let far = |&(x, y): &(i64, i64)| apart(x as usize, y as usize) > 6.5;
    let mut share = Plane { size, levels: vec![0.0; size.area()] };
    let mut light = Plane { size, levels: vec![0.0; size.area()] };
    for (x, y) in (150..330).flat_map(|y| (190..450).map(move |x| (x, y))).filter(far) {
        let i = y as usize * size.width + x as usize;
        (share.levels[i], light.levels[i]) = (1.0, green.levels[i]);
    }
    let [fine, coarse] = [0.8, 6.0].map(|sigma_px| {
        let (light, share) = (light.blurred(sigma_px), share.blurred(sigma_px));
        let levels = light.levels.iter().zip(&share.levels).map(|(light, share)| light / share).collect();
        Plane { size, levels }
    });
    let beside: Vec<f64> =
        middle.iter().filter(|at| far(at)).map(|&(x, y)| (fine.at(x, y) - coarse.at(x, y)) / coarse.at(x, y)).collect();
    println!("weave: {:.1} %", 100.0 * spread(&beside));

    // Dots: green in the middle of each against the mean half a pitch beside it; area below half of that.
    let (mut levels, mut share, mut diameter) = (Vec::new(), Vec::new(), Vec::new());
    for marker in 0..places.len() {
        let at = camera.marker_rectified_px(marker, &untouched);
        let reach = sensor.pitch_px / 2.0;
        let inside = |at: f64, count: usize| at > reach && at < count as f64 - reach - 1.0;
        if !inside(at.x, rectified_px.width) || !inside(at.y, rectified_px.height) {
            continue;
        }
        let level = |dx: f64, dy: f64| green.between(camera_px(&sensor, at + Vec2::new(dx, dy)));
        let corners = [(reach, reach), (-reach, reach), (reach, -reach), (-reach, -reach)];
        let (middle, light) = (level(0.0, 0.0), corners.iter().map(|&(dx, dy)| level(dx, dy)).sum::<f64>() / 4.0);
        levels.push(middle - light);
        share.push(1.0 - middle / light);
        let span = reach as i32;
        let dark = (-span..=span)
            .flat_map(|dy| (-span..=span).map(move |dx| (f64::from(dx), f64::from(dy))))
            .filter(|&(dx, dy)| level(dx, dy) < 0.5 * (middle + light))
            .count();
        diameter.push((4.0 * dark as f64 / std::f64::consts::PI).sqrt());
    }
    println!("contrast of a dot: {:.0} levels, {:.2} of the light beside it", median(&mut levels), median(&mut share));
    println!("diameter of a dot: {:.1} px, pitch {:.1} px, rectified", median(&mut diameter), sensor.pitch_px);

    let method = Settings::default();
    let mut builder = RestBuilder::new(&sensor, &method, size)?;
    builder.add(&Frame { pixels: Pixels::Rgb(Rgb::new(&frames[0], size)?), seq: 0, time_ns: None })?;
    println!("markers found at rest: {}", builder.build(RestKind::Unloaded)?.markers_count());
    Ok(())
}
