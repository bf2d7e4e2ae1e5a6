//! Recovers the identity of the markers after missed frames.
//!
//! ```text
//!   tried: every translation of the whole field, in steps of half a pitch
//!
//!   right        o  o   o  o     each marker is where its neighbours predict it: irregular as at rest
//!   a pitch off   o   o  o   o   the irregularities belong to other markers
//! ```
//!
//! Printed and painted dots are some hundredths of a pitch off their grid, which distinguishes a marker from the next.
//! Where they are not, there is no result.

use super::matching::Matching;
use crate::monitor::report::Marker;
use crate::plane::Vec2;

/// Steps tried each way along both axes, and their length.
const STEPS_EACH_WAY: i32 = 5;
const STEP_PITCH: f64 = 0.5;
/// Spots this near to a tried position are considered: more than the distance to the nearest step.
const REACH_PITCH: f64 = 0.4;
/// Motions are skipped when their misfit exceeds the least one by more than this share of that of a missing spot.
const WORSE_FRACTION: f64 = 0.15;
/// The deviation from the neighbours under the best motion must be at most this share of that under any other.
const CLEARLY_NEARER: f64 = 0.7;
/// Two answers this near are the same.
const SAME_PITCH: f64 = 0.5;

/// A candidate: the motion of the markers, and their median distance from the positions predicted by their neighbours.
#[derive(Debug, Clone, Copy)]
struct Answer {
    motion: Vec2,
    off_px: f64,
}

/// Finds the motion of the whole field during missed frames; owns its scratch.
#[derive(Debug, Clone)]
pub(super) struct Anchor {
    offs_px: Vec<f64>,
    answers: Vec<Answer>,
}

impl Anchor {
    pub(super) fn new(markers_count: usize) -> Self {
        let tried = (2 * STEPS_EACH_WAY + 1) as usize;
        Anchor { offs_px: Vec::with_capacity(markers_count), answers: Vec::with_capacity(tried * tried) }
    }

    /// The motion of the markers from `before`, px; None where two motions explain the spots equally well. Clears the
    /// matches of `matching`.
    pub(super) fn find(
        &mut self,
        matching: &mut Matching,
        markers: &[Marker],
        before: impl Iterator<Item = Vec2> + Clone,
        pitch_px: f64,
    ) -> Option<Vec2> {
        let steps = || {
            let each_way = -STEPS_EACH_WAY..=STEPS_EACH_WAY;
            let all = each_way.clone().flat_map(move |y| each_way.clone().map(move |x| (x, y)));
            all.map(|(x, y)| Vec2::new(f64::from(x), f64::from(y)) * (STEP_PITCH * pitch_px))
        };
        let misfit = |matching: &Matching, motion: Vec2| {
            matching.misfit(before.clone().map(|place| place + motion), REACH_PITCH) / (REACH_PITCH * pitch_px).powi(2)
        };
        let least = steps().map(|motion| misfit(matching, motion)).fold(f64::MAX, f64::min);
        self.answers.clear();
        for motion in steps() {
            if misfit(matching, motion) <= least + WORSE_FRACTION {
                matching.clear();
                matching.predict(before.clone().map(|place| place + motion));
                matching.assign(REACH_PITCH);
                let answer = self.look(matching, markers, before.clone());
                self.answers.extend(answer);
            }
        }
        matching.clear();
        let best = *self.answers.iter().min_by(|a, b| a.off_px.total_cmp(&b.off_px))?;
        let others = self.answers.iter().filter(|a| (a.motion - best.motion).length() > SAME_PITCH * pitch_px);
        let next_px = others.map(|a| a.off_px).fold(f64::MAX, f64::min);
        (best.off_px <= CLEARLY_NEARER * next_px).then_some(best.motion)
    }

    /// The candidate given by the current matches.
    fn look(&mut self, matching: &Matching, markers: &[Marker], before: impl Iterator<Item = Vec2>) -> Option<Answer> {
        let (mut sum, mut count) = (Vec2::ZERO, 0.0);
        self.offs_px.clear();
        for (i, before) in before.enumerate() {
            let Some((spot, place)) = matching.spot_and_place(markers, i) else { continue };
            sum += spot - before;
            count += 1.0;
            self.offs_px.push((spot - place).length());
        }
        if self.offs_px.len() < 4 || 2 * self.offs_px.len() < markers.len() {
            return None;
        }
        let middle = self.offs_px.len() / 2;
        let (_, off_px, _) = self.offs_px.select_nth_unstable_by(middle, f64::total_cmp);
        Some(Answer { motion: sum / count, off_px: *off_px })
    }
}
