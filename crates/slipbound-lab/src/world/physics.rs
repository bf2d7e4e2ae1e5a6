//! Physics that a scene does not set.

use crate::contact::Friction;
use crate::layer::{Gel, SoftObject};
use crate::objects::Object;

/// Materials of gel, interface and object; by default the standard gel, Coulomb friction, and the trial's object with
/// its own softness.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Physics {
    /// The gel.
    pub gel: Gel,
    /// Friction; None for Coulomb's with the coefficient of the trial.
    pub friction: Option<Friction>,
    /// The held object; None for the trial's object.
    pub object: Option<Object>,
    /// Softness; None for the object's own.
    pub softness: Option<SoftObject>,
}
