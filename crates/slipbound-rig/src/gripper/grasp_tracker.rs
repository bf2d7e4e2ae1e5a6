//! Whether something may be between the jaws, whatever the gripper reports: after an acknowledged fast stop, for
//! example, it presses without reporting that it holds. A force reading alone is no evidence: motors read a current
//! with nothing between the jaws.

use super::config::{Config, Kind, MOST_BIAS_N};
use slipbound::port::{GripperState, Jaws};

/// Least motion of the jaws that counts, mm.
const MOVED_MM: f64 = 1.0;

/// Idle readings that are averaged; beyond that the oldest are forgotten.
const IDLE_COUNT: u32 = 50;

/// What is remembered of the jaws.
#[derive(Debug, Default)]
pub(super) struct GraspTracker {
    /// Whether they closed, held, stopped or pressed with the force they are set to, and have not opened since.
    is_grasped: bool,
    /// Whether they closed or held since then: a stop alone does not tell that anything is between them.
    has_closed: bool,
    /// The last opening of them that was told, mm: a soft object is as wide as the force leaves it.
    grasped_mm: Option<f64>,
    idle_n: f64,
    idle_count: u32,
}

impl GraspTracker {
    /// A new state.
    pub fn see(&mut self, state: &GripperState, config: &Config) {
        match state.jaws {
            Jaws::Closing | Jaws::Holding | Jaws::Stopped => self.see_grasp(state),
            Jaws::Nothing | Jaws::Lost => self.forget_grasp(),
            Jaws::Open if self.has_opened(state, config) => {
                self.forget_grasp();
                if let Some(force_n) = state.force_n {
                    self.idle_count = (self.idle_count + 1).min(IDLE_COUNT);
                    self.idle_n += (force_n - self.idle_n) / f64::from(self.idle_count);
                }
            }
            // Nothing else tells whether these have opened.
            Jaws::Open if tells_only_its_jaws(state, config) => self.forget_grasp(),
            // They press on what was grasped before the link was made: no idle reading is just as high.
            Jaws::Open if self.presses_as_set(state, config) => self.see_grasp(state),
            Jaws::Open | Jaws::Unknown => {}
        }
    }

    fn see_grasp(&mut self, state: &GripperState) {
        self.is_grasped = true;
        self.has_closed |= matches!(state.jaws, Jaws::Closing | Jaws::Holding);
        // Jaws that open may press as set for a moment more, by a reading that is late.
        if state.jaws != Jaws::Open || self.grasped_mm.is_none() {
            self.grasped_mm = state.opening_mm.or(self.grasped_mm);
        }
    }

    fn forget_grasp(&mut self) {
        (self.is_grasped, self.has_closed, self.grasped_mm) = (false, false, None);
    }

    /// Whether something is, or may soon be, between the jaws.
    pub fn seems_to_hold(&self, state: &GripperState, config: &Config) -> bool {
        let presses = self.load_n(state).is_none_or(|load_n| load_n > 0.5 * config.least_n);
        match state.jaws {
            Jaws::Closing | Jaws::Holding | Jaws::Stopped => true,
            Jaws::Nothing | Jaws::Lost => false,
            Jaws::Open | Jaws::Unknown if self.is_grasped => presses,
            Jaws::Open | Jaws::Unknown if state.force_n.is_none() || self.has_opened(state, config) => false,
            // Jaws that were never seen to open may hold what was grasped before the link was made. A load below that
            // of an idle reading counts only where nothing tells with which force they would press.
            Jaws::Open if state.target_n.is_some() => self.load_n(state).is_some_and(|load_n| load_n > MOST_BIAS_N),
            Jaws::Open | Jaws::Unknown => presses,
        }
    }

    /// The force reading without its idle reading, N per finger.
    fn load_n(&self, state: &GripperState) -> Option<f64> {
        state.force_n.map(|force_n| force_n - self.idle_n)
    }

    /// Whether the load is the force that the gripper is set to.
    fn presses_as_set(&self, state: &GripperState, config: &Config) -> bool {
        let pair_n = self.load_n(state).zip(state.target_n);
        pair_n.is_some_and(|(load_n, target_n)| config.is_reading_of(load_n, target_n))
    }

