//! One to [`FINGERS_MOST`] fingers' reports fused into one [`HandReport`], in the frame of the hand.
//!
//! ```text
//!              X along the fingers, towards their tips (out of the page)
//!    left      Y across them, Z from the left finger to the right one
//!   |    |
//!   | gel|  object  |gel |   finger frames: x = X; y = -Y on the left, y = Y on the right, z into each gel
//!   |    |          |    |
//!             Z ->  right    around (a cap turns about X): the same y in both fingers
//!   Y up                     across (a pull along Y):      opposite y
//!                            along  (a pull along X):      the same x
//!                            pivot  (a turn about Z):      opposite rotation
//! ```
//!
//! One finger cannot distinguish around from across; two can.

mod freshness;

use crate::monitor::{Estimate, SlipKind, SlipReport, SlipState};
use crate::plane::Vec2;
use crate::setting::{SettingError, named, within};
use freshness::Freshness;
use serde::{Deserialize, Serialize};

/// Most fingers a hand can have.
pub const FINGERS_MOST: usize = 4;

/// Number of frames with identical measurements after which a finger counts as frozen: noise never repeats itself.
const FROZEN_FRAMES_COUNT: u32 = 3;

/// Length of the mean slide direction below which the fingers' directions cancel each other; 1 where they agree.
const CANCELLED_LENGTH: f64 = 0.3;

/// Fewest markers over the threshold that count as half a slip: a single one may be bad.
const HALF_MARKERS_COUNT: u32 = 2;

/// The side of the object on which a finger is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Its gel faces along Z.
    Left,
    /// Its gel faces against Z.
    Right,
}

const SIDES: [(Side, &str); 2] = [(Side::Left, "left"), (Side::Right, "right")];

named!(Side, "side", SIDES);

/// How a finger is mounted in the hand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mounting {
    /// Its side.
    pub side: Side,
    /// Angle by which its image is rotated against the finger frame, radians from x to y.
    #[serde(default)]
    pub turn_rad: f64,
}

impl Mounting {
    /// A finger on this side whose image is not rotated.
    pub const fn on(side: Side) -> Self {
        Mounting { side, turn_rad: 0.0 }
    }

    /// +1 on the right, where y is Y and a rotation from x to y is one from X to Y; -1 on the left.
    fn sense(&self) -> f64 {
        match self.side {
            Side::Left => -1.0,
            Side::Right => 1.0,
        }
    }

    /// A vector of the rectified image in the finger frame.
    fn in_finger(&self, v: Vec2) -> Vec2 {
        v.rotated(-self.turn_rad)
    }
}

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

    fn scaled(self, factor: f64) -> Self {
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
    /// Mean contact area per finger in mm2; None where the pitch in mm is unknown.
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

#[derive(Debug, Clone, Copy)]
struct Finger {
    mounting: Mounting,
    report: Option<SlipReport>,
    health: Health,
    same_count: u32,
    freshness: Freshness,
}

/// Mean shear of the gel when all of a contact slips, over mu P / (k A), with k the shear stiffness and A the area:
/// 0.61 to 0.89, mostly 0.75, for a simulated cap under 10 to 60 N. It is below 1 because the rim carries less.
const FULL_SLIP_SHEAR_FRACTION: f64 = 0.75;

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

/// Fuses fingers. In each cycle pass every finger's report to [`Hand::see`] or call [`Hand::missed`], then call
/// [`Hand::report`].
///
/// ```
/// use slipbound::hand::{Hand, Health, Mounting, Side};
/// use slipbound::monitor::{SlipReport, SlipState};
///
/// /// A cycle of the loop: the newest report of each finger, None where no frame came.
/// fn cycle(hand: &mut Hand, now_ns: u64, reports: &[Option<SlipReport>]) -> SlipState {
///     for (finger, report) in reports.iter().enumerate() {
///         match report {
///             Some(report) => hand.see(finger, report),
///             None => hand.missed(finger),
///         }
///     }
///     hand.report(now_ns).state
/// }
///
/// let mut hand = Hand::new(&[Mounting::on(Side::Left), Mounting::on(Side::Right)])?;
/// assert_eq!(cycle(&mut hand, 0, &[None, None]), SlipState::Unjudged); // a hand that sees nothing says so
/// assert_eq!(hand.report(33_333_333).health[..2], [Health::Blind; 2]);
/// # Ok::<(), slipbound::setting::SettingError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Hand {
    fingers: Vec<Finger>,
    /// When the last report was made, ns.
    now_ns: Option<u64>,
}

impl Hand {
    /// A hand of these fingers. Fails for no finger, more than [`FINGERS_MOST`], or a mounting angle that is not
    /// finite.
    pub fn new(mountings: &[Mounting]) -> Result<Self, SettingError> {
        within("hand.fingers (count)", mountings.len() as f64, 1.0, FINGERS_MOST as f64)?;
        for mounting in mountings {
            within("hand.fingers.turn_rad", mounting.turn_rad, -7.0, 7.0)?;
        }
        let finger = |&mounting| {
            let freshness = Freshness::default();
            Finger { mounting, report: None, health: Health::Blind, same_count: 0, freshness }
        };
        Ok(Hand { fingers: mountings.iter().map(finger).collect(), now_ns: None })
    }

