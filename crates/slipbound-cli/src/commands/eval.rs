//! `slipbound eval`: trials judged by every detector, as records, tables and a page.

pub(super) mod page;
mod pictures;
mod protocol_args;

use super::inputs;
use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::anyhow;
use protocol_args::{MERGE, ProtocolArgs};
use slipbound_lab::eval::folder::SweepFolder;
use slipbound_lab::eval::ramps::{RAMP_S, RATE_HZ, RampChanges};
use slipbound_lab::eval::shard::Shard;
use slipbound_lab::eval::{Protocol, Sweep, SweepError, TrialRecord, table};
use slipbound_lab::rivals::Entry;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The arguments of `slipbound eval`.
#[derive(Debug, clap::Args)]
pub struct Eval {
    #[command(flatten)]
    asked: ProtocolArgs,
    /// With `merge`: the folders of all shards
    #[arg(value_name = "FOLDER")]
    folders: Vec<PathBuf>,
    /// Pictures of the worst failures on the page; each runs its trial again
    #[arg(long, value_name = "N", default_value_t = 6)]
    pictures: usize,
    /// The folder to write to: new, or one of the same sweep, which goes on [default: eval-PROTOCOL]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

/// Fails where nothing could be judged.
fn refuse_unjudged(protocol: &dyn Protocol, records: &[TrialRecord]) -> Result<(), Failure> {
    let first = records.first().and_then(|record| Some((&record.trial, record.unjudged()?)));
    match first.filter(|_| records.iter().all(|record| record.unjudged().is_some())) {
        None => Ok(()),
        Some((trial, problem)) => {
            let what = format!("{}: expected trials that can be judged, got none", protocol.name());
            Err(Failure::Work(anyhow!("{what}; the first: {trial}: {problem}")))
        }
    }
}

impl Eval {
    /// Runs the missing trials, then writes tables and page.
    pub fn run(&self) -> Result<Outcome, Failure> {
        self.asked.refuse_without_effect()?;
        self.output.as_deref().map_or(Ok(()), inputs::refuse_stdout_folder)?;
        let name = &self.asked.protocol;
        if name == MERGE {
            return self.merge();
        }
        if let Some(folder) = self.folders.first() {
            let got = folder.display();
            return Err(Failure::Arguments(anyhow!("{name}: expected folders with `merge` only, got {got}")));
        }
        let seed = self.asked.seed.unwrap_or(0);
        let (asked, stop) = (&self.asked, Arc::default());
        let protocol = asked.protocol_of(name, seed, asked.trials, asked.refit, asked.changes(), &stop)?;
        let most = protocol.trials_count();
        if let Some(trials) = self.asked.trials.filter(|&trials| trials > most) {
            return Err(Failure::Arguments(anyhow!("--trials: expected at most the {most} of {name}, got {trials}")));
        }
        let detectors = self.asked.detectors()?;
        let sweep = Sweep::new(&*protocol, seed).map_err(|error| Failure::Work(error.into()))?;
        let names: Vec<&str> = detectors.iter().map(|entry| entry.name).collect();
        let path = self.output.clone().unwrap_or_else(|| format!("eval-{name}").into());
        let mut folder = SweepFolder::open(&path, &sweep, &names, self.asked.shard.unwrap_or(Shard::WHOLE))?;
        self.judge(&*protocol, &detectors, &mut folder, &stop)?;
        self.finish(&*protocol, &folder, &stop)
    }

