//! The library's reports as messages: unknown values are NaN, an empty string or, for times, 0.

use super::report::{
    Contact, Estimate, Evidence, HandReport, HandSlip, HandVector, Markers, Motion, Shear, Slip, SlipReport,
};
use super::standard::{Header, Time};
use serde::Serialize;
use slipbound::hand;
use slipbound::monitor;
use slipbound::plane::Vec2;

const UNKNOWN_PX: [f64; 2] = [f64::NAN; 2];

/// The name of this value in the JSON report, so that there is a single list of names.
fn word(value: impl Serialize) -> String {
    match toml::Value::try_from(value) {
        Ok(toml::Value::String(word)) => word,
        _ => String::new(),
    }
}

fn number(value: Option<f64>) -> f64 {
    value.unwrap_or(f64::NAN)
}

fn point(value: Option<Vec2>) -> [f64; 2] {
    value.map_or(UNKNOWN_PX, |v| [v.x, v.y])
}

impl From<Option<monitor::MotionReport>> for Motion {
    fn from(motion: Option<monitor::MotionReport>) -> Self {
        Motion {
            reference_px: point(motion.map(|m| m.reference_px)),
            translation_px: point(motion.map(|m| m.translation_px)),
            translation_mm: point(motion.and_then(|m| m.translation_mm)),
            rotation_rad: number(motion.map(|m| m.rotation_rad)),
            icr_px: point(motion.and_then(|m| m.icr_px)),
        }
    }
}

impl From<Option<monitor::ShearReport>> for Shear {
    fn from(shear: Option<monitor::ShearReport>) -> Self {
        Shear {
            translation_px: point(shear.map(|s| s.translation_px)),
            translation_mm: point(shear.and_then(|s| s.translation_mm)),
            rotation_rad: number(shear.map(|s| s.rotation_rad)),
        }
    }
}

impl From<monitor::SlipSummary> for Slip {
    fn from(slip: monitor::SlipSummary) -> Self {
        Slip {
            markers_over: slip.markers_over,
            markers_needed: slip.markers_needed,
            threshold_pitch: slip.threshold_pitch,
            max_pitch: slip.max_pitch,
            max_mm: number(slip.max_mm),
            kind: slip.kind.map(word).unwrap_or_default(),
            direction_rad: number(slip.direction_rad),
        }
    }
}

impl From<Option<monitor::Estimate>> for Estimate {
    fn from(estimate: Option<monitor::Estimate>) -> Self {
        match estimate {
            Some(monitor::Estimate { value, sd, age_frames }) => Estimate { value, sd, age_frames },
            None => Estimate { value: f64::NAN, sd: f64::NAN, age_frames: 0 },
        }
    }
}

impl From<Option<monitor::EvidenceReport>> for Evidence {
    fn from(evidence: Option<monitor::EvidenceReport>) -> Self {
        let number_of = |of: fn(&monitor::EvidenceReport) -> Option<f64>| number(evidence.as_ref().and_then(of));
        Evidence {
            reference_seq: evidence.map_or(0, |e| e.reference_seq),
            relaxation: number_of(|e| Some(e.relaxation)),
            centre_rim_ratio: number_of(|e| e.centre_rim_ratio),
            imprint_change: number_of(|e| e.imprint_change),
            imprint_age_frames: evidence.map_or(0, |e| e.imprint_age_frames),
            slide_score: number_of(|e| Some(e.slide_score)),
            slide_px: point(evidence.map(|e| e.slide_px)),
            slide_rad: number_of(|e| Some(e.slide_rad)),
            slides: evidence.is_some_and(|e| e.slides),
            gross_probability: number_of(|e| e.gross_probability),
            slide_pitch_per_s: number_of(|e| e.slide_pitch_per_s),
            slide_mm_per_s: number_of(|e| e.slide_mm_per_s),
        }
    }
}

impl SlipReport {
    /// The report of an image with this header, number `frame` of the finger's reports.
    pub fn of(header: Header, finger: &str, frame: u64, report: &monitor::SlipReport) -> Self {
        let contact = &report.contact;
        let monitor::MarkerCounts { detected, matched, lost, inner } = report.markers;
        let estimates = &report.estimates;
        SlipReport {
            header,
            finger: finger.to_owned(),
            frame,
            seq: report.seq,
            time_ns: report.time_ns.unwrap_or(0),
            state: word(report.state),
            reason: report.reason.map(|reason| reason.to_string()).unwrap_or_default(),
            contact: Contact {
                area_px2: contact.area_px2,
                area_mm2: number(contact.area_mm2),
                quality: contact.quality,
            },
            markers: Markers { detected, matched, lost, inner },
            reference_seq: report.reference_seq,
            grip_n: number(report.grip_n.filter(|n| *n > 0.0)),
            motion: report.motion.into(),
            shear: report.shear.into(),
            slip: report.slip.into(),
            stick_ratio: estimates.stick_ratio.into(),
            margin: estimates.margin.into(),
            shear_n: estimates.shear_n.into(),
            torque_nmm: estimates.torque_nmm.into(),
            friction: estimates.friction.into(),
            evidence: report.evidence.into(),
        }
    }
}

impl From<Option<hand::HandVector>> for HandVector {
    fn from(vector: Option<hand::HandVector>) -> Self {
        HandVector {
            along: number(vector.map(|v| v.along)),
            across: number(vector.map(|v| v.across)),
            around: number(vector.map(|v| v.around)),
        }
    }
}

impl HandReport {
    /// The report of a hand whose frame of reference has this name.
    pub fn of(frame_id: &str, report: &hand::HandReport) -> Self {
        HandReport {
            header: Header { stamp: Time::from_ns(report.time_ns.unwrap_or(0)), frame_id: frame_id.to_owned() },
            seq: report.seq,
            time_ns: report.time_ns.unwrap_or(0),
            state: word(report.state),
            live_count: report.live_count,
            health: report.health.map(word),
            separated: report.separated,
            shear_mm: report.shear_mm.into(),
            pivot_rad: number(report.pivot_rad),
            slip_max_mm: number(report.slip_max_mm),
            contact_area_mm2: number(report.contact_area_mm2),
            quality: report.quality,
            slip: HandSlip {
                direction: report.slip.map(|slip| slip.direction).into(),
                pivots: report.slip.is_some_and(|slip| slip.pivots),
                fingers_count: report.slip.map_or(0, |slip| slip.fingers_count),
            },
            margin: number(report.margin),
            margins_count: report.margins_count,
            friction: number(report.friction),
            cut_fraction: report.cut_fraction,
        }
    }
}
