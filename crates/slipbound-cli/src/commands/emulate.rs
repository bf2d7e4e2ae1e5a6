//! `slipbound emulate`: a gripper that is not there, at a port of this computer.

use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use slipbound::plant::Plant;
use slipbound_rig::emulator::{Block, Emulator, Faults, NAMES, by_name, faults, serve_tcp};
use std::fs::File;
use std::io::Write;
use std::net::{IpAddr, Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

/// The arguments of `slipbound emulate`.
#[derive(Debug, clap::Args)]
#[command(after_help = fault_help())]
pub struct Emulate {
    /// Which
    #[arg(value_parser = NAMES)]
    name: String,
    /// TCP port; 0 takes any that is free. Not for robotiq-rtu: that makes a serial device of its own
    #[arg(long, default_value_t = 0)]
    port: u16,
    /// Address to listen at. Everyone who reaches it can command the emulator
    #[arg(long, default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
    /// Width of the block between the jaws, mm; 0 for none
    #[arg(long, value_name = "MM", default_value_t = 50.0)]
    width: f64,
    /// Weight of the block, N; once carried, it falls when it is pressed too little
    #[arg(long, value_name = "NEWTONS", default_value_t = 0.0)]
    weight: f64,
    /// Friction coefficient of the block, for its weight
    #[arg(long, value_name = "MU", default_value_t = 0.5)]
    mu: f64,
    /// Write what is done to the block, one JSON object every 10 ms
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// What goes wrong, joined by commas; see below
    #[arg(long, value_name = "FAULTS", default_value = "")]
    fail: Faults,
}

/// Time between two lines of the log, ns.
const LOG_NS: u64 = 10_000_000;

/// A block that writes down what is done to it.
struct Logged {
    block: Block,
    log: Option<File>,
    due_ns: u64,
}

impl Logged {
    fn new(block: Block, log: Option<&Path>) -> Result<Self, Failure> {
        let create =
            |path: &Path| File::create(path).map_err(|e| Failure::work(format!("{}: cannot write", path.display()), e));
        Ok(Logged { block, log: log.map(create).transpose()?, due_ns: 0 })
    }
}

impl Plant for Logged {
    fn width_mm(&self) -> Option<f64> {
        self.block.width_mm()
    }

    fn press(&mut self, force_n: f64) {
        self.block.press(force_n);
    }

    fn place_wrist(&mut self, angle_rad: f64, lowered_mm: f64) {
        self.block.place_wrist(angle_rad, lowered_mm);
    }

    fn advance_to(&mut self, now_ns: u64) {
        self.block.advance_to(now_ns);
        let (Some(log), true) = (&mut self.log, now_ns >= self.due_ns) else { return };
        self.due_ns = now_ns + LOG_NS;
        let unix_ns = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64);
        let Block { force_n, angle_rad, lowered_mm, is_carried, .. } = self.block;
        // Who deletes the log while it is written does not want it.
        let _ = writeln!(
            log,
            "{{\"unix_ns\":{unix_ns},\"force_n\":{force_n:.3},\"angle_rad\":{angle_rad:.6},\"lowered_mm\":{lowered_mm:.4},\"is_carried\":{is_carried}}}"
        );
    }
}

/// The faults that can be asked for, as a table.
fn fault_help() -> String {
    let rows = faults::WORDS.iter().map(|(word, what)| format!("  {word:<18} {what}"));
    let rows: Vec<String> = rows.collect();
    format!("Faults (MS counts from the start):\n{}", rows.join("\n"))
}

impl Emulate {
    /// Serves until Ctrl-C.
    pub fn run(&self) -> Result<Outcome, Failure> {
        if !(0.0..=1000.0).contains(&self.width) {
            return Err(Failure::Arguments(anyhow::anyhow!("--width: expected 0 to 1000 mm, got {}", self.width)));
        }
        if !(0.0..=1000.0).contains(&self.weight) || !(0.01..=10.0).contains(&self.mu) {
            let (weight, mu) = (self.weight, self.mu);
            return Err(Failure::Arguments(anyhow::anyhow!(
                "expected --weight from 0 to 1000 N and --mu from 0.01 to 10, got {weight} and {mu}"
            )));
        }
        let interrupted = interruption::listen()?;
        let emulator = by_name(&self.name).ok_or_else(|| anyhow::anyhow!("no emulator is called {}", self.name))?;
        let mut emulator = emulator.with_faults(self.fail.clone());
        let width_mm = (self.width > 0.0).then_some(self.width);
        let block = Block { width_mm, least_n: self.weight / (2.0 * self.mu), ..Block::default() };
        let mut block = Logged::new(block, self.log.as_deref())?;
        match self.name.as_str() {
            "robotiq-rtu" => self.serve_serial(&mut emulator, &mut block, &interrupted)?,
            _ => self.serve_tcp(&mut emulator, &mut block, &interrupted)?,
        }
        let (force_n, opening_mm) = (emulator.force_n(), emulator.opening_mm());
        let block = match (block.block.is_carried, block.block.width_mm) {
            (true, _) => "the block is held",
            (false, Some(_)) => "the block is not held",
            (false, None) if self.width > 0.0 => "the block has fallen",
            (false, None) => "no block",
        };
        Terminal::plain()
            .say(&format!("at the end: {force_n:.2} N per finger, opening {opening_mm:.2} mm, {block}"))?;
        Ok(Outcome::Done)
    }

    fn serve_tcp(&self, emulator: &mut Emulator, block: &mut Logged, interrupted: &AtomicBool) -> Result<(), Failure> {
        let bound = TcpListener::bind((self.listen, self.port));
        let listener =
            bound.map_err(|e| Failure::work(format!("cannot listen at {}:{}", self.listen, self.port), e))?;
        let address = listener.local_addr().map_err(|e| Failure::work("cannot listen", e))?;
        Terminal::plain().say(&format!("{}://{address}", self.name))?;
        serve_tcp(listener, emulator, block, || !interrupted.load(Ordering::Relaxed))
            .map_err(|e| Failure::work("cannot serve", e))
    }

    #[cfg(not(target_os = "linux"))]
    fn serve_serial(&self, _: &mut Emulator, _: &mut Logged, _: &AtomicBool) -> Result<(), Failure> {
        Err(Failure::Arguments(anyhow::anyhow!("robotiq-rtu: expected Linux, whose pseudo-terminals have names")))
    }

    #[cfg(target_os = "linux")]
    fn serve_serial(
        &self,
        emulator: &mut Emulator,
        block: &mut Logged,
        interrupted: &AtomicBool,
    ) -> Result<(), Failure> {
        use slipbound_rig::emulator::serve_link;
        use slipbound_rig::link::PseudoTerminal;
        let mut terminal = PseudoTerminal::new().map_err(|e| Failure::work("cannot make a serial device", e))?;
        Terminal::plain().say(&format!("robotiq://{}", terminal.device.display()))?;
        while !interrupted.load(Ordering::Relaxed) {
            serve_link(&mut terminal.link, emulator, block, || !interrupted.load(Ordering::Relaxed))
                .map_err(|e| Failure::work("cannot serve", e))?;
        }
        Ok(())
    }
}
