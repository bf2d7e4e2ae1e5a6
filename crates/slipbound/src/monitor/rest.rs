//! The rest frame, that is the unloaded finger from which displacement counts, and how it is chosen.

use crate::image::SizePx;
use crate::monitor::cell_map::CellMap;
use crate::monitor::markers::RestMarker;
use crate::monitor::report::Reason;
use crate::sensor::{Sensor, Skin};
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};
use std::fmt;

/// How the rest frame is made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct RestSettings {
    /// Number of first frames among which the finger at rest is searched.
    pub window_count: u32,
    /// Most stationary frames to average. Ten reduce the noise of the rest frame to a third of that of one frame.
    pub average_count: u32,
    /// Two frames in a row are stationary when 99 of 100 cells change by less than this. Where noise or compression exceeds
    /// it in all first frames, it is the noise that counts.
    pub calm_levels: f64,
    /// A frame counts as dark when its brightness deviates from the window's median by more than this share.
    pub brightness_fraction: f64,
    /// Smooth gel without `bare_sharpness` in its file: a sharper image than this shows an imprint.
    pub imprint_levels: f64,
    /// Fewest markers a rest frame must show.
    pub markers_min_count: u32,
    /// Whether no frame is judged while the spacing of the markers at rest is not the sensor's pitch (0.85 to 1.18 of
    /// it), or while they fit its grid only with another flip. Set it to false for a finger whose dots are known to be
    /// irregular.
    pub check_spacing: bool,
    /// Whether an object is known to be held in the first frames, even if hardly visible there: then they are
    /// [`RestKind::InContact`].
    pub held: bool,
}

impl Default for RestSettings {
    fn default() -> Self {
        RestSettings {
            window_count: 20,
            average_count: 10,
            calm_levels: 5.0,
            brightness_fraction: 0.1,
            imprint_levels: 6.0,
            markers_min_count: 9,
            check_spacing: true,
            held: false,
        }
    }
}

impl RestSettings {
    pub(super) fn check(&self) -> Result<(), SettingError> {
        within("rest.window_count", f64::from(self.window_count), 1.0, 10_000.0)?;
        within("rest.average_count", f64::from(self.average_count), 1.0, 10_000.0)?;
        within("rest.calm_levels", self.calm_levels, 0.1, 255.0)?;
        within("rest.brightness_fraction", self.brightness_fraction, 0.001, 1.0)?;
        within("rest.imprint_levels", self.imprint_levels, 0.1, 255.0)?;
        within("rest.markers_min_count", f64::from(self.markers_min_count), 4.0, 1000.0)
    }
}

/// Whether the finger was in contact in the rest frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RestKind {
    /// Nothing touched it.
    Unloaded,
    /// Something already touched it: displacement counts from there, and the contact region of a smooth gel is where
    /// the imprint is sharper than illumination can be.
    InContact,
}

/// Why no rest frame could be made.
#[derive(Debug, Clone, PartialEq)]
pub enum RestError {
    /// No frame was stationary and bright enough.
    NoStationaryFrame {
        /// Frames examined.
        looked_at_count: usize,
        /// Of these, frames that could not be judged (dark, or of another size).
        unusable_count: usize,
    },
    /// A frame given as rest cannot be used.
    Unusable(Reason),
    /// No frame was added.
    Empty,
    /// Too few markers were found.
    FewMarkers {
        /// Fewest that are needed.
        expected_count: u32,
        /// Markers found.
        got_count: usize,
    },
}

impl fmt::Display for RestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RestError::NoStationaryFrame { looked_at_count, unusable_count } => write!(
                f,
                "no rest frame among the first {looked_at_count} frames ({unusable_count} of them dark or of another size)"
            ),
            RestError::Unusable(reason) => write!(f, "unusable as rest frame: {reason}"),
            RestError::Empty => f.write_str("no rest frame was given"),
            RestError::FewMarkers { expected_count, got_count } => write!(
                f,
                "too few markers in the rest frame: expected at least {expected_count}, got {got_count} \
                 (is it the right sensor file?)"
            ),
        }
    }
}

impl std::error::Error for RestError {}

/// The finger at rest, as the monitor needs it.
///
/// It can be saved and loaded in any serde format: a monitor made from the loaded value gives the same reports bit for
/// bit. As JSON, an image of 640x480 takes about 2 MB.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rest {
    pub(super) kind: RestKind,
    pub(super) seq: u64,
    pub(super) frames_count: u32,
    pub(super) size: SizePx,
    pub(super) grey: Vec<u8>,
    pub(super) flat: Vec<u8>,
    pub(super) cells: Vec<[f32; 3]>,
    pub(super) cells_covered: Vec<bool>,
    pub(super) markers: Vec<RestMarker>,
    pub(super) refusal: Option<Reason>,
}

impl Rest {
    /// Whether the finger was in contact.
    pub fn kind(&self) -> RestKind {
        self.kind
    }

    /// Size of the camera frames that it was made from; frames of other sizes cannot be judged against it.
    pub fn size(&self) -> SizePx {
        self.size
    }

    /// Number of the last frame averaged into it.
    pub fn seq(&self) -> u64 {
        self.seq
    }

    /// Frames averaged into it.
    pub fn frames_count(&self) -> u32 {
        self.frames_count
    }

    /// Why no frame can be judged against it; None when it can.
    pub fn refusal(&self) -> Option<Reason> {
        self.refusal
    }

    /// Markers found on it.
    pub fn markers_count(&self) -> usize {
        self.markers.len()
    }

    /// Checks that it belongs to this finger and these settings: a loaded file may be of another finger, or damaged.
    pub(super) fn check(&self, sensor: &Sensor, needs_flat: bool) -> Result<(), SettingError> {
        let (rectified_px, cell_px) = (sensor.rectified_px(), CellMap::cell_px(sensor));
        let cells_count = (rectified_px.width / cell_px) * (rectified_px.height / cell_px);
        let counts = |key: &str, got: usize, expected: usize| {
            let error =
                || SettingError { key: key.into(), got: got.to_string(), expected: format!("{expected} values") };
            (got == expected).then_some(()).ok_or_else(error)
        };
        counts("rest.grey", self.grey.len(), rectified_px.area())?;
        if needs_flat || sensor.skin == Skin::Fabric || !self.flat.is_empty() {
            counts("rest.flat", self.flat.len(), rectified_px.area())?;
        }
        counts("rest.cells", self.cells.len(), cells_count)?;
        counts("rest.cells_covered", self.cells_covered.len(), cells_count)?;
        within("rest.markers", self.markers.len() as f64, 1.0, rectified_px.area() as f64)?;
        let (width, height) = (rectified_px.width as f64, rectified_px.height as f64);
        for (n, marker) in self.markers.iter().enumerate() {
            within(&format!("rest.markers[{n}].position.x"), marker.position.x, 0.0, width)?;
            within(&format!("rest.markers[{n}].position.y"), marker.position.y, 0.0, height)?;
            marker.check(&format!("rest.markers[{n}]"))?;
        }
        let finite = |cell: &[f32; 3]| cell.iter().all(|value| value.is_finite());
        match self.cells.iter().position(|cell| !finite(cell)) {
            Some(n) => Err(SettingError {
                key: format!("rest.cells[{n}]"),
                got: format!("{:?}", self.cells[n]),
                expected: "three numbers".into(),
            }),
            None => Ok(()),
        }
    }
}
