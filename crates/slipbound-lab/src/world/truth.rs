//! Ground truth of a frame, written with it.

use super::gross::Gross;
use crate::contact::{Event, Finger, Grid, LINEAR_STRAIN, Pose, Wrench};
use crate::scenes::Trial;
use serde::{Deserialize, Serialize};
use slipbound::plane::Vec2;

/// Incremented when a reader of old lines could misread new ones.
pub const TRUTH_FORMAT_VERSION: u32 = 1;

/// An event and its time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TimedEvent {
    /// What.
    pub event: Event,
    /// Time on the clock of the frames, in s; that of gross slip is [`Gross::time_s`].
    pub time_s: f64,
}

/// Slip of the object over the gel, over all cells in contact.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct SlipTruth {
    /// Cells that slid in the last substep.
    pub sliding_cells_count: u32,
    /// Mean of the slip of all cells in contact since they came into contact, a vector in mm.
    pub mean_mm: Vec2,
    /// Mean path length of the slip since contact, in mm.
    pub mean_way_mm: f64,
    /// Largest path length of the slip since contact, in mm.
    pub largest_way_mm: f64,
}

/// Ground truth of a frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FrameTruth {
    /// Its number.
    pub frame: u64,
    /// Time of its exposure, in ns.
    pub time_ns: u64,
    /// Where the object's reference point is and how it is turned. Rolling is not in it: the contact then moves while the
    /// skin of the object stays where it touched.
    pub pose: Pose,
    /// Normal force of this finger, in N.
    pub grip_force_n: f64,
    /// Depth of the object's lowest point below the flat gel, in mm; negative above it.
    pub depth_mm: f64,
    /// In-plane load of the object on this finger's gel; the torque is about the object's reference point.
    pub wrench: Wrench,
    /// Area under pressure, in mm2.
    pub contact_area_mm2: f64,
    /// The part of it that did not slide in the last substep, in mm2.
    pub stick_area_mm2: f64,
    /// phi, stick area over contact area; None without contact.
    pub stick_ratio: Option<f64>,
    /// Share of the friction that is used: see [`Finger`]'s truth of that name. None without contact,
    /// load or motion.
    pub friction_used_fraction: Option<f64>,
    /// The load along its path, 0 or above, in the unit of the scene: see [`Pull`](crate::scenes::Pull) and
    /// [`LoadProfile::along`](crate::scenes::LoadProfile). None if the object is not loaded.
    pub load: Option<f64>,
    /// f = load over the load at gross slip; above 1 after it. None if the trial never reaches gross slip, and until it
    /// has: [`complete`] fills it in.
    pub load_fraction: Option<f64>,
    /// m = 1 - f, below 0 after gross slip; None where f is.
    pub margin: Option<f64>,
    /// Cells under pressure as [`runs`]; row by row along x.
    pub contact_runs: Vec<u32>,
    /// Cells under pressure that did not slide in the last substep, as [`runs`].
    pub stick_runs: Vec<u32>,
    /// Slip of the object.
    pub slip: SlipTruth,
    /// Largest pressure in MPa.
    pub peak_pressure_mpa: f64,
    /// Largest displacement gradient of the gel's surface, as a fraction.
    pub largest_strain_fraction: f64,
    /// Largest pressure over the modulus of a soft object; 0 for a rigid one.
    pub object_strain_fraction: f64,
    /// Whether gel or object strain beyond [`LINEAR_STRAIN`]: a real one would behave differently.
    pub beyond_linear: bool,
    /// Whether the contact reaches the border of the pad: of the grid, or the rounded edge of a gel that ends before it.
    pub at_border: bool,
    /// Whether both solvers met their tolerance in the last substep.
    pub converged: bool,
    /// Events since the frame before; in a recording, since the last one that was not dropped. Gross slip on a bend is
    /// confirmed after two frames, and moved to the frame that shows it by [`complete`].
    pub events: Vec<TimedEvent>,
    /// Of every marker: displacement along x, along y and into the gel in mm, then its position in the image as
    /// delivered by the camera, x and y in px. Rounded to 0.1 um and 0.0001 px.
    pub markers: Vec<[f64; 5]>,
}

impl FrameTruth {
    /// Reads the finger. `markers`: see [`FrameTruth::markers`].
    pub(super) fn of(finger: &Finger, frame: u64, time_ns: u64, markers: impl Iterator<Item = [f64; 5]>) -> Self {
        let truth = finger.truth();
        let settings = finger.settings();
        let cell_mm2 = settings.grid.cell_area_mm2();
        let stuck = finger.stick().iter().filter(|stick| **stick).count();
        let object_strain_fraction =
            settings.soft_object.map_or(0.0, |object| truth.peak_pressure_mpa / object.modulus_mpa);
        FrameTruth {
            frame,
            time_ns,
            pose: truth.pose,
            grip_force_n: truth.grip_force_n,
            depth_mm: truth.depth_mm,
            wrench: truth.wrench,
            contact_area_mm2: truth.contact_area_mm2,
            stick_area_mm2: stuck as f64 * cell_mm2,
            stick_ratio: truth.stick_ratio,
            friction_used_fraction: None,
            load: None,
            load_fraction: None,
            margin: None,
            contact_runs: runs(finger.contact()),
            stick_runs: runs(finger.stick()),
            slip: SlipTruth::of(finger),
            peak_pressure_mpa: truth.peak_pressure_mpa,
            largest_strain_fraction: truth.largest_strain_fraction,
            object_strain_fraction,
            beyond_linear: truth.beyond_linear || object_strain_fraction > LINEAR_STRAIN,
            at_border: truth.at_border,
            converged: truth.converged,
            events: Vec::new(),
            markers: markers.map(|marker| marker.map(|number| (number * 1e4).round() / 1e4 + 0.0)).collect(),
        }
    }

