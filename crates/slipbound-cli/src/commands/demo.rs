//! `slipbound demo`: a simulated hand does a task of the paper, live, and leaves a report.

mod results;

use crate::chronicle::Chronicle;
use crate::fitting::fit;
use crate::frames::FrameRecorder;
use crate::interruption;
use crate::loopback::Loopback;
use crate::outcome::{Failure, Outcome};
use crate::simulated::{Simulated, kind};
use crate::spoiled::Spoiler;
use crate::through::{LinkFaults, Through};
use anyhow::{Context, anyhow};
use slipbound::monitor::Settings;
use slipbound::sensor::Sensor;
use slipbound::task::{ControllerKind, TaskSettings};
use slipbound_lab::hand::{HandScene, HandTruth};
use slipbound_rig::config;
use slipbound_rig::emulator::Faults;
use slipbound_rig::link::now_ns;
use slipbound_rig::run::RunInfo;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// The folder a run is left in unless another is named.
const FOLDER: &str = "slipbound-demo";

/// The arguments of `slipbound demo`.
#[derive(Debug, clap::Args)]
pub struct Demo {
    /// The task
    #[arg(long, default_value = "screw", value_parser = ["screw", "unscrew", "place", "lift"])]
    task: String,
    /// Who holds: the paper's law ending on evidence, the paper to the letter, ours by slip margin, one force
    #[arg(long, value_parser = ["on_slip", "paper", "margin", "constant"])]
    controller: Option<String>,
    /// Fingers with a camera
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=2))]
    fingers: u8,
    /// What noise and disturbances are drawn from
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Set a parameter of the scene, as mu=0.6; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Settings of grip, controllers and tasks that replace the defaults
    #[arg(long, value_name = "FILE.toml")]
    settings: Option<PathBuf>,
    /// Something that goes wrong: lost, frozen, torn, dark or swapped, with @SECONDS and :left or :right as wanted
    #[arg(long, value_name = "WHAT@SECONDS:FINGER")]
    fault: Option<Spoiler>,
    /// Reach gripper and wrist through a driver and an emulator of its wire protocol, as wsg50 or wsg50?most_n=40
    #[arg(long, value_name = "GRIPPER?KEY=VALUE")]
    through: Option<Through>,
    /// Let that be real sockets on this computer, in real time, instead of lock-step
    #[arg(long, requires = "through", conflicts_with = "record")]
    sockets: bool,
    /// What goes wrong with the gripper's emulator, joined by commas (see `slipbound emulate --help`)
    #[arg(long, value_name = "FAULTS", default_value = "", requires = "through", hide_default_value = true)]
    gripper_fault: Faults,
    /// What goes wrong with the wrist's emulator
    #[arg(long, value_name = "FAULTS", default_value = "", requires = "through", hide_default_value = true)]
    wrist_fault: Faults,
    /// Keep every frame, so that `slipbound replay` can run the loop again
    #[arg(long)]
    record: bool,
    /// The folder of the run: new or empty [default: slipbound-demo, or with the next free number]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

