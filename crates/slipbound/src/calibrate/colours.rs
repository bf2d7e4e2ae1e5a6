//! Weights of red, green and blue that make markers stand out: Fisher's discriminant, without negative weights.
//!
//! In a good grey image, the contrast m of the markers against their surroundings is the same everywhere. Variation is
//! noise: the texture around the markers, and the contrast itself where one colour of light does not reach. The weights
//! maximise `(w . m)^2 / (w . S w)`, S the sum of both covariances.

use crate::pixels::patch::DotColours;
use crate::sensor::Polarity;

/// Part of S that is equal for all channels: camera noise that averaging over frames has hidden, levels squared.
const NOISE_LEVELS_SQUARED: f64 = 4.0;
/// Weights are rounded to this many parts of 1.
const PARTS: f64 = 100.0;

/// Weights of red, green and blue, at least 0, together 1. Equal ones when no channel shows the markers.
pub(super) fn grey_weights(dots: &[DotColours], polarity: Polarity) -> [f64; 3] {
    let sign = if polarity == Polarity::Dark { 1.0 } else { -1.0 };
    let n = dots.len().max(1) as f64;
    let contrast = |d: &DotColours, k: usize| sign * (d.ring_levels[k] - d.core_levels[k]);
    let mean: [f64; 3] = std::array::from_fn(|k| dots.iter().map(|d| contrast(d, k)).sum::<f64>() / n);
    let spread = |i: usize, j: usize| {
        let own = |d: &DotColours| d.ring_covariance[i][j] + (contrast(d, i) - mean[i]) * (contrast(d, j) - mean[j]);
        dots.iter().map(own).sum::<f64>() / n + if i == j { NOISE_LEVELS_SQUARED } else { 0.0 }
    };
    let s: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| spread(i, j)));
    let ratio = |w: &[f64; 3]| {
        let signal: f64 = w.iter().zip(&mean).map(|(w, m)| w * m).sum();
        let noise: f64 = (0..3).map(|i| (0..3).map(|j| w[i] * s[i][j] * w[j]).sum::<f64>()).sum();
        if signal > 0.0 { signal * signal / noise } else { 0.0 }
    };
    // Exhaustive search over mixtures in steps of a fiftieth.
    let mut best = ([1.0 / 3.0; 3], 0.0);
    for red in 0..=50 {
        for green in 0..=50 - red {
            let w = [f64::from(red), f64::from(green), f64::from(50 - red - green)].map(|v| v / 50.0);
            // A mixture must be clearly better than a simpler one found before.
            if ratio(&w) > best.1 * 1.0001 {
                best = (w, ratio(&w));
            }
        }
    }
    let rounded = best.0.map(|v| (v * PARTS).round() / PARTS);
    if best.1 == 0.0 { [0.33, 0.34, 0.33] } else { rounded }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dots(core: [f64; 3], noise: [f64; 3]) -> Vec<DotColours> {
        let ring_covariance =
            std::array::from_fn(|i| std::array::from_fn(|j| if i == j { noise[i] * noise[i] } else { 0.0 }));
        vec![DotColours { core_levels: core, ring_levels: [100.0; 3], ring_covariance }; 9]
    }

    #[test]
    fn the_channel_that_shows_the_markers_counts() {
        let w = grey_weights(&dots([100.0, 40.0, 90.0], [3.0, 3.0, 3.0]), Polarity::Dark);
        assert!(w[1] > 0.8 && w[0] < 0.03 && (w.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{w:?}");
        let w = grey_weights(&dots([40.0, 40.0, 40.0], [2.0, 20.0, 2.0]), Polarity::Dark);
        assert!(w[1] < 0.05 && (w[0] - w[2]).abs() < 0.03, "a noisy channel counts little: {w:?}");
        let w = grey_weights(&dots([100.0, 100.0, 160.0], [3.0; 3]), Polarity::Bright);
        assert_eq!(w, [0.0, 0.0, 1.0]);
    }

    #[test]
    fn markers_nobody_sees_give_equal_weights() {
        assert_eq!(grey_weights(&dots([100.0; 3], [3.0; 3]), Polarity::Dark), [0.33, 0.34, 0.33]);
        assert_eq!(grey_weights(&[], Polarity::Dark), [0.33, 0.34, 0.33]);
    }
}
