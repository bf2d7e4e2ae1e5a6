//! `slipbound emulate`: a gripper that is not there, at a port of this computer.

use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use slipbound_rig::emulator::{Block, Emulator, Faults, Faulty, NAMES, by_name, faults, serve_tcp};
use std::net::{IpAddr, Ipv4Addr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};

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
    /// What goes wrong, joined by commas; see below
    #[arg(long, value_name = "FAULTS", default_value = "")]
    fail: Faults,
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
        let interrupted = interruption::listen()?;
        let emulator = by_name(&self.name).ok_or_else(|| anyhow::anyhow!("no emulator is called {}", self.name))?;
        let mut emulator = Faulty::new(emulator, self.fail.clone());
        let mut block = Block { width_mm: (self.width > 0.0).then_some(self.width), ..Block::default() };
        match self.name.as_str() {
            "robotiq-rtu" => self.serve_serial(&mut emulator, &mut block, &interrupted)?,
            _ => self.serve_tcp(&mut emulator, &mut block, &interrupted)?,
        }
        let (force_n, opening_mm) = (emulator.force_n(), emulator.opening_mm());
        Terminal::plain().say(&format!("at the end: {force_n:.2} N per finger, opening {opening_mm:.2} mm"))?;
        Ok(Outcome::Done)
    }

    fn serve_tcp(&self, emulator: &mut Faulty, block: &mut Block, interrupted: &AtomicBool) -> Result<(), Failure> {
        let bound = TcpListener::bind((self.listen, self.port));
        let listener =
            bound.map_err(|e| Failure::work(format!("cannot listen at {}:{}", self.listen, self.port), e))?;
        let address = listener.local_addr().map_err(|e| Failure::work("cannot listen", e))?;
        Terminal::plain().say(&format!("{}://{address}", self.name))?;
        serve_tcp(&listener, emulator, block, || !interrupted.load(Ordering::Relaxed))
            .map_err(|e| Failure::work("cannot serve", e))
    }

    #[cfg(not(target_os = "linux"))]
    fn serve_serial(&self, _: &mut Faulty, _: &mut Block, _: &AtomicBool) -> Result<(), Failure> {
        Err(Failure::Arguments(anyhow::anyhow!("robotiq-rtu: expected Linux, whose pseudo-terminals have names")))
    }

    #[cfg(target_os = "linux")]
    fn serve_serial(&self, emulator: &mut Faulty, block: &mut Block, interrupted: &AtomicBool) -> Result<(), Failure> {
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