    /// Whether the jaws are open by their position: wider than they held, or as wide as a release leaves them and
    /// without load. Without a grasp that was seen the idle reading may be unknown.
    fn has_opened(&self, state: &GripperState, config: &Config) -> bool {
        let Some(opening_mm) = state.opening_mm else { return false };
        let is_wide = opening_mm >= config.open_mm - MOVED_MM
            && config.part_width_mm.is_none_or(|width_mm| width_mm < opening_mm - MOVED_MM);
        let most_idle_n = if self.has_closed { 0.5 * config.least_n } else { MOST_BIAS_N };
        let is_loaded = self.load_n(state).is_some_and(|load_n| load_n > most_idle_n);
        (is_wide && !is_loaded) || self.grasped_mm.is_some_and(|grasped_mm| opening_mm > grasped_mm + MOVED_MM)
    }
}

/// Whether the state of the jaws is all that is known. The text and binary interfaces of a WSG-50 may call jaws open
/// that press, after an acknowledgement.
fn tells_only_its_jaws(state: &GripperState, config: &Config) -> bool {
    matches!(config.kind, Kind::Robotiq | Kind::Line) && state.opening_mm.is_none() && state.force_n.is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(jaws: Jaws, opening_mm: f64, force_n: f64) -> GripperState {
        GripperState {
            time_ns: 0,
            force_n: Some(force_n),
            force_error_n: None,
            target_n: None,
            opening_mm: Some(opening_mm),
            jaws,
        }
    }

    fn set_to(target_n: f64, state: GripperState) -> GripperState {
        GripperState { target_n: Some(target_n), ..state }
    }

    #[test]
    fn what_open_jaws_read_is_taken_off_in_the_mean_however_it_scatters() {
        let config = Config::of(Kind::Wsg50);
        let mut grasp = GraspTracker::default();
        for reading in 0..200 {
            let force_n = if reading % 2 == 0 { 6.0 } else { 10.0 };
            grasp.see(&at(Jaws::Open, config.open_mm, force_n), &config);
        }
        assert!((grasp.idle_n - 8.0).abs() < 0.1, "{}", grasp.idle_n);
    }

    #[test]
    fn jaws_as_wide_as_after_a_release_hold_something_where_a_load_shows() {
        let config = Config::of(Kind::Wsg50);
        for (states, holds) in [
            (&[at(Jaws::Open, 104.0, 40.0)][..], true),
            (&[at(Jaws::Open, 104.0, 6.0)], false), // its idle reading, as far as is known
            (&[at(Jaws::Stopped, 104.0, 40.0), at(Jaws::Open, 104.0, 40.0)], true),
            (&[at(Jaws::Stopped, 110.0, 6.0), at(Jaws::Open, 110.0, 6.0)], false),
            (&[at(Jaws::Holding, 104.0, 8.0), at(Jaws::Stopped, 104.0, 8.0), at(Jaws::Open, 104.0, 8.0)], true),
            (&[at(Jaws::Holding, 104.0, 8.0), at(Jaws::Open, 109.0, 6.0)], false),
            // A soft object that gives way less after the force was lowered, then a fast stop and its acknowledgement.
            (&[at(Jaws::Holding, 30.0, 40.0), at(Jaws::Holding, 33.0, 20.0), at(Jaws::Open, 33.0, 20.0)], true),
            // It opens, and the force reading is late.
            (
                &[
                    set_to(20.0, at(Jaws::Holding, 50.0, 20.0)),
                    set_to(20.0, at(Jaws::Open, 50.9, 20.0)),
                    set_to(20.0, at(Jaws::Open, 51.8, 19.0)),
                    set_to(20.0, at(Jaws::Open, 52.7, 18.0)),
                ],
                false,
            ),
            (&[at(Jaws::Open, 100.0, 6.0), at(Jaws::Closing, 99.5, 6.0), at(Jaws::Open, 100.0, 6.0)], false),
            (&[set_to(30.0, at(Jaws::Open, 60.0, 4.0))], false), // opened by an earlier program
            (&[set_to(20.0, at(Jaws::Open, 50.0, 20.0))], true),
            (&[set_to(20.0, at(Jaws::Open, 50.0, 20.0)), set_to(20.0, at(Jaws::Open, 50.0, 15.0))], true), // it flickers
            (&[set_to(20.0, at(Jaws::Open, 50.0, 20.0)), set_to(20.0, at(Jaws::Open, 60.0, 4.0))], false), // it opens
            (&[set_to(30.0, at(Jaws::Open, 50.0, 12.0))], true), // more than any idle reading
            (&[set_to(30.0, at(Jaws::Unknown, 50.0, 8.0))], true),
            (&[at(Jaws::Open, 50.0, 8.0)], true),
        ] {
            let mut grasp = GraspTracker::default();
            states.iter().for_each(|state| grasp.see(state, &config));
            let newest = states.last().expect("one at least");
            assert_eq!(grasp.seems_to_hold(newest, &config), holds, "{states:?}");
        }
    }
}
