//! Gradient boosting of full regression trees with several outputs, splits between quantiles.

use super::row::Row;
use std::fmt::Write;

/// Most splits tried per feature.
const BINS: usize = 64;

/// The loss that is minimised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Loss {
    /// The squared error.
    Squares,
    /// The logarithmic loss of 0 or 1; the ensemble predicts log-odds.
    Logistic,
}

/// How an ensemble is fitted.
#[derive(Debug, Clone, Copy)]
pub struct Fitting {
    /// The loss that is minimised.
    pub loss: Loss,
    /// Number of trees.
    pub trees_count: usize,
    /// Splits from the root of a tree to a leaf.
    pub depth: u32,
    /// Share of a leaf's optimal value that is used.
    pub shrinkage: f64,
    /// Least weight of the rows in a leaf; with logistic loss times p (1 - p).
    pub least_rows: f64,
    /// Weight of virtual rows without residual in every leaf.
    pub ridge: f64,
}

#[derive(Debug, Clone, PartialEq)]
struct Tree<const N: usize> {
    features: Vec<usize>,
    thresholds: Vec<f32>,
    leaves: Vec<[f32; N]>,
}

/// Trees whose leaves are summed.
#[derive(Debug, Clone, PartialEq)]
pub struct Ensemble<const N: usize> {
    base: [f32; N],
    trees: Vec<Tree<N>>,
}

/// Sums of the weights and of the weighted residuals of some rows.
#[derive(Debug, Clone, Copy)]
struct Sums<const N: usize> {
    weight: f64,
    residuals: [f64; N],
}

impl<const N: usize> Sums<N> {
    const NONE: Self = Sums { weight: 0.0, residuals: [0.0; N] };

    fn add(&mut self, other: &Self) {
        self.weight += other.weight;
        self.residuals.iter_mut().zip(other.residuals).for_each(|(sum, residual)| *sum += residual);
    }

    fn less(&self, other: &Self) -> Self {
        Sums {
            weight: self.weight - other.weight,
            residuals: std::array::from_fn(|n| self.residuals[n] - other.residuals[n]),
        }
    }

    /// Reduction of the squared error by a leaf of these rows.
    fn gain(&self, ridge: f64) -> f64 {
        self.residuals.iter().map(|r| r * r).sum::<f64>() / (self.weight + ridge)
    }
}

impl<const N: usize> Ensemble<N> {
    /// Fits to rows.
    pub fn fit(rows: &[Row], targets: impl Fn(&Row) -> [f64; N], how: &Fitting) -> Self {
        let weight: f64 = rows.iter().map(|row| row.weight).sum();
        let base: [f32; N] = std::array::from_fn(|n| {
            let mean = rows.iter().map(|row| row.weight * targets(row)[n]).sum::<f64>() / weight.max(1e-9);
            match how.loss {
                Loss::Squares => mean as f32,
                Loss::Logistic => libm::log(mean.clamp(1e-6, 1.0 - 1e-6) / (1.0 - mean.clamp(1e-6, 1.0 - 1e-6))) as f32,
            }
        });
        let features_count = rows.first().map_or(0, |row| row.features.len());
        let edges: Vec<Vec<f32>> = (0..features_count).map(|feature| edges(rows, feature)).collect();
        let bins: Vec<u8> = rows
            .iter()
            .flat_map(|row| row.features.iter().zip(&edges))
            .map(|(value, edges)| edges.partition_point(|edge| *value > f64::from(*edge)) as u8)
            .collect();
        let mut predictions: Vec<[f64; N]> = vec![base.map(f64::from); rows.len()];
        let mut sums = vec![Sums::NONE; rows.len()];
        let mut trees = Vec::with_capacity(how.trees_count);
        let mut nodes = vec![0usize; rows.len()];
        for _ in 0..how.trees_count {
            for ((sums, row), prediction) in sums.iter_mut().zip(rows).zip(&predictions) {
                *sums = residual(row.weight, targets(row), prediction, how.loss);
            }
            let tree = grow(&sums, &bins, &edges, &mut nodes, how);
            for (prediction, node) in predictions.iter_mut().zip(&nodes) {
                let leaf = tree.leaves[node - tree.features.len()];
                prediction.iter_mut().zip(leaf).for_each(|(prediction, leaf)| *prediction += f64::from(leaf));
            }
            trees.push(tree);
        }
        Ensemble { base, trees }
    }

    /// The prediction for these features.
    pub fn at(&self, features: &[f64]) -> [f64; N] {
        let mut sum = self.base.map(f64::from);
        for tree in &self.trees {
            let mut at = 0;
            while let (Some(feature), Some(threshold)) = (tree.features.get(at), tree.thresholds.get(at)) {
                at = 2 * at + 1 + usize::from(features[*feature] > f64::from(*threshold));
            }
            sum.iter_mut().zip(tree.leaves[at - tree.features.len()]).for_each(|(sum, leaf)| *sum += f64::from(leaf));
        }
        sum
    }

    /// In the format that `slipbound` reads.
    pub fn written(&self, name: &str) -> String {
        let base: Vec<String> = self.base.iter().map(f32::to_string).collect();
        let mut text = format!("ensemble {name} {}\n", base.join(" "));
        for tree in &self.trees {
            for (feature, threshold) in tree.features.iter().zip(&tree.thresholds) {
                let _ = write!(text, "{feature}:{threshold} ");
            }
            let leaves: Vec<String> = tree.leaves.iter().flatten().map(|value| value.to_string()).collect();
            text += &leaves.join(" ");
            text.push('\n');
        }
        text
    }
}

