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
mod frame_copy;
mod grid;
mod image_file;
mod input;
mod palette;
mod regions;
mod strips;
mod writer;

pub use drawing::Overlay;
pub(crate) use frame_copy::FrameCopy;
pub use grid::grid_picture;
pub(crate) use image_file::write_png;
pub use image_file::{Error, is_numbered};
pub use input::OverlayInput;
pub use writer::{Drawn, OverlayOptions, OverlayWriter};
