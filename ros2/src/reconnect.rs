//! Detects when the network must be joined again: a participant that was given up has returned, or the clock was set back.
//!
//! RustDDS gives up a participant that is silent for its lease (50 s for RustDDS itself), as when a link is down. When
//! it returns, none of its readers and writers is matched again (RustDDS 0.15.1): the two discover each other and no
//! data passes. A participant that joins again is treated as a new one.
//!
//! RustDDS numbers what its readers receive by the wall clock: when that is set back, a best-effort reader gives nothing
//! until the clock is again where it was. A reader that is made anew begins with the new time.

use crate::ros::{Ros, unix_ns};
use rustdds::{DomainParticipantStatusEvent, DomainParticipantStatusListener, LostReason, StatusEvented as _};
use slipbound_rig::link::now_ns;

/// A clock that is set back by more silences the readers for longer than a camera may be silent, ns.
const SET_BACK_NS: i128 = 100_000_000;

/// Watches for returning participants and for the clock.
pub struct ReconnectWatcher {
    listener: DomainParticipantStatusListener,
    lost: LostParticipants,
    clock: WallClock,
}

impl ReconnectWatcher {
    /// Watches as this node.
    pub fn new(ros: &Ros) -> Self {
        ReconnectWatcher {
            listener: ros.context().domain_participant().status_listener(),
            lost: LostParticipants::default(),
            clock: WallClock::default(),
        }
    }

    /// Whether a participant has returned, or the clock was set back, since the last call.
    pub fn must_rejoin(&mut self) -> bool {
        let (before_ns, unix_ns) = (now_ns(), unix_ns());
        let mut has_returned = self.clock.was_set_back(before_ns, unix_ns, now_ns());
        while let Some(event) = self.listener.try_recv_status() {
            match event {
                DomainParticipantStatusEvent::ParticipantLost { id, reason: LostReason::Timeout { .. } } => {
                    self.lost.insert(id.as_ref());
                }
                DomainParticipantStatusEvent::ParticipantDiscovered { dpd } => {
                    has_returned |= self.lost.remove(dpd.guid.prefix.as_ref());
                }
                _ => {}
            }
        }
        has_returned
    }
}

/// Names of participants that were silent for too long.
#[derive(Debug, Default)]
struct LostParticipants(Vec<Vec<u8>>);

impl LostParticipants {
    fn insert(&mut self, who: &[u8]) {
        if !self.0.iter().any(|other| other == who) {
            self.0.push(who.to_vec());
        }
    }

    /// Whether it was given up before.
    fn remove(&mut self, who: &[u8]) -> bool {
        let place = self.0.iter().position(|other| other == who);
        place.map(|place| self.0.swap_remove(place)).is_some()
    }
}

/// The wall clock beside one that nobody sets.
#[derive(Debug, Default)]
struct WallClock {
    ahead_ns: Option<i128>,
}

impl WallClock {
    /// Whether it was set back since the last call, by its time and that of the other clock before and after it was read.
    fn was_set_back(&mut self, before_ns: u64, unix_ns: u64, after_ns: u64) -> bool {
        if i128::from(after_ns.saturating_sub(before_ns)) > SET_BACK_NS / 2 {
            return false; // a busy computer: the two were not read at the same time
        }
        let ahead_ns = i128::from(unix_ns) - i128::from(before_ns);
        self.ahead_ns.replace(ahead_ns).is_some_and(|last_ns| last_ns - ahead_ns > SET_BACK_NS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_is_set_back_is_noticed_once_and_one_that_is_set_forward_or_read_late_is_not() {
        const MS: u64 = 1_000_000;
        let mut clock = WallClock::default();
        let mut was_set_back =
            |since_ms: u64, unix_ms: u64| clock.was_set_back(since_ms * MS, unix_ms * MS, since_ms * MS);
        assert!(!was_set_back(10, 1_000_010), "the first time");
        assert!(!was_set_back(20, 1_000_020) && !was_set_back(30, 999_950), "80 ms");
        assert!(!was_set_back(40, 2_000_000), "forward");
        assert!(was_set_back(50, 1_999_900) && !was_set_back(60, 1_999_910), "110 ms");
        assert!(was_set_back(70, 0) && !was_set_back(80, 10), "to 1970");
        assert!(!clock.was_set_back(90 * MS, 200 * MS, 200 * MS), "read while others ran");
        assert!(!clock.was_set_back(210 * MS, 140 * MS, 210 * MS));
    }

    #[test]
    fn only_who_was_given_up_comes_back_and_once() {
        let mut lost = LostParticipants::default();
        assert!(!lost.remove(&[1]), "somebody new");
        lost.insert(&[1]);
        lost.insert(&[1]);
        lost.insert(&[2]);
        assert!(!lost.remove(&[3]) && lost.remove(&[1]) && !lost.remove(&[1]));
        assert!(lost.remove(&[2]));
    }
}
