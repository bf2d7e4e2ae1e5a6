//! Files, cameras and grippers for `slipbound`.

pub mod avi_writer;
pub mod source;
