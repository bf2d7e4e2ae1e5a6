//! A motion that the gripper has acknowledged, until it says that it has ended.

use crate::gripper::wsg50::words::grasp;

/// A motion in progress.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    pub name: &'static str,
    pub since_ns: u64,
    /// The state of the jaws, one of [`grasp`], before it and then while it runs.
    state: Option<u8>,
    /// Since when the state has been another one, ns.
    ended_ns: Option<u64>,
}

impl Motion {
    /// One that begins in this state of the jaws.
    pub fn new(name: &'static str, now_ns: u64, state: Option<u8>) -> Self {
        Motion { name, since_ns: now_ns, state, ended_ns: None }
    }

    /// A new state of the jaws. Returns whether the motion has ended although nothing said so: its end may have been
    /// lost or garbled. `wait_ns` is how late that may come, or a motion may begin.
    pub fn has_ended(&mut self, state: Option<u8>, now_ns: u64, wait_ns: u64) -> bool {
        let (running, done) = match self.name {
            "GRIP" => (grasp::GRASPING, grasp::HOLDING),
            "RELEASE" => (grasp::RELEASING, grasp::IDLE),
            "MOVE" => (grasp::POSITIONING, grasp::IDLE),
            _ => return false, // homing has no state of its own
        };
        if state == Some(running) {
            self.state = state;
        }
        // A short one, or a grip of what is held, may begin and end in the same state between two questions.
        if state.is_none() || (state == self.state && state != Some(done)) {
            self.ended_ns = None;
            return false;
        }
        now_ns.saturating_sub(*self.ended_ns.get_or_insert(now_ns)) >= wait_ns
    }
}
