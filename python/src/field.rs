//! Every marker after a frame as arrays, and the data of a frame that are kept to draw it later.

use numpy::{PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::prelude::*;
use slipbound::image::{Mask, SizePx};
use slipbound::monitor::{Marker, SlipMonitor, SlipReport};
use slipbound::pixels::morphology::Element;
use slipbound::plane::Vec2;
use slipbound::sensor::Sensor;
use slipbound_rig::overlay::OverlayInput;
use slipbound_rig::unmeasured::markers_after;
use std::sync::Arc;

/// What a report keeps of the monitor that made it.
pub struct Kept {
    pub sensor: Arc<Sensor>,
    pub markers: Vec<Marker>,
    /// The margin at which incipient slip is reported; None where another rule reports it.
    alarm_margin: Option<f64>,
    /// Size of the frame, where no monitor has checked whether it fits.
    pub unjudged_px: Option<SizePx>,
    /// The contact region and the element that erodes it to the inner one; None without contact.
    regions: Option<(Mask, Option<Element>)>,
}

impl Kept {
    /// For a frame of this size of which nothing is known.
    pub fn nothing(sensor: Arc<Sensor>, frame_px: SizePx) -> Self {
        Kept { sensor, markers: Vec::new(), alarm_margin: None, unjudged_px: Some(frame_px), regions: None }
    }

    /// The state of the monitor after the frame of this report.
    pub fn of(monitor: &SlipMonitor, sensor: Arc<Sensor>, report: &SlipReport) -> Self {
        let touched = report.contact.area_px2 > 0.0;
        let regions = touched.then(|| (monitor.contact_region().clone(), monitor.inner_erosion().cloned()));
        let alarm_margin = monitor.settings().slip.alarm_margin();
        let markers = markers_after(report, monitor.markers()).into_owned();
        Kept { sensor, markers, alarm_margin, unjudged_px: None, regions }
    }

    /// Shows it for an overlay.
    pub fn seen<R>(&self, draw: impl FnOnce(OverlayInput<'_>) -> R) -> R {
        let Kept { sensor, markers, alarm_margin, regions, .. } = self;
        let empty = Mask::new(sensor.rectified_px());
        let (contact_region, inner_erosion) = match regions {
            Some((contact_region, inner)) => (contact_region, inner.as_ref()),
            None => (&empty, None),
        };
        draw(OverlayInput { sensor, markers, contact_region, inner_erosion, alarm_margin: *alarm_margin })
    }
}

/// Every marker of the rest frame as arrays of N rows, row n for marker number n. Points and displacements are N x 2
/// float64 in px of the rectified image: x along the finger, y across it; flags are N bool.
#[pyclass(frozen, module = "slipbound")]
pub struct Field(pub Arc<Kept>);

impl Field {
    fn points<'py>(&self, py: Python<'py>, of: impl Fn(&Marker) -> Vec2) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let flat = self.0.markers.iter().map(of).flat_map(|v| [v.x, v.y]);
        PyArray1::from_iter(py, flat).reshape([self.0.markers.len(), 2])
    }

    fn flags<'py>(&self, py: Python<'py>, of: impl Fn(&Marker) -> bool) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_iter(py, self.0.markers.iter().map(of))
    }
}

#[pymethods]
impl Field {
    /// Position of each marker in the rest frame.
    #[getter]
    fn rest_px<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.points(py, |m| m.rest)
    }

    /// Position of each marker in this frame; the expected one when it was not found, and the last one known when nothing
    /// of the frame was measured.
    #[getter]
    fn now_px<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.points(py, |m| m.now)
    }

    /// Displacement since the rest frame.
    #[getter]
    fn now_from_rest_px<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.points(py, Marker::now_from_rest)
    }

    /// Displacement since the reference frame.
    #[getter]
    fn now_from_reference_px<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.points(py, Marker::now_from_reference)
    }

    /// The slip field: measured minus rigid displacement since the reference frame; 0 outside the contact. The object
    /// moves over the gel in the opposite direction.
    #[getter]
    fn slip_px<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.points(py, |m| m.slip)
    }

    /// Whether it was found in this frame.
    #[getter]
    fn matched<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.flags(py, |m| m.matched)
    }

    /// Whether it is completely in view.
    #[getter]
    fn whole<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.flags(py, |m| m.whole)
    }

    /// Whether it is in the contact region.
    #[getter]
    fn in_contact<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.flags(py, |m| m.in_contact)
    }

    /// Whether it was used to fit the rigid motion.
    #[getter]
    fn inner<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.flags(py, |m| m.inner)
    }

    /// Whether its slip exceeds the threshold.
    #[getter]
    fn over<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.flags(py, |m| m.over)
    }

    fn __len__(&self) -> usize {
        self.0.markers.len()
    }

    fn __repr__(&self) -> String {
        format!("<slipbound.Field of {} markers>", self.0.markers.len())
    }
}
