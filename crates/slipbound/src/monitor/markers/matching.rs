//! Matching of spots to markers.
//!
//! Three rules, in this order: a spot near the predicted position is the marker, nearest pairs first; a match that
//! contradicts its neighbours is undone; a marker without a spot is searched for where its neighbours moved. A marker
//! still without a spot is expected there and moves with them.

use super::median::median_of;
use super::plane_fit::{NEIGHBOURS, NeighbourPlane, slopes};
use super::spot_index::SpotIndex;
use super::view::View;
use crate::image::Mask;
use crate::monitor::report::Marker;
use crate::pixels::dots::Spot;
use crate::plane::Vec2;
use crate::sensor::Sensor;

/// A match is undone when it is further than this from the position predicted by its neighbours: a swap with the next
/// marker is off by a whole pitch, the gradient at the rim of a slipping contact by less than half a pitch.
const CONTRADICTION_PITCH: f64 = 0.6;
/// Largest share of the markers in view that a trusted frame may miss.
const MISSED_FRACTION: f64 = 0.02;
/// Largest RMS distance of markers from the positions predicted by their neighbours in a trusted frame. Real contacts
/// stay below 0.08; matches to noise reach 0.2 and more.
const DISAGREEMENT_PITCH: f64 = 0.15;
/// Largest distance of a spot from the position predicted by the neighbours.
const RECOVERY_PITCH: f64 = 0.4;
/// Rounds of recovery: each reaches one neighbourhood further into a region without detected markers.
const ROUNDS: usize = 4;

/// Markers this near to their rest position are taken to be still; an inconsistent field is regrown from them.
const STILL_PITCH: f64 = 0.25;
/// Rounds of growing: a fingertip contact is about ten pitches wide.
const GROWING_ROUNDS: usize = 14;
/// Inconsistency as a share of all markers above which a part of the field may be off by a pitch: 0.06 when a whole
/// contact is, 0.01 to 0.03 in a contact under strong shear.
const INCONSISTENT_FRACTION: f64 = 0.03;
/// A regrown field is accepted when its inconsistency is below the first share of the earlier one or, soon after a snap,
/// below the second in this many frames in a row. After a snap it has 0.42 to 0.82 of the inconsistency, frame after
/// frame. In a correctly matched field under strong shear it can be below the second share, too: in twelve simulated ramps
/// of 30 and 60 N never in two frames in a row, in a cap screwed on at 40 N in three.
const CLEARLY_LESS: f64 = 0.5;
const LESS: f64 = 0.8;
const LESS_FRAMES_COUNT: u32 = 3;
/// Rise of the inconsistency from one frame to the next, as a share of all markers, that a snap causes (0.043 when a
/// cap breaks loose; growing shear up to 0.014), and the number of frames after it that count as soon.
const SNAP_RISE_FRACTION: f64 = 0.03;
const SNAP_FRAMES_COUNT: u32 = 10;

const NO_SPOT: u32 = u32::MAX;

#[derive(Debug, Clone, Copy)]
struct Pair {
    distance_squared: f64,
    marker: u32,
    spot: u32,
}

/// Matches spots to markers; owns all scratch.
#[derive(Debug, Clone)]
pub(super) struct Matching {
    pitch_px: f64,
    view: View,
    spots: SpotIndex,
    spot_taken: Vec<bool>,
    least_response: Vec<f32>,
    predicted: Vec<Vec2>,
    match_of: Vec<u32>,
    pairs: Vec<Pair>,
    undone: Vec<bool>,
    /// Inconsistency of the last frame, before its field was regrown.
    last_inconsistency: f64,
    /// Frames that still count as soon after a snap.
    snap_frames_left_count: u32,
    /// Frames in a row in which the regrown field was less inconsistent than the matched one.
    less_frames_count: u32,
    saved_match_of: Vec<u32>,
    saved_predicted: Vec<Vec2>,
    disagreement_pitch: f64,
    /// The round from which the position inferred for a marker without a spot is used for its neighbours; 0: never.
    inferred_from_round: Vec<usize>,
    round: usize,
    neighbours: Vec<[u32; NEIGHBOURS]>,
    neighbours_count: Vec<usize>,
    neighbour_planes: Vec<NeighbourPlane>,
    /// The matches before any was undone, and the position predicted for each by its neighbours at that time.
    matches_before_undo: Vec<u32>,
    neighbour_prediction: Vec<Option<Vec2>>,
}

