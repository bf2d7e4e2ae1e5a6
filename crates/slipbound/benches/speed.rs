//! Time per frame, for `bench/speed.sh`: medians and tails relative to one copy of the frame, growth with pixels and
//! with markers, many fingers at once. Prints JSON; `judge` prints nothing: it is for counting instructions.
//!
//! ```text
//!   speed judge   FINGER FRAMES [MARKERS]   judges FRAMES frames; with MARKERS markers, of 1280x960 px
//!   speed measure FINGER FRAMES     whole step and each step, us: median of the mean of 30 consecutive frames, 99.9th
//!                                   percentile of one, the slowest frame of the schedule; and the whole step at
//!                                   30 Hz, where every frame runs all steps; in between the tail of copies that take
//!                                   as long as a step: the jitter of the machine
//!   speed turns   FINGER            for each line on standard input the medians of 300 steps and of 60 copies, to be
//!                                   run alternately with others
//!   speed growth  FINGER            medians for 320x240 to 1920x1440 px, and for 50 to 5,000 markers
//!   speed memory  FINGER            resident memory of a monitor, MiB
//!   speed start   FINGER            ms from the last of ten rest frames to a monitor: the first of the process, and
//!                                   the median of later ones
//!   speed fingers FINGER SECONDS    1 to 16 monitors at 90 Hz on all cores: late frames, share of the cores in use
//! ```
//! FINGER: smooth, fabric, rectified (fabric, every pixel resampled). 640x480 colour, 391 markers of 8.4 px, in
//! contact, grip known.
// A bench reads the clock and its memory, and prints.
#![allow(missing_docs, clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)]

#[path = "../tests/picture/mod.rs"]
mod picture;

use picture::{Painter, Touch};
use serde_json::{Value, json};
use slipbound::image::{Frame, Pixels, Rgb, SizePx};
use slipbound::monitor::{Probe, RestBuilder, RestKind, Settings, SlipMonitor, Step};
use slipbound::plane::{Homography, Vec2};
use slipbound::port::GripSample;
use slipbound::sensor::{Rectification, Shear, Skin};
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

const SIZE: SizePx = SizePx::new(640, 480);
const PITCH_PX: f64 = 26.5;
const FRAME_NS: u64 = 1_000_000_000 / 90;
const SLOW_FRAME_NS: u64 = 1_000_000_000 / 30;
const WARM_UP_FRAMES: usize = 200;

/// Length of the schedule, frames: at 90 Hz the twelve frames then meet the same steps again.
const TURN_FRAMES: usize = 60;

/// A finger and some frames of it, to be judged repeatedly.
#[derive(Clone)]
struct Recording {
    size: SizePx,
    frames: Arc<Vec<Vec<u8>>>,
    monitor: SlipMonitor,
    seq: u64,
    time_ns: u64,
    frame_ns: u64,
}

/// A finger of this kind with its markers, to be painted.
fn painter(finger: &str, size: SizePx, pitch_px: f64) -> Painter {
    let skin = match finger {
        "smooth" => Skin::Smooth,
        "fabric" | "rectified" => Skin::Fabric,
        other => panic!("finger {other:?}: expected smooth, fabric or rectified"),
    };
    let mut painter = Painter::new(size, pitch_px, 0.317 * pitch_px, skin, 0.02 * pitch_px, 9);
    painter.sensor.shear = Some(Shear { stiffness_n_per_pitch: 0.2, provenance: "assumed".into() });
    if finger == "rectified" {
        // A slight rotation, so that every pixel is resampled.
        let homography = Homography([[1.0, 0.02, -5.0], [-0.02, 1.0, 6.0], [0.0, 0.0, 1.0]]);
        let crop_px = [0, 0, size.width, size.height];
        painter.sensor.rectification = Some(Rectification { homography, crop_px, distortion: None });
    }
    painter
}

/// The rest frame's builder after this many frames of the untouched finger.
fn rest_builder(painter: &mut Painter, size: SizePx, frames_count: u64) -> RestBuilder {
    let mut builder = RestBuilder::new(&painter.sensor, &Settings::default(), size).expect("valid");
    for seq in 0..frames_count {
        let rest = painter.paint(&painter.rest.clone(), None, seq);
        builder.add(&picture::frame(&rest, size, seq)).expect("bright");
    }
    builder
}

