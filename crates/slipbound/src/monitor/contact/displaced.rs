//! Contact from shear of the gel, where the image shows none.
//!
//! ```text
//!   markers displaced from their untouched positions, like their neighbours          region
//!      . . . . . .                                                                  .------.
//!      . > > > > .      longer than a share of the longest      -- discs, holes --> |######|
//!      . > > > > .                                                filled            '------'
//! ```
//!
//! A flat face that covers the whole pad has no visible rim on a smooth gel, and a light one does not press the weave.
//! Both still displace markers when they drag the gel.

use crate::image::Mask;
use crate::monitor::report::Marker;
use crate::pixels::components::Components;
use crate::pixels::patch::write_disc;
use crate::plane::Vec2;
use crate::sensor::Sensor;

/// Neighbours of a marker are within this distance at rest, pitches: those at its sides.
const NEIGHBOUR_PITCH: f64 = 1.3;
/// Most neighbours used.
const NEIGHBOURS_COUNT: usize = 6;
/// A displacement is accepted if it differs from the mean of its neighbours' by at most this share of its length.
const DISAGREEMENT_FRACTION: f64 = 0.5;
/// Share of the longest displacement from which a marker is in contact. The gel beside a sticking patch is dragged
/// along.
const REGION_FRACTION: f64 = 0.4;
/// Contact ends when displacement falls below this share of the longest one of this contact: the gel creeps back
/// slowly.
const LEFT_FRACTION: f64 = 0.1;
/// Radius of the disc around a marker in contact, pitches: discs of neighbours on either lattice leave no gap.
const RADIUS_PITCH: f64 = 0.75;

/// What a frame changes, besides scratch.
#[derive(Debug, Clone)]
struct Baseline {
    /// Displacement from rest that does not indicate contact: the shortest since the last contact.
    slack_px: Vec<Vec2>,
    /// Whether this rule detects contact, and the longest displacement since it began.
    touches: bool,
    longest_px: f64,
}

/// Finds contact from displacement; owns all scratch.
#[derive(Debug, Clone)]
pub(super) struct DisplacedContact {
    /// The neighbours at the sides of each marker.
    neighbours: Vec<[Option<u32>; NEIGHBOURS_COUNT]>,
    now: Baseline,
    /// As it was before the last frame.
    before: Baseline,
    /// Displacement beyond the slack, zero where it is rejected.
    moved_px: Vec<Vec2>,
    components: Components,
    radius_px: f64,
    begins_px: f64,
}

impl DisplacedContact {
    /// `begins_pitch`: displacement that counts as contact; None where it is zero. `rest_px`: markers at rest.
    pub fn new(sensor: &Sensor, begins_pitch: f64, rest_px: &[Vec2]) -> Option<Self> {
        if begins_pitch <= 0.0 {
            return None;
        }
        let reach_px = NEIGHBOUR_PITCH * sensor.pitch_px;
        let neighbours = (0..rest_px.len()).map(|i| {
            let near = |&j: &usize| j != i && (rest_px[j] - rest_px[i]).length() <= reach_px;
            let mut near = (0..rest_px.len()).filter(near).map(|j| j as u32);
            std::array::from_fn(|_| near.next())
        });
        let baseline = Baseline { slack_px: vec![Vec2::ZERO; rest_px.len()], touches: false, longest_px: 0.0 };
        Some(DisplacedContact {
            neighbours: neighbours.collect(),
            now: baseline.clone(),
            before: baseline,
            moved_px: vec![Vec2::ZERO; rest_px.len()],
            components: Components::new(sensor.rectified_px()),
            radius_px: RADIUS_PITCH * sensor.pitch_px,
            begins_px: begins_pitch * sensor.pitch_px,
        })
    }

    /// Call it before a frame that may have to be forgotten.
    pub fn begin_frame(&mut self) {
        let Baseline { slack_px, touches, longest_px } = &self.now;
        self.before.slack_px.copy_from_slice(slack_px);
        (self.before.touches, self.before.longest_px) = (*touches, *longest_px);
    }

    /// Returns to what was known before that frame.
    pub fn forget_frame(&mut self) {
        std::mem::swap(&mut self.now, &mut self.before);
    }

    /// Call it while the image shows a contact: after it, displacement counts from the last positions.
    pub fn reset_baseline(&mut self, markers: &[Marker]) {
        self.now.slack_px.iter_mut().zip(markers).for_each(|(slack, m)| *slack = m.now_from_rest());
        (self.now.touches, self.now.longest_px) = (false, 0.0);
    }

    /// Writes the region, empty where nothing is displaced; returns the strength: 0 at the displacement that counts as
    /// contact, 1 at twice that.
    pub fn find(&mut self, markers: &[Marker], region: &mut Mask) -> f64 {
        region.clear();
        // The displacement left by the last contact only shrinks: a gel that springs back is not dragged.
        for (slack, m) in self.now.slack_px.iter_mut().zip(markers) {
            let now = m.now_from_rest();
            *slack = if now.length_squared() < slack.length_squared() { now } else { *slack };
        }
        let longest_px = self.measure(markers);
        self.now.longest_px = self.now.longest_px.max(longest_px);
        let left_px = (self.begins_px / 2.0).max(LEFT_FRACTION * self.now.longest_px);
        self.now.touches = longest_px >= if self.now.touches { left_px } else { self.begins_px };
        if !self.now.touches {
            self.now.longest_px = 0.0;
            return 0.0;
        }
        let least_px = REGION_FRACTION * longest_px;
        for (m, moved) in markers.iter().zip(&self.moved_px) {
            if moved.length() >= least_px {
                write_disc(region, m.now, self.radius_px, true);
            }
        }
        // A rotation has no displacement at its centre.
        self.components.fill_holes(region);
        longest_px / self.begins_px - 1.0
    }

