//! The fused report of all fingers: plain data, `Copy`.

use crate::monitor::SlipState;
use serde::{Deserialize, Serialize};

/// Most fingers a hand can have.
pub const FINGERS_MOST: usize = 4;

/// Mean shear of the gel when all of a contact slips, over mu P / (k A), with k the shear stiffness and A the area:
/// 0.61 to 0.89, mostly 0.75, for a simulated cap under 10 to 60 N. It is below 1 because the rim carries less.
const FULL_SLIP_SHEAR_FRACTION: f64 = 0.75;

/// A vector of the contact, by the ways an object moves in the hand: along X, across (along Y), around X.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct HandVector {
    /// Along the fingers.
    pub along: f64,
    /// Across them: both fingers are dragged the same way.
    pub across: f64,
    /// Around the axis along the fingers: they are dragged opposite ways, as by a cap that is turned.
    pub around: f64,
}

impl HandVector {
    /// Euclidean length.
    pub fn length(&self) -> f64 {
        libm::sqrt(self.along * self.along + self.across * self.across + self.around * self.around)
    }

    pub(super) fn scaled(self, factor: f64) -> Self {
        HandVector { along: self.along * factor, across: self.across * factor, around: self.around * factor }
    }
}

/// Whether a finger can be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Health {
    /// There is no such finger.
    #[default]
    Absent,
    /// Its newest frame was judged.
    Live,
    /// No frame arrived, or it could not be judged, or the newest one is older than 0.1 s or that much behind those of
    /// another finger.
    Blind,
    /// It repeats the same image.
    Frozen,
}

/// Slip of the object in the hand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HandSlip {
    /// Direction in which the object slides, of length 1; all 0 when it only pivots, when no finger knows a direction,
    /// or when the fingers disagree. For a slip detected on one side only, `across` and `around` are the same number.
    pub direction: HandVector,
    /// Whether it turns about the axis through both fingers, alone or in addition.
    pub pivots: bool,
    /// Number of fingers that detect it.
    pub fingers_count: u32,
}

/// The fused report of all fingers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HandReport {
    /// Number of the newest frame of a live finger; of any finger where none is live.
    pub seq: u64,
    /// Time of that frame.
    pub time_ns: Option<u64>,
    /// The verdict of the hand. [`SlipState::Unjudged`] when no finger is live.
    pub state: SlipState,
    /// Fingers that are live.
    pub live_count: u32,
    /// Every finger, in the order they were given.
    pub health: [Health; FINGERS_MOST],
    /// Whether around and across could be distinguished: a live finger on either side, and, if any finger is in
    /// contact, one in contact on either side.
    pub separated: bool,
    /// Mean shear of the gels since rest in mm, towards where the object drags them; None without contact or where
    /// the pitch in mm is unknown. Unless `separated`, `across` and `around` hold the same number.
    pub shear_mm: Option<HandVector>,
    /// Rotation of the contact about Z since rest in rad, from X to Y; None without contact.
    pub pivot_rad: Option<f64>,
    /// The longest slip vector among the live fingers in mm; None without contact or where the pitch in mm is unknown.
    pub slip_max_mm: Option<f64>,
    /// Mean contact area of the live fingers in contact in mm2; None without contact or where the pitch in mm is unknown.
    pub contact_area_mm2: Option<f64>,
    /// The least contact quality among the live fingers, 0 to 1.
    pub quality: f64,
    /// What slips; None while nothing does.
    pub slip: Option<HandSlip>,
    /// The least slip margin among the live fingers, 1 without load, 0 when the object slides, below 0 where the load is
    /// above the estimated limit; None while no finger knows one. See [`Estimates`](crate::monitor::Estimates).
    #[serde(default)]
    pub margin: Option<f64>,
    /// How many live fingers know a margin.
    #[serde(default)]
    pub margins_count: u32,
    /// The least friction coefficient among the live fingers; None while no finger knows one.
    #[serde(default)]
    pub friction: Option<f64>,
    /// The largest share of a contact that is at the border of the view, among the live fingers. See
    /// [`Estimates::cut_fraction`](crate::monitor::Estimates::cut_fraction).
    #[serde(default)]
    pub cut_fraction: f64,
}

impl HandReport {
    /// Tangential load per finger in N, from the shear of gels with this shear stiffness in MPa/mm; None without
    /// contact or where the pitch in mm is unknown. An estimate: it takes the gel for a wide layer.
    pub fn load_n(&self, stiffness_mpa_per_mm: f64) -> Option<f64> {
        let (shear, area_mm2) = (self.shear_mm?, self.contact_area_mm2?);
        let across = libm::hypot(shear.across, if self.separated { shear.around } else { 0.0 });
        let shear_mm = libm::hypot(shear.along, across);
        Some(stiffness_mpa_per_mm * area_mm2 * shear_mm / FULL_SLIP_SHEAR_FRACTION)
    }
}
