//! `slipbound emulate`: an emulated gripper at a port of this computer, or a whole hand.

mod hand;

use self::hand::Hand;
use super::inputs;
use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::{Terminal, complain};
use slipbound_rig::emulator::{Block, Emulator, Faults, LoggedBlock, NAMES, by_name, faults, serve_tcp};
use slipbound_rig::line_file::LineFile;
use slipbound_rig::link::{now_ns, time_of_day_ns};
use std::io::{BufRead, stdin};
use std::net::{IpAddr, Ipv4Addr, TcpListener};
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, channel};
use std::thread;

/// The arguments of `slipbound emulate`.
#[derive(Debug, clap::Args)]
#[command(after_help = fault_help(), args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Emulate {
    #[command(subcommand)]
    whole: Option<Whole>,
    /// Which gripper
    #[arg(value_parser = NAMES, required = true)]
    name: Option<String>,
    /// TCP port [default: any that is free]. Not for robotiq-rtu: that makes a serial device of its own
    #[arg(long)]
    port: Option<u16>,
    /// Address to listen at. Everyone who reaches it can command the emulator
    #[arg(long, default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
    /// Width of the block between the jaws, mm; 0 for none
    #[arg(long, value_name = "MM", default_value_t = 50.0, allow_negative_numbers = true)]
    width: f64,
    /// Weight of the block, N; once carried, it falls when the grip is too weak
    #[arg(long, value_name = "NEWTONS", default_value_t = 0.0, allow_negative_numbers = true)]
    weight: f64,
    /// Friction coefficient of the block, for its weight
    #[arg(long, value_name = "MU", default_value_t = 0.5, allow_negative_numbers = true)]
    mu: f64,
    /// Log force and motion of the block, one JSON object every 10 ms
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Overwrite a log that this program did not write
    #[arg(long, requires = "log")]
    force: bool,
    /// Faults, joined by commas; see below
    #[arg(long, value_name = "FAULTS", default_value = "")]
    fail: Faults,
    /// Take further faults from standard input while it serves, a line at a time; MS counts from the line
    #[arg(long)]
    fail_stdin: bool,
}

/// More than a gripper.
#[derive(Debug, clap::Subcommand)]
enum Whole {
    /// Emulate a hand with cameras, gripper and wrist around a simulated object, in real time
    Hand(Hand),
}

/// Lines of standard input, read on a thread of their own. None are read unless requested.
fn lines_of_stdin(is_asked: bool) -> Receiver<String> {
    let (hand_over, lines) = channel();
    if is_asked {
        thread::spawn(move || {
            let mut read = stdin().lock().lines().map_while(Result::ok);
            while read.next().is_some_and(|line| hand_over.send(line).is_ok()) {}
        });
    }
    lines
}

/// Injects the faults requested on standard input; reports a line that names none.
fn inject_asked(lines: &Receiver<String>, emulator: &mut Emulator) {
    for line in lines.try_iter() {
        if let Err(e) = emulator.fail_further(line.trim()) {
            complain(&anyhow::Error::new(e).context("standard input"), 0);
        }
    }
}

/// The available faults, as a table.
fn fault_help() -> String {
    let rows = faults::WORDS.iter().map(|(word, what)| format!("  {word:<18} {what}"));
    let rows: Vec<String> = rows.collect();
    format!("Faults (MS counts from the start):\n{}", rows.join("\n"))
}

