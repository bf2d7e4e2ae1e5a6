//! `slipbound demo`: a simulated hand does a task of the paper, live, and leaves a report.

mod results;

use super::inputs;
use super::run_recording;
use crate::emulated::{EmulatedActuators, EmulatedGripper, LinkFaults};
use crate::interruption;
use crate::loopback::Loopback;
use crate::outcome::{Failure, Outcome};
use crate::run_output::{RunOutput, RunScorer};
use crate::set_option;
use crate::terminal;
use anyhow::anyhow;
use slipbound::control::{CycleObserver, CycleView};
use slipbound::monitor::Settings;
use slipbound::task::{ControllerKind, Ending, Missing, Phase, TaskKind, TaskSettings};
use slipbound_lab::faults::CameraFault;
use slipbound_lab::hand::HandScene;
use slipbound_lab::lockstep::LockStep;
use slipbound_lab::score::RunScore;
use slipbound_rig::config;
use slipbound_rig::container::{McapObserver, Recorder};
use slipbound_rig::emulator::Faults;
use slipbound_rig::gripper::clamp_to_gripper;
use slipbound_rig::link::now_ns;
use slipbound_rig::realtime::MonitorWorkers;
use slipbound_rig::run::{self, FingerInfo, RunInfo};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// The outcome of a run: its score, its last time in ns, how far it came, and what it waited for.
type RunOutcome = (anyhow::Result<()>, RunScore, u64, Reached, Option<Missing>);

/// What the task was doing last, the first lower force that the gripper refused, and the blind force that the loop was
/// left with, if so, N per finger.
#[derive(Default)]
struct Reached {
    phase: Option<Phase>,
    refused_lowering: Option<String>,
    left_with_n: Option<f64>,
}

impl CycleObserver for Reached {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        self.phase = view.cycle().map(|cycle| cycle.phase).or(self.phase);
        if self.refused_lowering.is_none() {
            self.refused_lowering = view.refused_lowering.map(str::to_owned);
        }
    }
}

/// The folder a run is left in unless another is named.
const FOLDER: &str = "slipbound-demo";

/// The arguments of `slipbound demo`.
#[derive(Debug, clap::Args)]
pub struct Demo {
    /// The task
    #[arg(long, default_value = "screw", value_parser = TaskKind::NAMES)]
    task: String,
    /// The grip controller: the paper's law ending on evidence (on_slip), exactly the paper's (paper), by slip margin
    /// (margin), one constant force (constant)
    #[arg(long, value_parser = ControllerKind::NAMES)]
    controller: Option<String>,
    /// Fingers with a camera
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=2))]
    fingers: u8,
    /// Seed of noise and disturbances
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Set a parameter of the scene, as mu=0.6; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Settings of grip, controllers and tasks that replace the defaults
    #[arg(long, value_name = "FILE.toml")]
    settings: Option<PathBuf>,
    /// A fault of the cameras: lost, frozen, torn or dark, optionally with @SECONDS and :left or :right; or swapped,
    /// from the start on
    #[arg(long, value_name = "WHAT@SECONDS:FINGER")]
    fault: Option<CameraFault>,
    /// Reach gripper and wrist through a driver and an emulator of its wire protocol, as wsg50 or wsg50?most_n=40
    #[arg(long, value_name = "GRIPPER?KEY=VALUE", alias = "through")]
    emulated: Option<EmulatedGripper>,
    /// Connect driver and emulator by real sockets on this computer, in real time, instead of in lock-step
    #[arg(long, requires = "emulated")]
    sockets: bool,
    /// Faults of the gripper's emulator, joined by commas (see `slipbound emulate --help`)
    #[arg(long, value_name = "FAULTS", default_value = "", requires = "emulated", hide_default_value = true)]
    gripper_fault: Faults,
    /// Faults of the wrist's emulator
    #[arg(long, value_name = "FAULTS", default_value = "", requires = "emulated", hide_default_value = true)]
    wrist_fault: Faults,
    /// Keep every frame in the folder of the run, for `slipbound replay`; with =FILE.mcap instead in one file with
    /// reports and cycles
    #[arg(long, value_name = "FILE.mcap", num_args = 0..=1, require_equals = true)]
    record: Option<Option<PathBuf>>,
    /// The folder of the run: new or empty [default: slipbound-demo, or with the next free number]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

