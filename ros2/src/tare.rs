//! A tare in progress: requested of every finger, answered when all have finished.

use crate::msg::TriggerResponse;
use ros2_client::service::RmwRequestId;

/// Longest wait for the fingers, ns: enough images for a rest frame at 5 Hz.
pub const LONGEST_NS: u64 = 4_000_000_000;

/// Longest wait for a finger that was asked to stop, ns: one whose thread has panicked does not answer.
const STOP_NS: u64 = 1_000_000_000;

/// Why a tare was stopped.
pub fn too_few() -> String {
    format!("expected pictures for a rest frame within {} s, got too few", LONGEST_NS / 1_000_000_000)
}

/// A tare in progress.
#[derive(Debug)]
pub struct Tare {
    id: RmwRequestId,
    fingers: Vec<(String, Option<Result<(), String>>)>,
    since_ns: u64,
    is_stopped: bool,
}

impl Tare {
    /// A request for these fingers.
    pub fn new(id: RmwRequestId, fingers: Vec<String>, now_ns: u64) -> Self {
        Tare {
            id,
            fingers: fingers.into_iter().map(|name| (name, None)).collect(),
            since_ns: now_ns,
            is_stopped: false,
        }
    }

    /// The tare of a finger has succeeded or failed.
    pub fn ended(&mut self, finger: usize, how: Result<(), String>) {
        if let Some((_, ended)) = self.fingers.get_mut(finger) {
            *ended = Some(how);
        }
    }

    /// The fingers to stop, once the wait is over: a tare that is answered as failed must not take effect later.
    pub fn stop(&mut self, now_ns: u64) -> Vec<usize> {
        if self.is_stopped || now_ns.saturating_sub(self.since_ns) < LONGEST_NS {
            return Vec::new();
        }
        self.is_stopped = true;
        let open = self.fingers.iter().enumerate().filter(|(_, (_, ended))| ended.is_none());
        open.map(|(finger, _)| finger).collect()
    }

    /// The answer, when every finger has succeeded or failed, or has not confirmed that it stopped.
    pub fn answer(&self, now_ns: u64) -> Option<(RmwRequestId, TriggerResponse)> {
        let is_late = now_ns.saturating_sub(self.since_ns) >= LONGEST_NS + STOP_NS;
        if !is_late && self.fingers.iter().any(|(_, ended)| ended.is_none()) {
            return None;
        }
        let words = self.fingers.iter().map(|(name, ended)| match ended {
            Some(Ok(())) => format!("{name}: tared"),
            Some(Err(why)) => format!("{name}: {why}"),
            None => format!("{name}: {}", too_few()),
        });
        let message = words.collect::<Vec<_>>().join("; ");
        let success = self.fingers.iter().all(|(_, ended)| matches!(ended, Some(Ok(()))));
        Some((self.id, TriggerResponse { success, message }))
    }
}