impl Emulate {
    /// Serves until Ctrl-C.
    pub fn run(&self) -> Result<Outcome, Failure> {
        if let Some(Whole::Hand(hand)) = &self.whole {
            return hand.run();
        }
        let name = self.name.as_deref().unwrap_or_default();
        if !(0.0..=1000.0).contains(&self.width) {
            return Err(Failure::Arguments(anyhow::anyhow!("--width: expected 0 to 1000 mm, got {}", self.width)));
        }
        if !(0.0..=1000.0).contains(&self.weight) || !(0.01..=10.0).contains(&self.mu) {
            let (weight, mu) = (self.weight, self.mu);
            return Err(Failure::Arguments(anyhow::anyhow!(
                "expected --weight from 0 to 1000 N and --mu from 0.01 to 10, got {weight} and {mu}"
            )));
        }
        if let (Some(port), "robotiq-rtu") = (self.port, name) {
            let expected = "expected none for robotiq-rtu, which makes a serial device of its own";
            return Err(Failure::Arguments(anyhow::anyhow!("--port: {expected}, got {port}")));
        }
        if let (Some(log), false) = (&self.log, self.force) {
            inputs::refuse_foreign("--log", log)?;
        }
        let interrupted = interruption::listen()?;
        let emulator = by_name(name).ok_or_else(|| anyhow::anyhow!("no emulator is called {name}"))?;
        let mut emulator = emulator.with_faults(self.fail.clone());
        let width_mm = (self.width > 0.0).then_some(self.width);
        let block = Block { width_mm, least_n: self.weight / (2.0 * self.mu), ..Block::default() };
        let create = |path: &PathBuf| {
            LineFile::create(path).map_err(|e| Failure::work(format!("{}: cannot write", path.display()), e))
        };
        let log = self.log.as_ref().map(create).transpose()?;
        let mut block = LoggedBlock::new(block, log, time_of_day_ns().saturating_sub(now_ns()));
        let lines = lines_of_stdin(self.fail_stdin);
        let mut go_on = |emulator: &mut Emulator| {
            inject_asked(&lines, emulator);
            !interrupted.load(Ordering::Relaxed)
        };
        match name {
            "robotiq-rtu" => serve_serial(&mut emulator, &mut block, &mut go_on)?,
            _ => self.serve_tcp(name, &mut emulator, &mut block, &mut go_on)?,
        }
        let (force_n, opening_mm) = (emulator.force_n(), emulator.opening_mm());
        let what = match (block.block.is_carried, block.block.width_mm) {
            (true, _) => "the block is held",
            (false, Some(_)) => "the block is not held",
            (false, None) if self.width > 0.0 => "the block has fallen",
            (false, None) => "no block",
        };
        let mut terminal = Terminal::plain();
        terminal.say(&format!("at the end: {force_n:.2} N per finger, opening {opening_mm:.2} mm, {what}"))?;
        let (Some((count, first)), Some(log)) = (block.failed_lines(), &self.log) else { return Ok(Outcome::Done) };
        let log = log.display();
        terminal.note(&format!("--log: {log}: {count} lines could not be written, the first: {first}"));
        Ok(Outcome::DataLost)
    }

    fn serve_tcp(
        &self,
        name: &str,
        emulator: &mut Emulator,
        block: &mut LoggedBlock<LineFile>,
        go_on: &mut dyn FnMut(&mut Emulator) -> bool,
    ) -> Result<(), Failure> {
        let port = self.port.unwrap_or(0);
        let bound = TcpListener::bind((self.listen, port));
        let listener = bound.map_err(|e| Failure::work(format!("cannot listen at {}:{port}", self.listen), e))?;
        let address = listener.local_addr().map_err(|e| Failure::work("cannot listen", e))?;
        Terminal::plain().say(&format!("{name}://{address}"))?;
        serve_tcp(listener, emulator, block, go_on).map_err(|e| Failure::work("cannot serve", e))
    }
}

#[cfg(not(target_os = "linux"))]
fn serve_serial(
    _: &mut Emulator,
    _: &mut LoggedBlock<LineFile>,
    _: &mut dyn FnMut(&mut Emulator) -> bool,
) -> Result<(), Failure> {
    Err(Failure::Arguments(anyhow::anyhow!("robotiq-rtu: expected Linux, whose pseudo-terminals have names")))
}

#[cfg(target_os = "linux")]
fn serve_serial(
    emulator: &mut Emulator,
    block: &mut LoggedBlock<LineFile>,
    go_on: &mut dyn FnMut(&mut Emulator) -> bool,
) -> Result<(), Failure> {
    use slipbound_rig::emulator::serve_link;
    use slipbound_rig::link::PseudoTerminal;
    let mut terminal = PseudoTerminal::new().map_err(|e| Failure::work("cannot make a serial device", e))?;
    Terminal::plain().say(&format!("robotiq://{}", terminal.device.display()))?;
    while go_on(emulator) {
        serve_link(&mut terminal.link, emulator, block, &mut *go_on).map_err(|e| Failure::work("cannot serve", e))?;
    }
    Ok(())
}