    /// Judges the trials that are missing from the folder.
    fn judge(
        &self,
        protocol: &dyn Protocol,
        detectors: &[&'static Entry],
        folder: &mut SweepFolder,
        stop: &Arc<AtomicBool>,
    ) -> Result<(), Failure> {
        let missing = folder.missing();
        if missing.is_empty() {
            return Ok(());
        }
        let jobs = self.asked.jobs();
        interruption::listen_with(stop)?;
        let terminal = Terminal::with_bar_of(missing.len() as u64, "trials");
        let mut keep = |records: Vec<TrialRecord>| {
            folder.keep(records)?;
            terminal.advance();
            Ok(())
        };
        let stopped = || stop.load(Ordering::Relaxed);
        let ran = slipbound_lab::eval::run(protocol, detectors, &missing, jobs, &stopped, &mut keep);
        terminal.clear_bar();
        ran.map_err(|error: SweepError| Failure::Work(error.into()))
    }

    /// Joins shards into one folder.
    fn merge(&self) -> Result<Outcome, Failure> {
        let into = self.output.clone().ok_or_else(|| {
            Failure::Arguments(anyhow!("merge: expected -o FOLDER, a new folder for all of it, got none"))
        })?;
        let first = self
            .folders
            .first()
            .ok_or_else(|| Failure::Arguments(anyhow!("merge: expected the folders of all shards, got none")))?;
        let protocol = self.protocol_again(&SweepFolder::sweep_of(first)?)?;
        let folder = SweepFolder::merge(&self.folders, &into)?;
        self.finish(&*protocol, &folder, &AtomicBool::new(false))
    }

    /// The protocol of a sweep, from its settings; refuses options and files that contradict them.
    fn protocol_again(&self, sweep: &Sweep) -> Result<Box<dyn Protocol>, Failure> {
        let refuse = |refused: anyhow::Error| Err(Failure::Arguments(refused));
        let asked = &self.asked;
        let refit = sweep.settings.get("refit").is_some_and(|refit| refit == "true");
        if asked.refit && !refit {
            return refuse(anyhow!("merge --refit: expected folders of `lifts --refit`, got folders of another sweep"));
        }
        let is_left_out = sweep.settings.contains_key("estimates");
        if asked.left_out.is_some() && !is_left_out {
            return refuse(anyhow!(
                "merge --left-out: expected folders of `ramps --left-out`, got folders of another sweep"
            ));
        }
        if is_left_out && asked.left_out.is_none() && self.pictures > 0 {
            return refuse(anyhow!(
                "merge: expected --left-out FOLDER, whose trees the pictures are drawn with, or --pictures 0, got neither"
            ));
        }
        let changes = RampChanges {
            ramp_s: sweep.settings.get(RAMP_S).and_then(|ramp_s| ramp_s.parse().ok()),
            rate_hz: sweep.settings.get(RATE_HZ).and_then(|rate_hz| rate_hz.parse().ok()),
        };
        if let Some(other) = asked.ramp_s.filter(|asked| Some(*asked) != changes.ramp_s) {
            return refuse(anyhow!("merge --ramp-s: expected that of the sweep or none, got {other}"));
        }
        if let Some(other) = asked.rate_hz.filter(|asked| Some(*asked) != changes.rate_hz) {
            return refuse(anyhow!("merge --rate-hz: expected that of the sweep or none, got {other}"));
        }
        let protocol = asked.protocol_of(
            &sweep.protocol,
            sweep.seed,
            Some(sweep.trials_count),
            refit,
            changes,
            &Arc::default(),
        )?;
        // Tables and pictures are those of this program: another one says something else of the same records.
        let now = Sweep::new(&*protocol, sweep.seed).map_err(|error| Failure::Work(error.into()))?;
        if now.software_version != sweep.software_version {
            let (then, now) = (&sweep.software_version, now.software_version);
            return refuse(anyhow!("merge: software_version: expected that of the sweep, {then}, got {now}"));
        }
        for (key, now) in now.settings {
            if let Some(then) = sweep.settings.get(&key).filter(|then| **then != now) {
                return refuse(anyhow!("merge: {key}: expected that of the sweep, {then}, got {now}"));
            }
        }
        Ok(protocol)
    }

    /// Writes tables and page, and prints the first table.
    fn finish(&self, protocol: &dyn Protocol, folder: &SweepFolder, stop: &AtomicBool) -> Result<Outcome, Failure> {
        refuse_unjudged(protocol, folder.records())?;
        let tables = protocol.tables(folder.records());
        let (sweep, shard) = (folder.sweep(), folder.shard());
        let json = serde_json::to_string_pretty(&table::json(sweep, shard, &tables));
        let json = json.map_err(|error| Failure::work("table.json", error))?;
        folder.write("table.md", table::markdown(sweep, shard, &tables).as_bytes())?;
        folder.write("table.json", (json + "\n").as_bytes())?;
        let pictures = pictures::of_worst(protocol, folder.records(), self.pictures, stop)?;
        let page = page::of(sweep, folder.records(), &tables, pictures, self.pictures);
        folder.write("report.html", page.to_string().as_bytes())?;
        let mut terminal = Terminal::plain();
        for table in tables.iter().take(1) {
            terminal.say(&table.markdown())?;
        }
        terminal.say(&format!("report: {}", folder.path().join("report.html").display()))?;
        Ok(Outcome::Done)
    }
}
