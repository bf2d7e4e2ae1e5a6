//! The report on one frame: plain data, `Copy`, nothing in it from our own clock.

use crate::image::SizePx;
use crate::plane::Vec2;
use crate::sensor::Flip;
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;

/// The verdict on a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SlipState {
    /// Nothing touches the finger.
    NoContact,
    /// Something touches, but the contact is too small or too weak, or has too few markers, for a verdict.
    Unsure,
    /// The contact moves as one rigid body.
    Stick,
    /// Part of the contact lags behind the rigid motion: it has begun to slip.
    Incipient,
    /// The whole contact slides: its imprint moves over a gel that is no longer dragged along; see
    /// [`EvidenceReport::slides`](super::EvidenceReport). Tasks also conclude it from the load.
    Gross,
    /// The frame could not be judged; the reason says why.
    Unjudged,
}

impl SlipState {
    /// Whether the contact slips, in part or as a whole: `Incipient` or `Gross`.
    pub const fn is_slip(self) -> bool {
        matches!(self, SlipState::Incipient | SlipState::Gross)
    }
}

/// Why a frame is [`SlipState::Unjudged`] or [`SlipState::Unsure`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reason {
    /// The frame has another size than the monitor was made for.
    FrameSize {
        /// The size the monitor was made for.
        expected: SizePx,
        /// The size of this frame.
        got: SizePx,
    },
    /// The frame is too dark to show markers.
    Dark {
        /// Mean grey level of the frame.
        mean_levels: f64,
    },
    /// The frame did not arrive whole.
    Torn,
    /// Frames were missed before this one or a little earlier, and the markers may have moved by a pitch meanwhile, so
    /// that their identity is not clear yet. Ends when the markers are identified again, or when contact is lost.
    Gap {
        /// Time since the last frame before the gap, ns; None where frames carry no times.
        since_ns: Option<u64>,
    },
    /// Fewer than half of the markers that should be in view were found, or fewer than a quarter of all; or three tenths
    /// of them are missing since the frame before or that before it, as where a part of an image did not arrive.
    MarkersLost,
    /// The markers at rest do not stand the sensor's pitch apart, in rows and columns: this is another finger, or its
    /// image is mirrored differently from what the sensor file says. See
    /// [`RestSettings::check_spacing`](super::RestSettings).
    MarkerSpacing {
        /// The sensor's pitch in the rectified image, px.
        expected_px: f64,
        /// Median distance of a marker at rest to its nearest neighbour, px.
        got_px: f64,
        /// The flip with which they would stand a pitch apart, and their distance then, px; None when no flip does.
        fitting: Option<(Flip, f64)>,
    },
    /// The contact is too small, too weak or has too few markers: see [`ContactReport::quality`].
    ContactQuality,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::FrameSize { expected, got } => write!(f, "frame size: expected {expected}, got {got}"),
            Reason::Dark { mean_levels } => write!(f, "dark frame: mean grey level {mean_levels:.1}"),
            Reason::Torn => f.write_str("torn frame"),
            Reason::Gap { since_ns } => {
                f.write_str("frames were missed, and which marker is which is not clear yet")?;
                since_ns.map_or(Ok(()), |ns| write!(f, ", for {:.2} s", ns as f64 * 1e-9))
            }
            Reason::MarkersLost => f.write_str("too many markers are lost"),
            Reason::MarkerSpacing { expected_px, got_px, fitting } => {
                write!(
                    f,
                    "markers expected on a grid of {expected_px:.1} px (pitch_px of the sensor), got {got_px:.1} px apart: "
                )?;
                match fitting {
                    Some((flip, px)) => write!(f, "with flip = \"{flip}\" they stand {px:.1} px apart"),
                    None => f.write_str("is it the right sensor file?"),
                }
            }
            Reason::ContactQuality => f.write_str("contact too small or too weak to judge"),
        }
    }
}

impl Serialize for Reason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// The contact region of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ContactReport {
    /// Area in rectified pixels.
    pub area_px2: f64,
    /// Area on the gel; None where the finger's pitch in mm is unknown.
    pub area_mm2: Option<f64>,
    /// 0 to 1: whether the contact is large and strong enough to trust the verdict. The smaller of two shares, each at
    /// most 1: markers in contact over [`ContactSettings::full_markers_count`](super::ContactSettings), and strength of
    /// the imprint (smooth gel: from 0 at the change that counts as contact to 1 at twice that; fabric: the share of
    /// edge pixels, 1 at one in five).
    pub quality: f64,
}

