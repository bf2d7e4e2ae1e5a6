//! `slipbound run` and `slipbound hold`: a task with a real gripper and wrist.

use crate::chronicle::Chronicle;
use crate::closed_loop::{ClosedLoop, Eye};
use crate::fitting::fit;
use crate::interruption;
use crate::live;
use crate::outcome::{Failure, Outcome};
use anyhow::{Context, anyhow};
use slipbound::hand::{Mounting, Side};
use slipbound::monitor::Settings;
use slipbound::sensor::Sensor;
use slipbound::task::{Ending, Phase, TaskKind, TaskSettings};
use slipbound_rig::link::now_ns;
use slipbound_rig::run::{Row, RunInfo};
use slipbound_rig::{config, gripper, hand_file, sensors, source, wrist};
use std::path::PathBuf;

/// What a hold without an end is given for its time, ns: eleven days.
const WITHOUT_END_NS: u64 = 1_000_000_000_000_000;

/// The arguments of `slipbound run`.
#[derive(Debug, clap::Args)]
pub struct Run {
    /// The task
    #[arg(value_parser = ["screw", "unscrew", "place", "lift"])]
    task: String,
    #[command(flatten)]
    hardware: Hardware,
    /// line://HOST:PORT of the arm (docs/grippers.md), or dry for none
    #[arg(long, value_name = "ADDRESS")]
    wrist: String,
}

/// The arguments of `slipbound hold`.
#[derive(Debug, clap::Args)]
pub struct Hold {
    #[command(flatten)]
    hardware: Hardware,
    /// For how long, in seconds [default: until Ctrl-C or the end of the source]
    #[arg(long, value_name = "SECONDS")]
    for_s: Option<f64>,
}

/// What both need.
#[derive(Debug, clap::Args)]
struct Hardware {
    /// A recording for every finger, the left one first: an image folder, a quoted pattern or a video. It must begin
    /// with the hand open
    #[arg(required = true, num_args = 1..=2, value_name = "SOURCE")]
    sources: Vec<String>,
    /// The gripper: wsg50://HOST:1000, gcl://, robotiq://, line:// or dry, as in `slipbound gripper`
    #[arg(long, value_name = "ADDRESS")]
    gripper: String,
    /// A TOML file of gripper settings (docs/grippers.md)
    #[arg(long, value_name = "FILE.toml")]
    gripper_config: Option<PathBuf>,
    /// A file that names every finger, its sensor file and how it is mounted
    #[arg(long, value_name = "FILE.toml", conflicts_with = "sensor")]
    hand: Option<PathBuf>,
    /// The sensor of every finger: a built-in name or a sensor file
    #[arg(long, value_name = "NAME|FILE.toml")]
    sensor: Option<String>,
    /// Who holds: the paper's law ending on evidence, the paper to the letter, ours by slip margin, one force
    #[arg(long, value_parser = ["on_slip", "paper", "margin", "constant"])]
    controller: Option<String>,
    /// Settings of grip, controllers and tasks that replace the defaults
    #[arg(long, value_name = "FILE.toml")]
    settings: Option<PathBuf>,
    /// Frames per second at which the recordings are played
    #[arg(long, value_name = "HZ", default_value_t = 30.0)]
    rate_hz: f64,
    /// The folder of the run: new or empty [default: slipbound-run, or with the next free number]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

/// A finger before its loop.
struct Finger {
    name: String,
    mounting: Mounting,
    sensor: Sensor,
}

impl Run {
    /// Runs the task to its end.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let settings = self.hardware.task_settings()?;
        let kind = match self.task.as_str() {
            "screw" => TaskKind::Screw,
            "unscrew" => TaskKind::Unscrew,
            "place" => TaskKind::Place,
            _ => TaskKind::Lift,
        };
        self.hardware.run(&self.task, kind, &settings, &self.wrist)
    }
}

