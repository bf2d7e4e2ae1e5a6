//! `slipbound demo`: a simulated hand does a task of the paper, live, and leaves a report.

mod results;

use crate::closed_loop::{ClosedLoop, Turn};
use crate::frames::FrameRecorder;
use crate::interruption;
use crate::measures::Measures;
use crate::outcome::{Failure, Outcome};
use crate::simulated::Simulated;
use crate::spoiled::Spoiler;
use crate::terminal::Terminal;
use anyhow::{Context, anyhow};
use slipbound::grip::GripController;
use slipbound::image::Rgb;
use slipbound::monitor::Settings;
use slipbound::task::{ControllerKind, Phase, TaskSettings};
use slipbound_lab::hand::{HandScene, HandTruth};
use slipbound_rig::config;
use slipbound_rig::overlay::Overlay;
use slipbound_rig::run::{Cycle, RunFolder, RunInfo};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
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
        let monitor = Settings::default();
        let mut simulated = Simulated::new(&scene, &settings, &monitor, self.fault).map_err(Failure::Arguments)?;
        let folder = self.output.clone().unwrap_or_else(next_free);
        let mut run = Run::create(&folder, &self.info(&scene, &settings, &monitor, &simulated)?, &simulated)?;
        if self.record {
            simulated.around.recorder = Some(FrameRecorder::create(&folder)?);
        }
        let interrupted = interruption::listen()?;
        let began = Instant::now();
        run.terminal.say(&format!("{scene}"))?;
        let ran = simulated.run(|around, now_ns, turn, truth| {
            anyhow::ensure!(!interrupted.load(Ordering::Relaxed), "interrupted; the wrist was paused, the grip kept");
            run.turn(around, now_ns, turn, truth)
        });
        run.terminal.clear_bar();
        if let Err(e) = &ran {
            run.folder.note(simulated.hand.now_ns(), &format!("{e:#}"));
        }
        let seconds = simulated.hand.now_ns() as f64 * 1e-9;
        let took_s = began.elapsed().as_secs_f64();
        let rows = results::rows(&scene, &settings, &run.measures);
        for row in &rows {
            run.terminal.say(&format!("  {:<28}{:<22}{}", row.name, row.value, row.target))?;
        }
        let page = run.folder.finish(&rows, run.measures.ending).map_err(|e| Failure::Work(e.into()))?;
        run.terminal.say(&format!(
            "{seconds:.1} s simulated in {took_s:.1} s ({:.1} times real time); report: {}",
            seconds / took_s,
            page.display()
        ))?;
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
        simulated: &Simulated,
    ) -> Result<RunInfo, Failure> {
        let mut all = toml::Table::new();
        all.insert("task".into(), toml::Table::try_from(settings).context("settings as TOML")?.into());
        all.insert("monitor".into(), toml::Table::try_from(monitor).context("settings as TOML")?.into());
        if let Some(fault) = self.fault {
            all.insert("fault".into(), fault.to_string().into());
        }
        let controller = match settings.controller {
            ControllerKind::Constant => "constant",
            ControllerKind::OnSlip => "on_slip",
            ControllerKind::Paper => "paper",
            ControllerKind::Margin => "margin",
        };
        Ok(RunInfo {
            task: self.task.clone(),
            controller: controller.into(),
            source: scene.to_string(),
            seed: self.seed,
            settings: all,
            fingers: simulated.around.eyes.iter().map(|eye| eye.name.clone()).collect(),
        })
    }
}

/// A run as it is written down and told.
struct Run {
    folder: RunFolder,
    overlays: Vec<Overlay>,
    measures: Measures,
    terminal: Terminal,
    last: Option<Cycle>,
    slips_count: u32,
}

impl Run {
    fn create(folder: &Path, info: &RunInfo, simulated: &Simulated) -> Result<Self, Failure> {
        let overlays =
            (0..simulated.around.eyes.len()).map(|finger| Overlay::new(&simulated.hand.sensor(finger))).collect();
        Ok(Run {
            folder: RunFolder::create(folder, info).map_err(Failure::arguments)?,
            overlays,
            measures: Measures::default(),
            terminal: Terminal::with_status(),
            last: None,
            slips_count: 0,
        })
    }

    fn turn(&mut self, around: &ClosedLoop, now_ns: u64, turn: &Turn, truth: &HandTruth) -> anyhow::Result<()> {
        let grip = around.task.grip();
        self.measures.see(now_ns, turn, grip.alarms_count(), truth);
        let cycle = Cycle {
            time_ns: now_ns,
            hand: turn.hand,
            gripper: turn.gripper,
            wrist: turn.wrist,
            grip_command: turn.step.grip,
            wrist_command: turn.step.wrist,
            phase: turn.step.phase,
            margin: grip.margin(),
            alarms_count: grip.alarms_count(),
            truth: Some(results::truth(truth)),
        };
        self.folder.cycle(&cycle)?;
        self.tell(&cycle)?;
        if self.folder.slips_count() > self.slips_count {
            self.slips_count = self.folder.slips_count();
            for (eye, overlay) in around.eyes.iter().zip(&mut self.overlays) {
                let (Some(monitor), Some(report)) = (eye.monitor(), &eye.report) else { continue };
                overlay.draw(eye.frame.frame().ok().as_ref(), report, monitor);
                let rgb = overlay.rgb();
                let picture = Rgb::new(&rgb, overlay.size())?;
                self.folder.picture(now_ns, &eye.name, &format!("{:.1} N", turn.step.grip.force_n), picture)?;
            }
        }
        self.last = Some(cycle);
        Ok(())
    }

    /// A line where something happened, the status otherwise.
    fn tell(&mut self, cycle: &Cycle) -> anyhow::Result<()> {
        let at = format!("{:6.2} s", cycle.time_ns as f64 * 1e-9);
        let before = self.last.as_ref();
        let force_n = cycle.gripper.pressed_n().unwrap_or(0.0);
        let mut lines = Vec::new();
        if self.folder.slips_count() > self.slips_count {
            lines.push(format!("{at}  slip {} at {force_n:.0} N", self.folder.slips_count()));
        }
        if before.is_some_and(|last| (last.grip_command.force_n - cycle.grip_command.force_n).abs() >= 4.5) {
            lines.push(format!("{at}  grip to {:.0} N", cycle.grip_command.force_n));
        }
        if let Phase::Ended(ending) = cycle.phase
            && before.is_none_or(|last| last.phase != cycle.phase)
        {
            lines.push(format!("{at}  {}", ending.evidence()));
        }
        for line in lines {
            self.terminal.say(&line).map_err(|_| anyhow!("cannot write to the terminal"))?;
        }
        let bar = "#".repeat((force_n / 2.0).round().clamp(0.0, 40.0) as usize);
        let angle_deg = cycle.wrist.angle_rad.to_degrees();
        self.terminal.status(&format!("{at}  {angle_deg:6.1} deg  {force_n:5.1} N {bar}"));
        Ok(())
    }
}

/// `slipbound-demo`, or with the next free number.
fn next_free() -> PathBuf {
    let names = std::iter::once(FOLDER.to_owned()).chain((2..).map(|n| format!("{FOLDER}-{n}")));
    names.map(PathBuf::from).find(|folder| !folder.exists()).unwrap_or_else(|| FOLDER.into())
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
