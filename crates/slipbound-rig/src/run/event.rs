//! One record per cycle -> a few events.

use super::{Row, RunInfo};
use serde::{Deserialize, Serialize};
use slipbound::control::Cycle;
use slipbound::events::{Episode, SlipEpisodes, SlipObservation};
use slipbound::hand::{HandSlip, HandVector, Health};
use slipbound::monitor::{SlipReport, SlipState};
use slipbound::port::GripCommand;
use slipbound::task::{Ending, Phase};

/// A change of the commanded force from one cycle to the next that counts as a step, N. Slower changes are visible in
/// the plot.
const STEP_N: f64 = 0.5;
/// Least component of a unit direction that is named. A slip that a single finger sees counts half as across, half as
/// around: each is named where both together forbid a slip along the fingers (0.5, [`slipbound::hand::Allowed`]).
const NAMED: f64 = 0.35;

/// An event with its time: a line of `events.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TimedEvent {
    /// Time of the loop, ns.
    pub time_ns: u64,
    /// The event.
    #[serde(flatten)]
    pub event: Event,
}

/// An event of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "event")]
pub enum Event {
    /// The task enters another phase.
    Phase {
        /// The new phase.
        now: Phase,
    },
    /// Part of a contact began to slip.
    SlipBegins {
        /// Its number, from 1.
        slip: u32,
        /// Direction in words: `along`, `across`, `around`, `pivot`, several joined by ` and `.
        direction: String,
        /// How many fingers see it.
        fingers_count: u32,
        /// On what evidence: every live finger. Empty where it is not known, as in runs from before it was recorded.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        fingers: Vec<FingerVerdict>,
        /// Whether the whole contact slides.
        gross: bool,
        /// Force at which it slipped, N per finger: measured, else the force commanded before; None when neither is a
        /// number.
        force_n: Option<f64>,
        /// Whether `force_n` is measured. None where it is not known, as in runs from before it was recorded.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        force_measured: Option<bool>,
    },
    /// The slip stopped.
    SlipEnds {
        /// Its number.
        slip: u32,
        /// Time from the first sign of it to the last, ns.
        lasted_ns: u64,
    },
    /// The commanded force made a step.
    Grip {
        /// Before, N per finger; None when it was not a number.
        from_n: Option<f64>,
        /// After, N per finger; None when it is not a number.
        to_n: Option<f64>,
    },
    /// A finger went blind, froze or came back.
    Finger {
        /// Its name.
        finger: String,
        /// What it is now.
        health: Health,
    },
    /// An image was saved.
    Picture {
        /// The slip it belongs to, 0 before any.
        slip: u32,
        /// Name of the finger.
        finger: String,
        /// Name of the file in the folder.
        file: String,
    },
    /// A note of the loop, in words.
    Note {
        /// In words.
        text: String,
    },
    /// The task is over.
    Ended {
        /// How.
        ending: Ending,
        /// On what evidence.
        evidence: String,
    },
    /// A line of the table of results.
    Result(Row),
}

/// The verdict of a finger and what decided it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FingerVerdict {
    /// Its name.
    pub finger: String,
    /// The verdict.
    pub state: SlipState,
    /// Its slip margin; None where it is not known, or where the markers decide.
    pub margin: Option<f64>,
    /// Its markers over the threshold.
    pub markers_over: u32,
    /// The fewest of them that mean slip.
    pub markers_needed: u32,
}

/// Folds cycles into events.
#[derive(Debug)]
pub(crate) struct EventLog {
    fingers: Vec<String>,
    margin_decides: bool,
    last: Option<Cycle>,
    slips: SlipEpisodes,
}

impl EventLog {
    pub fn new(info: &RunInfo) -> Self {
        let margin_decides = info.monitor_settings.slip.alarm_margin().is_some();
        EventLog { fingers: info.finger_names(), margin_decides, last: None, slips: SlipEpisodes::default() }
    }

    /// Slips that have begun so far.
    pub fn slips_count(&self) -> u32 {
        self.last.map_or(0, |last| last.slips_count)
    }

