//! The contact of both fingers with the held object, stepped in time by the gripper and the wrist.

use super::pads::Pads;
use super::scene::HandScene;
use super::truth::{HandTruth, PadTruth};
use crate::contact::{Command, Displacement, Drive, Finger, Grip, LINEAR_STRAIN, Pose, Wrench};
use crate::plants::{ContactInput, HandState, HeldObject, Symmetry};
use crate::world::{FRAME_RATE_HZ, SUBSTEPS_COUNT, Sliding};
use slipbound::plane::Vec2;
use slipbound::plant::Plant;
use slipbound::setting::SettingError;

/// Steps of the contact per second.
const STEPS_HZ: u64 = FRAME_RATE_HZ * SUBSTEPS_COUNT;

/// Share of the grip that must be required before the object counts as sliding as a whole: while pressing, the first
/// cells may slip although nothing slides.
const LOADED_FRACTION: f64 = 0.5;

/// Share of the friction used below which an object no longer slides as a whole: knurls that pass over the gel make
/// cells stick for a step.
const STILL_SLIDES_FRACTION: f64 = 0.95;

/// The world between the jaws, without jaws and wrist: a [`Plant`].
///
/// Unless the scene specifies otherwise the two fingers and their loads are identical, up to the sign of y; one contact
/// is then computed.
#[derive(Debug)]
pub struct HandWorld {
    pads: Pads,
    held: Box<dyn HeldObject>,
    width_mm: f64,
    steps_count: u64,
    now: HandState,
    /// Target of gripper and wrist at the end of the next call of `advance_to`.
    target: HandState,
    truth: HandTruth,
    error: Option<SettingError>,
}

impl HandWorld {
    /// Starts with the object untouched between the fingers. Fails for invalid contact settings.
    pub fn new(scene: &HandScene) -> Result<Self, SettingError> {
        let held = scene.held()?;
        let mut pads = Pads::new(scene, held.symmetry())?;
        let off = Command {
            grip: Grip::ForceN(0.0),
            pose: held.start_pose(),
            roll_mm: Vec2::ZERO,
            wrench: Wrench::default(),
        };
        pads.step(Drive::Guided, &off)?;
        pads.step(Drive::Guided, &off)?; // repeated, because the first step left it with a velocity
        let mut world = HandWorld {
            pads,
            width_mm: scene.width_mm(),
            steps_count: 0,
            now: HandState::default(),
            target: HandState::default(),
            truth: HandTruth { converged: true, pose: held.start_pose(), ..HandTruth::default() },
            error: None,
            held,
        };
        world.truth.set_object(world.held.truth());
        Ok(world)
    }

    /// Ground truth at the end of the last step.
    pub fn truth(&self) -> &HandTruth {
        &self.truth
    }

    /// The computed contact of a finger, 0 left, 1 right. That of the right one is in the axes of the left one, before
    /// [`HandWorld::symmetry`]; if the pads are identical it is that of the left one.
    pub fn finger(&self, finger: usize) -> &Finger {
        self.pads.finger(finger)
    }

    /// Relation of the right finger's contact to the left one's, if the pads are identical.
    pub fn symmetry(&self) -> Symmetry {
        self.held.symmetry()
    }

    /// The error that stopped the run; None otherwise. After an error time does not advance.
    pub fn error(&self) -> Option<&SettingError> {
        self.error.as_ref()
    }

    /// Stops the run with an error, unless it is already stopped.
    pub(super) fn stop(&mut self, error: SettingError) {
        self.error.get_or_insert(error);
    }

    /// Time of the last step, in ns since the start.
    pub fn now_ns(&self) -> u64 {
        time_ns(self.steps_count)
    }

    /// Whole frames since the start.
    pub(super) fn frame(&self) -> u64 {
        self.steps_count / SUBSTEPS_COUNT
    }

    /// Steps since the start.
    pub(super) fn steps_count(&self) -> u64 {
        self.steps_count
    }

    /// The gel of a finger as seen by its camera, cell by cell, in its own frame: 0 left, 1 right.
    pub(super) fn show(&self, finger: usize, displacement: &mut [Displacement], pressure_mpa: &mut [f64]) {
        let gel = self.pads.finger(finger);
        let width = gel.settings().grid.width_cells;
        let mirrored = finger == 1 && self.symmetry() == Symmetry::Mirrored;
        for cell in 0..displacement.len() {
            let (row, column) = (cell / width, cell % width);
            let from = if mirrored { (displacement.len() / width - 1 - row) * width + column } else { cell };
            displacement[cell] = gel.displacement(from);
            pressure_mpa[cell] = gel.pressure_mpa()[from];
            if mirrored {
                displacement[cell].shift_mm.y = -displacement[cell].shift_mm.y;
            }
        }
    }

    fn step(&mut self, hand: HandState) -> Result<(), SettingError> {
        let step_s = self.pads.settings().substep_s;
        let gone = self.held.is_gone();
        let hand = if gone { HandState { force_n: 0.0, ..hand } } else { hand };
        let before = self.pads.truth().pose;
        let input =
            if gone { ContactInput::guided(before) } else { self.held.contact_input(self.pads.truth(), hand, step_s) };
        let ContactInput { drive, pose, roll_mm, wrench } = input;
        self.pads.step(drive, &Command { grip: Grip::ForceN(hand.force_n), pose, roll_mm, wrench })?;
        self.steps_count += 1;
        self.now = hand;
        self.update_truth(before);
        if !gone {
            self.held.after_step(self.pads.truth(), hand, step_s, self.truth.slid_mm);
        }
        self.truth.set_object(self.held.truth());
        Ok(())
    }