/// Candidate splits of a feature: between quantiles, at numbers of few digits.
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

/// Contribution of a row to a node: the gradient of its loss and, as its weight, the curvature.
fn residual<const N: usize>(weight: f64, targets: [f64; N], prediction: &[f64; N], loss: Loss) -> Sums<N> {
    match loss {
        Loss::Squares => Sums { weight, residuals: std::array::from_fn(|n| weight * (targets[n] - prediction[n])) },
        Loss::Logistic => {
            let likely = prediction.map(|odds| 1.0 / (1.0 + libm::exp(-odds)));
            let curved = likely.iter().map(|p| p * (1.0 - p)).sum::<f64>() / N as f64;
            Sums { weight: weight * curved, residuals: std::array::from_fn(|n| weight * (targets[n] - likely[n])) }
        }
    }
}

fn grow<const N: usize>(
    rows: &[Sums<N>],
    bins: &[u8],
    edges: &[Vec<f32>],
    nodes: &mut [usize],
    how: &Fitting,
) -> Tree<N> {
    let features_count = edges.len();
    let splits_count = (1 << how.depth) - 1;
    let mut tree = Tree {
        features: vec![0; splits_count],
        thresholds: vec![f32::INFINITY; splits_count],
        leaves: vec![[0.0; N]; splits_count + 1],
    };
    nodes.fill(0);
    for (first, last) in (0..how.depth).map(|level| ((1 << level) - 1, (2 << level) - 1)) {
        let mut sums = vec![Sums::NONE; (last - first) * features_count * BINS];
        for ((row, bins), node) in rows.iter().zip(bins.chunks_exact(features_count)).zip(&*nodes) {
            for (feature, bin) in bins.iter().enumerate() {
                sums[((node - first) * features_count + feature) * BINS + usize::from(*bin)].add(row);
            }
        }
        for node in first..last {
            let of = |feature: usize| {
                let from = ((node - first) * features_count + feature) * BINS;
                &sums[from..from + BINS]
            };
            (tree.features[node], tree.thresholds[node]) = best_split(of, edges, how);
        }
        for (node, bins) in nodes.iter_mut().zip(bins.chunks_exact(features_count)) {
            let (feature, threshold) = (tree.features[*node], tree.thresholds[*node]);
            let over = edges[feature].get(usize::from(bins[feature]).wrapping_sub(1)).is_some_and(|e| *e >= threshold);
            *node = 2 * *node + 1 + usize::from(over);
        }
    }
    let mut sums = vec![Sums::NONE; splits_count + 1];
    for (row, node) in rows.iter().zip(&*nodes) {
        sums[node - splits_count].add(row);
    }
    for (leaf, sums) in tree.leaves.iter_mut().zip(sums) {
        // Six decimals are finer than any estimate.
        let value = |sum: f64| ((how.shrinkage * sum / (sums.weight + how.ridge) * 1e6).round() / 1e6 + 0.0) as f32;
        *leaf = sums.residuals.map(value);
    }
    tree
}

/// The split of a node that reduces the squared error most. Without a useful split: a threshold that no row passes.
fn best_split<'a, const N: usize>(
    of: impl Fn(usize) -> &'a [Sums<N>],
    edges: &[Vec<f32>],
    how: &Fitting,
) -> (usize, f32) {
    let (mut best, mut best_gain) = ((0, f32::INFINITY), 1e-9);
    for (feature, edges) in edges.iter().enumerate() {
        let bins = of(feature);
        let all = bins.iter().fold(Sums::NONE, |mut sum, bin| {
            sum.add(bin);
            sum
        });
        let mut below = Sums::NONE;
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
    use slipbound::monitor::FEATURES_COUNT;

    fn rows() -> Vec<Row> {
        let row = |n: u64| {
            let mut features = [0.0; FEATURES_COUNT];
            features[3] = (n % 37) as f64 / 37.0;
            features[20] = (n % 11) as f64;
            let step = if features[3] > 0.5 { 1.0 } else { 0.0 };
            Row::new(n, "ball", 1.0, 0.5, [step, step * features[20] / 10.0], &features)
        };
        (0..2000).map(row).collect()
    }

    #[test]
    fn a_step_and_a_product_are_learned_and_written_as_the_monitor_reads_them() {
        let how =
            Fitting { loss: Loss::Squares, trees_count: 80, depth: 3, shrinkage: 0.2, least_rows: 5.0, ridge: 0.1 };
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

    #[test]
    fn odds_are_learned_where_only_ones_and_zeros_are_seen() {
        let how =
            Fitting { loss: Loss::Logistic, trees_count: 60, depth: 3, shrinkage: 0.3, least_rows: 2.0, ridge: 0.5 };
        // Above one half a quarter are 1, below none.
        let rows: Vec<Row> = (0..4000)
            .map(|n| {
                let above = n % 2 == 1;
                let is_one = above && n % 8 == 1;
                Row::new(n, "ball", 1.0, 0.5, [f64::from(u8::from(is_one)), 0.0], &[if above { 0.9 } else { 0.1 }, 0.0])
            })
            .collect();
        let ensemble = Ensemble::fit(&rows, |row| [row.targets[0]], &how);
        let likely = |value: f64| 1.0 / (1.0 + libm::exp(-ensemble.at(&[value, 0.0])[0]));
        assert!((likely(0.9) - 0.25).abs() < 0.02, "{}", likely(0.9));
        assert!(likely(0.1) < 0.03, "{}", likely(0.1));
    }
}
