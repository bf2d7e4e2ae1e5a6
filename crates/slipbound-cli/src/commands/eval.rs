//! `slipbound eval`: trials judged by every detector, as records, tables and a page.

mod page;
mod pictures;

use super::inputs;
use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use clap::builder::PossibleValuesParser;
use slipbound::monitor::EstimateTrees;
use slipbound::sensor::Sensor;
use slipbound_lab::eval::clips::Clips;
use slipbound_lab::eval::folder::{Shard, SweepFolder};
use slipbound_lab::eval::lifts::Lifts;
use slipbound_lab::eval::ramps::Ramps;
use slipbound_lab::eval::wriggles::Wriggles;
use slipbound_lab::eval::{Protocol, RECORDED, SIMULATED, Sweep, SweepError, TrialRecord, simulated, table};
use slipbound_lab::fit::kept;
use slipbound_lab::rivals::{DETECTORS, Entry, named};
use slipbound_rig::{sensors, source};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// In place of a protocol: joins folders.
const MERGE: &str = "merge";
/// Largest number of trials of a sweep.
const TRIALS_MOST: u64 = 10_000_000;

/// The arguments of `slipbound eval`.
#[derive(Debug, clap::Args)]
pub struct Eval {
    /// The protocol, or `merge` to join the folders of shards
    #[arg(value_parser = PossibleValuesParser::new(judging().into_iter().chain([MERGE])))]
    protocol: String,
    /// With `merge`: the folders of all shards
    #[arg(value_name = "FOLDER")]
    folders: Vec<PathBuf>,
    /// Seed of the simulated trials [default: 0]
    #[arg(long)]
    seed: Option<u64>,
    /// Judge with these detectors alone, by commas or several times [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = DETECTORS.map(|entry| entry.name))]
    detector: Vec<String>,
    /// How many trials instead of the protocol's own number; a different number is another sweep
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=TRIALS_MOST))]
    trials: Option<u64>,
    /// Only a part of the trials: the Ith of N
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<Shard>,
    /// Trials at a time [default: as many as there are cores]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// With `lifts` and `wriggles`: the folder with clips and labels.csv [default: gelsight-lift or gelsight-mini-wriggle in
    /// SLIPBOUND_DATA, else in ../shared/data]
    #[arg(long, value_name = "FOLDER")]
    data: Option<PathBuf>,
    /// With `lifts`: fit our scale for each object to the clips of all other objects
    #[arg(long)]
    refit: bool,
    /// With `ramps`: judge each object by the trees of FOLDER/OBJECT.txt, fitted without it (`fit_estimates --without`)
    #[arg(long, value_name = "FOLDER")]
    left_out: Option<PathBuf>,
    /// Pictures of the worst failures on the page; each runs its trial again
    #[arg(long, value_name = "N", default_value_t = 6)]
    pictures: usize,
    /// The folder to write to: new, or one of the same sweep, which goes on [default: eval-PROTOCOL]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

/// Names of the protocols that simulate their trials.
fn simulating() -> Vec<&'static str> {
    SIMULATED.iter().map(|protocol| protocol.name).collect()
}

/// Names of the protocols: those that simulate their trials, then those that judge clips.
fn judging() -> Vec<&'static str> {
    simulating().into_iter().chain(RECORDED).collect()
}

fn finger(name: &str) -> Result<Sensor, Failure> {
    sensors::load(name).map_err(Failure::arguments)
}

/// Reads `2/8`.
fn shard(text: &str) -> Result<Shard, String> {
    let numbers = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
    match numbers {
        Some((number, of)) if (1..=of).contains(&number) => Ok(Shard { number, of }),
        _ => Err(format!("expected I/N with I from 1 to N, as 2/8, got {text}")),
    }
}

/// Refuses an option that is given with another protocol than those it is made for.
fn refuse_elsewhere(option: &str, is_given: bool, of: &[&str], protocol: &str) -> Result<(), Failure> {
    if !is_given || of.contains(&protocol) {
        return Ok(());
    }
    let mut of: Vec<String> = of.iter().map(|name| format!("`{name}`")).collect();
    let last = of.pop().unwrap_or_default();
    let of = if of.is_empty() { last } else { format!("{} and {last}", of.join(", ")) };
    Err(Failure::Arguments(anyhow::Error::msg(format!("{option}: expected with {of} only, got {protocol}"))))
}

/// Fails where nothing could be judged.
fn refuse_unjudged(protocol: &dyn Protocol, records: &[TrialRecord]) -> Result<(), Failure> {
    let first = records.first().and_then(|record| Some((&record.trial, record.unjudged()?)));
    match first.filter(|_| records.iter().all(|record| record.unjudged().is_some())) {
        None => Ok(()),
        Some((trial, problem)) => {
            let what = format!("{}: expected trials that can be judged, got none", protocol.name());
            Err(Failure::Work(anyhow::Error::msg(format!("{what}; the first: {trial}: {problem}"))))
        }
    }
}

