//! The folder of a recorded run, and its replay.
//!
//! ```text
//!   run.toml             task, controller, source, seed, fingers, all settings, version
//!   left.sensor.toml     the facts of every finger, so that a replay needs nothing else
//!   reports.jsonl        a cycle a line: what was seen, what was commanded, what was true; exact, for replay
//!   events.jsonl         an event a line: phases, slips, steps of the grip, fingers lost and back, notes, results
//!   frames.jsonl, left/  every frame as it was received, or as PNG where that was pixels, if the run is recorded
//!   slip_003_left.png    what a finger saw when slip 3 began
//!   report.html          all of it to look at, in one file that needs no other
//! ```
//!
//! A line of `reports.jsonl`, shortened:
//!
//! ```json
//! {"time_ns":1200000000,"hand":{"seq":36,"state":"stick","live_count":2},"gripper":{"force_n":20.1,"jaws":"holding"},
//!  "wrist":{"angle_rad":0.11,"moving":true},"grip_command":{"jaws":"hold","force_n":20.0},
//!  "wrist_command":{"motion":{"motion":"turn","rate_rad_per_s":0.35,"most_rad":0.07},"time_to_live_ns":200000000},
//!  "phase":{"phase":"working"},"margin":null,"alarms_count":1,"slips_count":1,"truth":null}
//! ```
//!
//! Every line is flushed as soon as it is written, so that an interrupted loop leaves everything but its page.

mod error;
pub(crate) mod event;
mod folder;
pub(crate) mod frames;
mod info;
pub(crate) mod line;
mod notes;
mod page;
mod page_data;
mod recorder;
mod replay;
mod thinned;
mod words;

pub use error::Error;
pub use event::{Event, FingerVerdict, TimedEvent};
pub(crate) use folder::prepare_folder;
pub use folder::{RunFolder, free_folder, read, refuse_used_folder};
pub use frames::{FrameRecorder, RecordedSource};
pub use info::{FORMAT_VERSION, FingerInfo, Row, RunInfo};
pub use notes::{CameraLimits, RunNotes};
pub use page::recording::RecordingPage;
pub use recorder::RunRecorder;
pub(crate) use recorder::lost_text;
pub use replay::{Replay, ReplayError, Replayed};
pub use words::{duration, left_in_words};
