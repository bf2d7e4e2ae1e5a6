//! Drawn fingers: perspective, lens, rotation, missing and doubled dots, noise, glare.

use crate::{frame, known, number, reprojection_pitch};
use slipbound::calibrate::calibrate;
use slipbound::image::SizePx;
use slipbound::plane::{Homography, Vec2};
use slipbound::sensor::Polarity;

/// A sufficient generator for images (xorshift64*).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x2545_F491_4F6C_DD1D)
    }

    /// Uniform in 0..1.
    pub fn share(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }

    /// Normal, of variance 1.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.share()).sum::<f64>() - 6.0
    }
}

/// How a finger's grid of dots is mapped to the image.
pub struct Truth {
    pub homography: Homography,
    /// Cubic: radial, then mixed terms.
    pub bend: [f64; 5],
    pub half_span: f64,
}

impl Truth {
    /// From the plane, in pitches about the middle of the grid, to the camera.
    pub fn camera(&self, p: Vec2) -> Vec2 {
        let q = p / self.half_span;
        let [k, a, b, c, d] = self.bend;
        let r2 = q.length_squared();
        let bent = Vec2::new(
            q.x * (1.0 + k * r2) + a * q.x * q.x * q.y + b * q.y * q.y,
            q.y * (1.0 + k * r2) + c * q.y * q.y * q.x + d * q.x * q.x,
        );
        self.homography.apply(bent)
    }

    /// Derivatives along the two directions of the plane, camera px per pitch.
    fn slopes(&self, p: Vec2) -> (Vec2, Vec2) {
        let slope = |by: Vec2| (self.camera(p + by) - self.camera(p - by)) / 0.02;
        (slope(Vec2::new(0.01, 0.0)), slope(Vec2::new(0.0, 0.01)))
    }
}

/// A synthetic finger.
struct Finger {
    truth: Truth,
    size: SizePx,
    /// Nodes of the grid in pitches about its middle, those without a dot among them.
    nodes: Vec<Vec2>,
    polarity: Polarity,
    pitch_px: f64,
    diameter_px: f64,
    grey: Vec<u8>,
    what: String,
}

const DIAMETERS_PITCH: [f64; 4] = [0.22, 0.3, 0.38, 0.46];

