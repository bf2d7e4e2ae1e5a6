//! Whether a wrist that comes back still counts from where it did: where not, no distance from before is known.

use super::error::Error;
use slipbound::port::{LONGEST_TIME_TO_LIVE_NS, WristMotion, WristState};
use std::collections::VecDeque;

/// Longest time without a position, ms.
pub(super) const SILENCE_MS: u64 = 300;

/// How long a motion can go on after the last report of a link that is lost, ns: until the silence is noticed, and until
/// the motion expires.
const UNSEEN_NS: u64 = SILENCE_MS * 1_000_000 + LONGEST_TIME_TO_LIVE_NS;

/// How far a wrist at rest may be from where its motion ended.
const SLACK_RAD: f64 = 0.05;
const SLACK_MM: f64 = 1.0;

/// Compares the first position after an interruption with the last one before it.
#[derive(Debug, Default)]
pub struct ZeroCheck {
    /// The last position before the interruption, until one continues it.
    before: Option<WristState>,
    /// When the motions were sent that had not expired by the last report, ns, and how far each can go unreported when the
    /// link is lost: angle in rad and lowering in mm. A slower one may not arrive, and the faster one before it go on.
    sent: VecDeque<(u64, [f64; 2])>,
}

impl ZeroCheck {
    /// A motion is sent.
    pub fn commanded(&mut self, now_ns: u64, motion: WristMotion) {
        let rates_per_s = match motion {
            WristMotion::Turn { rate_rad_per_s, .. } => [rate_rad_per_s, 0.0],
            WristMotion::Lower { rate_mm_per_s, .. } => [0.0, rate_mm_per_s],
            WristMotion::Pause => return, // it may not arrive
        };
        self.sent.push_back((now_ns, rates_per_s.map(|rate_per_s| rate_per_s.abs() * UNSEEN_NS as f64 * 1e-9)));
    }

    /// A position is reported. A motion sent long before has expired, unless the position is yet to be compared.
    pub fn reported(&mut self, now_ns: u64) {
        while !self.is_open() && self.sent.front().is_some_and(|(sent_ns, _)| sent_ns + UNSEEN_NS < now_ns) {
            self.sent.pop_front();
        }
    }

    /// The positions were interrupted after this one, if there was any.
    pub fn interrupted(&mut self, last: Option<WristState>) {
        self.before = self.before.or(last);
    }

    /// Whether a position from before an interruption has not been continued yet.
    pub fn is_open(&self) -> bool {
        self.before.is_some()
    }

    /// Fails for a position after an interruption that the last motion cannot have reached. One that continues the last
    /// one ends the comparison. `address` is for the message.
    pub fn check(&mut self, address: &str, now: &WristState) -> Result<(), Error> {
        let Some(before) = self.before else { return Ok(()) };
        let most = |axis: usize| self.sent.iter().map(|(_, most)| most[axis]).fold(0.0, f64::max);
        let pairs = [
            ("angle_rad", before.angle_rad, now.angle_rad, most(0) + SLACK_RAD),
            ("lowered_mm", before.lowered_mm, now.lowered_mm, most(1) + SLACK_MM),
        ];
        for (key, expected, got, most) in pairs {
            if (got - expected).abs() > most {
                return Err(Error::OtherZero { address: address.into(), key, expected, most, got });
            }
        }
        self.before = None;
        Ok(())
    }
}
