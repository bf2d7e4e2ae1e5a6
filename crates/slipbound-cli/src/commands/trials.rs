//! `slipbound trials`: the tasks over friction, seeds, controllers and fingers, as a table.

use crate::closed_loop::Turned;
use crate::interruption;
use crate::measures::{Measures, succeeded};
use crate::outcome::{Failure, Outcome};
use crate::simulated::{Simulated, kind};
use crate::terminal::Terminal;
use slipbound::grip::GripController;
use slipbound::monitor::Settings;
use slipbound::task::{ControllerKind, TaskKind, TaskSettings};
use slipbound_lab::hand::HandScene;
use slipbound_rig::config;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// The arguments of `slipbound trials`.
#[derive(Debug, clap::Args)]
pub struct Trials {
    /// Tasks
    #[arg(long, value_delimiter = ',', default_value = "screw,unscrew")]
    task: Vec<String>,
    /// Controllers
    #[arg(long, value_delimiter = ',', default_value = "paper,on_slip,margin")]
    controller: Vec<String>,
    /// Friction coefficients, or `object`
    #[arg(long, value_delimiter = ',', default_value = "0.4,0.6,0.9")]
    mu: Vec<String>,
    /// Objects, or `task` for the one of the task
    #[arg(long, value_delimiter = ',', default_value = "task")]
    object: Vec<String>,
    /// Fingers with a camera
    #[arg(long, value_delimiter = ',', default_value = "1,2")]
    fingers: Vec<u8>,
    /// How many seeds, from --first-seed on
    #[arg(long, default_value_t = 5)]
    seeds: u64,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Set another parameter of every scene; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Settings of grip, controllers and tasks that replace the defaults
    #[arg(long, value_name = "FILE.toml")]
    settings: Option<PathBuf>,
    /// Also print every run
    #[arg(long)]
    each: bool,
}

/// One cell of the table, and its runs.
struct Group {
    name: [String; 5],
    kind: TaskKind,
    controller: ControllerKind,
    scenes: Vec<HandScene>,
}

impl Trials {
    /// Runs them all on all cores.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let settings = config::load_task_settings(self.settings.as_deref()).map_err(Failure::arguments)?;
        let groups = self.groups()?;
        let jobs: Vec<(usize, usize)> =
            groups.iter().enumerate().flat_map(|(g, group)| (0..group.scenes.len()).map(move |s| (g, s))).collect();
        let interrupted = interruption::listen()?;
        let terminal = Terminal::with_bar(Some(jobs.len() as u64), false);
        let results = run_all(&groups, &jobs, &settings, &interrupted, &terminal);
        terminal.clear_bar();
        let mut terminal = Terminal::plain();
        terminal.say("| task | object | mu | controller | fingers | ended as it should | torque, worst | slid, mean / worst mm | over-squeeze | time s | alarms | most N |")?;
        terminal.say("|---|---|---|---|---|---|---|---|---|---|---|---|")?;
        for (g, group) in groups.iter().enumerate() {
            let runs = jobs.iter().zip(&results).filter(|((of, _), _)| *of == g);
            let mut measured = Vec::new();
            for ((_, s), result) in runs {
                match result {
                    Some(Ok(run)) => measured.push((&group.scenes[*s], run)),
                    Some(Err(e)) => return Err(Failure::Work(anyhow::anyhow!("{}: {e:#}", group.scenes[*s]))),
                    None => return Err(Failure::Work(anyhow::anyhow!("interrupted"))),
                }
            }
            terminal.say(&row(group, &measured))?;
            if self.each {
                for (scene, run) in &measured {
                    terminal.say(&format!("    {scene}: {}", one(run)))?;
                }
            }
        }
        Ok(Outcome::Done)
    }

    fn groups(&self) -> Result<Vec<Group>, Failure> {
        let mut groups = Vec::new();
        for task in &self.task {
            for object in &self.object {
                for mu in &self.mu {
                    for controller in &self.controller {
                        for fingers in &self.fingers {
                            let mut scenes = Vec::new();
                            for seed in self.first_seed..self.first_seed + self.seeds {
                                let mut text = format!("{task}?seed={seed}&fingers={fingers}&mu={mu}");
                                if object != "task" {
                                    text = format!("{text}&object={object}");
                                }
                                for setting in &self.set {
                                    text = format!("{text}&{setting}");
                                }
                                scenes.push(HandScene::parse(&text).map_err(Failure::arguments)?);
                            }
                            let Some(first) = scenes.first() else { continue };
                            let kind = kind(first).map_err(Failure::arguments)?;
                            let name = [task, object, mu, controller, &fingers.to_string()].map(String::clone);
                            let controller = super::demo::controller(controller)?;
                            groups.push(Group { name, kind, controller, scenes });
                        }
                    }
                }
            }
        }
        Ok(groups)
    }
}

