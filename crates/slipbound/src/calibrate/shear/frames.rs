//! Measurements of each frame of the recording, and the frames in which the mass is held or hangs still.

use crate::calibrate::fit::{median, robust_sigma};
use crate::monitor::{Marker, SlipReport, SlipState};
use crate::plane::Vec2;
use crate::sensor::Sensor;

/// Fewest frames in which the mass is held, and in which it hangs.
pub(super) const FEWEST_FRAMES: usize = 5;
/// Frames are alike when their sums differ by at most this share of the load, or by at most this many standard
/// deviations of the noise along each axis, which 1 of 450 frames exceeds.
const ALIKE: (f64, f64) = (0.05, 3.5);
/// A marker is an outermost one when a sector this wide has no other marker within this many pitches.
const NEIGHBOURS_PITCH: f64 = 2.3;
const OPEN_SECTOR_RAD: f64 = 2.6;

/// The sum over all markers of their displacement from rest, rectified px.
pub fn displacement_sum_px(markers: &[Marker]) -> Vec2 {
    markers.iter().fold(Vec2::ZERO, |sum, m| sum + (m.now - m.rest))
}

/// Frames on either side of a frame over which [`steadied`] takes the median.
const STEADY_FRAMES: usize = 2;

/// The markers of a frame at the median of their positions in the frames around it: this removes jumps to a gap of the
/// weave for a frame or two. `frames`: the markers of every frame, in order.
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

/// The outermost markers: those with a wide sector without other markers. One value per marker, in their order.
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
    /// The state reported by the monitor.
    pub state: SlipState,
    /// Lost markers.
    pub lost_count: u32,
    /// Markers in all.
    pub markers_count: usize,
}

impl HangingFrame {
    /// From the report of a frame. `outermost`: from [`outermost`].
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

/// Noise from the differences of successive frames: the standard deviation of a sum along each axis, px.
pub(super) fn noise_px(frames: &[HangingFrame]) -> f64 {
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

/// The longest stationary run of frames with contact before the mass hangs: it is held and still supported. The first
/// of equally long ones; empty when none is long enough. `before`: all frames before the `hanging` ones.
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
