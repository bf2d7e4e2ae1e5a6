//! The load on a finger as a wrench.

use crate::msg::{Header, Vector3, Wrench, WrenchStamped};
use slipbound::monitor::SlipReport;

/// The load on the finger's surface in the frame of its picture (x along the finger, y across it, z into the gel): its size
/// is the report's `shear_n`, its direction that in which the gel is sheared; the torque is about z, positive from x to y.
/// z is the grip force, NaN where nobody tells it. None where shear force or torque are not known, so that nothing stands
/// where a zero could be taken for a measured one.
pub fn wrench(header: &Header, report: &SlipReport) -> Option<WrenchStamped> {
    let (shear, torque) = (report.estimates.shear_n?, report.estimates.torque_nmm?);
    let dragged = report.shear?.translation_px;
    let length_px = dragged.length();
    let (x, y) = match length_px > 0.0 {
        true => (shear.value * dragged.x / length_px, shear.value * dragged.y / length_px),
        false if shear.value == 0.0 => (0.0, 0.0),
        false => return None, // a force whose direction is not known
    };
    let force = Vector3 { x, y, z: report.grip_n.unwrap_or(f64::NAN) };
    let torque = Vector3 { z: torque.value * 1e-3, ..Vector3::default() };
    Some(WrenchStamped { header: header.clone(), wrench: Wrench { force, torque } })
}