fn finger(seed: u64) -> Finger {
    let mut random = Random::new(seed);
    let markers_count = random.within(60.0, 500.0);
    let size = match markers_count > 180.0 {
        true => SizePx::new(640, 480),
        false => [SizePx::new(320, 240), SizePx::new(427, 320), SizePx::new(640, 480)][(random.share() * 3.0) as usize],
    };
    let turn = random.within(0.0, std::f64::consts::TAU);
    // A grid that approximately fills the image, for any rotation.
    let (w, h) = (size.width as f64, size.height as f64);
    let (cos, sin) = (libm::cos(turn).abs(), libm::sin(turn).abs());
    let (wide, high) = if cos > sin { (w, h) } else { (h, w) };
    let columns = (markers_count * wide / high).sqrt().round().max(5.0);
    let rows = (markers_count / columns).round().max(5.0);
    let half_span = columns.max(rows) / 2.0;
    let pitch_px = (0.86 * (wide / columns).min(high / rows)) * random.within(0.8, 1.0);
    let scale = pitch_px * half_span;
    let (s, c) = libm::sincos(turn);
    let shift = [random.within(-0.04, 0.04) * w, random.within(-0.04, 0.04) * h];
    let place = Homography([
        [scale * c, -scale * s, w / 2.0 - 0.5 + shift[0]],
        [scale * s, scale * c, h / 2.0 - 0.5 + shift[1]],
        [0.0, 0.0, 1.0],
    ]);
    let lean =
        Homography([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [random.within(-0.2, 0.2), random.within(-0.2, 0.2), 1.0]]);
    let mut small = |most: f64| random.within(-most, most);
    let bend = [small(0.1), small(0.03), small(0.03), small(0.03), small(0.03)];
    let truth = Truth { homography: place.after(&lean), bend, half_span };
    let polarity = if random.share() < 0.5 { Polarity::Dark } else { Polarity::Bright };
    let diameter_pitch = DIAMETERS_PITCH[(random.share() * 4.0) as usize].max(4.0 / pitch_px).min(0.5);

    let nodes: Vec<Vec2> = (0..(columns * rows) as usize)
        .map(|i| Vec2::new(i as f64 % columns, (i as f64 / columns).floor()))
        .map(|p| p - Vec2::new((columns - 1.0) / 2.0, (rows - 1.0) / 2.0))
        .collect();
    let (light, depth) = (random.within(100.0, 150.0), random.within(35.0, 80.0));
    let slope = [random.within(-40.0, 40.0), random.within(-40.0, 40.0)];
    let mut levels: Vec<f64> = (0..size.area())
        .map(|i| {
            light + slope[0] * ((i % size.width) as f64 / w - 0.5) + slope[1] * ((i / size.width) as f64 / h - 0.5)
        })
        .collect();
    let sign = if polarity == Polarity::Dark { -1.0 } else { 1.0 };
    let mut cover = vec![0.0f64; size.area()];
    for node in &nodes {
        let doubled = random.share() < 0.05;
        if random.share() < 0.1 {
            continue;
        }
        let direction = random.within(0.0, std::f64::consts::TAU);
        let by = Vec2::new(libm::cos(direction), libm::sin(direction)) * diameter_pitch;
        match (doubled, random.share() < 0.5) {
            (false, _) => draw(&mut cover, size, &truth, *node, diameter_pitch),
            // Doubled, as by a lens: two halves of a bow tie.
            (true, true) => {
                draw(&mut cover, size, &truth, *node + by * 0.35, diameter_pitch * 0.8);
                draw(&mut cover, size, &truth, *node - by * 0.35, diameter_pitch * 0.8);
            }
            // Printed twice.
            (true, false) => {
                draw(&mut cover, size, &truth, *node, diameter_pitch);
                draw(&mut cover, size, &truth, *node + by * random.within(0.8, 1.2), diameter_pitch * 0.9);
            }
        }
    }
    for (level, cover) in levels.iter_mut().zip(&cover) {
        *level += sign * depth * cover + 2.5 * random.normal();
    }
    let grey = levels.iter().map(|v| v.round().clamp(0.0, 255.0) as u8).collect();
    let what = format!(
        "seed {seed}: {size}, {columns}x{rows} dots of {:.1} px at {pitch_px:.1} px, turned {:.0} deg, {polarity:?}",
        diameter_pitch * pitch_px,
        turn.to_degrees(),
    );
    let diameter_px = diameter_pitch * pitch_px;
    Finger { truth, size, nodes, polarity, pitch_px, diameter_px, grey, what }
}

/// The same with the reflection of a lamp: a bright strip in which the markers are fainter, with a chain of highlights
/// that look like dots. Returns their positions.
fn with_glare(finger: &mut Finger, seed: u64) -> Vec<Vec2> {
    let mut random = Random::new(seed ^ 0x61A2E);
    let (w, h) = (finger.size.width as f64, finger.size.height as f64);
    let along_rad = random.within(0.0, std::f64::consts::TAU);
    let (along, across) =
        (Vec2::new(libm::cos(along_rad), libm::sin(along_rad)), Vec2::new(-libm::sin(along_rad), libm::cos(along_rad)));
    let middle = Vec2::new(w / 2.0, h / 2.0) + across * (random.within(0.1, 0.38) * h);
    let half_px = 0.5 * random.within(2.5, 4.0) * finger.pitch_px;
    let mut phantoms = Vec::new();
    let chains_count = (2.0 * half_px / (0.9 * finger.pitch_px)).floor() as i32;
    for chain in 0..chains_count {
        let off_px = (f64::from(chain) - 0.5 * f64::from(chains_count - 1)) * 0.9 * finger.pitch_px;
        let mut at_px = -0.8 * w;
        while at_px < 0.8 * w {
            at_px += random.within(0.6, 1.1) * finger.pitch_px;
            let wobble_px = random.within(-0.2, 0.2) * finger.pitch_px;
            phantoms.push(middle + along * at_px + across * (off_px + wobble_px));
        }
    }
    phantoms.retain(|p| p.x > 0.0 && p.y > 0.0 && p.x < w && p.y < h);
    let straight = Truth { homography: Homography::IDENTITY, bend: [0.0; 5], half_span: 1.0 };
    let mut cover = vec![0.0; finger.size.area()];
    phantoms.iter().for_each(|p| draw(&mut cover, finger.size, &straight, *p, finger.diameter_px));
    let sign = if finger.polarity == Polarity::Dark { -1.0 } else { 1.0 };
    for (i, level) in finger.grey.iter_mut().enumerate() {
        let p = Vec2::new((i % finger.size.width) as f64, (i / finger.size.width) as f64);
        let light = 1.0 / (1.0 + libm::exp(((p - middle).dot(across).abs() - half_px) / 1.5));
        let lit = f64::from(*level) * (1.0 - 0.5 * light) + light * (90.0 + sign * 70.0 * cover[i]);
        *level = lit.round().clamp(0.0, 255.0) as u8;
    }
    phantoms
}

