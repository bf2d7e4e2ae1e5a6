//! Boosted regression trees of depth 3, read from a table.
//!
//! Its lines: `ensemble NAME` and the values it starts from, then its trees, `feature:threshold` of seven splits and eight
//! leaves of as many values.

const SPLITS: usize = 7;
const LEAVES: usize = 8;

/// A tree. Split i goes on with split 2 i + 1 where the feature is at most the threshold, else with 2 i + 2.
#[derive(Debug, Clone, Copy)]
struct Tree<const OUTPUTS: usize> {
    features: [u8; SPLITS],
    thresholds: [f32; SPLITS],
    leaves: [[f32; OUTPUTS]; LEAVES],
}

/// Trees whose leaves add up.
#[derive(Debug, Clone)]
pub(super) struct Ensemble<const OUTPUTS: usize> {
    base: [f64; OUTPUTS],
    trees: Vec<Tree<OUTPUTS>>,
}

impl<const OUTPUTS: usize> Default for Ensemble<OUTPUTS> {
    fn default() -> Self {
        Ensemble { base: [0.0; OUTPUTS], trees: Vec::new() }
    }
}

/// The ensembles of a table by these names, in their order, of so many features; None when a line is not as described above.
pub(super) fn parse<const OUTPUTS: usize, const NAMES: usize>(
    text: &str,
    names: [&str; NAMES],
    features_count: usize,
) -> Option<[Ensemble<OUTPUTS>; NAMES]> {
    let mut ensembles: [Ensemble<OUTPUTS>; NAMES] = std::array::from_fn(|_| Ensemble::default());
    let mut into = None;
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let mut words = line.split_ascii_whitespace();
        if let Some(rest) = line.strip_prefix("ensemble ") {
            let mut words = rest.split_ascii_whitespace();
            let name = words.next()?;
            let ensemble = &mut ensembles[names.iter().position(|known| *known == name)?];
            for base in &mut ensemble.base {
                *base = words.next()?.parse().ok()?;
            }
            into = Some(ensemble);
            continue;
        }
        let mut tree = Tree { features: [0; SPLITS], thresholds: [0.0; SPLITS], leaves: [[0.0; OUTPUTS]; LEAVES] };
        for split in 0..SPLITS {
            let (feature, threshold) = words.next()?.split_once(':')?;
            tree.features[split] = feature.parse().ok().filter(|f| usize::from(*f) < features_count)?;
            tree.thresholds[split] = threshold.parse().ok()?;
        }
        for value in tree.leaves.iter_mut().flatten() {
            *value = words.next()?.parse().ok()?;
        }
        into.as_mut()?.trees.push(tree);
    }
    Some(ensembles)
}

impl<const OUTPUTS: usize> Ensemble<OUTPUTS> {
    /// What it says of these features.
    pub fn at(&self, features: &[f64]) -> [f64; OUTPUTS] {
        let mut sum = self.base;
        for tree in &self.trees {
            let mut at = 0;
            while at < SPLITS {
                let over = features[usize::from(tree.features[at])] > f64::from(tree.thresholds[at]);
                at = 2 * at + 1 + usize::from(over);
            }
            for (sum, leaf) in sum.iter_mut().zip(tree.leaves[at - SPLITS]) {
                *sum += f64::from(leaf);
            }
        }
        sum
    }

    /// How many trees.
    #[cfg(test)]
    pub fn trees_count(&self) -> usize {
        self.trees.len()
    }
}
