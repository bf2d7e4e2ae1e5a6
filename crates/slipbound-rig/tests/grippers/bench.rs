//! A driver and an emulator, joined by two byte queues. Time goes on only when both are empty: every run is the same,
//! and faster than real time.

use slipbound::port::{GripCommand, GripperState, Jaws, Motion, Plant};
use slipbound_rig::emulator::{self, Block, Emulator, Faults, Faulty};
use slipbound_rig::gripper::config::{Config, Kind};
use slipbound_rig::gripper::{self, Driver, Error, Note, Order};

pub const MS: u64 = 1_000_000;

/// Time a step takes, ns.
const STEP_NS: u64 = 2 * MS;

/// Width of the block between the jaws, mm.
pub const WIDTH_MM: f64 = 50.0;

pub struct Bench {
    pub driver: Box<dyn Driver>,
    pub emulator: Faulty,
    pub plant: Block,
    pub now_ns: u64,
    /// Most bytes carried at once; small ones split every message.
    pub chunk: usize,
    /// Whether bytes are carried at all.
    pub is_carrying: bool,
    pub is_connected: bool,
    /// Everything the driver has sent.
    pub sent: Vec<u8>,
    pub notes: Vec<Note>,
    /// Least force since it was last reset, N per finger.
    pub least_n: f64,
}

/// A driver by the name of its emulator.
pub fn driver(name: &str, config: Config) -> Box<dyn Driver> {
    match name {
        "wsg50" => Box::new(gripper::wsg50::Wsg50::new("wsg50://bench", config)),
        "gcl" => Box::new(gripper::gcl::Gcl::new("gcl://bench", config)),
        "robotiq-rtu" => Box::new(gripper::robotiq::Serial::new("robotiq:///dev/bench", config)),
        "robotiq" => Box::new(gripper::robotiq::Socket::new("robotiq://bench", config)),
        _ => Box::new(gripper::line::LineGripper::new("line://bench", config)),
    }
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
        let emulator = Faulty::new(emulator::by_name(name).expect("a name"), faults);
        let mut bench = Bench {
            driver: driver(name, config),
            emulator,
            plant: Block::new(WIDTH_MM),
            now_ns: 0,
            chunk: usize::MAX,
            is_carrying: true,
            is_connected: false,
            sent: Vec::new(),
            notes: Vec::new(),
            least_n: f64::INFINITY,
        };
        bench.emulator.tick(0, &mut bench.plant);
        bench.connect();
        bench
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

    pub fn connect(&mut self) {
        self.is_connected = true;
        self.emulator.connected(self.now_ns);
        self.driver.linked(self.now_ns);
        self.carry();
    }

    /// Both sides see the link break.
    pub fn cut(&mut self) {
        self.is_connected = false;
        self.emulator.disconnected(self.now_ns);
        self.driver.unlinked(self.now_ns, "cut");
    }

    fn carry(&mut self) {
        for _ in 0..10_000 {
            if !self.is_connected || !self.is_carrying {
                return;
            }
            let ours = take(self.driver.outgoing(), self.chunk);
            let theirs = take(self.emulator.outgoing(), self.chunk);
            if ours.is_empty() && theirs.is_empty() {
                return;
            }
            self.sent.extend(&ours);
            self.emulator.receive(self.now_ns, &ours);
            self.driver.receive(self.now_ns, &theirs);
        }
        panic!("the two never stop talking");
    }

    pub fn step(&mut self) {
        self.carry();
        self.now_ns += STEP_NS;
        self.emulator.tick(self.now_ns, &mut self.plant);
        self.plant.advance_to(self.now_ns);
        if self.emulator.take_hang_up() {
            self.cut();
        }
        self.driver.tick(self.now_ns);
        self.least_n = self.least_n.min(self.plant.force_n);
        self.notes.extend(std::iter::from_fn(|| self.driver.next_note()));
        self.carry();
    }

    pub fn run(&mut self, ms: u64) {
        for _ in 0..ms * MS / STEP_NS {
            self.step();
        }
    }

    pub fn state(&mut self) -> Result<GripperState, Error> {
        self.driver.state(self.now_ns)
    }

    /// Steps until the state is as wanted; how many ms that took. Errors on the way count as not yet.
    pub fn until(&mut self, most_ms: u64, wanted: impl Fn(&GripperState) -> bool) -> u64 {
        let from_ns = self.now_ns;
        while !self.state().is_ok_and(|state| wanted(&state)) {
            self.step();
            assert!(self.now_ns - from_ns <= most_ms * MS, "still {:?}", self.driver.state(self.now_ns));
        }
        (self.now_ns - from_ns) / MS
    }

    /// Runs until the driver tells an error.
    pub fn until_error(&mut self, most_ms: u64) -> Error {
        let until_ns = self.now_ns + most_ms * MS;
        loop {
            self.step();
            match self.state() {
                Err(error) => return error,
                Ok(state) => assert!(self.now_ns < until_ns, "no error, but {state:?}"),
            }
        }
    }

    pub fn order(&mut self, order: Order) -> Result<(), Error> {
        let result = self.driver.order(self.now_ns, order);
        self.carry();
        result
    }

    pub fn grip(&mut self, force_n: f64) -> Result<(), Error> {
        self.order(Order::Grip(GripCommand { force_n, motion: Motion::Go }))
    }

    pub fn release(&mut self) -> Result<(), Error> {
        self.order(Order::Grip(GripCommand { force_n: 0.0, motion: Motion::Release }))
    }
}

fn take(queue: &mut Vec<u8>, most: usize) -> Vec<u8> {
    let count = queue.len().min(most);
    queue.drain(..count).collect()
}
