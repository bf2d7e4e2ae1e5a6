//! The protocol of a sweep by the arguments of `slipbound eval`: names and options -> trials, and who judges them.

use crate::outcome::Failure;
use anyhow::anyhow;
use clap::builder::PossibleValuesParser;
use slipbound::monitor::EstimateTrees;
use slipbound::sensor::Sensor;
use slipbound_lab::eval::clips::Clips;
use slipbound_lab::eval::folder::TRIALS_MOST;
use slipbound_lab::eval::lifts::Lifts;
use slipbound_lab::eval::ramps::{RampChanges, Ramps};
use slipbound_lab::eval::shard::Shard;
use slipbound_lab::eval::wriggles::Wriggles;
use slipbound_lab::eval::{Protocol, RECORDED, SIMULATED, simulated};
use slipbound_lab::fit::kept;
use slipbound_lab::rivals::{DETECTORS, Entry, named};
use slipbound_rig::{sensors, source};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// In place of a protocol: joins folders.
pub(super) const MERGE: &str = "merge";

/// The arguments that say which trials are judged, and by whom.
#[derive(Debug, clap::Args)]
pub(super) struct ProtocolArgs {
    /// The protocol, or `merge` to join the folders of shards
    #[arg(value_parser = PossibleValuesParser::new(judging().into_iter().chain([MERGE])))]
    pub(super) protocol: String,
    /// Seed of the simulated trials [default: 0]
    #[arg(long)]
    pub(super) seed: Option<u64>,
    /// Judge with these detectors alone, by commas or several times [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = DETECTORS.map(|entry| entry.name))]
    detector: Vec<String>,
    /// How many trials instead of the protocol's own number; a different number is another sweep
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=TRIALS_MOST))]
    pub(super) trials: Option<u64>,
    /// Only a part of the trials: the Ith of N
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub(super) shard: Option<Shard>,
    /// Trials at a time [default: as many as there are cores]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// With `lifts` and `wriggles`: the folder with clips and labels.csv [default: gelsight-lift or gelsight-mini-wriggle in
    /// SLIPBOUND_DATA, else in ../shared/data]
    #[arg(long, value_name = "FOLDER")]
    data: Option<PathBuf>,
    /// With `lifts`: fit our scale for each object to the clips of all other objects
    #[arg(long)]
    pub(super) refit: bool,
    /// With `ramps`: judge each object by the trees of FOLDER/OBJECT.txt, fitted without it (`fit_estimates --without`)
    #[arg(long, value_name = "FOLDER")]
    pub(super) left_out: Option<PathBuf>,
    /// With `ramps`: how long every ramp takes until the load would make the object slide, 0.05 to 120 s [default: every
    /// second one 1 s, the others 0.4 to 2 s]
    #[arg(long, value_name = "SECONDS", value_parser = ramp_s)]
    pub(super) ramp_s: Option<f64>,
    /// With `ramps`: frames per second of the camera, 10 to 120 [default: 30]
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u64).range(10..=120))]
    pub(super) rate_hz: Option<u64>,
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

/// Reads a duration within the range of the scene `ramp`.
fn ramp_s(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (0.05..=120.0).contains(seconds));
    seconds.ok_or_else(|| format!("expected 0.05 to 120 s, got {text}"))
}

/// Refuses an option that is given with another protocol than those it is made for.
fn refuse_elsewhere(option: &str, is_given: bool, of: &[&str], protocol: &str) -> Result<(), Failure> {
    if !is_given || of.contains(&protocol) {
        return Ok(());
    }
    let mut of: Vec<String> = of.iter().map(|name| format!("`{name}`")).collect();
    let last = of.pop().unwrap_or_default();
    let of = if of.is_empty() { last } else { format!("{} and {last}", of.join(", ")) };
    Err(Failure::Arguments(anyhow!("{option}: expected with {of} only, got {protocol}")))
}

