//! The training split: random trials with seeds that no table of results uses.

use super::random_shapes::random_shape;
use super::row::Row;
use crate::eval::EvalError;
use crate::eval::quiet::Quiet;
use crate::eval::watch::Reading;
use crate::objects::{OBJECTS, Object};
use crate::random::Random;
use crate::scenes::Trial;
use crate::world::{Gross, Physics, World};
use slipbound::monitor::{Features, RestBuilder, RestKind, Settings, SlipMonitor};
use slipbound::port::{FrameBuffer, FrameSource, Next};
use slipbound::setting::SettingError;

/// The seed of the split; tables of results use seeds below it.
pub const TRAINING_SEED: u64 = 1_000_000;

/// Weight of frames of trials that are not ramps: many of them look alike.
const QUIET_WEIGHT: f64 = 0.5;

/// Largest noise of a grip force reading, N.
const MOST_NOISE_N: f64 = 0.6;

/// The last three hundred of a thousand trials change the grip under load, also at lighter grips, as a controller does.
/// Meanwhile they use a fifth to all of the friction, so that a regrip alone predicts nothing.
const REGRIP_FROM: u64 = 700;

/// The hundred and fifty before those reduce a firm grip while the load begins to grow, like a controller after a firm
/// grasp: what the larger contact leaves at the rim is no slip.
const LET_GO_FROM: u64 = 550;

/// One in so many is an episode in which nothing slides despite gripping, rolling, pressing and shaking: the events in
/// sequence, as for the grip of a moving hand; every frame of the events, without the pauses.
const QUIET_EVERY: u64 = 40;

/// Share of trials with friction certainly below 0.4: an object that slides under a light load shows little slip, and
/// without these trials half of the used fraction is estimated.
const SLIPPERY_FRACTION: f64 = 0.2;

/// Trials from this number on have a random shape instead of the object.
const RANDOM_SHAPES_FROM: u64 = 2400;
/// Weight of a row of theirs: there are nearly as many of them as of the eleven objects together.
const RANDOM_SHAPE_WEIGHT: f64 = 0.5;

