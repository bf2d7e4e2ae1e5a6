//! The page that shows a run: one file, no other needed.

pub(super) mod picture;

use super::{Cycle, Row, RunInfo, TimedEvent};
use slipbound::task::Ending;
use std::fmt;

/// What a finger saw at a slip.
#[derive(Debug)]
pub(super) struct Picture {
    pub slip: u32,
    pub stem: String,
    pub finger: String,
    pub caption: String,
    pub file: String,
    pub jpeg: Vec<u8>,
}

/// Everything the page shows.
pub(super) struct Page<'a> {
    pub info: &'a RunInfo,
    pub cycles: &'a [Cycle],
    pub events: &'a [TimedEvent],
    pub pictures: &'a [Picture],
    pub results: &'a [Row],
    pub ending: Option<Ending>,
}

impl fmt::Display for Page<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "<!DOCTYPE html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>{}</title>", self.info.task)?;
        writeln!(f, "<p>{}</p>", self.ending.map_or("broken off", Ending::evidence))?;
        writeln!(f, "<p>{} cycles, {} events</p><table>", self.cycles.len(), self.events.len())?;
        for Row { name, value, target, ok } in self.results {
            writeln!(f, "<tr><td>{name}<td>{value}<td>{target}<td>{ok:?}</tr>")?;
        }
        writeln!(f, "</table>")?;
        for Picture { slip, finger, caption, file, jpeg, .. } in self.pictures {
            writeln!(f, "<p>slip {slip}, {finger}, {caption}: {file}, {} bytes</p>", jpeg.len())?;
        }
        writeln!(f, "</html>")
    }
}
