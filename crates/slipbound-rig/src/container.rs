//! MCAP files: frames as they came, with all reports on them.
//!
//! ```text
//!   camera --tap--> every frame that arrives      /left/camera  foxglove.CompressedImage or RawImage, protobuf
//!     | Newest                                    /left/frame   slipbound.Frame, JSON: number, time, judged or skipped
//!   monitor ------> report of every judged frame  /left/report  slipbound.Report, JSON (docs/report.schema.json)
//!                   lines over the picture        /left/annotations  foxglove.ImageAnnotations, protobuf
//!   loop ---------> commands, gripper, wrist      /cycle        slipbound.Cycle, JSON: a line of reports.jsonl
//!                   phases, slips, steps          /event        slipbound.Event, JSON: a line of events.jsonl
//!                   the frames of every cycle     /cycle/frames slipbound.CycleFrames, JSON: a line of frames.jsonl
//!   settings, sensor files, camera facts          attachments and metadata
//! ```
//!
//! Everything is written by a thread of its own behind a bounded queue: what does not fit is lost and counted, and never
//! delays a frame or a cycle. A chunk is closed every half second, so that a program that is killed loses no more.
//! [`McapSource`] gives the frames that were judged, and those alone, so that a recording is judged again to the same bits.

mod annotations;
mod book;
mod cdr;
mod convert;
mod db3;
mod foxglove;
mod frame_record;
mod late_file;
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
