//! What an object is made of, and its surface.

use super::form::Form;
use super::relief::Relief;
use crate::contact::shape::{Shape, Slope, slope_by_differences};
use crate::layer::{SoftObject, above_zero};
use serde::Serialize;
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// An object to be held.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Object {
    /// Its name in scenes.
    pub name: &'static str,
    /// The part that faces the pad, without its relief.
    pub form: Form,
    /// What is cut into the form.
    pub relief: Relief,
    /// Softness; None if it is rigid compared with the gel.
    pub softness: Option<SoftObject>,
    /// Friction coefficient on the gel, unless a scene sets one.
    pub mu: f64,
    /// Mass in kg; for the bottle, empty.
    pub mass_kg: f64,
    /// Radius of gyration about the point that is held, in mm.
    pub gyration_radius_mm: f64,
    /// Appearance of its surface.
    pub texture: &'static str,
    /// Known limits of the description.
    pub note: &'static str,
}

impl Object {
    /// Its surface, for the contact.
    pub fn surface(&self) -> ObjectSurface {
        ObjectSurface { form: self.form, relief: self.relief }
    }
}

/// A form with its relief as one height field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectSurface {
    /// Without the relief.
    pub form: Form,
    /// What is cut into it.
    pub relief: Relief,
}

impl Shape for ObjectSurface {
    fn gap_mm(&self, from_centre: Vec2, on_skin: Vec2) -> f64 {
        let gap_mm = self.form.shape().gap_mm(from_centre, on_skin);
        if gap_mm.is_finite() {
            gap_mm + self.relief.depth_at_mm(self.form.unrolled_mm(from_centre, on_skin))
        } else {
            gap_mm
        }
    }

    fn slope(&self, from_centre: Vec2, on_skin: Vec2) -> Slope {
        if self.relief.pushes_sideways() {
            slope_by_differences(self, from_centre, on_skin)
        } else {
            self.form.shape().slope(from_centre, on_skin)
        }
    }

    fn half_size_mm(&self) -> Vec2 {
        self.form.shape().half_size_mm()
    }

    fn check(&self) -> Result<(), SettingError> {
        self.form.shape().check()?;
        for (key, value) in self.relief.lengths_mm() {
            above_zero(key, value)?;
        }
        Ok(())
    }
}
