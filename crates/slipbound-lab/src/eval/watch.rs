//! A simulated trial seen by every detector: one pass over its frames, which are the main cost.
//!
//! ```text
//!   World --frame--> monitors (with force, without, the paper's) --> detectors --> Watched: per frame, per detector
//!     `--truth, grip reading--'
//! ```

use super::error::EvalError;
use super::ground_truth::{GroundTruth, ground_truth};
use crate::random::Random;
use crate::rivals::{Detector, Entry, Inputs, ReportEstimates, estimates_of};
use crate::scenes::{LoadProfile, Trial};
use crate::world::{FRAME_RATE_HZ, Gross, Physics, World};
use slipbound::monitor::{EstimateTrees, RestBuilder, RestKind, Settings, SlipMonitor, SlipReport, SlipState};
use slipbound::port::{FrameBuffer, FrameSource, GripSample, Next};
use slipbound::sensor::{Sensor, Shear};

/// Frames within which `gross` should be reported, and these at 30 Hz as a time, ms. Until then no trial ends because its
/// object has slid away.
pub(super) const GROSS_WITHIN_FRAMES: u64 = 2;
pub(super) const GROSS_WITHIN_MS: f64 = 66.7;

/// Model of a gripper's force reading: delayed, noisy, quantised.
///
/// One frame late, as over a 30 Hz link; noise of up to 0.6 N to either side, in steps of 0.1 N: estimates for the
/// readings of a force-controlled gripper of 80 N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Factor on the true force.
    pub scale: f64,
    /// Offset, N.
    pub offset_n: f64,
    /// Largest noise to either side, N, drawn anew for every frame.
    pub noise_n: f64,
}

impl Default for Reading {
    fn default() -> Self {
        Reading { scale: 1.0, offset_n: 0.0, noise_n: 0.6 }
    }
}

/// Steps of a reading, N.
const READING_STEP_N: f64 = 0.1;

impl Reading {
    /// The reading of a force; never below 0.
    pub(crate) fn of(&self, force_n: f64, random: &mut Random) -> GripSample {
        let read_n = self.scale * force_n + self.offset_n + random.between(-self.noise_n, self.noise_n);
        GripSample { force_n: ((read_n / READING_STEP_N).round() * READING_STEP_N).max(0.0) }
    }
}

/// Which detectors restart at the frame before the load, as the paper takes its reference once the object is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Restarts {
    /// Every detector.
    All,
    /// Every detector but ours, which has to find the load by itself.
    Rivals,
}

impl Restarts {
    /// The setting of a sweep that says so.
    pub(super) fn setting(self) -> (String, String) {
        let which = match self {
            Restarts::All => "all",
            Restarts::Rivals => "rivals",
        };
        ("restarts".into(), which.into())
    }
}

/// A trial and its variations.
#[derive(Debug, Clone)]
pub struct Watch {
    /// The trial.
    pub trial: Trial,
    /// Load profile, if it is not the scene's.
    pub profile: Option<LoadProfile>,
    /// Materials of gel and interface.
    pub physics: Physics,
    /// The gripper's force reading.
    pub reading: Reading,
    /// The gel's shear stiffness that the method assumes, over the true one.
    pub stiffness_scale: f64,
    /// Which detectors restart at the frame before the load.
    pub restarts: Restarts,
    /// Numbers of the world frames after which it stands still, and for how many frames.
    pub stills: Vec<(u64, u64)>,
    /// Trees of used fraction and stick ratio in place of the shipped ones.
    pub estimate_by: Option<EstimateTrees>,
    /// Number of frames after gross slip at which the trial ends; None for the whole scene.
    pub frames_after_gross: Option<u64>,
}

impl Watch {
    /// A scene without variations.
    pub fn new(trial: Trial, restarts: Restarts) -> Self {
        Watch {
            trial,
            profile: None,
            physics: Physics::default(),
            reading: Reading::default(),
            stiffness_scale: 1.0,
            restarts,
            stills: Vec::new(),
            estimate_by: None,
            frames_after_gross: None,
        }
    }

