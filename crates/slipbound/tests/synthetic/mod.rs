//! Synthetic hand reports and gripper states.
#![allow(dead_code)] // each test uses its part

use slipbound::hand::{FINGERS_MOST, HandReport, HandSlip, HandVector, Health};
use slipbound::monitor::SlipState;
use slipbound::port::{GripperState, Jaws};

pub const FRAME_NS: u64 = 33_333_333;

pub fn hand(state: SlipState) -> HandReport {
    let around = HandVector { around: 1.0, ..HandVector::default() };
    let slip = matches!(state, SlipState::Incipient).then_some(HandSlip {
        direction: around,
        pivots: false,
        fingers_count: 2,
    });
    let mut health = [Health::Absent; FINGERS_MOST];
    health[..2].fill(if state == SlipState::Unjudged { Health::Blind } else { Health::Live });
    HandReport {
        seq: 1,
        time_ns: None,
        state,
        live_count: if state == SlipState::Unjudged { 0 } else { 2 },
        health,
        separated: true,
        shear_mm: Some(HandVector::default()),
        pivot_rad: Some(0.0),
        slip_max_mm: Some(0.1),
        contact_area_mm2: Some(100.0),
        quality: 0.8,
        slip,
        margin: None,
        margins_count: 0,
        // The law `margin` uses 0.62 of it.
        friction: Some(0.5),
        cut_fraction: 0.0,
    }
}

pub fn gripper(force_n: f64) -> GripperState {
    GripperState {
        time_ns: 0,
        force_n: Some(force_n),
        force_error_n: None,
        target_n: Some(force_n),
        opening_mm: Some(28.0),
        jaws: Jaws::Holding,
    }
}