impl Eval {
    /// Runs the missing trials, then writes tables and page.
    pub fn run(&self) -> Result<Outcome, Failure> {
        self.refuse_without_effect()?;
        self.output.as_deref().map_or(Ok(()), inputs::refuse_stdout_folder)?;
        if self.protocol == MERGE {
            return self.merge();
        }
        if let Some(folder) = self.folders.first() {
            let text = format!("{}: expected folders with `merge` only, got {}", self.protocol, folder.display());
            return Err(Failure::Arguments(anyhow::Error::msg(text)));
        }
        let seed = self.seed.unwrap_or(0);
        let protocol = self.protocol_of(&self.protocol, seed, self.trials, self.refit)?;
        if let Some(trials) = self.trials.filter(|&trials| trials > protocol.trials_count()) {
            let what = format!(
                "--trials: expected at most the {} of {}, got {trials}",
                protocol.trials_count(),
                self.protocol
            );
            return Err(Failure::Arguments(anyhow::Error::msg(what)));
        }
        let detectors = self.detectors()?;
        let sweep = Sweep::new(&*protocol, seed).map_err(|error| Failure::Work(error.into()))?;
        let names: Vec<&str> = detectors.iter().map(|entry| entry.name).collect();
        let path = self.output.clone().unwrap_or_else(|| format!("eval-{}", self.protocol).into());
        let mut folder = SweepFolder::open(&path, &sweep, &names, self.shard.unwrap_or(Shard::WHOLE))?;
        self.judge(&*protocol, &detectors, &mut folder)?;
        self.finish(&*protocol, &folder)
    }

    /// Refuses options that mean nothing to this protocol.
    fn refuse_without_effect(&self) -> Result<(), Failure> {
        let (simulating, judging) = (simulating(), judging());
        for (option, is_given, of) in [
            ("--seed", self.seed.is_some(), &simulating),
            ("--trials", self.trials.is_some(), &simulating),
            ("--detector", !self.detector.is_empty(), &judging),
            ("--shard", self.shard.is_some(), &judging),
            ("--jobs", self.jobs.is_some(), &judging),
        ] {
            refuse_elsewhere(option, is_given, of, &self.protocol)?;
        }
        Ok(())
    }

    fn protocol_of(
        &self,
        name: &str,
        seed: u64,
        trials: Option<u64>,
        refit: bool,
    ) -> Result<Box<dyn Protocol>, Failure> {
        for (option, is_given, of) in [
            ("--refit", self.refit, &[Lifts::NAME][..]),
            ("--data", self.data.is_some(), &RECORDED),
            ("--left-out", self.left_out.is_some(), &[Ramps::NAME]),
        ] {
            refuse_elsewhere(option, is_given, of, name)?;
        }
        match name {
            Lifts::NAME => Ok(Box::new(Lifts::new(self.clips("gelsight-lift")?, finger("gelsight")?, refit))),
            Wriggles::NAME => {
                let clips = self.clips("gelsight-mini-wriggle")?;
                Ok(Box::new(Wriggles::new(clips, finger("gelsight_mini_near")?, self.jobs())))
            }
            Ramps::NAME if self.left_out.is_some() => Ok(Box::new(self.left_out(Ramps::new(seed, trials))?)),
            _ => simulated(name, seed, trials).map_err(Failure::arguments),
        }
    }

    /// Each object judged by its trees of `--left-out`. If a detector that uses frames alone is requested, its trees
    /// must be fitted without the object, too: trees kept from another table are the same in all of them.
    fn left_out(&self, ramps: Ramps) -> Result<Ramps, Failure> {
        let is_alone = |entry: &&Entry| entry.is_ours() && !entry.inputs.has_force();
        let alone = (self.protocol != MERGE).then(|| self.detectors()).transpose()?;
        let alone = alone.and_then(|detectors| detectors.into_iter().find(is_alone));
        let mut known: Vec<(String, &str)> = Vec::new();
        ramps.left_out(|object| {
            let (text, trees) = self.trees_without(object)?;
            for lesson in ["alone_used", "alone_stick"] {
                let (Some(entry), Some(own)) = (alone, kept(&text, lesson)) else { continue };
                if let Some((_, other)) = known.iter().find(|(trees, _)| *trees == own) {
                    let what = format!(
                        "{object}.txt: expected trees of {lesson} fitted without {object}, for the detector {}, got those of {other}.txt",
                        entry.name
                    );
                    return Err(Failure::Arguments(anyhow::Error::msg(what)));
                }
                known.push((own, object));
            }
            Ok((text, trees))
        })
    }

    /// The table of `--left-out` for an object, and the trees in it.
    fn trees_without(&self, object: &str) -> Result<(String, EstimateTrees), Failure> {
        let path = self.left_out.as_deref().unwrap_or_else(|| Path::new(".")).join(format!("{object}.txt"));
        let text = fs::read_to_string(&path)
            .map_err(|error| Failure::Arguments(anyhow::Error::new(error).context(path.display().to_string())))?;
        let Some(trees) = EstimateTrees::parse(&text) else {
            let what =
                format!("{}: expected a whole table of trees, as fit_estimates writes it, got none", path.display());
            return Err(Failure::Arguments(anyhow::Error::msg(what)));
        };
        Ok((text, trees))
    }

