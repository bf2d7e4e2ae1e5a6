//! A simulated hand reached like a real one: by the drivers of gripper and wrist, through the wire protocols of
//! emulators that press and move the simulated world. In lock-step here; over sockets in [`crate::loopback`].

use anyhow::{Context, anyhow};
use slipbound::plant::Plant;
use slipbound::port::{Gripper, Wrist};
use slipbound::setting::nearest;
use slipbound_lab::hand::{SimHand, SimPlant};
use slipbound_lab::lockstep::Actuators;
use slipbound_rig::emulator::{self, Emulator, Faults, LockstepPair, OnlyMoved};
use slipbound_rig::gripper::{self, Driver};
use slipbound_rig::wrist::LineWrist;
use std::fmt;
use std::str::FromStr;

/// Time between two exchanges of bytes of driver and emulator, ns.
const STEP_NS: u64 = 2_000_000;

/// Which gripper is emulated, with its settings: `wsg50`, `robotiq?most_n=40`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EmulatedGripper {
    name: String,
    query: String,
}

impl FromStr for EmulatedGripper {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, query) = text.split_once('?').unwrap_or((text, ""));
        if !emulator::NAMES.contains(&name) {
            let names = emulator::NAMES.join(", ");
            let meant =
                nearest(name, &emulator::NAMES).map_or_else(String::new, |name| format!(" (did you mean {name}?)"));
            return Err(format!("expected one of {names}, with ?KEY=VALUE as wanted, got `{text}`{meant}"));
        }
        Ok(EmulatedGripper { name: name.into(), query: query.into() })
    }
}

impl fmt::Display for EmulatedGripper {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        if self.query.is_empty() { Ok(()) } else { write!(f, "?{}", self.query) }
    }
}

impl EmulatedGripper {
    /// The address of the gripper at HOST:PORT; `width_mm` is the width of the object, a setting that a WSG-50 needs.
    pub fn address(&self, place: &str, width_mm: f64) -> String {
        let scheme = if self.name == "robotiq-rtu" { "robotiq:///dev/" } else { &format!("{}://", self.name) };
        let width = match self.query.contains("part_width_mm=") {
            true => String::new(),
            false => format!("part_width_mm={width_mm}&"),
        };
        format!("{scheme}{place}?{width}{}", self.query).trim_end_matches(['&', '?']).into()
    }

    /// The driver, not yet linked.
    pub fn driver(&self, width_mm: f64) -> anyhow::Result<Driver> {
        gripper::driver(&self.address("emulator:1", width_mm), None).map_err(|e| anyhow!(e))
    }

    /// The emulator with these faults.
    pub fn emulator(&self, faults: &Faults) -> anyhow::Result<Emulator> {
        faulty(&self.name, faults)
    }
}

/// The emulator of a wrist with these faults.
pub fn wrist_emulator(faults: &Faults) -> anyhow::Result<Emulator> {
    faulty("line", faults)
}

fn faulty(name: &str, faults: &Faults) -> anyhow::Result<Emulator> {
    let emulator = emulator::by_name(name).with_context(|| format!("no emulator is called {name}"))?;
    Ok(emulator.with_faults(faults.clone()))
}

/// Faults of the emulators of gripper and wrist.
#[derive(Debug, Clone, Default)]
pub struct LinkFaults {
    /// Of the gripper.
    pub gripper: Faults,
    /// Of the wrist.
    pub wrist: Faults,
}

/// Drivers and emulators of gripper and wrist that move a simulated world, in lock-step.
pub struct EmulatedActuators {
    gripper: LockstepPair<Driver>,
    wrist: LockstepPair<LineWrist>,
    plant: SimPlant,
}

impl EmulatedActuators {
    /// Takes the jaws and the wrist of a hand that holds an object of this width, mm.
    pub fn new(hand: &SimHand, width_mm: f64, emulated: &EmulatedGripper, faults: &LinkFaults) -> anyhow::Result<Self> {
        let mut plant = hand.plant();
        let gripper = LockstepPair::new(emulated.driver(width_mm)?, emulated.emulator(&faults.gripper)?, &mut plant);
        let (driver, emulator) = (LineWrist::new("line://emulator:2"), wrist_emulator(&faults.wrist)?);
        let wrist = LockstepPair::new(driver, emulator, &mut OnlyMoved(&mut plant));
        Ok(EmulatedActuators { gripper, wrist, plant })
    }
}

impl Actuators for EmulatedActuators {
    fn ports(&mut self) -> (&mut dyn Gripper, &mut dyn Wrist) {
        (&mut self.gripper, &mut self.wrist)
    }

    fn advance_frame(&mut self, hand: &SimHand) {
        let frame = hand.frame();
        while hand.frame() == frame && hand.error().is_none() {
            let now_ns = self.gripper.now_ns() + STEP_NS;
            self.gripper.step(now_ns, &mut self.plant);
            self.wrist.step(now_ns, &mut OnlyMoved(&mut self.plant));
            self.plant.advance_to(now_ns);
        }
    }
}
