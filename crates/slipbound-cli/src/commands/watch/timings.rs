//! How long each step takes. The only clock of the house that looks at the method.

use slipbound::monitor::{Probe, SlipMonitor, SlipReport, Step};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Notes the time after each step of a frame.
#[derive(Debug)]
pub struct Stopwatch {
    since: Instant,
    steps: Vec<(Step, f64)>,
}

impl Stopwatch {
    /// Running.
    pub fn new() -> Self {
        Stopwatch { since: Instant::now(), steps: Vec::new() }
    }

    /// A new frame begins now.
    pub fn restart(&mut self) {
        self.steps.clear();
        self.since = Instant::now();
    }
}

impl Probe for Stopwatch {
    fn after(&mut self, step: Step, _: &SlipMonitor) {
        let now = Instant::now();
        self.steps.push((step, (now - self.since).as_secs_f64() * 1e6));
        self.since = now;
    }
}

/// Writes one JSON object a frame: microseconds by step, and in all.
#[derive(Debug)]
pub struct Timings {
    path: PathBuf,
    to: BufWriter<File>,
}

impl Timings {
    /// Creates the file.
    pub fn create(path: &Path) -> io::Result<Self> {
        Ok(Timings { path: path.to_owned(), to: BufWriter::new(File::create(path)?) })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the line of a frame.
    pub fn write(&mut self, report: &SlipReport, watch: &Stopwatch) -> io::Result<()> {
        write!(self.to, "{{\"seq\":{}", report.seq)?;
        for (step, us) in &watch.steps {
            write!(self.to, ",\"{}_us\":{us:.1}", format!("{step:?}").to_lowercase())?;
        }
        let all_us: f64 = watch.steps.iter().map(|(_, us)| us).sum();
        writeln!(self.to, ",\"all_us\":{all_us:.1}}}")?;
        self.to.flush()
    }
}
