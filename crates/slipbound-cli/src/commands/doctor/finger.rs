//! Findings on the finger from the frames: its lighting, its markers and their noise.

use super::finding::{Finding, bad, good, judged};
use crate::commands::marker_noise::MarkerNoise;
use crate::commands::rest_window::advice_where_touched;
use slipbound::finger_pipeline::RestFinder;
use slipbound::image::SizePx;
use slipbound::monitor::{Rest, RestKind, Settings, SlipMonitor};
use slipbound::port::FrameBuffer;
use slipbound::sensor::{Sensor, Skin};

/// Levels from which on a pixel counts as saturated, and up to which it counts as black.
const BRIGHT_LEVEL: u8 = 250;
const DARK_LEVEL: u8 = 5;
/// A larger share of such pixels hides markers.
const MOST_SATURATED_FRACTION: f64 = 0.02;
/// The mean brightness of an untouched finger changes by less, levels.
const MOST_FLICKER_LEVELS: f64 = 1.5;
/// Noise of a marker beyond which slip is detected late: a tenth of the paper's threshold of 4.5 px.
const MOST_NOISE_PX: f64 = 0.45;

/// Saturation of the last frame, and whether the brightness is constant.
pub fn lighting(frames: &[FrameBuffer]) -> Vec<Finding> {
    let Some(last) = frames.last() else { return Vec::new() };
    let share = |is: &dyn Fn(u8) -> bool| {
        last.pixels.iter().filter(|value| is(**value)).count() as f64 / last.pixels.len().max(1) as f64
    };
    let (bright, dark) = (share(&|v| v >= BRIGHT_LEVEL), share(&|v| v <= DARK_LEVEL));
    let is = format!("{:.1} % white, {:.1} % black", 100.0 * bright, 100.0 * dark);
    let advice = if bright > MOST_SATURATED_FRACTION {
        "lower the exposure, the gain or the lights"
    } else {
        "more light or exposure"
    };
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

/// Markers found at rest, and their noise while nothing moves; also against a saved rest frame.
pub fn markers(frames: &[FrameBuffer], sensor: &Sensor, saved: Option<Rest>) -> Vec<Finding> {
    let settings = Settings::default();
    let fits = "does the sensor file belong to this finger and camera? `slipbound calibrate` makes one";
    let anew = "let nothing touch it and take it anew with `slipbound tare`";
    let Some(first) = frames.first() else { return Vec::new() };
    if let Err(e) = sensor.at_size(first.size) {
        let advice =
            "crop, scale or turn the images to those of the sensor file, or `slipbound calibrate` the finger as it is";
        return vec![bad("markers", e.to_string(), advice)];
    }
    let is_saved = saved.is_some();
    let rest = match saved {
        Some(rest) if rest.size() != first.size => {
            let is = format!("expected {} as the frames, got {}", first.size, rest.size());
            return vec![bad("rest", is, anew)];
        }
        Some(rest) => Ok(rest),
        None => found(frames, first.size, sensor, &settings),
    };
    let rest = match rest {
        Ok(rest) => rest,
        Err(why) => return vec![bad("markers", why, fits)],
    };
    let kind = rest.kind();
    let mut monitor = match SlipMonitor::new(sensor, &settings, rest) {
        Ok(monitor) => monitor,
        Err(e) if is_saved => return vec![bad("rest", e.to_string(), anew)],
        Err(e) => return vec![bad("markers", e.to_string(), fits)],
    };
    if let Some(reason) = monitor.refusal() {
        let touched = (kind != RestKind::Unloaded).then(String::new);
        return vec![untouched(touched, sensor.skin), bad("markers", reason.to_string(), fits)];
    }
    let marker_noise = MarkerNoise::measure(frames, &mut monitor, |_| true);
    let in_rest = (!is_saved && kind != RestKind::Unloaded).then(String::new);
    let seen = marker_noise.touched_seq.map(|seq| {
        let (count, all) = (marker_noise.touched_count, frames.len());
        format!(", from frame {seq} on, in {count} of {all}")
    });
    let is_touched = seen.is_some();
    let mut findings = vec![untouched(in_rest.or(seen), sensor.skin)];
    if let (true, Some(drift_px)) = (is_saved, marker_noise.drift_px) {
        let is = format!("the middle marker is {drift_px:.3} px from where it was");
        findings.push(judged("rest", is, drift_px <= MOST_NOISE_PX, anew));
    }
    let (count, followed) = (monitor.markers().len(), marker_noise.followed_count);
    let kept = format!("{count} found, {followed} followed through {} frames", frames.len());
    findings.push(judged("markers", kept, followed * 20 >= count * 19, fits));
    // A touched finger moves: that is not noise.
    if let Some((median_px, is)) = marker_noise.noise().filter(|_| !is_touched) {
        let advice = "more light and less gain, a sharper focus, less compression";
        findings.push(judged("noise", is, median_px <= MOST_NOISE_PX, advice));
    }
    findings
}

/// `touched`: where something touches it; None where nothing does.
fn untouched(touched: Option<String>, skin: Skin) -> Finding {
    match touched {
        None => good("untouched", "nothing touches the finger"),
        Some(place) => bad("untouched", format!("something touches the finger{place}"), advice_where_touched(skin)),
    }
}

/// The rest frame among these; the error says why there is none.
fn found(frames: &[FrameBuffer], size: SizePx, sensor: &Sensor, settings: &Settings) -> Result<Rest, String> {
    let mut finder = RestFinder::new(sensor, settings, size).map_err(|e| e.to_string())?;
    frames.iter().try_for_each(|frame| finder.see(frame)).map_err(|e| e.to_string())?;
    finder.find().map(|found| found.rest).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

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
        // Dark markers and a vignette are no reason for more light.
        let mut mixed = frame(120);
        let count = mixed.pixels.len();
        mixed.pixels[..count / 20].fill(255);
        mixed.pixels[count / 2..count / 2 + count / 5].fill(0);
        let advice = lighting(&[mixed])[0].advice.clone();
        assert!(advice.is_some_and(|advice| advice.starts_with("lower the exposure")));
    }
}