/// Counts of markers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct MarkerCounts {
    /// Spots in this frame that lie on a marker of the rest frame. Other spots that look like markers (glare, dirt) do
    /// not count.
    pub detected: u32,
    /// Markers of the rest frame found again.
    pub matched: u32,
    /// Markers of the rest frame not found; their positions are extrapolated, and they keep their number when found
    /// again.
    pub lost: u32,
    /// Markers in the inner contact region, from which the rigid motion is fitted.
    pub inner: u32,
}

/// Rigid motion of the inner contact region since the reference frame (step 3).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MotionReport {
    /// The reference point: mean of the inner markers in the reference frame, rectified px.
    pub reference_px: Vec2,
    /// Displacement of the reference point in px.
    pub translation_px: Vec2,
    /// The same on the gel; None where the pitch in mm is unknown.
    pub translation_mm: Option<Vec2>,
    /// Rotation in radians, positive from x to y (clockwise on the screen).
    pub rotation_rad: f64,
    /// Centre of rotation, rectified px; None for a pure translation.
    pub icr_px: Option<Vec2>,
}

/// How far the object has dragged the gel since rest: the least-squares rigid motion of all markers in contact. Unlike
/// the motion of the inner region it counts from the rest frame and is not reset after a slip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ShearReport {
    /// Mean displacement of the markers in contact, px.
    pub translation_px: Vec2,
    /// The same on the gel; None where the pitch in mm is unknown.
    pub translation_mm: Option<Vec2>,
    /// Rotation in radians, positive from x to y.
    pub rotation_rad: f64,
}

/// A quantity with its error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The quantity, in the unit of its name.
    pub value: f64,
    /// Standard deviation of its error, in the same unit. Of stick ratio and margin: from simulated trials of held-out
    /// objects. Without the errors of what is given: the shear stiffness and pitch of the sensor file, the grip force.
    pub sd: f64,
    /// Frames since it was measured; 0: in this frame.
    pub age_frames: u32,
}

/// Estimates of a contact (step 6). Each is None where it cannot be known: without contact, before the finger has been
/// squeezed, or where grip force, shear stiffness or pitch in mm are unknown.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Estimates {
    /// Area that sticks over area in contact, 0 to 1.
    pub stick_ratio: Option<Estimate>,
    /// 1 - load over the load of the same direction that makes the object slide; the object slides at about 0 or below.
    pub margin: Option<Estimate>,
    /// Force along the finger's surface, N.
    pub shear_n: Option<Estimate>,
    /// Torque about the middle of the contact, N mm, positive from x to y.
    pub torque_nmm: Option<Estimate>,
    /// Friction coefficient between object and gel.
    pub friction: Option<Estimate>,
    /// Share of the markers in contact that are at the border of the view, 0 to 1. The load beyond it is in the
    /// estimates where the length of the gel is known ([`Sensor::gel_mm`](crate::sensor::Sensor::gel_mm)); slip there
    /// is not.
    #[serde(skip)]
    pub cut_fraction: f64,
}

/// Evidence of sliding in a frame, independent of the slip field (step 5).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EvidenceReport {
    /// Number of the frame that it counts from.
    pub reference_seq: u64,
    /// Decrease of the displacement from its largest value since the reference, as a fraction of that: 0 where the gel
    /// is dragged along, 1 where it has sprung back. Of the 90th percentile over all markers.
    pub relaxation: f64,
    /// Mean displacement of the inner third of the markers that are dragged along, divided by that of the outer third;
    /// None before any is.
    pub centre_rim_ratio: Option<f64>,
    /// 1 - correlation of the imprint with that of the reference, both in gel coordinates: 0 where the imprint moves
    /// with the markers, 1 where nothing of it is left in place. None where no imprint is visible.
    pub imprint_change: Option<f64>,
    /// Age of the imprint's part of the evidence in frames.
    pub imprint_age_frames: u32,
    /// 0 to 2; over 1 where the object slides. Computed from the largest value of each of the three since the
    /// reference. On a smooth gel that is touched in its rest frame the state is gross while it grows beyond 1.
    pub slide_score: f64,
    /// How far the imprint has moved over the gel since the reference, rectified px; it is the motion of the object.
    pub slide_px: Vec2,
    /// How far it has turned on the gel since then, radians.
    pub slide_rad: f64,
    /// Whether the imprint moves over a gel that is no longer dragged along: one of the inputs of [`SlipState::Gross`],
    /// which is also reported where no imprint shows it.
    pub slides: bool,
    /// Probability that the object slides as a whole, 0 to 1, by trees fitted to the contact simulator: from the motion of
    /// imprint and gel, used friction and load. The state is gross from 0.97 on with the grip force, from 0.98 on without,
    /// until it falls below 0.05; it is also gross where the estimates say that the friction is spent. None where no slide
    /// can begin in this frame (less than half of the friction used; without the grip force: a gel at standstill), and
    /// where no imprint or no estimate is available.
    pub gross_probability: Option<f64>,
    /// Speed of that slide in pitches per second; None while nothing slides, where frames have no time, and where the
    /// imprint jumps further than can be tracked.
    pub slide_pitch_per_s: Option<f64>,
    /// The same in mm/s; None also where the pitch in mm is unknown.
    pub slide_mm_per_s: Option<f64>,
}