    /// Updates the truth after a step.
    fn update_truth(&mut self, before: Pose) {
        let contact = *self.pads.truth();
        let each = self.pads.sliding(before);
        let sliding = match &self.pads {
            Pads::Alike(_) => each[0],
            Pads::Apart(_) => Sliding::of_both(each, self.pads.turn_rad()),
        };
        let truth = &mut self.truth;
        truth.time_ns = time_ns(self.steps_count);
        truth.angle_rad = self.now.angle_rad;
        truth.lowered_mm = self.now.lowered_mm;
        truth.grip_force_n = contact.grip_force_n;
        truth.pose = contact.pose;
        truth.contact_area_mm2 = contact.contact_area_mm2;
        truth.stick_ratio = contact.stick_ratio;
        truth.friction_used_fraction = contact.friction_used_fraction;
        truth.peak_pressure_mpa = contact.peak_pressure_mpa;
        truth.largest_strain_fraction = contact.largest_strain_fraction;
        let soft = self.pads.settings().soft_object;
        let object_strain = soft.map_or(0.0, |object| contact.peak_pressure_mpa / object.modulus_mpa);
        truth.beyond_linear = contact.beyond_linear || object_strain > LINEAR_STRAIN;
        truth.at_border = contact.at_border;
        truth.converged &= contact.converged;

        let to_object_mm = contact.pose.position_mm - sliding.map_or(contact.pose.position_mm, |s| s.middle_mm);
        let mirrored = self.held.symmetry() == Symmetry::Mirrored;
        truth.wrench = [0, 1].map(|finger| {
            let own = self.pads.finger(finger).truth();
            let force_n = own.wrench.force_n;
            let middle_mm = each[finger].map_or(own.pose.position_mm, |s| s.middle_mm);
            let torque_n_mm = own.wrench.torque_n_mm + (own.pose.position_mm - middle_mm).cross(force_n);
            if finger == 1 && mirrored {
                Wrench { force_n: Vec2::new(force_n.x, -force_n.y), torque_n_mm: -torque_n_mm }
            } else {
                Wrench { force_n, torque_n_mm }
            }
        });
        truth.pads = match &self.pads {
            Pads::Alike(_) => None,
            Pads::Apart(_) => Some([0, 1].map(|finger| PadTruth::of(self.pads.finger(finger).truth()))),
        };
        // Friction alone, compared with the friction bounds: pressure carries its own part of the load.
        truth.required_n = sliding.map_or(0.0, |s| {
            let by_force_n = contact.friction.force_n;
            let by_torque_n_mm = contact.friction.torque_n_mm + to_object_mm.cross(by_force_n);
            let used_n = libm::hypot(by_force_n.length(), by_torque_n_mm / s.arm_mm.max(f64::MIN_POSITIVE));
            contact.grip_force_n * used_n / s.most_n
        });
        let goes_on = truth.gross && contact.friction_used_fraction.is_some_and(|used| used >= STILL_SLIDES_FRACTION);
        truth.gross =
            (contact.slides_as_a_whole() || goes_on) && truth.required_n > LOADED_FRACTION * contact.grip_force_n;
        if truth.gross {
            truth.gross_steps_count += 1;
            truth.first_gross_ns.get_or_insert(truth.time_ns);
            truth.slid_mm += sliding.map_or(0.0, |s| s.way_mm);
        }
    }
}

/// Time at the end of a step, in ns.
pub(super) fn time_ns(steps_count: u64) -> u64 {
    (steps_count * 1_000_000_000 + STEPS_HZ / 2) / STEPS_HZ
}

impl Plant for HandWorld {
    fn width_mm(&self) -> Option<f64> {
        (!self.held.is_gone()).then_some(self.width_mm)
    }

    /// A force that is NaN or below 0 stops the run.
    fn press(&mut self, force_n: f64) {
        self.target.force_n = force_n;
    }

    fn place_wrist(&mut self, angle_rad: f64, lowered_mm: f64) {
        self.target.angle_rad = angle_rad;
        self.target.lowered_mm = lowered_mm;
    }

    /// In whole steps of 1/120 s; the remaining time is kept for the next call. The wrist moves to its target evenly
    /// over the steps of one call.
    fn advance_to(&mut self, now_ns: u64) {
        let mut left = 0;
        while time_ns(self.steps_count + left + 1) <= now_ns {
            left += 1;
        }
        while left > 0 && self.error.is_none() {
            let share = 1.0 / left as f64;
            let (now, to) = (self.now, self.target);
            let hand = HandState {
                angle_rad: now.angle_rad + (to.angle_rad - now.angle_rad) * share,
                lowered_mm: now.lowered_mm + (to.lowered_mm - now.lowered_mm) * share,
                force_n: to.force_n,
            };
            self.error = self.step(hand).err();
            left -= 1;
        }
    }
}
