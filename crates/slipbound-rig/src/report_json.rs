//! Reports as JSON, one object a line: a header, then a line a frame. `docs/report.schema.json` is the schema.
//!
//! A line of a frame, shortened:
//!
//! ```json
//! {"finger":"finger","frame":41,"seq":41,"time_ns":4100000000,"state":"incipient","reason":null,
//!  "contact":{"area_px2":22786,"area_mm2":128.1,"quality":0.93},
//!  "markers":{"detected":224,"matched":224,"lost":0,"inner":24},"reference_seq":0,"grip_n":null,
//!  "motion":{"translation_px":[5.1,0.2],"rotation_rad":0.01,"icr_px":null},
//!  "slip":{"markers_over":9,"markers_needed":2,"threshold_pitch":0.296,"max_pitch":0.36,"max_mm":0.54,"kind":"translation",
//!  "direction_rad":0.05},
//!  "stick_ratio":{"value":0.52,"sd":0.1,"age_frames":0},"margin":{"value":0.46,"sd":0.08,"age_frames":0},
//!  "shear_n":null,"torque_nmm":null,"friction":null}
//! ```
//!
//! A line is flushed as soon as it is written, so what was judged is kept when a later frame fails. Numbers of a
//! frame have at most 4 decimals; what is not a number is null. Readers must ignore keys they do not know.

mod outline;

use crate::printable::without_passwords;
use crate::unmeasured::markers_after;
use serde::{Deserialize, Serialize};
use serde_json::ser::Formatter;
use slipbound::image::Mask;
use slipbound::monitor::{Marker, RestKind, Settings, SlipMonitor, SlipReport};
use slipbound::plane::Vec2;
use slipbound::port::Clock;
use slipbound::sensor::Sensor;
use std::io::{self, Write};

/// Incremented when a reader of old lines could misread new ones; not for new keys alone.
pub const FORMAT_VERSION: u32 = 2;

/// The first line of a report.
#[derive(Debug, Clone, Serialize)]
pub struct Header<'a> {
    /// Which finger of the hand.
    pub finger: &'a str,
    /// The facts of the finger at the size of its frames.
    pub sensor: &'a Sensor,
    /// All settings.
    pub settings: &'a Settings,
    /// Where the frames came from, as the user named it; a password in it is not written.
    #[serde(serialize_with = "shown")]
    pub source: &'a str,
    /// Whose clock `time_ns` is from.
    pub clock: Clock,
    /// What the rest frame was made from.
    pub rest: RestOrigin,
    /// What a reader should know before trusting the lines.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

fn shown<S: serde::Serializer>(source: &str, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(&without_passwords(source))
}

/// What the rest frame was made from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RestOrigin {
    /// How it was obtained.
    pub kind: RestOriginKind,
    /// The frames of the source that were averaged: from, to (exclusive); None when it came from another file.
    pub frames: Option<[u64; 2]>,
}

/// How the rest frame was obtained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RestOriginKind {
    /// Found among the first frames: nothing touched the finger.
    Unloaded,
    /// Found among the first frames: something touched the finger already.
    InContact,
    /// Named by the user.
    Given,
}

impl From<RestKind> for RestOriginKind {
    fn from(kind: RestKind) -> Self {
        match kind {
            RestKind::Unloaded => RestOriginKind::Unloaded,
            RestKind::InContact => RestOriginKind::InContact,
        }
    }
}

/// The header as it is written.
#[derive(Serialize)]
struct HeaderLine<'a> {
    format: &'static str,
    format_version: u32,
    software_version: &'static str,
    #[serde(flatten)]
    header: &'a Header<'a>,
}

/// What a line also contains where every marker is asked for.
#[derive(Debug, Clone, Copy)]
pub struct MarkerField<'a> {
    /// Every marker after the frame.
    pub markers: &'a [Marker],
    /// The contact region, rectified.
    pub contact_region: &'a Mask,
}

impl<'a> From<&'a SlipMonitor> for MarkerField<'a> {
    fn from(monitor: &'a SlipMonitor) -> Self {
        MarkerField { markers: monitor.markers(), contact_region: monitor.contact_region() }
    }
}

/// A frame as it is written.
#[derive(Serialize)]
struct FrameLine<'a> {
    finger: &'a str,
    frame: u64,
    #[serde(flatten)]
    report: &'a SlipReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    field: Option<Field<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lost_ids: Option<Vec<u32>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    contact_outline_px: Option<Vec<Vec<Vec2>>>,
}