impl Demo {
    /// Runs the task to its end.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let mut settings = config::load_task_settings(self.settings.as_deref()).map_err(Failure::arguments)?;
        if let Some(name) = &self.controller {
            settings.controller = controller(name)?;
        }
        let scene = HandScene::parse(&self.scene_text()).map_err(Failure::arguments)?;
        let mut fitted = None;
        if let Some(through) = &self.through {
            let driver = through.driver(scene.width_mm()).map_err(Failure::Arguments)?;
            let kind = kind(&scene).map_err(Failure::arguments)?;
            (settings, fitted) = fit(&settings, kind, driver.config()).map_err(Failure::Arguments)?;
        }
        let monitor = Settings::default();
        let folder = self.output.clone().unwrap_or_else(|| next_free(FOLDER));
        let faults = LinkFaults { gripper: self.gripper_fault.clone(), wrist: self.wrist_fault.clone() };
        let mut simulated = Simulated::new(&scene, &settings, &monitor, self.fault).map_err(Failure::Arguments)?;
        if let Some(through) = self.through.as_ref().filter(|_| !self.sockets) {
            simulated = simulated.through(&scene, through, &faults).map_err(Failure::Arguments)?;
        }
        let sensors: Vec<Sensor> = (0..scene.fingers_count()).map(|finger| simulated.hand.sensor(finger)).collect();
        let names = simulated.around.eyes.iter().map(|eye| eye.name.clone()).collect();
        let mut chronicle = Chronicle::create(&folder, &self.info(&scene, &settings, &monitor, names)?, &sensors)?;
        if self.record {
            simulated.around.recorder = Some(FrameRecorder::create(&folder)?);
        }
        let interrupted = interruption::listen()?;
        let began = Instant::now();
        chronicle.terminal.say(&format!("{scene}"))?;
        if let Some(fitted) = fitted {
            chronicle.note(0, &fitted)?;
        }
        let (ran, now_ns) = match self.through.as_ref().filter(|_| self.sockets) {
            Some(through) => {
                let loopback = Loopback::start(&scene, &settings, &monitor, self.fault, through, &faults)?;
                let (ran, truth) = loopback.run(&interrupted, &mut chronicle);
                truth.into_iter().for_each(|truth| chronicle.measures.watch(&truth));
                (ran, now_ns())
            }
            None => {
                let ran = in_lock_step(&mut simulated, &interrupted, &mut chronicle);
                chronicle.measures.watch(&simulated.hand.truth());
                (ran, simulated.hand.now_ns())
            }
        };
        if let Err(e) = &ran {
            chronicle.note(now_ns, &format!("{e:#}"))?;
        }
        let (seconds, took_s) = (now_ns as f64 * 1e-9, began.elapsed().as_secs_f64());
        let rows = results::rows(&scene, &settings, &chronicle.measures);
        let (mut terminal, page) = chronicle.finish(&rows)?;
        let times = seconds / took_s;
        let page = page.display();
        terminal.say(&format!("{seconds:.1} s in {took_s:.1} s ({times:.1} times real time); report: {page}"))?;
        ran.map_err(Failure::Work)?;
        Ok(Outcome::Done)
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
        fingers: Vec<String>,
    ) -> Result<RunInfo, Failure> {
        let mut all = toml::Table::new();
        all.insert("task".into(), toml::Table::try_from(settings).context("settings as TOML")?.into());
        all.insert("monitor".into(), toml::Table::try_from(monitor).context("settings as TOML")?.into());
        if let Some(fault) = self.fault {
            all.insert("fault".into(), fault.to_string().into());
        }
        if let Some(through) = &self.through {
            all.insert("through".into(), through.to_string().into());
        }
        Ok(RunInfo {
            task: self.task.clone(),
            controller: name_of(settings.controller).into(),
            source: scene.to_string(),
            seed: self.seed,
            settings: all,
            fingers,
        })
    }
}

/// A folder of this name, or with the next free number.
pub fn next_free(name: &str) -> PathBuf {
    let names = std::iter::once(name.to_owned()).chain((2..).map(|n| format!("{name}-{n}")));
    names.map(PathBuf::from).find(|folder| !folder.exists()).unwrap_or_else(|| name.into())
}

/// Turn after turn of the simulated hand, as fast as it goes.
fn in_lock_step(simulated: &mut Simulated, interrupted: &AtomicBool, chronicle: &mut Chronicle) -> anyhow::Result<()> {
    simulated.run(|around, told, truth: &HandTruth| {
        anyhow::ensure!(!interrupted.load(Ordering::Relaxed), "interrupted; the wrist was paused, the grip kept");
        chronicle.turn(around, told, Some(truth))
    })
}

/// The name of a controller.
pub fn name_of(controller: ControllerKind) -> &'static str {
    match controller {
        ControllerKind::Constant => "constant",
        ControllerKind::OnSlip => "on_slip",
        ControllerKind::Paper => "paper",
        ControllerKind::Margin => "margin",
    }
}

/// The controller of a name.
pub fn controller(name: &str) -> Result<ControllerKind, Failure> {
    Ok(match name {
        "constant" => ControllerKind::Constant,
        "on_slip" => ControllerKind::OnSlip,
        "paper" => ControllerKind::Paper,
        "margin" => ControllerKind::Margin,
        other => {
            return Err(Failure::Arguments(anyhow!(
                "controller: expected one of constant, on_slip, paper, margin, got `{other}`"
            )));
        }
    })
}
