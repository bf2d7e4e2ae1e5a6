//! What `run` and `hold` do: cameras, gripper and wrist in, a run's folder and recording out.
//!
//! ```text
//!   arguments -> fingers, driver settings, recording: checked, nothing created yet
//!             -> gripper, wrist: opened -> the folder -> cycles until the end -> Ended::report
//! ```

use super::ending::{Ended, note_frames};
use super::pace::Pace;
use crate::commands::hand_rest::{self, HandRest};
use crate::commands::inputs;
use crate::commands::recording::{LiveCamera, marked, open_live, open_recording};
use crate::commands::run_recording;
use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::run_output::{RunOutput, RunScorer};
use crate::terminal::{self, Terminal};
use anyhow::anyhow;
use slipbound::control::ControlLoop;
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::hand::{Mounting, Side};
use slipbound::monitor::Settings;
use slipbound::port::{Gripper as _, Jaws, Wrist};
use slipbound::task::{ControllerKind, TaskKind, TaskSettings};
use slipbound_rig::container::{Inlet, McapObserver, Recorder, TappedSource};
use slipbound_rig::gripper::clamp_to_gripper;
use slipbound_rig::link::now_ns;
use slipbound_rig::realtime::{self, MonitorWorkers};
use slipbound_rig::run::{self, CameraLimits, FingerInfo, RunInfo};
use slipbound_rig::source::{Encoded, Newest};
use slipbound_rig::{config, gripper, sensors, source, wrist};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Frames of a recording that are read ahead, so that a slow disk does not delay a cycle.
const READ_AHEAD_COUNT: usize = 8;

/// What is done with the hardware.
pub struct Work<'a> {
    /// What the run is called.
    pub name: &'static str,
    /// The task.
    pub task: TaskKind,
    /// Address of the wrist.
    pub wrist: &'a str,
    /// Whether the object is only held: the end of the source is then an end of the work.
    pub is_hold: bool,
}

/// The arguments of both commands.
#[derive(Debug, clap::Args)]
pub struct Hardware {
    /// A camera (docs/cameras.md), a recording or a scene ('sim:SCENE') for every finger, the left one first. It must begin with the hand open
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
    /// The grip controller: the paper's law ending on evidence (on_slip), exactly the paper's (paper), by slip margin
    /// (margin), one constant force (constant)
    #[arg(long, value_parser = ControllerKind::NAMES)]
    controller: Option<String>,
    /// Settings of grip, controllers and tasks that replace the defaults
    #[arg(long, value_name = "FILE.toml")]
    settings: Option<PathBuf>,
    /// The finger at rest: live:N takes the first N frames, in which nothing may touch it; FILE is one written by
    /// `slipbound tare`, given once for every finger, the left one first, and already the first frame is judged
    /// [default: found among the first 20 frames; a finger in contact is reported]
    #[arg(long, value_name = "live:N|FILE", value_parser = HandRest::parse)]
    rest: Vec<HandRest>,
    /// Frames per second at which recordings are played
    #[arg(long, value_name = "HZ", default_value_t = 30.0, allow_negative_numbers = true)]
    rate_hz: f64,
    /// Keep every frame in the folder of the run, for `slipbound replay`; with =FILE.mcap instead in one file with
    /// every frame, judged or not, reports and cycles
    #[arg(long, value_name = "FILE.mcap", num_args = 0..=1, require_equals = true)]
    record: Option<Option<PathBuf>>,
    /// Report a camera that gives no frame for longer
    #[arg(long, value_name = "MS", default_value_t = 300)]
    max_silence_ms: u64,
    /// Longest wait of a camera's frame for that of the other finger; frames whose time stamps differ by more are
    /// reported
    #[arg(long, value_name = "MS", default_value_t = 20, value_parser = clap::value_parser!(u64).range(0..=1000))]
    max_skew_ms: u64,
    /// The folder of the run: new or empty [default: slipbound-run, or with the next free number]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

/// What is open when the first cycle begins.
struct Opened {
    control: ControlLoop,
    /// Every camera, by the name of its finger.
    cameras: Vec<(String, LiveCamera)>,
    gripper: gripper::Device,
    wrist: Box<dyn Wrist>,
    recorder: Option<Recorder>,
    output: RunOutput,
}

impl Hardware {
    /// The settings of the task, with the controller that was named.
    pub fn task_settings(&self) -> Result<TaskSettings, Failure> {
        let mut settings = config::load_task_settings(self.settings.as_deref()).map_err(Failure::arguments)?;
        if let Some(name) = &self.controller {
            settings.controller = name.parse().map_err(Failure::arguments)?;
        }
        Ok(settings)
    }

