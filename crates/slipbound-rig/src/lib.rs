//! Files, cameras and grippers for `slipbound`: everything that needs an operating system or a codec.
//!
//! | what | where |
//! |---|---|
//! | recordings and cameras as frames: image folders, videos, MCAP, V4L2, MJPEG over HTTP | [`source`] |
//! | cameras, serial lines and supported grippers of this computer | [`devices`] |
//! | built-in sensors, and files for others | [`sensors`] |
//! | a calibration as a sensor file and an image | [`calibration`] |
//! | settings files and their error messages | [`config`] |
//! | which fingers a hand has and how they are mounted | [`config::hand`] |
//! | a saved rest frame | [`rest_file`] |
//! | reports as JSON lines | [`report_json`] |
//! | what is told of a frame that was not measured | [`unmeasured`] |
//! | reports as a table, slips as lines, summaries as text | [`report_csv`], [`report_slips`], [`report_summary`] |
//! | how long each step takes | [`timings`] |
//! | overlay images of the results | [`overlay`] |
//! | Motion-JPEG AVI files | [`avi_writer`] |
//! | files of complete lines; whether a file is ours to replace | [`line_file`], [`file_origin`] |
//! | the control loop in real time | [`realtime`] |
//! | recordings in one file: frames as they came, reports, settings | `container` |
//! | run folder and page of a closed loop, and its replay | [`run`] |
//! | a page of tables, charts and images | [`html_page`] |
//! | text from elsewhere, for a terminal | [`printable`] |
//! | grippers by their own protocols | [`gripper`] |
//! | the arm behind the hand | [`wrist`] |
//! | emulators of the same grippers, for tests without hardware | [`emulator`] |
//! | sockets, serial lines, and the clock of everything that runs in real time | [`link`] |
//!
//! ```no_run
//! use slipbound::monitor::{RestBuilder, Settings, SlipMonitor};
//! use slipbound::port::{FrameBuffer, Next};
//! use slipbound_rig::{sensors, source};
//!
//! let (sensor, settings) = (sensors::load("gelslim")?, Settings::default());
//! let mut source = source::open("recording.avi")?;
//! let mut buffer = FrameBuffer::default();
//!
//! source.next(&mut buffer)?; // the first frame, untouched, is the rest frame
//! let mut builder = RestBuilder::new(&sensor, &settings, buffer.size)?;
//! let kind = slipbound::monitor::RestKind::Unloaded;
//! builder.add(&buffer.frame()?)?;
//! let mut monitor = SlipMonitor::new(&sensor, &settings, builder.build(kind)?)?;
//!
//! while source.next(&mut buffer)? == Next::Frame {
//!     println!("{:?}", monitor.step(&buffer.frame()?, None).state);
//! }
//! # Ok::<(), Box<dyn std::error::Error + Send + Sync>>(())
//! ```

pub mod avi_writer;
pub mod calibration;
pub mod config;
#[cfg(feature = "mcap")]
pub mod container;
pub mod devices;
pub mod emulator;
pub mod file_origin;
pub mod gripper;
pub mod html_page;
pub mod line_file;
pub mod link;
pub mod overlay;
pub mod printable;
pub mod realtime;
mod replaced_file;
pub mod report_csv;
pub mod report_json;
pub mod report_slips;
pub mod report_summary;
pub mod rest_file;
pub mod run;
pub mod source;
pub mod timings;
pub mod unmeasured;
pub mod wrist;

pub use config::sensors;