impl Demo {
    /// Runs the task to its end.
    pub fn run(&self) -> Result<Outcome, Failure> {
        self.output.as_deref().map_or(Ok(()), inputs::refuse_stdout_folder)?;
        let mut settings = config::load_task_settings(self.settings.as_deref()).map_err(Failure::arguments)?;
        if let Some(name) = &self.controller {
            settings.controller = name.parse().map_err(Failure::arguments)?;
        }
        set_option::refuse_own(&self.set, &[("seed", "--seed"), ("fingers", "--fingers")])?;
        let scene = HandScene::parse(&self.scene_text()).map_err(Failure::arguments)?;
        let hits = |fault: &CameraFault| (0..usize::from(self.fingers)).any(|finger| fault.applies_to(finger));
        if let Some(fault) = self.fault.filter(|fault| !hits(fault)) {
            return Err(Failure::Arguments(anyhow!(
                "--fault {fault}: expected a finger of the hand, which has one, left"
            )));
        }
        let task = scene.task();
        let mut clamped = None;
        if let Some(emulated) = &self.emulated {
            let driver = emulated.driver(scene.width_mm()).map_err(Failure::Arguments)?;
            (settings, clamped) = clamp_to_gripper(&settings, task, driver.config()).map_err(Failure::arguments)?;
        }
        let monitor = Settings::default();
        let folder = self.output.clone().unwrap_or_else(|| run::free_folder(FOLDER));
        let faults = LinkFaults { gripper: self.gripper_fault.clone(), wrist: self.wrist_fault.clone() };
        let lockstep = LockStep::new(&scene, &settings, &monitor, self.fault).map_err(Failure::arguments)?;
        let info = self.info(&scene, &settings, &monitor, task, &lockstep);
        let keeps_frames = self.record == Some(None);
        let recorder = self.recorder(&info)?;
        let container = recorder.as_ref().map(|recorder| {
            let sources = vec![info.source.clone(); info.fingers.len()];
            McapObserver::new(recorder.inlet(), info.clone(), sources).keeping_frames()
        });
        let mut output = RunOutput::create(&folder, &info, keeps_frames)?.recording(container);
        let stop = interruption::listen()?;
        if let Some(recorder) = &recorder {
            recorder.begin();
        }
        let began = Instant::now();
        output.say(&info.source_in_words())?;
        if let Some(clamped) = clamped {
            output.note(0, &clamped);
        }
        let (ran, mut score, now_ns, reached, missing) = match self.emulated.as_ref().filter(|_| self.sockets) {
            Some(emulated) => {
                let loopback = Loopback::start(&scene, &settings, &monitor, self.fault, emulated, &faults)?;
                let (mut queued, mut scorer) = (output.queued(keeps_frames), RunScorer::new(settings.grip.most_n));
                let (ran, missing, left_with_n) = loopback.run(&stop, &mut queued, &mut scorer);
                output = queued.finish();
                let RunScorer { score, phase, refused_lowering, .. } = scorer;
                (ran, score, now_ns(), Reached { phase, refused_lowering, left_with_n }, missing)
            }
            None => self.in_lock_step(&scene, lockstep, &faults, &stop, &mut output)?,
        };
        let has_begun = reached.phase.is_some_and(|phase| phase != Phase::Grasping);
        output.end_cycles();
        let broke_off = ran.as_ref().err().map(terminal::in_words);
        if let Some(why) = &broke_off {
            output.note(now_ns, why);
        }
        if let Some(force_n) = reached.left_with_n {
            output.note(now_ns, &run::left_in_words(force_n));
            score.most_n = score.most_n.max(force_n);
        }
        let (seconds, took_s) = (now_ns as f64 * 1e-9, began.elapsed().as_secs_f64());
        run_recording::finish(recorder, &mut output);
        let rows = results::rows(&scene, &settings, &score, broke_off.as_deref());
        let outcome = output.finish(&rows, score.ending, |page| {
            let times = seconds / took_s;
            let (until_s, had) = score.ended_s.map_or((score.time_s, "broke off"), |ended_s| (ended_s, "had ended"));
            let after = format!(", the last {:.2} s of them after it {had},", (seconds - until_s).max(0.0));
            format!("simulated {seconds:.2} s{after} in {took_s:.2} s ({times:.1} times real time); report: {page}")
        })?;
        ran.map_err(Failure::Work)?;
        let refused_lowering = reached.refused_lowering.as_deref();
        match score.ending {
            None if !has_begun => Err(Failure::never_began(missing, refused_lowering)),
            Some(ending @ (Ending::NothingHeld | Ending::Lost)) => Err(Failure::ended(ending, refused_lowering)),
            _ if score.is_object_lost() => {
                Err(Failure::Work(anyhow!("the object was lost: it slid by {:.1} mm", score.slid_mm)))
            }
            _ => Ok(outcome),
        }
    }

