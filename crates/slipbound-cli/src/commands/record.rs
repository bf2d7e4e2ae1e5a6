//! `slipbound record`: writes frames of cameras into an MCAP file, as they come.

use super::inputs;
use super::recording::{open_recording, refuse_images_of_one_folder, refused, simulated_sensor};
use crate::interruption;
use crate::outcome::{Failure, Outcome, unless_reader_left};
use crate::terminal::Terminal;
use anyhow::anyhow;
use slipbound::hand::Side;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError, SourceErrorKind};
use slipbound::sensor::Sensor;
use slipbound_rig::config::hand::finger_name;
use slipbound_rig::container::{Recorder, TappedSource};
use slipbound_rig::link::now_ns;
use slipbound_rig::report_summary::frame_name;
use slipbound_rig::sensors;
use slipbound_rig::source::{self, Camera, CameraTally};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Duration;

/// Longest duration that can be requested, s: 32 years, far within the range of ns.
const MOST_S: f64 = 1e9;

/// The arguments of `slipbound record`.
#[derive(Debug, clap::Args)]
pub struct Record {
    /// Cameras (docs/cameras.md), or recordings or scenes ('sim:SCENE') to be put into one file
    #[arg(required = true, value_name = "SOURCE")]
    sources: Vec<String>,
    /// The file, which is replaced
    #[arg(short, long, value_name = "FILE.mcap")]
    output: PathBuf,
    /// Name of a finger, given once for every source [default: finger, or left and right]
    #[arg(long, value_name = "NAME", value_parser = finger_name)]
    finger: Vec<String>,
    /// The sensor of every finger, to go with the recording: a built-in name or a sensor file [default: those that the sources bring along]
    #[arg(long, value_name = "NAME|FILE.toml")]
    sensor: Option<String>,
    /// Duration in seconds, of a recording by the times of its frames, which it must have [default: until Ctrl-C or the end of every source]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    for_s: Option<f64>,
}

/// What was read of a source.
#[derive(Default)]
struct Counted {
    frames_count: u64,
    torn_count: u64,
    /// Why the first torn one is.
    torn_reason: Option<String>,
    /// Whether all that was asked for is there: to the end, or so many seconds.
    is_whole: bool,
}

impl Record {
    /// Records until the sources end, the time is over, writing fails, or Ctrl-C.
    pub fn run(&self) -> Result<Outcome, Failure> {
        refuse_images_of_one_folder(&self.sources)?;
        let names = self.names()?;
        if let Some(for_s) = self.for_s.filter(|s| !(*s > 0.0 && *s <= MOST_S)) {
            return Err(Failure::Arguments(anyhow!(
                "--for-s: expected seconds above 0, at most {MOST_S}, got {for_s}"
            )));
        }
        let given = self.sensor.as_deref().map(sensors::load).transpose().map_err(Failure::arguments)?;
        inputs::refuse_recording("--output", &self.output, &self.sources, &[self.sensor.as_deref().map(Path::new)])?;
        let recorder = Recorder::create(&self.output, &names, false)?;
        let mut terminal = Terminal::with_status();
        for (name, uri) in names.iter().zip(&self.sources) {
            let brought = if given.is_some() { None } else { brought_along(uri, &terminal)? };
            let Some(sensor) = given.clone().or(brought) else { continue };
            let text = toml::to_string(&sensor).map_err(|e| Failure::work("sensor", e))?;
            recorder.attach(&format!("{name}.sensor.toml"), "text/toml", text.into_bytes());
        }
        self.sources.iter().filter_map(|uri| source::doubt(uri)).for_each(|doubt| terminal.note(&doubt));
        let stop = interruption::listen()?;
        let mut opened = Vec::new();
        for (number, (name, uri)) in names.iter().zip(&self.sources).enumerate() {
            let one = open(uri, name, number, &recorder, &terminal, &stop, self.for_s.is_some());
            // Open sources stop reading when the recording is not made.
            opened.push(one.inspect_err(|_| stop.store(true, Ordering::Relaxed))?);
        }
        recorder.begin();
        let for_ns = self.for_s.map(|s| (s * 1e9) as u64);
        let running: Vec<_> = opened.into_iter().map(|one| one.read(&stop, for_ns)).collect();
        self.wait(&stop, &recorder, &running, &names, &terminal);
        terminal.clear_bar();
        let interrupted = stop.swap(true, Ordering::Relaxed);
        let (mut whole_count, mut torn_count, mut is_cut) = (0, 0, false);
        let (mut failed, mut torn) = (None, None);
        // A reader of standard output that has gone costs the recording nothing.
        let mut said = Ok(());
        for ((thread, tally), name) in running.into_iter().zip(&names) {
            match thread.join() {
                Ok(Ok(counted)) => {
                    let Counted { frames_count: frames, torn_count: torn_frames, torn_reason, is_whole } = counted;
                    whole_count += frames;
                    torn_count += torn_frames;
                    torn = torn.or(torn_reason.map(|reason| format!("{name}: the first torn frame: {reason}")));
                    // A camera has no other end.
                    is_cut |= interrupted && !is_whole && tally.is_none();
                    let told = tally
                        .map_or(format!("{frames} frames, {torn_frames} torn"), |tally| tally.counts().to_string());
                    said = said.and(terminal.say(&format!("{name}: {told}")));
                }
                Ok(Err(error)) => drop(failed.get_or_insert(error)),
                Err(_) => return Err(anyhow!("{name}: the thread that reads it has panicked").into()),
            }
        }
        // A recording without its end is known to be cut off; the old file stays if nothing was recorded.
        if let Some(error) = failed {
            drop(recorder);
            return Err(match error.kind {
                SourceErrorKind::Settings => Failure::arguments(error),
                _ => error.into(),
            });
        }
        if whole_count == 0 {
            drop(recorder);
            let came = torn.map_or("no frame came".into(), |torn| format!("no whole frame came ({torn})"));
            return Err(anyhow!("{came}: {} is as it was", self.output.display()).into());
        }
        torn.iter().for_each(|torn| terminal.note(torn));
        if is_cut {
            drop(recorder);
            let seen_count = whole_count + torn_count;
            return Err(anyhow!("interrupted after {seen_count} frames; what was recorded is kept").into());
        }
        let written = recorder.finish().map_err(|e| Failure::Work(e.into()))?;
        said = said.and(terminal.say(&format!("{}: {} frames", self.output.display(), written.frames_count)));
        if written.lost_count > 0 {
            terminal.note(&format!("{} frames were not recorded: the disk did not keep up", written.lost_count));
        }
        let outcome = if torn_count + written.lost_count > 0 { Outcome::DataLost } else { Outcome::Done };
        unless_reader_left(said).map(|()| outcome)
    }

