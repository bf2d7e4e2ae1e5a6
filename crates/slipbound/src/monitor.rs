//! The slip monitor: the four steps of the paper in their order, one frame at a time.

mod contact;
mod imprint;
mod markers;
mod motion;
mod report;
mod rest;
mod slip;

pub use contact::ContactSettings;
pub use imprint::ImprintSettings;
pub use markers::MarkerSettings;
pub use motion::MotionSettings;
pub use report::*;
pub use rest::{Rest, RestBuilder, RestError, RestKind, RestLook, RestSettings};
pub use slip::SlipSettings;

use crate::image::{Frame, Gray, Mask};
use crate::port::GripSample;
use crate::sensor::{Sensor, SettingError};
use serde::{Deserialize, Serialize};

/// The settings of every step. `Settings::default()` is what we ship, [`Settings::paper`] the paper as written.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// How the rest frame is made.
    pub rest: RestSettings,
    /// Step 0.
    pub imprint: ImprintSettings,
    /// Step 1.
    pub contact: ContactSettings,
    /// Step 2.
    pub markers: MarkerSettings,
    /// Step 3.
    pub motion: MotionSettings,
    /// Step 4.
    pub slip: SlipSettings,
}

/// The steps of the method, for a [`Probe`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// Step 0: grey, rectified, flattened.
    Imprint,
    /// Step 1: contact region.
    Contact,
    /// Step 2: marker displacement.
    Markers,
    /// Step 3: rigid motion of the inner region.
    Motion,
    /// Step 4: slip field and verdict.
    Slip,
}

/// Looks on while a frame is judged: timing, debug pictures, tests. Called after each step.
pub trait Probe {
    /// `step` has just been done; the monitor's views show its result.
    fn after(&mut self, step: Step, monitor: &SlipMonitor);
}

impl Probe for () {
    fn after(&mut self, _: Step, _: &SlipMonitor) {}
}
