//! Recordings and simulated scenes as reports, one after the other: `slipbound watch` as an iterator.

use crate::errors::{
    ClosedError, SettingError, config, exclusive, guarded, internal, rest as rest_error, setting,
    source as source_error, word,
};
use crate::field::Kept;
use crate::picture::{array, byte_order};
use crate::ports::FirstException;
use crate::report::Report;
use crate::sensor::{Sensor, Settings, sensor_of, settings_of};
use numpy::PyArrayDyn;
use pyo3::exceptions::PyRuntimeWarning;
use pyo3::prelude::*;
use slipbound::finger_pipeline::{RecordingMonitor, RestFinder};
use slipbound::image::SizePx;
use slipbound::monitor::{RestKind, Settings as CoreSettings, SlipMonitor};
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError as SourceFailure, SourceErrorKind};
use slipbound::sensor::Sensor as CoreSensor;
use slipbound_lab::faults::Faulty;
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use slipbound_rig::link::now_ns;
use slipbound_rig::report_summary::torn;
use slipbound_rig::sensors::{self, RecordingError};
use slipbound_rig::source::{self, Arrivals, Awaited, Newest, ReadAhead, most_common_size};
use std::ffi::CString;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, TryLockError};
use std::thread;
use std::time::{Duration, Instant};

/// Its name in messages.
const WHAT: &str = "watch";

/// Longest wait until a camera is closed: its thread looks up every tenth of a second, unless it is connecting again.
const LONGEST_CLOSE: Duration = Duration::from_millis(300);

/// Longest wait for another thread that takes a report: of a silent camera it looks up every tenth of a second.
const LONGEST_USE: Duration = Duration::from_secs(1);

/// A recording, and where it was opened.
struct Open {
    recording: ReadAhead,
    monitor: Box<RecordingMonitor>,
    /// The frame of the newest report.
    frame: FrameBuffer,
    /// Whether it is whole.
    whole: bool,
    /// What is being read.
    read: FrameBuffer,
    frames_count: u64,
    process_id: u32,
    /// Of a camera, which is read on a thread of its own.
    arrivals: Option<Arrivals>,
    /// The exception that Ctrl-C raised while the source gave no whole frame.
    raised: FirstException,
}

impl Open {
    /// What was read is the frame of the newest report.
    fn take(&mut self, whole: bool) {
        std::mem::swap(&mut self.frame, &mut self.read);
        self.whole = whole;
    }
}

/// A source whose first frames are read: a camera may be silent, or torn, for any time, and Ctrl-C ends that.
struct Interruptible {
    source: Box<dyn FrameSource + Send>,
    raised: FirstException,
}

impl FrameSource for Interruptible {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceFailure> {
        let next = self.source.next(into)?;
        if matches!(next, Next::Silent | Next::Torn { .. })
            && let Err(error) = Python::attach(|py| py.check_signals())
        {
            return Err(SourceFailure::new(SourceErrorKind::Other, self.raised.keep(error)));
        }
        Ok(next)
    }

    fn frames_count(&self) -> Option<u64> {
        self.source.frames_count()
    }
}

/// The reports of a recording, in order: an iterator. Made by `slipbound.watch`.
#[pyclass(frozen, module = "slipbound")]
pub struct Watch {
    source: String,
    finger: String,
    sensor: Arc<CoreSensor>,
    settings: Arc<CoreSettings>,
    clock: Clock,
    rest_kind: RestKind,
    /// None when it was closed.
    open: Mutex<Option<Open>>,
    /// Whether it is to be closed: set without a lock, which a thread that waits for a silent camera keeps.
    closes: AtomicBool,
}

/// See the package's `watch`.
#[pyfunction]
#[pyo3(signature = (source, sensor, settings, finger))]
pub fn watch(
    py: Python<'_>,
    source: PathBuf,
    sensor: Option<&Bound<'_, PyAny>>,
    settings: Option<&Bound<'_, PyAny>>,
    finger: String,
) -> PyResult<Watch> {
    let sensor = sensor.map(sensor_of).transpose()?;
    let settings = settings_of(settings)?;
    let source = source.to_string_lossy().into_owned();
    let opened = py.detach(|| guarded(|| Watch::open(source, sensor, settings, finger)));
    interrupted_or(py, opened)
}

/// The exception of Ctrl-C, if it has interrupted the read.
fn interrupted_or<R>(py: Python<'_>, result: PyResult<R>) -> PyResult<R> {
    result.or_else(|error| py.check_signals().and(Err(error)))
}

/// A source that is open.
struct Opened {
    source: Box<dyn FrameSource + Send>,
    /// The finger of a simulated one.
    simulated: Option<CoreSensor>,
    /// Of a camera, whose frames are read on a thread of its own, which keeps the newest.
    arrivals: Option<Arrivals>,
}

