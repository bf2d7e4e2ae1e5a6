//! Incipient slip from a camera inside a soft fingertip: the method of "Maintaining Grasps within Slipping Bound by
//! Monitoring Incipient Slip" (Dong, Ma, Donlon, Rodriguez, ICRA 2019), frame in, verdict out.
//!
//! A camera inside the fingertip watches markers on a soft gel. While an object is held, the gel in the contact region
//! moves with it as one rigid body. When the load grows, the rim of the contact slips first: its markers lag behind the
//! rigid motion of the middle. That difference, the slip field, can be seen before the object slides.
//!
//! ```text
//!   frame -> 0 imprint -> 1 contact region -> 2 marker displacement -> 3 rigid motion -> 4 slip field
//!            imprint.rs   contact.rs          markers.rs               motion.rs         slip.rs
//!
//!         -> 5 evidence of sliding -> 6 estimates -> 7 verdict        each under monitor/
//!            evidence.rs              estimate.rs    verdict.rs
//! ```
//!
//! # A program
//!
//! ```
//! use slipbound::image::{Frame, Gray, Pixels, SizePx};
//! use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor, SlipState};
//! use slipbound::sensor::{Flip, Polarity, Sensor, Skin};
//!
//! // The facts of a finger; `slipbound-rig` reads them from a file.
//! let size = SizePx::new(160, 120);
//! let sensor = Sensor {
//!     name: "mine".into(),
//!     description: "a grid of 6 px dots at 20 px".into(),
//!     serial: None,
//!     image_px: size,
//!     flip: Flip::None,
//!     grey_weights_rgb: [1.0 / 3.0; 3],
//!     polarity: Polarity::Dark,
//!     pitch_px: 20.0,
//!     pitch_mm: Some(1.5),
//!     gel_mm: None,
//!     marker_diameter_px: 6.0,
//!     skin: Skin::Smooth,
//!     bare_sharpness: None,
//!     edge_bands: vec![],
//!     rectification: None,
//!     defects_px: vec![],
//!     shear: None,
//! };
//! // A picture of the finger at rest.
//! let dark = |v: usize| (8..14).contains(&(v % 20));
//! let pixels: Vec<u8> =
//!     (0..size.area()).map(|i| if dark(i % 160) && dark(i / 160) { 60 } else { 150 }).collect();
//! let frame = |seq| Frame {
//!     pixels: Pixels::Gray(Gray::new(&pixels, size).unwrap()),
//!     seq,
//!     time_ns: None,
//! };
//!
//! let settings = Settings::default();
//! let mut builder = RestBuilder::new(&sensor, &settings, size)?;
//! builder.add(&frame(0))?;
//! let rest = builder.build(RestKind::Unloaded)?;
//! assert_eq!(rest.markers_count(), 48);
//!
//! let mut monitor = SlipMonitor::new(&sensor, &settings, rest)?;
//! let report = monitor.step(&frame(1), None);
//! assert_eq!(report.state, SlipState::NoContact);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Modules
//!
//! | module | what |
//! |---|---|
//! | [`monitor`] | the steps in order; settings, reports, the rest frame |
//! | [`events`] | slip events, "begins" and "ends", from verdicts |
//! | [`finger_pipeline`] | a finger of the loop: source, rest frame, monitor |
//! | [`control`] | the control loop around a task, its record of a cycle, and the port of its observers |
//! | [`hand`] | the reports of several fingers fused, in the frame of the hand |
//! | [`grip`] | controllers: hand report in, grip command out; the paper's law and ours |
//! | [`task`] | screw, unscrew, place, lift: state machines over commands, for simulation and hardware alike |
//! | [`calibrate`] | the facts of an unknown finger from images of it at rest |
//! | [`sensor`] | the facts of a finger: geometry, pitch, skin |
//! | [`port`] | the traits of cameras, grippers and wrists |
//! | [`plant`] | the object between the jaws, the motion of jaws and wrist on command, the ground truth in simulation |
//! | [`setting`] | the error for an invalid setting |
//! | [`image`], [`plane`] | borrowed pixels, masks; points, rigid motions, homographies, the axes |
//! | [`pixels`] | every loop over pixels, one kernel per file |
//!
//! The crate has no clock, no files and no sockets, and allocates nothing per frame: all memory is allocated when a
//! [`monitor::SlipMonitor`] is made. The same frames and settings give the same bytes on any machine.

pub mod calibrate;
pub mod control;
pub mod events;
pub mod finger_pipeline;
pub mod grip;
pub mod hand;
pub mod image;
pub mod monitor;
pub mod pixels;
pub mod plane;
pub mod plant;
pub mod port;
#[cfg(test)]
mod random;
pub mod sensor;
pub mod setting;
mod smoothing;
pub mod task;
