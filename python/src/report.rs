//! The report on one frame, as an object with the names of the JSON report.

use crate::errors::{internal, word};
use crate::field::{Field, Kept};
use pyo3::prelude::*;
use serde_json::Value;
use slipbound::monitor::{
    ContactReport, Estimate as CoreEstimate, EvidenceReport, MarkerCounts, MotionReport, ShearReport, SlipKind,
    SlipReport, SlipSummary,
};
use slipbound::plane::Vec2;
use slipbound_rig::overlay::OverlayInput;
use slipbound_rig::report_csv::MEASURED;
use slipbound_rig::report_json::{MarkerField, frame_line};
use slipbound_rig::unmeasured::is_unmeasured;
use std::sync::Arc;

/// x and y.
type Pair = (f64, f64);

fn pair(v: Vec2) -> Pair {
    (v.x, v.y)
}

/// A part of a report: read-only attributes, and a text with all of them.
macro_rules! part {
    ($(#[$doc:meta])* $name:ident from $core:ty { $($(#[$field_doc:meta])* $field:ident: $type:ty = $value:expr,)* }) => {
        $(#[$doc])*
        #[pyclass(frozen, get_all, module = "slipbound")]
        #[derive(Debug, Clone)]
        pub struct $name { $($(#[$field_doc])* pub $field: $type,)* }

        impl From<$core> for $name {
            fn from(core: $core) -> Self {
                $name { $($field: $value(core.$field),)* }
            }
        }

        #[pymethods]
        impl $name {
            fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
                let fields = [$((stringify!($field), self.$field.clone().into_pyobject(py)?.repr()?.to_string()),)*];
                let fields: Vec<String> = fields.iter().map(|(name, value)| format!("{name}={value}")).collect();
                Ok(format!(concat!(stringify!($name), "({})"), fields.join(", ")))
            }
        }
    };
}

fn same<T>(value: T) -> T {
    value
}

fn maybe_pair(v: Option<Vec2>) -> Option<Pair> {
    v.map(pair)
}

part! {
    /// The contact region of a frame.
    Contact from ContactReport {
        /// Area in rectified pixels.
        area_px2: f64 = same,
        /// Area on the gel in mm2; None where the finger's pitch in mm is unknown.
        area_mm2: Option<f64> = same,
        /// 0 to 1: whether the patch is large and strong enough to trust the verdict.
        quality: f64 = same,
    }
}

part! {
    /// Numbers of markers by state.
    Markers from MarkerCounts {
        /// Spots in this frame that lie on a marker of the rest frame.
        detected: u32 = same,
        /// Markers of the rest frame found again.
        matched: u32 = same,
        /// Markers of the rest frame not found.
        lost: u32 = same,
        /// Markers in the inner contact region, from which the rigid motion is fitted.
        inner: u32 = same,
    }
}

part! {
    /// Rigid motion of the inner contact region since the reference frame.
    Motion from MotionReport {
        /// Mean of the inner markers in the reference frame, rectified px.
        reference_px: Pair = pair,
        /// Displacement of that point in px.
        translation_px: Pair = pair,
        /// The same in mm; None where the pitch in mm is unknown.
        translation_mm: Option<Pair> = maybe_pair,
        /// Rotation in radians, positive from x to y (clockwise on the screen).
        rotation_rad: f64 = same,
        /// Centre of rotation, rectified px; None for a pure translation.
        icr_px: Option<Pair> = maybe_pair,
    }
}

part! {
    /// Displacement of the gel by the object since rest.
    Shear from ShearReport {
        /// Mean displacement of the markers in contact, px.
        translation_px: Pair = pair,
        /// The same in mm; None where the pitch in mm is unknown.
        translation_mm: Option<Pair> = maybe_pair,
        /// Rotation in radians, positive from x to y.
        rotation_rad: f64 = same,
    }
}

fn maybe_word(kind: Option<SlipKind>) -> Option<String> {
    kind.and_then(|kind| word(&kind).ok())
}

part! {
    /// Summary of the slip field.
    Slip from SlipSummary {
        /// Markers in contact that slip by more than the threshold.
        markers_over: u32 = same,
        /// The least number of them that counts as slip.
        markers_needed: u32 = same,
        /// That threshold, in marker pitches.
        threshold_pitch: f64 = same,
        /// Largest length of the slip field in contact, in marker pitches.
        max_pitch: f64 = same,
        /// The same in mm; None where the pitch in mm is unknown.
        max_mm: Option<f64> = same,
        /// `translation`, `rotation` or `both`; None while nothing slips.
        kind: Option<String> = maybe_word,
        /// Direction in which the OBJECT slides over the gel, radians from x to y; None while nothing slips.
        direction_rad: Option<f64> = same,
    }
}

part! {
    /// An estimated number.
    Estimate from CoreEstimate {
        /// The estimate.
        value: f64 = same,
        /// Its standard deviation.
        sd: f64 = same,
        /// Its age in frames; 0 when it is of this frame.
        age_frames: u32 = same,
    }
}

part! {
    /// Evidence of sliding that does not use the slip field.
    Evidence from EvidenceReport {
        /// Number of the frame of its reference.
        reference_seq: u64 = same,
        /// Fall of the displacement from its greatest since the reference, 0 to 1.
        relaxation: f64 = same,
        /// Displacement of the inner third of the markers over that of the outer third; None before any moves.
        centre_rim_ratio: Option<f64> = same,
        /// 1 - correlation of the imprint with that of the reference, in gel coordinates; None where no imprint is
        /// visible.
        imprint_change: Option<f64> = same,
        /// Age of the imprint's part of the evidence in frames.
        imprint_age_frames: u32 = same,
        /// Over 1 where the object slides; 0 to 2.
        slide_score: f64 = same,
        /// Motion of the imprint over the gel since the reference, rectified px.
        slide_px: Pair = pair,
        /// Rotation of the imprint on the gel since then, radians.
        slide_rad: f64 = same,
        /// Whether the object slides as a whole now.
        slides: bool = same,
        /// Probability that the object slides as a whole, 0 to 1; None where no slide can begin, or too little is known.
        gross_probability: Option<f64> = same,
        /// Speed of that slide in pitches per second; None while nothing slides.
        slide_pitch_per_s: Option<f64> = same,
        /// The same in mm/s; None also where the pitch in mm is unknown.
        slide_mm_per_s: Option<f64> = same,
    }
}

/// The verdict on one frame and the evidence for it.
#[pyclass(frozen, module = "slipbound")]
pub struct Report {
    pub report: SlipReport,
    pub kept: Arc<Kept>,
    /// The name of the finger.
    #[pyo3(get)]
    pub finger: String,
    /// Index among all frames seen, from 0.
    #[pyo3(get)]
    pub frame: u64,
    /// Why there is no rest frame yet.
    pub waiting: Option<String>,
}

#[pymethods]
impl Report {
    /// The source's number of the frame.
    #[getter]
    fn seq(&self) -> u64 {
        self.report.seq
    }

    /// The source's time of the frame in ns; None where it has none.
    #[getter]
    fn time_ns(&self) -> Option<u64> {
        self.report.time_ns
    }

    /// `no_contact`, `unsure`, `stick`, `incipient`, `gross` or `unjudged`.
    #[getter]
    fn state(&self) -> PyResult<String> {
        word(&self.report.state)
    }

    /// Whether the contact slips, in part or as a whole.
    #[getter]
    fn slips(&self) -> bool {
        self.report.state.is_slip()
    }

    /// Why there is no verdict; None when there is one.
    #[getter]
    fn reason(&self) -> Option<String> {
        self.waiting.clone().or_else(|| self.report.reason.map(|reason| reason.to_string()))
    }

    /// The contact region.
    #[getter]
    fn contact(&self) -> Contact {
        self.report.contact.into()
    }

    /// Numbers of markers by state.
    #[getter]
    fn markers(&self) -> Markers {
        self.report.markers.into()
    }

    /// Number of the reference frame.
    #[getter]
    fn reference_seq(&self) -> u64 {
        self.report.reference_seq
    }

    /// Grip force per finger in newtons, as given.
    #[getter]
    fn grip_n(&self) -> Option<f64> {
        self.report.grip_n
    }

    /// Rigid motion of the inner contact region; None when too few markers are in contact.
    #[getter]
    fn motion(&self) -> Option<Motion> {
        self.report.motion.map(Into::into)
    }

    /// Shear displacement of the gel; None without contact.
    #[getter]
    fn shear(&self) -> Option<Shear> {
        self.report.shear.map(Into::into)
    }

    /// Summary of the slip field.
    #[getter]
    fn slip(&self) -> Slip {
        self.report.slip.into()
    }

    /// Share of the contact that sticks, 0 to 1.
    #[getter]
    fn stick_ratio(&self) -> Option<Estimate> {
        self.report.estimates.stick_ratio.map(Into::into)
    }

    /// Slip margin: 1 - load over the load at which the object slides.
    #[getter]
    fn margin(&self) -> Option<Estimate> {
        self.report.estimates.margin.map(Into::into)
    }

    /// Force along the finger's surface, N.
    #[getter]
    fn shear_n(&self) -> Option<Estimate> {
        self.report.estimates.shear_n.map(Into::into)
    }

    /// Torque about the middle of the contact, N mm, positive from x to y.
    #[getter]
    fn torque_nmm(&self) -> Option<Estimate> {
        self.report.estimates.torque_nmm.map(Into::into)
    }

    /// Friction coefficient between object and gel.
    #[getter]
    fn friction(&self) -> Option<Estimate> {
        self.report.estimates.friction.map(Into::into)
    }

    /// Evidence of sliding; None without contact, and where it is not used.
    #[getter]
    fn evidence(&self) -> Option<Evidence> {
        self.report.evidence.map(Into::into)
    }

    /// Every marker of the rest frame as arrays: the displacement and slip fields.
    #[getter]
    fn field(&self) -> Field {
        Field(self.kept.clone())
    }

    /// The line of `slipbound watch --json`; with `markers` that of `watch --json --markers`.
    ///
    /// Parameters
    /// ----------
    /// markers : bool
    ///     Whether every marker and the outline of the contact are in it.
    #[pyo3(signature = (*, markers = false))]
    fn to_json(&self, markers: bool) -> PyResult<String> {
        let line = self.kept.seen(|OverlayInput { markers: all, contact_region, .. }| {
            let field = markers.then_some(MarkerField { markers: all, contact_region });
            frame_line(&self.finger, self.frame, &self.report, field)
        });
        let line = line.map_err(internal)?;
        let line = String::from_utf8(line).map_err(internal)?;
        Ok(match &self.waiting {
            None => line,
            // A quote in the finger's name is escaped: the first such text is the key.
            Some(why) => line.replacen("\"reason\":null", &format!("\"reason\":{}", Value::from(why.as_str())), 1),
        })
    }

    /// The same as a dict.
    ///
    /// Parameters
    /// ----------
    /// markers : bool
    ///     Whether every marker and the outline of the contact are in it.
    #[pyo3(signature = (*, markers = false))]
    fn to_dict<'py>(&self, py: Python<'py>, markers: bool) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (self.to_json(markers)?,))
    }

    /// The same as a flat dict: `contact_area_px2`, `motion_translation_px_x`, ... The keys are the same for every
    /// report; an unknown value is None, and so is what was not measured, as in a torn frame.
    fn to_row<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let line = self.to_dict(py, false)?;
        if self.waiting.is_some() || is_unmeasured(&self.report) {
            MEASURED.iter().try_for_each(|part| line.set_item(part, py.None()))?;
        }
        py.import("slipbound._rows")?.call_method1("flat", (line,))
    }

    fn __repr__(&self) -> PyResult<String> {
        let state = word(&self.report.state)?;
        let margin = self.report.estimates.margin.map_or_else(String::new, |m| format!(", margin {:.2}", m.value));
        let reason = self.reason().map_or_else(String::new, |reason| format!(": {reason}"));
        Ok(format!("<slipbound.Report of frame {}: {state}{reason}{margin}>", self.report.seq))
    }
}

/// The line of a report in which nothing is None: it defines the columns and their types.
#[pyfunction]
pub fn full_line() -> PyResult<String> {
    String::from_utf8(slipbound_rig::report_csv::full_line().map_err(internal)?).map_err(internal)
}
