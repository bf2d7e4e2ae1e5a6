//! Boosted regression trees, read from a table.
//!
//! Its lines: `ensemble NAME VALUE` with the base value, then the trees, one per line: `feature:threshold` of the
//! splits, level by level, and the values of the leaves, one more than there are splits. The trees of an ensemble are
//! complete and equally deep.

/// Largest depth of a tree.
const MOST_DEPTH: u32 = 12;

/// Most features, and most thresholds per feature.
const MOST_FEATURES: usize = 64;
const MOST_THRESHOLDS: usize = 255;

/// Trees whose leaves are read together, once all are found: each is a cache miss, and so the misses overlap.
const BLOCK: usize = 64;

/// Split i continues with split 2 i + 1 where the feature is at most the threshold, else with 2 i + 2; the leaves
/// follow the last splits.
///
/// A threshold is stored as its rank among those of its feature, in ascending order: this needs a quarter of the bytes,
/// and between frames the table does not stay in the near caches.
#[derive(Debug, Clone, Copy)]
struct Split {
    feature: u8,
    threshold: u8,
}

/// Trees whose leaves are summed.
#[derive(Debug, Clone)]
pub(super) struct Ensemble {
    base: f64,
    depth: u32,
    /// Of each feature, ascending.
    thresholds: Vec<Vec<f32>>,
    /// Of all trees, one after the other.
    splits: Vec<Split>,
    leaves: Vec<f32>,
}

/// Feature and threshold of a split, as the table has them.
type Read = (usize, f32);

impl Default for Ensemble {
    fn default() -> Self {
        Ensemble { base: 0.0, depth: 1, thresholds: Vec::new(), splits: Vec::new(), leaves: Vec::new() }
    }
}

/// The ensembles of a table by these names, in this order, with `features_count` features (64 at most); None when a
/// line is not as described above, or a feature has more than 255 thresholds in an ensemble.
pub(super) fn parse<const NAMES: usize>(
    text: &str,
    names: [&str; NAMES],
    features_count: usize,
) -> Option<[Ensemble; NAMES]> {
    let mut ensembles: [(Ensemble, Vec<Read>); NAMES] = std::array::from_fn(|_| Default::default());
    let mut into = None;
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        if let Some(rest) = line.strip_prefix("ensemble ") {
            let (name, base) = rest.split_once(' ')?;
            let ensemble = &mut ensembles[names.iter().position(|known| *known == name)?];
            ensemble.0.base = base.parse().ok()?;
            into = Some(ensemble);
        } else {
            let (ensemble, read) = into.as_mut()?;
            ensemble.add(line, features_count.min(MOST_FEATURES), read)?;
        }
    }
    for (ensemble, read) in &mut ensembles {
        ensemble.number(read, features_count)?;
    }
    Some(ensembles.map(|(ensemble, _)| ensemble))
}

impl Ensemble {
    /// Adds the tree of a line; appends its splits to `read`.
    fn add(&mut self, line: &str, features_count: usize, read: &mut Vec<Read>) -> Option<()> {
        let (first_split, first_leaf) = (read.len(), self.leaves.len());
        for word in line.split_ascii_whitespace() {
            let Some((feature, threshold)) = word.split_once(':') else {
                self.leaves.push(word.parse().ok()?);
                continue;
            };
            let feature = feature.parse().ok().filter(|feature| *feature < features_count)?;
            let threshold = threshold.parse().ok().filter(|threshold: &f32| !threshold.is_nan())?;
            read.push((feature, threshold));
            if self.leaves.len() > first_leaf {
                return None; // splits come before leaves
            }
        }
        let (splits_count, leaves_count) = (read.len() - first_split, self.leaves.len() - first_leaf);
        let depth = leaves_count.checked_ilog2().filter(|depth| (1..=MOST_DEPTH).contains(depth))?;
        let fits = first_leaf == 0 || depth == self.depth;
        if leaves_count != 1 << depth || splits_count + 1 != leaves_count || !fits {
            return None;
        }
        self.depth = depth;
        Some(())
    }