    /// The events of this cycle, in reading order. `reports`: those of the fingers in this cycle, as far as they are
    /// known.
    pub fn see(&mut self, cycle: &Cycle, reports: &[Option<&SlipReport>]) -> Vec<Event> {
        let mut events = self.fingers_changed(cycle);
        self.slips(cycle, reports, &mut events);
        let before = self.last.as_ref().map(|last| last.grip_command);
        if let (Some(GripCommand::Hold { force_n: from_n }), GripCommand::Hold { force_n: to_n }) =
            (before, cycle.grip_command)
        {
            let both = from_n.is_finite() && to_n.is_finite();
            if if both { (to_n - from_n).abs() >= STEP_N } else { from_n.is_finite() != to_n.is_finite() } {
                events.push(Event::Grip { from_n: finite(from_n), to_n: finite(to_n) });
            }
        }
        if self.last.as_ref().is_none_or(|last| last.phase != cycle.phase) {
            events.extend(match (cycle.ending(), cycle.phase) {
                (Some(ending), _) => Some(Event::Ended { ending, evidence: ending.evidence().to_owned() }),
                (None, Phase::Ended(_)) => None, // by a fault, which is told by itself
                (None, now) => Some(Event::Phase { now }),
            });
        }
        self.last = Some(*cycle);
        events
    }

    /// Ends a slip still in progress when the loop ends.
    pub fn end(&mut self) -> Option<Event> {
        let slip = self.slips.end()?;
        Some(ends(&slip, self.slips_count()))
    }

    fn fingers_changed(&self, cycle: &Cycle) -> Vec<Event> {
        let fingers = self.fingers.iter().enumerate().zip(&cycle.hand.health);
        let changed = fingers.filter(|((i, _), now)| {
            // A finger counts as live at first: the first cycle reports only those that are not.
            let before = self.last.as_ref().map_or(Health::Live, |last| last.hand.health[*i]);
            before != **now
        });
        changed.map(|((_, finger), &health)| Event::Finger { finger: finger.clone(), health }).collect()
    }

    fn slips(&mut self, cycle: &Cycle, reports: &[Option<&SlipReport>], events: &mut Vec<Event>) {
        let change = self.slips.see(&SlipObservation::of_hand(cycle.time_ns, &cycle.hand));
        // The number is the loop's own: a queue may have lost cycles before this one.
        events.extend(change.ended.map(|slip| ends(&slip, self.slips_count())));
        if change.began.is_some() {
            // This cycle's command is the response to the slip.
            let commanded_n = self.last.as_ref().and_then(|last| last.grip_command.force_n());
            let force_n = cycle.gripper.pressed_n().or(commanded_n).and_then(finite);
            events.push(Event::SlipBegins {
                slip: cycle.slips_count,
                direction: cycle.hand.slip.as_ref().map_or_else(String::new, direction),
                fingers_count: cycle.hand.slip.map_or(0, |slip| slip.fingers_count),
                fingers: self.verdicts(cycle, reports),
                gross: cycle.hand.state == SlipState::Gross,
                force_n,
                force_measured: force_n.map(|_| cycle.gripper.force_n.is_some()),
            });
        }
    }

    /// The verdicts of the fingers that were fused: those that are live.
    fn verdicts(&self, cycle: &Cycle, reports: &[Option<&SlipReport>]) -> Vec<FingerVerdict> {
        let fingers = self.fingers.iter().zip(reports).zip(&cycle.hand.health);
        let live = fingers.filter(|(_, health)| **health == Health::Live);
        let verdict = |(finger, report): (&String, &SlipReport)| FingerVerdict {
            finger: finger.clone(),
            state: report.state,
            margin: report.estimates.margin.map(|margin| margin.value).filter(|_| self.margin_decides).and_then(finite),
            markers_over: report.slip.markers_over,
            markers_needed: report.slip.markers_needed,
        };
        live.filter_map(|((finger, report), _)| Some(verdict((finger, (*report)?)))).collect()
    }
}

fn ends(slip: &Episode, number: u32) -> Event {
    let lasted_ns =
        slip.last.time_ns.zip(slip.first.time_ns).map_or(0, |(last_ns, first_ns)| last_ns.saturating_sub(first_ns));
    Event::SlipEnds { slip: number, lasted_ns }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// The direction of a slip in words.
fn direction(slip: &HandSlip) -> String {
    let HandVector { along, across, around } = slip.direction;
    let named = [("along", along), ("across", across), ("around", around)];
    let mut words: Vec<&str> = named.iter().filter(|(_, part)| part.abs() > NAMED).map(|(name, _)| *name).collect();
    if slip.pivots {
        words.push("pivot");
    }
    words.join(" and ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_makes_a_slip_more_than_one_along_the_fingers_is_named() {
        let of = |along: f64, across: f64, around: f64| {
            let direction = HandVector { along, across, around };
            super::direction(&HandSlip { direction, pivots: false, fingers_count: 1 })
        };
        assert_eq!(of(0.83, 0.396, 0.396), "along and across and around", "34 deg off, seen by one finger");
        assert_eq!(of(0.94, 0.24, 0.24), "along", "20 deg off");
        assert_eq!(of(0.3, 0.0, 0.95), "around");
    }
}