impl Matching {
    /// `view`: the pixels that the camera sees, if not all.
    pub(super) fn new(sensor: &Sensor, markers: &[Marker], view: Option<&Mask>) -> Self {
        let (size, pitch_px) = (sensor.rectified_px(), sensor.pitch_px);
        let mut neighbours = vec![[0; NEIGHBOURS]; markers.len()];
        let mut neighbours_count = vec![0; markers.len()];
        let mut order: Vec<(f64, u32)> = Vec::new();
        for (i, m) in markers.iter().enumerate() {
            order.clear();
            let others = markers.iter().filter(|o| o.id != m.id);
            order.extend(others.map(|o| ((o.rest - m.rest).length_squared(), o.id)));
            order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            neighbours_count[i] = order.len().min(NEIGHBOURS);
            neighbours[i].iter_mut().zip(&order).for_each(|(n, o)| *n = o.1);
        }
        let arms = |(m, n): (&Marker, &[u32; NEIGHBOURS])| n.map(|n| markers[n as usize].rest - m.rest);
        let neighbour_planes =
            markers.iter().zip(&neighbours).map(arms).map(|arms| NeighbourPlane::new(arms, pitch_px)).collect();
        Matching {
            pitch_px,
            view: View::new(sensor, view),
            disagreement_pitch: 0.0,
            spots: SpotIndex::new(size, 0.5 * pitch_px),
            spot_taken: Vec::with_capacity(SpotIndex::most_spots(size)),
            least_response: vec![0.0; markers.len()],
            predicted: vec![Vec2::ZERO; markers.len()],
            match_of: vec![NO_SPOT; markers.len()],
            // Spots are at least 0.45 pitch apart: at most nine lie within half a pitch of a position.
            pairs: Vec::with_capacity(9 * markers.len()),
            undone: vec![false; markers.len()],
            last_inconsistency: 0.0,
            snap_frames_left_count: 0,
            less_frames_count: 0,
            saved_match_of: vec![NO_SPOT; markers.len()],
            saved_predicted: vec![Vec2::ZERO; markers.len()],
            inferred_from_round: vec![0; markers.len()],
            round: 0,
            neighbours,
            neighbours_count,
            neighbour_planes,
            matches_before_undo: vec![NO_SPOT; markers.len()],
            neighbour_prediction: vec![None; markers.len()],
        }
    }

    /// Takes the spots of a frame and clears all matches.
    pub(super) fn take_spots(&mut self, spots: &[Spot]) {
        self.spots.take(spots);
        self.spot_taken.clear();
        self.spot_taken.resize(spots.len(), false);
        self.match_of.fill(NO_SPOT);
        self.matches_before_undo.fill(NO_SPOT);
    }

    /// Clears all matches and frees all spots.
    pub(super) fn clear(&mut self) {
        self.spot_taken.fill(false);
        self.match_of.fill(NO_SPOT);
        self.inferred_from_round.fill(0);
        self.round = 0;
    }

    /// Position of a matched marker, and the position predicted by its neighbours.
    pub(super) fn spot_and_place(&self, markers: &[Marker], marker: usize) -> Option<(Vec2, Vec2)> {
        Some((self.spot_of(marker)?.position, self.predicted_by_neighbours(markers, marker)?))
    }

    /// Sets the least contrast of a spot for each marker.
    pub(super) fn least_response(&mut self, least: impl Iterator<Item = f32>) {
        self.least_response.iter_mut().zip(least).for_each(|(l, v)| *l = v);
    }

    /// Sets where to look for each marker.
    pub(super) fn predict(&mut self, places: impl Iterator<Item = Vec2>) {
        self.predicted.iter_mut().zip(places).for_each(|(p, v)| *p = v);
    }

    /// How badly positions explain the spots: mean squared distance to the nearest spot, cut at the reach.
    pub(super) fn misfit(&self, places: impl Iterator<Item = Vec2>, reach_pitch: f64) -> f64 {
        let reach_px = reach_pitch * self.pitch_px;
        let (mut sum, mut count) = (0.0, 0u32);
        for place in places.filter(|&p| self.in_view(p)) {
            let mut best = reach_px * reach_px;
            self.spots.near(place, |_, distance_squared| best = best.min(distance_squared));
            sum += best;
            count += 1;
        }
        sum / f64::from(count.max(1))
    }