/// A trial of the split: mostly pulls and turns up to gross slip, some below it, some without load.
pub fn training_trial(number: u64) -> Result<Trial, SettingError> {
    let mut random = Random::of(TRAINING_SEED, number);
    let object = OBJECTS[(random.next_u64() % OBJECTS.len() as u64) as usize].name;
    let between_log = |random: &mut Random, low: f64, high: f64| low * libm::pow(high / low, random.fraction());
    let force_n = between_log(&mut random, 5.0, 60.0);
    let most_mu = if random.fraction() < SLIPPERY_FRACTION { 0.4 } else { 1.3 };
    let mu = between_log(&mut random, 0.2, most_mu);
    let direction_deg = random.between(0.0, 360.0);
    let twist = match random.next_u64() % 10 {
        0..=3 => 0.0,
        4..=6 => random.between(-1.0, 1.0),
        7 => 1.0,
        8 => -1.0,
        _ => random.between(-0.6, 0.6),
    };
    let ramp_s = between_log(&mut random, 0.4, 4.0);
    let turn_deg = random.between(-15.0, 15.0) + if random.fraction() < 0.3 { 90.0 } else { 0.0 };
    let (x_mm, y_mm) = (random.between(-1.5, 1.5), random.between(-1.0, 1.0));
    let camera = if random.fraction() < 0.25 { "gelsight_mini" } else { "gelslim" };
    let kind = random.fraction();
    let regrips = number % 1000 >= REGRIP_FROM;
    let lets_go = (LET_GO_FROM..REGRIP_FROM).contains(&(number % 1000));
    let force_n = match (regrips, lets_go) {
        (true, _) => between_log(&mut random, 4.0, 40.0),
        (_, true) => between_log(&mut random, 8.0, 60.0),
        _ => force_n,
    };
    let with = |force_n: f64| {
        format!(
            "object={object}&force_n={force_n:.3}&mu={mu:.4}&at_x_mm={x_mm:.3}&at_y_mm={y_mm:.3}&turn_deg={turn_deg:.2}\
             &grid=fast&camera={camera}&seed={}",
            TRAINING_SEED + number
        )
    };
    let held = with(force_n);
    let ramp = format!("direction_deg={direction_deg:.1}&twist_fraction={twist:.3}&ramp_s={ramp_s:.3}");
    let text = match kind {
        kind if regrips && kind < 0.7 => {
            let most = (70.0 / force_n).min(4.0);
            let last_fraction = between_log(&mut random, 0.6, most);
            format!(
                "regrip?{held}&{ramp}&peak_fraction={:.2}&regrip_fraction={last_fraction:.3}&regrips={}&regrip_at_fraction={:.3}",
                1.6 * last_fraction.max(1.0),
                1 + random.next_u64() % 20,
                random.between(0.2, 1.0)
            )
        }
        kind if lets_go && kind < 0.9 => {
            let last_fraction = between_log(&mut random, 0.3, 0.8);
            format!(
                "regrip?{held}&{ramp}&peak_fraction=1.6&regrip_fraction={last_fraction:.3}&regrips={}&regrip_at_fraction={:.3}",
                1 + random.next_u64() % 12,
                last_fraction * random.between(0.0, 0.5)
            )
        }
        _ if regrips || lets_go => format!("ramp?{held}&{ramp}&hold_s=0.2"),
        kind if kind < 0.60 => format!("ramp?{held}&{ramp}&hold_s=0.2"),
        kind if kind < 0.76 => format!(
            "ramp?{held}&{ramp}&peak_fraction={:.3}&hold_s={:.2}",
            random.between(0.05, 0.9),
            random.between(0.3, 1.2)
        ),
        kind if kind < 0.80 => {
            let light = with(random.between(5.0, 20.0));
            format!("quiet_grip_steps?{light}&step_n={:.2}&most_n=60&hold_s=0.3", random.between(1.0, 12.0))
        }
        kind if kind < 0.84 => format!("press?{held}&hold_s=0.8&press_s={:.2}", random.between(0.2, 1.0)),
        kind if kind < 0.89 => format!(
            "roll?{held}&distance_mm={:.2}&direction_deg={direction_deg:.1}&speed_mm_per_s={:.2}",
            random.between(1.0, 5.0),
            random.between(2.0, 8.0)
        ),
        kind if kind < 0.92 => format!("vibration?{held}&direction_deg={direction_deg:.1}&hold_s=1"),
        kind if kind < 0.97 => format!(
            "shear?{held}&direction_deg={direction_deg:.1}&distance_mm=4&speed_mm_per_s={:.2}",
            random.between(1.0, 8.0)
        ),
        _ => format!(
            "shear_and_twist?{held}&direction_deg={direction_deg:.1}&distance_mm=3&speed_mm_per_s={:.2}&angle_deg={:.1}",
            random.between(1.0, 6.0),
            random.between(-30.0, 30.0)
        ),
    };
    Trial::parse(&text)
}

/// The random shape of a trial.
pub(super) fn shape_of(number: u64) -> Object {
    random_shape(&mut Random::of(TRAINING_SEED + 2, number))
}

/// Gross slip of a ramp that stops before it, if the load had continued to grow.
pub(super) fn gross_later(trial: &Trial, physics: &Physics) -> Option<Gross> {
    if trial.scene().name != "ramp" {
        return None;
    }
    let grown = |setting: &str| {
        if setting.starts_with("peak_fraction=") { "peak_fraction=1.8".into() } else { setting.to_string() }
    };
    let text: Vec<String> = trial.to_string().split('&').map(grown).collect();
    let trial = Trial::parse(&text.join("&")).ok()?;
    let mut world = World::with(&trial, trial.load_profile().ok()?, physics).ok()?;
    while world.gross().is_none() && world.advance().ok()?.is_some() {}
    world.gross()
}

