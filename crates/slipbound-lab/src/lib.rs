//! Simulated soft fingers: the contact of a soft, bonded gel pad with an object, with exact ground truth of what sticks
//! and what slips.
//!
//! ```text
//!        object  (pose, roll, force, wrench)
//!      ~~~~~\_______/~~~~~      shape:     how high the object is above the flat gel
//!      =====gel surface=====    contact:   what touches (normal), what sticks (tangential)
//!           gel, h mm           layer:     how the gel yields
//!      #####rigid lens######
//! ```
//!
//! Lengths are in mm, forces in N, pressures in MPa = N/mm2, times in s; x runs along the finger, y across it,
//! z into the gel, and pressure is positive when it compresses. The equations are in docs/simulator.md.
//!
//! ```
//! use slipbound_lab::contact::{Finger, FingerSettings, Leg, Path};
//! use slipbound_lab::contact::shape::Sphere;
//!
//! let settings = FingerSettings::fast();
//! let mut finger = Finger::new(settings, Sphere { radius_mm: 15.0 }).unwrap();
//! let path = Path::new(vec![Leg::press(20.0, 0.1), Leg::shear(1.0, 0.0, 0.1)]).unwrap();
//! for command in path.commands(finger.settings().substep_s) {
//!     finger.step(&command).unwrap();
//! }
//! let truth = finger.truth();
//! assert!(truth.wrench.force_n.x > 1.0 && truth.stick_ratio.unwrap() < 1.0);
//! ```
//!
//! A whole trial, with its camera and ground truth, is a line of text ([`scenes`]) and a source of frames ([`world`]):
//!
//! ```
//! use slipbound::port::{FrameBuffer, FrameSource, Next};
//! use slipbound_lab::{scenes::Trial, world::World};
//!
//! let trial = Trial::parse("ramp?object=scissors&force_n=15&ramp_s=0.3&rest_frames=2&grid=fast&seed=3").unwrap();
//! let mut world = World::new(&trial).unwrap();
//! let mut frame = FrameBuffer::default();
//! while world.next(&mut frame).unwrap() == Next::Frame {
//!     let truth = world.truth();
//!     println!("{} s: stick ratio {:?}", 1e-9 * truth.time_ns as f64, truth.stick_ratio);
//! }
//! assert!(world.gross().is_some(), "it slid in the end");
//! ```
//!
//! Two such fingers on a gripper and a wrist, holding a cap, a bottle or a tool, are a [`hand`] that
//! takes commands; [`score`] rates what a run did.

pub mod clairvoyant;
pub mod contact;
pub mod eval;
pub mod faults;
pub mod fit;
pub mod hand;
pub mod jpeg;
pub mod layer;
pub mod lockstep;
pub mod objects;
pub mod plants;
pub mod random;
pub mod record;
pub mod render;
pub mod rivals;
pub mod scenes;
pub mod score;
pub mod trials;
pub mod validation;
pub mod world;