/// A disc of the plane as seen by the camera, with an edge of about a pixel.
pub fn draw(cover: &mut [f64], size: SizePx, truth: &Truth, centre: Vec2, diameter_pitch: f64) {
    let at = truth.camera(centre);
    let (a, b) = truth.slopes(centre);
    let det = a.cross(b);
    let radius = diameter_pitch / 2.0;
    let px_per_pitch = det.abs().sqrt();
    let reach = (radius * a.length().max(b.length()) + 4.0).ceil();
    let span = |at: f64, len: usize| (at - reach).max(0.0) as usize..((at + reach).max(0.0) as usize).min(len);
    for y in span(at.y, size.height) {
        for x in span(at.x, size.width) {
            let by = Vec2::new(x as f64, y as f64) - at;
            let plane = Vec2::new(by.cross(b), a.cross(by)) / det;
            let beyond_px = (plane.length() - radius) * px_per_pitch;
            let here = 1.0 / (1.0 + libm::exp(beyond_px / 0.45));
            let pixel = &mut cover[y * size.width + x];
            *pixel = pixel.max(here);
        }
    }
}

/// Glare neither distorts the map nor counts as markers; ambiguous cases are refused.
#[test]
fn a_finger_with_a_strip_of_glare_is_calibrated_from_the_grid_alone() {
    let (from, count) = (number("SLIPBOUND_CALIBRATE_FROM", 0), number("SLIPBOUND_CALIBRATE_COUNT", 20));
    let (mut right, mut wrong, mut refused) = (0, 0, 0);
    let (mut phantoms_count, mut taken_count) = (0, 0);
    for seed in from..from + count {
        let mut finger = finger(seed);
        let phantoms = with_glare(&mut finger, seed);
        let found = match calibrate(&[frame(&finger.grey, finger.size)], &known()) {
            Ok(found) => found,
            Err(e) => {
                println!("{}, {} highlights: refused: {e}", finger.what, phantoms.len());
                refused += 1;
                continue;
            }
        };
        let (rms, worst) = reprojection_pitch(&found.sensor, &finger.truth, &finger.nodes, finger.size);
        let near = |list: &[Vec2], p: Vec2| {
            list.iter().map(|q| (*q - p).length()).fold(f64::INFINITY, f64::min) / finger.pitch_px
        };
        let places: Vec<Vec2> = finger.nodes.iter().map(|n| finger.truth.camera(*n)).collect();
        let taken =
            found.markers.iter().filter(|m| near(&places, m.camera_px) > 0.2 && near(&phantoms, m.camera_px) < 0.1);
        let taken = taken.count();
        if rms <= 0.03 {
            right += 1
        } else {
            wrong += 1
        }
        phantoms_count += phantoms.len();
        taken_count += taken;
        println!(
            "{}, {} highlights: {} markers, {} off the grid, {taken} highlights taken; reprojection {rms:.4}, worst {worst:.4}",
            finger.what,
            phantoms.len(),
            found.markers.len(),
            found.off_grid.len(),
        );
    }
    println!(
        "{count} fingers with glare: {right} right, {refused} refused, {wrong} wrong; {taken_count} of {phantoms_count} highlights taken"
    );
    assert_eq!(wrong, 0);
    assert!(10 * refused <= count, "{refused} of {count} refused");
    assert!(50 * taken_count <= phantoms_count, "{taken_count} highlights taken for markers");
}

/// Calibration result of a finger; errors in pitches, RMS.
enum Tally {
    Refused,
    Right(f64),
    Wrong(f64),
}

