//! Whether a wrist that comes back still counts from where it did: where not, no distance from before is known.

use super::error::Error;
use slipbound::port::{LONGEST_TIME_TO_LIVE_NS, WristMotion, WristState};

/// Longest time without a position, ms.
pub(super) const SILENCE_MS: u64 = 300;

/// How long a motion can go on after the last report of a link that is lost, s: until the silence is noticed, and until
/// the motion expires.
const UNSEEN_S: f64 = (SILENCE_MS as f64 * 1e6 + LONGEST_TIME_TO_LIVE_NS as f64) * 1e-9;

/// How far a wrist at rest may be from where its motion ended.
const SLACK_RAD: f64 = 0.05;
const SLACK_MM: f64 = 1.0;

/// A slower motion may not arrive, and the faster one before it go on.
fn widen(most: &mut f64, rate_per_s: f64) {
    *most = most.max(rate_per_s.abs() * UNSEEN_S);
}

/// Compares the first position after an interruption with the last one before it.
#[derive(Debug, Default)]
pub struct ZeroCheck {
    /// The last position before the interruption, until one continues it.
    before: Option<WristState>,
    /// How far the fastest motions so far can go unreported when the link is lost: angle in rad and lowering in mm.
    most: [f64; 2],
}

impl ZeroCheck {
    /// A motion is sent.
    pub fn commanded(&mut self, motion: WristMotion) {
        match motion {
            WristMotion::Turn { rate_rad_per_s, .. } => widen(&mut self.most[0], rate_rad_per_s),
            WristMotion::Lower { rate_mm_per_s, .. } => widen(&mut self.most[1], rate_mm_per_s),
            WristMotion::Pause => {} // it may not arrive
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
        let pairs = [
            ("angle_rad", before.angle_rad, now.angle_rad, self.most[0] + SLACK_RAD),
            ("lowered_mm", before.lowered_mm, now.lowered_mm, self.most[1] + SLACK_MM),
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
