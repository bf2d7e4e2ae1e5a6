//! The monitor of one finger: a frame in, a report out.

use crate::errors::{FrameError, SettingError, exclusive, guarded, rest as rest_error, setting};
use crate::field::Kept;
use crate::picture::{Picture, buffer, byte_order, pictures_of};
use crate::report::Report;
use crate::sensor::{Sensor, Settings, sensor_of, settings_of};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use slipbound::finger_pipeline::{RestFinder, rest_from};
use slipbound::image::{ByteOrder, Frame, SizePx};
use slipbound::monitor::{
    ContactReport, Estimates, MarkerCounts, Rest, RestBuilder, RestError as NoRest, Settings as CoreSettings,
    SlipMonitor, SlipReport, SlipState, SlipSummary,
};
use slipbound::port::GripSample;
use slipbound::sensor::Sensor as CoreSensor;
use slipbound_rig::rest_file::{RestFileError, SavedRest};
use std::hint::black_box;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// The name of a monitor in messages.
const WHAT: &str = "monitor";

/// A grip force in the form that the method takes.
pub fn grip(grip_n: Option<f64>) -> PyResult<Option<GripSample>> {
    match grip_n {
        Some(force_n) if !(force_n.is_finite() && force_n >= 0.0) => {
            Err(SettingError::new_err(format!("grip_n: expected a finite force of 0 N or above, got {force_n}")))
        }
        known => Ok(known.map(|force_n| GripSample { force_n })),
    }
}

/// A time in the form that the method takes.
pub fn time(time_ns: Option<i128>) -> PyResult<Option<u64>> {
    time_ns
        .map(|ns| {
            u64::try_from(ns).map_err(|_| {
                SettingError::new_err(format!("time_ns: expected a whole number from 0 to 2^64 - 1, got {ns}"))
            })
        })
        .transpose()
}

/// Whether the rest frame is known.
enum Phase {
    /// The rest frame is searched among the first frames; None before the first of them.
    Looking(Option<Box<RestFinder>>),
    /// The rest frame is known.
    Judging(Box<SlipMonitor>, Arc<CoreSensor>),
}

struct State {
    phase: Phase,
    frames_count: u64,
    /// Pixels of arrays that are not contiguous.
    scratch: Vec<u8>,
}

/// Judges the frames of one finger, one after the other.
///
/// Parameters
/// ----------
/// sensor : Sensor, str or path
///     The finger: a sensor, the name of a built-in one (`slipbound.sensors()`) or its ``FILE.toml``.
/// rest : "auto", array, sequence of arrays, path or bytes
///     The rest frame. ``"auto"`` finds it among the first frames given to :meth:`step`, which are ``unjudged``
///     until then. A path, or bytes: a file written by ``slipbound tare``.
/// settings : Settings, str, path or None
///     The settings; ``"paper"`` is the paper as written.
/// order : {"BGR", "RGB"}
///     The order of the channels of colour images; OpenCV gives BGR.
/// finger : str
///     The name of the finger in the reports.
#[pyclass(frozen, module = "slipbound")]
pub struct Monitor {
    sensor: Arc<CoreSensor>,
    settings: Arc<CoreSettings>,
    order: ByteOrder,
    finger: String,
    state: Mutex<State>,
}

#[pymethods]
impl Monitor {
    #[new]
    #[pyo3(signature = (sensor, rest = None, settings = None, *, order = "BGR", finger = "finger"))]
    fn new(
        py: Python<'_>,
        sensor: &Bound<'_, PyAny>,
        rest: Option<&Bound<'_, PyAny>>,
        settings: Option<&Bound<'_, PyAny>>,
        order: &str,
        finger: &str,
    ) -> PyResult<Self> {
        let (sensor, settings, order) = (sensor_of(sensor)?, settings_of(settings)?, byte_order(order)?);
        let rest = rest.map(|rest| rest_given(py, rest, order, &sensor, &settings)).transpose()?.flatten();
        let phase = match rest {
            None => {
                settings.check().map_err(setting)?;
                Phase::Looking(None)
            }
            Some(rest) => py.detach(|| guarded(|| judging(&sensor, &settings, rest)))?,
        };
        let state = Mutex::new(State { phase, frames_count: 0, scratch: Vec::new() });
        Ok(Monitor { sensor, settings, order, finger: finger.to_owned(), state })
    }

