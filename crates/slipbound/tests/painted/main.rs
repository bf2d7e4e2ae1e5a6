//! What the monitor measures on painted fingers, whose truth is known. One program: in each part one test takes most of the time, and
//! they run side by side.
#![allow(clippy::disallowed_macros)] // tests print what they measured

mod borders;
mod evidence;
mod exactness;
mod in_turns;
mod paper_cases;
#[path = "../picture/mod.rs"]
mod picture;
mod rates;