/// Opens a recording or a camera, or starts a simulation.
fn open_source(uri: &str) -> PyResult<Opened> {
    let Some(scene) = uri.strip_prefix("sim:") else {
        if source::is_live(uri) {
            let newest = Newest::new(source::open_camera(uri).map_err(|e| failed(e.into()))?.source);
            let arrivals = Some(newest.arrivals());
            return Ok(Opened { source: Box::new(Awaited(newest)), simulated: None, arrivals });
        }
        let source = source::open(uri).map_err(|e| failed(e.into()))?;
        return Ok(Opened { source, simulated: None, arrivals: None });
    };
    let trial = Trial::parse(scene).map_err(setting)?;
    let world = World::new(&trial).map_err(setting)?;
    let simulated = Some(world.sensor());
    let source: Box<dyn FrameSource + Send> = match trial.faults() {
        Some(faults) => Box::new(Faulty::new(world, faults, trial.seed)),
        None => Box::new(world),
    };
    Ok(Opened { source, simulated, arrivals: None })
}

/// The finger of a recording that brings its sensor file along, else the only built-in one with frames of this size.
fn sensor_of_recording(uri: &str, size: SizePx) -> PyResult<CoreSensor> {
    match sensors::of_recording(uri) {
        Ok(Some((sensor, _))) => Ok(sensor),
        Ok(None) => sensor_of_frames(uri, size),
        Err(RecordingError::Sensor(error)) => Err(config(error)),
        Err(RecordingError::Source(error)) => Err(failed(error.into())),
    }
}

/// The only built-in finger with frames of this size.
fn sensor_of_frames(uri: &str, size: SizePx) -> PyResult<CoreSensor> {
    let mut fitting = sensors::of_frames(size).map_err(config)?;
    match (fitting.pop(), fitting.is_empty()) {
        (Some(only), true) => Ok(only),
        (None, _) => Err(SettingError::new_err(format!(
            "{uri}: no built-in finger has frames of {size}: expected sensor=, got none"
        ))),
        (Some(last), false) => {
            let names: Vec<&str> = fitting.iter().chain([&last]).map(|s| s.name.as_str()).collect();
            let names = names.join(", ");
            Err(SettingError::new_err(format!(
                "{uri}: more than one built-in finger has frames of {size}: expected sensor= with one of {names}, got none"
            )))
        }
    }
}

/// A `RuntimeWarning` at the place where the next report is taken.
fn warn(py: Python<'_>, text: &str) -> PyResult<()> {
    let text = CString::new(text.replace('\0', "\\0")).map_err(internal)?;
    PyErr::warn(py, py.get_type::<PyRuntimeWarning>().as_any(), &text, 1)
}

/// Closes a source. A camera is waited for, so that it can be opened again: many serve one program at a time.
fn close(open: Open) {
    // A fork has no thread that could close it.
    let arrivals = open.arrivals.clone().filter(|_| open.process_id == std::process::id());
    drop(open);
    let from = Instant::now();
    while arrivals.as_ref().is_some_and(|arrivals| !arrivals.is_closed()) && from.elapsed() < LONGEST_CLOSE {
        thread::sleep(Duration::from_millis(1));
    }
}

fn failed(error: SourceFailure) -> PyErr {
    Python::attach(|py| source_error(py, error))
}

impl Watch {
    fn open(
        uri: String,
        sensor: Option<Arc<CoreSensor>>,
        settings: Arc<CoreSettings>,
        finger: String,
    ) -> PyResult<Self> {
        let Opened { source, simulated, arrivals } = open_source(&uri)?;
        let raised = FirstException::default();
        let source = Box::new(Interruptible { source, raised: raised.clone() });
        let mut recording = match arrivals.is_some() {
            true => ReadAhead::live(source, &uri, now_ns),
            false => ReadAhead::new(source),
        };
        let window_count = settings.rest.window_count as usize;
        let ahead = recording.read_ahead(window_count);
        let (mut seen, mut first_torn) = (Vec::new(), String::new());
        for ahead in ahead {
            match &ahead.torn {
                None => seen.push(ahead.buffer.clone()),
                Some(reason) if first_torn.is_empty() => first_torn = format!("; {}", torn(&ahead.buffer, reason)),
                Some(_) => {}
            }
        }
        if let Some(error) = raised.take() {
            return Err(error);
        }
        let Some(size) = most_common_size(&seen) else {
            let none = format!("{uri}: expected at least one whole frame, got none{first_torn}");
            let none = || crate::errors::SourceError::new_err(none);
            return Err(recording.take_failure().map_or_else(none, failed));
        };
        let sensor = match (sensor, simulated) {
            (Some(sensor), _) => sensor,
            (None, Some(sensor)) => Arc::new(sensor),
            (None, None) => Arc::new(sensor_of_recording(&uri, size)?),
        };
        let mut finder = RestFinder::new(&sensor, &settings, size).map_err(setting)?;
        for frame in &seen {
            finder.see(frame).map_err(internal)?;
        }
        let rest = finder.find().map_err(rest_error)?.rest;
        let rest_kind = rest.kind();
        let monitor = SlipMonitor::new(&sensor, &settings, rest).map_err(setting)?;
        let clock = recording.clock();
        let sensor = Arc::new(monitor.sensor().clone());
        let monitor = Box::new(RecordingMonitor::with_rest_of_first_frames(monitor).map_err(setting)?);
        let process_id = std::process::id();
        let (frame, read) = (FrameBuffer::default(), FrameBuffer::default());
        let open =
            Open { recording, monitor, frame, whole: false, read, frames_count: 0, process_id, arrivals, raised };
        let (open, closes) = (Mutex::new(Some(open)), AtomicBool::new(false));
        Ok(Watch { source: uri, finger, sensor, settings, clock, rest_kind, open, closes })
    }

