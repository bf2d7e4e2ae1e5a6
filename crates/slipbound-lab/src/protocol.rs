//! The paper's experiment with ten objects: held, pushed or turned until they slip, or not; does the rule say so?
//!
//! ```text
//!   object x force x push --> World --frames--> SlipMonitor (one for each settings) --> Verdict
//!                                 `--gross slip-------------------------------------------^
//! ```
//!
//! Dong, Ma, Donlon and Rodriguez 2019, section IV: ten objects, 24 trials each, 18 of them with slip. Their forces
//! and pushes were by hand and are not published trial by trial; ours are [`FORCES_N`] and [`pushes`].

use crate::objects::OBJECTS;
use crate::random::Random;
use crate::scenes::Trial;
use crate::world::{FRAME_RATE_HZ, World};
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor, SlipState};
use slipbound::port::{FrameBuffer, FrameSource, Next};
use std::error::Error;

/// Grip forces per finger in N: the least a common gripper holds, a firm grip, a strong one.
pub const FORCES_N: [f64; 3] = [5.0, 15.0, 30.0];

/// Load up to which a trial counts as one without slip, as a share of what would make the object slide.
const NEGATIVE_FRACTION: f64 = 0.19;

/// A load fraction below which an alarm in a trial with slip came for another reason.
pub const FALSE_BELOW_FRACTION: f64 = 0.2;

/// A trial and whether the object slips in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Push {
    /// What happens.
    pub trial: Trial,
    /// Whether the object slides as a whole in the end.
    pub slips: bool,
}

/// The 24 trials of an object: at each force three pulls and three turns until it slides, and a pull and a harder
/// grip that do not make it slide. Place, friction and speed vary with the seed.
pub fn pushes(object: &str, seed: u64) -> Vec<Push> {
    let mut pushes = Vec::new();
    for (n, force_n) in FORCES_N.into_iter().enumerate() {
        let pull = |k: usize| format!("ramp?direction_deg={}", 90 * ((3 * n + k) % 4));
        let turn = |share: f64, k: usize| format!("ramp?twist_fraction={share}&direction_deg={}", 90 * ((n + k) % 4));
        let kinds = [
            (pull(0), true),
            (pull(1), true),
            (pull(2), true),
            (turn(1.0, 0), true),
            (turn(-1.0, 0), true),
            (turn(0.5, 1), true),
            (format!("{}&peak_fraction={NEGATIVE_FRACTION}", pull(3)), false),
            (format!("quiet_grip_steps?step_n=5&most_n={}", force_n + 5.0), false),
        ];
        for (kind, slips) in kinds {
            let number = pushes.len() as u64;
            let mut random = Random::of(seed, 1000 * (1 + position(object)) + number);
            let mu = OBJECTS[position(object) as usize].mu * random.between(0.85, 1.15);
            let (x_mm, y_mm) = (random.between(-0.5, 0.5), random.between(-0.5, 0.5));
            let (turn_deg, ramp_s) = (random.between(-8.0, 8.0), random.between(0.5, 1.5));
            let ramp = if kind.starts_with("ramp") { format!("&ramp_s={ramp_s:.3}") } else { String::new() };
            let joint = if kind.contains('?') { '&' } else { '?' };
            let text = format!(
                "{kind}{joint}object={object}&force_n={force_n}&mu={mu:.3}&at_x_mm={x_mm:.3}&at_y_mm={y_mm:.3}\
                 &turn_deg={turn_deg:.3}&grid=fast{ramp}&seed={number}"
            );
            let trial = Trial::parse(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
            pushes.push(Push { trial, slips });
        }
    }
    pushes
}

/// Place of an object in the library; the first for an unknown one.
fn position(object: &str) -> u64 {
    OBJECTS.iter().position(|known| known.name == object).unwrap_or(0) as u64
}

/// How a rule's alarm compares with the truth of a trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// An alarm at this load fraction, between [`FALSE_BELOW_FRACTION`] and 1: in time.
    InTime(f64),
    /// An alarm before the load was any reason for it, or in a trial without slip: a false positive.
    False,
    /// An alarm when the object slid already: a false negative.
    Late,
    /// No alarm though the object slid: a false negative.
    Missed,
    /// No alarm and no slip: right.
    Quiet,
}

/// The outcome of a trial for one rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RuleOutcome {
    /// Whether the alarm was right.
    pub verdict: Verdict,
    /// Frames under load, from the end of the grip on.
    pub frames_count: u32,
    /// Of these, frames the rule did not decide or was unsure of.
    pub unsure_count: u32,
    /// Whether it raised an alarm while the object was being gripped. The paper's reference is taken after that, so
    /// it is counted apart.
    pub alarm_while_gripping: bool,
}

