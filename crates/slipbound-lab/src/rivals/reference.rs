//! Positions of the markers when the object was grasped.

use slipbound::monitor::{SlipMonitor, SlipReport, SlipState};
use slipbound::plane::Vec2;

/// A displacement of a marker in contact since the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moved {
    /// Position of the marker in the reference, rectified px.
    pub from_px: Vec2,
    /// Displacement since then, px.
    pub by_px: Vec2,
    /// Whether it lies in the inner region.
    pub inner: bool,
}

/// Positions of the markers in the reference frame: the first with contact, or the last before a call of
/// [`Reference::restart`].
#[derive(Debug, Clone, Default)]
pub(super) struct Reference {
    at_px: Vec<Option<Vec2>>,
    is_held: bool,
    now_px: Vec<Option<Vec2>>,
    moved: Vec<Moved>,
    /// Counts the references, so that a user of images knows when to take a new one.
    pub taken_count: u32,
}

impl Reference {
    /// The last frame seen becomes the reference.
    pub fn restart(&mut self) {
        if self.is_held {
            self.at_px.clone_from(&self.now_px);
            self.taken_count += 1;
        }
    }

    /// Displacement since the reference of the markers in contact, whole and matched; empty without contact, after
    /// which the next contact sets a new reference.
    pub fn moved(&mut self, monitor: &SlipMonitor, report: &SlipReport) -> &[Moved] {
        self.moved.clear();
        match report.state {
            SlipState::NoContact => {
                self.is_held = false;
                return &self.moved;
            }
            SlipState::Unjudged => return &self.moved,
            _ => {}
        }
        self.now_px.clear();
        self.now_px.extend(monitor.markers().iter().map(|m| (m.matched && m.whole).then_some(m.now)));
        if !self.is_held {
            self.is_held = true;
            self.at_px.clone_from(&self.now_px);
            self.taken_count += 1;
        }
        let known = monitor.markers().iter().zip(&self.at_px).zip(&self.now_px);
        self.moved.extend(known.filter(|((m, _), _)| m.in_contact).filter_map(|((m, from), now)| {
            let (from_px, now_px) = ((*from)?, (*now)?);
            Some(Moved { from_px, by_px: now_px - from_px, inner: m.inner })
        }));
        &self.moved
    }
}

/// Mean of the positions in the reference; the origin for none.
pub(super) fn middle_px(moved: &[Moved]) -> Vec2 {
    moved.iter().fold(Vec2::ZERO, |sum, m| sum + m.from_px) / (moved.len().max(1) as f64)
}

/// Fewest markers in contact that a rival judges.
pub(super) const LEAST_COUNT: usize = 6;
