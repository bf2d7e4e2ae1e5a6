//! The tasks over friction, objects, seeds, controllers and fingers, on all cores, as a table.

use crate::clairvoyant::Clairvoyant;
use crate::hand::{HandScene, SimHand};
use crate::lockstep::{LockStep, LockStepError};
use crate::score::RunScore;
use slipbound::control::ControlError;
use slipbound::grip::Guard;
use slipbound::monitor::Settings;
use slipbound::setting::SettingError;
use slipbound::task::{ControllerKind, Ending, TaskKind, TaskSettings};
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The controller of the grip in a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Controls {
    /// A controller that uses the sensors.
    Feeling(ControllerKind),
    /// The one that knows load and friction from the simulation: [`Clairvoyant`].
    Clairvoyant,
}

/// Name of [`Controls::Clairvoyant`].
const CLAIRVOYANT: &str = "clairvoyant";

impl fmt::Display for Controls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Controls::Feeling(kind) => kind.fmt(f),
            Controls::Clairvoyant => f.write_str(CLAIRVOYANT),
        }
    }
}

impl FromStr for Controls {
    type Err = SettingError;

    fn from_str(name: &str) -> Result<Self, SettingError> {
        match name {
            CLAIRVOYANT => Ok(Controls::Clairvoyant),
            name => name.parse().map(Controls::Feeling).map_err(|error: SettingError| {
                let names: Vec<&str> = ControllerKind::NAMES.into_iter().chain([CLAIRVOYANT]).collect();
                SettingError::none_of(&error.key, name, &names)
            }),
        }
    }
}

/// The varied parameters: every combination is a cell of the table, every seed a run in it.
#[derive(Debug, Clone)]
pub struct TrialGrid {
    /// Tasks.
    pub tasks: Vec<TaskKind>,
    /// Objects, or `task` for the task's own object.
    pub objects: Vec<String>,
    /// Friction coefficients, or `object`.
    pub mu: Vec<String>,
    /// Controllers.
    pub controllers: Vec<Controls>,
    /// Fingers with a camera.
    pub fingers: Vec<u8>,
    /// The seeds.
    pub seeds: Range<u64>,
    /// Other parameters of every scene, `KEY=VALUE` each.
    pub parameters: Vec<String>,
}

/// A cell of the table: the same task and controller with several seeds.
#[derive(Debug, Clone)]
pub struct TrialCell {
    /// Object and friction, as named by the caller.
    names: [String; 2],
    task: TaskKind,
    controller: Controls,
    fingers: u8,
    /// The scene of the first seed; those of the others differ in the seed alone.
    first: HandScene,
    seeds: Range<u64>,
}

/// A run that failed: its scene, and why.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// A run could not be started or finished.
    #[error("{scene}: {source}")]
    Run {
        /// The scene.
        scene: String,
        /// Why.
        source: LockStepError,
    },
    /// The caller stopped the trials.
    #[error("interrupted")]
    Interrupted,
}

impl TrialGrid {
    /// The cells, in the order in which they are varied. Refuses invalid scenes.
    pub fn cells(&self) -> Result<Vec<TrialCell>, SettingError> {
        let mut cells = Vec::new();
        for &task in &self.tasks {
            for object in &self.objects {
                for mu in &self.mu {
                    for &controller in &self.controllers {
                        for &fingers in &self.fingers {
                            let scene = |seed| {
                                let mut text = format!("{task}?seed={seed}&fingers={fingers}&mu={mu}");
                                if object != "task" {
                                    text = format!("{text}&object={object}");
                                }
                                for parameter in &self.parameters {
                                    text = format!("{text}&{parameter}");
                                }
                                HandScene::parse(&text)
                            };
                            let seeds = self.seeds.clone();
                            let first = scene(seeds.start)?;
                            scene(seeds.end.saturating_sub(1).max(seeds.start))?; // the largest seed
                            let names = [object.clone(), mu.clone()];
                            cells.push(TrialCell { names, task, controller, fingers, first, seeds });
                        }
                    }
                }
            }
        }
        Ok(cells)
    }
}

