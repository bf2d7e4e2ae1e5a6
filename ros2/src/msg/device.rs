//! `slipbound_msgs`: commands and states of grippers and wrists. Meanings and units are in the `.msg` files.
#![allow(missing_docs)] // said once, in slipbound_msgs/msg/*.msg

use super::standard::Header;
use super::topic_types;
use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GripCommand {
    pub header: Header,
    pub jaws: String,
    pub force_n: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GripperState {
    pub header: Header,
    pub force_n: f64,
    pub force_error_n: f64,
    pub target_n: f64,
    pub opening_mm: f64,
    pub jaws: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WristCommand {
    pub header: Header,
    pub motion: String,
    pub rate_rad_per_s: f64,
    pub most_rad: f64,
    pub rate_mm_per_s: f64,
    pub most_mm: f64,
    pub time_to_live_ns: u64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WristState {
    pub header: Header,
    pub angle_rad: f64,
    pub lowered_mm: f64,
    pub moving: bool,
}

topic_types! {
    "slipbound_msgs" / GripCommand GripperState WristCommand WristState;
}