    /// Judges the next frame.
    ///
    /// Parameters
    /// ----------
    /// frame : numpy.ndarray
    ///     uint8, H x W x 3 or H x W, as the camera delivers it. Read in place where it is contiguous as a whole, also
    ///     with its channels reversed (``[:, :, ::-1]``); a part of a larger one is copied first.
    /// grip_n : float or None
    ///     Normal force per finger in newtons, where it is known.
    /// time_ns : int or None
    ///     Time of exposure in ns on any one clock, where it is known.
    /// order : {"BGR", "RGB"} or None
    ///     Order of the channels of this frame; None takes the monitor's.
    ///
    /// Returns
    /// -------
    /// Report
    ///     A frame that cannot be judged gives a report, too: ``state`` is then ``unjudged`` and ``reason`` says why.
    #[pyo3(signature = (frame, grip_n = None, time_ns = None, order = None))]
    fn step(
        &self,
        py: Python<'_>,
        frame: &Bound<'_, PyAny>,
        grip_n: Option<f64>,
        time_ns: Option<i128>,
        order: Option<&str>,
    ) -> PyResult<Report> {
        let (grip, time_ns) = (grip(grip_n)?, time(time_ns)?);
        let picture = Picture::new(frame, order.map_or(Ok(self.order), byte_order)?)?;
        let mut state = exclusive(&self.state, WHAT)?;
        let state = &mut *state;
        let mut scratch = std::mem::take(&mut state.scratch);
        let pixels = picture.pixels(&mut scratch)?;
        let seq = state.frames_count;
        let frame = Frame { pixels, seq, time_ns };
        let done = py.detach(|| guarded(|| self.judge(&mut state.phase, &frame, grip)));
        state.scratch = scratch;
        let (report, kept, waiting) = done?;
        state.frames_count += 1;
        Ok(Report { report, kept: Arc::new(kept), finger: self.finger.clone(), frame: seq, waiting })
    }

    /// Judges one frame `count` times in Rust alone and returns the ns of each step: the reference of
    /// `bench/python.md`.
    fn _time_steps(&self, py: Python<'_>, frame: &Bound<'_, PyAny>, count: u64) -> PyResult<Vec<u64>> {
        let picture = Picture::new(frame, self.order)?;
        let mut state = exclusive(&self.state, WHAT)?;
        let state = &mut *state;
        let Phase::Judging(monitor, _) = &mut state.phase else { return Err(rest_error(NoRest::Empty)) };
        let mut scratch = Vec::new();
        let pixels = picture.pixels(&mut scratch)?;
        // Numbered without gaps: after a gap a frame is searched for larger motions, which costs time.
        let first = state.frames_count;
        state.frames_count += count;
        py.detach(|| {
            guarded(|| {
                Ok((first..first + count)
                    .map(|seq| {
                        let start = Instant::now();
                        black_box(monitor.step(&Frame { pixels, seq, time_ns: None }, None));
                        start.elapsed().as_nanos() as u64
                    })
                    .collect())
            })
        })
    }

    /// Takes the last known markers as the reference from here on, as after a grip step.
    fn rebase(&self) -> PyResult<()> {
        let mut state = exclusive(&self.state, WHAT)?;
        let seq = state.frames_count.saturating_sub(1);
        if let Phase::Judging(monitor, _) = &mut state.phase {
            monitor.rebase(seq);
        }
        Ok(())
    }

    /// Whether the rest frame is known, so that frames are judged.
    #[getter]
    fn is_ready(&self) -> PyResult<bool> {
        Ok(matches!(exclusive(&self.state, WHAT)?.phase, Phase::Judging(..)))
    }

    /// Why no frame can be judged with this sensor; None when frames can.
    #[getter]
    fn refusal(&self) -> PyResult<Option<String>> {
        Ok(match &exclusive(&self.state, WHAT)?.phase {
            Phase::Judging(monitor, _) => monitor.refusal().map(|reason| reason.to_string()),
            Phase::Looking(_) => None,
        })
    }

    /// The name of the finger in the reports.
    #[getter]
    fn finger(&self) -> &str {
        &self.finger
    }

    /// The facts of the finger, as given.
    #[getter]
    fn sensor(&self) -> Sensor {
        Sensor(self.sensor.clone())
    }

    /// The settings.
    #[getter]
    fn settings(&self) -> Settings {
        Settings(self.settings.clone())
    }

    fn __repr__(&self) -> String {
        format!("<slipbound.Monitor of a {}>", self.sensor.name)
    }
}

type Judged = (SlipReport, Kept, Option<String>);