impl ProtocolArgs {
    /// Refuses options that mean nothing to this protocol.
    pub(super) fn refuse_without_effect(&self) -> Result<(), Failure> {
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

    /// How the ramps that are asked for differ from the drawn ones.
    pub(super) fn changes(&self) -> RampChanges {
        RampChanges { ramp_s: self.ramp_s, rate_hz: self.rate_hz }
    }

    /// A protocol with these options, which may be that of a sweep instead of the one that was asked for. `stop` ends the
    /// first look at all clips.
    pub(super) fn protocol_of(
        &self,
        name: &str,
        seed: u64,
        trials: Option<u64>,
        refit: bool,
        changes: RampChanges,
        stop: &Arc<AtomicBool>,
    ) -> Result<Box<dyn Protocol>, Failure> {
        for (option, is_given, of) in [
            ("--refit", self.refit, &[Lifts::NAME][..]),
            ("--data", self.data.is_some(), &RECORDED),
            ("--left-out", self.left_out.is_some(), &[Ramps::NAME]),
            ("--ramp-s", self.ramp_s.is_some(), &[Ramps::NAME]),
            ("--rate-hz", self.rate_hz.is_some(), &[Ramps::NAME]),
        ] {
            refuse_elsewhere(option, is_given, of, name)?;
        }
        match name {
            Lifts::NAME => {
                let clips = self.clips("gelsight-lift")?.until(stop.clone());
                Ok(Box::new(Lifts::new(clips, finger("gelsight")?, refit)))
            }
            Wriggles::NAME => {
                let clips = self.clips("gelsight-mini-wriggle")?.until(stop.clone());
                Ok(Box::new(Wriggles::new(clips, finger("gelsight_mini_near")?, self.jobs())))
            }
            Ramps::NAME => {
                let ramps = Ramps::new(seed, trials).changed(changes);
                Ok(Box::new(if self.left_out.is_some() { self.left_out(ramps)? } else { ramps }))
            }
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
                    return Err(Failure::Arguments(anyhow!(
                        "{object}.txt: expected trees of {lesson} fitted without {object}, for the detector {}, got those of {other}.txt",
                        entry.name
                    )));
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
            return Err(Failure::Arguments(anyhow!(
                "{}: expected a whole table of trees, as fit_estimates writes it, got none",
                path.display()
            )));
        };
        Ok((text, trees))
    }

    /// The clips of `--data`, or of a folder of the recordings.
    fn clips(&self, name: &str) -> Result<Clips, Failure> {
        let folder = self.data.clone().unwrap_or_else(|| {
            let recordings = std::env::var_os("SLIPBOUND_DATA").map_or_else(|| "../shared/data".into(), PathBuf::from);
            recordings.join(name)
        });
        if matches!(folder.try_exists(), Ok(false)) {
            let advice = if self.data.is_some() { "" } else { "; `--data FOLDER` names yours" };
            let folder = folder.display();
            return Err(Failure::Arguments(anyhow!("{folder}: expected a folder of clips, got none{advice}")));
        }
        Clips::open(&folder, |uri| Ok(source::open(uri)?)).map_err(Failure::arguments)
    }

    /// How many trials are judged at a time.
    pub(super) fn jobs(&self) -> usize {
        self.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
    }

    /// The detectors that judge: those asked for, else all that the protocol can have.
    pub(super) fn detectors(&self) -> Result<Vec<&'static Entry>, Failure> {
        let recorded = RECORDED.contains(&self.protocol.as_str());
        if self.detector.is_empty() {
            return Ok(DETECTORS.iter().filter(|entry| !(recorded && entry.needs_force())).collect());
        }
        let of_name = |name: &String| {
            let entry = named(name).map_err(Failure::arguments)?;
            if recorded && entry.needs_force() {
                return Err(Failure::Arguments(anyhow!(
                    "--detector {name}: it reads the grip force, which the clips of {} do not have",
                    self.protocol
                )));
            }
            Ok(entry)
        };
        if let Some((_, twice)) = self.detector.iter().enumerate().find(|(n, name)| self.detector[..*n].contains(name))
        {
            return Err(Failure::Arguments(anyhow!("--detector {twice}: expected each detector once, got it twice")));
        }
        self.detector.iter().map(of_name).collect()
    }
}
