//! Every marker after a frame as arrays, and what is kept of a frame so that it can be drawn later.

use numpy::{PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::prelude::*;
use slipbound::image::{Mask, SizePx};
use slipbound::monitor::{Marker, SlipMonitor};
use slipbound::pixels::morphology::Element;
use slipbound::plane::Vec2;
use slipbound::sensor::Sensor;
use slipbound_rig::overlay::Seen;
use std::sync::Arc;

/// What a report keeps of the monitor that made it.
pub struct Kept {
    pub sensor: Arc<Sensor>,
    pub markers: Vec<Marker>,
    /// Size of the frame, where no monitor has said whether it fits.
    pub unjudged_px: Option<SizePx>,
    /// Contact region and what erodes it to the inner one; None without contact.
    regions: Option<(Mask, Option<Element>)>,
}

impl Kept {
    /// Nothing is known yet, of a frame of this size.
    pub fn nothing(sensor: Arc<Sensor>, frame_px: SizePx) -> Self {
        Kept { sensor, markers: Vec::new(), unjudged_px: Some(frame_px), regions: None }
    }

    /// As the monitor has it after a frame; `touched`: whether there is a contact.
    pub fn of(monitor: &SlipMonitor, sensor: Arc<Sensor>, touched: bool) -> Self {
        let regions = touched.then(|| (monitor.contact_region().clone(), monitor.inner_erosion().cloned()));
        Kept { sensor, markers: monitor.markers().to_vec(), unjudged_px: None, regions }
    }

    /// Shows it for an overlay.
    pub fn seen<R>(&self, draw: impl FnOnce(Seen<'_>) -> R) -> R {
        let Kept { sensor, markers, regions, .. } = self;
        match regions {
            Some((contact_region, inner)) => {
                draw(Seen { sensor, markers, contact_region, inner_erosion: inner.as_ref() })
            }
            None => {
                let empty = Mask::new(sensor.rectified_px());
                draw(Seen { sensor, markers, contact_region: &empty, inner_erosion: None })
            }
        }
    }
}

/// Every marker of the rest frame as arrays of N rows, row n for marker number n. Points and displacements are N x 2
/// float64 in px of the rectified picture: x along the finger, y across it; what is true or false is N bool.
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
    /// Where each marker was in the rest frame.
    #[getter]
    fn rest_px<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.points(py, |m| m.rest)
    }

    /// Where each marker is now; where it is expected when it was not found.
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
    /// moves over the gel against it.
    #[getter]
    fn slip_px<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.points(py, |m| m.slip)
    }

    /// Whether it was found in this frame.
    #[getter]
    fn matched<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.flags(py, |m| m.matched)
    }

    /// Whether it lies whole in view.
    #[getter]
    fn whole<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.flags(py, |m| m.whole)
    }

    /// Whether it lies in the contact region.
    #[getter]
    fn in_contact<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.flags(py, |m| m.in_contact)
    }

    /// Whether the rigid motion was fitted to it.
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