    /// Measures the displacement of every marker that its neighbours confirm; returns the longest.
    fn measure(&mut self, markers: &[Marker]) -> f64 {
        let moved = |i: usize| {
            let m = &markers[i];
            (m.matched && m.whole).then(|| m.now_from_rest() - self.now.slack_px[i])
        };
        let mut longest_px = 0.0f64;
        for (i, neighbours) in self.neighbours.iter().enumerate() {
            let (mut sum, mut count) = (Vec2::ZERO, 0);
            for moved in neighbours.iter().flatten().filter_map(|&j| moved(j as usize)) {
                sum += moved;
                count += 1;
            }
            let confirmed =
                |u: &Vec2| count >= 2 && (*u - sum / f64::from(count)).length() <= DISAGREEMENT_FRACTION * u.length();
            self.moved_px[i] = moved(i).filter(confirmed).unwrap_or(Vec2::ZERO);
            longest_px = longest_px.max(self.moved_px[i].length());
        }
        longest_px
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::tests::smooth;

    /// 12 x 9 markers at 30 px, each displaced by `by`, px.
    fn moved(by: impl Fn(Vec2) -> Vec2) -> Vec<Marker> {
        let marker = |id: u32| {
            let rest = Vec2::new(15.0 + 30.0 * f64::from(id % 12), 15.0 + 30.0 * f64::from(id / 12));
            Marker { now: rest + by(rest), ..Marker::at_rest(id, rest) }
        };
        (0..108).map(marker).collect()
    }

    fn finder() -> (DisplacedContact, Mask) {
        let mut sensor = smooth();
        sensor.pitch_px = 30.0;
        let rest: Vec<Vec2> = moved(|_| Vec2::ZERO).iter().map(|m| m.rest).collect();
        let finder = DisplacedContact::new(&sensor, 0.03, &rest).expect("wanted");
        (finder, Mask::new(sensor.rectified_px()))
    }

    const MIDDLE: Vec2 = Vec2::new(180.0, 135.0);

    #[test]
    fn what_drags_the_gel_along_is_in_contact_and_what_is_far_from_it_is_not() {
        let (mut finder, mut region) = finder();
        let strength = finder.find(&moved(|p| Vec2::new(if p.x < 180.0 { 1.8 } else { 0.2 }, 0.0)), &mut region);
        assert!((strength - 1.0).abs() < 1e-9, "1.8 px are twice 0.03 of a pitch: {strength}");
        assert!(region.get(80, 135) && region.get(165, 15) && !region.get(240, 135));
    }

    #[test]
    fn a_turn_has_its_middle_in_contact_too() {
        let (mut finder, mut region) = finder();
        let turned = moved(|p| if (p - MIDDLE).length() < 100.0 { (p - MIDDLE).turned() * 0.04 } else { Vec2::ZERO });
        assert!(finder.find(&turned, &mut region) > 0.5);
        assert!(region.get(180, 135) && region.get(120, 135) && !region.get(15, 15));
    }

    #[test]
    fn lone_and_lost_markers_and_noise_are_no_contact() {
        let (mut finder, mut region) = finder();
        let lone =
            moved(|p| if (p - Vec2::new(165.0, 135.0)).length() < 1.0 { Vec2::new(20.0, 0.0) } else { Vec2::ZERO });
        let noise = moved(|p| Vec2::new(1.0, 0.0).rotated(0.37 * p.x * p.x + 0.71 * p.y * p.y + 0.13 * p.x * p.y));
        let mut lost = moved(|_| Vec2::new(9.0, 0.0));
        lost.iter_mut().for_each(|m| m.matched = false);
        for markers in [lone, noise, lost] {
            finder.find(&markers, &mut region);
            assert!(region.area_px2() < 3072, "{} px2: a contact begins with 3072", region.area_px2());
        }
    }

    #[test]
    fn a_gel_that_creeps_back_after_a_contact_is_touched_by_nothing_until_it_is_dragged_again() {
        let (mut finder, mut region) = finder();
        finder.reset_baseline(&moved(|_| Vec2::new(6.0, 0.0)));
        for left_px in [6.0, 4.0, 3.0, 1.0, 0.5] {
            finder.find(&moved(|_| Vec2::new(left_px, 0.0)), &mut region);
            assert_eq!(region.area_px2(), 0, "{left_px} px left");
        }
        finder.find(&moved(|_| Vec2::new(1.3, 0.0)), &mut region);
        assert_eq!(region.area_px2(), 0, "0.8 px on top of what is left");
        finder.find(&moved(|_| Vec2::new(1.5, 0.0)), &mut region);
        assert!(region.area_px2() > 0, "1 px");
    }

    #[test]
    fn a_gel_that_springs_back_all_at_once_is_touched_by_nothing() {
        let (mut finder, mut region) = finder();
        finder.reset_baseline(&moved(|_| Vec2::new(27.0, 0.0)));
        // It was dragged on before the image showed that it is free.
        finder.find(&moved(|_| Vec2::new(29.0, 0.0)), &mut region);
        for _ in 0..2 {
            finder.find(&moved(|_| Vec2::ZERO), &mut region);
            assert_eq!(region.area_px2(), 0);
        }
    }

    #[test]
    fn it_ends_at_half_of_what_begins_it_or_at_a_tenth_of_the_longest() {
        let (mut finder, mut region) = finder();
        let mut touches = |by_px: f64| {
            finder.find(&moved(|_| Vec2::new(by_px, 0.0)), &mut region);
            region.area_px2() > 0
        };
        assert!(!touches(0.8) && touches(1.0) && touches(0.5) && !touches(0.4));
        assert!(!touches(0.8), "begun anew as at first");
        assert!(touches(30.0) && touches(3.2) && !touches(2.9));
    }
}