/// All markers, `[id, x_px, y_px, dx_px, dy_px, slip_x_px, slip_y_px, inner, over, in_contact]` each.
struct Field<'a>(&'a [Marker]);

impl Serialize for Field<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(|m| {
            let moved = m.now_from_rest();
            let flags = [m.inner, m.over, m.in_contact].map(u8::from);
            (m.id, m.now.x, m.now.y, moved.x, moved.y, m.slip.x, m.slip.y, flags[0], flags[1], flags[2])
        }))
    }
}

/// The line of a frame by itself, without an end of line: frame number `frame` of the finger called `finger`.
pub fn frame_line(
    finger: &str,
    frame: u64,
    report: &SlipReport,
    field: Option<MarkerField<'_>>,
) -> io::Result<Vec<u8>> {
    let mut line = Vec::new();
    put_frame(&mut line, finger, frame, report, field)?;
    Ok(line)
}

/// For programs that read reports: the report of a line that [`frame_line`] has made, its numbers as exact as they were
/// written; None for the header. Fails where a number was not finite, for then null stands in its place.
pub fn read_frame(line: &str) -> serde_json::Result<Option<SlipReport>> {
    let is_header = serde_json::from_str::<Format>(line)?.format.is_some();
    if is_header { Ok(None) } else { serde_json::from_str(line).map(Some) }
}

/// What only a header has.
#[derive(Deserialize)]
struct Format {
    format: Option<String>,
}

fn put_frame(
    line: &mut Vec<u8>,
    finger: &str,
    frame: u64,
    report: &SlipReport,
    field: Option<MarkerField<'_>>,
) -> io::Result<()> {
    let markers = field.map(|f| markers_after(report, f.markers));
    let lost_ids = markers.as_ref().map(|all| all.iter().filter(|m| !m.matched).map(|m| m.id).collect());
    // A frame that was not judged has no contact region of its own.
    let outlines = |f: MarkerField<'_>| match report.contact.area_px2 {
        0.0 => Vec::new(),
        _ => outline::outlines(f.contact_region),
    };
    let (contact_outline_px, field) = (field.map(outlines), markers.as_deref().map(Field));
    let written = FrameLine { finger, frame, report, field, lost_ids, contact_outline_px };
    Ok(written.serialize(&mut serde_json::Serializer::with_formatter(line, FourDecimals))?)
}

/// Writes the lines.
#[derive(Debug)]
pub struct ReportJson<W> {
    to: W,
    finger: String,
    frames_count: u64,
    line: Vec<u8>,
}

impl<W: Write> ReportJson<W> {
    /// Writes the header.
    pub fn new(mut to: W, header: &Header<'_>) -> io::Result<Self> {
        let line = HeaderLine {
            format: "slipbound-report",
            format_version: FORMAT_VERSION,
            software_version: env!("CARGO_PKG_VERSION"),
            header,
        };
        let mut bytes = serde_json::to_vec(&line)?;
        bytes.push(b'\n');
        to.write_all(&bytes)?;
        to.flush()?;
        Ok(ReportJson { to, finger: header.finger.to_owned(), frames_count: 0, line: Vec::new() })
    }

    /// Writes the line of the next frame; with `field` also where each marker is, and the outline of the contact.
    pub fn frame(&mut self, report: &SlipReport, field: Option<MarkerField<'_>>) -> io::Result<()> {
        self.line.clear();
        put_frame(&mut self.line, &self.finger, self.frames_count, report, field)?;
        self.line.push(b'\n');
        self.to.write_all(&self.line)?;
        self.to.flush()?;
        self.frames_count += 1;
        Ok(())
    }
}

/// Rounds every number to 4 decimals; `serde_json` itself writes null for what is not finite.
struct FourDecimals;