    fn wait(&self, stop: &AtomicBool, recorder: &Recorder, running: &[Running], names: &[String], terminal: &Terminal) {
        let mut is_told = vec![false; running.len()];
        let is_live = self.sources.iter().any(|uri| source::is_live(uri));
        let until_ns = self.for_s.filter(|_| is_live).map(|s| now_ns() + (s * 1e9) as u64);
        while !stop.load(Ordering::Relaxed) && running.iter().any(|(thread, _)| !thread.is_finished()) {
            // A full disk: recording is the only work, so it is reported at once.
            if until_ns.is_some_and(|until_ns| now_ns() >= until_ns) || recorder.has_failed() {
                return;
            }
            for (((thread, _), name), is_told) in running.iter().zip(names).zip(&mut is_told) {
                if let (Some(why), false) = (thread.failure.get(), *is_told) {
                    *is_told = true;
                    terminal.note(&format!("{name}: {why}; the others go on"));
                }
            }
            let told: Vec<String> =
                running.iter().flat_map(|(_, tally)| Some(tally.as_ref()?.counts().to_string())).collect();
            terminal.status(&told.join(" | "));
            thread::sleep(Duration::from_millis(50));
        }
    }

    fn names(&self) -> Result<Vec<String>, Failure> {
        let (names, sources_count) = (&self.finger, self.sources.len());
        let names: Vec<String> = match (names.is_empty(), sources_count) {
            (false, _) => names.clone(),
            (true, 1) => vec!["finger".into()],
            (true, 2) => Side::NAMES.map(str::to_owned).to_vec(),
            (true, count) => (0..count).map(|number| format!("finger{number}")).collect(),
        };
        let is_twice = names.iter().enumerate().any(|(i, name)| names[..i].contains(name));
        if names.len() != sources_count || is_twice {
            let got = names.join(", ");
            return Err(Failure::Arguments(anyhow!("--finger: expected {sources_count} different names, got {got}")));
        }
        Ok(names)
    }
}

/// A source on its thread; the tally of a camera.
type Running = (Reading, Option<Arc<CameraTally>>);

/// A thread that reads a source.
struct Reading {
    thread: thread::JoinHandle<Result<Counted, SourceError>>,
    /// Why it failed, as soon as it has.
    failure: Arc<OnceLock<String>>,
}

impl Reading {
    fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    fn join(self) -> thread::Result<Result<Counted, SourceError>> {
        self.thread.join()
    }
}

/// A source that has been opened.
enum Opened {
    /// A camera is read at once, so that its frames are not old when the last source is open.
    Camera(Running),
    /// A recording waits.
    Recording(TappedSource<Box<dyn FrameSource + Send>>),
}

impl Opened {
    /// `for_ns`: how much of a recording.
    fn read(self, stop: &Arc<AtomicBool>, for_ns: Option<u64>) -> Running {
        match self {
            Opened::Camera(running) => running,
            Opened::Recording(tapped) => (spawn(tapped, stop, for_ns), None),
        }
    }
}

fn open(
    uri: &str,
    name: &str,
    number: usize,
    recorder: &Recorder,
    terminal: &Terminal,
    stop: &Arc<AtomicBool>,
    for_seconds: bool,
) -> Result<Opened, Failure> {
    if !source::is_live(uri) {
        let mut recording = open_recording(uri)?;
        if for_seconds {
            recording = Box::new(Timed { recording, uri: uri.into() });
        }
        return Ok(Opened::Recording(TappedSource::new(recording, number, recorder.inlet(), true)));
    }
    let Camera { source, facts, tally } = source::open_camera(uri).map_err(refused)?;
    let words: Vec<String> = facts.iter().map(|(name, value)| format!("{name} {value}")).collect();
    terminal.note(&format!("{name}: {}", words.join(", ")));
    recorder.metadata(&format!("slipbound.camera.{name}"), facts);
    Ok(Opened::Camera((spawn(TappedSource::new(source, number, recorder.inlet(), false), stop, None), Some(tally))))
}

