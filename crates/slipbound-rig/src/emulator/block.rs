//! A block of wood: the simplest thing to hold.

use slipbound::port::Plant;

/// A rigid block that stays where it is, or nothing. Keeps what was done to it.
#[derive(Debug, Clone, Default)]
pub struct Block {
    /// Width, mm; None: nothing is there.
    pub width_mm: Option<f64>,
    /// Force it is pressed with, N per finger.
    pub force_n: f64,
    /// Angle of the wrist, rad.
    pub angle_rad: f64,
    /// Distance lowered, mm.
    pub lowered_mm: f64,
    /// Time it has been told, ns.
    pub now_ns: u64,
}

impl Block {
    /// A block of this width, mm.
    pub fn new(width_mm: f64) -> Self {
        Block { width_mm: Some(width_mm), ..Block::default() }
    }
}

impl Plant for Block {
    fn width_mm(&self) -> Option<f64> {
        self.width_mm
    }

    fn press(&mut self, force_n: f64) {
        self.force_n = force_n;
    }

    fn place_wrist(&mut self, angle_rad: f64, lowered_mm: f64) {
        (self.angle_rad, self.lowered_mm) = (angle_rad, lowered_mm);
    }

    fn advance_to(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }
}
