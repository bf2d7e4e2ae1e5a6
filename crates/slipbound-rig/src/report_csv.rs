//! Reports as a table, one flat row a frame: `docs/report.schema.json` with the keys joined by `_`.
//!
//! ```text
//!   finger,frame,seq,time_ns,state,reason,contact_area_px2,...,motion_translation_px_x,...,margin_value,margin_sd,...
//! ```
//!
//! Every row has every column; an unknown value is empty. The numbers are those of the JSON lines, which have zeros where
//! nothing of a frame was measured.

use crate::report_json::frame_line;
pub use crate::unmeasured::is_unmeasured;
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use slipbound::monitor::{
    ContactReport, Estimate, Estimates, EvidenceReport, MarkerCounts, MotionReport, Reason, ShearReport, SlipKind,
    SlipReport, SlipState, SlipSummary,
};
use slipbound::plane::Vec2;
use std::fmt;
use std::io::{self, Write};

/// Names of the components of a position or displacement.
const PARTS: [&str; 2] = ["x", "y"];

/// A report with every field set: it defines the columns. Only numbers that may have a fraction have one.
fn full_report() -> SlipReport {
    let some = Some(Estimate { value: 0.5, sd: 0.5, age_frames: 0 });
    let (point, number) = (Vec2::new(0.5, 0.5), Some(0.5));
    SlipReport {
        seq: 0,
        time_ns: Some(0),
        state: SlipState::Stick,
        reason: Some(Reason::Torn),
        contact: ContactReport { area_px2: 0.5, area_mm2: number, quality: 0.5 },
        markers: MarkerCounts::default(),
        reference_seq: 0,
        grip_n: number,
        motion: Some(MotionReport {
            reference_px: point,
            translation_px: point,
            translation_mm: Some(point),
            rotation_rad: 0.5,
            icr_px: Some(point),
        }),
        shear: Some(ShearReport { translation_px: point, translation_mm: Some(point), rotation_rad: 0.5 }),
        slip: SlipSummary {
            markers_over: 0,
            markers_needed: 0,
            threshold_pitch: 0.5,
            max_pitch: 0.5,
            max_mm: number,
            kind: Some(SlipKind::Both),
            direction_rad: number,
        },
        estimates: Estimates {
            stick_ratio: some,
            margin: some,
            shear_n: some,
            torque_nmm: some,
            friction: some,
            ..Estimates::default()
        },
        evidence: Some(EvidenceReport {
            reference_seq: 0,
            relaxation: 0.5,
            centre_rim_ratio: number,
            imprint_change: number,
            imprint_age_frames: 0,
            slide_score: 0.5,
            slide_px: point,
            slide_rad: 0.5,
            slides: false,
            gross_probability: number,
            slide_pitch_per_s: number,
            slide_mm_per_s: number,
        }),
    }
}

/// The parts of a report that are measured in every judged frame.
pub const MEASURED: [&str; 3] = ["contact", "markers", "slip"];

/// The line of a report in which nothing is null, and every number that may have a fraction has one.
pub fn full_line() -> io::Result<Vec<u8>> {
    frame_line("finger", 0, &full_report(), None)
}

/// A line of the report whose keys keep their order.
enum Ordered {
    Leaf(String),
    Parts(Vec<Ordered>),
    Object(Vec<(String, Ordered)>),
}

impl<'de> Deserialize<'de> for Ordered {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Any;
        impl<'de> Visitor<'de> for Any {
            type Value = Ordered;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a line of a report")
            }
            fn visit_unit<E>(self) -> Result<Ordered, E> {
                Ok(Ordered::Leaf(String::new()))
            }
            fn visit_bool<E>(self, value: bool) -> Result<Ordered, E> {
                Ok(Ordered::Leaf(value.to_string()))
            }
            fn visit_i64<E>(self, value: i64) -> Result<Ordered, E> {
                Ok(Ordered::Leaf(value.to_string()))
            }
            fn visit_u64<E>(self, value: u64) -> Result<Ordered, E> {
                Ok(Ordered::Leaf(value.to_string()))
            }
            fn visit_f64<E>(self, value: f64) -> Result<Ordered, E> {
                Ok(Ordered::Leaf(value.to_string()))
            }
            fn visit_str<E>(self, value: &str) -> Result<Ordered, E> {
                Ok(Ordered::Leaf(value.to_owned()))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut parts: A) -> Result<Ordered, A::Error> {
                let mut all = Vec::new();
                while let Some(part) = parts.next_element()? {
                    all.push(part);
                }
                Ok(Ordered::Parts(all))
            }
            fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Ordered, A::Error> {
                let mut all = Vec::new();
                while let Some(entry) = entries.next_entry()? {
                    all.push(entry);
                }
                Ok(Ordered::Object(all))
            }
        }
        deserializer.deserialize_any(Any)
    }
}

