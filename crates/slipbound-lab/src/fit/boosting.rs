//! Gradient boosting of regression trees of depth 3 with two outputs, squared error, splits between quantiles.

use super::row::Row;
use slipbound::monitor::FEATURES_COUNT;
use std::fmt::Write;

const SPLITS: usize = 7;
const LEAVES: usize = 8;
/// Splits tried of a feature, at most.
const BINS: usize = 64;

/// How an ensemble is fitted.
#[derive(Debug, Clone, Copy)]
pub struct Fitting {
    /// Number of trees.
    pub trees_count: usize,
    /// Share of what a leaf would say that it says.
    pub shrinkage: f64,
    /// Least weight of the rows in a leaf.
    pub least_rows: f64,
    /// Weight of imagined rows with no residual in every leaf.
    pub ridge: f64,
}

#[derive(Debug, Clone, PartialEq)]
struct Tree {
    features: [usize; SPLITS],
    thresholds: [f32; SPLITS],
    leaves: [[f32; 2]; LEAVES],
}

/// Trees whose leaves add up.
#[derive(Debug, Clone, PartialEq)]
pub struct Ensemble {
    base: [f32; 2],
    trees: Vec<Tree>,
}

/// Weight and weighted residuals of some rows.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    weight: f64,
    residuals: [f64; 2],
}

impl Sums {
    fn add(&mut self, other: &Sums) {
        self.weight += other.weight;
        self.residuals[0] += other.residuals[0];
        self.residuals[1] += other.residuals[1];
    }

    fn less(&self, other: &Sums) -> Sums {
        Sums {
            weight: self.weight - other.weight,
            residuals: [self.residuals[0] - other.residuals[0], self.residuals[1] - other.residuals[1]],
        }
    }

    /// By how much a leaf of these rows lowers the squared error.
    fn gain(&self, ridge: f64) -> f64 {
        (self.residuals[0] * self.residuals[0] + self.residuals[1] * self.residuals[1]) / (self.weight + ridge)
    }
}

impl Ensemble {
    /// Fits to rows.
    pub fn fit(rows: &[Row], targets: impl Fn(&Row) -> [f64; 2], how: &Fitting) -> Ensemble {
        let weight: f64 = rows.iter().map(|row| row.weight).sum();
        let mean = |n: usize| rows.iter().map(|row| row.weight * targets(row)[n]).sum::<f64>() / weight.max(1e-9);
        let base = [mean(0) as f32, mean(1) as f32];
        let edges: Vec<Vec<f32>> = (0..FEATURES_COUNT).map(|feature| edges(rows, feature)).collect();
        let bins: Vec<[u8; FEATURES_COUNT]> = rows
            .iter()
            .map(|row| {
                std::array::from_fn(|f| edges[f].partition_point(|edge| row.features[f] > f64::from(*edge)) as u8)
            })
            .collect();
        let mut residuals: Vec<[f64; 2]> = rows
            .iter()
            .map(|row| [targets(row)[0] - f64::from(base[0]), targets(row)[1] - f64::from(base[1])])
            .collect();
        let mut trees = Vec::with_capacity(how.trees_count);
        let mut nodes = vec![0usize; rows.len()];
        for _ in 0..how.trees_count {
            let tree = grow(rows, &bins, &edges, &residuals, &mut nodes, how);
            for (residual, node) in residuals.iter_mut().zip(&nodes) {
                let leaf = tree.leaves[node - SPLITS];
                *residual = [residual[0] - f64::from(leaf[0]), residual[1] - f64::from(leaf[1])];
            }
            trees.push(tree);
        }
        Ensemble { base, trees }
    }

    /// What it says of these features.
    pub fn at(&self, features: &[f64]) -> [f64; 2] {
        let mut sum = self.base.map(f64::from);
        for tree in &self.trees {
            let mut at = 0;
            while at < SPLITS {
                at = 2 * at + 1 + usize::from(features[tree.features[at]] > f64::from(tree.thresholds[at]));
            }
            let leaf = tree.leaves[at - SPLITS];
            sum = [sum[0] + f64::from(leaf[0]), sum[1] + f64::from(leaf[1])];
        }
        sum
    }

    /// As `slipbound` reads it.
    pub fn written(&self, name: &str) -> String {
        let mut text = format!("ensemble {name} {} {}\n", self.base[0], self.base[1]);
        for tree in &self.trees {
            for (feature, threshold) in tree.features.iter().zip(tree.thresholds) {
                let _ = write!(text, "{feature}:{threshold} ");
            }
            let leaves: Vec<String> = tree.leaves.iter().flatten().map(|value| value.to_string()).collect();
            text += &leaves.join(" ");
            text.push('\n');
        }
        text
    }
}

