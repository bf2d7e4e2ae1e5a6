//! `slipbound-ros2 hold` and `slipbound-ros2 run`: the library's control loop with a gripper and a wrist that are nodes.

use super::Done;
use slipbound::control::{ControlError, ControlLoop, Cycle, CycleObserver, CycleView};
use slipbound::finger_pipeline::FingerView;
use slipbound::image::SizePx;
use slipbound::port::Next;
use slipbound::setting::SettingError;
use slipbound::task::{Ending, TaskKind, TaskSettings};
use slipbound_rig::config::Error as ConfigError;
use slipbound_rig::link::now_ns;
use slipbound_rig::printable::printable;
use slipbound_rig::realtime::{self, Finished, FramesDue, MonitorWorkers, QueuedObserver};
use slipbound_rig::run::{self, FingerInfo, Row, RunInfo, RunNotes, RunRecorder};
use slipbound_ros2::config::{self, Config, Control, GripperAddress};
use slipbound_ros2::counters::FingerCounters;
use slipbound_ros2::error::Error;
use slipbound_ros2::ros_hand::RosHand;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Cycles that may wait for the network, the disk or the terminal: four seconds at 30 Hz.
const QUEUE_DEPTH_COUNT: usize = 128;

/// Longest wait at the end for the disk, and for network and terminal, to take the queue.
const LONGEST_DISK: Duration = Duration::from_secs(10);
const LONGEST_OTHERS: Duration = Duration::from_secs(1);

/// Least change of the commanded force that is printed, N.
const SHOWN_STEP_N: f64 = 4.5;

/// The arguments of both commands.
#[derive(Debug, clap::Args)]
struct Files {
    /// Parameters: ros2/example.toml has them all. The table [control] names gripper, wrist and controller
    #[arg(value_name = "FILE.toml")]
    config: PathBuf,
    /// The folder of the run: new or empty [default: slipbound-run, or with the next free number]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

/// The arguments of `slipbound-ros2 hold`.
#[derive(Debug, clap::Args)]
pub struct Hold {
    #[command(flatten)]
    files: Files,
    /// Duration in seconds [default: until Ctrl-C]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    for_s: Option<f64>,
}

/// The arguments of `slipbound-ros2 run`.
#[derive(Debug, clap::Args)]
pub struct Run {
    /// The task
    #[arg(value_parser = TaskKind::NAMES)]
    task: String,
    #[command(flatten)]
    files: Files,
}

/// What is done with the hand.
struct Work<'a> {
    /// What the run is called.
    name: &'a str,
    task: TaskKind,
    settings: TaskSettings,
    /// Base name of the wrist's topics; None where it is left alone.
    wrist: Option<&'a str>,
}

impl Hold {
    /// Takes hold, and holds.
    pub fn run(&self, stop: &AtomicBool) -> Done {
        let (config, control) = self.files.load()?;
        let settings = control.settings.holding(self.for_s);
        let settings = settings.map_err(|e| Error::from(SettingError { key: "--for-s".into(), ..e }))?;
        self.files.run(&config, &control, Work { name: "hold", task: TaskKind::Lift, settings, wrist: None }, stop)
    }
}

impl Run {
    /// Runs the task to its end.
    pub fn run(&self, stop: &AtomicBool) -> Done {
        let (config, control) = self.files.load()?;
        let task: TaskKind = self.task.parse().map_err(Error::from)?;
        let wrist = control.wrist.as_deref();
        let wrist = wrist.ok_or_else(|| self.files.missing("control.wrist", "ros2:///BASE of its topics"))?;
        let work = Work { name: task.name(), task, settings: control.settings, wrist: Some(wrist) };
        self.files.run(&config, &control, work, stop)
    }
}

impl Files {
    fn load(&self) -> Result<(Config, Control), Error> {
        if self.output.as_deref().is_some_and(|folder| folder == Path::new("-")) {
            let (key, expected) = ("--output".into(), "the name of a folder".into());
            return Err(SettingError { key, expected, got: "-".into() }.into());
        }
        let domain_id = std::env::var("ROS_DOMAIN_ID").ok();
        let config = config::load(&self.config, domain_id.as_deref())?;
        let control = config.control.clone();
        let expected = "a table with the gripper: what is to be commanded has to be named";
        control.map(|control| (config, control)).ok_or_else(|| self.missing("control", expected))
    }

