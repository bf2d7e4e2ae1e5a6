//! Motion of the imprint over the gel: its pattern is registered against a key frame, for small motions only.
//!
//! ```text
//!   now - key  =  - gradient . (shift + turn x arm)      least squares over all cells; new key after a small shift
//! ```

use super::pattern::Pattern;
use super::planes::{Planes, sum_of};
use crate::pixels::wide::wide;
use crate::plane::Vec2;

/// The key frame is replaced when the imprint has moved this far against it, in pitches: beyond, the pattern is no
/// longer linear between two cells.
const KEY_PITCH: f64 = 0.15;

/// It is also replaced when the pattern has changed by more than this: too little is left in common to register it.
const KEY_CHANGE: f64 = 0.4;

/// Ridge on each unknown, relative to the strongest: a motion that the pattern does not show (along a straight edge)
/// stays zero instead of arbitrary.
const RIDGE: f64 = 0.02;

/// Motion of the imprint over the gel since the reference.
#[derive(Debug, Clone)]
pub(super) struct Slide {
    key: Planes,
    sums: RowSums,
    key_shift_px: Vec2,
    key_turn_rad: f64,
    key_px: f64,
    pub(super) shift_px: Vec2,
    pub(super) turn_rad: f64,
    /// Mean arm of the rotation, px.
    pub(super) arm_px: f64,
}

impl Slide {
    pub(super) fn new(pattern: &Pattern, pitch_px: f64) -> Self {
        Slide {
            key: pattern.now.clone(),
            sums: RowSums::new(pattern.columns()),
            key_shift_px: Vec2::ZERO,
            key_turn_rad: 0.0,
            key_px: KEY_PITCH * pitch_px,
            shift_px: Vec2::ZERO,
            turn_rad: 0.0,
            arm_px: pitch_px,
        }
    }

    /// Starts from the current pattern.
    pub(super) fn restart(&mut self, pattern: &Pattern) {
        (self.shift_px, self.turn_rad) = (Vec2::ZERO, 0.0);
        self.take_key(pattern);
    }

    fn take_key(&mut self, pattern: &Pattern) {
        self.key.copy_from(&pattern.now);
        (self.key_shift_px, self.key_turn_rad) = (self.shift_px, self.turn_rad);
    }

    /// Adds the pattern of the next frame.
    pub(super) fn take(&mut self, pattern: &Pattern) {
        let Some((shift_px, turn_rad, arm_px)) = self.against_key(pattern) else { return };
        self.arm_px = arm_px;
        self.shift_px = self.key_shift_px + shift_px;
        self.turn_rad = self.key_turn_rad + turn_rad;
        let far = shift_px.length().max(turn_rad.abs() * arm_px) > self.key_px;
        if far || pattern.now.change(&self.key).is_some_and(|change| change > KEY_CHANGE) {
            self.take_key(pattern);
        }
    }

    /// Shift in px and rotation of the pattern against the key, and the mean arm of the cells that it is found from.
    fn against_key(&mut self, pattern: &Pattern) -> Option<(Vec2, f64, f64)> {
        let sums = self.sums.over(&pattern.now, &self.key);
        let weight = sums.xx + sums.yy;
        if weight <= 0.0 {
            return None;
        }
        // The rotation is about the middle of the visible pattern; its unknown is multiplied by the arm: a length like
        // the shift.
        let centre = sums.at / weight;
        let arm = (sums.at_squared / weight - centre.length_squared()).max(1.0).sqrt();
        let middle = centre.turned();
        let turn_x = (sums.xt - middle.x * sums.xx - middle.y * sums.xy) / arm;
        let turn_y = (sums.yt - middle.x * sums.xy - middle.y * sums.yy) / arm;
        let turn_turn =
            (sums.tt - middle.x * (sums.xt + arm * turn_x) - middle.y * (sums.yt + arm * turn_y)) / (arm * arm);
        let turn_step = (sums.ts - middle.x * sums.xs - middle.y * sums.ys) / arm;
        let mut a = [[sums.xx, sums.xy, turn_x], [sums.xy, sums.yy, turn_y], [turn_x, turn_y, turn_turn]];
        let strongest = a[0][0].max(a[1][1]).max(a[2][2]);
        (0..3).for_each(|i| a[i][i] += RIDGE * strongest);
        let [x, y, turn] = solve(a, [-sums.xs, -sums.ys, -turn_step])?;
        let cell_px = pattern.cell_px() as f64;
        Some((Vec2::new(x, y) * cell_px, turn / arm, arm * cell_px))
    }
}

/// Sums over all cells seen, with their neighbours, in both patterns: of the slope (x, y) of their mean, of its moment
/// t = slope . (position turned by 90 degrees), and of the step s from key to now. Lengths in cells; positions from the
/// middle.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    xx: f64,
    xy: f64,
    yy: f64,
    xt: f64,
    yt: f64,
    tt: f64,
    xs: f64,
    ys: f64,
    ts: f64,
    /// Position, weighted by the square of the slope.
    at: Vec2,
    at_squared: f64,
}

/// Scratch of one row of cells.
#[derive(Debug, Clone)]
struct RowSums {
    /// Column from the middle.
    column: Vec<f32>,
    /// 1 where both patterns have the cell and its neighbours.
    whole: Vec<f32>,
    x: Vec<f32>,
    y: Vec<f32>,
    step: Vec<f32>,
    /// Slope along y times column, and column times the square of the slope.
    y_column: Vec<f32>,
    weight_column: Vec<f32>,
}

