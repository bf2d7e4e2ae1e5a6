//! Boosted regression trees, read from a table.
//!
//! Its lines: `ensemble NAME VALUE`, the value it starts from, then its trees, one a line: `feature:threshold` of the splits, level by level,
//! and the values of the leaves, one more than there are splits. The trees of an ensemble are full and equally deep.

/// Deepest trees that are read.
const MOST_DEPTH: u32 = 12;

/// Split i goes on with split 2 i + 1 where the feature is at most the threshold, else with 2 i + 2; behind the last splits are the leaves.
#[derive(Debug, Clone, Copy)]
struct Split {
    feature: u8,
    threshold: f32,
}

/// Trees whose leaves add up.
#[derive(Debug, Clone)]
pub(super) struct Ensemble {
    base: f64,
    depth: u32,
    /// Of all trees, one after the other.
    splits: Vec<Split>,
    leaves: Vec<f32>,
}

impl Default for Ensemble {
    fn default() -> Self {
        Ensemble { base: 0.0, depth: 1, splits: Vec::new(), leaves: Vec::new() }
    }
}

/// The ensembles of a table by these names, in their order, of so many features; None when a line is not as described above.
pub(super) fn parse<const NAMES: usize>(
    text: &str,
    names: [&str; NAMES],
    features_count: usize,
) -> Option<[Ensemble; NAMES]> {
    let mut ensembles: [Ensemble; NAMES] = std::array::from_fn(|_| Ensemble::default());
    let mut into = None;
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        if let Some(rest) = line.strip_prefix("ensemble ") {
            let (name, base) = rest.split_once(' ')?;
            let ensemble = &mut ensembles[names.iter().position(|known| *known == name)?];
            ensemble.base = base.parse().ok()?;
            into = Some(ensemble);
        } else {
            into.as_mut()?.add(line, features_count)?;
        }
    }
    Some(ensembles)
}

impl Ensemble {
    /// Adds the tree of a line.
    fn add(&mut self, line: &str, features_count: usize) -> Option<()> {
        let words = || line.split_ascii_whitespace();
        let splits_count = words().filter(|word| word.contains(':')).count();
        let leaves_count = words().count() - splits_count;
        let depth = leaves_count.checked_ilog2().filter(|depth| (1..=MOST_DEPTH).contains(depth))?;
        let fits = self.leaves.is_empty() || depth == self.depth;
        if leaves_count != 1 << depth || splits_count + 1 != leaves_count || !fits {
            return None;
        }
        self.depth = depth;
        for word in words().take(splits_count) {
            let (feature, threshold) = word.split_once(':')?;
            let feature = feature.parse().ok().filter(|feature| usize::from(*feature) < features_count)?;
            self.splits.push(Split { feature, threshold: threshold.parse().ok()? });
        }
        for word in words().skip(splits_count) {
            self.leaves.push(word.parse().ok()?);
        }
        Some(())
    }

    /// What it says of these features.
    pub fn at(&self, features: &[f64]) -> f64 {
        let leaves_count = 1 << self.depth;
        let trees = self.splits.chunks_exact(leaves_count - 1).zip(self.leaves.chunks_exact(leaves_count));
        trees.fold(self.base, |sum, (splits, leaves)| {
            let mut at = 0;
            for _ in 0..self.depth {
                let Split { feature, threshold } = splits[at];
                at = 2 * at + 1 + usize::from(features[usize::from(feature)] > f64::from(threshold));
            }
            sum + f64::from(leaves[at - splits.len()])
        })
    }

    /// How many trees.
    pub fn trees_count(&self) -> usize {
        self.leaves.len() >> self.depth
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# a table\nensemble flat 0.5\n1:0.25 -1 1\nensemble deep 0\n0:0.5 1:1.5 1:2.5 1 2 3 4\n0:9 0:9 0:9 10 20 30 40\n";

    #[test]
    fn leaves_of_trees_of_any_depth_add_up() {
        let [deep, flat] = parse(TEXT, ["deep", "flat"], 2).expect("as described");
        assert_eq!([flat.at(&[7.0, 0.25]), flat.at(&[7.0, 0.26])], [-0.5, 1.5], "at the threshold it is not over it");
        let of = [[0.5, 1.5], [0.5, 1.6], [0.6, 2.5], [0.6, 2.6], [9.1, 0.0]].map(|features| deep.at(&features));
        assert_eq!(of, [11.0, 12.0, 13.0, 14.0, 43.0]);
        assert_eq!([flat.trees_count(), deep.trees_count()], [1, 2]);
    }

    #[test]
    fn a_spoiled_table_is_refused() {
        let refused = |text: &str| parse(text, ["deep", "flat"], 2).is_none();
        assert!(!refused(TEXT));
        assert!(refused("1:0.25 -1 1"), "a tree of no ensemble");
        assert!(refused("ensemble other 0"), "an unknown name");
        assert!(refused("ensemble flat zero"));
        for tree in ["2:0.25 -1 1", "1:x -1 1", "1:0.25 -1 x", "1:0.25 -1", "1:0.25 -1 1 2", "0:1 0:1 1 2 3", "5"] {
            assert!(refused(&format!("ensemble flat 0\n{tree}")), "{tree}");
        }
        assert!(refused("ensemble flat 0\n1:0.25 -1 1\n0:0.5 1:1.5 1:2.5 1 2 3 4"), "trees of two depths");
    }
}
