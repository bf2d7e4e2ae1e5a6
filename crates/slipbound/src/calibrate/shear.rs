//! A known mass, held and then hanging still -> the shear stiffness of the skin.
//!
//! ```text
//!   sum of    |                    ______ hanging     force = stiffness x (hanging - held)
//!   displace- |      ____________/
//!   ments     |_____/  held, the mass still stands
//!             +---------------------------> time
//! ```
//! The skin is a thin layer on a stiff back: each patch answers for itself, so force is stiffness times the sum of
//! displacement over all markers. A grip pushes markers apart, and unevenly in what a tilted camera sees; that is in
//! both sums and falls out of their difference.

use super::fit::{median, robust_sigma};
use crate::monitor::{Marker, SlipReport, SlipState};
use crate::plane::Vec2;
use crate::sensor::{Sensor, Shear};
use std::fmt;

/// Standard acceleration of gravity, m/s2.
const GRAVITY_M_S2: f64 = 9.80665;
/// The sum of displacement must be at least this, in pitches: half a dozen markers by a tenth each.
const LEAST_SUM_PITCH: f64 = 0.6;
/// Standard deviation of the sum over the frames in which it hangs, as a share of the load, up to which it hangs still;
/// where the markers' noise is larger, [`NOISE_RATIO`] times that of the frames in which it is held.
const MOST_SCATTER: f64 = 0.1;
const NOISE_RATIO: f64 = 1.5;
/// Standard error of the difference of both means, as a share of it.
const MOST_ERROR: f64 = 0.05;
/// Fewest frames in which it is held, and hangs.
const FEWEST_FRAMES: usize = 5;
/// Frames are alike when their sums differ by no more than this share of the load, or by the noise: these many standard
/// deviations along each axis, beyond which 1 of 450 frames lies.
const ALIKE: (f64, f64) = (0.05, 3.5);
/// Most markers that may be out of sight.
const MOST_LOST: f64 = 0.1;
/// Most of the load that the outermost markers may show: with more, part of the skin that bears it is out of view. In
/// simulation 0.02 to 0.05 in full view (stiffness 2 to 21 % too high), 0.25 to 0.32 where the contact is cut (21 to 76 %).
const MOST_AT_BORDER: f64 = 0.1;
/// A marker is an outermost one when no other lies within so many pitches over a sector as wide as this.
const NEIGHBOURS_PITCH: f64 = 2.3;
const OPEN_SECTOR_RAD: f64 = 2.6;

/// Why there is no stiffness.
#[derive(Debug, Clone, PartialEq)]
pub enum ShearError {
    /// Too few frames show the mass hanging.
    FewFrames {
        /// Frames there were.
        got_count: usize,
    },
    /// Too few frames show it held while it still stands.
    NotHeld {
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
    /// The outermost markers move, too: what is beyond them is not seen.
    Cut {
        /// Share of the load that they show.
        at_border_fraction: f64,
    },
    /// The skin hardly moves.
    Faint {
        /// Sum of the displacements, in pitches.
        sum_pitch: f64,
    },
    /// The mass swings.
    Swings {
        /// Standard deviation over load.
        scatter_fraction: f64,
    },
    /// Too few frames for their noise.
    Noisy {
        /// Standard error over load.
        error_fraction: f64,
    },
}

impl fmt::Display for ShearError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ShearError::FewFrames { got_count } => {
                write!(f, "expected at least {FEWEST_FRAMES} frames of the hanging mass, got {got_count}")
            }
            ShearError::NotHeld { got_count } => write!(
                f,
                "expected at least {FEWEST_FRAMES} stationary frames in which the mass is held and still stands, got {got_count} \
                 (grip it, wait, then lift; or say when it is held: --held A..B)"
            ),
            ShearError::NoContact => f.write_str("expected the mass to be held by the finger, got no contact"),
            ShearError::Slips { seq } => {
                write!(f, "expected the mass to hang still, got slip in frame {seq} (grip harder)")
            }
            ShearError::MarkersLost { seq, lost_count, markers_count } => {
                write!(f, "expected all markers in sight, got {lost_count} of {markers_count} lost in frame {seq}")
            }
            ShearError::Cut { at_border_fraction } => write!(
                f,
                "expected the sheared skin in full view, at most {:.0} % of the load at its outermost markers, got {:.0} % \
                 (hold a smaller object, or in the middle)",
                100.0 * MOST_AT_BORDER,
                100.0 * at_border_fraction
            ),
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
            ShearError::Noisy { error_fraction } => write!(
                f,
                "expected a load known to {:.0} %, got {:.0} % (take a heavier mass, or record longer)",
                100.0 * MOST_ERROR,
                100.0 * error_fraction
            ),
        }
    }
}

impl std::error::Error for ShearError {}

