//! Grippers and a wrist that are not there: the real wire protocols from the other side, moved by [`JawDrive`] and
//! [`WristDrive`], between their jaws any [`Plant`]. State machines told the time, like the drivers.
//!
//! | what | emulator | speaks |
//! |---|---|---|
//! | `wsg50` | [`wsg50::Wsg50`] | WSG-50 binary interface |
//! | `gcl` | [`gcl::Gcl`] | WSG-50 text interface |
//! | `robotiq-rtu` | [`robotiq::Serial`] | Robotiq 2F-85, Modbus RTU |
//! | `robotiq` | [`robotiq::Socket`] | Robotiq 2F-85 behind a UR controller |
//! | `line` | [`line::Line`] | the line protocol, gripper and wrist |
//!
//! They can be told to fail ([`Faults`]). What they hold when a link is cut, they go on holding.
//!
//! [`JawDrive`]: slipbound::plant::JawDrive
//! [`WristDrive`]: slipbound::plant::WristDrive

mod block;
pub mod faults;
pub mod gcl;
mod hand;
mod joined;
pub mod line;
pub mod robotiq;
mod server;
mod weiss;
pub mod wsg50;

pub use block::Block;
pub use faults::{Faults, Faulty};
pub use joined::{Joined, OnlyMoved};
pub use server::{Server, serve_link, serve_tcp};

use slipbound::plant::Plant;

/// What can happen to an emulator from within.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mishap {
    /// It stops itself and must be acknowledged.
    FastStop,
    /// From now on it refuses every new force.
    RefuseForce,
    /// The object is gone.
    LosePart,
    /// Its supply fails and comes back: the link breaks, it forgets where its jaws are. They keep their force.
    PowerCycle,
    /// A new force limit has no effect on what is already held.
    FixedLimit,
    /// A grasp may be given again while holding.
    AllowRegrasp,
}

/// An emulator without its link. Whoever owns it carries the bytes, tells the time and lets time pass in the plant.
pub trait Emulator: Send {
    /// Somebody has connected.
    fn connected(&mut self, now_ns: u64);

    /// The connection is gone.
    fn disconnected(&mut self, now_ns: u64);

    /// Bytes have come.
    fn receive(&mut self, now_ns: u64, bytes: &[u8]);

    /// Time has passed: the jaws move and press; replies and updates fall due. Does not advance the plant.
    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant);

    /// Bytes to be sent; whoever sends them takes them away from the front.
    fn outgoing(&mut self) -> &mut Vec<u8>;

    /// Something happens to it. False where it cannot happen to one of its kind.
    fn befall(&mut self, now_ns: u64, mishap: Mishap) -> bool;

    /// Normal force per finger it presses with, N.
    fn force_n(&self) -> f64;

    /// Distance between its fingertips, mm.
    fn opening_mm(&self) -> f64;
}

/// The emulators by name.
pub const NAMES: [&str; 5] = ["wsg50", "gcl", "robotiq", "robotiq-rtu", "line"];

/// An emulator by its name; None for a name that is not among [`NAMES`].
pub fn by_name(name: &str) -> Option<Box<dyn Emulator>> {
    Some(match name {
        "wsg50" => Box::new(wsg50::Wsg50::default()),
        "gcl" => Box::new(gcl::Gcl::default()),
        "robotiq" => Box::new(robotiq::Socket::default()),
        "robotiq-rtu" => Box::new(robotiq::Serial::default()),
        "line" => Box::new(line::Line::default()),
        _ => return None,
    })
}
