//! Causes of marker position errors: the method on simulated images with one cause removed at a time.
//! `cargo run --release -p slipbound-lab --example marker_errors`; the table is in docs/simulator.md, "The camera".
//! With `-- 90` the frames are labelled as those of a camera at 90 Hz, for which the monitor's steps take turns.

use slipbound::image::{Frame, Pixels, Rgb};
use slipbound::monitor::{Marker, RestBuilder, RestKind, Settings, SlipMonitor};
use slipbound::plane::Vec2;
use slipbound::port::FrameBuffer;
use slipbound_lab::contact::shape::{Cylinder, FlatBox, Shape, Sphere};
use slipbound_lab::contact::{Command, Displacement, Finger, FingerSettings, Grid, Grip, Pose, Wrench};
use slipbound_lab::jpeg::Codec;
use slipbound_lab::render::{CameraSettings, Renderer, Surface, Surroundings};

type Failure = Box<dyn std::error::Error + Send + Sync>;

struct Pressed {
    grid: Grid,
    displacement: Vec<Displacement>,
    pressure_mpa: Vec<f64>,
}

impl Pressed {
    fn surface(&self) -> Surface<'_> {
        Surface { grid: &self.grid, displacement: &self.displacement, pressure_mpa: &self.pressure_mpa }
    }

    /// One frame after another until the shift is reached; the monitor sees all of them.
    fn by(shape: Option<impl Shape + 'static>, force_n: f64, shift_mm: Vec2) -> Result<Vec<Self>, Failure> {
        let settings = FingerSettings::standard();
        let grid = settings.grid;
        let cells = grid.cells_count();
        let empty =
            || Pressed { grid, displacement: vec![Displacement::default(); cells], pressure_mpa: vec![0.0; cells] };
        let Some(shape) = shape else { return Ok((0..20).map(|_| empty()).collect()) };
        let mut finger = Finger::new(settings, shape)?;
        let mut all = Vec::new();
        for i in 0..32 {
            let pressed = (f64::from(i) / 12.0).min(1.0);
            let pose = Pose { position_mm: shift_mm * ((f64::from(i) - 14.0) / 16.0).clamp(0.0, 1.0), turn_rad: 0.0 };
            let grip = Grip::ForceN(force_n * pressed);
            finger.step(&Command { grip, pose, roll_mm: Vec2::ZERO, wrench: Wrench::default() })?;
            let mut now = empty();
            now.displacement.iter_mut().enumerate().for_each(|(cell, out)| *out = finger.displacement(cell));
            now.pressure_mpa.copy_from_slice(finger.pressure_mpa());
            all.push(now);
        }
        Ok(all)
    }
}

/// JPEG at `quality`, or none at all.
fn render_frame(camera: &mut Renderer, surface: &Surface, seed: u64, quality: Option<u8>) -> Result<Vec<u8>, Failure> {
    let size = camera.size();
    let mut rgb = vec![0; 3 * size.area()];
    camera.render(surface, seed, &mut rgb);
    let Some(quality) = quality else { return Ok(rgb) };
    let (codec, mut frame) = (Codec::new(size, quality), FrameBuffer::default()); // as in a recorded scene
    codec.encode(&rgb, &mut frame.encoded)?;
    codec.decode(&mut frame)?;
    Ok(frame.pixels)
}

/// Errors of marker positions, in px of the rectified image.
#[derive(Default)]
struct Errors {
    count: f64,
    squares: f64,
    sum: Vec2,
    /// Positions more than a pixel off, left out of the above.
    lost: usize,
    /// Of the displacement since the object was pressed on, before the shift.
    since_count: f64,
    since_squares: f64,
}

/// Frame before the shift begins.
const PRESSED_FRAME: usize = 13;

/// Error of each marker to the nearest true position; None if it was not found or is more than a pixel off.
fn offs(monitor: &SlipMonitor, camera: &Renderer, surface: &Surface) -> Vec<Option<Vec2>> {
    let truth: Vec<Vec2> =
        (0..camera.markers_at_rest_mm().len()).map(|i| camera.marker_rectified_px(i, surface)).collect();
    let nearest = |now: Vec2| {
        truth.iter().map(|t| now - *t).min_by(|a, b| a.length().total_cmp(&b.length())).unwrap_or(Vec2::ZERO)
    };
    let off = |m: &Marker| nearest(m.now);
    monitor.markers().iter().map(|m| (m.matched && m.whole).then(|| off(m))).collect()
}