    fn missing(&self, key: &str, expected: &str) -> Error {
        let source = SettingError { key: key.into(), expected: expected.into(), got: "none".into() };
        ConfigError::OutOfRange { file: self.config.display().to_string(), source }.into()
    }

    /// Does this work to its end. Everything is checked before the network is joined, and nothing is commanded before the
    /// nodes of gripper and wrist and the images are there.
    fn run(&self, config: &Config, control: &Control, work: Work<'_>, stop: &AtomicBool) -> Done {
        let Work { name, task, settings, wrist } = work;
        let sensors: Vec<_> = config.fingers.iter().map(|finger| &finger.finger.sensor).collect();
        for sensor in &sensors {
            settings.check_finger(task, sensor).map_err(Error::from)?;
        }
        let stiffness = sensors.first().and_then(|sensor| sensor.shear_stiffness_mpa_per_mm());
        let task_steps = settings.task(task, stiffness).map_err(Error::from)?;
        let folder = self.output.clone().unwrap_or_else(|| run::free_folder("slipbound-run"));
        run::refuse_used_folder(&folder).map_err(Error::from)?;

        let mut hand = RosHand::join(config, control, wrist)?;
        let fingers = std::mem::take(&mut hand.fingers);
        let topics: Vec<&str> = config.fingers.iter().map(|finger| finger.image_topic.as_str()).collect();
        let info = RunInfo {
            name: name.into(),
            task,
            source: topics.join(", "),
            seed: 0,
            task_settings: settings,
            monitor_settings: config.settings.clone(),
            notes: notes(control, wrist),
            fingers: fingers.iter().map(FingerInfo::of).collect(),
        };
        let control_loop = ControlLoop::new(fingers, task_steps).map_err(Error::from)?;
        say(&format!("{name}: in domain {}; Ctrl-C ends it", config.domain_id));
        hand.await_all(stop, &mut |missing| say(&format!("{name}: waits for {missing}")))?;
        let recorder = RunRecorder::create(&folder, &info, false).map_err(Error::from)?.limited(control.limits);
        run_cycles(control_loop.with_runner(Box::new(MonitorWorkers::new())), hand, recorder, control, stop)
    }
}

/// Further conditions of the run.
fn notes(control: &Control, wrist: Option<&str>) -> toml::Table {
    let gripper = match &control.gripper {
        GripperAddress::Topics(base) => format!("ros2://{base}"),
        GripperAddress::Action(action) => format!("ros2+action://{}", action.action),
    };
    let wrist = wrist.map(|base| ("wrist".into(), format!("ros2://{base}").into()));
    [("gripper".into(), gripper.into())].into_iter().chain(wrist).collect()
}