impl RowSums {
    fn new(columns: usize) -> Self {
        let inner = columns.saturating_sub(2);
        let zeros = vec![0.0; inner];
        let middle = (columns as f32 - 1.0) / 2.0;
        RowSums {
            column: (0..inner).map(|i| (i + 1) as f32 - middle).collect(),
            whole: zeros.clone(),
            x: zeros.clone(),
            y: zeros.clone(),
            step: zeros.clone(),
            y_column: zeros.clone(),
            weight_column: zeros,
        }
    }

    fn over(&mut self, now: &Planes, key: &Planes) -> Sums {
        let mut sums = Sums::default();
        let inner = self.column.len();
        let columns = inner + 2;
        let rows = now.seen.len() / columns;
        let middle_row = (rows as f64 - 1.0) / 2.0;
        for row in 1..rows.saturating_sub(1) {
            // The cell itself, its left, right, upper and lower neighbour.
            let starts = [0, -1, 1, -(columns as isize), columns as isize]
                .map(|away| (row * columns + 1).wrapping_add_signed(away));
            let lines = |plane| neighbours(plane, starts, inner);
            seen_by_both(lines(&now.seen), lines(&key.seen), &mut self.whole);
            let from_middle = row as f64 - middle_row;
            for (now, key) in now.shades.iter().zip(&key.shades) {
                self.slopes(lines(now), lines(key));
                sums.add(self, from_middle);
            }
        }
        sums
    }

    fn slopes(&mut self, now: [&[f32]; 5], key: [&[f32]; 5]) {
        slopes(now, key, &self.whole, &mut self.x, &mut self.y, &mut self.step);
        let weighed = (&mut self.y_column[..], &mut self.weight_column[..]);
        moments(&self.x, &self.y, &self.column, weighed.0, weighed.1);
    }
}

wide! {
    /// 1 where both patterns have a cell and its four neighbours.
    fn seen_by_both(now: [&[f32]; 5], key: [&[f32]; 5], whole: &mut [f32]) {
        let n = whole.len();
        let (now, key) = (now.map(|line| &line[..n]), key.map(|line| &line[..n]));
        for i in 0..n {
            let mut all = 1.0;
            for line in now {
                all *= line[i];
            }
            for line in key {
                all *= line[i];
            }
            whole[i] = all;
        }
    }

    /// Slopes of the mean of both, and the step from one to the other. Lines: the cells, left, right, above, below.
    fn slopes(now: [&[f32]; 5], key: [&[f32]; 5], whole: &[f32], x: &mut [f32], y: &mut [f32], step: &mut [f32]) {
        let n = whole.len();
        let (now, key) = (now.map(|line| &line[..n]), key.map(|line| &line[..n]));
        let (x, y, step) = (&mut x[..n], &mut y[..n], &mut step[..n]);
        for i in 0..n {
            let sum = |side: usize| now[side][i] + key[side][i];
            x[i] = 0.25 * whole[i] * (sum(2) - sum(1));
            y[i] = 0.25 * whole[i] * (sum(4) - sum(3));
            step[i] = whole[i] * (now[0][i] - key[0][i]);
        }
    }

    fn moments(x: &[f32], y: &[f32], column: &[f32], y_column: &mut [f32], weight_column: &mut [f32]) {
        let n = column.len();
        let (x, y, y_column, weight_column) = (&x[..n], &y[..n], &mut y_column[..n], &mut weight_column[..n]);
        for i in 0..n {
            y_column[i] = y[i] * column[i];
            weight_column[i] = (x[i] * x[i] + y[i] * y[i]) * column[i];
        }
    }

    /// The sums of a row: x x, x y, y y; x and y with y times column; that squared; x, y and y times column with the
    /// step; of the weight times column alone and with the column.
    fn sums_of_row(of: &RowSums) -> [f64; 11] {
        let dot = |a: &[f32], b: &[f32]| sum_of(a, b, |a, b| a * b);
        [
            dot(&of.x, &of.x), dot(&of.x, &of.y), dot(&of.y, &of.y),
            dot(&of.x, &of.y_column), dot(&of.y, &of.y_column), dot(&of.y_column, &of.y_column),
            dot(&of.x, &of.step), dot(&of.y, &of.step), dot(&of.y_column, &of.step),
            sum_of(&of.weight_column, &of.weight_column, |weight, _| weight), dot(&of.weight_column, &of.column),
        ]
    }
}

/// Slices of a plane of this length.
fn neighbours(plane: &[f32], starts: [usize; 5], length: usize) -> [&[f32]; 5] {
    starts.map(|start| &plane[start..start + length])
}

impl Sums {
    /// Adds a row, `row` cells below the middle.
    fn add(&mut self, of: &RowSums, row: f64) {
        // t = y column - x row.
        let [xx, xy, yy, xc, yc, cc, xs, ys, cs, weight_column, weight_column_squared] = sums_of_row(of);
        self.xx += xx;
        self.xy += xy;
        self.yy += yy;
        self.xt += xc - row * xx;
        self.yt += yc - row * xy;
        self.tt += cc - 2.0 * row * xc + row * row * xx;
        self.xs += xs;
        self.ys += ys;
        self.ts += cs - row * xs;
        let weight = xx + yy;
        self.at += Vec2::new(weight_column, weight * row);
        self.at_squared += weight_column_squared + weight * row * row;
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
