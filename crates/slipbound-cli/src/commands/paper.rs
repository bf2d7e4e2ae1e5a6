//! `slipbound paper`: the figures and tables of the paper from our own frames, on one page.
//!
//! ```text
//!   steps of the method   one simulated frame, step by step
//!   Table I               `slipbound eval table1`, beside the published numbers
//!   what fails            the two objects that the paper's rule misses most
//!   tasks                 screwing, unscrewing, laying a tool down
//! ```

mod steps;
mod tasks;

use super::eval::page::table_parts;
use super::inputs;
use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::anyhow;
use slipbound_lab::eval::folder::{self, SweepFolder};
use slipbound_lab::eval::shard::Shard;
use slipbound_lab::eval::{Protocol, Sweep, SweepError, simulated, table};
use slipbound_lab::rivals::{DETECTORS, Entry};
use slipbound_rig::html_page::{HtmlPage, Part};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// The arguments of `slipbound paper`.
#[derive(Debug, clap::Args)]
pub struct Paper {
    /// Seed of trials and tasks
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=1 << 53))]
    seed: u64,
    /// Trials of Table I instead of its 240 and the 80 at 50 N
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    trials: Option<u64>,
    /// Trials at a time [default: as many as there are cores]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// The folder to write to: new, or one of the same command, which goes on
    #[arg(short, long, value_name = "FOLDER", default_value = "paper")]
    output: PathBuf,
}

impl Paper {
    /// Makes every figure and table.
    pub fn run(&self) -> Result<Outcome, Failure> {
        inputs::refuse_stdout_folder(&self.output)?;
        let protocol: Box<dyn Protocol> = simulated("table1", self.seed, self.trials).map_err(Failure::arguments)?;
        let most = protocol.trials_count();
        if let Some(trials) = self.trials.filter(|&trials| trials > most) {
            return Err(Failure::Arguments(anyhow!("--trials: expected at most the {most} of table1, got {trials}")));
        }
        folder::refuse_used(&self.output, "table1/sweep.json", &["table1"])?;
        fs::create_dir_all(&self.output).map_err(|error| cannot_write(&self.output, error))?;
        let stop = interruption::listen()?;
        let mut parts = vec![Part::Heading("The steps of the method".into())];
        parts.extend(steps::method()?);
        parts.push(Part::Heading("Table I".into()));
        parts.extend(self.table1(&*protocol, &stop)?);
        parts.push(Part::Heading("The two objects that fail".into()));
        parts.extend(steps::failing()?);
        parts.push(Part::Heading("Tasks".into()));
        parts.extend(tasks::all(self.seed, &stop)?);
        let html_page = HtmlPage {
            above: "Slipbound".into(),
            title: "Maintaining grasps within slipping bound: the paper's figures and tables from our own frames"
                .into(),
            below: format!(
                "Everything here is simulated: seed {}, version {}. Published: Dong, Ma, Donlon and Rodriguez, ICRA 2019.",
                self.seed,
                env!("CARGO_PKG_VERSION")
            ),
            parts,
        };
        let page = self.output.join("paper.html");
        fs::write(&page, html_page.to_string()).map_err(|error| cannot_write(&page, error))?;
        Terminal::plain().say(&format!("page: {}", page.display()))?;
        Ok(Outcome::Done)
    }

    /// Table I in a folder of its own, with its missing trials.
    fn table1(&self, protocol: &dyn Protocol, stop: &AtomicBool) -> Result<Vec<Part>, Failure> {
        let detectors: Vec<&'static Entry> = DETECTORS.iter().collect();
        let sweep = Sweep::new(protocol, self.seed).map_err(|error| Failure::Work(error.into()))?;
        let names = DETECTORS.map(|entry| entry.name);
        let path = self.output.join("table1");
        let mut folder = SweepFolder::open(&path, &sweep, &names, Shard::WHOLE)?;
        let missing = folder.missing();
        let bar = Terminal::with_bar_of(missing.len() as u64, "trials");
        let jobs = self.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
        let ran = slipbound_lab::eval::run(
            protocol,
            &detectors,
            &missing,
            jobs,
            &|| stop.load(Ordering::Relaxed),
            &mut |records| {
                folder.keep(records)?;
                bar.advance();
                Ok(())
            },
        );
        bar.clear_bar();
        ran.map_err(|error: SweepError| Failure::Work(error.into()))?;
        let tables = protocol.tables(folder.records());
        folder.write("table.md", table::markdown(&sweep, folder.shard(), &tables).as_bytes())?;
        let mut parts = Vec::new();
        for table in tables.iter().take(3) {
            parts.push(Part::Text(format!("{}. {}", table.title, table.note)));
            parts.extend(table_parts(table));
        }
        Ok(parts)
    }
}

fn cannot_write(path: &Path, error: io::Error) -> Failure {
    Failure::work(format!("{}: cannot write", path.display()), error)
}
