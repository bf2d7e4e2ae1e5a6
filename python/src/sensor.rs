//! Sensors and settings as objects, and their files.

use crate::errors::{SettingError, calibration, config as config_error, data, guarded, internal, word};
use crate::picture::{byte_order, pictures_of};
use pyo3::prelude::*;
use slipbound::calibrate::{FRAMES_MOST, KnownFacts, calibrate as calibrate_frames};
use slipbound::image::{Frame, SizePx};
use slipbound::monitor::Settings as CoreSettings;
use slipbound::sensor::{Flip, Polarity, Sensor as CoreSensor, Skin};
use slipbound_rig::calibration::raise_edges;
use slipbound_rig::{config, sensors};
use std::path::PathBuf;
use std::sync::Arc;

/// The name of a text given to Python in messages.
const TEXT: &str = "the text";

/// The facts of a finger: how its camera sees the gel and what the markers on it look like. Read-only.
///
/// Parameters
/// ----------
/// name_or_file : str or path
///     The name of a built-in finger (`slipbound.sensors()`) or its ``FILE.toml``.
#[pyclass(frozen, eq, module = "slipbound")]
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor(pub Arc<CoreSensor>);

fn size((SizePx { width, height },): (SizePx,)) -> (usize, usize) {
    (width, height)
}

#[pymethods]
impl Sensor {
    /// A built-in finger by its name, or a finger from its `FILE.toml`.
    #[new]
    fn new(name_or_file: PathBuf) -> PyResult<Self> {
        guarded(|| {
            let sensor = sensors::load(&name_or_file.to_string_lossy()).map_err(config_error)?;
            Ok(Sensor(Arc::new(sensor)))
        })
    }

    /// A finger from the text of a sensor file.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     TOML; ``extends = "gelslim"`` takes what it does not say from that finger.
    #[staticmethod]
    fn from_toml(text: &str) -> PyResult<Self> {
        guarded(|| Ok(Sensor(Arc::new(sensors::parse(text, TEXT).map_err(config_error)?))))
    }

    /// The text of a sensor file with all facts in it.
    fn to_toml(&self) -> PyResult<String> {
        sensors::to_toml(&self.0).map_err(internal)
    }

    /// Pickle stores the text, so that other processes can have it.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((py.get_type::<Sensor>().getattr("from_toml")?, (self.to_toml()?,)))
    }

    /// All facts, with the names of the sensor file as keys.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        data(py, &*self.0)
    }

    /// The name of the kind of finger.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// Width and height of the camera image to which the px values apply.
    #[getter]
    fn image_px(&self) -> (usize, usize) {
        size((self.0.image_px,))
    }

    /// Width and height of the rectified image.
    #[getter]
    fn rectified_px(&self) -> (usize, usize) {
        size((self.0.rectified_px(),))
    }

    /// Distance between neighbouring markers in the rectified image.
    #[getter]
    fn pitch_px(&self) -> f64 {
        self.0.pitch_px
    }

    /// The same distance on the gel in mm; None where it was not measured.
    #[getter]
    fn pitch_mm(&self) -> Option<f64> {
        self.0.pitch_mm
    }

    /// `fabric` or `smooth`.
    #[getter]
    fn skin(&self) -> PyResult<String> {
        word(&self.0.skin)
    }

    fn __repr__(&self) -> String {
        let s = &self.0;
        format!("<slipbound.Sensor {}: {} px, pitch {} px>", s.name, s.image_px, s.pitch_px)
    }
}

/// A sensor from an argument.
pub fn sensor_of(argument: &Bound<'_, PyAny>) -> PyResult<Arc<CoreSensor>> {
    match argument.cast::<Sensor>() {
        Ok(sensor) => Ok(sensor.get().0.clone()),
        Err(_) => Ok(Sensor::new(argument.extract()?)?.0),
    }
}

/// The settings of the method. Read-only; other settings are made from TOML whose keys replace the defaults.
///
/// Parameters
/// ----------
/// name_or_file : str, path or None
///     None is the defaults, ``"paper"`` the paper as written; else a ``FILE.toml``.
#[pyclass(frozen, eq, module = "slipbound")]
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Settings(pub Arc<CoreSettings>);

