//! Overlay images of the results, in the paper's colours but for the rigid motion, which is light blue.
//!
//! ```text
//!   +--------------------------------------------------------------+
//!   | verdict   frame, time, contact, motion, slip                 |
//!   +------------------------------+-------------------------------+
//!   | the rectified image:         | the same, paled:              |
//!   |  contact green, inner white  |  contact green                |
//!   |  measured yellow, rigid blue |  slip field black             |
//!   |  ICR yellow dot              |  slip over threshold purple   |
//!   |  reference point blue arrow  |                               |
//!   +------------------------------+-------------------------------+
//!   | legend                                                       |
//!   +--------------------------------------------------------------+
//! ```

mod backdrop;
mod canvas;
mod drawing;
mod grid;
mod input;
mod palette;
mod regions;
mod strips;
mod writer;

pub use drawing::Overlay;
pub use grid::grid_picture;
pub use input::OverlayInput;
pub(crate) use writer::write_png;
pub use writer::{Error, OverlayWriter, is_numbered};
