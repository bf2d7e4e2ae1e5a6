//! A known mass hanging still -> the shear stiffness of the skin.
//!
//! The skin is a thin layer on a stiff back: each patch answers for itself, so force is stiffness times the sum of
//! displacement over all markers. A grip pushes markers apart evenly; in the sum that cancels, weight does not.

use crate::monitor::{Marker, SlipReport, SlipState};
use crate::plane::Vec2;
use crate::sensor::{Sensor, Shear};
use std::fmt;

/// Standard acceleration of gravity, m/s2.
const GRAVITY_M_S2: f64 = 9.80665;
/// The sum of displacement must be at least this, in pitches: half a dozen markers by a tenth each.
const LEAST_SUM_PITCH: f64 = 0.6;
/// Standard deviation of the sum over frames, as a share of its mean, up to which it hangs still.
const MOST_SCATTER: f64 = 0.1;
/// Fewest frames in which it hangs.
const FEWEST_FRAMES: usize = 3;
/// Most markers that may be out of sight.
const MOST_LOST: f64 = 0.1;

/// Why there is no stiffness.
#[derive(Debug, Clone, PartialEq)]
pub enum ShearError {
    /// Too few frames show the mass hanging.
    FewFrames {
        /// Frames there were.
        got_count: usize,
    },
    /// Nothing touches the finger in them.
    NoContact,
    /// It slips: then friction bears the mass, not the skin alone.
    Slips {
        /// Number of the frame.
        seq: u64,
    },
    /// Markers are out of sight, and what they bear with them.
    MarkersLost {
        /// Number of the frame.
        seq: u64,
        /// Markers lost.
        lost_count: u32,
        /// Markers in all.
        markers_count: usize,
    },
    /// The skin hardly moves.
    Faint {
        /// Sum of the displacements, in pitches.
        sum_pitch: f64,
    },
    /// The mass swings.
    Swings {
        /// Standard deviation over mean.
        scatter_fraction: f64,
    },
}

impl fmt::Display for ShearError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ShearError::FewFrames { got_count } => {
                write!(f, "expected at least {FEWEST_FRAMES} frames of the hanging mass, got {got_count}")
            }
            ShearError::NoContact => f.write_str("expected the mass to hang on the finger, got no contact"),
            ShearError::Slips { seq } => {
                write!(f, "expected the mass to hang still, got slip in frame {seq} (grip harder)")
            }
            ShearError::MarkersLost { seq, lost_count, markers_count } => {
                write!(f, "expected all markers in sight, got {lost_count} of {markers_count} lost in frame {seq}")
            }
            ShearError::Faint { sum_pitch } => write!(
                f,
                "expected the skin to move by {LEAST_SUM_PITCH} pitch summed over all markers, got {sum_pitch:.2} \
                 (take a heavier mass)"
            ),
            ShearError::Swings { scatter_fraction } => write!(
                f,
                "expected the mass to hang still, to {:.0} %, got {:.0} % (wait until it does, or say when: --hanging A..B)",
                100.0 * MOST_SCATTER,
                100.0 * scatter_fraction
            ),
        }
    }
}

impl std::error::Error for ShearError {}

/// The sum over all markers of their displacement from rest, rectified px.
pub fn displacement_sum_px(markers: &[Marker]) -> Vec2 {
    markers.iter().fold(Vec2::ZERO, |sum, m| sum + (m.now - m.rest))
}

/// One frame of the hanging mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HangingFrame {
    /// Its number.
    pub seq: u64,
    /// From [`displacement_sum_px`].
    pub sum_px: Vec2,
    /// What the monitor said.
    pub state: SlipState,
    /// Markers out of sight.
    pub lost_count: u32,
    /// Markers in all.
    pub markers_count: usize,
}

impl HangingFrame {
    /// What a frame shows.
    pub fn new(report: &SlipReport, markers: &[Marker]) -> Self {
        HangingFrame {
            seq: report.seq,
            sum_px: displacement_sum_px(markers),
            state: report.state,
            lost_count: report.markers.lost,
            markers_count: markers.len(),
        }
    }
}

/// The calm frames at the end: those whose sum is within a twentieth of the last ones' median.
pub fn calm_end(frames: &[HangingFrame]) -> &[HangingFrame] {
    let last = &frames[frames.len().saturating_sub(FEWEST_FRAMES)..];
    let middle = |part: &dyn Fn(&HangingFrame) -> f64| super::median(&last.iter().map(part).collect::<Vec<_>>());
    let end = Vec2::new(middle(&|f| f.sum_px.x), middle(&|f| f.sum_px.y));
    let calm = |f: &&HangingFrame| (f.sum_px - end).length() <= 0.05 * end.length();
    let count = frames.iter().rev().take_while(calm).count();
    &frames[frames.len() - count..]
}