    /// Runs the cycles of the simulated hand as fast as possible.
    fn in_lock_step(
        &self,
        scene: &HandScene,
        lockstep: LockStep,
        faults: &LinkFaults,
        stop: &AtomicBool,
        output: &mut RunOutput,
    ) -> Result<RunOutcome, Failure> {
        let mut lockstep = lockstep.with_runner(Box::new(MonitorWorkers::new()));
        if let Some(emulated) = &self.emulated {
            let actuators = EmulatedActuators::new(lockstep.hand(), scene.width_mm(), emulated, faults);
            lockstep = lockstep.with_actuators(Box::new(actuators.map_err(Failure::Arguments)?));
        }
        let mut reached = Reached::default();
        let ran = lockstep.run(&|| stop.load(Ordering::Relaxed), &mut (&mut *output, &mut reached));
        let mut score = lockstep.score().clone();
        score.add_truth(&lockstep.hand().truth());
        reached.left_with_n = lockstep.control().left_with_n();
        let missing = lockstep.control().task().missing();
        Ok((ran.map_err(Into::into), score, lockstep.hand().now_ns(), reached, missing))
    }

    /// The recording in one file that was requested.
    fn recorder(&self, info: &RunInfo) -> Result<Option<Recorder>, Failure> {
        let Some(Some(path)) = &self.record else { return Ok(None) };
        inputs::refuse_recording("--record", path, &[], &[self.settings.as_deref()])?;
        let recorder = Recorder::create(path, &info.finger_names(), true)?;
        run_recording::describe(&recorder, info)?;
        Ok(Some(recorder))
    }

    fn scene_text(&self) -> String {
        let mut text = format!("{}?seed={}&fingers={}", self.task, self.seed, self.fingers);
        for setting in &self.set {
            text = format!("{text}&{setting}");
        }
        text
    }

    fn info(
        &self,
        scene: &HandScene,
        settings: &TaskSettings,
        monitor: &Settings,
        task: TaskKind,
        lockstep: &LockStep,
    ) -> RunInfo {
        let mut notes = toml::Table::new();
        if let Some(fault) = self.fault {
            notes.insert("fault".into(), fault.to_string().into());
        }
        if let Some(emulated) = &self.emulated {
            notes.insert("emulated".into(), emulated.to_string().into());
        }
        RunInfo {
            name: task.name().into(),
            task,
            source: scene.to_string(),
            seed: self.seed,
            task_settings: *settings,
            monitor_settings: monitor.clone(),
            notes,
            fingers: lockstep.control().fingers().iter().map(FingerInfo::of).collect(),
        }
    }
}