/// The sum over all markers of their displacement from rest, rectified px.
pub fn displacement_sum_px(markers: &[Marker]) -> Vec2 {
    markers.iter().fold(Vec2::ZERO, |sum, m| sum + (m.now - m.rest))
}

/// Frames on either side of a frame over which [`steadied`] takes the median.
const STEADY_FRAMES: usize = 2;

/// The markers of a frame where the median of the frames around it has them: one that jumps to a gap of the weave and
/// back for a frame or two stays where it was. `frames`: the markers of every frame, in their order.
pub fn steadied(frames: &[Vec<Marker>], at: usize) -> Vec<Marker> {
    let around = &frames[at.saturating_sub(STEADY_FRAMES)..frames.len().min(at + STEADY_FRAMES + 1)];
    let middle = |i: usize, part: &dyn Fn(&Marker) -> f64| {
        median(&around.iter().filter_map(|markers| markers.get(i).map(part)).collect::<Vec<_>>())
    };
    let steady = |(i, marker): (usize, &Marker)| {
        let now = Vec2::new(middle(i, &|m| m.now.x), middle(i, &|m| m.now.y));
        Marker { now, ..*marker }
    };
    frames.get(at).into_iter().flatten().enumerate().map(steady).collect()
}

/// The outermost markers: those beside which a wide sector has no other. True at their places in the list.
pub fn outermost(sensor: &Sensor, markers: &[Marker]) -> Vec<bool> {
    let reach_px = NEIGHBOURS_PITCH * sensor.pitch_px;
    let is_outermost = |m: &Marker| {
        let from = |o: &Marker| o.rest - m.rest;
        let near = markers.iter().filter(|o| o.id != m.id && from(o).length() < reach_px);
        let mut angles_rad: Vec<f64> = near.map(|o| libm::atan2(from(o).y, from(o).x)).collect();
        angles_rad.sort_unstable_by(f64::total_cmp);
        let turn = std::f64::consts::TAU;
        let next = angles_rad.iter().skip(1).copied().chain(angles_rad.first().map(|a| a + turn));
        let widest_rad = angles_rad.iter().zip(next).map(|(a, b)| b - a).fold(0.0, f64::max);
        angles_rad.is_empty() || widest_rad > OPEN_SECTOR_RAD
    };
    markers.iter().map(is_outermost).collect()
}

/// One frame of the hanging mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HangingFrame {
    /// Its number.
    pub seq: u64,
    /// From [`displacement_sum_px`].
    pub sum_px: Vec2,
    /// The same of the outermost markers alone.
    pub border_sum_px: Vec2,
    /// What the monitor said.
    pub state: SlipState,
    /// Markers out of sight.
    pub lost_count: u32,
    /// Markers in all.
    pub markers_count: usize,
}

impl HangingFrame {
    /// What a frame shows. `outermost`: from [`outermost`].
    pub fn new(report: &SlipReport, markers: &[Marker], outermost: &[bool]) -> Self {
        let at_border = markers.iter().zip(outermost).filter(|(_, outermost)| **outermost);
        HangingFrame {
            seq: report.seq,
            sum_px: displacement_sum_px(markers),
            border_sum_px: at_border.fold(Vec2::ZERO, |sum, (m, _)| sum + (m.now - m.rest)),
            state: report.state,
            lost_count: report.markers.lost,
            markers_count: markers.len(),
        }
    }
}

/// What one frame differs from the next by noise: the standard deviation of a sum along each axis, px.
fn noise_px(frames: &[HangingFrame]) -> f64 {
    let steps: Vec<f64> = frames.windows(2).map(|pair| (pair[1].sum_px - pair[0].sum_px).length()).collect();
    robust_sigma(&steps) / std::f64::consts::SQRT_2
}

/// Median of each coordinate of the sums.
fn middle(frames: &[HangingFrame]) -> Vec2 {
    let of = |part: &dyn Fn(&HangingFrame) -> f64| median(&frames.iter().map(part).collect::<Vec<_>>());
    Vec2::new(of(&|f| f.sum_px.x), of(&|f| f.sum_px.y))
}

/// The stationary frames at the end: those whose sum is like the last ones'.
pub fn stationary_end(frames: &[HangingFrame]) -> &[HangingFrame] {
    let end = middle(&frames[frames.len().saturating_sub(FEWEST_FRAMES)..]);
    let alike_px = (ALIKE.0 * end.length()).max(ALIKE.1 * noise_px(frames));
    let count = frames.iter().rev().take_while(|f| (f.sum_px - end).length() <= alike_px).count();
    &frames[frames.len() - count..]
}

