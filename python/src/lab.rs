//! The simulator: frames and their exact ground truth as arrays.

use crate::errors::{FrameError, data, exclusive, guarded, setting, source as source_error, word};
use crate::picture::{array, byte_order};
use crate::sensor::Sensor;
use numpy::{PyArray1, PyArray2, PyArrayDyn, PyArrayMethods as _};
use pyo3::prelude::*;
use slipbound::port::{FrameBuffer, FrameSource as _, Next};
use slipbound::sensor::Sensor as CoreSensor;
use slipbound_lab::contact::Grid;
use slipbound_lab::faults::Faulty;
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::{FrameTruth, Gross, World, complete, unpacked};
use std::sync::{Arc, Mutex};

/// A running trial: an iterator of frames with their ground truth. Made by `slipbound.lab.simulate`.
#[pyclass(frozen, module = "slipbound.lab")]
pub struct Simulation {
    trial: Trial,
    sensor: Arc<CoreSensor>,
    grid: Grid,
    rest_mm: Vec<[f64; 2]>,
    /// The source, and the number of events of the frames that have come.
    world: Mutex<(Faulty<World>, usize)>,
}

/// See the package's `lab.simulate`.
#[pyfunction]
#[pyo3(signature = (scene, seed, parameters))]
pub fn simulate(
    py: Python<'_>,
    scene: &str,
    seed: Option<u64>,
    parameters: Vec<(String, String)>,
) -> PyResult<Simulation> {
    let made = || {
        let mut trial = Trial::parse(scene).map_err(setting)?;
        if let Some(seed) = seed {
            trial = trial.with("seed", &seed.to_string()).map_err(setting)?;
        }
        for (key, value) in &parameters {
            trial = trial.with(key, value).map_err(setting)?;
        }
        let world = World::new(&trial).map_err(setting)?;
        let rest_mm = world.markers_at_rest_mm().iter().map(|p| [p.x, p.y]).collect();
        let (sensor, grid) = (Arc::new(world.sensor()), world.grid());
        let world = Mutex::new((Faulty::new(world, trial.faults().unwrap_or_default(), trial.seed), 0));
        Ok(Simulation { trial, sensor, grid, rest_mm, world })
    };
    // Making a world takes a few tenths of a second.
    py.detach(|| guarded(made))
}

#[pymethods]
impl Simulation {
    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<SimulatedFrame>> {
        py.check_signals()?;
        let mut world = exclusive(&self.world, "simulation")?;
        let (world, events_count) = &mut *world;
        let next = py.detach(|| {
            guarded(|| {
                let mut frame = FrameBuffer::default();
                let torn = loop {
                    match world.next(&mut frame).map_err(|e| Python::attach(|py| source_error(py, e)))? {
                        Next::Frame => break None,
                        Next::Torn { reason } => break Some(reason),
                        // A late frame: it comes next.
                        Next::Silent => {}
                        Next::End => return Ok(None),
                    }
                };
                let world = world.source();
                // Those of dropped frames too.
                let events = world.events()[*events_count..].to_vec();
                *events_count = world.events().len();
                Ok(Some((frame, torn, FrameTruth { events, ..world.truth().clone() })))
            })
        })?;
        Ok(next.map(|(frame, torn, truth)| SimulatedFrame { frame, torn, truth: Truth { truth, grid: self.grid } }))
    }

    /// The trial with all its parameters, as `simulate` accepts it.
    #[getter]
    fn trial(&self) -> String {
        self.trial.to_string()
    }

    /// The facts of the finger, with the stiffness of its gel.
    #[getter]
    fn sensor(&self) -> Sensor {
        Sensor(self.sensor.clone())
    }

    /// Positions of the markers on the gel at rest, N x 2, mm.
    #[getter]
    fn markers_at_rest_mm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let flat = self.rest_mm.iter().flatten().copied();
        PyArray1::from_iter(py, flat).reshape([self.rest_mm.len(), 2])
    }

    /// When the object began to slide as a whole and under which load, as a dict; None while it has not.
    #[getter]
    fn gross<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        exclusive(&self.world, "simulation")?.0.source().gross().map(|gross: Gross| data(py, &gross)).transpose()
    }

    /// The truths with load fraction and margin filled in, which are known when the trial is over, and the event of gross
    /// slip in the first frame that shows it: on a bend it is found two frames later.
    ///
    /// Parameters
    /// ----------
    /// truths : sequence of Truth
    ///     Those of the frames, in their order.
    fn complete(&self, truths: Vec<PyRef<'_, Truth>>) -> PyResult<Vec<Truth>> {
        let gross = exclusive(&self.world, "simulation")?.0.source().gross();
        let mut all: Vec<FrameTruth> = truths.iter().map(|truth| truth.truth.clone()).collect();
        complete(&mut all, gross);
        Ok(all.into_iter().map(|truth| Truth { truth, grid: self.grid }).collect())
    }

    fn __repr__(&self) -> String {
        format!("<slipbound.lab.Simulation {}>", self.trial)
    }
}

