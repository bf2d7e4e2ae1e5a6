//! Ground truth of a frame that the scores need.

use crate::contact::{GROSS_FRICTION_FRACTION, Pose, Wrench};
use crate::world::{FULL_SLIP_STICK_RATIO, World};
use slipbound::monitor::SlipKind;
use slipbound::plane::Vec2;

/// Ground truth of a frame, without the markers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundTruth {
    /// Number of the frame.
    pub frame: u64,
    /// Time of its exposure, s, on the clock of the world, which stops while the world stands still.
    pub time_s: f64,
    /// The load along its path; None if the object is not loaded.
    pub load: Option<f64>,
    /// Stick area over contact area; None without contact.
    pub stick_ratio: Option<f64>,
    /// Normal force, N.
    pub grip_n: f64,
    /// Force and torque on the gel; the torque about the middle of the contact, as in reports.
    pub wrench: Wrench,
    /// Where the object is.
    pub pose: Pose,
    /// Mean slip of the cells in contact since they came into contact, mm.
    pub slip_mm: Vec2,
    /// Root mean square distance of the cells in contact from their middle, mm.
    pub arm_mm: f64,
    /// Whether the object slides as a whole: friction does 99 % of its largest possible work, or hardly any cell
    /// sticks. On a curved path friction lags behind the motion and does less work, although all cells slide.
    pub slides: bool,
}

/// Reads the world at its last frame.
pub(crate) fn ground_truth(world: &World, frame: u64) -> GroundTruth {
    let truth = world.truth();
    GroundTruth {
        frame,
        time_s: truth.time_ns as f64 * 1e-9,
        load: truth.load,
        stick_ratio: truth.stick_ratio,
        grip_n: truth.grip_force_n,
        wrench: about_middle(world),
        pose: truth.pose,
        slip_mm: truth.slip.mean_mm,
        arm_mm: arm_mm(world),
        slides: truth.friction_used_fraction.is_some_and(|used| used >= GROSS_FRICTION_FRACTION)
            || truth.stick_ratio.is_some_and(|stick_ratio| stick_ratio <= FULL_SLIP_STICK_RATIO),
    }
}

/// The ground truth states torque about the object's reference point, which may be anywhere outside the contact.
fn about_middle(world: &World) -> Wrench {
    let (truth, grid, finger) = (world.truth(), world.grid(), world.finger());
    let touching = || finger.contact().iter().enumerate().filter(|(_, contact)| **contact).map(|(cell, _)| cell);
    let count = touching().count();
    if count == 0 {
        return truth.wrench;
    }
    let place = |cell: usize| grid.centre_mm(cell) + finger.displacement(cell).shift_mm;
    let middle = touching().fold(Vec2::ZERO, |sum, cell| sum + place(cell)) / count as f64;
    let lever_mm = truth.pose.position_mm - middle;
    Wrench { torque_n_mm: truth.wrench.torque_n_mm + lever_mm.cross(truth.wrench.force_n), ..truth.wrench }
}

fn arm_mm(world: &World) -> f64 {
    let grid = world.grid();
    let cells = || world.finger().contact().iter().enumerate().filter(|(_, contact)| **contact).map(|(cell, _)| cell);
    let count = cells().count().max(1) as f64;
    let middle = cells().fold(Vec2::ZERO, |sum, cell| sum + grid.centre_mm(cell)) / count;
    (cells().map(|cell| (grid.centre_mm(cell) - middle).length_squared()).sum::<f64>() / count).sqrt()
}

/// Kind of the motion of an object between two frames, from the share of rotation in the motion at the rim: the thirds
/// of [`SlipKind`].
pub fn kind_of_motion(from: &GroundTruth, to: &GroundTruth) -> SlipKind {
    let turn_mm = (to.pose.turn_rad - from.pose.turn_rad).abs() * to.arm_mm;
    let shift_mm = (to.pose.position_mm - from.pose.position_mm).length();
    match turn_mm / (turn_mm + shift_mm).max(f64::MIN_POSITIVE) {
        share if share > 2.0 / 3.0 => SlipKind::Rotation,
        share if share < 1.0 / 3.0 => SlipKind::Translation,
        _ => SlipKind::Both,
    }
}
