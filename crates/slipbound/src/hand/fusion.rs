//! The values of several fingers -> one of the hand: state, vectors, slip, means and least values.

use super::mounting::{Mounting, Side};
use super::report::{HandSlip, HandVector};
use crate::monitor::{Estimate, SlipKind, SlipReport, SlipState};
use crate::plane::Vec2;

/// Length of the mean slide direction below which the fingers' directions cancel each other; 1 where they agree.
const CANCELLED_LENGTH: f64 = 0.3;

/// Fewest markers over the threshold that count as half a slip: a single one may be bad.
const HALF_MARKERS_COUNT: u32 = 2;

/// Slip detected by any finger counts. So do two fingers with half the markers needed each, where markers decide.
pub(super) fn fused_state(reports: impl Iterator<Item = SlipReport> + Clone) -> SlipState {
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
pub(super) fn least(estimates: impl Iterator<Item = Estimate>) -> Option<f64> {
    estimates.map(|estimate| estimate.value).reduce(f64::min)
}

/// Mean of all values; None when there are none or one is missing.
pub(super) fn mean(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0u32);
    for value in values {
        sum += value?;
        count += 1;
    }
    (count > 0).then(|| sum / f64::from(count))
}

/// Image vectors of several fingers, combined in the hand frame. With fingers on both sides, each side counts once.
pub(super) fn fused_vector(
    vectors: impl Iterator<Item = Option<(Mounting, Vec2)>>,
    separated: bool,
) -> Option<HandVector> {
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

/// The slip of all live fingers, each with its mounting; None while nothing slips.
pub(super) fn fused_slip(
    live: impl Iterator<Item = (Mounting, SlipReport)> + Clone,
    separated: bool,
) -> Option<HandSlip> {
    let slipping = live.filter(|(_, r)| r.state.is_slip());
    let fingers_count = slipping.clone().count() as u32;
    if fingers_count == 0 {
        return None;
    }
    // A slip of unknown kind does not count as pivoting: it has no direction either, and no task allows it.
    let pivots = slipping.clone().any(|(_, r)| matches!(r.slip.kind, Some(SlipKind::Rotation | SlipKind::Both)));
    let unit = |angle_rad: f64| Vec2::new(libm::cos(angle_rad), libm::sin(angle_rad));
    let ways = slipping.filter_map(|(mounting, r)| Some(Some((mounting, unit(r.slip.direction_rad?)))));
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