/// The stiffness from frames in which a mass of `weight_g` grams, shared by `fingers_count` fingers, hangs still.
/// `what`: the recording, for the provenance.
pub fn shear_stiffness(
    sensor: &Sensor,
    frames: &[HangingFrame],
    weight_g: f64,
    fingers_count: u32,
    what: &str,
) -> Result<Shear, ShearError> {
    if frames.len() < FEWEST_FRAMES {
        return Err(ShearError::FewFrames { got_count: frames.len() });
    }
    for f in frames {
        match f.state {
            SlipState::NoContact => return Err(ShearError::NoContact),
            SlipState::Incipient => return Err(ShearError::Slips { seq: f.seq }),
            _ => {}
        }
        if f64::from(f.lost_count) > MOST_LOST * f.markers_count as f64 {
            let (lost_count, markers_count) = (f.lost_count, f.markers_count);
            return Err(ShearError::MarkersLost { seq: f.seq, lost_count, markers_count });
        }
    }
    let n = frames.len() as f64;
    let mean = frames.iter().fold(Vec2::ZERO, |sum, f| sum + f.sum_px) / n;
    let variance = frames.iter().map(|f| (f.sum_px - mean).length_squared()).sum::<f64>() / n;
    let sum_pitch = mean.length() / sensor.pitch_px;
    if sum_pitch.is_nan() || sum_pitch < LEAST_SUM_PITCH {
        return Err(ShearError::Faint { sum_pitch });
    }
    let scatter_fraction = variance.sqrt() / mean.length();
    if scatter_fraction > MOST_SCATTER {
        return Err(ShearError::Swings { scatter_fraction });
    }
    let force_n = weight_g / 1000.0 * GRAVITY_M_S2 / f64::from(fingers_count.max(1));
    let (first, last) = (frames[0].seq, frames[frames.len() - 1].seq);
    let shared = if fingers_count > 1 { format!(" shared by {fingers_count} fingers") } else { String::new() };
    Ok(Shear {
        stiffness_n_per_pitch: force_n / sum_pitch,
        provenance: format!(
            "{weight_g} g{shared} hanging in frames {first} to {last} of {what}: {force_n:.3} N moved the markers by \
             {sum_pitch:.2} pitch in sum, scatter {:.1} %",
            100.0 * scatter_fraction
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::tests::smooth;

    fn hanging(count: u64, sum_px: impl Fn(u64) -> f64) -> Vec<HangingFrame> {
        let frame = |seq| HangingFrame {
            seq,
            sum_px: Vec2::new(0.0, sum_px(seq)),
            state: SlipState::Stick,
            lost_count: 0,
            markers_count: 70,
        };
        (0..count).map(frame).collect()
    }

    #[test]
    fn the_force_comes_back_out_of_the_stiffness() {
        let sensor = smooth();
        let frames = hanging(9, |_| 60.0);
        let shear = shear_stiffness(&sensor, &frames, 204.0, 2, "clip.avi").expect("measured");
        assert!(shear.provenance.contains("204 g shared by 2 fingers hanging in frames 0 to 8 of clip.avi"));
        assert_eq!(sensor.shear_force_n(Vec2::new(0.0, 60.0)), None, "nobody measured it");
        let sensor = Sensor { shear: Some(shear), ..sensor };
        sensor.check().expect("possible");
        let force = sensor.shear_force_n(Vec2::new(0.0, 30.0)).expect("measured");
        assert!((force.y - 0.204 * 9.80665 / 4.0).abs() < 1e-9 && force.x == 0.0, "{force:?}");
        // Twice the pixels of the same finger: twice the sum, the same newtons.
        let large = sensor.at_size(crate::image::SizePx::new(640, 480)).expect("same shape");
        assert!((large.shear_force_n(Vec2::new(0.0, 60.0)).expect("measured") - force).length() < 1e-9);
    }

    #[test]
    fn the_end_is_where_it_no_longer_moves() {
        let frames = hanging(30, |i| if i < 12 { 5.0 * i as f64 } else { 60.0 + (i % 2) as f64 });
        let calm = calm_end(&frames);
        assert_eq!((calm[0].seq, calm.len()), (12, 18));
    }

    #[test]
    fn what_cannot_be_measured_is_refused() {
        let sensor = smooth();
        let refused = |frames: &[HangingFrame]| shear_stiffness(&sensor, frames, 100.0, 1, "x").expect_err("refused");
        assert_eq!(refused(&hanging(2, |_| 60.0)), ShearError::FewFrames { got_count: 2 });
        assert!(matches!(refused(&hanging(9, |_| 6.0)), ShearError::Faint { .. }));
        assert!(matches!(refused(&hanging(9, |i| 40.0 + 10.0 * (i % 3) as f64)), ShearError::Swings { .. }));
        let mut frames = hanging(9, |_| 60.0);
        frames[4].state = SlipState::Incipient;
        assert_eq!(refused(&frames), ShearError::Slips { seq: 4 });
        frames[4].state = SlipState::NoContact;
        assert_eq!(refused(&frames), ShearError::NoContact);
        frames[4] = HangingFrame { lost_count: 20, state: SlipState::Stick, ..frames[4] };
        assert_eq!(refused(&frames), ShearError::MarkersLost { seq: 4, lost_count: 20, markers_count: 70 });
    }
}