type Ran = Option<anyhow::Result<Measures>>;

fn run_all(
    groups: &[Group],
    jobs: &[(usize, usize)],
    settings: &TaskSettings,
    interrupted: &AtomicBool,
    terminal: &Terminal,
) -> Vec<Ran> {
    let next = AtomicUsize::new(0);
    let results: Mutex<Vec<Ran>> = Mutex::new(jobs.iter().map(|_| None).collect());
    let cores_count = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores_count {
            scope.spawn(|| {
                while !interrupted.load(Ordering::Relaxed) {
                    let job = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&(g, s)) = jobs.get(job) else { return };
                    let settings = TaskSettings { controller: groups[g].controller, ..*settings };
                    let result = measure(&groups[g].scenes[s], &settings);
                    if let Ok(mut results) = results.lock() {
                        results[job] = Some(result);
                    }
                    terminal.advance();
                }
            });
        }
    });
    results.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// One run without pictures or folder.
fn measure(scene: &HandScene, settings: &TaskSettings) -> anyhow::Result<Measures> {
    let mut simulated = Simulated::new(scene, settings, &Settings::default(), None)?;
    let mut measures = Measures::default();
    simulated.run(|around, told, truth| {
        if let Turned::Commanded(turn) = &told.turned {
            measures.see(told.now_ns, turn, around.task.grip().alarms_count(), Some(truth));
        }
        Ok(())
    })?;
    Ok(measures)
}

fn row(group: &Group, runs: &[(&HandScene, &Measures)]) -> String {
    let count = runs.len();
    let right = runs.iter().filter(|(_, run)| succeeded(group.kind, run)).count();
    let mean = |of: &dyn Fn(&Measures) -> f64| runs.iter().map(|(_, run)| of(run)).sum::<f64>() / count as f64;
    let worst = |of: &dyn Fn(&Measures) -> f64| runs.iter().map(|(_, run)| of(run)).fold(0.0, f64::max);
    let torque = runs.iter().filter_map(|(scene, run)| run.torque_fraction(scene.mu())).reduce(f64::min);
    let squeezes: Vec<f64> = runs.iter().filter_map(|(_, run)| run.over_squeeze_ratio()).collect();
    let squeeze = squeezes.iter().sum::<f64>() / squeezes.len() as f64;
    let [task, object, mu, controller, fingers] = &group.name;
    format!(
        "| {task} | {object} | {mu} | {controller} | {fingers} | {right} of {count} | {} | {:.2} / {:.2} | {squeeze:.2} | {:.1} | {:.1} | {:.0} |",
        torque.map_or("-".into(), |t| format!("{:.1} %", 100.0 * t)),
        mean(&|run| run.last.slid_mm),
        worst(&|run| run.last.slid_mm),
        mean(&|run| run.ended_s.unwrap_or(run.time_s)),
        mean(&|run| f64::from(run.alarms_count)),
        worst(&|run| run.most_n),
    )
}

fn one(run: &Measures) -> String {
    format!(
        "{:?} at {:?} s, slid {:.2} mm, gross steps {}, alarms {}, first at {:.2?} of the friction, least held {:.1?} N, most {:.0} N, strain {:.2}, border {}",
        run.ending,
        run.ended_s,
        run.last.slid_mm,
        run.last.gross_steps_count,
        run.alarms_count,
        run.first_alarm_ratio(),
        run.least_held_n,
        run.most_n,
        run.last.largest_strain_fraction,
        run.last.at_border,
    )
}
