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
    /// Up, and the farewell has been sent: nothing else may follow it.
    Leaving,
}

/// The state of one link.
#[derive(Debug)]
pub(crate) struct LinkHealth {
    state: State,
    silence_ms: u64,
    heard_ns: u64,
}

impl LinkHealth {
    /// A link not yet made, on which a silence of more than `silence_ms` is a fault.
    pub fn new(silence_ms: u64) -> Self {
        LinkHealth { state: State::Down { why: "not yet made".into() }, silence_ms, heard_ns: 0 }
    }

    /// For a driver without a link: never down, never silent.
    pub fn not_needed() -> Self {
        LinkHealth { state: State::NotNeeded, silence_ms: 0, heard_ns: 0 }
    }

    /// The link is up.
    pub fn up(&mut self, now_ns: u64) {
        (self.state, self.heard_ns) = (State::Up, now_ns);
    }

    /// The link is down. Returns whether it was up before.
    pub fn down(&mut self, why: &str) -> bool {
        matches!(mem::replace(&mut self.state, State::Down { why: why.into() }), State::Up | State::Leaving)
    }

    /// The farewell has been sent.
    pub fn leave(&mut self) {
        if self.state == State::Up {
            self.state = State::Leaving;
        }
    }

    /// A valid message was received.
    pub fn heard(&mut self, now_ns: u64) {
        self.heard_ns = now_ns;
    }

    /// Whether the link is up, also after the farewell.
    pub fn is_up(&self) -> bool {
        matches!(self.state, State::Up | State::Leaving)
    }

    /// Whether commands may still be sent.
    pub fn may_send(&self) -> bool {
        matches!(self.state, State::Up | State::NotNeeded)
    }

    /// What is wrong with it at this time, if anything is.
    pub fn check(&self, now_ns: u64) -> Result<(), LinkProblem> {
        let silent_ns = now_ns.saturating_sub(self.heard_ns);
        match &self.state {
            State::NotNeeded => Ok(()),
            State::Down { why } => Err(LinkProblem::Down { why: why.clone() }),
            State::Up | State::Leaving if silent_ns > self.silence_ms * 1_000_000 => {
                Err(LinkProblem::Silent { expected_ms: self.silence_ms, got_ms: silent_ns / 1_000_000 })
            }
            State::Up | State::Leaving => Ok(()),
        }
    }
}