fn errors(
    settings: &CameraSettings,
    frames: &[Pressed],
    quality: Option<u8>,
    rate_hz: Option<u64>,
) -> Result<Errors, Failure> {
    let mut camera = Renderer::new(settings.clone(), 2);
    let (sensor, method) = (camera.sensor(), Settings::default());
    let mut builder = RestBuilder::new(&sensor, &method, camera.size())?;
    let untouched = Pressed::by(None::<Sphere>, 0.0, Vec2::ZERO)?;
    for i in 0..10 {
        let rgb = render_frame(&mut camera, &untouched[0].surface(), 100 + i, quality)?;
        builder.add(&Frame { pixels: Pixels::Rgb(Rgb::new(&rgb, camera.size())?), seq: i, time_ns: None })?;
    }
    let mut monitor = SlipMonitor::new(&sensor, &method, builder.build(RestKind::Unloaded)?)?;
    let (mut pressed, mut last) = (Vec::new(), Vec::new());
    for (i, frame) in frames.iter().enumerate() {
        let rgb = render_frame(&mut camera, &frame.surface(), i as u64, quality)?;
        let time_ns = rate_hz.map(|hz| (i as u64 + 1) * 1_000_000_000 / hz);
        let picture = Frame { pixels: Pixels::Rgb(Rgb::new(&rgb, camera.size())?), seq: i as u64, time_ns };
        monitor.step(&picture, None);
        last = offs(&monitor, &camera, &frame.surface());
        if i == PRESSED_FRAME {
            pressed = last.clone();
        }
    }
    let mut out = Errors::default();
    for (i, off) in last.iter().enumerate() {
        let Some(off) = *off else { continue };
        if off.length() > 1.0 {
            out.lost += 1;
            continue;
        }
        out.count += 1.0;
        out.squares += off.length_squared();
        out.sum += off;
        if let Some(before) = pressed.get(i).copied().flatten().filter(|before| before.length() <= 1.0) {
            out.since_count += 1.0;
            out.since_squares += (off - before).length_squared();
        }
    }
    Ok(out)
}

fn main() -> Result<(), Failure> {
    let rate_hz = std::env::args().nth(1).map(|text| text.parse()).transpose()?;
    let cap = Cylinder { radius_mm: 14.0, length_mm: 12.0, edge_radius_mm: 0.5 };
    let face = FlatBox { length_mm: 24.0, width_mm: 18.0, edge_radius_mm: 1.0 };
    let loads = [
        ("rest", Pressed::by(None::<Sphere>, 0.0, Vec2::ZERO)?),
        ("sphere 20 N", Pressed::by(Some(Sphere { radius_mm: 15.0 }), 20.0, Vec2::ZERO)?),
        ("sphere 20 N, sheared", Pressed::by(Some(Sphere { radius_mm: 15.0 }), 20.0, Vec2::new(0.9, 0.3))?),
        ("cap 20 N, sheared", Pressed::by(Some(cap), 20.0, Vec2::new(0.9, 0.3))?),
        ("box 60 N, sheared", Pressed::by(Some(face), 60.0, Vec2::new(0.9, 0.3))?),
    ];
    type Change = fn(&mut CameraSettings);
    let plain: Change = |_| ();
    let no_weave: Change = |s| (s.texture.rest_fraction, s.texture.gain_fraction) = (0.0, 0.0);
    let no_shade: Change = |s| s.light.shade = 0.0;
    let no_noise: Change = |s| s.noise_levels = 0.0;
    let no_glare: Change = |s| {
        s.light.glare_levels = [0.0; 3];
        s.glints = false;
        s.stuck_pixels_count = 0;
        s.surroundings = Surroundings::Housing;
    };
    let housing: Change = |s| s.surroundings = Surroundings::Housing;
    let walls: Change = |s| s.surroundings = Surroundings::Walls;
    let glare: Change = |s| s.surroundings = Surroundings::Glare;
    let dirt: Change = |s| s.surroundings = Surroundings::Dirt;
    let even_light: Change = |s| {
        for (levels, middle) in s.light.background_levels.iter_mut().zip([60.0, 120.0, 100.0]) {
            *levels = [0.0; 15];
            levels[0] = middle;
        }
    };
    let q = Some(85);
    let cases: Vec<(&str, Vec<Change>, Option<u8>)> = vec![
        ("all causes", vec![plain], q),
        ("no weave", vec![no_weave], q),
        ("no shading", vec![no_shade], q),
        ("no JPEG", vec![plain], None),
        ("no glare, scratches, stuck pixels, walls", vec![no_glare], q),
        ("all, in a dark housing", vec![housing], q),
        ("all, walls alone", vec![walls], q),
        ("all, walls and highlights", vec![glare], q),
        ("all, walls and dirt", vec![dirt], q),
        ("only geometry", vec![no_weave, no_shade, no_noise, no_glare, even_light], None),
        ("only weave", vec![no_shade, no_noise, no_glare, even_light], None),
        ("only shading", vec![no_weave, no_noise, no_glare, even_light], None),
        ("only noise", vec![no_weave, no_shade, no_glare, even_light], None),
        ("only JPEG", vec![no_weave, no_shade, no_noise, no_glare, even_light], q),
        ("only light and glare", vec![no_weave, no_shade, no_noise], None),
    ];
    for (name, frames) in &loads {
        println!(
            "\n| {name} | markers | more than 1 px off | RMS px | bias px | displacement, RMS px |\n|---|---|---|---|---|---|"
        );
        for (case, changes, quality) in &cases {
            let mut settings = CameraSettings::gelslim();
            changes.iter().for_each(|change| change(&mut settings));
            let e = errors(&settings, frames, *quality, rate_hz)?;
            let rms = |squares: f64, count: f64| (squares / (2.0 * count)).sqrt();
            println!(
                "| {case} | {} | {} | {:.3} | {:.3} | {:.3} |",
                e.count + e.lost as f64,
                e.lost,
                rms(e.squares, e.count),
                (e.sum / e.count).length(),
                rms(e.since_squares, e.since_count)
            );
        }
    }
    Ok(())
}
