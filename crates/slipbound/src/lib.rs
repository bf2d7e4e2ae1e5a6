//! Incipient slip from a camera inside a soft fingertip.

pub mod events;
pub mod image;
pub mod monitor;
pub mod pixels;
pub mod plane;
pub mod port;
pub mod sensor;
