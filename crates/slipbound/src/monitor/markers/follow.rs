//! Between two searches for spots (at 90 Hz: in every third frame while a marker is missing, else in every fifth), each
//! marker is followed from the position predicted by its own motion.
//!
//! ```text
//!   position + last step --edge pull, or template where the weave is pressed--> position   core as dark as before?
//!                                                                                          if any is not: full search
//! ```
//! Lost markers wait for the next search, three frames later at most, and move with their neighbours until then.

use super::detect::core_levels;
use super::templates::{MarkerTemplates, TemplateMatch};
use super::{Markers, is_away};
use crate::monitor::imprint::Imprint;
use crate::plane::Vec2;

/// A core whose brightness changed by more than this share of the dot's contrast is no longer the marker's.
const CORE_CHANGE: f64 = 0.4;

impl Markers {
    /// Follows the whole markers. Returns whether all were found; if not, no position is changed.
    pub(super) fn follow(&mut self, imprint: &Imprint, touched: bool) -> bool {
        let known = self.anchored && self.untrusted_frames_count == 0 && self.matched_count > 0;
        if !known || !self.settings.follows() {
            return false;
        }
        self.before.iter_mut().zip(&self.all).for_each(|(b, m)| *b = m.now);
        for i in 0..self.all.len() {
            if self.all[i].whole {
                let Some(place) = self.near(imprint, i, touched) else { return false };
                self.followed[i] = place;
            }
        }
        for i in 0..self.all.len() {
            let marker = self.all[i];
            let now = if marker.whole { self.followed[i] } else { marker.now + self.step_around(i) };
            self.all[i].now = now;
            self.tracks[i].trusted = now;
            self.tracks[i].step = if marker.matched { now - marker.now } else { Vec2::ZERO };
        }
        true
    }

    /// Finds a whole marker near the position predicted by its motion.
    fn near(&mut self, imprint: &Imprint, i: usize, touched: bool) -> Option<Vec2> {
        let track = &self.tracks[i];
        let start = self.all[i].now + track.step;
        let rest = track.rest;
        let contrast = f64::from(track.response_levels / rest.response_levels);
        let away = touched && is_away(&self.matching, &self.all, i);
        let is_plain = |templates: &MarkerTemplates| away && templates.is_plain(i, Some(start), Some(start));
        if let Some(templates) = self.templates.as_mut().filter(|templates| !is_plain(templates)) {
            let stretch = self.matching.stretch(&self.all, &self.before, i);
            match templates.find(imprint, i, None, Some(start), stretch) {
                TemplateMatch::Found(fit) if self.detector.in_view(imprint, fit.place) => {
                    return Some(self.settle(imprint, i, &fit, None));
                }
                TemplateMatch::Found(_) | TemplateMatch::Rejected => return None,
                TemplateMatch::NotChecked => {}
            }
        }
        let place = self.detector.follow(imprint, start, contrast, &rest)?;
        let core_levels = core_levels(&imprint.grey, imprint.size(), place)?;
        let changed = f64::from((core_levels - self.tracks[i].core_levels).abs());
        if changed > 9.0 * CORE_CHANGE * f64::from(self.tracks[i].response_levels) {
            return None;
        }
        self.tracks[i].core_levels = core_levels;
        Some(place)
    }

    /// Mean step of the whole markers around since the previous frame; zero without any.
    fn step_around(&self, i: usize) -> Vec2 {
        let (mut sum, mut count) = (Vec2::ZERO, 0u32);
        for n in self.matching.with_neighbours(i).filter(|&n| self.all[n].whole) {
            sum += self.followed[n] - self.before[n];
            count += 1;
        }
        sum / f64::from(count.max(1))
    }
}
