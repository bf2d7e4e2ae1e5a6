//! Rows for the gross slip verdict: the training split's trials and guided slides, seen with and without the grip
//! force.

use super::row::Row;
use super::split::{TRAINING_SEED, gross_later, monitor_at_rest, reading, shape_of, training_trial};
use crate::eval::ground_truth::ground_truth;
use crate::eval::quiet::Quiet;
use crate::eval::slides::Slides;
use crate::eval::watch::{Restarts, Watch};
use crate::eval::{EvalError, GroundTruth};
use crate::world::World;
use slipbound::monitor::SlideFeatures;
use slipbound::port::{FrameBuffer, FrameSource, Next};

/// The first trial of the split. The estimates, which are features here, were fitted to the trials below it and would
/// look too accurate on them.
const FIRST_TRIAL: u64 = 2000;

/// Rows from this number on have a random shape instead of the object.
const RANDOM_SHAPES_FROM: u64 = 2000;

/// Every fifth trial is a guided slide.
const SLIDES_EVERY: u64 = 5;

/// One in so many is an episode in which nothing slides despite gripping, rolling, pressing and shaking; other episodes
/// than those for the fit of the estimates.
const QUIET_EVERY: u64 = 40;
/// Remainder that selects them; none of the slides.
const QUIET_AT: u64 = 21;
/// Of such an episode one in so many frames counts.
const QUIET_STRIDE: usize = 2;

/// A frame between this load fraction and gross slip is no training row: either verdict is right.
const EITHER_FROM_FRACTION: f64 = 0.8;

/// After sliding began, a frame with a larger stick ratio does not slide; below it either verdict is right.
const STICKS_AGAIN: f64 = 0.3;

/// An object that moves less than this per frame stands still, mm at the rim.
const STANDS_MM: f64 = 0.002;

/// Features of a frame, with the grip force and without it, and its ground truth.
struct Seen {
    features: [Option<SlideFeatures>; 2],
    truth: GroundTruth,
    slides: bool,
}

fn is_quiet(number: u64) -> bool {
    number % QUIET_EVERY == QUIET_AT
}

fn watched(number: u64) -> Option<Watch> {
    let mut watch = watched_with_name(number)?;
    if number >= RANDOM_SHAPES_FROM && !is_quiet(number) {
        watch.physics.object = Some(shape_of(FIRST_TRIAL + number));
    }
    Some(watch)
}

fn watched_with_name(number: u64) -> Option<Watch> {
    if number.is_multiple_of(SLIDES_EVERY) {
        return Slides::new(TRAINING_SEED, None).watch_of(number / SLIDES_EVERY).ok().map(|(_, watch)| watch);
    }
    if is_quiet(number) {
        let episode = (FIRST_TRIAL + number) / QUIET_EVERY;
        return Quiet::new(TRAINING_SEED, None).watch_of(episode).ok().map(|(_, watch)| watch);
    }
    let trial = training_trial(FIRST_TRIAL + number).ok()?;
    Some(Watch::new(trial, Restarts::Rivals))
}

/// The rows of a trial with the grip force, then those without; none if the object does not fit on the pad.
pub fn gross_rows_of(number: u64) -> Result<[Vec<Row>; 2], EvalError> {
    let Some(watch) = watched(number) else { return Ok(Default::default()) };
    let trial = &watch.trial;
    let profile = watch.profile.clone().map_or_else(|| trial.load_profile(), Ok);
    let world = profile.ok().and_then(|profile| World::with(trial, profile, &watch.physics).ok());
    let Some(mut world) = world else { return Ok(Default::default()) };
    let mut frame = FrameBuffer::default();
    let mut monitor = monitor_at_rest(&mut world, &mut frame)?;
    let mut alone = monitor.clone();
    let (reading, mut readings) = reading(FIRST_TRIAL + number);
    let mut grip_sample = reading.of(0.0, &mut readings);
    let mut seen: Vec<Seen> = Vec::new();
    let (mut gross_grip_n, mut before, mut after) = (None, None::<GroundTruth>, 0);
    while world.next(&mut frame)? == Next::Frame {
        monitor.step(&frame.frame()?, Some(grip_sample));
        alone.step(&frame.frame()?, None);
        let truth = ground_truth(&world, frame.seq);
        grip_sample = reading.of(truth.grip_n, &mut readings);
        if world.gross().is_none() || gross_grip_n.is_none() {
            gross_grip_n = Some(truth.grip_n);
        }
        let moved_mm = before.map_or(0.0, |before| {
            (truth.pose.position_mm - before.pose.position_mm).length()
                + (truth.pose.turn_rad - before.pose.turn_rad).abs() * truth.arm_mm
        });
        before = Some(truth);
        let features = [monitor.slide_features().copied(), alone.slide_features().copied()];
        seen.push(Seen { features, truth, slides: truth.slides && moved_mm > STANDS_MM });
        after += u64::from(world.gross().is_some());
        if watch.frames_after_gross.is_some_and(|most| after > most) {
            break;
        }
    }
    let object = watch.physics.object.map_or(trial.object().name, |object| object.name);
    let gross = world.gross().or_else(|| gross_later(trial, &watch.physics));
    let targets = |Seen { truth, slides, .. }: &Seen| -> Option<[f64; 2]> {
        let stick_ratio = truth.stick_ratio?;
        if world.gross().is_some_and(|gross| truth.time_s >= gross.time_s) {
            return match slides {
                true => Some([1.0, 1.0]),
                false if stick_ratio > STICKS_AGAIN => Some([0.0, 1.0]),
                false => None,
            };
        }
        let used = match (truth.load, &gross) {
            (None, _) => truth.wrench.force_n.length() / (trial.mu() * truth.grip_n).max(1e-6),
            // The load at which an object slides is proportional to the grip.
            (Some(load), Some(gross)) => load / truth.grip_n.max(1e-6) * gross_grip_n? / gross.load,
            (Some(_), None) => return None,
        };
        (used < EITHER_FROM_FRACTION).then_some([0.0, used])
    };
    let stride = if is_quiet(number) { QUIET_STRIDE } else { 1 };
    let rows = |knowing: usize| {
        seen.iter()
            .step_by(stride)
            .filter_map(|seen| Some((seen.features[knowing]?, targets(seen)?)))
            .map(|(features, targets)| Row::new(number, object, 1.0, trial.mu(), targets, &features))
            .collect()
    };
    Ok([rows(0), rows(1)])
}
