//! Files, cameras and grippers for `slipbound`.

pub mod avi_writer;
pub mod config;
pub mod overlay;
pub mod report_json;
pub mod sensors;
pub mod source;