impl TrialCell {
    /// Number of runs.
    pub fn runs_count(&self) -> usize {
        self.seeds.end.saturating_sub(self.seeds.start) as usize
    }

    /// The scene of each run, in the order of the seeds.
    pub fn scenes(&self) -> impl Iterator<Item = HandScene> {
        self.seeds.clone().map(|seed| self.first.with_seed(seed))
    }

    /// The scene of a run.
    fn scene(&self, run: usize) -> HandScene {
        self.first.with_seed(self.seeds.start + run as u64)
    }
}

/// Runs every scene of every cell on all cores; the scores by cell and seed. `progress` is called after each run.
pub fn run(
    cells: &[TrialCell],
    settings: &TaskSettings,
    stop: &(dyn Fn() -> bool + Sync),
    progress: &(dyn Fn() + Sync),
) -> Result<Vec<Vec<RunScore>>, TrialError> {
    // Neither the runs nor their scenes are listed: only the scores of those that have ended take memory.
    let place = |mut job: usize| {
        cells.iter().enumerate().find_map(|(c, cell)| match job.checked_sub(cell.runs_count()) {
            None => Some((c, job)),
            Some(others) => {
                job = others;
                None
            }
        })
    };
    let next = AtomicUsize::new(0);
    let results: Mutex<BTreeMap<usize, Result<RunScore, LockStepError>>> = Mutex::new(BTreeMap::new());
    let cores_count = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores_count {
            scope.spawn(|| {
                while !stop() {
                    let job = next.fetch_add(1, Ordering::Relaxed);
                    let Some((c, run)) = place(job) else { return };
                    let result = score(&cells[c].scene(run), cells[c].controller, settings, stop);
                    results.lock().unwrap_or_else(PoisonError::into_inner).insert(job, result);
                    progress();
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    let mut scores: Vec<Vec<RunScore>> = cells.iter().map(|_| Vec::new()).collect();
    for (job, (c, run)) in (0..).map_while(|job| Some((job, place(job)?))) {
        match results.remove(&job) {
            Some(Ok(score)) => scores[c].push(score),
            Some(Err(source)) => return Err(TrialError::Run { scene: cells[c].scene(run).to_string(), source }),
            None => return Err(TrialError::Interrupted),
        }
    }
    Ok(scores)
}

/// One run without images or a folder.
fn score(
    scene: &HandScene,
    controls: Controls,
    settings: &TaskSettings,
    stop: &dyn Fn() -> bool,
) -> Result<RunScore, LockStepError> {
    let mut lockstep = match controls {
        Controls::Feeling(kind) => LockStep::new(scene, &settings.with_controller(kind), &Settings::default(), None)?,
        Controls::Clairvoyant => {
            let hand = SimHand::new(scene)?;
            let grip = Guard::new(Box::new(Clairvoyant::new(hand.clone(), &settings.grip)), settings.grip);
            let stiffness = hand.sensor(0).shear_stiffness_mpa_per_mm();
            let task = settings.task_with(scene.task(), grip, stiffness)?;
            LockStep::around(scene, hand, task, &Settings::default(), None)?
        }
    };
    match lockstep.run(stop, &mut ()) {
        // A run that a fault ended has not ended as it should; the others are told all the same.
        Ok(()) | Err(LockStepError::Control(ControlError::Fault { .. })) => Ok(lockstep.score().clone()),
        Err(error) => Err(error),
    }
}

/// The head of the table, in Markdown.
pub const TABLE_HEAD: [&str; 2] = [
    "| task | object | mu | controller | fingers | ended as it should | torque, worst | slid, mean / worst mm | over-squeeze | time s | alarms | most N |",
    "|---|---|---|---|---|---|---|---|---|---|---|---|",
];

/// The row of a cell, in Markdown.
pub fn row(cell: &TrialCell, runs: &[RunScore]) -> String {
    let count = runs.len();
    let right = runs.iter().filter(|run| run.succeeded(cell.task)).count();
    let mean = |of: &dyn Fn(&RunScore) -> f64| runs.iter().map(of).sum::<f64>() / count as f64;
    let worst = |of: &dyn Fn(&RunScore) -> f64| runs.iter().map(of).fold(0.0, f64::max);
    let fractions = runs.iter().filter_map(RunScore::torque_fraction);
    let torque = fractions.reduce(f64::min).map_or("-".into(), |t| format!("{:.1} %", 100.0 * t));
    let squeezes: Vec<f64> = runs.iter().filter_map(RunScore::over_squeeze_ratio).collect();
    let mean_squeeze = squeezes.iter().sum::<f64>() / squeezes.len() as f64;
    let squeeze = if squeezes.is_empty() { "-".into() } else { format!("{mean_squeeze:.2}") };
    let TrialCell { names: [object, mu], task, controller, fingers, .. } = cell;
    format!(
        "| {task} | {object} | {mu} | {controller} | {fingers} | {right} of {count} | {torque} | {:.2} / {:.2} | {squeeze} | {:.1} | {:.1} | {:.0} |",
        mean(&|run| run.slid_mm),
        worst(&|run| run.slid_mm),
        mean(&|run| run.ended_s.unwrap_or(run.time_s)),
        mean(&|run| f64::from(run.alarms_count)),
        worst(&|run| run.most_n),
    )
}

/// One run as a line.
pub fn line(run: &RunScore) -> String {
    let ending = run.ending.map_or("did not end", Ending::evidence);
    let ended = run.ended_s.map_or(String::new(), |ended_s| format!(" after {ended_s:.2} s"));
    let first =
        run.first_alarm_used_fraction().map_or("none".into(), |used| format!("first at {used:.2} of the friction"));
    let least =
        run.least_held_n.map_or("nothing was held".into(), |least_n| format!("held with {least_n:.1} N at least"));
    format!(
        "{ending}{ended}; slid {:.2} mm in {} steps; alarms: {}, {first}; {least}, {:.0} N at most; largest strain of the gel {:.2}{}",
        run.slid_mm,
        run.last.gross_steps_count,
        run.alarms_count,
        run.most_n,
        run.last.largest_strain_fraction,
        if run.last.at_border { ", contact at the border of the pad" } else { "" },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    fn grid(seeds: Range<u64>) -> TrialGrid {
        TrialGrid {
            tasks: vec![TaskKind::Lift],
            objects: vec!["task".into()],
            mu: vec!["0.4".into(), "0.6".into()],
            controllers: vec![Controls::Clairvoyant],
            fingers: vec![1],
            seeds,
            parameters: vec!["longest_s=0.1".into()],
        }
    }

    #[test]
    fn a_million_seeds_take_no_memory_before_they_are_run() {
        let began = Instant::now();
        let cells = grid(7..1_000_007).cells().expect("scenes");
        let ran = run(&cells, &TaskSettings::default(), &|| true, &|| ());
        assert!(matches!(ran, Err(TrialError::Interrupted)), "{ran:?}");
        assert!(began.elapsed() < Duration::from_secs(2), "they were listed: {:?}", began.elapsed());
        assert_eq!(
            (cells[1].runs_count(), cells[1].scenes().nth(999).map(|scene| scene.seed())),
            (1_000_000, Some(1006))
        );
        let parsed = HandScene::parse("lift?seed=1006&fingers=1&mu=0.6&longest_s=0.1").expect("a scene");
        assert_eq!(cells[1].scene(999), parsed);
        assert!(grid((1 << 53) - 1..(1 << 53) + 2).cells().is_err(), "the last seed is none");
    }

    #[test]
    fn every_scene_is_run_in_its_cell() {
        let cells = grid(3..6).cells().expect("scenes");
        let scores = run(&cells, &TaskSettings::default(), &|| false, &|| ()).expect("they run");
        assert_eq!(scores.iter().map(Vec::len).collect::<Vec<_>>(), [3, 3]);
    }
}