    fn closed(&self) -> PyErr {
        ClosedError::new_err(format!("{}: it was closed", self.source))
    }

    /// The next report; None at the end. Of a torn frame also what is wrong with it, as the command line says it.
    fn next(&self, open: &mut Open) -> PyResult<Option<(Report, Option<String>)>> {
        if open.process_id != std::process::id() {
            let source = &self.source;
            return Err(ClosedError::new_err(format!("{source}: opened before a fork; open it again in this process")));
        }
        let mut torn_why = None;
        let report = loop {
            if self.closes.load(Ordering::Relaxed) {
                return Err(self.closed());
            }
            let next = open.recording.next(&mut open.read);
            match next.map_err(|error| open.raised.take().unwrap_or_else(|| failed(error)))? {
                Next::End => return Ok(None),
                Next::Silent => {}
                Next::Torn { reason } => {
                    open.take(false);
                    torn_why = Some(format!("{}: {}", self.source, torn(&open.frame, &reason)));
                    break open.monitor.torn(open.frame.seq, open.frame.time_ns);
                }
                Next::Frame => {
                    open.take(true);
                    let judged = open.monitor.step(&open.frame, &mut (), &mut |_, _| {});
                    break judged.map_err(|e| failed(e.into()))?;
                }
            }
        };
        let kept = Arc::new(Kept::of(open.monitor.monitor(), self.sensor.clone(), &report));
        let frame = open.frames_count;
        open.frames_count += 1;
        let report = Report { report, kept, finger: self.finger.clone(), frame, waiting: None };
        Ok(Some((report, torn_why)))
    }
}

#[pymethods]
impl Watch {
    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Report>> {
        py.check_signals()?;
        let mut open = exclusive(&self.open, WHAT)?;
        let open = open.as_mut().ok_or_else(|| self.closed())?;
        let next = py.detach(|| guarded(|| self.next(open)));
        let Some((report, torn_why)) = interrupted_or(py, next)? else { return Ok(None) };
        torn_why.map_or(Ok(()), |why| warn(py, &why))?;
        Ok(Some(report))
    }

    /// The frame of the newest report as an array; None before the first, and where it did not arrive completely.
    ///
    /// Parameters
    /// ----------
    /// order : {"BGR", "RGB"}
    ///     Order of its channels.
    #[pyo3(signature = (*, order = "BGR"))]
    fn image<'py>(&self, py: Python<'py>, order: &str) -> PyResult<Option<Bound<'py, PyArrayDyn<u8>>>> {
        let order = byte_order(order)?;
        let open = exclusive(&self.open, WHAT)?;
        let open = open.as_ref().ok_or_else(|| self.closed())?;
        let FrameBuffer { pixels, size, format, .. } = &open.frame;
        open.whole.then(|| array(py, pixels.clone(), *size, *format, order)).transpose()
    }

    /// Closes the source. Reports already given stay valid; a thread that waits for the next one gets a `ClosedError`.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.closes.store(true, Ordering::Relaxed);
        py.detach(|| {
            let from = Instant::now();
            while matches!(self.open.try_lock(), Err(TryLockError::WouldBlock)) && from.elapsed() < LONGEST_USE {
                thread::sleep(Duration::from_millis(1));
            }
        });
        let Some(open) = exclusive(&self.open, WHAT)?.take() else { return Ok(()) };
        py.detach(|| close(open));
        Ok(())
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyAny>) -> PyResult<bool> {
        self.close(py)?;
        Ok(false)
    }

    /// The source, as named.
    #[getter]
    fn source(&self) -> &str {
        &self.source
    }

    /// The facts of the finger at the size of its frames.
    #[getter]
    fn sensor(&self) -> Sensor {
        Sensor(self.sensor.clone())
    }

    /// The settings.
    #[getter]
    fn settings(&self) -> Settings {
        Settings(self.settings.clone())
    }

    /// Whose clock `time_ns` is from: `device`, `host`, `container`, `assumed` or `unknown`.
    #[getter]
    fn clock(&self) -> PyResult<String> {
        word(&self.clock)
    }

    /// The state of the finger in the rest frame chosen among the first frames: `unloaded` or `in_contact`. Each of
    /// these frames is judged by the one chosen among it and those before it.
    #[getter]
    fn rest_kind(&self) -> PyResult<String> {
        word(&self.rest_kind)
    }

    /// All remaining reports as a table of flat columns, see `Report.to_row`.
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("slipbound._rows")?.call_method1("to_pandas", (slf,))
    }

    fn __repr__(&self) -> String {
        format!("<slipbound.Watch of {}>", self.source)
    }
}
