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

mod allowed;
mod freshness;
mod fusion;
mod mounting;
mod report;

use crate::monitor::{SlipReport, SlipState};
use crate::setting::{SettingError, within};
pub use allowed::Allowed;
use freshness::Freshness;
use fusion::{fused_slip, fused_state, fused_vector, least, mean};
pub use mounting::{Mounting, Side};
pub use report::{FINGERS_MOST, HandReport, HandSlip, HandVector, Health};

/// Number of frames with identical measurements after which a finger counts as frozen: noise never repeats itself.
const FROZEN_FRAMES_COUNT: u32 = 3;

#[derive(Debug, Clone, Copy)]
struct Finger {
    mounting: Mounting,
    report: Option<SlipReport>,
    health: Health,
    same_count: u32,
    freshness: Freshness,
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

/// Refuses fingers that are all on one side: they cannot hold anything. A single finger may be the one with a camera.
pub fn check_sides(mountings: &[Mounting]) -> Result<(), SettingError> {
    match mountings {
        [first, .., last] if mountings.iter().all(|mounting| mounting.side == first.side) => Err(SettingError {
            key: format!("fingers[{}].side", mountings.len() - 1),
            expected: "fingers on both sides".into(),
            got: format!("`{}` for all {}", last.side.name(), mountings.len()),
        }),
        _ => Ok(()),
    }
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
            slip: fused_slip(live().map(|(f, r)| (f.mounting, r)), separated),
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
