//! A contact that was loaded when last judged and can be judged no longer may be slipping: the grip rises slowly, within
//! bounds.
//!
//! ```text
//!   force   1.5 n |            ______________     n: the force at which it began
//!                 |        __/                    slope: `unsure_n_per_s`
//!               n |_______/
//!                 +---------------------------> time
//!                   stick |  unsure
//! ```

use crate::hand::{HandReport, Health};
use crate::monitor::SlipState;

/// A contact whose last known margin was smaller than this is loaded.
const LOADED_MARGIN: f64 = 0.8;

/// The rise while the hand is `unsure`.
#[derive(Debug, Clone, Copy)]
pub(super) struct UnsureRise {
    n_per_s: f64,
    most_fraction: f64,
    /// The margin when the contact was last judged.
    last_margin: Option<f64>,
    /// The force at which it began, N.
    from_n: Option<f64>,
}

impl UnsureRise {
    /// Of a rate, N per finger and second, and of at most this fraction of the force at which it begins.
    pub fn new(n_per_s: f64, most_fraction: f64) -> Self {
        UnsureRise { n_per_s, most_fraction, last_margin: None, from_n: None }
    }

    /// The contact was judged.
    pub fn judged(&mut self, margin: f64) {
        self.last_margin = Some(margin);
    }

    /// The next rise begins at the force of then.
    pub fn begin_anew(&mut self) {
        self.from_n = None;
    }

    /// Forgets the load of a contact that is lost: the next one is another. A finger that is not live may still feel it.
    /// The bound stays. Returns whether it is lost.
    pub fn see(&mut self, hand: &HandReport) -> bool {
        let all_live = hand.health.iter().all(|health| matches!(health, Health::Live | Health::Absent));
        let is_lost = hand.state == SlipState::NoContact && all_live;
        if is_lost {
            self.last_margin = None;
        }
        is_lost
    }

    /// The force after this time in which the hand was `unsure`, N per finger: at most `limit_n`, never lower than
    /// `force_n`, and the same where the contact was not loaded.
    pub fn raised_n(&mut self, force_n: f64, limit_n: f64, elapsed_s: f64) -> f64 {
        if self.last_margin.is_none_or(|margin| margin >= LOADED_MARGIN) {
            return force_n;
        }
        let from_n = *self.from_n.get_or_insert(force_n);
        let most_n = (from_n * (1.0 + self.most_fraction)).min(limit_n);
        (force_n + self.n_per_s * elapsed_s).min(most_n).max(force_n)
    }
}
