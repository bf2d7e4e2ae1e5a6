//! Edge thresholds above the response of the bare weave of a fabric skin.
//!
//! On a fabric skin, contact is detected where Canny's edges are dense. The edge strength of the bare weave depends on
//! camera, light and colour mixture, so thresholds of another finger may detect contact everywhere. They are raised
//! until the frames at rest show none.

use slipbound::calibrate::Calibration;
use slipbound::image::Frame;
use slipbound::monitor::{RestBuilder, Settings};
use slipbound::sensor::{Sensor, Skin};

/// Factor from step to step, so that few are tried: 90, 113, 141, 176, 220, ...
const STEP_FACTOR: f64 = 1.25;
/// An imprint of the simulated GelSlim is detected up to twice the last step; if more is needed, something touches the
/// finger.
const STEPS_MOST: u32 = 6;

/// Raises the thresholds of a calibrated fabric skin until none of the averaged frames shows contact; returns the low
/// and the high threshold of its first band. None if no change is needed, and if raising does not help: the thresholds
/// then stay unchanged, and the frames count as touched.
pub fn raise_edges(frames: &[Frame<'_>], calibration: &mut Calibration) -> Option<[u16; 2]> {
    let [first, last] = calibration.averaged;
    let frames = frames.get(first..=last)?;
    let at_step = |step: u32| {
        let raised = |levels: u16| (f64::from(levels) * STEP_FACTOR.powi(step as i32)).round() as u16;
        let mut sensor = Sensor { bare_sharpness: None, ..calibration.sensor.clone() };
        for band in &mut sensor.edge_bands {
            (band.low_levels, band.high_levels) = (raised(band.low_levels), raised(band.high_levels));
        }
        sensor
    };
    if calibration.sensor.skin != Skin::Fabric || !any_looks_touched(frames, &at_step(0))? {
        return None;
    }
    let Some(quiet) = (1..=STEPS_MOST).map(at_step).find(|sensor| any_looks_touched(frames, sensor) == Some(false))
    else {
        calibration.untouched = false;
        calibration.sensor.bare_sharpness = None;
        return None;
    };
    calibration.sensor = quiet;
    calibration.untouched = true;
    calibration.sensor.edge_bands.first().map(|band| [band.low_levels, band.high_levels])
}

fn any_looks_touched(frames: &[Frame<'_>], sensor: &Sensor) -> Option<bool> {
    let mut builder = RestBuilder::new(sensor, &Settings::default(), sensor.image_px).ok()?;
    Some(frames.iter().any(|frame| builder.look(frame).touched))
}
