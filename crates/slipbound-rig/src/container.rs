//! MCAP files: frames as they came, with everything that was said of them.
//!
//! ```text
//!   camera --tap--> every frame that arrives      /left/camera  foxglove.CompressedImage or RawImage, protobuf
//!     | Newest                                    /left/frame   slipbound.Frame, JSON: number, time, judged or skipped
//!   monitor ------> report of every judged frame  /left/report  slipbound.Report, JSON (docs/report.schema.json)
//!   loop ---------> commands, gripper, wrist      /cycle        slipbound.Cycle, JSON
//!   settings, sensor files, camera facts          attachments and metadata
//! ```
//!
//! Everything is written by a thread of its own behind a bounded queue: what does not fit is lost and counted, and never
//! delays a frame or a cycle. A chunk is closed every half second, so that a program that is killed loses no more.
//! [`McapSource`] gives the frames that were judged, and those alone, so that a recording is judged again to the same bits.

mod cdr;
mod foxglove;
mod observer;
mod pictures;
mod reader;
mod recorder;
mod tap;
mod wire;

pub use observer::McapObserver;
pub use reader::McapSource;
pub use recorder::{Error, Inlet, Recorder, Written};
pub use tap::{MarkedSource, ReportLines, TappedSource};

use serde::{Deserialize, Serialize};
use slipbound::port::Clock;

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fate {
    /// It was taken: for the rest frame, or to be judged.
    Judged,
    /// A newer one came before it was taken.
    Skipped,
    /// It was recorded, and nobody judged.
    Recorded,
}

/// What is written of every frame beside its bytes: `slipbound.Frame`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// The source's running number.
    pub seq: u64,
    /// Its time, ns, by `clock`.
    pub time_ns: Option<u64>,
    /// Whose clock.
    pub clock: Clock,
    /// What became of it.
    pub fate: Fate,
    /// Why it is torn; None when it is whole.
    pub torn: Option<String>,
    /// Whether its bytes are in the file; false when the disk did not keep up.
    pub is_kept: bool,
}

/// The topic of a finger's pictures.
pub(crate) fn camera_topic(finger: &str) -> String {
    format!("/{finger}/camera")
}

/// The topic of a finger's [`FrameRecord`]s, from that of its pictures.
pub(crate) fn frame_topic(camera_topic: &str) -> Option<String> {
    camera_topic.strip_suffix("/camera").map(|finger| format!("{finger}/frame"))
}
