//! How far the imprint has moved over the gel: its pattern registered against a key frame, small motions only.
//!
//! ```text
//!   now - key  =  - gradient . (shift + turn x arm)      least squares over all cells; key taken anew after a small shift
//! ```

use super::pattern::{Pattern, Seen};
use crate::plane::Vec2;

/// The key frame is taken anew when the imprint has moved this far against it, in pitches: beyond, the pattern is no
/// longer a straight line between two cells.
const KEY_PITCH: f64 = 0.15;

/// The same when the pattern has changed by more than this: what is left in common no longer says where it went.
const KEY_CHANGE: f64 = 0.4;

/// Least weight of each unknown against the strongest, so that what a pattern does not show (along a straight edge)
/// stays zero instead of anything.
const RIDGE: f64 = 0.02;

/// Motion of the imprint over the gel since the reference.
#[derive(Debug, Clone)]
pub(super) struct Slide {
    key: Vec<Seen>,
    key_shift_px: Vec2,
    key_turn_rad: f64,
    key_px: f64,
    pub(super) shift_px: Vec2,
    pub(super) turn_rad: f64,
    /// Mean arm about which a turn was seen, px.
    pub(super) arm_px: f64,
}

impl Slide {
    pub(super) fn new(pattern: &Pattern, pitch_px: f64) -> Self {
        Slide {
            key: pattern.now.clone(),
            key_shift_px: Vec2::ZERO,
            key_turn_rad: 0.0,
            key_px: KEY_PITCH * pitch_px,
            shift_px: Vec2::ZERO,
            turn_rad: 0.0,
            arm_px: pitch_px,
        }
    }

    /// Counts from the pattern as it is now.
    pub(super) fn restart(&mut self, pattern: &Pattern) {
        (self.shift_px, self.turn_rad) = (Vec2::ZERO, 0.0);
        self.take_key(pattern);
    }

    fn take_key(&mut self, pattern: &Pattern) {
        self.key.copy_from_slice(&pattern.now);
        (self.key_shift_px, self.key_turn_rad) = (self.shift_px, self.turn_rad);
    }

    /// Takes the pattern of the next frame.
    pub(super) fn take(&mut self, pattern: &Pattern) {
        let Some((shift_px, turn_rad, arm_px)) = self.against_key(pattern) else { return };
        self.arm_px = arm_px;
        self.shift_px = self.key_shift_px + shift_px;
        self.turn_rad = self.key_turn_rad + turn_rad;
        let far = shift_px.length().max(turn_rad.abs() * arm_px) > self.key_px;
        if far || pattern.change(&self.key).is_some_and(|change| change > KEY_CHANGE) {
            self.take_key(pattern);
        }
    }

    /// Shift in px and turn of the pattern against the key, and the mean arm of what it was found by.
    fn against_key(&self, pattern: &Pattern) -> Option<(Vec2, f64, f64)> {
        let columns = pattern.columns();
        let (now, key) = (&pattern.now, &self.key);
        let (mut centre, mut arm, mut energy) = (Vec2::ZERO, 0.0, 0.0);
        each(now, key, columns, |at, slope, _| {
            let weight = slope.iter().map(|g| g.length_squared()).sum::<f64>();
            centre += at * weight;
            energy += weight;
        });
        if energy <= 0.0 {
            return None;
        }
        centre = centre / energy;
        each(now, key, columns, |at, slope, _| {
            arm += (at - centre).length_squared() * slope.iter().map(|g| g.length_squared()).sum::<f64>();
        });
        let arm = (arm / energy).sqrt().max(1.0);
        // Unknowns: shift along x and y in cells, turn times arm.
        let (mut a, mut b) = ([[0.0f64; 3]; 3], [0.0f64; 3]);
        each(now, key, columns, |at, slope, step| {
            let across = (at - centre).turned() / arm;
            for k in 0..2 {
                let row = [slope[k].x, slope[k].y, slope[k].dot(across)];
                for i in 0..3 {
                    b[i] -= row[i] * step[k];
                    for j in 0..3 {
                        a[i][j] += row[i] * row[j];
                    }
                }
            }
        });
        let strongest = a[0][0].max(a[1][1]).max(a[2][2]);
        (0..3).for_each(|i| a[i][i] += RIDGE * strongest);
        let [x, y, turn] = solve(a, b)?;
        let cell_px = pattern.cell_px() as f64;
        Some((Vec2::new(x, y) * cell_px, turn / arm, arm * cell_px))
    }
}

/// Calls for every cell that both patterns see with its neighbours: its place in cells, the slope of their mean for both
/// shades, and the step from key to now.
fn each(now: &[Seen], key: &[Seen], columns: usize, mut with: impl FnMut(Vec2, [Vec2; 2], [f64; 2])) {
    let rows = now.len() / columns;
    let seen = |i: usize| now[i][2] * key[i][2] > 0.0;
    for row in 1..rows.saturating_sub(1) {
        for column in 1..columns.saturating_sub(1) {
            let i = row * columns + column;
            if !(seen(i) && seen(i - 1) && seen(i + 1) && seen(i - columns) && seen(i + columns)) {
                continue;
            }
            let sum = |j: usize, k: usize| f64::from(now[j][k] + key[j][k]);
            let slope = std::array::from_fn(|k| {
                Vec2::new(sum(i + 1, k) - sum(i - 1, k), sum(i + columns, k) - sum(i - columns, k)) / 4.0
            });
            let step = std::array::from_fn(|k| f64::from(now[i][k] - key[i][k]));
            with(Vec2::new(column as f64, row as f64), slope, step);
        }
    }
}

/// Solves a symmetric 3 x 3 system by cofactors; None when it is singular.
fn solve(a: [[f64; 3]; 3], b: [f64; 3]) -> Option<[f64; 3]> {
    let minor = |i: usize, j: usize| {
        let (r, c) = ([(i + 1) % 3, (i + 2) % 3], [(j + 1) % 3, (j + 2) % 3]);
        a[r[0]][c[0]] * a[r[1]][c[1]] - a[r[0]][c[1]] * a[r[1]][c[0]]
    };
    let determinant: f64 = (0..3).map(|j| a[0][j] * minor(0, j)).sum();
    (determinant.abs() > f64::MIN_POSITIVE)
        .then(|| std::array::from_fn(|i| (0..3).map(|j| minor(j, i) * b[j]).sum::<f64>() / determinant))
}
