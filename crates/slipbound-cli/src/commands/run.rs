//! `slipbound run` and `slipbound hold`: a task with a real gripper and wrist.

use super::hand_rest::{self, HandRest};
use super::inputs;
use super::recording::{LiveCamera, marked, open_live};
use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::run_output::{FrameTally, RunOutput, RunScorer};
use crate::terminal::Terminal;
use anyhow::anyhow;
use slipbound::control::ControlLoop;
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::hand::{Mounting, Side};
use slipbound::monitor::Settings;
use slipbound::port::Gripper as _;
use slipbound::task::{ControllerKind, Ending, Missing, Phase, TaskKind, TaskSettings};
use slipbound_rig::container::{Inlet, McapObserver, Recorder, TappedSource, Written};
use slipbound_rig::gripper::clamp_to_gripper;
use slipbound_rig::link::now_ns;
use slipbound_rig::realtime::{self, FramesDue, MonitorWorkers};
use slipbound_rig::run::{self, CameraLimits, FingerInfo, Row, RunInfo};
use slipbound_rig::source::{Encoded, Newest};
use slipbound_rig::{config, gripper, sensors, source, wrist};
use std::path::{Path, PathBuf};

/// Frames of a recording that are read ahead, so that a slow disk does not delay a cycle.
const READ_AHEAD_COUNT: usize = 8;

/// The duration given to an endless hold, ns: eleven days.
const WITHOUT_END_NS: u64 = 1_000_000_000_000_000;

/// Longest time between two cycles where frames come at a camera's rate, ns.
const LONGEST_CYCLE_NS: u64 = 100_000_000;

/// The error of a task that ended while it was still taking hold.
pub(super) fn never_began(missing: Option<Missing>, refused_lowering: Option<&str>) -> anyhow::Error {
    // Without a frame that can be judged the task never runs.
    let why = missing.map_or("no finger has shown a frame that can be judged", Missing::in_words);
    match refused_lowering {
        Some(refused) => anyhow!("the work never began: {why}; {refused}"),
        None => anyhow!("the work never began: {why}"),
    }
}

/// The state when the loop ended.
struct Ended {
    /// The force, N per finger.
    held_n: Option<f64>,
    /// What the task waited for.
    missing: Option<Missing>,
    /// The number of frames in which the rest frame is searched.
    window_count: u32,
    /// Whether every frame arrived whole and in the size of the first.
    is_whole: bool,
}

/// The arguments of `slipbound run`.
#[derive(Debug, clap::Args)]
pub struct Run {
    /// The task
    #[arg(value_parser = TaskKind::NAMES)]
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
    /// Duration in seconds [default: until Ctrl-C or the end of the source]
    #[arg(long, value_name = "SECONDS")]
    for_s: Option<f64>,
}

