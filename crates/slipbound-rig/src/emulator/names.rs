//! The emulators by name.

use super::emulated::Emulator;
use super::firmware::Firmware;
use super::{gcl, line, robotiq, wsg50};

/// The emulators by name.
pub const NAMES: [&str; 5] = ["wsg50", "gcl", "robotiq", "robotiq-rtu", "line"];

/// An emulator by its name, without faults; None for a name that is not among [`NAMES`].
pub fn by_name(name: &str) -> Option<Emulator> {
    let firmware: Box<dyn Firmware> = match name {
        "wsg50" => Box::new(wsg50::Wsg50::default()),
        "gcl" => Box::new(gcl::Gcl::default()),
        "robotiq" => Box::new(robotiq::Socket::default()),
        "robotiq-rtu" => Box::new(robotiq::Serial::default()),
        "line" => Box::new(line::Line::default()),
        _ => return None,
    };
    Some(Emulator::new(firmware))
}
