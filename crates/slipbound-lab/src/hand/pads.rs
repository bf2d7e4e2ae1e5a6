//! The two pads and the object between them: identical, so that one represents both, or computed separately.

use super::scene::HandScene;
use crate::contact::{Body, Command, Drive, Finger, FingerPair, FingerSettings, Pose, Truth};
use crate::plants::{FINGERS_COUNT, Symmetry};
use crate::world::Sliding;
use slipbound::setting::SettingError;

/// The contact of both fingers. Both are computed in axes in which they would be equal if both were identical: those of
/// the left finger.
#[derive(Debug)]
pub(super) enum Pads {
    /// The right pad and its load equal those of the left one: one contact is computed.
    Alike(Box<Finger>),
    /// They differ in friction, stiffness or mounting.
    Apart(Box<FingerPair>),
}

impl Pads {
    /// The pads of a scene. Refuses invalid settings of the contact.
    pub fn new(scene: &HandScene, symmetry: Symmetry) -> Result<Self, SettingError> {
        let (settings, surface) = scene.contact()?;
        Ok(match scene.right_pad() {
            None => Pads::Alike(Box::new(Finger::new(settings, surface)?)),
            Some(right) => {
                // In its own frame the right finger is the mirror image, so a rotation has the opposite sign.
                let turn_rad = if symmetry == Symmetry::Mirrored { -right.turn_rad } else { right.turn_rad };
                let pair = FingerPair::new([settings, right.of(settings)], turn_rad, surface)?;
                Pads::Apart(Box::new(pair))
            }
        })
    }

    /// A finger: 0 left, 1 right.
    pub fn finger(&self, finger: usize) -> &Finger {
        match self {
            Pads::Alike(both) => both,
            Pads::Apart(pair) => pair.finger(finger),
        }
    }

    /// The settings of the left finger.
    pub fn settings(&self) -> &FingerSettings {
        self.finger(0).settings()
    }

    /// Ground truth of both, in the form of one of two identical fingers.
    pub fn truth(&self) -> &Truth {
        match self {
            Pads::Alike(both) => both.truth(),
            Pads::Apart(pair) => pair.truth(),
        }
    }

    /// One step of both.
    pub fn step(&mut self, drive: Drive, command: &Command) -> Result<(), SettingError> {
        let body = Body { drive, fingers_count: FINGERS_COUNT };
        match self {
            Pads::Alike(both) => {
                both.set_body(body)?;
                both.step(command)?;
            }
            Pads::Apart(pair) => {
                pair.set_body(body)?;
                pair.step(command)?;
            }
        }
        Ok(())
    }

    /// How the object slid over each finger since it was at `before`, each in its own axes.
    pub fn sliding(&self, before: Pose) -> [Option<Sliding>; 2] {
        match self {
            Pads::Alike(both) => [Sliding::since(both, before); 2],
            Pads::Apart(pair) => {
                let own = |finger: usize, before| Sliding::since(pair.finger(finger), before);
                [own(0, before), own(1, before.seen_turned(pair.turn_rad()))]
            }
        }
    }

    /// Rotation of the right pad relative to the left one, in rad.
    pub fn turn_rad(&self) -> f64 {
        match self {
            Pads::Alike(_) => 0.0,
            Pads::Apart(pair) => pair.turn_rad(),
        }
    }
}
