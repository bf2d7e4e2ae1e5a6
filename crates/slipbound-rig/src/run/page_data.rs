//! The content of a run's page, kept during the run: as much for a day as for five minutes.
//!
//! ```text
//!   cycles    every one | every second, once they are too many | every fourth ..   of those between, the one of the largest force
//!   events    the first thousand .. left out, counted .. the last thousand
//!   pictures  the first, as many as the page has
//! ```

use super::event::{Event, TimedEvent};
use super::page::{PICTURES_MOST, Picture};
use super::thinned::Thinned;
use slipbound::control::Cycle;
use std::collections::VecDeque;

/// Cycles that are kept; a plot has at most 1600 points. At 30 Hz every cycle of four and a half minutes.
const CYCLES_MOST: usize = 8192;
/// Events that are kept from the beginning, and as many from the end.
const EVENTS_MOST: usize = 1000;

/// A cycle, and the largest slip of a marker since the reference, in marker pitches.
type Point = (Cycle, Option<f64>);

/// What is kept.
#[derive(Debug)]
pub(super) struct PageData {
    cycles: Thinned<Point>,
    first_events: Vec<TimedEvent>,
    last_events: VecDeque<TimedEvent>,
    /// Events between the two, which are only in their file.
    left_out_count: u64,
    /// The first images.
    pub pictures: Vec<Picture>,
    /// When the task ended, ns.
    pub ended_ns: Option<u64>,
}

impl PageData {
    /// Nothing yet.
    pub fn new() -> Self {
        PageData {
            cycles: Thinned::new(CYCLES_MOST, stronger),
            first_events: Vec::new(),
            last_events: VecDeque::new(),
            left_out_count: 0,
            pictures: Vec::new(),
            ended_ns: None,
        }
    }

    /// Takes a cycle.
    pub fn cycle(&mut self, cycle: &Cycle, slip_pitch: Option<f64>) {
        if self.ended_ns.is_none() && cycle.ending().is_some() {
            self.ended_ns = Some(cycle.time_ns);
        }
        self.cycles.push((*cycle, slip_pitch));
    }

    /// Time of the last cycle, ns; 0 before the first.
    pub fn last_ns(&self) -> u64 {
        self.cycles.last.map_or(0, |(_, (cycle, _))| cycle.time_ns)
    }

    /// Takes an event. Images and results are on the page without it.
    pub fn event(&mut self, event: TimedEvent) {
        if matches!(event.event, Event::Result(_) | Event::Picture { .. }) {
            return;
        }
        if self.first_events.len() < EVENTS_MOST {
            return self.first_events.push(event);
        }
        if self.last_events.len() == EVENTS_MOST {
            self.last_events.pop_front();
            self.left_out_count += 1;
        }
        self.last_events.push_back(event);
    }

    /// Takes an image, if the page has room for it.
    pub fn picture(&mut self, picture: Picture) {
        if self.pictures.len() < PICTURES_MOST {
            self.pictures.push(picture);
        }
    }

    /// The cycles and their slips: those that are kept, and the last one.
    pub fn cycles(&self) -> (Vec<Cycle>, Vec<Option<f64>>) {
        self.cycles.all().into_iter().unzip()
    }

    /// All events that are kept, and how many are left out after the first so many.
    pub fn events(&self) -> (Vec<TimedEvent>, (usize, u64)) {
        let events = self.first_events.iter().chain(&self.last_events).cloned().collect();
        (events, (self.first_events.len(), self.left_out_count))
    }
}

/// The point with the larger force, with the larger slip of both: no peak is lost.
fn stronger(a: Point, b: Point) -> (Point, bool) {
    let force_n = |(cycle, _): &Point| cycle.grip_command.force_n().filter(|n| n.is_finite()).unwrap_or(0.0);
    let is_second = force_n(&b) > force_n(&a);
    let (cycle, _) = if is_second { b } else { a };
    ((cycle, a.1.into_iter().chain(b.1).reduce(f64::max)), is_second)
}