    /// Whether a marker at `p` is entirely in view.
    pub(super) fn in_view(&self, p: Vec2) -> bool {
        self.view.holds(p)
    }

    /// Whether the matches of this frame can be trusted: hardly any marker in view is missed, and each moved like its
    /// neighbours. Noise, glare and swapped markers fail this test.
    pub(super) fn trustworthy(&self) -> bool {
        let (mut missed, mut count) = (0u32, 0u32);
        for i in (0..self.match_of.len()).filter(|&i| self.match_of[i] != NO_SPOT || self.in_view(self.predicted[i])) {
            count += 1;
            missed += u32::from(self.match_of[i] == NO_SPOT);
        }
        let most_missed = (MISSED_FRACTION * f64::from(count)) as u32;
        missed <= most_missed && self.disagreement_pitch <= DISAGREEMENT_PITCH
    }

    /// Matches markers without a spot to free spots within reach of their predicted position, nearest pairs first.
    pub(super) fn assign(&mut self, reach_pitch: f64) {
        let reach_px = reach_pitch * self.pitch_px;
        let mut pairs = std::mem::take(&mut self.pairs);
        pairs.clear();
        for marker in 0..self.match_of.len() {
            if self.match_of[marker] != NO_SPOT {
                continue;
            }
            self.spots.near(self.predicted[marker], |spot, distance_squared| {
                let strong = self.spots.all()[spot as usize].response_levels >= self.least_response[marker];
                if strong && !self.spot_taken[spot as usize] && distance_squared <= reach_px * reach_px {
                    pairs.push(Pair { distance_squared, marker: marker as u32, spot });
                }
            });
        }
        pairs.sort_unstable_by(|a, b| {
            let ids = |p: &Pair| (p.marker, p.spot);
            a.distance_squared.total_cmp(&b.distance_squared).then_with(|| ids(a).cmp(&ids(b)))
        });
        for pair in &pairs {
            let (marker, spot) = (pair.marker as usize, pair.spot as usize);
            if self.match_of[marker] == NO_SPOT && !self.spot_taken[spot] {
                self.match_of[marker] = pair.spot;
                self.spot_taken[spot] = true;
            }
        }
        self.pairs = pairs;
    }

    /// Undoes matches that contradict their neighbours, then searches for markers where their neighbours moved.
    pub(super) fn settle_with_neighbours(&mut self, markers: &[Marker]) {
        self.round = 0;
        let (mut sum, mut count) = (0.0, 0u32);
        self.matches_before_undo.copy_from_slice(&self.match_of);
        for i in 0..markers.len() {
            let spot = self.spot_of(i).map(|spot| spot.position);
            self.neighbour_prediction[i] = spot.and_then(|_| self.predicted_by_neighbours(markers, i));
            let off_pitch =
                spot.zip(self.neighbour_prediction[i]).map(|(spot, place)| (spot - place).length() / self.pitch_px);
            self.undone[i] = off_pitch.is_some_and(|off| off > CONTRADICTION_PITCH);
            sum += off_pitch.map_or(0.0, |off| off * off);
            count += u32::from(off_pitch.is_some());
        }
        self.disagreement_pitch = (sum / f64::from(count.max(1))).sqrt();
        for i in 0..markers.len() {
            if self.undone[i] {
                self.spot_taken[self.match_of[i] as usize] = false;
                self.match_of[i] = NO_SPOT;
            }
        }
        self.recover_from_neighbours(markers, ROUNDS);
    }