/// Runs the cycles to their end, writes the page, and decides whether the work was done.
fn run_cycles(
    mut control_loop: ControlLoop,
    hand: RosHand,
    recorder: RunRecorder,
    control: &Control,
    stop: &AtomicBool,
) -> Done {
    let RosHand { mut gripper, mut wrist, arrivals, reports, overlays, counters, .. } = hand;
    let mut due = FramesDue::new(arrivals, control.limits.max_skew_ns);
    let console = Console { notes: RunNotes::new(control.limits), last: None };
    let mut observer = (
        (
            QueuedObserver::reporting_losses(recorder, QUEUE_DEPTH_COUNT, false, RunRecorder::lost_cycles),
            QueuedObserver::new(console, QUEUE_DEPTH_COUNT, false),
        ),
        ((QueuedObserver::new(reports, QUEUE_DEPTH_COUNT, false), overlays), Score::default()),
    );
    let ran = realtime::run(
        &mut control_loop,
        gripper.as_mut(),
        wrist.as_mut(),
        stop,
        &mut || due.is_due(now_ns()),
        &mut observer,
    );
    let left_with_n = control_loop.left_with_n();
    let held_n = gripper.poll().ok().and_then(|state| state.pressed_n());
    let ((recorder, console), ((reports, _), score)) = observer;
    console.finish(LONGEST_OTHERS);
    let unpublished_count = reports.finish(LONGEST_OTHERS).lost_count;
    let Finished { observer: recorder, lost_count } = recorder.finish(LONGEST_DISK);
    let ending = score.ending;
    let images: Vec<(String, bool)> = score.images.iter().zip(&counters).map(|(images, of)| images.tally(of)).collect();
    let mut lost = losses(&images, lost_count, unpublished_count);
    let row = |name: &str, value: String| Row { name: name.into(), value, ..Row::default() };
    let unfinished = || ran.as_ref().err().map_or("not before the end of the source".into(), ToString::to_string);
    let (lasted, until) = run::duration(score.ended_s, score.time_s, ending);
    let rows = [
        row("ended", ending.map_or_else(unfinished, |ending| ending.name().into())),
        row(&format!("time {until}"), lasted),
        row("alarms", score.alarms_count.to_string()),
        row("largest force commanded", format!("{:.1} N", score.most_n.max(left_with_n.unwrap_or(0.0)))),
        row("grip at the end", held_n.map_or("unknown".into(), |n| format!("{n:.1} N per finger"))),
    ];
    let left = left_with_n.map(run::left_in_words);
    left.iter().for_each(|line| say(line));
    images.iter().for_each(|(line, _)| say(&format!("  {line}")));
    rows.iter().for_each(|row| say(&format!("  {:<28}{}", row.name, row.value)));
    match recorder {
        None => lost.push("report.html was not written: the disk did not answer".into()),
        Some(mut recorder) => {
            recorder.end_cycles();
            images.iter().for_each(|(line, _)| recorder.note(now_ns(), line));
            if let Err(e) = &ran {
                recorder.note(now_ns(), &e.to_string());
            }
            left.iter().for_each(|line| recorder.note(now_ns(), line));
            if let (count @ 1.., Some(first)) = recorder.failures() {
                lost.push(format!("{count} times something could not be written, the first: {first}"));
            }
            match recorder.finish(&rows, ending) {
                Ok(page) => say(&format!("report: {}", page.display())),
                Err(e) => lost.push(e.to_string()),
            }
        }
    }
    concluded(ran, ending, &lost)
}

/// What was lost on the way: images, and cycles that the queues to the disk and to the network had no room for.
fn losses(images: &[(String, bool)], unwritten_count: u64, unpublished_count: u64) -> Vec<String> {
    let of_images = images.iter().filter(|(_, is_whole)| !is_whole).map(|(line, _)| line.clone());
    let cycles = [
        (unwritten_count, "cycles were not written: the disk did not keep up"),
        (unpublished_count, "cycles were not published: the network did not keep up"),
    ];
    let of_cycles = cycles.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}"));
    of_images.chain(of_cycles).collect()
}

/// Whether the work was done and nothing lost on the way. What was lost is told whatever ended the work.
fn concluded(ran: Result<(), ControlError>, ending: Option<Ending>, lost: &[String]) -> Done {
    let failed = match (ran, ending) {
        (Err(error), _) => Some(error.to_string()),
        (Ok(()), Some(ending)) => Some(ending.evidence().to_owned()).filter(|_| !ending.is_success()),
        (Ok(()), None) => Some("the images ended before the task did".into()),
    };
    match (failed, lost.is_empty()) {
        (None, true) => Ok(()),
        (None, false) => Err(Error::DataLost(lost.join("; ")).into()),
        (Some(why), true) => Err(why.into()),
        (Some(why), false) => Err(format!("{why}; {}", lost.join("; ")).into()),
    }
}

/// What a run comes to.
#[derive(Default)]
struct Score {
    ending: Option<Ending>,
    /// When the task ended, and the time of the last command, s.
    ended_s: Option<f64>,
    time_s: f64,
    alarms_count: u32,
    most_n: f64,
    images: Vec<ImageSizes>,
}

/// The size of a finger's first image, and how many had another one.
#[derive(Clone, Default)]
struct ImageSizes {
    finger: String,
    first: Option<SizePx>,
    other_count: u64,
}

