//! What the frames say of the finger: its lighting, its markers and their noise.

use super::finding::{Finding, bad, good, judged};
use slipbound::finger_pipeline::RestFinder;
use slipbound::monitor::{RestKind, Settings, SlipMonitor};
use slipbound::plane::Vec2;
use slipbound::port::FrameBuffer;
use slipbound::sensor::Sensor;

/// Levels from which on a pixel is as bright as it can be, and up to which it is black.
const BRIGHT_LEVEL: u8 = 250;
const DARK_LEVEL: u8 = 5;
/// A larger share of such pixels hides markers.
const MOST_SATURATED_FRACTION: f64 = 0.02;
/// The mean brightness of a finger that nothing touches changes by less, levels.
const MOST_FLICKER_LEVELS: f64 = 1.5;
/// The noise of a marker beyond which slip is seen late: a tenth of the paper's threshold of 4.5 px.
const MOST_NOISE_PX: f64 = 0.45;

/// Saturation of the last frame, and whether the brightness stays.
pub fn lighting(frames: &[FrameBuffer]) -> Vec<Finding> {
    let Some(last) = frames.last() else { return Vec::new() };
    let share = |is: &dyn Fn(u8) -> bool| {
        last.pixels.iter().filter(|value| is(**value)).count() as f64 / last.pixels.len().max(1) as f64
    };
    let (bright, dark) = (share(&|v| v >= BRIGHT_LEVEL), share(&|v| v <= DARK_LEVEL));
    let is = format!("{:.1} % white, {:.1} % black", 100.0 * bright, 100.0 * dark);
    let advice = if bright > dark { "lower the exposure, the gain or the lights" } else { "more light or exposure" };
    let is_good = bright <= MOST_SATURATED_FRACTION && dark < 0.5;
    let mut findings = vec![judged("lighting", is, is_good, advice)];
    let mean = |frame: &FrameBuffer| {
        frame.pixels.iter().map(|v| f64::from(*v)).sum::<f64>() / frame.pixels.len().max(1) as f64
    };
    let means: Vec<f64> = frames.iter().map(mean).collect();
    let (least, most) = means.iter().fold((f64::MAX, f64::MIN), |(least, most), m| (least.min(*m), most.max(*m)));
    let is = format!("the mean brightness moves by {:.1} levels", most - least);
    let advice = "lock exposure, gain and white balance, keep daylight and lamps on mains away, let nothing touch it";
    findings.push(judged("steady light", is, most - least <= MOST_FLICKER_LEVELS, advice));
    findings
}

/// Markers found at rest, and how much they move while nothing does.
pub fn markers(frames: &[FrameBuffer], sensor: &Sensor) -> Vec<Finding> {
    let settings = Settings::default();
    let fits = "does the sensor file belong to this finger and camera? `slipbound calibrate` makes one";
    let Some(first) = frames.first() else { return Vec::new() };
    let found = RestFinder::new(sensor, &settings, first.size).map_err(|e| e.to_string()).and_then(|mut finder| {
        frames.iter().try_for_each(|frame| finder.see(frame)).map_err(|e| e.to_string())?;
        finder.find().map_err(|e| e.to_string())
    });
    let found = match found {
        Ok(found) => found,
        Err(why) => return vec![bad("markers", why, fits)],
    };
    let mut findings = vec![match found.rest.kind() {
        RestKind::Unloaded => good("untouched", "nothing touches the finger"),
        RestKind::InContact => bad("untouched", "something touches the finger", "free it and start again"),
    }];
    let mut monitor = match SlipMonitor::new(sensor, &settings, found.rest) {
        Ok(monitor) => monitor,
        Err(e) => return vec![bad("markers", e.to_string(), fits)],
    };
    if let Some(reason) = monitor.refusal() {
        findings.push(bad("markers", reason.to_string(), fits));
        return findings;
    }
    let mut noise: Vec<Noise> = vec![Noise::default(); monitor.markers().len()];
    for frame in frames.iter().filter_map(|frame| frame.frame().ok()) {
        monitor.step(&frame, None);
        for (noise, marker) in noise.iter_mut().zip(monitor.markers()).filter(|(_, marker)| marker.matched) {
            noise.see(marker.now_from_rest());
        }
    }
    let count = noise.len();
    let mut rms_px: Vec<f64> = noise.iter().filter_map(Noise::rms_px).collect();
    rms_px.sort_by(f64::total_cmp);
    let kept = format!("{count} found, {} followed through {} frames", rms_px.len(), frames.len());
    findings.push(judged("markers", kept, rms_px.len() * 20 >= count * 19, fits));
    if let (Some(median_px), Some(worst_px)) = (rms_px.get(rms_px.len() / 2), rms_px.last()) {
        let is = format!("{median_px:.3} px in the middle, {worst_px:.3} px at worst, of a marker at rest");
        let advice = "more light and less gain, a sharper focus, less compression";
        findings.push(judged("noise", is, *median_px <= MOST_NOISE_PX, advice));
    }
    findings
}

/// Where a marker was seen: sums for its scatter.
#[derive(Debug, Clone, Copy, Default)]
struct Noise {
    count: f64,
    sum: (f64, f64),
    sum_of_squares: f64,
}

impl Noise {
    fn see(&mut self, at: Vec2) {
        self.count += 1.0;
        self.sum = (self.sum.0 + at.x, self.sum.1 + at.y);
        self.sum_of_squares += at.x * at.x + at.y * at.y;
    }

    /// Root mean square distance from its mean place, px; None before it was seen three times.
    fn rms_px(&self) -> Option<f64> {
        let mean_square = (self.sum.0 * self.sum.0 + self.sum.1 * self.sum.1) / (self.count * self.count);
        (self.count >= 3.0).then(|| (self.sum_of_squares / self.count - mean_square).max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::image::SizePx;

    fn frame(level: u8) -> FrameBuffer {
        let (pixels, size) = (vec![level; 300], SizePx::new(10, 10));
        FrameBuffer { pixels, size, ..FrameBuffer::default() }
    }

    #[test]
    fn white_pictures_and_light_that_moves_are_bad() {
        let is_good =
            |frames: &[FrameBuffer]| -> Vec<bool> { lighting(frames).iter().map(|f| f.advice.is_none()).collect() };
        assert_eq!(is_good(&[frame(120), frame(121)]), [true, true]);
        assert_eq!(is_good(&[frame(120), frame(255)]), [false, false]);
        assert_eq!(is_good(&[frame(0), frame(0)]), [false, true]);
    }

    #[test]
    fn the_noise_of_a_marker_is_its_scatter() {
        let mut noise = Noise::default();
        for (x, y) in [(5.0, 1.0), (5.2, 1.0), (4.8, 1.0), (5.0, 1.0)] {
            noise.see(Vec2::new(x, y));
        }
        let rms_px = noise.rms_px().expect("seen often enough");
        assert!((rms_px - (0.08f64 / 4.0).sqrt()).abs() < 1e-6, "{rms_px}");
    }
}
