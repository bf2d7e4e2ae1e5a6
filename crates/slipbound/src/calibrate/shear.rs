//! A known mass, held and then hanging still -> the shear stiffness of the skin.
//!
//! ```text
//!   sum of    |                    ______ hanging     force = stiffness x (hanging - held)
//!   displace- |      ____________/
//!   ments     |_____/  held, mass still supported
//!             +---------------------------> time
//! ```
//! The skin is a thin layer on a stiff back: each patch deforms independently, so force is stiffness times the sum of
//! displacement over all markers. A grip pushes markers apart, unevenly in the view of a tilted camera; this is in both
//! sums and cancels in their difference.

mod error;
mod frames;

pub use error::ShearError;
pub use frames::{HangingFrame, displacement_sum_px, outermost, stationary_end, stationary_held, steadied};

use crate::monitor::SlipState;
use crate::plane::Vec2;
use crate::plant::GRAVITY_M_PER_S2;
use crate::sensor::{Sensor, Shear};
use error::{LEAST_SUM_PITCH, MOST_AT_BORDER, MOST_ERROR, MOST_SCATTER};
use frames::{FEWEST_FRAMES, noise_px};

/// Where the noise of the markers exceeds [`MOST_SCATTER`], the sum may scatter by this many times the noise from the
/// differences of successive frames in which the mass is held, which a slow motion hardly raises.
const NOISE_RATIO: f64 = 1.5;
/// Largest share of markers that may be lost.
const MOST_LOST: f64 = 0.1;

fn mean(frames: &[HangingFrame], of: impl Fn(&HangingFrame) -> Vec2) -> Vec2 {
    frames.iter().fold(Vec2::ZERO, |sum, f| sum + of(f)) / frames.len() as f64
}

/// Mean of the sums and their standard deviation (of the length of the difference).
fn mean_and_scatter(frames: &[HangingFrame]) -> (Vec2, f64) {
    let n = frames.len() as f64;
    let mean = mean(frames, |f| f.sum_px);
    let variance = frames.iter().map(|f| (f.sum_px - mean).length_squared()).sum::<f64>() / n;
    (mean, variance.sqrt())
}

