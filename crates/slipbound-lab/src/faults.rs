//! Faults between a camera and the method: sources that damage the frames of another source.
//!
//! ```text
//!   FrameSource --> Faulty       { drop, late, stale, torn, blur, dead, drift, flicker } --> FrameSource
//!                   at random, by the seed:   drop=0.02,torn=0.01
//!   FrameSource --> CameraFaults { lost, frozen, torn, dark, swapped }                   --> FrameSource
//!                   from a time on, for good: lost@2:left
//! ```
//!
//! A frame whose pixels are changed is encoded again: the recording contains what the method saw.

mod camera;
mod frames;
mod image;
mod paint;

pub use camera::{CameraFault, CameraFaultError, CameraFaultKind, CameraFaults};
pub use frames::{Faults, Faulty};

#[cfg(test)]
mod tests;