impl Recording {
    fn new(finger: &str, size: SizePx, pitch_px: f64, frames_count: usize) -> Self {
        let mut painter = painter(finger, size, pitch_px);
        let (width, height) = (size.width as f64, size.height as f64);
        let touch = Touch {
            centre: Vec2::new(width, height) * 0.5,
            radii_px: Vec2::new(0.33 * width, 0.375 * height),
            strength_levels: 32.0,
        };
        let frames = (0..frames_count as i32)
            .map(|i| {
                let shift = Vec2::new(0.7, 0.2) * f64::from(6 - (i - 6i32).abs()) * (pitch_px / PITCH_PX);
                let moved = |&p: &Vec2| if touch.depth(p) < 0.8 { p + shift } else { p };
                let now: Vec<Vec2> = painter.rest.iter().map(moved).collect();
                painter.paint(&now, Some(&touch), i as u64)
            })
            .collect();
        let rest = rest_builder(&mut painter, size, 1).build(RestKind::Unloaded).expect("markers");
        let monitor = SlipMonitor::new(&painter.sensor, &Settings::default(), rest).expect("valid");
        Recording { size, frames: Arc::new(frames), monitor, seq: 0, time_ns: 0, frame_ns: FRAME_NS }
    }

    fn judge(&mut self, probe: &mut dyn Probe) {
        let rgb = &self.frames[self.seq as usize % self.frames.len()];
        let pixels = Pixels::Rgb(Rgb::new(rgb, self.size).expect("a whole picture"));
        let frame = Frame { pixels, seq: self.seq, time_ns: Some(self.time_ns) };
        black_box(self.monitor.step_probed(&frame, Some(GripSample { force_n: 10.0 }), probe));
        self.seq += 1;
        self.time_ns += self.frame_ns;
    }
}

/// Times between the steps, us.
struct StepTimes {
    since: Instant,
    times_us: Vec<(Step, Vec<f64>)>,
}

impl Probe for StepTimes {
    fn after(&mut self, step: Step, _: &SlipMonitor) {
        let now = Instant::now();
        if let Some((_, times)) = self.times_us.iter_mut().find(|(s, _)| *s == step) {
            times.push(1e6 * (now - self.since).as_secs_f64());
        }
        self.since = Instant::now();
    }
}

/// The given quantile of the times, in their unit.
fn quantile(times: &mut [f64], share: f64) -> f64 {
    times.sort_unstable_by(f64::total_cmp);
    times[((times.len() - 1) as f64 * share).round() as usize]
}

/// Median of the mean of 30 consecutive frames: at 90 Hz some steps run in every third frame, one in every fifth.
fn turn_us(times: &[f64]) -> f64 {
    let mut turns: Vec<f64> = times.as_chunks::<30>().0.iter().map(|turn| turn.iter().sum::<f64>() / 30.0).collect();
    quantile(&mut turns, 0.5)
}

/// The slowest frame of the schedule, by the median over all repetitions: the tail caused by the steps, without the
/// machine.
fn dearest_us(times: &[f64]) -> f64 {
    let of_place = |place: usize| {
        let mut same: Vec<f64> = times.iter().skip(place).step_by(TURN_FRAMES).copied().collect();
        quantile(&mut same, 0.5)
    };
    (0..TURN_FRAMES).map(of_place).fold(0.0, f64::max)
}

fn timed_us(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    1e6 * start.elapsed().as_secs_f64()
}

/// A finger after warm-up, and the target buffer of the copies.
struct Warm {
    recording: Recording,
    target: Vec<u8>,
}

impl Warm {
    fn new(finger: &str) -> Self {
        let mut recording = Recording::new(finger, SIZE, PITCH_PX, 12);
        let target = recording.frames[0].clone();
        (0..WARM_UP_FRAMES).for_each(|_| recording.judge(&mut ()));
        Warm { recording, target }
    }

    fn steps_us(&mut self, count: usize) -> impl Iterator<Item = f64> {
        (0..count).map(|_| timed_us(|| self.recording.judge(&mut ())))
    }

    /// Times of `count` copies of `frames_count` frames, the same twelve in turn as for the monitor.
    fn copies_us(&mut self, count: usize, frames_count: usize) -> impl Iterator<Item = f64> {
        let Warm { recording, target } = self;
        let mut frames = recording.frames.iter().cycle();
        (0..count).map(move |_| {
            timed_us(|| {
                for frame in frames.by_ref().take(frames_count) {
                    black_box(&mut *target).copy_from_slice(black_box(frame));
                }
            })
        })
    }
}

/// Answers each line of standard input with the medians of some steps and some copies, us.
fn turns(finger: &str) {
    let mut warm = Warm::new(finger);
    for _ in std::io::stdin().lines() {
        let steps: Vec<f64> = warm.steps_us(300).collect();
        let mut copies: Vec<f64> = warm.copies_us(60, 1).collect();
        println!("{}", json!({ "step_us": turn_us(&steps), "copy_us": quantile(&mut copies, 0.5) }));
    }
}