    /// Whether an event is among those since the frame before.
    pub fn saw(&self, event: Event) -> bool {
        self.events.iter().any(|timed| timed.event == event)
    }
}

impl SlipTruth {
    fn of(finger: &Finger) -> Self {
        let mut slip = SlipTruth::default();
        let mut cells = 0.0f64;
        for (cell, _) in finger.contact().iter().enumerate().filter(|(_, contact)| **contact) {
            cells += 1.0;
            slip.sliding_cells_count += u32::from(!finger.stick()[cell]);
            slip.mean_mm += finger.slip_mm(cell);
            slip.mean_way_mm += finger.slipped_mm(cell);
            slip.largest_way_mm = slip.largest_way_mm.max(finger.slipped_mm(cell));
        }
        if cells > 0.0 {
            slip.mean_mm = slip.mean_mm / cells;
            slip.mean_way_mm /= cells;
        }
        slip
    }
}

/// The first line of a truth file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TruthHeader {
    /// `slipbound-truth`.
    pub format: String,
    /// [`TRUTH_FORMAT_VERSION`].
    pub format_version: u32,
    /// The version of the simulator.
    pub software_version: String,
    /// The trial.
    pub trial: Trial,
    /// The grid of the runs.
    pub grid: Grid,
    /// Positions of the markers at rest, in mm on the gel.
    pub markers_at_rest_mm: Vec<Vec2>,
    /// When the object began to slide as a whole; None when it never did.
    pub gross: Option<Gross>,
}

/// Fills in load fraction and margin, once gross slip is known or the trial has ended. The load at which an object slides
/// is proportional to the grip: f is the load over the one that would slide at the grip of its own frame. The event of
/// gross slip moves to the first frame that shows it.
pub fn complete(truths: &mut [FrameTruth], gross: Option<Gross>) {
    if let Some(gross) = gross {
        move_event(truths, &gross);
    }
    for truth in truths {
        let gross_load = gross.filter(|_| truth.grip_force_n > 0.0);
        let gross_load = gross_load.map(|gross| gross.load * (truth.grip_force_n / gross.grip_force_n));
        truth.load_fraction = truth.load.zip(gross_load).map(|(load, gross_load)| load / gross_load);
        truth.margin = truth.load_fraction.map(|fraction| 1.0 - fraction);
    }
}

fn move_event(truths: &mut [FrameTruth], gross: &Gross) {
    let Some(from) = truths.iter().position(|truth| truth.saw(Event::Gross)) else { return };
    let Some(to) = truths.iter().position(|truth| gross.is_shown_at(truth.time_ns as f64 * 1e-9)) else { return };
    if to < from {
        let gross_event = |timed: &mut TimedEvent| timed.event == Event::Gross;
        let moved: Vec<TimedEvent> = truths[from].events.extract_if(.., gross_event).collect();
        truths[to].events.extend(moved);
        truths[to].events.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    }
}

/// A mask as run lengths: cells outside, then cells inside, alternating. The first may be 0; a last run outside is left
/// out, so an empty mask has no runs.
pub fn runs(mask: &[bool]) -> Vec<u32> {
    let mut runs = Vec::new();
    let (mut inside, mut length) = (false, 0);
    for &cell in mask {
        if cell != inside {
            runs.push(length);
            (inside, length) = (cell, 0);
        }
        length += 1;
    }
    if inside {
        runs.push(length);
    }
    runs
}

/// The mask of `cells_count` cells that [`runs`] packed; None when there are too many.
pub fn unpacked(runs: &[u32], cells_count: usize) -> Option<Vec<bool>> {
    let mut mask = Vec::with_capacity(cells_count);
    for (n, &length) in runs.iter().enumerate() {
        if length as usize > cells_count - mask.len() {
            return None;
        }
        mask.resize(mask.len() + length as usize, n % 2 == 1);
    }
    mask.resize(cells_count, false);
    Some(mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_unpack_to_the_mask_they_came_from() {
        let mask = |picture: &str| picture.bytes().map(|sign| sign == b'#').collect::<Vec<bool>>();
        for (picture, expected) in
            [("......", vec![]), ("######", vec![0, 6]), ("..##.#", vec![2, 2, 1, 1]), ("#.....", vec![0, 1])]
        {
            let mask = mask(picture);
            assert_eq!(runs(&mask), expected, "{picture}");
            assert_eq!(unpacked(&expected, mask.len()), Some(mask), "{picture}");
        }
        assert_eq!(unpacked(&[3, 4], 6), None);
    }
}
