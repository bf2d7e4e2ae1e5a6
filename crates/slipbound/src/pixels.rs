//! Every loop over pixels of this crate, one kernel per file. Plain functions on borrowed buffers; nothing allocates
//! after the scratch memory of a kernel has been made.

pub mod background;
pub mod bgr;
pub mod binomial;
mod bits;
pub mod blur;
mod border;
pub mod canny;
pub mod cells;
pub mod centroid;
pub mod checksum;
pub mod components;
pub mod contour;
pub mod contrast;
pub mod disc;
pub mod dots;
mod element;
pub(crate) use element::MAX_ELEMENT_PX;
pub mod flatten;
pub mod gaussian;
pub mod grey;
mod lanes;
pub mod mean;
pub mod mirror;
pub mod morphology;
pub mod patch;
mod runs;
pub mod template;
pub mod threshold;
pub mod warp;
pub mod wide;
pub mod yuyv;