impl ImageSizes {
    /// A line with what came of the images of these counters, and whether all were whole and of the first one's size.
    fn tally(&self, counters: &Mutex<FingerCounters>) -> (String, bool) {
        let FingerCounters { received_count, torn_count, .. } =
            *counters.lock().unwrap_or_else(PoisonError::into_inner);
        let mut line = format!("{}: {received_count} images received, {torn_count} torn", self.finger);
        if self.other_count > 0 {
            line = format!("{line}, {} of another size than the first", self.other_count);
        }
        (line, torn_count + self.other_count == 0)
    }
}

impl CycleObserver for Score {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        if self.images.is_empty() {
            let images = |finger: &FingerView<'_>| ImageSizes { finger: finger.name.into(), ..ImageSizes::default() };
            self.images = view.fingers.iter().map(images).collect();
        }
        for (finger, images) in view.fingers.iter().zip(&mut self.images) {
            let size = finger.frame.size;
            let is_other = *finger.next == Next::Frame && *images.first.get_or_insert(size) != size;
            images.other_count += u64::from(is_other);
        }
        let Some(cycle) = view.cycle() else { return };
        self.time_s = cycle.time_ns as f64 * 1e-9;
        if let (Some(ending), None) = (cycle.ending(), self.ending) {
            (self.ending, self.ended_s) = (Some(ending), Some(self.time_s));
        }
        self.alarms_count = cycle.alarms_count;
        self.most_n = cycle.grip_command.force_n().map_or(self.most_n, |n| n.max(self.most_n));
    }
}

/// Prints a line where something happened.
struct Console {
    notes: RunNotes,
    last: Option<Cycle>,
}

impl CycleObserver for Console {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let mut lines = self.notes.see(view);
        if let Some(cycle) = view.cycle() {
            let last = self.last.replace(cycle);
            if last.map_or(0, |last| last.slips_count) < cycle.slips_count {
                let force_n = cycle.gripper.pressed_n().unwrap_or(0.0);
                lines.push(format!("slip {} at {force_n:.1} N", cycle.slips_count));
            }
            let commanded_n = last.and_then(|last| last.grip_command.force_n()).zip(cycle.grip_command.force_n());
            if let Some((_, to_n)) = commanded_n.filter(|(from_n, to_n)| (from_n - to_n).abs() >= SHOWN_STEP_N) {
                lines.push(format!("grip to {to_n:.1} N"));
            }
            if let Some(ending) = cycle.ending() {
                lines.push(ending.evidence().into());
            }
        }
        lines.iter().for_each(|line| say(&format!("{:6.2} s  {line}", view.now_ns as f64 * 1e-9)));
    }
}

/// A line for the user; a terminal that is gone does not end the run, everything is in the folder.
fn say(line: &str) {
    let _ = writeln!(std::io::stdout(), "{}", printable(line));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_lost_is_told_whatever_ended_the_work() {
        let images = [("left: 9 images received, 1 torn".into(), false), ("right: 9 images received".into(), true)];
        let lost = losses(&images, 0, 2);
        assert_eq!(lost, [images[0].0.as_str(), "2 cycles were not published: the network did not keep up"]);
        let both = lost.join("; ");
        let interrupted = || Err(ControlError::Interrupted);
        for (ran, ending, why) in [
            (interrupted(), None, ControlError::Interrupted.to_string()),
            (interrupted(), Some(Ending::Held), ControlError::Interrupted.to_string()),
            (Ok(()), Some(Ending::Lost), Ending::Lost.evidence().to_owned()),
            (Ok(()), None, "the images ended before the task did".to_owned()),
        ] {
            let told = concluded(ran, ending, &lost).expect_err("failed");
            assert_eq!(told.to_string(), format!("{why}; {both}"));
            assert!(told.downcast_ref::<Error>().is_none(), "exit code 1");
        }
        let told = concluded(Ok(()), Some(Ending::Held), &lost).expect_err("data lost");
        assert_eq!(told.to_string(), format!("finished, but {both}"));
        assert!(matches!(told.downcast_ref::<Error>(), Some(Error::DataLost(_))), "exit code 3");
        assert!(concluded(Ok(()), Some(Ending::Held), &[]).is_ok());
        assert_eq!(
            concluded(interrupted(), None, &[]).expect_err("failed").to_string(),
            ControlError::Interrupted.to_string()
        );
    }
}
