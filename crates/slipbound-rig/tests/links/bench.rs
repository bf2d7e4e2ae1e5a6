//! A driver and an emulator, joined by two byte queues. Time advances only when both are empty: every run is the same,
//! and faster than real time.

use slipbound::plant::Plant;
use slipbound::port::{DriverEvent, GripCommand, Gripper, GripperState, Jaws};
use slipbound_rig::emulator::{self, Block, Faults, LockstepPair};
use slipbound_rig::gripper::config::{Config, Kind};
use slipbound_rig::gripper::{self, Driver, Error, Protocol, Request};
use std::ops::{Deref, DerefMut};

pub const MS: u64 = 1_000_000;

/// Time a step takes, ns.
const STEP_NS: u64 = 2 * MS;

/// Width of the block between the jaws, mm.
pub const WIDTH_MM: f64 = 50.0;

/// The driver, the emulator, and the block between the jaws.
pub struct Bench {
    pub pair: LockstepPair<Driver>,
    pub plant: Block,
    pub events: Vec<DriverEvent>,
    /// Least force since it was last reset, N per finger.
    pub least_n: f64,
}

impl Deref for Bench {
    type Target = LockstepPair<Driver>;

    fn deref(&self) -> &Self::Target {
        &self.pair
    }
}

impl DerefMut for Bench {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.pair
    }
}

/// A driver by the name of its emulator.
pub fn driver(name: &str, config: Config) -> Driver {
    let (address, protocol): (_, Box<dyn Protocol>) = match name {
        "wsg50" => ("wsg50://bench", Box::new(gripper::wsg50::Wsg50::default())),
        "gcl" => ("gcl://bench", Box::new(gripper::gcl::Gcl::default())),
        "robotiq-rtu" => ("robotiq:///dev/bench", Box::new(gripper::robotiq::Serial::default())),
        "robotiq" => ("robotiq://bench", Box::new(gripper::robotiq::Socket::default())),
        _ => ("line://bench", Box::new(gripper::line::LineGripper::default())),
    };
    Driver::new(address, config, protocol)
}

/// The settings the bench takes: those of the driver, with the block's width.
pub fn config(name: &str) -> Config {
    let kind = match name {
        "wsg50" => Kind::Wsg50,
        "gcl" => Kind::Gcl,
        "robotiq" | "robotiq-rtu" => Kind::Robotiq,
        _ => Kind::Line,
    };
    Config { part_width_mm: Some(WIDTH_MM), ..Config::of(kind) }
}

impl Bench {
    /// A pair by name, linked, with a block between the jaws and these faults.
    pub fn new(name: &str, config: Config, faults: &str) -> Self {
        let faults: Faults = faults.parse().expect("faults");
        let emulator = emulator::by_name(name).expect("a name").with_faults(faults);
        let mut plant = Block::new(WIDTH_MM);
        let mut pair = LockstepPair::unlinked(driver(name, config), emulator, &mut plant);
        (pair.reconnects, pair.sent) = (false, Some(Vec::new()));
        pair.connect();
        Bench { pair, plant, events: Vec::new(), least_n: f64::INFINITY }
    }

    /// The same with the settings of the name.
    pub fn of(name: &str, faults: &str) -> Self {
        Bench::new(name, config(name), faults)
    }

    /// A bench whose jaws hold the block with this force.
    pub fn holding(name: &str, config: Config, faults: &str, force_n: f64) -> Self {
        let mut bench = Bench::new(name, config, faults);
        bench.run(200);
        bench.grip(force_n).expect("taken over");
        bench.until(5000, |state| state.jaws == Jaws::Holding);
        bench.run(1000);
        assert_eq!(bench.emulator.force_n(), bench.plant.force_n);
        assert!((bench.plant.force_n - force_n).abs() < 0.5, "{}", bench.plant.force_n);
        bench.least_n = f64::INFINITY;
        bench
    }

    /// Everything the driver has sent.
    pub fn sent(&self) -> &[u8] {
        self.pair.sent.as_deref().expect("it is kept")
    }

    pub fn step(&mut self) {
        let now_ns = self.pair.now_ns() + STEP_NS;
        self.pair.step(now_ns, &mut self.plant);
        assert!(self.pair.exchange(), "the two never stop talking");
        self.plant.advance_to(now_ns);
        self.least_n = self.least_n.min(self.plant.force_n);
        self.events.extend(std::iter::from_fn(|| self.pair.next_event()));
    }

    pub fn run(&mut self, ms: u64) {
        for _ in 0..ms * MS / STEP_NS {
            self.step();
        }
    }

    /// Steps until the state is as wanted; returns the time that took, ms. Errors on the way count as not yet.
    pub fn until(&mut self, most_ms: u64, wanted: impl Fn(&GripperState) -> bool) -> u64 {
        let from_ns = self.now_ns();
        while !self.state().is_ok_and(|state| wanted(&state)) {
            self.step();
            let is_in_time = self.now_ns() - from_ns <= most_ms * MS;
            assert!(is_in_time, "still {:?}", self.state());
        }
        (self.now_ns() - from_ns) / MS
    }

    /// Runs until the driver reports an error.
    pub fn until_error(&mut self, most_ms: u64) -> Error {
        let until_ns = self.now_ns() + most_ms * MS;
        loop {
            self.step();
            match self.state() {
                Err(error) => return error,
                Ok(state) => assert!(self.now_ns() < until_ns, "no error, but {state:?}"),
            }
        }
    }

    pub fn grip(&mut self, force_n: f64) -> Result<(), Error> {
        self.request(Request::Grip(GripCommand::Hold { force_n }))
    }

    pub fn release(&mut self) -> Result<(), Error> {
        self.request(Request::Grip(GripCommand::Release))
    }
}
