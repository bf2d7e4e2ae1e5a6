//! Whether something may be between the jaws, whatever the gripper reports: after an acknowledged fast stop, for
//! example, it presses without reporting that it holds. A force reading alone is no evidence: motors read a current
//! with nothing between the jaws.

use super::config::Config;
use slipbound::port::{GripperState, Jaws};

/// Least motion of the jaws that counts, mm.
const MOVED_MM: f64 = 1.0;

/// Idle readings that are averaged; beyond that the oldest are forgotten.
const IDLE_COUNT: u32 = 50;

/// What is remembered of the jaws.
#[derive(Debug, Default)]
pub(super) struct GraspTracker {
    /// Whether they closed, held or stopped, and have not opened since.
    is_grasped: bool,
    /// The least opening since then, mm.
    grasped_mm: Option<f64>,
    idle_n: f64,
    idle_count: u32,
}

impl GraspTracker {
    /// A new state.
    pub fn see(&mut self, state: &GripperState, config: &Config) {
        match state.jaws {
            Jaws::Closing | Jaws::Holding | Jaws::Stopped => {
                self.is_grasped = true;
                self.grasped_mm = self.grasped_mm.into_iter().chain(state.opening_mm).reduce(f64::min);
            }
            Jaws::Nothing | Jaws::Lost => (self.is_grasped, self.grasped_mm) = (false, None),
            Jaws::Open if self.has_opened(state, config) => {
                (self.is_grasped, self.grasped_mm) = (false, None);
                if let Some(force_n) = state.force_n {
                    self.idle_count = (self.idle_count + 1).min(IDLE_COUNT);
                    self.idle_n += (force_n - self.idle_n) / f64::from(self.idle_count);
                }
            }
            Jaws::Open | Jaws::Unknown => {}
        }
    }

    /// Whether something is, or may soon be, between the jaws.
    pub fn seems_to_hold(&self, state: &GripperState, config: &Config) -> bool {
        let presses = state.force_n.is_none_or(|force_n| force_n - self.idle_n > 0.5 * config.least_n);
        match state.jaws {
            Jaws::Closing | Jaws::Holding | Jaws::Stopped => true,
            Jaws::Nothing | Jaws::Lost => false,
            // Jaws that were never seen to open may hold what was grasped before the link was made.
            Jaws::Open | Jaws::Unknown => match self.is_grasped {
                true => presses,
                false => state.force_n.is_some() && presses && !self.has_opened(state, config),
            },
        }
    }

    /// Whether the jaws are open by their position: at the commanded opening, or wider than they held.
    fn has_opened(&self, state: &GripperState, config: &Config) -> bool {
        let Some(opening_mm) = state.opening_mm else { return false };
        let is_wide = opening_mm >= config.open_mm - MOVED_MM
            && config.part_width_mm.is_none_or(|width_mm| width_mm < opening_mm - MOVED_MM);
        is_wide || self.grasped_mm.is_some_and(|grasped_mm| opening_mm > grasped_mm + MOVED_MM)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper::config::Kind;

    #[test]
    fn what_open_jaws_read_is_taken_off_in_the_mean_however_it_scatters() {
        let config = Config::of(Kind::Wsg50);
        let open = |force_n: f64| GripperState {
            time_ns: 0,
            force_n: Some(force_n),
            force_error_n: None,
            target_n: None,
            opening_mm: Some(config.open_mm),
            jaws: Jaws::Open,
        };
        let mut grasp = GraspTracker::default();
        for reading in 0..200 {
            grasp.see(&open(if reading % 2 == 0 { 6.0 } else { 10.0 }), &config);
        }
        assert!((grasp.idle_n - 8.0).abs() < 0.1, "{}", grasp.idle_n);
    }
}