impl Hold {
    /// Takes hold, and holds.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let mut settings = self.hardware.task_settings()?;
        settings.lift.lift_mm = 0.0;
        settings.lift.hold_ns = match self.for_s {
            None => WITHOUT_END_NS,
            Some(s) if (0.0..=1e6).contains(&s) => (s * 1e9) as u64,
            Some(s) => return Err(Failure::Arguments(anyhow!("--for-s: expected 0 to 1000000 s, got {s}"))),
        };
        self.hardware.run("hold", TaskKind::Lift, &settings, "dry")
    }
}

impl Hardware {
    fn task_settings(&self) -> Result<TaskSettings, Failure> {
        let mut settings = config::load_task_settings(self.settings.as_deref()).map_err(Failure::arguments)?;
        if let Some(name) = &self.controller {
            settings.controller = super::demo::controller(name)?;
        }
        Ok(settings)
    }

    fn run(&self, task: &str, kind: TaskKind, settings: &TaskSettings, wrist: &str) -> Result<Outcome, Failure> {
        if !(0.1..=1000.0).contains(&self.rate_hz) {
            return Err(Failure::Arguments(anyhow!("--rate-hz: expected 0.1 to 1000 Hz, got {}", self.rate_hz)));
        }
        let monitor = Settings::default();
        let fingers = self.fingers()?;
        let driver =
            gripper::driver(&self.gripper, self.gripper_config.as_deref()).map_err(super::gripper::opening_failed)?;
        let (settings, fitted) = fit(settings, kind, driver.config()).map_err(Failure::Arguments)?;
        let mut around = self.around(&fingers, kind, &settings, &monitor)?;
        let folder = self.output.clone().unwrap_or_else(|| super::demo::next_free("slipbound-run"));
        let sensors: Vec<Sensor> = fingers.iter().map(|finger| finger.sensor.clone()).collect();
        let mut chronicle = Chronicle::create(&folder, &self.info(task, &settings, &monitor, &fingers)?, &sensors)?;
        if let Some(fitted) = fitted {
            chronicle.note(now_ns(), &fitted)?;
        }
        let interrupted = interruption::listen()?;
        let mut gripper = gripper::Device::open(&self.gripper, self.gripper_config.as_deref())
            .map_err(super::gripper::opening_failed)?;
        let mut wrist = wrist::open(wrist).map_err(|error| match error {
            wrist::Error::Address { .. } => Failure::arguments(error),
            other => Failure::Work(other.into()),
        })?;
        let period_ns = (1e9 / self.rate_hz) as u64;
        let from_ns = now_ns();
        let mut due_ns = from_ns;
        let is_due = || {
            let now_ns = now_ns();
            let is_due = now_ns >= due_ns;
            if is_due {
                due_ns = (due_ns + period_ns).max(now_ns.saturating_sub(period_ns));
            }
            is_due
        };
        let ran = live::run(&mut around, &mut gripper, wrist.as_mut(), &interrupted, is_due, |around, told| {
            chronicle.turn(around, told, None)
        });
        let held = gripper.state().ok().and_then(|state| state.pressed_n());
        drop(gripper);
        self.end(task == "hold", ran, held, chronicle)
    }