/// The stiffness from frames in which a mass of `weight_g` grams is held and still supported, and frames in which it
/// hangs still, shared by `fingers_count` fingers. `what`: the recording, for the provenance.
pub fn shear_stiffness(
    sensor: &Sensor,
    held: &[HangingFrame],
    hanging: &[HangingFrame],
    weight_g: f64,
    fingers_count: u32,
    what: &str,
) -> Result<Shear, ShearError> {
    if hanging.len() < FEWEST_FRAMES {
        return Err(ShearError::FewFrames { got_count: hanging.len() });
    }
    if held.len() < FEWEST_FRAMES {
        return Err(ShearError::NotHeld { got_count: held.len() });
    }
    let span = |frames: &[HangingFrame]| [frames[0].seq, frames[frames.len() - 1].seq];
    let (held_seqs, hanging_seqs) = (span(held), span(hanging));
    if held_seqs[1] >= hanging_seqs[0] {
        return Err(ShearError::Order { held_seqs, hanging_seqs });
    }
    for f in held.iter().chain(hanging) {
        match f.state {
            SlipState::NoContact => return Err(ShearError::NoContact),
            SlipState::Incipient | SlipState::Gross => return Err(ShearError::Slips { seq: f.seq }),
            // In an unjudged frame, every marker counts as lost.
            SlipState::Stick | SlipState::Unsure | SlipState::Unjudged => {}
        }
        if f64::from(f.lost_count) > MOST_LOST * f.markers_count as f64 {
            let (lost_count, markers_count) = (f.lost_count, f.markers_count);
            return Err(ShearError::MarkersLost { seq: f.seq, lost_count, markers_count });
        }
    }
    let ((before, held_px), (after, hanging_px)) = (mean_and_scatter(held), mean_and_scatter(hanging));
    let load_px = (after - before).length();
    let sum_pitch = load_px / sensor.pitch_px;
    if sum_pitch.is_nan() || sum_pitch < LEAST_SUM_PITCH {
        return Err(ShearError::Faint { sum_pitch });
    }
    let most_px = (MOST_SCATTER * load_px).max(NOISE_RATIO * noise_px(held));
    if held_px > most_px {
        return Err(ShearError::Moves { scatter_fraction: held_px / load_px });
    }
    if hanging_px > most_px {
        return Err(ShearError::Swings { scatter_fraction: hanging_px / load_px });
    }
    let (n, m) = (held.len() as f64, hanging.len() as f64);
    let error_fraction = (held_px * held_px / n + hanging_px * hanging_px / m).sqrt() / load_px;
    if error_fraction > MOST_ERROR {
        return Err(ShearError::Noisy { error_fraction });
    }
    let at_border_px = mean(hanging, |f| f.border_sum_px) - mean(held, |f| f.border_sum_px);
    let at_border_fraction = at_border_px.dot(after - before) / (load_px * load_px);
    if at_border_fraction > MOST_AT_BORDER {
        return Err(ShearError::Cut { at_border_fraction });
    }
    let force_n = weight_g / 1000.0 * GRAVITY_M_PER_S2 / f64::from(fingers_count.max(1));
    let words = |[from, to]: [u64; 2]| format!("{from} to {to}");
    let shared = if fingers_count > 1 { format!(" shared by {fingers_count} fingers") } else { String::new() };
    Ok(Shear {
        stiffness_n_per_pitch: force_n / sum_pitch,
        provenance: format!(
            "{weight_g} g{shared}, held in frames {} and hanging in frames {} of {what}: {force_n:.3} N moved the markers \
             by {sum_pitch:.2} pitch in sum, noise {:.1} %",
            words(held_seqs),
            words(hanging_seqs),
            100.0 * error_fraction
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::tests::smooth;

    /// Frames with a sum of 7 px along x by the grip, and of `sum_px` along y.
    fn frames(first: u64, count: u64, sum_px: impl Fn(u64) -> f64) -> Vec<HangingFrame> {
        let frame = |seq| HangingFrame {
            seq,
            sum_px: Vec2::new(7.0, sum_px(seq)),
            border_sum_px: Vec2::new(7.0, 0.0),
            state: SlipState::Stick,
            lost_count: 0,
            markers_count: 70,
        };
        (first..first + count).map(frame).collect()
    }

    fn held() -> Vec<HangingFrame> {
        frames(0, 9, |_| -20.0)
    }

    #[test]
    fn the_force_comes_back_out_of_the_stiffness_and_what_the_grip_does_does_not_count() {
        let sensor = smooth();
        let hanging = frames(20, 9, |_| 40.0);
        let shear = shear_stiffness(&sensor, &held(), &hanging, 204.0, 2, "clip.avi").expect("measured");
        let told = "204 g shared by 2 fingers, held in frames 0 to 8 and hanging in frames 20 to 28 of clip.avi";
        assert!(shear.provenance.contains(told), "{}", shear.provenance);
        assert_eq!(sensor.shear_stiffness_n_per_px3(), None, "it was not measured");
        // Each marker stands for a pitch squared.
        let force_n = |sensor: &Sensor, sum_px: f64| {
            let stiffness = sensor.shear_stiffness_n_per_px3().expect("measured");
            stiffness * sum_px * sensor.pitch_px * sensor.pitch_px
        };
        let sensor = Sensor { shear: Some(shear), ..sensor };
        sensor.check().expect("possible");
        let force = force_n(&sensor, 30.0);
        assert!((force - 0.204 * 9.80665 / 4.0).abs() < 1e-9, "{force}");
        // Twice the pixels of the same finger: twice the sum, the same newtons.
        let large = sensor.at_size(crate::image::SizePx::new(640, 480)).expect("same shape");
        assert!((force_n(&large, 60.0) - force).abs() < 1e-9);
    }

    #[test]
    fn the_stationary_parts_are_found() {
        // Untouched, gripped, held with a little noise, lifted, hanging.
        let sum_px = |i: u64| match i {
            0..5 => 0.0,
            5..10 => -4.0 * (i - 4) as f64,
            10..25 => -20.0 + (i % 2) as f64,
            25..32 => -20.0 + 10.0 * (i - 25) as f64,
            _ => 50.0 + (i % 2) as f64,
        };
        let mut all = frames(0, 60, sum_px);
        all[..5].iter_mut().for_each(|f| f.state = SlipState::NoContact);
        let hanging = stationary_end(&all);
        assert_eq!((hanging[0].seq, hanging.len()), (32, 28));
        let held = stationary_held(&all[..32], hanging);
        assert_eq!((held[0].seq, held[held.len() - 1].seq), (9, 25));
        all[..32].iter_mut().for_each(|f| f.state = SlipState::NoContact);
        assert_eq!(stationary_held(&all[..32], &all[32..]), [], "nothing is held there");
    }

    #[test]
    fn what_cannot_be_measured_is_refused() {
        let sensor = smooth();
        let refused = |held: &[HangingFrame], hanging: &[HangingFrame]| {
            shear_stiffness(&sensor, held, hanging, 100.0, 1, "x").expect_err("refused")
        };
        let of = |hanging: &[HangingFrame]| refused(&held(), hanging);
        assert_eq!(of(&frames(20, 4, |_| 40.0)), ShearError::FewFrames { got_count: 4 });
        assert_eq!(refused(&held()[..4], &frames(20, 9, |_| 40.0)), ShearError::NotHeld { got_count: 4 });
        assert!(matches!(of(&frames(20, 9, |_| -14.0)), ShearError::Faint { .. }));
        assert!(matches!(of(&frames(20, 9, |i| 20.0 + 10.0 * (i % 3) as f64)), ShearError::Swings { .. }));
        let drifting = frames(0, 9, |i| -20.0 + 30.0 * i as f64 / 8.0);
        assert!(matches!(refused(&drifting, &frames(20, 9, |_| 40.0)), ShearError::Moves { .. }), "by half the load");
        let exchanged = ShearError::Order { held_seqs: [20, 28], hanging_seqs: [0, 8] };
        assert_eq!(refused(&frames(20, 9, |_| 40.0), &held()), exchanged);
        let noisy = |first, level: f64| frames(first, 9, |i| level + 15.0 * (i % 2) as f64);
        assert!(matches!(refused(&noisy(0, -20.0), &noisy(20, 40.0)), ShearError::Noisy { .. }));
        let mut hanging = frames(20, 9, |_| 40.0);
        hanging.iter_mut().for_each(|f| f.border_sum_px.y = 12.0);
        assert_eq!(of(&hanging), ShearError::Cut { at_border_fraction: 0.2 });
        let mut hanging = frames(20, 9, |_| 40.0);
        hanging[4].state = SlipState::Incipient;
        assert_eq!(of(&hanging), ShearError::Slips { seq: 24 });
        hanging[4].state = SlipState::Gross;
        assert_eq!(of(&hanging), ShearError::Slips { seq: 24 }, "the whole mass slides");
        hanging[4].state = SlipState::NoContact;
        assert_eq!(of(&hanging), ShearError::NoContact);
        hanging[4] = HangingFrame { lost_count: 20, state: SlipState::Stick, ..hanging[4] };
        assert_eq!(of(&hanging), ShearError::MarkersLost { seq: 24, lost_count: 20, markers_count: 70 });
    }
}
