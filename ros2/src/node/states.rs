//! Actions of the node when its state changes, on request or by itself.

use super::{LOOK, SlipNode, hand};
use crate::finger_thread::FingerRequest;
use crate::lifecycle::{State, Transition};
use crate::tare::LONGEST_NS;
use slipbound_rig::link::now_ns;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// For how long a node that is shut down stays on the network, so that its last messages arrive.
const LEAVE: Duration = Duration::from_millis(500);

impl SlipNode {
    /// Answers requests for the state, and executes requested transitions.
    pub(super) fn serve_states(&mut self) {
        self.network.managed.answer(&self.lifecycle);
        while let Some((id, requested)) = self.network.managed.request() {
            match self.lifecycle.request(requested.id, &requested.label) {
                Some(begun) => {
                    (self.transition_request, self.starts_itself) = (Some((id, now_ns())), false);
                    self.begin(begun);
                }
                None => self.network.managed.done(id, false),
            }
        }
        self.settle();
    }

    /// Whether reports are published.
    pub(super) fn publishes(&self) -> bool {
        self.lifecycle.state() == State::Active
    }

    pub(super) fn publish_state(&self) {
        self.network.managed.publish_state(self.lifecycle.state());
    }

    /// Proceeds, and publishes it, once the rest frames are known or the wait is over.
    pub(super) fn settle(&mut self) {
        let has_rest = self.fingers.iter().all(|finger| finger.has_rest);
        let is_late =
            self.transition_request.is_some_and(|(_, since_ns)| now_ns().saturating_sub(since_ns) >= LONGEST_NS);
        // A node that starts itself proceeds without a missing camera: the hand is blind for that finger.
        let waited = self.rest_since_ns.is_some_and(|since_ns| now_ns().saturating_sub(since_ns) >= LONGEST_NS);
        match self.lifecycle.state() {
            State::Unconfigured if self.starts_itself && (has_rest || waited) => {
                for label in ["configure", "activate"] {
                    if let Some(begun) = self.lifecycle.request(0, label) {
                        self.network.managed.publish_transition(begun);
                        self.end(true);
                    }
                }
                self.starts_itself = false;
                self.publish_state();
            }
            State::Configuring if has_rest => self.finish(true),
            State::Configuring if is_late => self.finish(false),
            _ => {}
        }
    }

    fn begin(&mut self, begun: Transition) {
        self.network.managed.publish_transition(begun);
        if begun.goal == State::Configuring {
            self.shared.publishes.store(self.publishes(), Ordering::Relaxed);
            self.send_to_fingers(FingerRequest::Look);
            self.publish_state();
        } else {
            self.finish(true);
        }
    }

    /// Ends the transition in progress, publishes the result, and answers.
    fn finish(&mut self, is_well: bool) {
        self.end(is_well);
        self.publish_state();
        if let Some((id, _)) = self.transition_request.take() {
            self.network.managed.done(id, is_well);
        }
    }

    fn end(&mut self, is_well: bool) {
        let Some(ended) = self.lifecycle.end(is_well) else { return };
        self.shared.publishes.store(self.publishes(), Ordering::Relaxed);
        if ended.goal == State::Unconfigured {
            self.forget();
        }
        self.network.managed.publish_transition(ended);
    }

    /// Forgets the rest frames and everything based on them; a tare in progress ends.
    fn forget(&mut self) {
        self.forgotten_count += 1;
        self.send_to_fingers(FingerRequest::Forget);
        for (place, finger) in self.fingers.iter_mut().enumerate() {
            finger.has_rest = false;
            if let Some(tare) = &mut self.tare {
                tare.ended(place, Err("its rest frame was forgotten meanwhile".into()));
            }
        }
        if let Ok(hand) = hand(&self.config) {
            self.hand = hand; // the same configuration was valid at the start
        }
        self.is_fresh.fill(false);
        self.fresh_since_ns = None;
    }

    fn send_to_fingers(&self, request: FingerRequest) {
        for finger in &self.fingers {
            let _ = finger.requests.send(request); // a panicked thread does not answer: `settle` stops waiting
        }
    }

    /// Stays on the network for a moment to answer; the fingers no longer judge.
    pub(super) fn take_leave(&mut self, stop: &AtomicBool) {
        self.shared.stop.store(true, Ordering::Relaxed);
        let until = Instant::now() + LEAVE;
        while Instant::now() < until && !stop.load(Ordering::Relaxed) {
            self.serve_states();
            sleep(LOOK);
        }
    }
}