/// The longest stationary run of frames with contact before the mass hangs: it is held and still stands. Of equally long ones
/// the first; empty when none is long enough. `before`: all frames before those in which it hangs, `hanging` those.
pub fn stationary_held<'a>(before: &'a [HangingFrame], hanging: &[HangingFrame]) -> &'a [HangingFrame] {
    let noise_px = noise_px(before);
    let end = middle(hanging);
    let touches = |f: &&HangingFrame| !matches!(f.state, SlipState::NoContact | SlipState::Unjudged);
    let run_from = |from: usize| {
        let start = &before[from..before.len().min(from + FEWEST_FRAMES)];
        let level = middle(start);
        let alike_px = (ALIKE.0 * (end - level).length()).max(ALIKE.1 * noise_px);
        let alike = |f: &&HangingFrame| touches(f) && (f.sum_px - level).length() <= alike_px;
        &before[from..from + before[from..].iter().take_while(alike).count()]
    };
    let longest = (0..before.len()).map(run_from).reduce(|a, b| if b.len() > a.len() { b } else { a });
    longest.filter(|run| run.len() >= FEWEST_FRAMES).unwrap_or_default()
}

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

/// The stiffness from frames in which a mass of `weight_g` grams is held and still stands, and frames in which it hangs
/// still, shared by `fingers_count` fingers. `what`: the recording, for the provenance.
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
    for f in held.iter().chain(hanging) {
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
    let ((before, noise_px), (after, scatter_px)) = (mean_and_scatter(held), mean_and_scatter(hanging));
    let load_px = (after - before).length();
    let sum_pitch = load_px / sensor.pitch_px;
    if sum_pitch.is_nan() || sum_pitch < LEAST_SUM_PITCH {
        return Err(ShearError::Faint { sum_pitch });
    }
    if scatter_px > (MOST_SCATTER * load_px).max(NOISE_RATIO * noise_px) {
        return Err(ShearError::Swings { scatter_fraction: scatter_px / load_px });
    }
    let (n, m) = (held.len() as f64, hanging.len() as f64);
    let error_fraction = (noise_px * noise_px / n + scatter_px * scatter_px / m).sqrt() / load_px;
    if error_fraction > MOST_ERROR {
        return Err(ShearError::Noisy { error_fraction });
    }
    let at_border_px = mean(hanging, |f| f.border_sum_px) - mean(held, |f| f.border_sum_px);
    let at_border_fraction = at_border_px.dot(after - before) / (load_px * load_px);
    if at_border_fraction > MOST_AT_BORDER {
        return Err(ShearError::Cut { at_border_fraction });
    }
    let force_n = weight_g / 1000.0 * GRAVITY_M_S2 / f64::from(fingers_count.max(1));
    let span = |frames: &[HangingFrame]| format!("{} to {}", frames[0].seq, frames[frames.len() - 1].seq);
    let shared = if fingers_count > 1 { format!(" shared by {fingers_count} fingers") } else { String::new() };
    Ok(Shear {
        stiffness_n_per_pitch: force_n / sum_pitch,
        provenance: format!(
            "{weight_g} g{shared}, held in frames {} and hanging in frames {} of {what}: {force_n:.3} N moved the markers \
             by {sum_pitch:.2} pitch in sum, noise {:.1} %",
            span(held),
            span(hanging),
            100.0 * error_fraction
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::tests::smooth;

    /// Frames of a finger that is held at 7 px along x, and then carries `sum_px` along y.
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
        assert_eq!(sensor.shear_force_n(Vec2::new(0.0, 60.0)), None, "it was not measured");
        let sensor = Sensor { shear: Some(shear), ..sensor };
        sensor.check().expect("possible");
        let force = sensor.shear_force_n(Vec2::new(0.0, 30.0)).expect("measured");
        assert!((force.y - 0.204 * 9.80665 / 4.0).abs() < 1e-9 && force.x == 0.0, "{force:?}");
        // Twice the pixels of the same finger: twice the sum, the same newtons.
        let large = sensor.at_size(crate::image::SizePx::new(640, 480)).expect("same shape");
        assert!((large.shear_force_n(Vec2::new(0.0, 60.0)).expect("measured") - force).length() < 1e-9);
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
        let noisy = |first, level: f64| frames(first, 9, |i| level + 15.0 * (i % 2) as f64);
        assert!(matches!(refused(&noisy(0, -20.0), &noisy(20, 40.0)), ShearError::Noisy { .. }));
        let mut hanging = frames(20, 9, |_| 40.0);
        hanging.iter_mut().for_each(|f| f.border_sum_px.y = 12.0);
        assert_eq!(of(&hanging), ShearError::Cut { at_border_fraction: 0.2 });
        let mut hanging = frames(20, 9, |_| 40.0);
        hanging[4].state = SlipState::Incipient;
        assert_eq!(of(&hanging), ShearError::Slips { seq: 24 });
        hanging[4].state = SlipState::NoContact;
        assert_eq!(of(&hanging), ShearError::NoContact);
        hanging[4] = HangingFrame { lost_count: 20, state: SlipState::Stick, ..hanging[4] };
        assert_eq!(of(&hanging), ShearError::MarkersLost { seq: 24, lost_count: 20, markers_count: 70 });
    }
}