impl Monitor {
    fn judge(&self, phase: &mut Phase, frame: &Frame<'_>, grip: Option<GripSample>) -> PyResult<Judged> {
        let finder = match phase {
            Phase::Judging(monitor, sensor) => {
                let report = monitor.step(frame, grip);
                let kept = Kept::of(monitor, sensor.clone(), &report);
                return Ok((report, kept, None));
            }
            Phase::Looking(finder) => finder,
        };
        let size = frame.pixels.size();
        let sensor = match self.sensor.at_size(size) {
            Ok(sensor) => Arc::new(sensor),
            // Such a frame does not matter for the others: the search goes on with them.
            Err(error) => {
                let nothing = Kept::nothing(self.sensor.clone(), size);
                return Ok((unjudged(frame, grip), nothing, Some(error.to_string())));
            }
        };
        let new = || RestFinder::new(&self.sensor, &self.settings, size).map(Box::new).map_err(setting);
        // The frames before had another size: the search begins again.
        let same = finder.take().filter(|looking| looking.sensor().image_px == size);
        let mut looking = same.map_or_else(new, Ok)?;
        looking.see(&buffer(frame)).map_err(|e| FrameError::new_err(e.to_string()))?;
        let waiting = if looking.is_full() {
            match looking.find() {
                Ok(found) => {
                    *phase = judging(&self.sensor, &self.settings, found.rest)?;
                    "this frame completes the search for the rest frame; the next one is judged".to_owned()
                }
                // The search goes on with the next frames.
                Err(error @ NoRest::NoStationaryFrame { .. }) => error.to_string(),
                Err(error) => return Err(rest_error(error)),
            }
        } else {
            *finder = Some(looking);
            let window_count = self.settings.rest.window_count;
            format!("no rest frame yet: it is looked for among the first {window_count} frames")
        };
        Ok((unjudged(frame, grip), Kept::nothing(sensor, size), Some(waiting)))
    }
}

/// A frame before the rest frame is known.
fn unjudged(frame: &Frame<'_>, grip: Option<GripSample>) -> SlipReport {
    SlipReport {
        seq: frame.seq,
        time_ns: frame.time_ns,
        state: SlipState::Unjudged,
        reason: None,
        contact: ContactReport::default(),
        markers: MarkerCounts::default(),
        reference_seq: 0,
        grip_n: grip.map(|g| g.force_n),
        motion: None,
        shear: None,
        slip: SlipSummary::default(),
        estimates: Estimates::default(),
        evidence: None,
    }
}

fn is_auto(rest: &Bound<'_, PyAny>) -> bool {
    rest.extract::<&str>().is_ok_and(|word| word == "auto")
}

fn judging(sensor: &CoreSensor, settings: &CoreSettings, rest: Rest) -> PyResult<Phase> {
    let monitor = SlipMonitor::new(sensor, settings, rest).map_err(setting)?;
    let sensor = Arc::new(monitor.sensor().clone());
    Ok(Phase::Judging(Box::new(monitor), sensor))
}

/// The rest frame from the argument of the caller; None for `auto`.
pub fn rest_given(
    py: Python<'_>,
    rest: &Bound<'_, PyAny>,
    order: ByteOrder,
    sensor: &CoreSensor,
    settings: &CoreSettings,
) -> PyResult<Option<Rest>> {
    if rest.is_none() || is_auto(rest) {
        return Ok(None);
    }
    if let Some(saved) = saved(rest)? {
        let saved = saved.map_err(refused)?;
        saved.check(sensor, settings, "rest").map_err(refused)?;
        return Ok(Some(saved.rest));
    }
    let pictures = pictures_of(rest, order)?;
    let mut scratch = vec![Vec::new(); pictures.len()];
    let mut frames = Vec::with_capacity(pictures.len());
    for (i, (picture, scratch)) in pictures.iter().zip(&mut scratch).enumerate() {
        frames.push(Frame { pixels: picture.pixels(scratch)?, seq: i as u64, time_ns: None });
    }
    let Some(size) = frames.first().map(|frame| frame.pixels.size()) else { return Err(rest_error(NoRest::Empty)) };
    py.detach(|| guarded(|| rest_of(sensor, settings, size, &frames))).map(Some)
}

/// A rest file of `slipbound tare`, as bytes or as a path; None for anything that is neither.
fn saved(rest: &Bound<'_, PyAny>) -> PyResult<Option<Result<SavedRest, RestFileError>>> {
    if let Ok(bytes) = rest.cast::<PyBytes>() {
        return Ok(Some(SavedRest::from_bytes(bytes.as_bytes(), "rest")));
    }
    let Ok(path) = rest.extract::<PathBuf>() else { return Ok(None) };
    if !path.is_file() {
        let expected = "expected \"auto\", pictures, or the file or the bytes of `slipbound tare`";
        return Err(SettingError::new_err(format!("rest: {expected}, got {path:?}, which is no file")));
    }
    Ok(Some(SavedRest::read(&path)))
}

fn refused(error: RestFileError) -> PyErr {
    SettingError::new_err(error.to_string())
}

fn rest_of(sensor: &CoreSensor, settings: &CoreSettings, size: SizePx, frames: &[Frame<'_>]) -> PyResult<Rest> {
    let builder = RestBuilder::new(sensor, settings, size).map_err(setting)?;
    rest_from(builder, frames).map_err(|(place, error)| match place {
        Some(i) => crate::errors::RestError::new_err(format!("frame {i}: {error}")),
        None => rest_error(error),
    })
}