/// Runs a trial and evaluates every rule on the same frames. A rule starts anew from the last frame before the load,
/// as the paper takes its reference once the object is held.
pub fn evaluate(push: &Push, rules: &[Settings]) -> Result<Vec<RuleOutcome>, Box<dyn Error + Send + Sync>> {
    let mut world = World::new(&push.trial)?;
    let sensor = world.sensor();
    let rest_frames = push.trial.number("rest_frames") as u64;
    let gripped_s = push.trial.number("press_s") + push.trial.number("settle_s");
    let load_from = rest_frames + (gripped_s * FRAME_RATE_HZ as f64).floor() as u64;
    let mut frame = FrameBuffer::default();
    let mut rests = Vec::new();
    for _ in 0..rest_frames {
        world.next(&mut frame)?;
        if rests.is_empty() {
            rests = rules.iter().map(|rule| RestBuilder::new(&sensor, rule, frame.size)).collect::<Result<_, _>>()?;
        }
        for (rest, rule) in rests.iter_mut().zip(rules) {
            if frame.seq < u64::from(rule.rest.average_count) {
                rest.add(&frame.frame()?)?;
            }
        }
    }
    let mut monitors = Vec::new();
    for (rest, rule) in rests.into_iter().zip(rules) {
        monitors.push(SlipMonitor::new(&sensor, rule, rest.build(RestKind::Unloaded)?)?);
    }
    let none = RuleOutcome { verdict: Verdict::Quiet, frames_count: 0, unsure_count: 0, alarm_while_gripping: false };
    let mut outcomes = vec![(none, None); rules.len()];
    while world.next(&mut frame)? == Next::Frame {
        for (monitor, (outcome, alarm)) in monitors.iter_mut().zip(&mut outcomes) {
            let state = monitor.step(&frame.frame()?, None).state;
            let alarms = matches!(state, SlipState::Incipient | SlipState::Gross);
            if frame.seq < load_from {
                outcome.alarm_while_gripping |= alarms;
                if frame.seq + 1 == load_from {
                    monitor.rebase(frame.seq);
                }
                continue;
            }
            outcome.frames_count += 1;
            outcome.unsure_count += u32::from(!alarms && state != SlipState::Stick);
            if alarms && alarm.is_none() {
                *alarm = Some((world.truth().load.unwrap_or(0.0), world.truth().time_ns as f64 * 1e-9));
            }
        }
    }
    let gross = world.gross();
    Ok(outcomes
        .into_iter()
        .map(|(outcome, alarm)| {
            let verdict = match (push.slips, alarm, gross) {
                (false, None, _) => Verdict::Quiet,
                (false, Some(_), _) => Verdict::False,
                (true, None, _) => Verdict::Missed,
                (true, Some((_, time_s)), Some(gross)) if time_s > gross.time_s => Verdict::Late,
                (true, Some((load, _)), Some(gross)) if load / gross.load < FALSE_BELOW_FRACTION => Verdict::False,
                (true, Some((load, _)), Some(gross)) => Verdict::InTime(load / gross.load),
                // It never slid as a whole, by our definition: any alarm is in time for what did not come.
                (true, Some((load, _)), None) => Verdict::InTime(load.min(1.0)),
            };
            RuleOutcome { verdict, ..outcome }
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_object_gets_the_papers_24_trials() {
        for object in &OBJECTS[..10] {
            let pushes = pushes(object.name, 0);
            assert_eq!((pushes.len(), pushes.iter().filter(|push| push.slips).count()), (24, 18));
            assert!(pushes.iter().all(|push| push.trial.object().name == object.name));
            for (n, push) in pushes.iter().enumerate() {
                assert!(!pushes[..n].contains(push), "{} comes twice", push.trial);
            }
        }
    }

    #[test]
    fn trials_that_should_slip_do_and_the_others_stay_below_a_fifth() {
        for push in pushes("scissors", 0) {
            let mut world = World::new(&push.trial).expect("a sound trial");
            let mut most = 0.0f64;
            while let Some(truth) = world.advance().expect("a sound trial") {
                most = most.max(truth.load.unwrap_or(0.0));
            }
            assert_eq!(world.gross().is_some(), push.slips, "{}", push.trial);
            assert!(push.slips || most < FALSE_BELOW_FRACTION, "{}: {most}", push.trial);
        }
    }
}