    /// Takes the report of a finger. Indices of absent fingers are ignored, and so is a repeated frame: it does not
    /// refresh the finger.
    pub fn see(&mut self, finger: usize, report: &SlipReport) {
        let Some(finger) = self.fingers.get_mut(finger) else { return };
        if finger.report.is_some_and(|last| (last.seq, last.time_ns) == (report.seq, report.time_ns)) {
            return;
        }
        // A torn frame may carry the host's time where the camera's time was lost with the frame.
        finger.freshness.see(report.time_ns.filter(|_| report.state != SlipState::Unjudged));
        let repeats = finger.report.is_some_and(|last| last.seq != report.seq && same_picture(&last, report));
        finger.same_count = if repeats { finger.same_count + 1 } else { 0 };
        finger.report = Some(*report);
        finger.health = match () {
            _ if report.state == SlipState::Unjudged => Health::Blind,
            _ if finger.same_count >= FROZEN_FRAMES_COUNT => Health::Frozen,
            _ => Health::Live,
        };
    }

    /// No frame came from a finger in this cycle.
    pub fn missed(&mut self, finger: usize) {
        if let Some(finger) = self.fingers.get_mut(finger) {
            finger.health = Health::Blind;
        }
    }

    /// The fused report at this time of the loop, ns, which must not decrease.
    pub fn report(&mut self, now_ns: u64) -> HandReport {
        let step_ns = now_ns.saturating_sub(self.now_ns.replace(now_ns).unwrap_or(now_ns));
        freshness::advance(self.fingers.iter_mut().map(|finger| &mut finger.freshness), now_ns, step_ns);
        for finger in self.fingers.iter_mut().filter(|finger| finger.freshness.is_stale()) {
            finger.health = Health::Blind;
        }
        self.fused()
    }

    fn fused(&self) -> HandReport {
        let live = || self.fingers.iter().filter(|f| f.health == Health::Live).filter_map(|f| Some((f, f.report?)));
        let seen = |(f, r): (&Finger, SlipReport)| (f.freshness.seen_ns(), r);
        let any = || self.fingers.iter().filter_map(|f| Some((f, f.report?)));
        let newest = live().map(seen).max_by_key(|(seen_ns, r)| (*seen_ns, r.seq));
        let newest = newest.or_else(|| any().map(seen).max_by_key(|(seen_ns, r)| (*seen_ns, r.seq))).map(|(_, r)| r);
        let touches = live().any(|(_, r)| r.shear.is_some());
        let side = |side| live().any(|(f, r)| f.mounting.side == side && (r.shear.is_some() || !touches));
        let separated = side(Side::Left) && side(Side::Right);
        let mut health = [Health::Absent; FINGERS_MOST];
        for (health, finger) in health.iter_mut().zip(&self.fingers) {
            *health = finger.health;
        }
        let touching = || live().filter(|(_, r)| r.shear.is_some());
        let shear = touching().map(|(f, r)| Some((f.mounting, r.shear?.translation_mm?)));
        let area = || touching().map(|(_, r)| r.contact.area_mm2);
        let margins = || live().filter_map(|(_, r)| r.estimates.margin);
        HandReport {
            seq: newest.map_or(0, |r| r.seq),
            time_ns: newest.and_then(|r| r.time_ns),
            state: fused_state(live().map(|(_, r)| r)),
            live_count: live().count() as u32,
            health,
            separated,
            shear_mm: fused_vector(shear, separated),
            pivot_rad: mean(touching().map(|(f, r)| Some(f.mounting.sense() * r.shear?.rotation_rad))),
            slip_max_mm: touching().map(|(_, r)| r.slip.max_mm).reduce(|most, mm| Some(most?.max(mm?))).flatten(),
            contact_area_mm2: mean(area()),
            quality: live().map(|(_, r)| r.contact.quality).fold(1.0, f64::min)
                * f64::from(live().count().min(1) as u32),
            slip: fused_slip(live(), separated),
            margin: least(margins()),
            margins_count: margins().count() as u32,
            friction: least(live().filter_map(|(_, r)| r.estimates.friction)),
            cut_fraction: live().map(|(_, r)| r.estimates.cut_fraction).fold(0.0, f64::max),
        }
    }
}

/// Whether all measurements are identical. A finger without contact measures nothing and is not compared.
fn same_picture(a: &SlipReport, b: &SlipReport) -> bool {
    a.shear.is_some() && a.shear == b.shear && a.contact == b.contact && a.markers == b.markers
}