    /// The clips of `--data`, or of a folder of the recordings.
    fn clips(&self, name: &str) -> Result<Clips, Failure> {
        let folder = self.data.clone().unwrap_or_else(|| {
            let recordings = std::env::var_os("SLIPBOUND_DATA").map_or_else(|| "../shared/data".into(), PathBuf::from);
            recordings.join(name)
        });
        Clips::open(&folder, |uri| Ok(source::open(uri)?)).map_err(Failure::arguments)
    }

    fn jobs(&self) -> usize {
        self.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
    }

    fn detectors(&self) -> Result<Vec<&'static Entry>, Failure> {
        let recorded = RECORDED.contains(&self.protocol.as_str());
        if self.detector.is_empty() {
            return Ok(DETECTORS.iter().filter(|entry| !(recorded && entry.needs_force())).collect());
        }
        let of_name = |name: &String| {
            let entry = named(name).map_err(Failure::arguments)?;
            if recorded && entry.needs_force() {
                let what = format!(
                    "--detector {name}: it reads the grip force, which the clips of {} do not have",
                    self.protocol
                );
                return Err(Failure::Arguments(anyhow::Error::msg(what)));
            }
            Ok(entry)
        };
        if let Some((_, twice)) = self.detector.iter().enumerate().find(|(n, name)| self.detector[..*n].contains(name))
        {
            let what = format!("--detector {twice}: expected each detector once, got it twice");
            return Err(Failure::Arguments(anyhow::Error::msg(what)));
        }
        self.detector.iter().map(of_name).collect()
    }

    /// Judges the trials that are missing from the folder.
    fn judge(
        &self,
        protocol: &dyn Protocol,
        detectors: &[&'static Entry],
        folder: &mut SweepFolder,
    ) -> Result<(), Failure> {
        let missing = folder.missing();
        if missing.is_empty() {
            return Ok(());
        }
        let jobs = self.jobs();
        let stop = interruption::listen()?;
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
            Failure::Arguments(anyhow::Error::msg("merge: expected -o FOLDER, a new folder for all of it, got none"))
        })?;
        let first = self.folders.first().ok_or_else(|| {
            Failure::Arguments(anyhow::Error::msg("merge: expected the folders of all shards, got none"))
        })?;
        let protocol = self.protocol_again(&SweepFolder::sweep_of(first)?)?;
        let folder = SweepFolder::merge(&self.folders, &into)?;
        self.finish(&*protocol, &folder)
    }

    /// The protocol of a sweep, from its settings; refuses options and files that contradict them.
    fn protocol_again(&self, sweep: &Sweep) -> Result<Box<dyn Protocol>, Failure> {
        let refuse = |text: String| Err(Failure::Arguments(anyhow::Error::msg(text)));
        let refit = sweep.settings.get("refit").is_some_and(|refit| refit == "true");
        if self.refit && !refit {
            return refuse("merge --refit: expected folders of `lifts --refit`, got folders of another sweep".into());
        }
        let is_left_out = sweep.settings.contains_key("estimates");
        if self.left_out.is_some() && !is_left_out {
            return refuse(
                "merge --left-out: expected folders of `ramps --left-out`, got folders of another sweep".into(),
            );
        }
        if is_left_out && self.left_out.is_none() && self.pictures > 0 {
            let what = "merge: expected --left-out FOLDER, whose trees the pictures are drawn with, or --pictures 0, got neither";
            return refuse(what.into());
        }
        let protocol = self.protocol_of(&sweep.protocol, sweep.seed, Some(sweep.trials_count), refit)?;
        for (key, now) in protocol.settings() {
            if let Some(then) = sweep.settings.get(&key).filter(|then| **then != now) {
                return refuse(format!("merge: {key}: expected that of the sweep, {then}, got {now}"));
            }
        }
        Ok(protocol)
    }

    /// Writes tables and page, and prints the first table.
    fn finish(&self, protocol: &dyn Protocol, folder: &SweepFolder) -> Result<Outcome, Failure> {
        refuse_unjudged(protocol, folder.records())?;
        let tables = protocol.tables(folder.records());
        let json = serde_json::to_string_pretty(&table::json(folder.sweep(), &tables));
        let json = json.map_err(|error| Failure::work("table.json", error))?;
        folder.write("table.md", table::markdown(folder.sweep(), &tables).as_bytes())?;
        folder.write("table.json", (json + "\n").as_bytes())?;
        let pictures = pictures::of_worst(protocol, folder.records(), self.pictures)?;
        let page = page::of(folder.sweep(), folder.records(), &tables, pictures, self.pictures);
        folder.write("report.html", page.to_string().as_bytes())?;
        let mut terminal = Terminal::plain();
        for table in tables.iter().take(1) {
            terminal.say(&table.markdown())?;
        }
        terminal.say(&format!("report: {}", folder.path().join("report.html").display()))?;
        Ok(Outcome::Done)
    }
}
