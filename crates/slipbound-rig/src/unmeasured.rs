//! Frames of which nothing was measured: dark, torn, of another size, after a gap.

use slipbound::monitor::{Marker, Reason, SlipReport, SlipState};
use slipbound::plane::Vec2;
use std::borrow::Cow;

/// Whether a frame was not measured at all.
pub fn is_unmeasured(report: &SlipReport) -> bool {
    use Reason::{Dark, FrameSize, Gap, Torn};
    let is_reason = matches!(report.reason, Some(Dark { .. } | FrameSize { .. } | Gap { .. } | Torn));
    report.state == SlipState::Unjudged && is_reason
}

/// The markers of a monitor as they are after the frame of this report. A monitor keeps those of the last frame that was
/// measured; in one that was not, none was found, is in contact or slips, and each is where it was last.
pub fn markers_after<'a>(report: &SlipReport, markers: &'a [Marker]) -> Cow<'a, [Marker]> {
    if !is_unmeasured(report) {
        return Cow::Borrowed(markers);
    }
    let unseen =
        |m: &Marker| Marker { matched: false, in_contact: false, inner: false, over: false, slip: Vec2::ZERO, ..*m };
    Cow::Owned(markers.iter().map(unseen).collect())
}
