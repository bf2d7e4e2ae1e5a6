//! The load on a finger as a wrench.

use crate::msg::{Header, Time, Vector3, Wrench, WrenchStamped};
use slipbound::monitor::SlipReport;

/// The force of the object on the gel, in `frame`: x along the finger, y across it, z into the gel, as in the rectified
/// image and right-handed.
///
/// Its magnitude in the plane is the report's `shear_n`, its direction that in which the gel is dragged. z is the grip
/// force, NaN if unknown, as where 0 N or less is read. The torque is about z through the middle of the contact, not through the origin of `frame`,
/// positive from x to y; torques about x and y are not measured and are 0. None where shear force or torque is unknown,
/// so that a zero is never mistaken for a measured value.
pub fn wrench(stamp: Time, frame: &str, report: &SlipReport) -> Option<WrenchStamped> {
    let (shear, torque) = (report.estimates.shear_n?, report.estimates.torque_nmm?);
    let dragged = report.shear?.translation_px;
    let length_px = dragged.length();
    let (x, y) = match length_px > 0.0 {
        true => (shear.value * dragged.x / length_px, shear.value * dragged.y / length_px),
        false if shear.value == 0.0 => (0.0, 0.0),
        false => return None, // a force whose direction is not known
    };
    let force = Vector3 { x, y, z: report.grip_n.filter(|n| *n > 0.0).unwrap_or(f64::NAN) };
    let torque = Vector3 { z: torque.value * 1e-3, ..Vector3::default() };
    let header = Header { stamp, frame_id: frame.to_owned() };
    Some(WrenchStamped { header, wrench: Wrench { force, torque } })
}
