//! The image of the results on a frame.

use crate::errors::{FrameError, guarded};
use crate::picture::{Picture, array, byte_order};
use crate::report::Report;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use slipbound::image::Frame;
use slipbound::monitor::Reason;
use slipbound::port::PixelFormat;
use slipbound_rig::overlay::Overlay;

/// Draws the results on a frame, in the paper's colours: displacement on the left, slip on the right.
///
/// Parameters
/// ----------
/// frame : numpy.ndarray
///     The frame of the report.
/// report : Report
///     The report of :meth:`Monitor.step` or :func:`watch` on it.
/// order : {"BGR", "RGB"}
///     Order of the channels of the frame and of the image.
///
/// Returns
/// -------
/// numpy.ndarray
///     uint8, H x W x 3; its size depends on the sensor alone.
///
/// Raises
/// ------
/// FrameError
///     When the size of the frame differs from that of the report.
#[pyfunction]
#[pyo3(signature = (frame, report, *, order = "BGR"))]
pub fn overlay<'py>(
    py: Python<'py>,
    frame: &Bound<'py, PyAny>,
    report: &Bound<'py, Report>,
    order: &str,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let order = byte_order(order)?;
    let picture = Picture::new(frame, order)?;
    let mut scratch = Vec::new();
    let Report { report, kept, .. } = report.get();
    let frame = Frame { pixels: picture.pixels(&mut scratch)?, seq: report.seq, time_ns: report.time_ns };
    let got = frame.pixels.size();
    // The size of a frame that was refused, or judged before the rest frame was known; else that of the sensor.
    let expected = match report.reason {
        Some(Reason::FrameSize { got, .. }) => got,
        _ => kept.unjudged_px.unwrap_or(kept.sensor.image_px),
    };
    if got != expected {
        return Err(FrameError::new_err(format!(
            "expected the frame that the report is of, {expected} px, got {got} px"
        )));
    }
    let (pixels, size) = py.detach(|| {
        guarded(|| {
            let mut overlay = Overlay::new(&kept.sensor);
            kept.seen(|found| overlay.draw(Some(&frame), report, found));
            Ok((overlay.rgb(), overlay.size()))
        })
    })?;
    array(py, pixels, size, PixelFormat::Rgb, order)
}
