//! The record of every frame besides its bytes.

use serde::{Deserialize, Serialize};
use slipbound::port::Clock;

/// Whether a frame was judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fate {
    /// It was taken, for the rest frame or to be judged.
    Judged,
    /// A newer frame came before it was taken.
    Skipped,
    /// It was only recorded.
    Recorded,
}

/// The record of every frame besides its bytes: `slipbound.Frame`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// The source's running number.
    pub seq: u64,
    /// Its time, ns, by `clock`.
    pub time_ns: Option<u64>,
    /// Whose clock.
    pub clock: Clock,
    /// Whether it was judged.
    pub fate: Fate,
    /// Why it is torn; None when it is whole.
    pub torn: Option<String>,
    /// Whether its bytes are in the file; false when the disk did not keep up.
    pub is_kept: bool,
}

/// The topic of a finger's images.
pub(super) fn camera_topic(finger: &str) -> String {
    format!("/{finger}/camera")
}

/// The topic of the results on a finger's images.
pub(super) fn annotations_topic(finger: &str) -> String {
    format!("/{finger}/annotations")
}

/// The topic of a finger's [`FrameRecord`]s, from that of its images.
pub(super) fn frame_topic(camera_topic: &str) -> Option<String> {
    camera_topic.strip_suffix("/camera").map(|finger| format!("{finger}/frame"))
}