    /// Frames per second of the trial.
    fn rate_hz(&self) -> u64 {
        self.trial.number("rate_hz") as u64
    }

    /// Number of the first frame under load: the first after the grip has settled.
    pub fn load_from_frame(&self) -> u64 {
        let gripped_s = self.trial.number("press_s") + self.trial.number("settle_s");
        self.trial.number("rest_frames") as u64 + (gripped_s * self.rate_hz() as f64 + 1e-6).floor() as u64
    }
}

/// Results of a detector on a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Its score.
    pub score: f64,
    /// Whether it raised the alarm.
    pub alarms: bool,
    /// The state of its monitor.
    pub state: SlipState,
    /// Other estimates of its monitor.
    pub estimates: ReportEstimates,
}

impl Seen {
    /// Whether the frame is decided, as coverage counts it.
    pub fn is_decided(&self) -> bool {
        matches!(self.state, SlipState::Stick | SlipState::Incipient | SlipState::Gross)
    }
}

/// Results of a trial.
#[derive(Debug, Clone, Default)]
pub struct Watched {
    /// Ground truth of every frame from the first touch on.
    pub truth: Vec<GroundTruth>,
    /// Gross slip; None if it never occurred.
    pub gross: Option<Gross>,
    /// Number of the first frame under load: the first after the grip has settled.
    pub load_from_frame: u64,
    /// Frames per second.
    pub rate_hz: u64,
    /// By detector, as many frames as in the ground truth.
    pub seen: Vec<(&'static Entry, Vec<Seen>)>,
}

/// A callback that sees every frame with its report, for images.
pub type Onlooker<'a> = dyn FnMut(&FrameBuffer, &SlipReport, &SlipMonitor) + 'a;

/// A monitor and the detectors that read it.
struct MonitorGroup {
    inputs: Inputs,
    monitor: SlipMonitor,
    detectors: Vec<(&'static Entry, Box<dyn Detector>, Vec<Seen>)>,
}

impl MonitorGroup {
    fn see(&mut self, frame: &FrameBuffer, grip: GripSample) -> Result<SlipReport, EvalError> {
        let report = self.monitor.step(&frame.frame()?, self.inputs.has_force().then_some(grip));
        for (entry, detector, seen) in &mut self.detectors {
            let score = detector.see(&self.monitor, &report);
            let alarms = detector.alarms(score, &report);
            let estimates = if entry.is_ours() { estimates_of(&report) } else { ReportEstimates::default() };
            seen.push(Seen { score, alarms, state: report.state, estimates });
        }
        Ok(report)
    }

