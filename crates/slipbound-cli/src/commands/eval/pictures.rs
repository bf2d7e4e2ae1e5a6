//! Images of the worst failures of a detector.

use crate::outcome::Failure;
use slipbound::monitor::{SlipMonitor, SlipReport};
use slipbound::port::FrameBuffer;
use slipbound_lab::eval::outcome::{Outcome, never_slides};
use slipbound_lab::eval::{Protocol, SweepError, TrialRecord};
use slipbound_lab::rivals::named;
use slipbound_rig::html_page::{Figure, FigureError};
use slipbound_rig::overlay::Overlay;
use std::sync::atomic::{AtomicBool, Ordering};

/// The detector whose failures are shown.
const SHOWN: &str = "ours";

/// A failure and how bad it is.
pub struct Failed<'a> {
    /// The record.
    pub record: &'a TrialRecord,
    /// In words.
    pub what: &'static str,
    /// The frame that shows it; None where no frame does.
    frame: Option<u64>,
    badness: f64,
}

/// The failure of a record; None where there is none, or nothing to fail at.
fn failed(record: &TrialRecord) -> Option<Failed<'_>> {
    if never_slides(record) {
        return None;
    }
    let before_gross = record.number_of("gross_frame").map(|frame| (frame as u64).saturating_sub(1));
    let (what, frame, badness) = match Outcome::of(record) {
        // Of missed slips, those with the least evidence first.
        Some(Outcome::Missed) => ("missed", before_gross, 3.0 - record.score.min(1.0)),
        Some(Outcome::Late) => ("late", before_gross, 1.5),
        Some(Outcome::False) => ("false alarm", record.first_alarm_frame, 1.0 + record.score.min(1e3) * 1e-4),
        Some(_) => return None,
        // Protocols without outcomes, such as hours in which nothing slides, and recorded clips.
        None => match (record.truth?, record.verdict) {
            (false, true) => ("false alarm", record.first_alarm_frame, record.score.min(1e3)),
            (true, false) => ("missed", None, -record.score),
            _ => return None,
        },
    };
    Some(Failed { record, what, frame, badness })
}

/// The failures of the detector that is shown, the worst first; None if it has no record.
pub fn all(records: &[TrialRecord]) -> Option<Vec<Failed<'_>>> {
    let mut shown = records.iter().filter(|record| record.detector == SHOWN).peekable();
    shown.peek()?;
    let mut worst: Vec<Failed<'_>> = shown.filter_map(failed).collect();
    worst.sort_by(|a, b| b.badness.total_cmp(&a.badness).then(a.record.number.cmp(&b.record.number)));
    Some(worst)
}

/// Images of the worst failures, the worst first; as many as can be shown. `stop` leaves the others.
pub fn of_worst(
    protocol: &dyn Protocol,
    records: &[TrialRecord],
    most: usize,
    stop: &AtomicBool,
) -> Result<Vec<Figure>, Failure> {
    let (Ok(entry), Some(worst)) = (named(SHOWN), all(records)) else { return Ok(Vec::new()) };
    let mut figures = Vec::new();
    let with_frame = worst.iter().filter_map(|failed| Some((failed, failed.frame?)));
    for (failed, shown_frame) in with_frame.take(most) {
        if stop.load(Ordering::Relaxed) {
            return Err(Failure::Work(SweepError::Interrupted.into()));
        }
        let mut figure: Option<Result<Figure, FigureError>> = None;
        let mut look = |frame: &FrameBuffer, report: &SlipReport, monitor: &SlipMonitor| {
            if frame.seq != shown_frame || figure.is_some() {
                return;
            }
            let mut overlay = Overlay::new(monitor.sensor()).for_stills();
            overlay.draw(frame.frame().ok().as_ref(), report, monitor);
            let what = match failed.what {
                "false alarm" => failed.what.to_owned(),
                slip => format!("{slip}: the last frame before gross slip"),
            };
            let title = format!("{}, frame {shown_frame}: {what}", failed.record.object);
            figure = Some(Figure::new(&title, &failed.record.trial, &overlay.rgb(), overlay.size()));
        };
        let shown = protocol.show(failed.record.number, entry, &mut look);
        shown.map_err(|error| Failure::work(format!("trial {}", failed.record.number), error))?;
        if let Some(figure) = figure {
            figures.push(figure.map_err(|error| Failure::Work(error.into()))?);
        }
    }
    Ok(figures)
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound_lab::eval::watch::Onlooker;
    use slipbound_lab::eval::{EvalError, Table};
    use slipbound_lab::rivals::Entry;
    use std::sync::atomic::AtomicUsize;

    /// Counts the trials that are run again; in the second the user asks for the end.
    #[derive(Default)]
    struct Counted {
        shown_count: AtomicUsize,
        stop: AtomicBool,
    }

    impl Protocol for Counted {
        fn name(&self) -> &'static str {
            "counted"
        }

        fn trials_count(&self) -> u64 {
            9
        }

        fn judge(&self, _: u64, _: &[&'static Entry]) -> Result<Vec<TrialRecord>, EvalError> {
            Ok(Vec::new())
        }

        fn tables(&self, _: &[TrialRecord]) -> Vec<Table> {
            Vec::new()
        }

        fn show(&self, _: u64, _: &'static Entry, _: &mut Onlooker<'_>) -> Result<(), EvalError> {
            self.stop.fetch_or(self.shown_count.fetch_add(1, Ordering::Relaxed) == 1, Ordering::Relaxed);
            Ok(())
        }
    }

    #[test]
    fn after_an_interrupt_no_further_picture_is_drawn() {
        let record = |number| TrialRecord {
            number,
            trial: "t".into(),
            object: "cup".into(),
            detector: SHOWN.into(),
            truth: Some(false),
            verdict: true,
            score: 2.0,
            first_alarm_frame: Some(7),
            more: Default::default(),
        };
        let (records, protocol) = ((0..9).map(record).collect::<Vec<_>>(), Counted::default());
        let drawn = of_worst(&protocol, &records, 6, &protocol.stop);
        assert!(matches!(drawn, Err(Failure::Work(error)) if error.to_string().starts_with("interrupted")));
        assert_eq!(protocol.shown_count.load(Ordering::Relaxed), 2);
    }
}