/// Where a feature may be split: between quantiles, at numbers of few digits.
fn edges(rows: &[Row], feature: usize) -> Vec<f32> {
    let mut values: Vec<f64> = rows.iter().map(|row| row.features[feature]).collect();
    values.sort_unstable_by(f64::total_cmp);
    let mut edges: Vec<f32> = (1..BINS)
        .filter_map(|n| values.get(n * values.len() / BINS))
        .map(|value| format!("{value:.3e}").parse().unwrap_or(0.0))
        .collect();
    edges.dedup();
    edges
}

fn grow(
    rows: &[Row],
    bins: &[[u8; FEATURES_COUNT]],
    edges: &[Vec<f32>],
    residuals: &[[f64; 2]],
    nodes: &mut [usize],
    how: &Fitting,
) -> Tree {
    let mut tree = Tree { features: [0; SPLITS], thresholds: [f32::MAX; SPLITS], leaves: [[0.0; 2]; LEAVES] };
    nodes.fill(0);
    for (first, last) in [(0, 1), (1, 3), (3, 7)] {
        let mut sums = vec![Sums::default(); (last - first) * FEATURES_COUNT * BINS];
        for (at, node) in nodes.iter().enumerate() {
            let weight = rows[at].weight;
            let one = Sums { weight, residuals: residuals[at].map(|r| weight * r) };
            for (feature, bin) in bins[at].iter().enumerate() {
                sums[((node - first) * FEATURES_COUNT + feature) * BINS + usize::from(*bin)].add(&one);
            }
        }
        for node in first..last {
            let of = |feature: usize| {
                let from = ((node - first) * FEATURES_COUNT + feature) * BINS;
                &sums[from..from + BINS]
            };
            (tree.features[node], tree.thresholds[node]) = best_split(of, edges, how);
        }
        for (at, node) in nodes.iter_mut().enumerate() {
            let (feature, threshold) = (tree.features[*node], tree.thresholds[*node]);
            let over = rows[at].features[feature] > f64::from(threshold);
            *node = 2 * *node + 1 + usize::from(over);
        }
    }
    let mut sums = [Sums::default(); LEAVES];
    for (at, node) in nodes.iter().enumerate() {
        let weight = rows[at].weight;
        sums[node - SPLITS].add(&Sums { weight, residuals: residuals[at].map(|r| weight * r) });
    }
    for (leaf, sums) in tree.leaves.iter_mut().zip(sums) {
        // Six decimals are finer than any estimate.
        let said = |sum: f64| ((how.shrinkage * sum / (sums.weight + how.ridge) * 1e6).round() / 1e6 + 0.0) as f32;
        *leaf = sums.residuals.map(said);
    }
    tree
}

/// The split of a node that lowers the squared error most; none is one that no row passes.
fn best_split<'a>(of: impl Fn(usize) -> &'a [Sums], edges: &[Vec<f32>], how: &Fitting) -> (usize, f32) {
    let (mut best, mut best_gain) = ((0, f32::MAX), 1e-9);
    for (feature, edges) in edges.iter().enumerate() {
        let bins = of(feature);
        let all = bins.iter().fold(Sums::default(), |mut sum, bin| {
            sum.add(bin);
            sum
        });
        let mut below = Sums::default();
        for (edge, bin) in edges.iter().zip(bins) {
            below.add(bin);
            let above = all.less(&below);
            if below.weight < how.least_rows || above.weight < how.least_rows {
                continue;
            }
            let gain = below.gain(how.ridge) + above.gain(how.ridge) - all.gain(how.ridge);
            if gain > best_gain {
                (best, best_gain) = ((feature, *edge), gain);
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> Vec<Row> {
        let row = |n: u64| {
            let mut features = [0.0; FEATURES_COUNT];
            features[3] = (n % 37) as f64 / 37.0;
            features[20] = (n % 11) as f64;
            let step = if features[3] > 0.5 { 1.0 } else { 0.0 };
            Row::new(n, "ball", 1.0, [step, step * features[20] / 10.0], &features)
        };
        (0..2000).map(row).collect()
    }

    #[test]
    fn a_step_and_a_product_are_learned_and_written_as_the_monitor_reads_them() {
        let how = Fitting { trees_count: 80, shrinkage: 0.2, least_rows: 5.0, ridge: 0.1 };
        let rows = rows();
        let ensemble = Ensemble::fit(&rows, |row| row.targets, &how);
        for row in &rows {
            let [step, product] = ensemble.at(&row.features);
            assert!((step - row.targets[0]).abs() < 0.02, "{step} {:?}", row.targets);
            assert!((product - row.targets[1]).abs() < 0.05, "{product} {:?}", row.targets);
        }
        let text = ensemble.written("grip");
        assert_eq!(text.lines().count(), 81);
        assert_eq!(text.lines().nth(1).map(|line| line.split(' ').count()), Some(7 + 16));
    }
}