/// One frame of a simulation.
#[pyclass(frozen, module = "slipbound.lab")]
pub struct SimulatedFrame {
    frame: FrameBuffer,
    torn: Option<String>,
    truth: Truth,
}

#[pymethods]
impl SimulatedFrame {
    /// The image as an array, uint8, H x W x 3.
    ///
    /// Parameters
    /// ----------
    /// order : {"BGR", "RGB"}
    ///     Order of its channels.
    ///
    /// Raises
    /// ------
    /// slipbound.FrameError
    ///     When the frame is torn.
    #[pyo3(signature = (*, order = "BGR"))]
    fn image<'py>(&self, py: Python<'py>, order: &str) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        let FrameBuffer { pixels, size, format, seq, .. } = &self.frame;
        if let Some(why) = &self.torn {
            return Err(FrameError::new_err(format!("expected a whole frame, got frame {seq} that is torn: {why}")));
        }
        array(py, pixels.clone(), *size, *format, byte_order(order)?)
    }

    /// Why the frame did not arrive completely, with ``fault="torn=0.1"``; None where it is whole.
    #[getter]
    fn torn(&self) -> Option<&str> {
        self.torn.as_deref()
    }

    /// The image as sent by the simulated camera: the bytes of a JPEG file, cut off where the frame is torn.
    #[getter]
    fn jpeg(&self) -> &[u8] {
        &self.frame.encoded
    }

    /// Number of the frame.
    #[getter]
    fn seq(&self) -> u64 {
        self.frame.seq
    }

    /// Time of its exposure in ns.
    #[getter]
    fn time_ns(&self) -> Option<u64> {
        self.frame.time_ns
    }

    /// The ground truth of the frame.
    #[getter]
    fn truth(&self) -> Truth {
        self.truth.clone()
    }

    fn __repr__(&self) -> String {
        format!("<slipbound.lab.SimulatedFrame {}>", self.frame.seq)
    }
}

/// The exact ground truth of a simulated frame.
#[pyclass(frozen, module = "slipbound.lab")]
#[derive(Clone)]
pub struct Truth {
    truth: FrameTruth,
    grid: Grid,
}

impl Truth {
    fn mask<'py>(&self, py: Python<'py>, runs: &[u32]) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let Grid { width_cells, height_cells, .. } = self.grid;
        let mask = unpacked(runs, self.grid.cells_count()).unwrap_or_default();
        PyArray1::from_vec(py, mask).reshape([height_cells, width_cells])
    }

    fn markers<'py>(&self, py: Python<'py>, from: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let markers = &self.truth.markers;
        let flat = markers.iter().flat_map(|m| [m[from], m[from + 1]]);
        PyArray1::from_iter(py, flat).reshape([markers.len(), 2])
    }
}

#[pymethods]
impl Truth {
    /// Area that sticks over area in contact; None without contact.
    #[getter]
    fn stick_ratio(&self) -> Option<f64> {
        self.truth.stick_ratio
    }

    /// Share of the available friction that is used; None without contact, load or motion.
    #[getter]
    fn friction_used_fraction(&self) -> Option<f64> {
        self.truth.friction_used_fraction
    }

    /// Normal force of the finger in N.
    #[getter]
    fn grip_force_n(&self) -> f64 {
        self.truth.grip_force_n
    }

    /// 1 - load over the load of gross slip; None until `Simulation.complete` fills it in.
    #[getter]
    fn margin(&self) -> Option<f64> {
        self.truth.margin
    }

    /// Names of the events since the frame before, dropped ones included: `first_contact`, `stick_below80` and
    /// `stick_below50` (the stick ratio falls below 0.8, 0.5), `gross`, `parted`.
    #[getter]
    fn events(&self) -> PyResult<Vec<String>> {
        self.truth.events.iter().map(|timed| word(&timed.event)).collect()
    }

    /// Gel cells under pressure: bool, rows along y x columns along x.
    #[getter]
    fn contact<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        self.mask(py, &self.truth.contact_runs)
    }

    /// Gel cells under pressure that stick, likewise.
    #[getter]
    fn stick<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        self.mask(py, &self.truth.stick_runs)
    }

    /// Displacement of every marker in the plane of the gel, N x 2, mm.
    #[getter]
    fn marker_shift_mm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.markers(py, 0)
    }

    /// Position of every marker in the image as the camera delivers it, N x 2, px.
    #[getter]
    fn marker_px<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.markers(py, 3)
    }

    /// All of it, as a line of truth.jsonl.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        data(py, &self.truth)
    }

    fn __repr__(&self) -> String {
        format!("<slipbound.lab.Truth of frame {}>", self.truth.frame)
    }
}