    fn restart(&mut self, frame: u64, restarts: Restarts) {
        // The monitor of ours, which other detectors may share, always continues: the inputs of a rival must not depend
        // on the other detectors. Rivals keep their own references; the paper as written has its own monitor.
        if restarts == Restarts::All || self.inputs == Inputs::PaperFrames {
            self.monitor.rebase(frame);
        }
        for (entry, detector, _) in &mut self.detectors {
            if restarts == Restarts::All || !entry.is_ours() {
                detector.restart();
            }
        }
    }
}

/// The finger as configured for the method: its shear stiffness is scaled.
fn configured_sensor(world: &World, scale: f64) -> Sensor {
    let sensor = world.sensor();
    let scaled = |shear: Shear| Shear { stiffness_n_per_pitch: scale * shear.stiffness_n_per_pitch, ..shear };
    Sensor { shear: sensor.shear.map(scaled), ..sensor }
}

/// Runs a trial with some detectors. `onlooker`: a detector, and the callback that sees its monitor.
pub fn watch(
    watch: &Watch,
    entries: &[&'static Entry],
    mut onlooker: Option<(&str, &mut Onlooker<'_>)>,
) -> Result<Watched, EvalError> {
    let trial = &watch.trial;
    let profile = match &watch.profile {
        Some(profile) => profile.clone(),
        None => trial.load_profile()?,
    };
    let mut world = World::with(trial, profile, &watch.physics)?;
    let rate_hz = watch.rate_hz();
    world.go_on_after_gross((GROSS_WITHIN_FRAMES * rate_hz).div_ceil(FRAME_RATE_HZ));
    let sensor = configured_sensor(&world, watch.stiffness_scale);
    let rest_frames = trial.number("rest_frames") as u64;
    let load_from_frame = watch.load_from_frame();
    let mut groups = monitor_groups(&mut world, &sensor, entries, rest_frames)?;
    if let Some(trees) = &watch.estimate_by {
        groups.iter_mut().for_each(|group| group.monitor.estimate_by(trees));
    }
    let mut readings = Random::of(trial.seed, 0x6121);
    let mut grip_sample = watch.reading.of(0.0, &mut readings);
    let mut watched = Watched { load_from_frame, rate_hz, ..Watched::default() };
    let mut frame = FrameBuffer::default();
    let mut stills = watch.stills.iter().copied().peekable();
    let (mut still_count, mut standing, mut left) = (0u64, 0u64, None);
    loop {
        if standing > 0 {
            standing -= 1;
            still_count += 1;
            world.render_again(still_count | 1 << 40, &mut frame)?;
        } else if world.next(&mut frame)? != Next::Frame {
            break;
        } else if let Some((_, count)) = stills.next_if(|(at, _)| *at == world.truth().frame) {
            standing = count;
        }
        frame.seq = world.truth().frame + still_count;
        frame.time_ns = Some(frame.seq * 1_000_000_000 / rate_hz);
        for group in &mut groups {
            let report = group.see(&frame, grip_sample)?;
            if let Some((name, look)) = &mut onlooker
                && group.detectors.iter().any(|(entry, ..)| entry.name == *name)
            {
                look(&frame, &report, &group.monitor);
            }
            if frame.seq + 1 == load_from_frame {
                group.restart(frame.seq, watch.restarts);
            }
        }
        watched.truth.push(ground_truth(&world, frame.seq));
        // The next frame's reading, unless the link of 30 Hz repeats it.
        let sent = |seq: u64| seq * FRAME_RATE_HZ / rate_hz;
        if sent(frame.seq + 1) > sent(frame.seq) {
            grip_sample = watch.reading.of(world.truth().grip_force_n, &mut readings);
        }
        left = left.map(|left: u64| left.saturating_sub(1)).or(world.gross().and(watch.frames_after_gross));
        if left == Some(0) {
            break;
        }
    }
    watched.gross = world.gross();
    let mut seen: Vec<_> =
        groups.into_iter().flat_map(|group| group.detectors).map(|(entry, _, seen)| (entry, seen)).collect();
    seen.sort_by_key(|(entry, _)| entries.iter().position(|other| other.name == entry.name));
    watched.seen = seen;
    Ok(watched)
}

/// Runs a trial with one detector, whose monitor the onlooker sees.
pub(super) fn show(what: &Watch, detector: &'static Entry, onlooker: &mut Onlooker<'_>) -> Result<(), EvalError> {
    watch(what, &[detector], Some((detector.name, onlooker))).map(drop)
}

/// Monitors for the inputs of the detectors, from the frames at rest.
fn monitor_groups(
    world: &mut World,
    sensor: &Sensor,
    entries: &[&'static Entry],
    rest_frames: u64,
) -> Result<Vec<MonitorGroup>, EvalError> {
    let mut inputs: Vec<Inputs> = entries.iter().map(|entry| entry.inputs).collect();
    inputs.sort();
    inputs.dedup();
    let mut frame = FrameBuffer::default();
    // Inputs that differ only in the force share one rest frame.
    let mut rests: Vec<(Settings, RestBuilder)> = Vec::new();
    for _ in 0..rest_frames {
        world.next(&mut frame)?;
        if rests.is_empty() {
            for settings in inputs.iter().map(|inputs| inputs.settings()) {
                if rests.iter().all(|(known, _)| *known != settings) {
                    let rest = RestBuilder::new(sensor, &settings, frame.size)?;
                    rests.push((settings, rest));
                }
            }
        }
        for (settings, rest) in &mut rests {
            if rest.frames_count() < settings.rest.average_count {
                rest.add(&frame.frame()?)?;
            }
        }
    }
    let mut monitors = Vec::new();
    for (settings, rest) in rests {
        let monitor = SlipMonitor::new(sensor, &settings, rest.build(RestKind::Unloaded)?)?;
        monitors.push((settings, monitor));
    }
    // Without a rest frame there is no monitor, and no detector runs.
    let group = |inputs: Inputs| {
        let settings = inputs.settings();
        let (_, monitor) = monitors.iter().find(|(known, _)| *known == settings)?;
        let detectors = entries.iter().filter(|entry| entry.inputs == inputs);
        Some(MonitorGroup {
            inputs,
            monitor: monitor.clone(),
            detectors: detectors.map(|entry| (*entry, entry.make(), Vec::new())).collect(),
        })
    };
    Ok(inputs.into_iter().filter_map(group).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rivals::named;

    #[test]
    fn a_reading_is_off_by_its_scale_its_offset_and_some_noise() {
        let mut random = Random::new(1);
        let exact = Reading { noise_n: 0.0, ..Reading::default() };
        assert_eq!(exact.of(20.04, &mut random).force_n, 20.0);
        let off = Reading { scale: 1.15, offset_n: 1.0, noise_n: 0.6 };
        let read: Vec<f64> = (0..200).map(|_| off.of(20.0, &mut random).force_n).collect();
        let (least, most) = read.iter().fold((f64::MAX, 0.0f64), |(a, b), &n| (a.min(n), b.max(n)));
        assert!(least >= 23.4 - 1e-9 && most <= 24.6 + 1e-9 && most - least > 1.0, "{least} to {most}");
        assert_eq!(Reading { offset_n: -1.0, noise_n: 0.0, scale: 1.0 }.of(0.0, &mut random).force_n, 0.0);
    }

    /// A sponge that is turned spins away within a frame; the trial still lasts long enough to judge the two-frame
    /// limit.
    #[test]
    fn no_trial_ends_before_gross_slip_could_be_told_in_time() {
        let scene = "ramp?object=scrub_sponge&force_n=20&mu=0.9&ramp_s=0.3&twist_fraction=1&grid=fast&seed=4";
        let what = Watch::new(Trial::parse(scene).expect("a trial"), Restarts::Rivals);
        let watched = watch(&what, &[], None).expect("a sound trial");
        let gross = watched.gross.expect("it slides");
        let after_count = watched.truth.iter().filter(|truth| gross.is_shown_at(truth.time_s)).count() as u64;
        assert_eq!(
            after_count,
            GROSS_WITHIN_FRAMES + 1,
            "that which shows it first, and those in which it is to be told"
        );
    }

    /// Also holds for a custom detector, which may read displacements from the monitor's reference.
    #[test]
    fn a_rival_is_told_the_same_whoever_else_is_asked() {
        let trial =
            Trial::parse("ramp?object=scissors&force_n=20&mu=0.5&ramp_s=0.2&grid=fast&seed=4").expect("a trial");
        let what = Watch::new(trial, Restarts::Rivals);
        let told_to = |rival: &str, others: &[&str]| {
            let names = others.iter().copied().chain([rival]);
            let entries: Vec<&'static Entry> = names.map(|name| named(name).expect("there is one")).collect();
            let mut reports = Vec::new();
            let mut look = |_: &FrameBuffer, report: &SlipReport, _: &SlipMonitor| reports.push(*report);
            let watched = watch(&what, &entries, Some((rival, &mut look))).expect("a sound trial");
            (watched.seen.into_iter().next_back().expect("the rival").1, reports)
        };
        for (rival, ours) in [("paper", "ours_frames"), ("load", "ours"), ("paper_as_written", "ours_frames")] {
            let (alone, reports) = told_to(rival, &[]);
            assert!(alone.iter().any(|seen| seen.score > 0.0) && reports.len() == alone.len(), "{rival}");
            assert!((alone, reports) == told_to(rival, &[ours]), "{rival} beside {ours}");
        }
    }
}