/// The finger that a recording brings along, or that of a scene. One that cannot be read costs no recording.
fn brought_along(uri: &str, terminal: &Terminal) -> Result<Option<Sensor>, Failure> {
    if source::is_live(uri) {
        return Ok(None);
    }
    if let Some(sensor) = simulated_sensor(uri)? {
        return Ok(Some(sensor));
    }
    let found = sensors::of_recording(uri);
    let found =
        found.inspect_err(|error| terminal.note(&format!("recorded without the sensor file of {uri}: {error}")));
    Ok(found.ok().flatten().map(|(sensor, _)| sensor))
}

fn spawn(source: impl FrameSource + Send + 'static, stop: &Arc<AtomicBool>, for_ns: Option<u64>) -> Reading {
    let stop = stop.clone();
    let failure = Arc::new(OnceLock::new());
    let told = failure.clone();
    let thread = thread::spawn(move || {
        let read = drain(source, &stop, for_ns);
        read.inspect_err(|error| drop(told.set(error.to_string())))
    });
    Reading { thread, failure }
}

fn drain(mut source: impl FrameSource, stop: &AtomicBool, for_ns: Option<u64>) -> Result<Counted, SourceError> {
    let mut counted = Counted::default();
    let mut frame = FrameBuffer::default();
    let mut passed = PassedTime::default();
    while !counted.is_whole && !stop.load(Ordering::Relaxed) {
        match source.next(&mut frame)? {
            Next::Frame => {
                counted.frames_count += 1;
                let passed_ns = frame.time_ns.map(|ns| passed.see(frame.clock, ns));
                counted.is_whole = passed_ns.zip(for_ns).is_some_and(|(passed_ns, for_ns)| passed_ns >= for_ns);
            }
            Next::Torn { reason } => {
                counted.torn_count += 1;
                counted.torn_reason.get_or_insert(reason);
            }
            Next::Silent => {}
            Next::End => counted.is_whole = true,
        }
    }
    Ok(counted)
}

/// The time that has passed by the times of whole frames. From a frame of one clock to one of another none passes.
#[derive(Default)]
struct PassedTime {
    /// The first frame of the present clock, and what had passed before it, ns.
    from: Option<(Clock, u64)>,
    before_ns: u64,
    passed_ns: u64,
}

impl PassedTime {
    /// What has passed up to this frame, ns.
    fn see(&mut self, clock: Clock, time_ns: u64) -> u64 {
        if self.from.is_none_or(|(of, _)| of != clock) {
            (self.from, self.before_ns) = (Some((clock, time_ns)), self.passed_ns);
        }
        let since_ns = self.from.map_or(0, |(_, from_ns)| time_ns.saturating_sub(from_ns));
        self.passed_ns = self.before_ns + since_ns;
        self.passed_ns
    }
}

/// A recording that fails at a frame without a time: its seconds cannot be counted.
struct Timed {
    recording: Box<dyn FrameSource + Send>,
    uri: String,
}

impl FrameSource for Timed {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = self.recording.next(into)?;
        if next == Next::Frame && into.time_ns.is_none() {
            let text = format!("--for-s: {}: expected frames with times, got {} without", self.uri, frame_name(into));
            return Err(SourceError::new(SourceErrorKind::Settings, text).of_file(&self.uri));
        }
        Ok(next)
    }

    fn frames_count(&self) -> Option<u64> {
        self.recording.frames_count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames 0.1 s apart; every third is torn, with the time of another clock, as recordings of an earlier version have.
    struct Torn(u64);

    impl FrameSource for Torn {
        fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
            let number = self.0;
            self.0 += 1;
            (into.time_ns, into.clock) = (Some(number * 100_000_000), Clock::Device);
            if number == 1000 {
                return Ok(Next::End);
            }
            if number % 3 == 1 {
                (into.time_ns, into.clock) = (Some(1_700_000_000_000_000_000), Clock::Host);
                return Ok(Next::Torn { reason: "cut".into() });
            }
            Ok(Next::Frame)
        }
    }

    #[test]
    fn seconds_are_counted_by_the_times_of_one_clock() {
        let counted = drain(Torn(0), &AtomicBool::new(false), Some(2_000_000_000)).expect("reads");
        assert_eq!((counted.frames_count, counted.torn_count, counted.is_whole), (14, 7, true));
        // A source whose stamps are distrusted from some frame on.
        let mut passed = PassedTime::default();
        let times = [(Clock::Device, 5), (Clock::Device, 9), (Clock::Host, 1000), (Clock::Host, 1003)];
        assert_eq!(times.map(|(clock, ns)| passed.see(clock, ns)), [0, 4, 4, 7]);
    }
}