/// Kind of slip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SlipKind {
    /// The object shifts over the gel.
    Translation,
    /// The object rotates on the gel.
    Rotation,
    /// Both, neither below a third of the motion at the rim.
    Both,
}

/// Summary of the slip field (step 4).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct SlipSummary {
    /// Markers in contact whose measured displacement differs from the rigid one by more than the threshold.
    pub markers_over: u32,
    /// The fewest of them that mean slip.
    pub markers_needed: u32,
    /// That threshold, in marker pitches.
    pub threshold_pitch: f64,
    /// Largest length of the slip field in contact, in marker pitches.
    pub max_pitch: f64,
    /// The same on the gel; None where the pitch in mm is unknown.
    pub max_mm: Option<f64>,
    /// Kind of slip; None while nothing slips, and where the load that makes it slip is not known.
    pub kind: Option<SlipKind>,
    /// Direction in which the OBJECT slides over the gel (against the slip field), radians, 0 along x, positive from x
    /// to y; None without a kind, and when the object only rotates.
    pub direction_rad: Option<f64>,
}

/// The verdict on one frame and the measurements behind it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SlipReport {
    /// Number of the frame, from its source.
    pub seq: u64,
    /// Time of the frame in nanoseconds, from its source.
    pub time_ns: Option<u64>,
    /// The verdict.
    pub state: SlipState,
    /// Why there is no verdict; None when there is one.
    pub reason: Option<Reason>,
    /// Step 1.
    pub contact: ContactReport,
    /// Step 2.
    pub markers: MarkerCounts,
    /// Number of the reference frame of displacement: the rest frame without contact, then the frame in which the
    /// squeeze of the finger had settled, or that of the last slip.
    pub reference_seq: u64,
    /// Grip force per finger in newtons, as passed by the caller; None where that is not a number.
    pub grip_n: Option<f64>,
    /// Step 3; None when too few markers are in contact.
    pub motion: Option<MotionReport>,
    /// How far the gel is sheared; None without contact.
    pub shear: Option<ShearReport>,
    /// Step 4.
    pub slip: SlipSummary,
    /// Step 6.
    #[serde(flatten)]
    pub estimates: Estimates,
    /// Step 5: evidence of sliding that does not depend on the slip field; None without contact, and where it is not used.
    pub evidence: Option<EvidenceReport>,
}

/// One marker after a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Marker {
    /// Its number: its index in the rest frame, in reading order. Never changes as long as the rest frame is the same.
    pub id: u32,
    /// Position in the rest frame, rectified px.
    pub rest: Vec2,
    /// Position in the reference frame, rectified px.
    pub reference: Vec2,
    /// Position now, rectified px; the expected one when it is not matched.
    pub now: Vec2,
    /// Whether it was found in this frame.
    pub matched: bool,
    /// Whether it is completely in view. A marker cut by the image border keeps its number and is positioned by its
    /// neighbours, but does not count for slip.
    pub whole: bool,
    /// Whether it was found in the reference frame; a marker that was not has no displacement since then.
    pub in_reference: bool,
    /// Whether it lies in the contact region.
    pub in_contact: bool,
    /// Whether the rigid motion was fitted to it.
    pub inner: bool,
    /// Measured minus rigid displacement since the reference frame, px; zero outside the contact.
    pub slip: Vec2,
    /// Whether the slip exceeds the threshold.
    pub over: bool,
}

impl Marker {
    /// A marker at its position in the rest frame, px.
    pub(crate) const fn at_rest(id: u32, rest: Vec2) -> Self {
        Marker {
            id,
            rest,
            reference: rest,
            now: rest,
            matched: true,
            whole: true,
            in_reference: true,
            in_contact: false,
            inner: false,
            slip: Vec2::ZERO,
            over: false,
        }
    }

    /// Displacement from rest in px.
    pub fn now_from_rest(&self) -> Vec2 {
        self.now - self.rest
    }

    /// Displacement since the reference frame in px.
    pub fn now_from_reference(&self) -> Vec2 {
        self.now - self.reference
    }
}
