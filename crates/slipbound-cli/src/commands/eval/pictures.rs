//! Images of the worst failures of a detector.

use crate::outcome::Failure;
use slipbound::monitor::{SlipMonitor, SlipReport};
use slipbound::port::FrameBuffer;
use slipbound_lab::eval::outcome::{Outcome, never_slides};
use slipbound_lab::eval::{Protocol, TrialRecord};
use slipbound_lab::rivals::named;
use slipbound_rig::html_page::{Figure, FigureError};
use slipbound_rig::overlay::Overlay;

/// The detector whose failures are shown.
const SHOWN: &str = "ours";

/// A failure, its frame and how bad it is.
struct Failed<'a> {
    record: &'a TrialRecord,
    frame: u64,
    what: &'static str,
    badness: f64,
}

/// The failure of a record; None where there is none, no frame to show, or nothing to fail at.
fn failed(record: &TrialRecord) -> Option<Failed<'_>> {
    if never_slides(record) {
        return None;
    }
    let gross_frame = record.number_of("gross_frame").map(|frame| frame as u64);
    match Outcome::of(record) {
        // Of missed slips, those with the least evidence first.
        Some(Outcome::Missed) => Some(Failed {
            record,
            frame: gross_frame?.saturating_sub(1),
            what: "missed: the last frame before gross slip",
            badness: 3.0 - record.score.min(1.0),
        }),
        Some(Outcome::Late) => Some(Failed {
            record,
            frame: gross_frame?.saturating_sub(1),
            what: "late: the last frame before gross slip",
            badness: 1.5,
        }),
        Some(Outcome::False) => Some(Failed {
            record,
            frame: record.first_alarm_frame?,
            what: "false alarm",
            badness: 1.0 + record.score.min(1e3) * 1e-4,
        }),
        Some(_) => None,
        // Protocols without outcomes, such as hours in which nothing slides.
        None => {
            let wrong = record.truth == Some(false) && record.verdict;
            wrong.then_some(())?;
            Some(Failed {
                record,
                frame: record.first_alarm_frame?,
                what: "false alarm",
                badness: record.score.min(1e3),
            })
        }
    }
}

/// Images of the worst failures, the worst first; as many as can be shown.
pub fn of_worst(protocol: &dyn Protocol, records: &[TrialRecord], most: usize) -> Result<Vec<Figure>, Failure> {
    let Ok(entry) = named(SHOWN) else { return Ok(Vec::new()) };
    let mut worst: Vec<Failed<'_>> =
        records.iter().filter(|record| record.detector == entry.name).filter_map(failed).collect();
    worst.sort_by(|a, b| b.badness.total_cmp(&a.badness).then(a.record.number.cmp(&b.record.number)));
    let mut figures = Vec::new();
    for failed in worst.iter().take(most) {
        let mut figure: Option<Result<Figure, FigureError>> = None;
        let mut look = |frame: &FrameBuffer, report: &SlipReport, monitor: &SlipMonitor| {
            if frame.seq != failed.frame || figure.is_some() {
                return;
            }
            let mut overlay = Overlay::new(monitor.sensor());
            overlay.draw(frame.frame().ok().as_ref(), report, monitor);
            let title = format!("{}, frame {}: {}", failed.record.object, failed.frame, failed.what);
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