fn tally(seed: u64) -> Tally {
    let finger = finger(seed);
    match calibrate(&[frame(&finger.grey, finger.size)], &known()) {
        Err(e) => {
            println!("{}: refused: {e}", finger.what);
            Tally::Refused
        }
        Ok(found) => {
            let (rms, worst) = reprojection_pitch(&found.sensor, &finger.truth, &finger.nodes, finger.size);
            if rms <= 0.03 && found.sensor.polarity == finger.polarity {
                return Tally::Right(rms);
            }
            let (count, residual, polarity) = (found.markers.len(), found.residual_pitch, found.sensor.polarity);
            println!(
                "{}: WRONG: reprojection {rms:.4} RMS, {worst:.4} worst pitch; {count} markers, residual {residual:.4}, {polarity:?}",
                finger.what
            );
            Tally::Wrong(rms)
        }
    }
}

/// 99 of 100 fingers are calibrated to within 0.03 pitch, and the others are refused.
#[test]
fn a_drawn_finger_is_calibrated_to_three_hundredths_of_a_pitch_or_refused() {
    let (from, count) = (number("SLIPBOUND_CALIBRATE_FROM", 0), number("SLIPBOUND_CALIBRATE_COUNT", 40));
    // Every seed is independent, so all cores are used.
    let cores_count = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    let parts: Vec<Tally> = std::thread::scope(|scope| {
        let part =
            |core| scope.spawn(move || (from + core..from + count).step_by(cores_count as usize).map(tally).collect());
        let parts: Vec<_> = (0..cores_count).map(part).collect();
        parts.into_iter().flat_map(|part| -> Vec<Tally> { part.join().expect("no panic") }).collect()
    });
    let refused = parts.iter().filter(|part| matches!(part, Tally::Refused)).count() as u64;
    let wrong = parts.iter().filter(|part| matches!(part, Tally::Wrong(_))).count();
    let error = |part: &Tally| match part {
        Tally::Refused => None,
        Tally::Right(rms) | Tally::Wrong(rms) => Some(*rms),
    };
    let mut errors: Vec<f64> = parts.iter().filter_map(error).collect();
    errors.sort_by(f64::total_cmp);
    let at = |share: f64| errors.get((share * (errors.len().max(1) - 1) as f64) as usize).copied().unwrap_or(f64::NAN);
    println!(
        "{count} fingers from seed {from}: {refused} refused, {wrong} wrong; reprojection median {:.4}, 99 % {:.4}, worst {:.4} pitch",
        at(0.5),
        at(0.99),
        at(1.0)
    );
    assert_eq!(wrong, 0, "wrong calibrations");
    assert!(100 * refused <= count, "{refused} of {count} refused");
}

/// A large photo out of focus: every dot is a soft spot of half a pitch.
#[test]
fn dots_larger_than_a_sensor_may_have_are_refused_by_their_size() {
    refuse_soft_spots(SizePx::new(1920, 1440), 300.0, 72.0, [6, 4]);
    // Wider than our own search for dots can sum over.
    refuse_soft_spots(SizePx::new(2592, 1944), 450.0, 70.0, [5, 4]);
}

fn refuse_soft_spots(size: SizePx, pitch_px: f64, sigma_px: f64, [columns, rows]: [i32; 2]) {
    // The shadow of a grid along one axis: the image is the product of both.
    let shadow = |length_px: usize, count: i32| -> Vec<f64> {
        let place = |k: i32| 0.5 * length_px as f64 + (f64::from(k) - 0.5 * f64::from(count - 1)) * pitch_px;
        let bell = |t: f64| libm::exp(-0.5 * t * t);
        let of = |at: f64| (0..count).map(|k| bell((at - place(k)) / sigma_px)).sum();
        (0..length_px).map(|at| of(at as f64)).collect()
    };
    let (along, across) = (shadow(size.width, columns), shadow(size.height, rows));
    let row = |down: &f64| along.iter().map(|v| (200.5 - 120.0 * v * down) as u8).collect::<Vec<u8>>();
    let grey: Vec<u8> = across.iter().flat_map(row).collect();
    let error = calibrate(&[frame(&grey, size)], &known()).expect_err("no finger has such dots").to_string();
    assert!(error.starts_with("marker_diameter_px: expected a number from 3 to 64, got 1"), "{error}");
}

