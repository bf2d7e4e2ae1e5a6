//! A tare that is going on: asked of every finger, answered when all have.

use crate::msg::TriggerResponse;
use ros2_client::service::RmwRequestId;

/// Longest wait for the fingers, ns: pictures for a rest frame at 5 Hz.
pub const LONGEST_NS: u64 = 4_000_000_000;

/// A tare that is going on.
#[derive(Debug)]
pub struct Tare {
    id: RmwRequestId,
    fingers: Vec<(String, Option<Result<(), String>>)>,
    since_ns: u64,
}

impl Tare {
    /// A request for these fingers.
    pub fn new(id: RmwRequestId, fingers: Vec<String>, now_ns: u64) -> Self {
        Tare { id, fingers: fingers.into_iter().map(|name| (name, None)).collect(), since_ns: now_ns }
    }

    /// A finger has been tared, or not.
    pub fn ended(&mut self, finger: usize, how: Result<(), String>) {
        if let Some((_, ended)) = self.fingers.get_mut(finger) {
            *ended = Some(how);
        }
    }

    /// The answer, when every finger has been tared or not, or has been waited for long enough.
    pub fn answer(&self, now_ns: u64) -> Option<(RmwRequestId, TriggerResponse)> {
        let is_late = now_ns.saturating_sub(self.since_ns) >= LONGEST_NS;
        if !is_late && self.fingers.iter().any(|(_, ended)| ended.is_none()) {
            return None;
        }
        let words = self.fingers.iter().map(|(name, ended)| match ended {
            Some(Ok(())) => format!("{name}: tared"),
            Some(Err(why)) => format!("{name}: {why}"),
            None => format!(
                "{name}: expected pictures for a rest frame within {} s, got too few",
                LONGEST_NS / 1_000_000_000
            ),
        });
        let message = words.collect::<Vec<_>>().join("; ");
        let success = self.fingers.iter().all(|(_, ended)| matches!(ended, Some(Ok(()))));
        Some((self.id, TriggerResponse { success, message }))
    }
}
