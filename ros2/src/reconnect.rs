//! Detects participants that were given up on the network and returned.
//!
//! RustDDS gives up a participant that is silent for its lease (50 s for RustDDS itself), as when a link is down. When
//! it returns, none of its readers and writers is matched again (RustDDS 0.15.1): the two discover each other and no
//! data passes. A participant that joins again is treated as a new one.

use crate::ros::Ros;
use rustdds::{DomainParticipantStatusEvent, DomainParticipantStatusListener, LostReason, StatusEvented as _};

/// Watches for returning participants.
pub struct ReconnectWatcher {
    listener: DomainParticipantStatusListener,
    lost: LostParticipants,
}

impl ReconnectWatcher {
    /// Watches as this node.
    pub fn new(ros: &Ros) -> Self {
        ReconnectWatcher {
            listener: ros.context().domain_participant().status_listener(),
            lost: LostParticipants::default(),
        }
    }

    /// Whether a participant has returned since the last call.
    pub fn participant_returned(&mut self) -> bool {
        let mut has_returned = false;
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

#[cfg(test)]
mod tests {
    use super::*;

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