fn measure(finger: &str, frames_count: usize) -> Value {
    let mut warm = Warm::new(finger);
    let (mut whole, mut copies, mut as_long) = (Vec::with_capacity(frames_count), Vec::new(), Vec::new());
    // Number of copies that take as long as a step.
    let mut first: Vec<f64> = warm.copies_us(60, 1).collect();
    let steps: Vec<f64> = warm.steps_us(300).collect();
    let copies_a_step = (turn_us(&steps) / quantile(&mut first, 0.5)).round().max(1.0) as usize;
    // The copies use the same frames as the monitor, in the same run, in separate stretches, so that neither depends on
    // the cache state left by the other.
    while whole.len() < frames_count {
        let count = 500.min(frames_count - whole.len());
        whole.extend(warm.steps_us(count));
        copies.extend(warm.copies_us(60, 1));
        as_long.extend(warm.copies_us(count, copies_a_step));
    }
    let mut recording = warm.recording;
    let steps = [Step::Imprint, Step::Contact, Step::Markers, Step::Motion, Step::Slip, Step::Evidence, Step::Verdict];
    let mut probe = StepTimes { since: Instant::now(), times_us: steps.map(|s| (s, Vec::new())).into() };
    for _ in 0..frames_count.min(2000) {
        probe.since = Instant::now();
        recording.judge(&mut probe);
    }
    let by_step: serde_json::Map<String, Value> = (probe.times_us.iter())
        .map(|(step, times)| (format!("{step:?}").to_lowercase(), json!(turn_us(times))))
        .collect();
    let dearest_us = dearest_us(&whole);
    // From here on the camera runs at 30 Hz.
    recording.frame_ns = SLOW_FRAME_NS;
    let slow: Vec<f64> = (0..frames_count.min(900)).map(|_| timed_us(|| recording.judge(&mut ()))).collect();
    let (copy_us, median_us) = (quantile(&mut copies, 0.5), turn_us(&whole));
    json!({
        "markers_count": recording.monitor.markers().len(), "frames_count": frames_count, "memcpy_us_median": copy_us,
        "step_us_median": median_us, "step_us_p999": quantile(&mut whole, 0.999),
        "copies_tail_ratio": quantile(&mut as_long, 0.999) / quantile(&mut as_long, 0.5), "step_us_dearest": dearest_us, "step_us_at_30_hz": turn_us(&slow),
        "step_us_worst": whole[whole.len() - 1], "memcpy_ratio": median_us / copy_us, "steps_us_median": by_step,
    })
}

/// 1280x960 px with about this many markers.
fn with_markers(finger: &str, count: f64) -> Recording {
    Recording::new(finger, SizePx::new(1280, 960), (1280.0 * 960.0 / count).sqrt(), 3)
}

fn growth(finger: &str) -> Value {
    let median_us = |mut recording: Recording| {
        (0..30).for_each(|_| recording.judge(&mut ()));
        let times: Vec<f64> = (0..150).map(|_| timed_us(|| recording.judge(&mut ()))).collect();
        (recording.monitor.markers().len(), turn_us(&times))
    };
    let pixels: Vec<Value> = [(320, 240), (640, 480), (960, 720), (1280, 960), (1600, 1200), (1920, 1440)]
        .map(|(width, height)| {
            let (size, pitch_px) = (SizePx::new(width, height), PITCH_PX * width as f64 / 640.0);
            let (markers_count, us) = median_us(Recording::new(finger, size, pitch_px, 3));
            json!({ "pixels_count": width * height, "markers_count": markers_count, "step_us_median": us })
        })
        .into();
    let markers: Vec<Value> = [50.0, 100.0, 200.0, 400.0, 800.0, 1600.0, 3200.0, 5000.0]
        .map(|wanted: f64| {
            let (markers_count, us) = median_us(with_markers(finger, wanted));
            json!({ "pixels_count": 1280 * 960, "markers_count": markers_count, "step_us_median": us })
        })
        .into();
    json!({ "pixels": pixels, "markers": markers })
}