    /// A gel that snaps back moves by a pitch within one frame, and each marker is then matched to the spot of the
    /// next. The field is inconsistent at the boundary of that region. If it is, regrows it from the markers that hardly
    /// moved before (`trusted`), and keeps the result if its inconsistency is clearly smaller or, after a snap, smaller
    /// in several frames in a row.
    pub(super) fn repair_field(&mut self, markers: &[Marker], trusted: impl Iterator<Item = Vec2>) {
        let before = self.inconsistency(markers);
        let rise = before - std::mem::replace(&mut self.last_inconsistency, before);
        if before <= INCONSISTENT_FRACTION * markers.len() as f64 {
            (self.snap_frames_left_count, self.less_frames_count) = (0, 0);
            return;
        }
        let has_snapped = rise > SNAP_RISE_FRACTION * markers.len() as f64;
        self.snap_frames_left_count =
            if has_snapped { SNAP_FRAMES_COUNT } else { self.snap_frames_left_count.saturating_sub(1) };
        self.saved_match_of.copy_from_slice(&self.match_of);
        self.saved_predicted.copy_from_slice(&self.predicted);
        for ((undone, m), trusted) in self.undone.iter_mut().zip(markers).zip(trusted) {
            *undone = (trusted - m.rest).length() > STILL_PITCH * self.pitch_px;
        }
        self.spot_taken.fill(false);
        self.match_of.fill(NO_SPOT);
        for (i, m) in markers.iter().enumerate() {
            // A marker that may have moved has no predicted position until its neighbours provide one.
            let far = Vec2::new(f64::NAN, f64::NAN);
            self.predicted[i] = if self.undone[i] { far } else { m.rest };
        }
        self.assign(RECOVERY_PITCH);
        self.recover_from_neighbours(markers, GROWING_ROUNDS);
        let regrown = self.inconsistency(markers);
        let is_less = regrown < LESS * before && self.snap_frames_left_count > 0;
        self.less_frames_count = if is_less { self.less_frames_count + 1 } else { 0 };
        if regrown < CLEARLY_LESS * before || self.less_frames_count >= LESS_FRAMES_COUNT {
            (self.snap_frames_left_count, self.less_frames_count) = (0, 0);
            return;
        }
        self.match_of.copy_from_slice(&self.saved_match_of);
        self.predicted.copy_from_slice(&self.saved_predicted);
        self.inferred_from_round.fill(0);
        self.spot_taken.fill(false);
        for &spot in self.match_of.iter().filter(|&&spot| spot != NO_SPOT) {
            self.spot_taken[spot as usize] = true;
        }
    }

    /// How inconsistent the field is: one for each missed marker in view, and up to one for each match, by how far it
    /// contradicts its neighbours.
    fn inconsistency(&self, markers: &[Marker]) -> f64 {
        let one = |i: usize| match self.spot_of(i) {
            None => f64::from(!self.predicted[i].is_finite() || self.in_view(self.predicted[i])),
            Some(spot) => {
                let off_pitch = self
                    .cached_neighbour_prediction(markers, i)
                    .map_or(CONTRADICTION_PITCH, |predicted| (spot.position - predicted).length() / self.pitch_px);
                let share = (off_pitch / CONTRADICTION_PITCH).min(1.0);
                share * share
            }
        };
        (0..markers.len()).map(one).sum()
    }

    /// Searches for markers without a spot where their neighbours moved, further inwards in each round.
    fn recover_from_neighbours(&mut self, markers: &[Marker], rounds_count: usize) {
        self.inferred_from_round.fill(0);
        self.round = 0;
        for round in 1..=rounds_count {
            let mut any_inferred = false;
            for i in 0..markers.len() {
                if self.match_of[i] != NO_SPOT {
                    continue;
                }
                if let Some(place) = self.predicted_by_neighbours(markers, i) {
                    self.predicted[i] = place;
                    // Used by others from the next round on.
                    self.inferred_from_round[i] =
                        if self.inferred_from_round[i] == 0 { round + 1 } else { self.inferred_from_round[i] };
                    any_inferred = true;
                }
            }
            if !any_inferred {
                return;
            }
            self.assign(RECOVERY_PITCH);
            self.round = round + 1;
        }
    }

    /// Position of a marker: its spot, or the position inferred from its neighbours in an earlier round.
    fn known(&self, marker: usize) -> Option<Vec2> {
        let inferred = || (1..=self.round).contains(&self.inferred_from_round[marker]).then(|| self.predicted[marker]);
        self.spot_of(marker).map(|s| s.position).or_else(inferred)
    }

    /// The spot of a marker.
    pub(super) fn spot_of(&self, marker: usize) -> Option<&Spot> {
        self.spots.all().get(self.match_of[marker] as usize)
    }

    /// Where a marker without a spot is expected.
    pub(super) fn expected(&self, marker: usize) -> Vec2 {
        self.predicted[marker]
    }