/// A monitor with the default settings, from the first frames of a world.
pub(super) fn monitor_at_rest(world: &mut World, frame: &mut FrameBuffer) -> Result<SlipMonitor, EvalError> {
    let (sensor, settings) = (world.sensor(), Settings::default());
    world.next(frame)?;
    let mut rest = RestBuilder::new(&sensor, &settings, frame.size)?;
    for _ in 0..settings.rest.average_count {
        rest.add(&frame.frame()?)?;
        world.next(frame)?;
    }
    Ok(SlipMonitor::new(&sensor, &settings, rest.build(RestKind::Unloaded)?)?)
}

/// The gripper's force reading: delayed, with noise that differs between grippers.
pub(super) fn reading(number: u64) -> (Reading, Random) {
    let mut readings = Random::of(TRAINING_SEED + 1, number);
    (Reading { noise_n: readings.between(0.0, MOST_NOISE_N), ..Reading::default() }, readings)
}

/// A trial, its world and its physics; None if the object does not fit on the pad.
fn world_of(number: u64) -> Option<(Trial, World, Physics)> {
    if number % QUIET_EVERY != QUIET_EVERY / 2 {
        let trial = training_trial(number).ok()?;
        let object = (number >= RANDOM_SHAPES_FROM).then(|| shape_of(number));
        let physics = Physics { object, ..Physics::default() };
        let world = World::with(&trial, trial.load_profile().ok()?, &physics).ok()?;
        return Some((trial, world, physics));
    }
    let (_, watch) = Quiet::new(TRAINING_SEED, None).watch_of(number / QUIET_EVERY).ok()?;
    let physics = Physics::default();
    let world = World::with(&watch.trial, watch.profile?, &physics).ok()?;
    Some((watch.trial, world, physics))
}

/// The rows of a trial; none if the object does not fit on the pad.
pub fn rows_of(number: u64) -> Result<Vec<Row>, EvalError> {
    let Some((trial, mut world, physics)) = world_of(number) else { return Ok(Vec::new()) };
    let mut frame = FrameBuffer::default();
    let mut monitor = monitor_at_rest(&mut world, &mut frame)?;
    let mut seen: Vec<(Features, [f64; 2], f64, f64)> = Vec::new();
    let mut gross_grip_n = None;
    let (reading, mut readings) = reading(number);
    let mut grip_sample = reading.of(0.0, &mut readings);
    while world.next(&mut frame)? == Next::Frame {
        let truth = world.truth();
        let grip_n = truth.grip_force_n;
        monitor.step(&frame.frame()?, Some(grip_sample));
        grip_sample = reading.of(grip_n, &mut readings);
        let (Some(features), Some(stick)) = (monitor.features(), truth.stick_ratio) else { continue };
        // The load at which an object slides is proportional to the grip.
        let load_n = truth.load.map(|load| load / grip_n.max(1e-6));
        if world.gross().is_none() || gross_grip_n.is_none() {
            gross_grip_n = Some(grip_n);
        }
        let force_n = truth.wrench.force_n.length();
        let unloaded = force_n / (trial.mu() * grip_n).max(1e-6);
        seen.push((*features, [unloaded, stick], load_n.unwrap_or(f64::NAN), truth.time_ns as f64 * 1e-9));
    }
    let gross = world.gross().or_else(|| gross_later(&trial, &physics));
    let object = physics.object.map_or(trial.object().name, |object| object.name);
    let is_ramp = matches!(trial.scene().name, "ramp" | "regrip");
    let rows = seen.into_iter().filter_map(|(features, [unloaded, stick], load, time_s)| {
        let used = match gross {
            _ if load.is_nan() => unloaded,
            Some(gross) if world.gross().is_some() && time_s >= gross.time_s => 1.0,
            Some(gross) => load * gross_grip_n.unwrap_or(f64::NAN) / gross.load,
            // It never slid: the load that would have made it slide is unknown.
            None => return None,
        };
        let shape_weight = if physics.object.is_some() { RANDOM_SHAPE_WEIGHT } else { 1.0 };
        let weight = shape_weight * if is_ramp { 1.0 } else { QUIET_WEIGHT };
        Some(Row::new(number, object, weight, trial.mu(), [used.clamp(0.0, 1.1), stick], &features))
    });
    Ok(rows.collect())
}
