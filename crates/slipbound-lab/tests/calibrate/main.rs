//! Synthetic fingers, drawn and calibrated: perspective, lens, rotation, missing and doubled dots, noise.
//!
//! `SLIPBOUND_CALIBRATE_FROM` and `SLIPBOUND_CALIBRATE_COUNT` choose other fingers than the first forty
//! (`.ci/run full`: a hundred), and other clouds.

#![allow(clippy::disallowed_macros)] // a test may print what failed

mod clouds;
mod drawn;
mod simulated;

use drawn::Truth;
use slipbound::calibrate::KnownFacts;
use slipbound::image::{Frame, Gray, Pixels, SizePx};
use slipbound::plane::Vec2;
use slipbound::sensor::{Flip, Sensor, Skin};
use std::collections::BTreeMap;

fn known() -> KnownFacts {
    KnownFacts {
        name: "drawn".into(),
        description: String::new(),
        serial: None,
        pitch_mm: Some(1.5),
        flip: Flip::None,
        skin: Skin::Smooth,
        polarity: None,
    }
}

fn frame(grey: &[u8], size: SizePx) -> Frame<'_> {
    Frame { pixels: Pixels::Gray(Gray::new(grey, size).expect("whole")), seq: 0, time_ns: None }
}

/// Distance between the calibrated and the drawn position of every node of the grid in view, in pitches: RMS and worst.
/// Infinite if nodes are not numbered consecutively.
fn reprojection_pitch(sensor: &Sensor, truth: &Truth, nodes: &[Vec2], size: SizePx) -> (f64, f64) {
    let pitch = sensor.pitch_px;
    let inside = |p: Vec2| p.x > 2.0 && p.y > 2.0 && p.x < size.width as f64 - 3.0 && p.y < size.height as f64 - 3.0;
    let seen: Vec<(Vec2, Vec2)> = nodes.iter().map(|n| (*n, truth.camera(*n))).filter(|(_, c)| inside(*c)).collect();
    // The origin of the rectified grid: the phase of most nodes.
    let plane = |c: Vec2| sensor.rectified_from_upright(c).map_or(Vec2::new(f64::NAN, f64::NAN), |p| p / pitch);
    let (middle, _) =
        seen.iter().map(|(n, c)| (*c, n.length())).min_by(|a, b| a.1.total_cmp(&b.1)).expect("a node in view");
    let origin = plane(middle);
    let (mut sum, mut worst) = (0.0, 0.0f64);
    let mut numbered: BTreeMap<(i64, i64), Vec2> = BTreeMap::new();
    for (node, c) in &seen {
        let from = plane(*c) - origin;
        let number = Vec2::new(from.x.round(), from.y.round());
        if numbered.insert((number.x as i64, number.y as i64), *node).is_some() || !from.is_finite() {
            return (f64::INFINITY, f64::INFINITY);
        }
    }
    // Neighbours in the rectified grid are neighbours on the finger.
    for (&(i, j), node) in &numbered {
        for next in [(i + 1, j), (i, j + 1)] {
            if numbered.get(&next).is_some_and(|other| ((*other - *node).length() - 1.0).abs() > 1e-6) {
                return (f64::INFINITY, f64::INFINITY);
            }
        }
    }
    // The phase of the grid in the calibration: nodes at whole pitches from its margin.
    let phase = {
        let margin = (0.75 * pitch).round() / pitch;
        Vec2::new(margin, margin)
    };
    for (_, c) in &seen {
        let p = plane(*c) - phase;
        let node = Vec2::new(p.x.round(), p.y.round()) + phase;
        let back = sensor.upright_from_rectified(node * pitch);
        let step = sensor.upright_from_rectified((node + Vec2::new(0.5, 0.0)) * pitch)
            - sensor.upright_from_rectified((node - Vec2::new(0.5, 0.0)) * pitch);
        let other = sensor.upright_from_rectified((node + Vec2::new(0.0, 0.5)) * pitch)
            - sensor.upright_from_rectified((node - Vec2::new(0.0, 0.5)) * pitch);
        let miss = (back - *c).length() / step.cross(other).abs().sqrt();
        sum += miss * miss;
        worst = worst.max(miss);
    }
    ((sum / seen.len() as f64).sqrt(), worst)
}

/// The number in an environment variable.
fn number(key: &str, default: u64) -> u64 {
    std::env::var(key).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}
