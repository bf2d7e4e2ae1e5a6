//! Physics that a scene does not set.

use crate::contact::Friction;
use crate::layer::{Gel, SoftObject};

/// What gel, interface and object are made of; by default the standard gel, Coulomb friction and the object's own softness.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Physics {
    /// The gel.
    pub gel: Gel,
    /// Friction; None for Coulomb's with the coefficient of the trial.
    pub friction: Option<Friction>,
    /// Softness; None for the object's own.
    pub softness: Option<SoftObject>,
}
