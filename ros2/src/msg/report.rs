//! `slipbound_msgs`: reports of frames and hands. Meanings and units are in the `.msg` files.
#![allow(missing_docs)] // said once, in slipbound_msgs/msg/*.msg

use super::standard::Header;
use super::topic_types;
use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    pub area_px2: f64,
    pub area_mm2: f64,
    pub quality: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Markers {
    pub detected: u32,
    pub matched: u32,
    pub lost: u32,
    pub inner: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    pub reference_px: [f64; 2],
    pub translation_px: [f64; 2],
    pub translation_mm: [f64; 2],
    pub rotation_rad: f64,
    pub icr_px: [f64; 2],
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Shear {
    pub translation_px: [f64; 2],
    pub translation_mm: [f64; 2],
    pub rotation_rad: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Slip {
    pub markers_over: u32,
    pub markers_needed: u32,
    pub threshold_pitch: f64,
    pub max_pitch: f64,
    pub max_mm: f64,
    pub kind: String,
    pub direction_rad: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    pub value: f64,
    pub sd: f64,
    pub age_frames: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    pub reference_seq: u64,
    pub relaxation: f64,
    pub centre_rim_ratio: f64,
    pub imprint_change: f64,
    pub imprint_age_frames: u32,
    pub slide_score: f64,
    pub slide_px: [f64; 2],
    pub slide_rad: f64,
    pub slides: bool,
    pub gross_probability: f64,
    pub slide_pitch_per_s: f64,
    pub slide_mm_per_s: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SlipReport {
    pub header: Header,
    pub finger: String,
    pub frame: u64,
    pub seq: u64,
    pub time_ns: u64,
    pub state: String,
    pub reason: String,
    pub contact: Contact,
    pub markers: Markers,
    pub reference_seq: u64,
    pub grip_n: f64,
    pub motion: Motion,
    pub shear: Shear,
    pub slip: Slip,
    pub stick_ratio: Estimate,
    pub margin: Estimate,
    pub shear_n: Estimate,
    pub torque_nmm: Estimate,
    pub friction: Estimate,
    pub evidence: Evidence,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HandVector {
    pub along: f64,
    pub across: f64,
    pub around: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HandSlip {
    pub direction: HandVector,
    pub pivots: bool,
    pub fingers_count: u32,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HandReport {
    pub header: Header,
    pub seq: u64,
    pub time_ns: u64,
    pub state: String,
    pub live_count: u32,
    pub health: [String; 4],
    pub separated: bool,
    pub shear_mm: HandVector,
    pub pivot_rad: f64,
    pub slip_max_mm: f64,
    pub contact_area_mm2: f64,
    pub quality: f64,
    pub slip: HandSlip,
    pub margin: f64,
    pub margins_count: u32,
    pub friction: f64,
    pub cut_fraction: f64,
}

topic_types! {
    "slipbound_msgs" / SlipReport HandReport;
}
