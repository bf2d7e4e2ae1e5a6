//! Whether a link is up and receives: the state that every driver keeps of its link.

use std::mem;

/// What is wrong with a link.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum LinkProblem {
    /// It is down.
    Down {
        /// Why.
        why: String,
    },
    /// It is up, but nothing has come through it for too long.
    Silent {
        /// Longest silence allowed, ms.
        expected_ms: u64,
        /// Silence so far, ms.
        got_ms: u64,
    },
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum State {
    /// There is no link and none is needed.
    NotNeeded,
    Down {
        why: String,
    },
    Up,
    /// Up again, but nothing has been received since: a relay between us and the device may accept a link and close it
    /// at once. Why the link before was lost.
    Unproven {
        why: String,
    },
    /// Up, and the farewell has been sent: nothing else may follow it.
    Leaving,
}

/// The state of one link.
#[derive(Debug)]
pub(crate) struct LinkHealth {
    state: State,
    /// Whether a valid message has ever been received.
    has_heard: bool,
    silence_ms: u64,
    /// Since when something is awaited: the last message, or the first question after it, ns.
    awaited_ns: u64,
    /// Whether a question was sent after the last message.
    has_asked: bool,
}

impl LinkHealth {
    /// A link not yet made, on which a silence of more than `silence_ms` is a fault.
    pub fn new(silence_ms: u64) -> Self {
        LinkHealth {
            state: State::Down { why: "not yet made".into() },
            has_heard: false,
            silence_ms,
            ..LinkHealth::not_needed()
        }
    }

    /// For a driver without a link: never down, never silent.
    pub fn not_needed() -> Self {
        LinkHealth { state: State::NotNeeded, has_heard: false, silence_ms: 0, awaited_ns: 0, has_asked: false }
    }

    /// The link is up.
    pub fn up(&mut self, now_ns: u64) {
        (self.awaited_ns, self.has_asked) = (now_ns, false);
        self.state = match mem::replace(&mut self.state, State::Up) {
            State::Down { why } if self.has_heard => State::Unproven { why },
            _ => State::Up,
        };
    }

    /// The link is down. Returns whether it was up before.
    pub fn down(&mut self, why: &str) -> bool {
        let was_up = self.is_up();
        self.state = State::Down { why: why.into() };
        was_up
    }

    /// The farewell has been sent.
    pub fn leave(&mut self) {
        if matches!(self.state, State::Up | State::Unproven { .. }) {
            self.state = State::Leaving;
        }
    }

    /// A valid message was received.
    pub fn heard(&mut self, now_ns: u64) {
        (self.has_heard, self.awaited_ns, self.has_asked) = (true, now_ns, false);
        if let State::Unproven { .. } = self.state {
            self.state = State::Up;
        }
    }

    /// A device that speaks only when it is asked was asked: until then it owed nothing.
    pub fn asked(&mut self, now_ns: u64) {
        if !mem::replace(&mut self.has_asked, true) {
            self.awaited_ns = now_ns;
        }
    }

    /// Whether a valid message has ever been received.
    pub fn has_heard(&self) -> bool {
        self.has_heard
    }

    /// Whether the link is up, also after the farewell.
    pub fn is_up(&self) -> bool {
        matches!(self.state, State::Up | State::Unproven { .. } | State::Leaving)
    }

    /// Whether commands may still be sent.
    pub fn may_send(&self) -> bool {
        matches!(self.state, State::Up | State::Unproven { .. } | State::NotNeeded)
    }

    /// What is wrong with what is known of the device: as [`LinkHealth::check`], but a link made anew counts as lost
    /// until something has been received.
    pub fn check_heard(&self, now_ns: u64) -> Result<(), LinkProblem> {
        self.check(now_ns)?;
        match &self.state {
            State::Unproven { why } => Err(LinkProblem::Down { why: why.clone() }),
            _ => Ok(()),
        }
    }

    /// What is wrong with it for a command at this time, if anything is.
    pub fn check(&self, now_ns: u64) -> Result<(), LinkProblem> {
        let silent_ns = now_ns.saturating_sub(self.awaited_ns);
        match &self.state {
            State::NotNeeded => Ok(()),
            State::Down { why } => Err(LinkProblem::Down { why: why.clone() }),
            State::Up | State::Unproven { .. } | State::Leaving if silent_ns > self.silence_ms * 1_000_000 => {
                Err(LinkProblem::Silent { expected_ms: self.silence_ms, got_ms: silent_ns / 1_000_000 })
            }
            State::Up | State::Unproven { .. } | State::Leaving => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn lost() -> Result<(), LinkProblem> {
        Err(LinkProblem::Down { why: "reset by peer".into() })
    }

    #[test]
    fn a_link_made_anew_stays_lost_until_something_is_received() {
        let mut link = LinkHealth::new(300);
        link.up(0);
        assert_eq!(link.check_heard(MS), Ok(()), "the first link counts at once");
        link.heard(2 * MS);
        assert!(link.down("reset by peer"));
        assert_eq!(link.check_heard(3 * MS), lost());
        for up_ms in [10, 20] {
            // A relay that accepts and closes again.
            link.up(up_ms * MS);
            assert!(
                link.may_send() && link.check((up_ms + 1) * MS).is_ok(),
                "commands are sent: a pause must not wait"
            );
            assert_eq!(link.check_heard((up_ms + 1) * MS), lost());
            assert!(link.down("reset by peer"));
        }
        link.up(30 * MS);
        assert_eq!(link.check_heard(331 * MS), Err(LinkProblem::Silent { expected_ms: 300, got_ms: 301 }));
        link.heard(332 * MS);
        assert_eq!(link.check_heard(333 * MS), Ok(()));
    }
}