    /// Ranks the thresholds of the splits in `read`.
    fn number(&mut self, read: &[Read], features_count: usize) -> Option<()> {
        self.thresholds = vec![Vec::new(); features_count];
        for &(feature, threshold) in read {
            self.thresholds[feature].push(threshold);
        }
        for thresholds in &mut self.thresholds {
            thresholds.sort_by(f32::total_cmp);
            thresholds.dedup();
        }
        let fits = self.thresholds.iter().all(|thresholds| thresholds.len() <= MOST_THRESHOLDS);
        let split = |&(feature, threshold): &Read| Split {
            feature: feature as u8,
            threshold: self.thresholds[feature].partition_point(|lower| *lower < threshold) as u8,
        };
        self.splits = read.iter().map(split).collect();
        fits.then_some(())
    }

    /// The prediction for these features.
    pub fn at(&self, features: &[f64]) -> f64 {
        let mut passed = [0u8; MOST_FEATURES];
        for ((passed, thresholds), &value) in passed.iter_mut().zip(&self.thresholds).zip(features) {
            *passed = thresholds.partition_point(|threshold| value > f64::from(*threshold)) as u8;
        }
        let leaves_count = 1 << self.depth;
        let splits_count = leaves_count - 1;
        let blocks = self.splits.chunks(BLOCK * splits_count).zip(self.leaves.chunks(BLOCK * leaves_count));
        let mut sum = self.base;
        for (splits, leaves) in blocks {
            let mut reached = [0; BLOCK];
            for (reached, splits) in reached.iter_mut().zip(splits.chunks_exact(splits_count)) {
                let mut at = 0;
                for _ in 0..self.depth {
                    let Split { feature, threshold } = splits[at];
                    at = 2 * at + 1 + usize::from(passed[usize::from(feature)] > threshold);
                }
                *reached = at - splits_count;
            }
            for (leaves, reached) in leaves.chunks_exact(leaves_count).zip(reached) {
                sum += f64::from(leaves[reached]);
            }
        }
        sum
    }

    /// Number of trees.
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
        // More trees than one block.
        let stumps = (1..=3 * BLOCK / 2).fold("ensemble many 0".to_owned(), |text, k| format!("{text}\n0:{k} 0 {k}"));
        let [many] = parse(&stumps, ["many"], 1).expect("as described");
        let sum_to = |k: usize| (k * (k + 1) / 2) as f64;
        assert_eq!([many.at(&[90.5]), many.at(&[1e3])], [sum_to(90), sum_to(3 * BLOCK / 2)]);
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
        assert!(refused("ensemble flat 0\n1:NaN -1 1"), "nothing is over it");
        let stumps = |count: usize| {
            (0..count).map(|k| format!("\n1:{k} 0 1")).fold("ensemble flat 0".into(), |a: String, b| a + &b)
        };
        assert!(!refused(&stumps(255)) && refused(&stumps(256)), "thresholds that no byte numbers");
    }

    #[test]
    fn equal_thresholds_of_many_trees_are_each_passed_from_just_above_on() {
        let text = "ensemble flat 0\n0:2 0 1\n0:-0 0 10\n0:2 0 100\n0:0 0 1000\n1:2 0 10000\n0:3 0 100000";
        let [flat] = parse(text, ["flat"], 2).expect("as described");
        let of = |value: f64, other: f64| flat.at(&[value, other]);
        assert_eq!([of(-1.0, 2.0), of(0.0, 2.0), of(1e-9, 2.0), of(2.0, 2.0)], [0.0, 0.0, 1010.0, 1010.0]);
        assert_eq!([of(2.0 + 1e-9, 2.0), of(3.1, 2.1), of(f64::NAN, 3.0)], [1111.0, 111_111.0, 10_000.0]);
    }
}