/// Calls `leaf(name, value)` for every leaf of a line, in the order of the complete line `full`.
fn each_leaf(full: &Ordered, line: Option<&Ordered>, name: &str, leaf: &mut impl FnMut(&str, &str)) {
    let named = |part: &str| if name.is_empty() { part.to_owned() } else { format!("{name}_{part}") };
    match full {
        Ordered::Leaf(_) => match line {
            Some(Ordered::Leaf(value)) => leaf(name, value),
            _ => leaf(name, ""),
        },
        Ordered::Parts(parts) => {
            for (i, (part, letter)) in parts.iter().zip(PARTS).enumerate() {
                let value = line.and_then(|line| if let Ordered::Parts(all) = line { all.get(i) } else { None });
                each_leaf(part, value, &named(letter), leaf);
            }
        }
        Ordered::Object(entries) => {
            for (key, part) in entries {
                let value = line.and_then(|line| match line {
                    Ordered::Object(all) => all.iter().find(|(other, _)| other == key).map(|(_, value)| value),
                    _ => None,
                });
                each_leaf(part, value, &named(key), leaf);
            }
        }
    }
}

/// Writes the table.
pub struct ReportCsv<W: Write> {
    to: csv::Writer<W>,
    full: Ordered,
    finger: String,
    frames_count: u64,
}

impl<W: Write> ReportCsv<W> {
    /// Starts a table with its header: the reports of the finger called `finger`.
    pub fn new(to: W, finger: &str) -> io::Result<Self> {
        let full = serde_json::from_slice(&full_line()?)?;
        let mut writer = csv::Writer::from_writer(to);
        let mut names = csv::StringRecord::new();
        each_leaf(&full, None, "", &mut |name, _| names.push_field(name));
        writer.write_record(&names)?;
        Ok(ReportCsv { to: writer, full, finger: finger.to_owned(), frames_count: 0 })
    }

    /// Writes the row of a frame, completely or not at all as far as the operating system allows.
    pub fn frame(&mut self, report: &SlipReport) -> io::Result<()> {
        let line = serde_json::from_slice(&frame_line(&self.finger, self.frames_count, report, None)?)?;
        let mut row = csv::StringRecord::new();
        let is_unmeasured = is_unmeasured(report);
        each_leaf(&self.full, Some(&line), "", &mut |name, value| {
            let is_empty = is_unmeasured && name.split_once('_').is_some_and(|(part, _)| MEASURED.contains(&part));
            row.push_field(if is_empty { "" } else { value });
        });
        self.frames_count += 1;
        self.to.write_record(&row)?;
        self.to.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_has_every_column_and_what_is_unknown_is_empty() {
        let mut bytes = Vec::new();
        let mut table = ReportCsv::new(&mut bytes, "left, upper").expect("memory");
        let known = SlipReport { seq: 7, ..full_report() };
        let unknown = SlipReport {
            state: SlipState::Unjudged,
            reason: Some(Reason::MarkersLost),
            motion: None,
            evidence: None,
            time_ns: None,
            ..full_report()
        };
        table.frame(&known).expect("memory");
        table.frame(&unknown).expect("memory");
        table.frame(&SlipReport { reason: Some(Reason::Torn), ..unknown }).expect("memory");
        drop(table);
        let mut rows = csv::Reader::from_reader(bytes.as_slice());
        let names = rows.headers().expect("a header").clone();
        let column =
            |name: &str| names.iter().position(|n| n == name).unwrap_or_else(|| panic!("no {name}: {names:?}"));
        let records: Vec<_> = rows.records().map(|row| row.expect("as long as the header")).collect();
        assert_eq!(names.iter().take(6).collect::<Vec<_>>(), ["finger", "frame", "seq", "time_ns", "state", "reason"]);
        assert_eq!((&records[0][column("finger")], &records[0][column("seq")]), ("left, upper", "7"));
        assert_eq!(&records[0][column("motion_translation_px_y")], "0.5");
        assert_eq!((&records[1][column("frame")], &records[1][column("time_ns")]), ("1", ""));
        assert_eq!((&records[1][column("state")], &records[1][column("motion_icr_px_x")]), ("unjudged", ""));
        assert_eq!((&records[1][column("margin_value")], &records[1][column("markers_lost")]), ("0.5", "0"));
        let values = |name: &str| records[2][column(name)].to_owned();
        assert_eq!(["state", "reason", "seq"].map(values), ["unjudged", "torn frame", "0"]);
        assert_eq!(["contact_area_mm2", "markers_lost", "slip_max_pitch"].map(values), ["", "", ""], "not measured");
    }
}