    /// Position of a marker whose spot is cut by the border of the view: along the border from its spot, across it from
    /// its neighbours. None without spot or neighbours.
    pub(super) fn cut(&self, markers: &[Marker], marker: usize) -> Option<Vec2> {
        let own = self.spot_of(marker)?.position;
        let predicted = self.predicted_by_neighbours(markers, marker)?;
        let [is_cut_x, is_cut_y] = self.view.cuts(own);
        let x = if is_cut_x { predicted.x } else { own.x };
        let y = if is_cut_y { predicted.y } else { own.y };
        Some(Vec2::new(x, y))
    }

    /// The neighbours of a marker, then the marker itself.
    pub(super) fn with_neighbours(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        self.neighbours[i][..self.neighbours_count[i]].iter().map(|&n| n as usize).chain([i])
    }

    /// Median step of the neighbours and the marker itself since the last frame, per axis, from their spots. None with
    /// fewer than three spots.
    pub(super) fn step_of_neighbours(&self, before: &[Vec2], i: usize) -> Option<Vec2> {
        let (mut steps, mut count) = ([Vec2::ZERO; NEIGHBOURS + 1], 0);
        for n in self.with_neighbours(i) {
            let Some(spot) = self.spot_of(n) else { continue };
            steps[count] = spot.position - before[n];
            count += 1;
        }
        let steps = &steps[..count];
        (count >= 3).then(|| Vec2::new(median_of(steps, |step| step.x), median_of(steps, |step| step.y)))
    }

    /// Stretch and rotation of the gel around marker `i` with the markers at `places`: displacement per current length
    /// along x and along y, by least squares over the neighbours.
    pub(super) fn stretch(&self, markers: &[Marker], places: &[Vec2], i: usize) -> [Vec2; 2] {
        let (here, place) = (markers[i].rest, places[i]);
        let neighbours = self.neighbours[i][..self.neighbours_count[i]].iter();
        slopes(
            neighbours.map(|&n| {
                let (rest, now) = (markers[n as usize].rest - here, places[n as usize] - place);
                (now, now - rest)
            }),
            self.pitch_px,
        )
    }

    /// [`Matching::predicted_by_neighbours`] of a marker with a spot; reuses the value from before matches were undone
    /// where that is still valid.
    fn cached_neighbour_prediction(&self, markers: &[Marker], i: usize) -> Option<Vec2> {
        let stands = |&n: &u32| {
            let n = n as usize;
            let inferred = self.match_of[n] == NO_SPOT && self.inferred_from_round[n] != 0;
            self.match_of[n] == self.matches_before_undo[n] && !inferred
        };
        let was_matched = self.matches_before_undo[i] != NO_SPOT;
        if was_matched && self.neighbours[i][..self.neighbours_count[i]].iter().all(stands) {
            return self.neighbour_prediction[i];
        }
        self.predicted_by_neighbours(markers, i)
    }

    /// Rest position plus the displacement there of a plane fitted to the neighbours with a known position; None with
    /// fewer than three of them.
    fn predicted_by_neighbours(&self, markers: &[Marker], i: usize) -> Option<Vec2> {
        let here = markers[i].rest;
        // Known neighbours and their displacements.
        let (mut known, mut displaced) = ([0; NEIGHBOURS], [Vec2::ZERO; NEIGHBOURS]);
        let (mut count, mut shift) = (0, Vec2::ZERO);
        for &n in &self.neighbours[i][..self.neighbours_count[i]] {
            let Some(place) = self.known(n as usize) else { continue };
            (known[count], displaced[count]) = (n as usize, place - markers[n as usize].rest);
            shift += displaced[count];
            count += 1;
        }
        if count < 3 {
            return None;
        }
        let shift = shift / count as f64;
        if count == NEIGHBOURS {
            let [slope_x, slope_y] = self.neighbour_planes[i].slopes(displaced.map(|d| d - shift));
            let middle = self.neighbour_planes[i].middle;
            return Some(here + shift - slope_x * middle.x - slope_y * middle.y);
        }
        let arms = known[..count].iter().map(|&n| markers[n].rest - here);
        let mut middle = Vec2::ZERO;
        arms.clone().for_each(|arm| middle += arm);
        let middle = middle / count as f64;
        let [slope_x, slope_y] = slopes(arms.zip(displaced).map(|(arm, d)| (arm - middle, d - shift)), self.pitch_px);
        Some(here + shift - slope_x * middle.x - slope_y * middle.y)
    }
}

#[cfg(test)]
mod tests;
