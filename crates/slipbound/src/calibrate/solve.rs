//! Symmetric positive definite systems of a few dozen unknowns.

/// Normal equations, summed row by row.
#[derive(Debug, Clone)]
pub(super) struct Normal {
    n: usize,
    a: Vec<f64>,
    b: Vec<f64>,
}

impl Normal {
    pub fn new(n: usize) -> Self {
        Normal { n, a: vec![0.0; n * n], b: vec![0.0; n] }
    }

    /// Adds the equation `row . x = value` with a weight.
    pub fn add(&mut self, row: &[f64], value: f64, weight: f64) {
        for (i, &r) in row.iter().enumerate() {
            if r != 0.0 {
                let wr = weight * r;
                for (a, &s) in self.a[i * self.n..][..=i].iter_mut().zip(row) {
                    *a += wr * s;
                }
                self.b[i] += wr * value;
            }
        }
    }

    /// Solves for x, with every diagonal entry raised by `damping` of itself. None when the system is singular.
    pub fn solve(&self, damping: f64) -> Option<Vec<f64>> {
        let n = self.n;
        let mut l = self.a.clone();
        for i in 0..n {
            l[i * n + i] *= 1.0 + damping;
            let diagonal = l[i * n + i];
            for j in 0..=i {
                let (before, here) = l.split_at_mut(i * n);
                let other = if j < i { &before[j * n..][..j] } else { &here[..0] };
                let dot: f64 = match j < i {
                    true => here[..j].iter().zip(other).map(|(a, b)| a * b).sum(),
                    false => here[..j].iter().map(|a| a * a).sum(),
                };
                if j < i {
                    here[j] = (here[j] - dot) / before[j * n + j];
                } else {
                    let left = here[j] - dot;
                    if left.is_nan() || left <= 1e-13 * diagonal {
                        return None;
                    }
                    here[j] = left.sqrt();
                }
            }
        }
        let mut x = self.b.clone();
        for i in 0..n {
            let dot: f64 = (0..i).map(|j| l[i * n + j] * x[j]).sum();
            x[i] = (x[i] - dot) / l[i * n + i];
        }
        for i in (0..n).rev() {
            let dot: f64 = (i + 1..n).map(|j| l[j * n + i] * x[j]).sum();
            x[i] = (x[i] - dot) / l[i * n + i];
        }
        Some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_solvable_system_is_solved_and_a_singular_one_refused() {
        let truth = [2.0, -1.0, 0.5];
        let rows = [[1.0, 2.0, 0.0], [0.0, 1.0, -3.0], [4.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
        let mut normal = Normal::new(3);
        for row in &rows {
            normal.add(row, row.iter().zip(&truth).map(|(a, x)| a * x).sum(), 2.0);
        }
        let x = normal.solve(0.0).expect("regular");
        assert!(x.iter().zip(&truth).all(|(a, b)| (a - b).abs() < 1e-9), "{x:?}");
        let mut flat = Normal::new(2);
        flat.add(&[1.0, 2.0], 1.0, 1.0);
        flat.add(&[2.0, 4.0], 2.0, 1.0);
        assert_eq!(flat.solve(0.0), None);
    }
}