#[pymethods]
impl Settings {
    /// The defaults; `paper`, the paper as written; or the settings of a `FILE.toml`.
    #[new]
    #[pyo3(signature = (name_or_file = None))]
    fn new(name_or_file: Option<PathBuf>) -> PyResult<Self> {
        guarded(|| match name_or_file {
            None => Ok(Settings::default()),
            Some(name) => {
                let settings = config::load_settings(&name.to_string_lossy()).map_err(config_error)?;
                Ok(Settings(Arc::new(settings)))
            }
        })
    }

    /// The paper as written.
    #[staticmethod]
    fn paper() -> Self {
        Settings(Arc::new(CoreSettings::paper()))
    }

    /// Settings from the text of a settings file; its keys replace the defaults.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     TOML, as ``slipbound settings`` prints it.
    #[staticmethod]
    fn from_toml(text: &str) -> PyResult<Self> {
        guarded(|| Ok(Settings(Arc::new(config::parse_settings(text, TEXT).map_err(config_error)?))))
    }

    /// The text of a settings file with every setting in it.
    fn to_toml(&self) -> PyResult<String> {
        config::settings_to_toml(&self.0).map_err(internal)
    }

    /// Pickle stores the text, so that other processes can have it.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((py.get_type::<Settings>().getattr("from_toml")?, (self.to_toml()?,)))
    }

    /// All settings, with the names of the settings file as keys.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        data(py, &*self.0)
    }

    fn __repr__(&self) -> String {
        let kind = match *self.0 == CoreSettings::default() {
            true => " default",
            false if *self.0 == CoreSettings::paper() => " paper",
            false => "",
        };
        format!("<slipbound.Settings{kind}>")
    }
}

/// Settings from an argument: None, settings, `paper`, a file.
pub fn settings_of(argument: Option<&Bound<'_, PyAny>>) -> PyResult<Arc<CoreSettings>> {
    match argument {
        None => Ok(Settings::default().0),
        Some(argument) => match argument.cast::<Settings>() {
            Ok(settings) => Ok(settings.get().0.clone()),
            Err(_) => Ok(Settings::new(Some(argument.extract()?))?.0),
        },
    }
}

/// The names of the built-in fingers.
#[pyfunction]
pub fn sensors_built_in() -> Vec<&'static str> {
    sensors::names().collect()
}

/// The fact of a word in a sensor file.
fn fact<T: serde::de::DeserializeOwned>(key: &str, value: &str) -> PyResult<T> {
    serde_json::from_value(value.into()).map_err(|e| SettingError::new_err(format!("{key}: {e}")))
}

/// See the package's `calibrate`.
#[pyfunction]
#[pyo3(signature = (image, name, skin, flip, polarity, pitch_mm, serial, description, order))]
#[allow(clippy::too_many_arguments)] // the keywords of the Python function
pub fn calibrate(
    py: Python<'_>,
    image: &Bound<'_, PyAny>,
    name: String,
    skin: &str,
    flip: &str,
    polarity: Option<&str>,
    pitch_mm: Option<f64>,
    serial: Option<String>,
    description: String,
    order: &str,
) -> PyResult<Sensor> {
    let order = byte_order(order)?;
    let known = KnownFacts {
        name,
        description,
        serial,
        pitch_mm,
        flip: fact::<Flip>("flip", flip)?,
        skin: fact::<Skin>("skin", skin)?,
        polarity: polarity.map(|word| fact::<Polarity>("polarity", word)).transpose()?,
    };
    let pictures = pictures_of(image, order)?;
    let mut scratch = vec![Vec::new(); pictures.len()];
    let frames: PyResult<Vec<Frame<'_>>> = pictures
        .iter()
        .zip(&mut scratch)
        .enumerate()
        .map(|(i, (picture, scratch))| Ok(Frame { pixels: picture.pixels(scratch)?, seq: i as u64, time_ns: None }))
        .collect();
    let frames = frames?;
    let first = &frames[..frames.len().min(FRAMES_MOST)];
    let found = py.detach(|| {
        guarded(|| {
            let mut found = calibrate_frames(first, &known).map_err(calibration)?;
            raise_edges(first, &mut found);
            Ok(found)
        })
    })?;
    Ok(Sensor(Arc::new(found.sensor)))
}
