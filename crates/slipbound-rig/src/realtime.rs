//! The control loop in real time: the clock, threads and links around [`slipbound::control`], for any gripper and wrist.
//!
//! ```text
//!   sources on threads of their own ([`Newest`](crate::source::Newest)) --frames--.
//!   run: wait for frames, polling the links every ms --> ControlLoop::cycle ------+--> observer
//!        monitors of all but one finger on threads ([`MonitorWorkers`])           '--> [`QueuedObserver`]: a thread
//! ```

mod frames_due;
pub mod latency;
mod queue;
mod runner;
mod workers;

pub use frames_due::FramesDue;
pub use queue::{Finished, QueuedObserver};
pub use runner::{run, run_at_least_every};
pub use workers::MonitorWorkers;