/// What both need.
#[derive(Debug, clap::Args)]
struct Hardware {
    /// A camera (docs/cameras.md) or a recording for every finger, the left one first. It must begin with the hand open
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
    #[arg(long, value_name = "HZ", default_value_t = 30.0)]
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

impl Run {
    /// Runs the task to its end.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let settings = self.hardware.task_settings()?;
        let task: TaskKind = self.task.parse().map_err(Failure::arguments)?;
        self.hardware.run(task.name(), task, &settings, &self.wrist)
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
            settings.controller = name.parse().map_err(Failure::arguments)?;
        }
        Ok(settings)
    }

    fn run(&self, name: &str, task: TaskKind, settings: &TaskSettings, wrist: &str) -> Result<Outcome, Failure> {
        self.output.as_deref().map_or(Ok(()), inputs::refuse_stdout_folder)?;
        if !(0.1..=1000.0).contains(&self.rate_hz) {
            return Err(Failure::Arguments(anyhow!("--rate-hz: expected 0.1 to 1000 Hz, got {}", self.rate_hz)));
        }
        let ms = |ms: u64| ms.saturating_mul(1_000_000);
        self.sources
            .iter()
            .filter_map(|uri| source::doubtful_rate(uri))
            .for_each(|doubt| Terminal::plain().note(&doubt));
        let limits = CameraLimits { max_silence_ns: ms(self.max_silence_ms), max_skew_ns: ms(self.max_skew_ms) };
        let mut monitor = Settings::default();
        if let [HandRest::Live(count)] = self.rest[..] {
            monitor.rest.window_count = count;
        }
        let fingers = hand_rest::saved(&self.rest, self.fingers()?, &monitor)?;
        let driver = gripper::driver(&self.gripper, self.gripper_config.as_deref())?;
        let (settings, clamped) = clamp_to_gripper(settings, task, driver.config()).map_err(Failure::arguments)?;
        let recorder = self.recorder(&fingers)?;
        let inlet = recorder.as_ref().map(Recorder::inlet);
        let (mut control, cameras) = self.control(&fingers, task, &settings, &monitor, inlet.as_ref())?;
        let folder = self.output.clone().unwrap_or_else(|| run::free_folder("slipbound-run"));
        let info = RunInfo {
            name: name.into(),
            task,
            source: self.sources.join(", "),
            seed: 0,
            task_settings: settings,
            monitor_settings: monitor.clone(),
            notes: self.notes(&cameras),
            fingers,
        };
        if let Some(recorder) = &recorder {
            describe(recorder, &info)?;
        }
        // Checked before the gripper is searched; nothing is created before the gripper is found.
        run::refuse_used_folder(&folder)?;
        let stop = interruption::listen()?;
        let mut gripper = gripper::Device::open(&self.gripper, self.gripper_config.as_deref())?;
        let mut wrist = wrist::open(wrist).map_err(|error| match error {
            wrist::Error::Address { .. } => Failure::arguments(error),
            other => Failure::Work(other.into()),
        })?;
        let keeps_frames = self.keeps_frames();
        let output = RunOutput::create(&folder, &info, keeps_frames)?;
        if let Some(recorder) = &recorder {
            recorder.begin(); // nothing can be refused any more
        }
        let mut output = output
            .recording(inlet.map(|inlet| McapObserver::new(inlet, info.clone(), self.sources.clone())))
            .limited(limits);
        if let Some(clamped) = clamped {
            output.note(now_ns(), &clamped);
        }
        let period_ns = (1e9 / self.rate_hz) as u64;
        // A recording that is played slowly is silent between two frames as intended.
        let longest_cycle_ns = LONGEST_CYCLE_NS.max(period_ns + period_ns / 2);
        let mut due_ns = now_ns();
        let mut frames_due = FramesDue::new(cameras.iter().map(|(_, live)| live.arrivals.clone()), limits.max_skew_ns);
        let mut is_due = || {
            let now_ns = now_ns();
            if !cameras.is_empty() {
                return frames_due.is_due(now_ns);
            }
            let is_due = now_ns >= due_ns;
            if is_due {
                due_ns = (due_ns + period_ns).max(now_ns.saturating_sub(period_ns));
            }
            is_due
        };
        let mut observer = (output.queued(keeps_frames), RunScorer::new(control.task().grip().limits().most_n));
        let ran = realtime::run_at_least_every(
            longest_cycle_ns,
            &mut control,
            &mut gripper,
            wrist.as_mut(),
            &stop,
            &mut is_due,
            &mut observer,
        );
        let missing = control.task().missing();
        let held_n = gripper.poll().ok().and_then(|state| state.pressed_n());
        drop(gripper);
        let (queued, scorer) = observer;
        let mut output = queued.finish();
        let names: Vec<String> = control.fingers().iter().map(|finger| finger.name().to_owned()).collect();
        drop(control); // its sources hand in no more frames
        finish_recording(recorder, &mut output);
        let is_whole = tell_frames(&names, &scorer.tallies, &cameras, &mut output);
        let ended = Ended { held_n, missing, window_count: monitor.rest.window_count, is_whole };
        self.end(name, ran.map_err(Into::into), &ended, output, scorer)
    }

    /// Whether every frame is kept in the folder of the run.
    fn keeps_frames(&self) -> bool {
        self.record == Some(None)
    }

    /// Reports the outcome.
    fn end(
        &self,
        name: &str,
        ran: anyhow::Result<()>,
        ended: &Ended,
        mut output: RunOutput,
        scorer: RunScorer,
    ) -> Result<Outcome, Failure> {
        if let Err(e) = &ran {
            output.note(now_ns(), &format!("{e:#}"));
        }
        let RunScorer { mut score, phase, refused_lowering, tallies, .. } = scorer;
        let &Ended { held_n, missing, window_count, is_whole } = ended;
        if ran.is_ok() && name == "hold" && matches!(phase, Some(Phase::Working | Phase::Waiting)) {
            score.ending = Some(Ending::Held); // to the end of the source
        }
        let ending = score.ending;
        let row = |name: &str, value: String| Row { name: name.into(), value, ..Row::default() };
        let rows = [
            row("ended", ending.map_or("not before the end of the source", Ending::name).into()),
            row("alarms", score.alarms_count.to_string()),
            row("largest grip", format!("{:.1} N", score.most_n)),
            row("grip at the end", held_n.map_or("unknown".into(), |n| format!("{n:.1} N per finger"))),
        ];
        let outcome = output.finish(&rows, ending, |page| format!("report: {page}"))?;
        ran?;
        match ending {
            None if phase.is_none() => {
                let got = |(number, source): (usize, &String)| {
                    format!("{} frames of {source}", tallies.get(number).map_or(0, |tally| tally.whole_count))
                };
                let got: Vec<String> = self.sources.iter().enumerate().map(got).collect();
                let expected = format!("expected {window_count} bright frames of the open hand to begin with");
                Err(anyhow!("{expected}, got {}", got.join(" and ")).into())
            }
            None if phase == Some(Phase::Grasping) => Err(never_began(missing, refused_lowering.as_deref()).into()),
            None => {
                let was = if phase == Some(Phase::Waiting) { "waiting" } else { "working" };
                Err(anyhow!("the source ended before the task did: {name} was still {was}, its end was not seen")
                    .into())
            }
            Some(ending) if !ending.is_success() => Err(anyhow!("{}", ending.evidence()).into()),
            Some(_) => Ok(if is_whole { outcome } else { Outcome::DataLost }),
        }
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
                    let mut source = source::open(uri).map_err(Failure::arguments)?;
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

/// Reports the frames of every finger; returns whether all arrived whole and in the size of the first.
fn tell_frames(
    names: &[String],
    tallies: &[FrameTally],
    cameras: &[(String, LiveCamera)],
    output: &mut RunOutput,
) -> bool {
    let mut is_whole = true;
    for (number, name) in names.iter().enumerate() {
        let FrameTally { whole_count, torn_count, other_size_count, .. } =
            tallies.get(number).copied().unwrap_or_default();
        let camera = cameras.iter().find(|(of, _)| of == name).map(|(_, live)| live);
        // A torn frame that was replaced by a newer one is lost all the same.
        let torn_count = camera.map_or(torn_count, |live| live.tally.counts().torn_count);
        let mut line = match camera {
            Some(live) => format!("{name}: camera: {}", live.line()),
            None => format!("{name}: {whole_count} frames, {torn_count} torn"),
        };
        if other_size_count > 0 {
            line = format!("{line}, {other_size_count} of another size than the first");
        }
        output.note(now_ns(), &line);
        is_whole &= torn_count + other_size_count == 0;
    }
    is_whole
}

/// Writes the description of a run into its recording, with the sensor of every finger and the settings of the
/// monitors.
pub(super) fn describe(recorder: &Recorder, info: &RunInfo) -> Result<(), Failure> {
    for finger in &info.fingers {
        let sensor = toml::to_string(&finger.sensor).map_err(|e| Failure::work("sensor", e))?;
        recorder.attach(&finger.sensor_file(), "text/toml", sensor.into_bytes());
        if let Some((name, bytes)) = finger.rest_file().map_err(|e| Failure::work("rest", e))? {
            recorder.attach(&name, "application/octet-stream", bytes);
        }
    }
    let settings = toml::to_string(&info.monitor_settings).map_err(|e| Failure::work("settings", e))?;
    recorder.attach("settings.toml", "text/toml", settings.into_bytes());
    let run = info.to_toml().map_err(|e| Failure::work("run.toml", e))?;
    recorder.attach("run.toml", "text/toml", run.into_bytes());
    Ok(())
}

/// Closes a recording, and reports what is missing from it.
pub(super) fn finish_recording(recorder: Option<Recorder>, output: &mut RunOutput) {
    match recorder.map(Recorder::finish) {
        None => {}
        Some(Ok(written)) if written.lost_count == 0 => {}
        Some(Ok(Written { lost_count, .. })) => {
            output.lost(format!("{lost_count} frames or lines were not recorded: the disk did not keep up"));
        }
        Some(Err(e)) => output.lost(e.to_string()),
    }
}
