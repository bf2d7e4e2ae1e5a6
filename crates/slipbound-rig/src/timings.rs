//! Time that each step of the monitor takes, measured through its [`Probe`]. The time of the whole loop: `realtime/latency.rs`.

use crate::line_file::LineFile;
use slipbound::monitor::{Probe, SlipMonitor, SlipReport, Step};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Measures the time that each step of a frame takes.
#[derive(Debug)]
pub struct Stopwatch {
    since: Instant,
    /// Steps in their order, and the time each took, us.
    steps_us: Vec<(Step, f64)>,
}

impl Stopwatch {
    /// A frame begins now.
    pub fn new() -> Self {
        Stopwatch { since: Instant::now(), steps_us: Vec::new() }
    }

    /// The next frame begins now.
    pub fn restart(&mut self) {
        self.steps_us.clear();
        self.since = Instant::now();
    }
}

impl Default for Stopwatch {
    fn default() -> Self {
        Stopwatch::new()
    }
}

impl Probe for Stopwatch {
    fn begin(&mut self) {
        self.restart();
    }

    fn after(&mut self, step: Step, _: &SlipMonitor) {
        let now = Instant::now();
        self.steps_us.push((step, (now - self.since).as_secs_f64() * 1e6));
        self.since = now;
    }
}

/// Writes one JSON object a frame: microseconds by step, and in all.
#[derive(Debug)]
pub struct Timings {
    path: PathBuf,
    to: LineFile,
}

impl Timings {
    /// Creates the file.
    pub fn create(path: &Path) -> io::Result<Self> {
        Ok(Timings { path: path.to_owned(), to: LineFile::create(path)? })
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the line of a frame.
    pub fn write(&mut self, report: &SlipReport, stopwatch: &Stopwatch) -> io::Result<()> {
        write!(self.to, "{{\"seq\":{}", report.seq)?;
        for (step, us) in &stopwatch.steps_us {
            write!(self.to, ",\"{}_us\":{us:.1}", step.name())?;
        }
        let all_us: f64 = stopwatch.steps_us.iter().map(|(_, us)| us).sum();
        writeln!(self.to, ",\"all_us\":{all_us:.1}}}")
    }
}