/// Dark dots of this diameter, px, wherever `places` are.
fn dots(size: SizePx, places: &[Vec2], diameter_px: f64) -> Vec<u8> {
    let mut grey = vec![200u8; size.area()];
    for (i, pixel) in grey.iter_mut().enumerate() {
        let at = Vec2::new((i % size.width) as f64, (i / size.width) as f64);
        let nearest_px = places.iter().map(|p| (at - *p).length()).fold(f64::INFINITY, f64::min);
        let cover = 1.0 / (1.0 + libm::exp((nearest_px - diameter_px / 2.0) / 0.45));
        *pixel = (200.0 - 150.0 * cover) as u8;
    }
    grey
}

/// The nodes of a grid with these steps that lie well within an image.
fn nodes(size: SizePx, along: Vec2, across: Vec2, margin_px: f64) -> Vec<Vec2> {
    let middle = Vec2::new(size.width as f64, size.height as f64) / 2.0;
    let at = |(i, j): (i32, i32)| middle + along * f64::from(i) + across * f64::from(j);
    let lies = |p: &Vec2| {
        let (width, height) = (size.width as f64 - margin_px, size.height as f64 - margin_px);
        (margin_px..width).contains(&p.x) && (margin_px..height).contains(&p.y)
    };
    (-40..=40).flat_map(|i| (-40..=40).map(move |j| (i, j))).map(at).filter(lies).collect()
}

/// The steps of the grid in the image are stated where they are the same all over it.
#[test]
fn a_grid_that_is_not_square_is_told_from_a_square_one_seen_from_the_front() {
    let size = SizePx::new(320, 240);
    let cells = |along: Vec2, across: Vec2| {
        let grey = dots(size, &nodes(size, along, across, 15.0), 8.0);
        calibrate(&[frame(&grey, size)], &known()).expect("a grid").cells_from_front()
    };
    let (wide, _) = cells(Vec2::new(40.0, 0.0), Vec2::new(0.0, 30.0)).expect("from the front");
    assert!((wide - 40.0 / 30.0).abs() < 0.02, "{wide}");
    let (ratio, angle_rad) = cells(Vec2::new(26.0, 0.0), Vec2::new(13.0, 22.5)).expect("from the front");
    assert!(
        (ratio - 1.0).abs() < 0.03 && ((angle_rad.to_degrees() - 90.0).abs() - 30.0).abs() < 2.0,
        "{ratio}, {angle_rad} rad"
    );
    let (ratio, angle_rad) = cells(Vec2::new(24.0, 3.0), Vec2::new(-3.0, 24.0)).expect("from the front");
    assert!((ratio - 1.0).abs() < 0.02 && (angle_rad.to_degrees() - 90.0).abs() < 1.0, "{ratio}, {angle_rad} rad");
    // An oblique view: rows come closer to each other upwards.
    let oblique = Homography([[1.0, 0.0, 0.0], [0.0, 0.8, 0.0], [0.0, 0.0009, 1.0]]);
    let square = nodes(SizePx::new(400, 400), Vec2::new(24.0, 0.0), Vec2::new(0.0, 24.0), 0.0);
    let within = |p: &Vec2| (15.0..305.0).contains(&p.x) && (15.0..225.0).contains(&p.y);
    let seen: Vec<Vec2> = square.iter().map(|p| oblique.apply(*p)).filter(within).collect();
    let grey = dots(size, &seen, 8.0);
    assert_eq!(calibrate(&[frame(&grey, size)], &known()).expect("a grid").cells_from_front(), None);
}

#[test]
fn a_finger_with_wide_dots_gets_a_diameter_that_its_file_may_have() {
    let size = SizePx::new(320, 240);
    for pitch_px in [20.2, 23.3] {
        let places = nodes(size, Vec2::new(pitch_px, 0.0), Vec2::new(0.0, pitch_px), 15.0);
        let found = calibrate(&[frame(&dots(size, &places, 0.75 * pitch_px), size)], &known()).expect("a finger");
        let sensor = &found.sensor;
        assert!(found.diameter_is_limited(), "{pitch_px}: {} px", sensor.marker_diameter_px);
        assert_eq!((10.0 * sensor.marker_diameter_px).fract(), 0.0, "whole tenths are written as they are");
        assert_eq!(sensor.check(), Ok(()));
        let narrow = calibrate(&[frame(&dots(size, &places, 0.4 * pitch_px), size)], &known()).expect("a finger");
        assert!(!narrow.diameter_is_limited());
    }
}
