//! The illumination of the untouched gel, separated from the sharper imprint of an object.

/// Rounds of the robust fit.
const ROUNDS_COUNT: usize = 12;
/// Scale of its weights (Geman-McClure): this many median residuals, and this much more, levels.
const SCALE_MEDIANS: f64 = 1.5;
const LEAST_SCALE_LEVELS: f64 = 0.5;

/// The rest image of a finger that is already touched: a smooth surface (a polynomial of degree 6) fitted robustly to
/// the cells. The imprint is sharper than illumination can be and counts as outliers.
pub(crate) fn illumination(cells: &mut [[f32; 3]], covered: &[bool], columns: usize) {
    let rows = cells.len() / columns;
    const DEGREE: usize = 6;
    const TERMS: usize = (DEGREE + 1) * (DEGREE + 2) / 2;
    let basis = |i: usize| {
        let x = 2.0 * (i % columns) as f64 / (columns - 1).max(1) as f64 - 1.0;
        let y = 2.0 * (i / columns) as f64 / (rows - 1).max(1) as f64 - 1.0;
        let mut out = [0.0; TERMS];
        let mut k = 0;
        for power in 0..=DEGREE {
            for across in 0..=power {
                out[k] = libm::pow(x, (power - across) as f64) * libm::pow(y, across as f64);
                k += 1;
            }
        }
        out
    };
    // Powers take longer than all sums over them, and are the same in every round.
    let basis: Vec<[f64; TERMS]> = (0..cells.len()).map(basis).collect();
    let mut weight: Vec<f64> = covered.iter().map(|&c| if c { 0.0 } else { 1.0 }).collect();
    let mut fitted = vec![[0.0f64; 3]; cells.len()];
    let mut residuals: Vec<f64> = Vec::with_capacity(cells.len());
    for _ in 0..ROUNDS_COUNT {
        let mut normal = [[0.0f64; TERMS + 3]; TERMS];
        for (i, colour) in cells.iter().enumerate().filter(|(i, _)| weight[*i] > 0.0) {
            let b = &basis[i];
            for r in 0..TERMS {
                let wb = weight[i] * b[r];
                for (c, value) in b.iter().enumerate() {
                    normal[r][c] += wb * value;
                }
                for (c, &value) in colour.iter().enumerate() {
                    normal[r][TERMS + c] += wb * f64::from(value);
                }
            }
        }
        let Some(terms) = solve(&mut normal) else { return };
        residuals.clear();
        for (i, out) in fitted.iter_mut().enumerate() {
            let b = &basis[i];
            *out = std::array::from_fn(|c| (0..TERMS).map(|k| b[k] * terms[k][c]).sum());
            let worst = (0..3).map(|c| (f64::from(cells[i][c]) - out[c]).abs()).fold(0.0, f64::max);
            residuals.push(worst);
        }
        let mut sorted = residuals.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let scale = SCALE_MEDIANS * sorted[sorted.len() / 2] + LEAST_SCALE_LEVELS;
        for (i, w) in weight.iter_mut().enumerate().filter(|(i, _)| !covered[*i]) {
            let t = residuals[i] / scale;
            *w = 1.0 / ((1.0 + t * t) * (1.0 + t * t));
        }
    }
    for (cell, fit) in cells.iter_mut().zip(&fitted) {
        *cell = fit.map(|v| v as f32);
    }
}

/// Gauss-Jordan elimination of N rows with three right-hand sides; None when the rows are dependent.
fn solve<const N: usize, const M: usize>(rows: &mut [[f64; M]; N]) -> Option<[[f64; 3]; N]> {
    for pivot in 0..N {
        let best = (pivot..N).max_by(|&a, &b| rows[a][pivot].abs().total_cmp(&rows[b][pivot].abs()))?;
        rows.swap(pivot, best);
        let lead = rows[pivot][pivot];
        if lead.abs() < 1e-12 {
            return None;
        }
        rows[pivot].iter_mut().for_each(|v| *v /= lead);
        let line = rows[pivot];
        for (_, row) in rows.iter_mut().enumerate().filter(|(i, _)| *i != pivot) {
            let factor = row[pivot];
            row.iter_mut().zip(&line).for_each(|(v, l)| *v -= factor * l);
        }
    }
    Some(std::array::from_fn(|r| std::array::from_fn(|c| rows[r][N + c])))
}

#[cfg(test)]
pub(in crate::monitor) mod tests {
    use super::*;

    pub const COLUMNS: usize = 40;
    pub const ROWS: usize = 30;

    /// Illumination of a gel of 40 x 30 cells: a polynomial of degree 3 in each colour.
    fn light(i: usize) -> [f32; 3] {
        let (x, y) = ((i % COLUMNS) as f32 / 20.0 - 1.0, (i / COLUMNS) as f32 / 15.0 - 1.0);
        [100.0 + 20.0 * x - 10.0 * x * y, 90.0 - 15.0 * y * y * y + 5.0 * x, 80.0 + 12.0 * x * x * y]
    }

    /// A gel under this light that nothing touches.
    pub fn cells() -> Vec<[f32; 3]> {
        (0..COLUMNS * ROWS).map(light).collect()
    }

    fn furthest_levels(cells: &[[f32; 3]]) -> f32 {
        let off = |(i, cell): (usize, &[f32; 3])| (0..3).map(|c| (cell[c] - light(i)[c]).abs()).fold(0.0, f32::max);
        cells.iter().enumerate().map(off).fold(0.0, f32::max)
    }

    /// An imprint around the middle: 30 levels brighter on one side, darker on the other.
    pub fn imprint(cells: &mut [[f32; 3]], radius_cells: f32) {
        for (i, cell) in cells.iter_mut().enumerate() {
            let (x, y) = ((i % COLUMNS) as f32 - 19.5, (i / COLUMNS) as f32 - 14.5);
            if x.hypot(y) < radius_cells {
                let sign = if x > 0.0 { 30.0 } else { -30.0 };
                *cell = cell.map(|levels| levels + sign);
            }
        }
    }

    #[test]
    fn light_is_found_again_under_an_imprint_and_under_markers() {
        let seen = vec![false; COLUMNS * ROWS];
        let mut bare = cells();
        illumination(&mut bare, &seen, COLUMNS);
        assert!(furthest_levels(&bare) < 1e-3, "{}", furthest_levels(&bare));

        let mut touched = cells();
        imprint(&mut touched, 6.0);
        illumination(&mut touched, &seen, COLUMNS);
        assert!(furthest_levels(&touched) < 0.5, "{} levels of 30 are left", furthest_levels(&touched));

        // Covered cells, black here, do not count and are filled in.
        let covered: Vec<bool> = (0..COLUMNS * ROWS).map(|i| i.is_multiple_of(7)).collect();
        let mut marked = cells();
        marked.iter_mut().zip(&covered).filter(|(_, covered)| **covered).for_each(|(cell, _)| *cell = [0.0; 3]);
        illumination(&mut marked, &covered, COLUMNS);
        assert!(furthest_levels(&marked) < 1e-3, "{}", furthest_levels(&marked));

        // Where all cells are covered, the image stays unchanged.
        let mut hidden = cells();
        imprint(&mut hidden, 6.0);
        let before = hidden.clone();
        illumination(&mut hidden, &vec![true; COLUMNS * ROWS], COLUMNS);
        assert_eq!(hidden, before);
    }
}
