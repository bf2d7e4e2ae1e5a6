//! MCAP files: frames as they came, with all reports on them.
//!
//! ```text
//!   camera --tap--> every frame that arrives      /left/camera  foxglove.CompressedImage or RawImage, protobuf
//!     | Newest                                    /left/frame   slipbound.Frame, JSON: number, time, judged or skipped
//!   monitor ------> report of every judged frame  /left/report  slipbound.Report, JSON (docs/report.schema.json)
//!                   lines over the image          /left/annotations  foxglove.ImageAnnotations, protobuf
//!   loop ---------> commands, gripper, wrist      /cycle        slipbound.Cycle, JSON: a line of reports.jsonl
//!                   phases, slips, steps          /event        slipbound.Event, JSON: a line of events.jsonl
//!                   the frames of every cycle     /cycle/frames slipbound.CycleFrames, JSON: a line of frames.jsonl
//!   settings, sensor files, camera facts          attachments and metadata
//! ```
//!
//! A separate thread writes everything from a bounded queue. What does not fit is lost and counted; a frame or a cycle
//! is never delayed. A chunk is closed every half second, so a killed program loses no more than that. [`McapSource`]
//! returns only the frames that were judged, so judging a recording again gives the same bits.

mod annotations;
mod cdr;
mod convert;
mod db3;
mod deferred_truncation;
mod foxglove;
mod frame_record;
mod mcap_writer;
mod observer;
mod pictures;
mod reader;
mod recorder;
mod records;
mod sqlite;
mod tap;
mod unpack;
mod wire;

pub use annotations::ARROW_POINTS_COUNT;
pub use convert::{ConvertError, Converted, to_folder, to_mcap};
pub use db3::Db3Source;
pub use frame_record::{Fate, FrameRecord};
pub use observer::{McapAnnotations, McapObserver};
pub use reader::{McapSource, attached_sensor};
pub use recorder::{Error, Inlet, Recorder, Written};
pub use tap::{MarkedSource, ReportLines, TappedSource};
