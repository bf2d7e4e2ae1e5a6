//! The rank-three part of the tangential problem: the rigid displacement of a body, in three numbers.

use super::product::dot;
use crate::contact::body::{Motion, Resistance, inverse};
use num_complex::Complex64;

/// B^T P B over the cells: the load that a rigid motion produces, with P = 1 for a cell that is free to follow and less
/// for one that slides.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Spread {
    xx: f64,
    xy: f64,
    yy: f64,
    x_turn: f64,
    y_turn: f64,
    turn_turn: f64,
}

impl Spread {
    /// A cell that follows in both directions.
    #[inline(always)]
    pub fn add_free(&mut self, lever: Complex64) {
        self.xx += 1.0;
        self.yy += 1.0;
        self.x_turn -= lever.im;
        self.y_turn += lever.re;
        self.turn_turn += lever.norm_sqr();
    }

    /// A cell that follows by a share along one direction: it slides, and only the direction of its traction changes.
    #[inline(always)]
    pub fn add_sliding(&mut self, along: Complex64, share: f64, lever: Complex64) {
        let turn = lever.re * along.im - lever.im * along.re;
        self.xx += share * along.re * along.re;
        self.xy += share * along.re * along.im;
        self.yy += share * along.im * along.im;
        self.x_turn += share * along.re * turn;
        self.y_turn += share * along.im * turn;
        self.turn_turn += share * turn * turn;
    }

    /// Solves (1 + length S W) y = load.
    pub fn settle(&self, resistance: Resistance, length: f64, load: Motion) -> Motion {
        let one = |x, y, turn| resistance.retreat(Motion { shift: Complex64::new(x, y), turn });
        let columns = [one(1.0, 0.0, 0.0), one(0.0, 1.0, 0.0), one(0.0, 0.0, 1.0)].map(|motion| {
            let (x, y, turn) = (motion.shift.re, motion.shift.im, motion.turn);
            [
                self.xx * x + self.xy * y + self.x_turn * turn,
                self.xy * x + self.yy * y + self.y_turn * turn,
                self.x_turn * x + self.y_turn * y + self.turn_turn * turn,
            ]
        });
        let matrix = std::array::from_fn(|row| {
            std::array::from_fn(|column| f64::from(u8::from(row == column)) + length * columns[column][row])
        });
        let row = |r: [f64; 3]| r[0] * load.shift.re + r[1] * load.shift.im + r[2] * load.turn;
        let [x, y, turn] = inverse(&matrix).map(row);
        Motion { shift: Complex64::new(x, y), turn }
    }
}

/// Work of a load along a motion.
pub(super) fn work(load: Motion, motion: Motion) -> f64 {
    dot(load.shift, motion.shift) + load.turn * motion.turn
}

/// a + b t
pub(super) fn added(a: Motion, b: Motion, t: f64) -> Motion {
    Motion { shift: a.shift + b.shift * t, turn: a.turn + b.turn * t }
}
