//! A rigid block: the simplest object to hold.

use slipbound::plant::Plant;

/// A rigid block, or nothing. Once the fingers carry it, it falls when they press with less than `least_n`. Records
/// forces and motions.
#[derive(Debug, Clone, Default)]
pub struct Block {
    /// Width, mm; None: there is no block, or it has fallen.
    pub width_mm: Option<f64>,
    /// Least force that carries it, N per finger: its weight over twice the friction coefficient.
    pub least_n: f64,
    /// Whether the fingers carry it.
    pub is_carried: bool,
    /// Force on it, N per finger.
    pub force_n: f64,
    /// Angle of the wrist, rad.
    pub angle_rad: f64,
    /// Distance lowered, mm.
    pub lowered_mm: f64,
    /// Present time, ns.
    pub now_ns: u64,
}

impl Block {
    /// A block of this width, mm, without weight.
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
        let is_carried = self.width_mm.is_some() && force_n > 0.0 && force_n >= self.least_n;
        if self.is_carried && !is_carried {
            self.width_mm = self.width_mm.filter(|_| self.least_n == 0.0);
        }
        self.is_carried = is_carried;
    }

    fn place_wrist(&mut self, angle_rad: f64, lowered_mm: f64) {
        (self.angle_rad, self.lowered_mm) = (angle_rad, lowered_mm);
    }

    fn advance_to(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }
}