impl Formatter for FourDecimals {
    fn write_f64<W: ?Sized + Write>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        let rounded = (value * 1e4).round() / 1e4 + 0.0; // + 0.0 takes the sign off a zero
        // Whole numbers without a decimal point, as most are; beyond 2^53 the shortest form has an exponent.
        if rounded.fract() == 0.0 && rounded.abs() < 9e15 {
            write!(writer, "{}", rounded as i64)
        } else {
            write!(writer, "{}", if rounded.is_finite() { rounded } else { value })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::Value;
    use slipbound::monitor::{
        ContactReport, Estimate, Estimates, EvidenceReport, MarkerCounts, MotionReport, Reason, ShearReport, SlipKind,
        SlipState, SlipSummary,
    };

    fn report() -> SlipReport {
        SlipReport {
            seq: 7,
            time_ns: Some(280_000_000),
            state: SlipState::Incipient,
            reason: None,
            contact: ContactReport { area_px2: 31.0, area_mm2: None, quality: 0.123456 },
            markers: MarkerCounts { detected: 65, matched: 64, lost: 1, inner: 20 },
            reference_seq: 3,
            grip_n: Some(10.0),
            motion: Some(MotionReport {
                reference_px: Vec2::new(1.00004, -0.00004),
                translation_px: Vec2::new(1e-9, 2.5),
                translation_mm: None,
                rotation_rad: f64::NAN,
                icr_px: None,
            }),
            shear: Some(ShearReport {
                translation_px: Vec2::new(2.0, -1.0),
                translation_mm: None,
                rotation_rad: 0.125,
            }),
            slip: SlipSummary {
                markers_over: 9,
                markers_needed: 8,
                threshold_pitch: 0.29605,
                max_pitch: 0.33336,
                max_mm: None,
                kind: Some(SlipKind::Both),
                direction_rad: Some(-1.5),
            },
            estimates: Estimates {
                margin: Some(Estimate { value: 0.43217, sd: 0.08, age_frames: 0 }),
                ..Estimates::default()
            },
            evidence: Some(EvidenceReport {
                reference_seq: 2,
                relaxation: 0.25,
                centre_rim_ratio: None,
                imprint_change: Some(0.5),
                imprint_age_frames: 0,
                slide_score: 0.75,
                slide_px: Vec2::new(3.0, 0.5),
                slide_rad: 0.01,
                slides: true,
                gross_probability: Some(0.984),
                slide_pitch_per_s: Some(1.5),
                slide_mm_per_s: None,
            }),
        }
    }

    fn marker() -> Marker {
        Marker {
            id: 4,
            rest: Vec2::new(10.0, 20.0),
            reference: Vec2::new(10.0, 20.0),
            now: Vec2::new(11.5, 19.0),
            matched: true,
            whole: true,
            in_reference: true,
            in_contact: true,
            inner: true,
            slip: Vec2::new(0.25, f64::INFINITY),
            over: false,
        }
    }

    fn region() -> Mask {
        Mask::from_picture(
            "......
             .####.
             .####.",
        )
    }

    fn field<'a>(markers: &'a [Marker], contact_region: &'a Mask) -> MarkerField<'a> {
        MarkerField { markers, contact_region }
    }

    fn header<'a>(sensor: &'a Sensor, settings: &'a Settings) -> Header<'a> {
        let rest = RestOrigin { kind: RestOriginKind::InContact, frames: Some([0, 6]) };
        let (source, note) = ("rtsp://me:secret@cam/gel", Some("starts in contact".into()));
        Header { finger: "left", sensor, settings, source, clock: Clock::Unknown, rest, note }
    }

    fn lines() -> Vec<String> {
        let (sensor, settings) = (crate::sensors::load("gelslim").expect("built in"), Settings::default());
        let mut out = Vec::new();
        let mut json = ReportJson::new(&mut out, &header(&sensor, &settings)).expect("writes");
        json.frame(&report(), None).expect("writes");
        json.frame(&report(), Some(field(&[marker()], &region()))).expect("writes");
        let reason = Some(Reason::Torn);
        let torn = SlipReport { state: SlipState::Unjudged, reason, motion: None, time_ns: None, ..report() };
        json.frame(&torn, None).expect("writes");
        String::from_utf8(out).expect("UTF-8").lines().map(str::to_owned).collect()
    }

    #[test]
    fn a_frame_is_the_line_that_was_agreed() {
        let expected = r#"{"finger":"left","frame":0,"seq":7,"time_ns":280000000,"state":"incipient","reason":null,"#
            .to_owned()
            + r#""contact":{"area_px2":31,"area_mm2":null,"quality":0.1235},"#
            + r#""markers":{"detected":65,"matched":64,"lost":1,"inner":20},"reference_seq":3,"grip_n":10,"#
            + r#""motion":{"reference_px":[1,0],"translation_px":[0,2.5],"translation_mm":null,"rotation_rad":null,"icr_px":null},"#
            + r#""shear":{"translation_px":[2,-1],"translation_mm":null,"rotation_rad":0.125},"#
            + r#""slip":{"markers_over":9,"markers_needed":8,"threshold_pitch":0.2961,"max_pitch":0.3334,"max_mm":null,"kind":"both","direction_rad":-1.5},"stick_ratio":null,"margin":{"value":0.4322,"sd":0.08,"age_frames":0},"shear_n":null,"torque_nmm":null,"friction":null,"#
            + r#""evidence":{"reference_seq":2,"relaxation":0.25,"centre_rim_ratio":null,"imprint_change":0.5,"imprint_age_frames":0,"#
            + r#""slide_score":0.75,"slide_px":[3,0.5],"slide_rad":0.01,"slides":true,"gross_probability":0.984,"slide_pitch_per_s":1.5,"slide_mm_per_s":null}}"#;
        assert_eq!(lines()[1], expected);
    }

    #[test]
    fn a_line_by_itself_is_the_same() {
        let line = frame_line("left", 1, &report(), Some(field(&[marker()], &region()))).expect("writes");
        assert_eq!(String::from_utf8(line).expect("UTF-8"), lines()[2]);
    }

    fn any_reason() -> impl Strategy<Value = Option<Reason>> {
        let px = |number: u32| f64::from(number) / 10.0;
        prop_oneof![
            Just(None),
            Just(Some(Reason::Torn)),
            any::<u16>().prop_map(move |n| Some(Reason::Dark { mean_levels: px(n.into()) })),
            any::<u32>().prop_map(|n| Some(Reason::Gap { since_ns: Some(u64::from(n) * 10_000_000) })),
            any::<u16>().prop_map(move |n| {
                Some(Reason::MarkerSpacing { expected_px: px(n.into()), got_px: px(7), fitting: None })
            }),
        ]
    }

    proptest! {
        #[test]
        fn a_report_comes_back_from_its_line(
            numbers in proptest::collection::vec(-1e9f64..1e9, 12),
            parts in proptest::collection::vec(any::<bool>(), 6),
            counts in proptest::collection::vec(any::<u32>(), 4),
            reason in any_reason(),
        ) {
            let mut report = SlipReport { reason, time_ns: parts[0].then_some(u64::from(counts[0])), ..report() };
            report.markers.detected = counts[1];
            report.contact = ContactReport { area_mm2: parts[1].then_some(numbers[0]), quality: numbers[1], ..report.contact };
            report.motion = parts[2].then(|| MotionReport {
                reference_px: Vec2::new(numbers[2], numbers[3]),
                translation_px: Vec2::default(),
                translation_mm: parts[3].then(|| Vec2::new(numbers[4], 0.0)),
                rotation_rad: numbers[5],
                icr_px: None,
            });
            report.slip.kind = parts[4].then_some(SlipKind::Rotation);
            let estimate = Estimate { value: numbers[6], sd: numbers[7], age_frames: counts[2] };
            report.estimates = Estimates { friction: parts[5].then_some(estimate), ..report.estimates };
            let exact = serde_json::to_string(&report).expect("JSON");
            prop_assert_eq!(read_frame(&exact).expect("a report"), Some(report), "to the last bit");
            let line = frame_line("left", 3, &report, None).expect("writes");
            let read = read_frame(std::str::from_utf8(&line).expect("UTF-8")).expect("a report").expect("no header");
            prop_assert_eq!(frame_line("left", 3, &read, None).expect("writes"), line, "as exact as it was written");
        }
    }

    #[test]
    fn a_header_is_no_report_and_a_null_number_is_told() {
        assert_eq!(read_frame(&lines()[0]).expect("a header"), None);
        let refused = read_frame(&lines()[1]).expect_err("the rotation is not a number").to_string();
        assert!(refused.contains("null"), "{refused}");
    }

    #[test]
    fn markers_are_short_rows() {
        let line: Value = serde_json::from_str(&lines()[2]).expect("JSON");
        assert_eq!(line["field"].to_string(), "[[4,11.5,19,1.5,-1,0.25,null,1,0,1]]");
        assert_eq!(line["contact_outline_px"].to_string(), "[[[4.5,0.5],[4.5,2.5],[0.5,2.5],[0.5,0.5]]]");
        assert_eq!(line["frame"], 1);
    }

    #[test]
    fn a_frame_that_was_not_judged_has_no_outline_of_the_one_before() {
        let torn = SlipReport { contact: ContactReport::default(), ..report() };
        let line = frame_line("left", 1, &torn, Some(field(&[], &region()))).expect("writes");
        let line: Value = serde_json::from_slice(&line).expect("JSON");
        assert_eq!(line["contact_outline_px"], Value::Array(Vec::new()));
    }

    #[test]
    fn a_frame_that_was_not_measured_has_no_marker_that_was_found_or_slips() {
        let dark = Some(Reason::Dark { mean_levels: 0.0 });
        let unmeasured =
            SlipReport { state: SlipState::Unjudged, reason: dark, contact: ContactReport::default(), ..report() };
        let of = |report: &SlipReport| {
            let line = frame_line("left", 1, report, Some(field(&[marker()], &region()))).expect("writes");
            let line: Value = serde_json::from_slice(&line).expect("JSON");
            (line["field"].to_string(), line["lost_ids"].to_string())
        };
        assert_eq!(of(&unmeasured), ("[[4,11.5,19,1.5,-1,0,0,0,0,0]]".into(), "[4]".into()));
        let measured = SlipReport { reason: Some(Reason::MarkersLost), ..unmeasured };
        assert_eq!(of(&measured), ("[[4,11.5,19,1.5,-1,0.25,null,1,0,1]]".into(), "[]".into()), "what there is");
    }

    #[test]
    fn the_published_schema_takes_rows_without_in_contact_and_a_line_without_outline() {
        let mut line: Value = serde_json::from_str(&lines()[2]).expect("JSON");
        line["field"][0].as_array_mut().expect("a row").pop();
        line.as_object_mut().expect("an object").remove("contact_outline_px");
        assert!(schema().is_valid(&line), "as written before they existed");
    }

    #[test]
    fn the_header_says_what_made_the_lines() {
        let line: Value = serde_json::from_str(&lines()[0]).expect("JSON");
        assert_eq!((&line["format"], &line["format_version"]), (&"slipbound-report".into(), &2.into()));
        assert_eq!(line["software_version"], env!("CARGO_PKG_VERSION"));
        assert_eq!(line["sensor"]["rectification"]["homography"][2][0], -0.00010275817, "not rounded");
        assert_eq!(line["rest"].to_string(), r#"{"frames":[0,6],"kind":"in_contact"}"#);
        assert_eq!(line["source"], "rtsp://me@cam/gel", "no password");
        assert_eq!((&line["clock"], &line["note"]), (&"unknown".into(), &"starts in contact".into()));
        let (sensor, settings) = (crate::sensors::load("gelslim").expect("built in"), Settings::default());
        assert_eq!(serde_json::from_value::<Sensor>(line["sensor"].clone()).expect("a sensor"), sensor);
        assert_eq!(serde_json::from_value::<Settings>(line["settings"].clone()).expect("settings"), settings);
    }

    fn schema() -> jsonschema::Validator {
        let text = include_str!("../report.schema.json");
        jsonschema::validator_for(&serde_json::from_str(text).expect("JSON")).expect("a schema")
    }

    #[test]
    fn the_published_schema_takes_what_is_written() {
        let schema = schema();
        for line in lines() {
            let line: Value = serde_json::from_str(&line).expect("JSON");
            let faults: Vec<String> = schema.iter_errors(&line).map(|e| e.to_string()).collect();
            assert!(faults.is_empty(), "{line}: {faults:?}");
        }
    }

    #[test]
    fn the_published_schema_refuses_what_is_not_written() {
        let schema = schema();
        let lines = lines();
        for (line, pointer, value) in [
            (0, "/clock", Value::from("noon")),
            (0, "/format_version", Value::from(3)),
            (0, "/rest/kind", Value::from("warm")),
            (0, "/settings", Value::Null),
            (1, "/state", Value::from("slipping")),
            (1, "/contact/quality", Value::from(1.5)),
            (1, "/contact/area_px2", Value::Null),
            (1, "/motion/translation_px", Value::from("none")),
            (1, "/markers/lost", Value::from(-1)),
            (1, "/time_ns", Value::from("now")),
            (1, "/slip/kind", Value::from("none")),
            (1, "/evidence/slides", Value::from("yes")),
            (1, "/evidence/relaxation", Value::from(1.5)),
            (2, "/field/0/7", Value::from(2)),
            (2, "/field/0/9", Value::from(2)),
            (2, "/contact_outline_px/0", Value::from(vec![1, 2])),
            (2, "/field/0", Value::from(vec![1, 2])),
        ] {
            let mut line: Value = serde_json::from_str(&lines[line]).expect("JSON");
            *line.pointer_mut(pointer).expect("there") = value.clone();
            assert!(!schema.is_valid(&line), "{pointer} = {value} passed");
        }
        for key in ["finger", "state", "slip", "motion", "time_ns"] {
            let mut line: Value = serde_json::from_str(&lines[1]).expect("JSON");
            line.as_object_mut().expect("an object").remove(key);
            assert!(!schema.is_valid(&line), "a line without {key} passed");
        }
    }
}