    /// Says how it went.
    fn end(
        &self,
        is_hold: bool,
        ran: anyhow::Result<()>,
        held_n: Option<f64>,
        mut chronicle: Chronicle,
    ) -> Result<Outcome, Failure> {
        if let Err(e) = &ran {
            chronicle.note(now_ns(), &format!("{e:#}"))?;
        }
        let phase = chronicle.phase();
        let measures = &mut chronicle.measures;
        if ran.is_ok() && is_hold && matches!(phase, Some(Phase::Working | Phase::Waiting)) {
            measures.ending = Some(Ending::Held); // to the end of the source
        }
        let ending = measures.ending;
        let row = |name: &str, value: String| Row { name: name.into(), value, ..Row::default() };
        let rows = [
            row("ended", ending.map_or("not before the end of the source".into(), |ending| format!("{ending:?}"))),
            row("alarms", measures.alarms_count.to_string()),
            row("largest grip", format!("{:.0} N", measures.most_n)),
            row("grip at the end", held_n.map_or("unknown".into(), |n| format!("{n:.1} N per finger"))),
        ];
        let (mut terminal, page) = chronicle.finish(&rows)?;
        terminal.say(&format!("report: {}", page.display()))?;
        ran?;
        match ending {
            None if phase.is_none() => {
                let expected = "expected ten bright frames of the open hand to begin with, got none in";
                Err(anyhow!("{expected} {}", self.sources.join(" and ")).into())
            }
            Some(ending) if !ending.is_success() => Err(anyhow!("{}", ending.evidence()).into()),
            _ => Ok(Outcome::Done),
        }
    }

    fn fingers(&self) -> Result<Vec<Finger>, Failure> {
        let fingers: Vec<Finger> = match (&self.hand, &self.sensor) {
            (Some(hand), _) => {
                let hand = hand_file::load(hand).map_err(Failure::arguments)?;
                let finger = |f: hand_file::Finger| Finger { name: f.name, mounting: f.mounting, sensor: f.sensor };
                hand.fingers.into_iter().map(finger).collect()
            }
            (None, Some(sensor)) => {
                let sensor = sensors::load(sensor).map_err(Failure::arguments)?;
                let sides = [(Side::Left, "left"), (Side::Right, "right")];
                let finger = |(side, name): &(Side, &str)| Finger {
                    name: (*name).into(),
                    mounting: Mounting::on(*side),
                    sensor: sensor.clone(),
                };
                sides.iter().take(self.sources.len()).map(finger).collect()
            }
            (None, None) => {
                let names: Vec<&str> = sensors::names().collect();
                let names = names.join(", ");
                return Err(Failure::Arguments(anyhow!(
                    "expected --hand FILE.toml or --sensor with a FILE.toml or one of {names}, got neither"
                )));
            }
        };
        if fingers.len() != self.sources.len() {
            let (expected, got) = (fingers.len(), self.sources.len());
            return Err(Failure::Arguments(anyhow!("expected a SOURCE for each of {expected} fingers, got {got}")));
        }
        Ok(fingers)
    }

    fn around(
        &self,
        fingers: &[Finger],
        kind: TaskKind,
        settings: &TaskSettings,
        monitor: &Settings,
    ) -> Result<ClosedLoop, Failure> {
        let mut eyes = Vec::new();
        for (finger, uri) in fingers.iter().zip(&self.sources) {
            let source = source::open(uri).map_err(Failure::arguments)?;
            eyes.push(Eye::new(&finger.name, finger.mounting, finger.sensor.clone(), monitor.clone(), source));
        }
        let stiffness = fingers.first().and_then(|finger| finger.sensor.shear_stiffness_mpa_per_mm());
        let task = settings.task(kind, stiffness).map_err(Failure::arguments)?;
        ClosedLoop::new(eyes, task).map_err(Failure::Arguments)
    }

    fn info(
        &self,
        task: &str,
        settings: &TaskSettings,
        monitor: &Settings,
        fingers: &[Finger],
    ) -> Result<RunInfo, Failure> {
        let mut all = toml::Table::new();
        all.insert("task".into(), toml::Table::try_from(settings).context("settings as TOML")?.into());
        all.insert("monitor".into(), toml::Table::try_from(monitor).context("settings as TOML")?.into());
        all.insert("gripper".into(), self.gripper.clone().into());
        Ok(RunInfo {
            task: task.into(),
            controller: super::demo::name_of(settings.controller).into(),
            source: self.sources.join(", "),
            seed: 0,
            settings: all,
            fingers: fingers.iter().map(|finger| finger.name.clone()).collect(),
        })
    }
}
