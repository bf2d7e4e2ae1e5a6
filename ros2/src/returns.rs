//! Detects participants that were given up on the network and returned.
//!
//! RustDDS gives up a participant that is silent for its lease (50 s for RustDDS itself), as when a link is down. When
//! it returns, none of its readers and writers is matched again (RustDDS 0.15.1): the two discover each other and no
//! data passes. A participant that joins again is treated as a new one.

use crate::ros::Ros;
use rustdds::{DomainParticipantStatusEvent, DomainParticipantStatusListener, LostReason, StatusEvented as _};

/// Watches for returning participants.
pub struct Returns {
    listener: DomainParticipantStatusListener,
    given_up: GivenUp,
}

impl Returns {
    /// Watches as this node.
    pub fn new(ros: &Ros) -> Self {
        Returns { listener: ros.context().domain_participant().status_listener(), given_up: GivenUp::default() }
    }

    /// Whether a participant has returned since the last call.
    pub fn seen(&mut self) -> bool {
        let mut seen = false;
        while let Some(event) = self.listener.try_recv_status() {
            match event {
                DomainParticipantStatusEvent::ParticipantLost { id, reason: LostReason::Timeout { .. } } => {
                    self.given_up.lost(id.as_ref());
                }
                DomainParticipantStatusEvent::ParticipantDiscovered { dpd } => {
                    seen |= self.given_up.discovered(dpd.guid.prefix.as_ref());
                }
                _ => {}
            }
        }
        seen
    }
}

/// Names of participants that were silent for too long.
#[derive(Debug, Default)]
struct GivenUp(Vec<Vec<u8>>);

impl GivenUp {
    fn lost(&mut self, who: &[u8]) {
        if !self.0.iter().any(|other| other == who) {
            self.0.push(who.to_vec());
        }
    }

    /// Whether it was given up before.
    fn discovered(&mut self, who: &[u8]) -> bool {
        let place = self.0.iter().position(|other| other == who);
        place.map(|place| self.0.swap_remove(place)).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_who_was_given_up_comes_back_and_once() {
        let mut given_up = GivenUp::default();
        assert!(!given_up.discovered(&[1]), "somebody new");
        given_up.lost(&[1]);
        given_up.lost(&[1]);
        given_up.lost(&[2]);
        assert!(!given_up.discovered(&[3]) && given_up.discovered(&[1]) && !given_up.discovered(&[1]));
        assert!(given_up.discovered(&[2]));
    }
}