    /// Does this work to its end.
    pub fn run(&self, work: &Work<'_>, settings: &TaskSettings) -> Result<Outcome, Failure> {
        self.output.as_deref().map_or(Ok(()), inputs::refuse_stdout_folder)?;
        let limits = self.limits()?;
        let mut monitor = Settings::default();
        if let [HandRest::Live(count)] = self.rest[..] {
            monitor.rest.window_count = count;
        }
        let fingers = hand_rest::saved(&self.rest, self.fingers()?, &monitor)?;
        let driver = gripper::driver(&self.gripper, self.gripper_config.as_deref())?;
        let (settings, clamped) = clamp_to_gripper(settings, work.task, driver.config()).map_err(Failure::arguments)?;
        let recorder = self.recorder(&fingers)?;
        let inlet = recorder.as_ref().map(Recorder::inlet);
        let (control, cameras) = self.control(&fingers, work.task, &settings, &monitor, inlet.as_ref())?;
        let folder = self.output.clone().unwrap_or_else(|| run::free_folder("slipbound-run"));
        let info = RunInfo {
            name: work.name.into(),
            task: work.task,
            source: self.sources.join(", "),
            seed: 0,
            task_settings: settings,
            monitor_settings: monitor.clone(),
            notes: self.notes(&cameras),
            fingers,
        };
        if let Some(recorder) = &recorder {
            run_recording::describe(recorder, &info)?;
        }
        // Checked before the gripper is searched; nothing is created before the gripper is found.
        run::refuse_used_folder(&folder)?;
        let stop = interruption::listen()?;
        let gripper = gripper::Device::open(&self.gripper, self.gripper_config.as_deref())?;
        let wrist = wrist::open(work.wrist).map_err(|error| match error {
            wrist::Error::Address { .. } => Failure::arguments(error),
            other => Failure::Work(other.into()),
        })?;
        let output = RunOutput::create(&folder, &info, self.keeps_frames())?;
        if let Some(recorder) = &recorder {
            recorder.begin(); // nothing can be refused any more
        }
        let mut output = output
            .recording(inlet.map(|inlet| McapObserver::new(inlet, info.clone(), self.sources.clone())))
            .limited(limits);
        if let Some(clamped) = clamped {
            output.note(now_ns(), &clamped);
        }
        let opened = Opened { control, cameras, gripper, wrist, recorder, output };
        self.run_cycles(work, opened, &limits, monitor.rest.window_count, &stop)
    }

    /// Runs the cycles to their end, closes what was opened, and reports. `window_count`: the number of frames in which the
    /// rest frame is searched.
    fn run_cycles(
        &self,
        work: &Work<'_>,
        opened: Opened,
        limits: &CameraLimits,
        window_count: u32,
        stop: &AtomicBool,
    ) -> Result<Outcome, Failure> {
        let Opened { mut control, cameras, mut gripper, mut wrist, recorder, output } = opened;
        let arrivals = cameras.iter().map(|(_, live)| live.arrivals.clone());
        let mut pace = Pace::new(arrivals, limits.max_skew_ns, self.rate_hz, now_ns());
        let most_n = control.task().grip().limits().most_n;
        let mut observer = (output.queued(self.keeps_frames()), RunScorer::new(most_n));
        let ran = realtime::run_at_least_every(
            pace.longest_cycle_ns(),
            &mut control,
            &mut gripper,
            wrist.as_mut(),
            stop,
            &mut || pace.is_due(now_ns()),
            &mut observer,
        );
        let (missing, left_with_n) = (control.task().missing(), control.left_with_n());
        let state = gripper.poll().ok();
        let held_n = state.and_then(|state| state.pressed_n());
        let holds = state.is_some_and(|state| state.jaws == Jaws::Holding);
        drop(gripper);
        let (queued, scorer) = observer;
        let mut output = queued.finish();
        let names: Vec<String> = control.fingers().iter().map(|finger| finger.name().to_owned()).collect();
        drop(control); // its sources hand in no more frames
        let is_whole = note_frames(&names, &scorer.tallies, &cameras, &mut output);
        let ran = ran.map_err(anyhow::Error::from);
        if let Err(e) = &ran {
            output.note(now_ns(), &terminal::in_words(e));
        }
        if let Some(force_n) = left_with_n {
            output.note(now_ns(), &run::left_in_words(force_n));
        }
        run_recording::finish(recorder, &mut output);
        let (name, is_hold) = (work.name, work.is_hold);
        let sources = &self.sources;
        let ended = Ended { name, is_hold, sources, held_n, left_with_n, holds, missing, window_count, is_whole };
        ended.report(ran, output, scorer)
    }

    /// The limits for reports about cameras. Also checks the rate at which recordings are played, and notes doubts about
    /// the rates of their frames.
    fn limits(&self) -> Result<CameraLimits, Failure> {
        if !(0.1..=1000.0).contains(&self.rate_hz) {
            return Err(Failure::Arguments(anyhow!("--rate-hz: expected 0.1 to 1000 Hz, got {}", self.rate_hz)));
        }
        self.sources.iter().filter_map(|uri| source::doubt(uri)).for_each(|doubt| Terminal::plain().note(&doubt));
        let ms = |ms: u64| ms.saturating_mul(1_000_000);
        Ok(CameraLimits { max_silence_ns: ms(self.max_silence_ms), max_skew_ns: ms(self.max_skew_ms) })
    }

