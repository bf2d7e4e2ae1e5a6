//! Measurements of the monitor on painted fingers with known ground truth. One binary: each part has one test that
//! takes most of the time, and these run in parallel.
#![allow(clippy::disallowed_macros)] // tests print what they measured

mod borders;
mod evidence;
mod exactness;
mod in_turns;
mod paper_cases;
#[path = "../picture/mod.rs"]
mod picture;
mod rates;
