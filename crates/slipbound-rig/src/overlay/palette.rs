//! The colours of everything that is drawn: those of the paper, except that the rigid motion is light blue: on the green
//! contact, red is hard to see for the red-green blind.

use super::canvas::Colour;

pub(super) const CONTACT: Colour = Colour::new(38, 208, 92);
pub(super) const INNER: Colour = Colour::new(255, 255, 255);
pub(super) const MEASURED: Colour = Colour::new(255, 222, 0);
pub(super) const RIGID: Colour = Colour::new(86, 180, 233);
pub(super) const SLIP: Colour = Colour::new(0, 0, 0);
pub(super) const SLIPPING: Colour = Colour::new(150, 30, 200);
pub(super) const GROSS: Colour = Colour::new(216, 22, 30);
pub(super) const LOST: Colour = Colour::new(205, 210, 216);
pub(super) const PAPER: Colour = Colour::new(255, 255, 255);
pub(super) const BACKGROUND: Colour = Colour::new(22, 25, 30);