    /// Whether every frame is kept in the folder of the run.
    fn keeps_frames(&self) -> bool {
        self.record == Some(None)
    }

    fn fingers(&self) -> Result<Vec<FingerInfo>, Failure> {
        let fingers: Vec<FingerInfo> = match (&self.hand, &self.sensor) {
            (Some(hand), _) => {
                let hand = config::hand::load(hand).map_err(Failure::arguments)?;
                let finger = |f: config::hand::FingerConfig| FingerInfo {
                    name: f.name,
                    mounting: f.mounting,
                    sensor: f.sensor,
                    rest: None,
                };
                hand.fingers.into_iter().map(finger).collect()
            }
            (None, Some(sensor)) => {
                let sensor = sensors::load(sensor).map_err(Failure::arguments)?;
                let finger = |side: Side| FingerInfo {
                    name: side.name().into(),
                    mounting: Mounting::on(side),
                    sensor: sensor.clone(),
                    rest: None,
                };
                [Side::Left, Side::Right].into_iter().map(finger).take(self.sources.len()).collect()
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

    fn control(
        &self,
        fingers: &[FingerInfo],
        task: TaskKind,
        settings: &TaskSettings,
        monitor: &Settings,
        inlet: Option<&Inlet>,
    ) -> Result<(ControlLoop, Vec<(String, LiveCamera)>), Failure> {
        let (mut pipelines, mut cameras) = (Vec::new(), Vec::new());
        for (number, (finger, uri)) in fingers.iter().zip(&self.sources).enumerate() {
            let FingerInfo { name, mounting, sensor, rest } = finger;
            let source = match source::is_live(uri) {
                true => {
                    let (newest, live) = open_live(uri, inlet, number, self.keeps_frames())?;
                    cameras.push((name.clone(), live));
                    newest
                }
                false => {
                    let mut source = open_recording(uri)?;
                    if let Some(inlet) = inlet {
                        source = Box::new(TappedSource::new(source, number, inlet.clone(), true));
                    }
                    if self.keeps_frames() {
                        source = Box::new(Encoded(source));
                    }
                    Newest::every_frame(source, READ_AHEAD_COUNT)
                }
            };
            let source = marked(source, inlet.cloned(), number, false);
            let pipeline = FingerPipeline::new(name, *mounting, sensor.clone(), monitor.clone(), source);
            pipelines.push(match rest {
                Some(saved) => pipeline.with_rest(saved.rest.clone()),
                None if self.rest.is_empty() => pipeline,
                None => pipeline.refusing_touch(),
            });
        }
        let stiffness = fingers.first().and_then(|finger| finger.sensor.shear_stiffness_mpa_per_mm());
        for finger in fingers {
            settings.check_finger(task, &finger.sensor).map_err(Failure::arguments)?;
        }
        let task = settings.task(task, stiffness).map_err(Failure::arguments)?;
        let control = ControlLoop::new(pipelines, task).map_err(Failure::arguments)?;
        Ok((control.with_runner(Box::new(MonitorWorkers::new())), cameras))
    }

    /// The recording in one file that was requested.
    fn recorder(&self, fingers: &[FingerInfo]) -> Result<Option<Recorder>, Failure> {
        let Some(Some(path)) = &self.record else { return Ok(None) };
        let rests = self.rest.iter().map(|rest| match rest {
            HandRest::File(path) => Some(path.as_path()),
            HandRest::Live(_) => None,
        });
        let sensor = self.sensor.as_deref().map(Path::new);
        let others = [sensor, self.hand.as_deref(), self.settings.as_deref(), self.gripper_config.as_deref()];
        inputs::refuse_recording(
            "--record",
            path,
            &self.sources,
            &others.into_iter().chain(rests).collect::<Vec<_>>(),
        )?;
        let names: Vec<String> = fingers.iter().map(|finger| finger.name.clone()).collect();
        Ok(Some(Recorder::create(path, &names, true)?))
    }

    /// Further conditions of the run: the gripper, and the settings of every camera.
    fn notes(&self, cameras: &[(String, LiveCamera)]) -> toml::Table {
        let mut notes = toml::Table::new();
        notes.insert("gripper".into(), self.gripper.clone().into());
        let facts = |live: &LiveCamera| -> toml::Table {
            live.facts.iter().map(|(name, value)| (name.clone(), value.clone().into())).collect()
        };
        if !cameras.is_empty() {
            let all: toml::Table = cameras.iter().map(|(name, live)| (name.clone(), facts(live).into())).collect();
            notes.insert("cameras".into(), all.into());
        }
        notes
    }
}