/// Memory of 16 more monitors, on Linux, divided by sixteen; each has judged a frame.
fn memory(finger: &str) -> Value {
    let resident_mib = || {
        let pages = std::fs::read_to_string("/proc/self/statm").ok()?;
        pages.split(' ').nth(1)?.parse::<f64>().ok().map(|pages| pages * 4096.0 / 1048576.0)
    };
    let mut recording = Recording::new(finger, SIZE, PITCH_PX, 12);
    recording.judge(&mut ());
    let before = resident_mib();
    let mut others = Vec::new();
    for _ in 0..16 {
        others.push(recording.monitor.clone());
        std::mem::swap(&mut recording.monitor, others.last_mut().expect("just pushed"));
        recording.judge(&mut ());
    }
    json!({ "monitor_mib": resident_mib().zip(before).map(|(after, before)| (after - before) / 16.0) })
}

/// From the last of ten frames of the untouched finger to a monitor that can judge. The first of a process also makes
/// the tables that all monitors share.
fn start(finger: &str) -> Value {
    let mut painter = painter(finger, SIZE, PITCH_PX);
    let builder = rest_builder(&mut painter, SIZE, 10);
    let start_ms = || {
        let builder = builder.clone();
        1e-3 * timed_us(|| {
            let rest = builder.build(RestKind::Unloaded).expect("markers");
            black_box(SlipMonitor::new(&painter.sensor, &Settings::default(), rest).expect("valid"));
        })
    };
    let first_ms = start_ms();
    let mut later_ms: Vec<f64> = (0..20).map(|_| start_ms()).collect();
    json!({ "first_ms": first_ms, "later_ms_median": quantile(&mut later_ms, 0.5) })
}

/// A number of monitors, each with a frame every 1/90 s, distributed over as many threads as there are cores; a frame
/// judged after the next one is due is late.
fn fingers(finger: &str, seconds: f64) -> Value {
    let cores_count = std::thread::available_parallelism().map_or(1, usize::from);
    let period = Duration::from_nanos(FRAME_NS);
    let one = Recording::new(finger, SIZE, PITCH_PX, 12);
    let rows: Vec<Value> = [1, 2, 4, 8, 12, 16]
        .map(|monitors_count: usize| {
            let start = Instant::now() + Duration::from_millis(300);
            let share = |thread: usize| {
                let own = (thread..monitors_count).step_by(cores_count).count();
                let mut recordings = vec![one.clone(); own];
                let (mut late_count, mut judged_count, mut busy) = (0u64, 0u64, Duration::ZERO);
                for tick in 0..(seconds * 90.0) as u32 {
                    let due = start + period * tick;
                    std::thread::sleep(due.saturating_duration_since(Instant::now()));
                    for recording in &mut recordings {
                        let since = Instant::now();
                        recording.judge(&mut ());
                        busy += since.elapsed();
                        late_count += u64::from(Instant::now() > due + period);
                        judged_count += 1;
                    }
                }
                (late_count, judged_count, busy)
            };
            let share = &share;
            let sums: Vec<_> = std::thread::scope(|scope| {
                let threads: Vec<_> = (0..cores_count).map(|thread| scope.spawn(move || share(thread))).collect();
                threads.into_iter().map(|thread| thread.join().expect("it judges")).collect()
            });
            let late: u64 = sums.iter().map(|s| s.0).sum();
            let judged: u64 = sums.iter().map(|s| s.1).sum();
            let busy: Duration = sums.iter().map(|s| s.2).sum();
            json!({
                "monitors_count": monitors_count, "judged_count": judged, "late_count": late,
                "cores_in_use_fraction": busy.as_secs_f64() / seconds / cores_count as f64,
            })
        })
        .into();
    json!({ "cores_count": cores_count, "rows": rows })
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let number = |text: &str| text.parse::<f64>().unwrap_or_else(|_| panic!("{text:?}: expected a number"));
    let result = match args[..] {
        ["judge", finger, frames_count] => {
            let mut recording = Recording::new(finger, SIZE, PITCH_PX, 12);
            (0..number(frames_count) as usize).for_each(|_| recording.judge(&mut ()));
            return;
        }
        ["judge", finger, frames_count, markers_count] => {
            let mut recording = with_markers(finger, number(markers_count));
            (0..number(frames_count) as usize).for_each(|_| recording.judge(&mut ()));
            return;
        }
        ["turns", finger] => return turns(finger),
        ["measure", finger, frames_count] => measure(finger, number(frames_count) as usize),
        ["growth", finger] => growth(finger),
        ["memory", finger] => memory(finger),
        ["start", finger] => start(finger),
        ["fingers", finger, seconds] => fingers(finger, number(seconds)),
        // Without arguments, as called by `cargo bench`: a short run.
        [] => json!(["smooth", "fabric", "rectified"].map(|finger| json!({ finger: measure(finger, 500) }))),
        _ => panic!("see the head of benches/speed.rs for its arguments"),
    };
    println!("{result}");
}