/// Slip detected by any finger counts. So do two fingers with half the markers needed each, where markers decide.
fn fused_state(reports: impl Iterator<Item = SlipReport> + Clone) -> SlipState {
    let any = |state| reports.clone().any(|r| r.state == state);
    let halves = reports.clone().filter(|r| {
        r.state == SlipState::Stick
            && r.estimates.margin.is_none()
            && r.slip.markers_over >= HALF_MARKERS_COUNT
            && 2 * r.slip.markers_over >= r.slip.markers_needed
    });
    match () {
        _ if reports.clone().next().is_none() => SlipState::Unjudged,
        _ if any(SlipState::Gross) => SlipState::Gross,
        _ if any(SlipState::Incipient) || halves.count() >= 2 => SlipState::Incipient,
        _ if any(SlipState::Stick) => SlipState::Stick,
        _ if any(SlipState::Unsure) => SlipState::Unsure,
        _ => SlipState::NoContact,
    }
}

/// The smallest value; None without any.
fn least(estimates: impl Iterator<Item = Estimate>) -> Option<f64> {
    estimates.map(|estimate| estimate.value).reduce(f64::min)
}

/// Mean of all values; None when there are none or one is missing.
fn mean(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0u32);
    for value in values {
        sum += value?;
        count += 1;
    }
    (count > 0).then(|| sum / f64::from(count))
}

/// Image vectors of several fingers, combined in the hand frame. With fingers on both sides, each side counts once.
fn fused_vector(vectors: impl Iterator<Item = Option<(Mounting, Vec2)>>, separated: bool) -> Option<HandVector> {
    let mut sides = [(Vec2::ZERO, 0u32); 2];
    for vector in vectors {
        let (mounting, v) = vector?;
        let (sum, count) = &mut sides[usize::from(mounting.side == Side::Right)];
        *sum += mounting.in_finger(v);
        *count += 1;
    }
    let of = |(sum, count): (Vec2, u32)| (count > 0).then(|| sum / f64::from(count));
    match (of(sides[0]), of(sides[1])) {
        (Some(left), Some(right)) if separated => Some(HandVector {
            along: (left.x + right.x) / 2.0,
            across: (right.y - left.y) / 2.0,
            around: (right.y + left.y) / 2.0,
        }),
        (Some(one), _) | (None, Some(one)) => Some(HandVector { along: one.x, across: one.y, around: one.y }),
        (None, None) => None,
    }
}

fn fused_slip<'a>(live: impl Iterator<Item = (&'a Finger, SlipReport)> + Clone, separated: bool) -> Option<HandSlip> {
    let slipping = live.filter(|(_, r)| r.state.is_slip());
    let fingers_count = slipping.clone().count() as u32;
    if fingers_count == 0 {
        return None;
    }
    // A slip of unknown kind does not count as pivoting: it has no direction either, and no task allows it.
    let pivots = slipping.clone().any(|(_, r)| matches!(r.slip.kind, Some(SlipKind::Rotation | SlipKind::Both)));
    let unit = |angle_rad: f64| Vec2::new(libm::cos(angle_rad), libm::sin(angle_rad));
    let ways = slipping.filter_map(|(f, r)| Some(Some((f.mounting, unit(r.slip.direction_rad?)))));
    let sees_on = |side| ways.clone().flatten().any(|(mounting, _)| mounting.side == side);
    // With slip on one side only, around and across cannot be separated, even if both sides are live: each gets half.
    let is_one_sided = !(sees_on(Side::Left) && sees_on(Side::Right));
    let mut direction = fused_vector(ways.clone(), separated).unwrap_or_default();
    if is_one_sided {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        direction = HandVector { across: half * direction.across, around: half * direction.around, ..direction };
    }
    let length = direction.length();
    // Directions that cancel each other leave only noise.
    let direction = if length >= CANCELLED_LENGTH { direction.scaled(1.0 / length) } else { HandVector::default() };
    Some(HandSlip { direction, pivots, fingers_count })
}

/// Directions in which a task allows the object to slide, for example along a thread but not around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Allowed {
    /// Along the fingers.
    pub along: bool,
    /// Across them.
    pub across: bool,
    /// Around the axis along them.
    pub around: bool,
    /// Pivoting about the axis through both.
    pub pivot: bool,
}

/// Sine of the angle, 30 deg, by which a slip may deviate from an allowed direction.
const STRAY_SIN: f64 = 0.5;

impl Allowed {
    /// Whether this slip is in a direction that is not allowed.
    pub fn forbids(&self, slip: &HandSlip) -> bool {
        let d = slip.direction;
        let part = |component: f64, allowed: bool| if allowed { 0.0 } else { component };
        let outside = HandVector {
            along: part(d.along, self.along),
            across: part(d.across, self.across),
            around: part(d.around, self.around),
        };
        // It slides in an unknown direction, or the fingers disagree: not allowed unless all directions are.
        let is_unknown = d.length() == 0.0 && !slip.pivots && !(self.along && self.across && self.around);
        let slides = d.length() > 0.0 && outside.length() > STRAY_SIN;
        let pivots = slip.pivots && !self.pivot;
        slides || pivots || is_unknown
    }

    /// The report as a controller should see it: without slip in an allowed direction, and without the margin that this
    /// motion has used up.
    pub fn filter(&self, report: &HandReport) -> HandReport {
        match report.slip {
            Some(slip) if !self.forbids(&slip) => {
                HandReport { state: SlipState::Stick, slip: None, margin: None, margins_count: 0, ..*report }
            }
            _ => *report,
        }
    }
}
