//! What a WSG-50 is asked at its text interface, in turn, and what it last answered.

use super::message::QUESTIONS;
use crate::gripper::driver_state::DriverState;
use crate::gripper::protocol::MISSES_COUNT;

/// The questions since the link was made.
#[derive(Debug, Default)]
pub(super) struct Questions {
    /// Which of [`QUESTIONS`] comes next, and when the first was last asked.
    next: usize,
    asked_ns: Option<u64>,
    /// How often in a row each of them was not answered.
    misses_count: [u32; QUESTIONS.len()],
    /// What the gripper does with a part, one of [`grasp`](crate::gripper::wsg50::words::grasp).
    pub grasp: Option<u8>,
    /// When it last told that, or the link was made, ns.
    grasp_ns: u64,
    /// Whether that was before it was stopped.
    pub is_grasp_old: bool,
}

/// The place of one of [`QUESTIONS`].
fn place(name: &str) -> usize {
    QUESTIONS.iter().position(|known| *known == name).expect("one of them")
}

impl Questions {
    /// On a link made at this time.
    pub fn new(now_ns: u64) -> Self {
        Questions { grasp_ns: now_ns, ..Questions::default() }
    }

    /// The questions one after the other, once per period; None until the next is due.
    pub fn next_due(&mut self, driver: &DriverState) -> Option<&'static str> {
        let now_ns = driver.now_ns();
        if self.next == 0 {
            let period_ns = driver.config.update_ms * 1_000_000;
            if self.asked_ns.is_some_and(|asked_ns| now_ns.saturating_sub(asked_ns) < period_ns) {
                return None;
            }
            self.asked_ns = Some(now_ns);
        }
        let name = QUESTIONS[self.next];
        self.next = (self.next + 1) % QUESTIONS.len();
        Some(name)
    }

    /// The state of the jaws is asked next, out of turn.
    pub fn put_grasp_first(&mut self) {
        self.next = place("GRIPSTATE");
    }

    /// The value of a question; None: one that the gripper cannot tell.
    pub fn take(&mut self, driver: &mut DriverState, name: &str, number: Option<f64>) {
        if number.is_some() {
            driver.gripper.time_ns = driver.now_ns();
            self.misses_count[place(name)] = 0;
        }
        match name {
            "POS" => driver.gripper.opening_mm = number.filter(|mm| (-10.0..=1000.0).contains(mm)),
            "FORCE" => driver.gripper.force_n = number.and_then(|own_n| driver.config.from_own_n(own_n)),
            _ => {
                self.grasp = number.filter(|state| (0.0..=7.0).contains(state)).map(|state| state as u8);
                self.is_grasp_old = false;
                if number.is_some() {
                    self.grasp_ns = driver.now_ns();
                }
            }
        }
    }

    /// A question was not answered. One answer may be lost; after that the value is not known.
    pub fn miss(&mut self, driver: &mut DriverState, name: &str) {
        let misses_count = &mut self.misses_count[place(name)];
        *misses_count += 1;
        match name {
            _ if *misses_count < MISSES_COUNT => {}
            "POS" => driver.gripper.opening_mm = None,
            "FORCE" => driver.gripper.force_n = None,
            _ => self.is_grasp_old = false,
        }
    }

    /// Since when the state of the jaws has not been told although it was asked for, ns; None while it is.
    pub fn grasp_untold_since_ns(&self) -> Option<u64> {
        (self.misses_count[place("GRIPSTATE")] >= MISSES_COUNT).then_some(self.grasp_ns)
    }
}
