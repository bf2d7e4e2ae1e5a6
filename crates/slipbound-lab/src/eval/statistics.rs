//! Numbers of a sample with their 95 % intervals.

use serde::Serialize;

/// Standard normal deviate of a two-sided 95 % interval.
const Z: f64 = 1.959_963_984_540_054;

/// A number with its 95 % interval and the size of the sample behind it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimated {
    /// The number; None for an empty sample.
    pub value: Option<f64>,
    /// Lower end of the interval; None if the sample gives none.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// Size of the sample.
    pub n: u64,
}

impl Estimated {
    /// Of an empty sample.
    pub const NONE: Estimated = Estimated { value: None, low: None, high: None, n: 0 };

    fn of(value: f64, low: f64, high: f64, n: u64) -> Self {
        Estimated { value: Some(value), low: Some(low), high: Some(high), n }
    }

    /// The same in another unit.
    pub fn scaled(self, by: f64) -> Self {
        let scaled = |number: Option<f64>| number.map(|number| number * by);
        Estimated { value: scaled(self.value), low: scaled(self.low), high: scaled(self.high), n: self.n }
    }
}

/// A share of `count` in `of`, with the interval of Wilson (JASA 22 (1927) 209).
pub fn share(count: u64, of: u64) -> Estimated {
    if of == 0 { Estimated::NONE } else { wilson(count as f64 / of as f64, of) }
}

/// A share of the frames of some trials. The frames of a trial are alike, so the interval is that of a share of as many
/// answers as there are trials: the widest, as if all frames of a trial were the same.
pub fn share_of_frames(count: u64, of: u64, trials: u64) -> Estimated {
    if of == 0 || trials == 0 { Estimated::NONE } else { wilson(count as f64 / of as f64, trials) }
}

/// The share `p` of so many independent answers.
fn wilson(p: f64, of: u64) -> Estimated {
    let n = of as f64;
    let whole = 1.0 + Z * Z / n;
    let middle = (p + Z * Z / (2.0 * n)) / whole;
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt() / whole;
    // At the ends the bound is exact, without a rounding error.
    let low = if p == 0.0 { 0.0 } else { middle - half };
    let high = if p == 1.0 { 1.0 } else { middle + half };
    Estimated::of(p, low, high, of)
}

/// The share of true answers.
pub fn share_of(answers: impl IntoIterator<Item = bool>) -> Estimated {
    let (mut count, mut of) = (0, 0);
    for answer in answers {
        count += u64::from(answer);
        of += 1;
    }
    share(count, of)
}

/// Area under the ROC curve of scores (larger means more positive), ties counting half, with method 5 of Newcombe
/// (Statistics in Medicine 25 (2006) 559): the interval of all areas from which this one is at most 1.96 standard
/// deviations away. Unlike DeLong's it is not empty if every positive is above every negative.
pub fn auc(positives: &[f64], negatives: &[f64]) -> Estimated {
    let (m, n) = (positives.len(), negatives.len());
    if m == 0 || n == 0 {
        return Estimated { n: (m + n) as u64, ..Estimated::NONE };
    }
    let mut sorted = negatives.to_vec();
    sorted.sort_by(f64::total_cmp);
    let below: f64 = positives
        .iter()
        .map(|score| {
            let under = sorted.partition_point(|other| other < score);
            let upto = sorted.partition_point(|other| other <= score);
            0.5 * (under + upto) as f64
        })
        .sum();
    let area = below / (m * n) as f64;
    let pairs = (m * n) as f64;
    let others = 0.5 * (m + n) as f64 - 1.0;
    let deviation = |theta: f64| {
        let spread = 1.0 + others * ((1.0 - theta) / (2.0 - theta) + theta / (1.0 + theta));
        (theta * (1.0 - theta) * spread / pairs).sqrt()
    };
    let low = bisect(0.0, area, |theta| area - theta > Z * deviation(theta));
    let high = bisect(area, 1.0, |theta| theta - area <= Z * deviation(theta));
    let (low, high) = (if area == 0.0 { 0.0 } else { low }, if area == 1.0 { 1.0 } else { high });
    Estimated::of(area, low, high, (m + n) as u64)
}

/// The point between `low` and `high` at which a condition that holds at `low` stops holding.
fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if holds(middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The ROC curve: false positive and true positive rate at every threshold, from (0, 0) to (1, 1).
pub fn roc(positives: &[f64], negatives: &[f64]) -> Vec<(f64, f64)> {
    let mut scores: Vec<(f64, bool)> =
        positives.iter().map(|&s| (s, true)).chain(negatives.iter().map(|&s| (s, false))).collect();
    scores.sort_by(|a, b| b.0.total_cmp(&a.0));
    let rate = |count: usize, of: usize| if of == 0 { 0.0 } else { count as f64 / of as f64 };
    let (mut hits, mut alarms) = (0, 0);
    let mut curve = vec![(0.0, 0.0)];
    for (n, &(score, positive)) in scores.iter().enumerate() {
        if positive {
            hits += 1
        } else {
            alarms += 1
        }
        let last_of_ties = scores.get(n + 1).is_none_or(|next| next.0 != score);
        if last_of_ties {
            curve.push((rate(alarms, negatives.len()), rate(hits, positives.len())));
        }
    }
    curve
}

/// Up to this sample size the ranks of an interval are exact; beyond it the normal approximation is used (Conover).
const EXACT_COUNT: usize = 20;

/// The ranks, from 1 to `count`, of the order statistics that enclose the `at` quantile at 95 % confidence, for any
/// distribution. None if the sample is too small: a median needs six.
fn interval_ranks(count: usize, at: f64) -> Option<(usize, usize)> {
    let n = count as f64;
    let (low, high) = if count > EXACT_COUNT {
        let half = Z * (n * at * (1.0 - at)).sqrt();
        if half == 0.0 {
            return None; // no order statistic lies beyond the ends of a distribution
        }
        ((n * at - half).ceil(), (n * at + half).ceil())
    } else {
        // The number of values below the quantile has a binomial distribution. 2.5 % are excluded on either side.
        let mut chance = (0..count).fold(1.0, |chance, _| chance * (1.0 - at));
        let (mut up_to, mut low, mut high) = (0.0, 0.0, n + 1.0);
        for below in 0..=count {
            up_to += chance;
            if up_to <= 0.025 {
                low = (below + 1) as f64;
            }
            if up_to >= 0.975 && high > n {
                high = (below + 1) as f64;
            }
            chance *= (count - below) as f64 / (below + 1) as f64 * at / (1.0 - at);
        }
        (low, high)
    };
    (low >= 1.0 && high <= n).then_some((low as usize, high as usize))
}

/// A quantile of a sample, `at` from 0 to 1, interpolated between order statistics (type 7 of Hyndman and Fan), with
/// the order statistics that enclose it at 95 % confidence (Conover), for any distribution; no interval if the sample
/// is too small.
pub fn quantile(sample: &[f64], at: f64) -> Estimated {
    let mut sorted: Vec<f64> = sample.iter().copied().filter(|number| !number.is_nan()).collect();
    if sorted.is_empty() {
        return Estimated::NONE;
    }
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len() - 1;
    let place = at.clamp(0.0, 1.0) * last as f64;
    let (under, part) = (place.floor() as usize, place.fract());
    let over = (under + 1).min(last);
    let value = if part == 0.0 { sorted[under] } else { sorted[under] + part * (sorted[over] - sorted[under]) };
    let n = sorted.len() as u64;
    match interval_ranks(sorted.len(), at) {
        Some((low, high)) => Estimated::of(value, sorted[low - 1].min(value), sorted[high - 1].max(value), n),
        None => Estimated { value: Some(value), low: None, high: None, n },
    }
}

/// The median, as [`quantile`].
pub fn median(sample: &[f64]) -> Estimated {
    quantile(sample, 0.5)
}

/// Student's t for a two-sided 95 % interval with this many degrees of freedom, at least 1: the sums of Abramowitz and
/// Stegun, 26.7.3 and 26.7.4, with t = sqrt(freedom) tan(angle).
fn student_t(freedom: usize) -> f64 {
    let within = |angle: f64| {
        let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
        let is_odd = freedom % 2 == 1;
        let (mut term, mut sum) = (if is_odd { sine * cosine } else { sine }, 0.0);
        for n in (usize::from(is_odd)..freedom.saturating_sub(1)).step_by(2) {
            sum += term;
            term *= cosine * cosine * (n + 1) as f64 / (n + 2) as f64;
        }
        if is_odd { std::f64::consts::FRAC_2_PI * (angle + sum) } else { sum }
    };
    let angle = bisect(0.0, std::f64::consts::FRAC_PI_2, |angle| within(angle) < 0.95);
    (freedom as f64).sqrt() * libm::tan(angle)
}

/// The mean of independent, normally distributed numbers with the interval of Student's t; no interval for fewer than
/// two. The mean of numbers none of which is negative, such as errors, is not negative.
pub fn mean(sample: &[f64]) -> Estimated {
    let n = sample.len() as f64;
    match sample.len() {
        0 => Estimated::NONE,
        1 => Estimated { value: Some(sample[0]), low: None, high: None, n: 1 },
        count => {
            let mean = sample.iter().sum::<f64>() / n;
            let variance = sample.iter().map(|number| (number - mean) * (number - mean)).sum::<f64>() / (n - 1.0);
            let half = student_t(count - 1) * (variance / n).sqrt();
            let least = if sample.iter().all(|number| *number >= 0.0) { 0.0 } else { f64::NEG_INFINITY };
            Estimated::of(mean, (mean - half).max(least), mean + half, count as u64)
        }
    }
}

/// The mean of shares, such as the share of the frames of each trial, as [`mean`]; it is not above 1.
pub fn mean_share(shares: &[f64]) -> Estimated {
    let mean = mean(shares);
    Estimated { high: mean.high.map(|high| high.min(1.0)), ..mean }
}

/// Events per hour, with the exact (Garwood) one-sided 95 % upper bound; the lower end is 0. No event in T hours bounds
/// the rate at 3.0 / T.
pub fn rate_per_h(events: u64, hours_h: f64) -> Estimated {
    if hours_h <= 0.0 {
        return Estimated::NONE;
    }
    let n = events as f64;
    // Probability of at most so many events if more are expected: summed from the largest term downwards, because the
    // smallest, exp(-expected), underflows to 0 from 746 on.
    let at_most = |expected: f64| {
        let mut term = libm::exp(n * libm::log(expected) - expected - libm::lgamma(n + 1.0));
        let mut sum = term;
        for k in (1..=events).rev() {
            term *= k as f64 / expected;
            sum += term;
        }
        sum
    };
    let most = n + 10.0 * (n + 10.0).sqrt();
    let bound = bisect(n, most, |expected| at_most(expected) > 0.05);
    Estimated::of(n / hours_h, 0.0, bound / hours_h, events)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(got: Option<f64>, expected: f64, within: f64) {
        let got = got.expect("a number");
        assert!((got - expected).abs() <= within, "{got}, not {expected}");
    }

    /// Against the table of examples in Newcombe, Statistics in Medicine 17 (1998) 857: 81 of 263, 15 of 148, 0 of 20,
    /// 1 of 29.
    #[test]
    fn shares_have_wilsons_interval() {
        for (count, of, low, high) in
            [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)]
        {
            let share = share(count, of);
            near(share.low, low, 5e-5);
            near(share.high, high, 5e-5);
        }
        assert_eq!(share(20, 20).high, Some(1.0));
        assert_eq!(share(0, 0), Estimated::NONE);
        assert_eq!(share_of([true, false, true, true]).value, Some(0.75));
        // 120 frames of each of three trials are no 360 independent answers.
        assert_eq!(share_of_frames(360, 360, 3), share(3, 3));
        assert_eq!(share_of_frames(90, 360, 4), Estimated { value: Some(0.25), ..share(1, 4) });
        assert_eq!((share_of_frames(0, 0, 3), share_of_frames(0, 0, 0)), (Estimated::NONE, Estimated::NONE));
    }

    #[test]
    fn areas_of_known_samples() {
        assert_eq!(auc(&[3.0, 4.0], &[1.0, 2.0]).value, Some(1.0));
        assert_eq!(auc(&[1.0, 2.0], &[3.0, 4.0]).value, Some(0.0));
        assert_eq!(auc(&[1.0; 5], &[1.0; 7]).value, Some(0.5), "ties count half");
        // 3 > 1, 3 > 2, 3 < 4, 5 > all: 5 of 6 pairs.
        near(auc(&[3.0, 5.0], &[1.0, 2.0, 4.0]).value, 5.0 / 6.0, 1e-12);
        assert_eq!(auc(&[], &[1.0]).value, None);
        let perfect = auc(&[2.0; 20], &[1.0; 20]);
        assert_eq!(perfect.high, Some(1.0));
        assert!((0.8..0.99).contains(&perfect.low.expect("a bound")), "{perfect:?}: no certainty from 40 trials");
    }

    /// The deviation at the bound is the required one, and more trials make the interval narrower.
    #[test]
    fn the_interval_of_an_area_shrinks_with_the_sample() {
        let spread = |n: usize| {
            let positives: Vec<f64> = (0..n).map(|k| k as f64 / n as f64 + 0.3).collect();
            let negatives: Vec<f64> = (0..n).map(|k| k as f64 / n as f64).collect();
            let area = auc(&positives, &negatives);
            assert!(area.low < area.value && area.value < area.high);
            area.high.expect("a bound") - area.low.expect("a bound")
        };
        assert!((1.9..2.3).contains(&(spread(25) / spread(100))), "{}", spread(25) / spread(100));
    }

    #[test]
    fn the_roc_curve_goes_from_corner_to_corner_and_ties_go_at_once() {
        assert_eq!(
            roc(&[3.0, 2.0], &[2.0, 1.0]),
            [(0.0, 0.0), (0.0, 0.5), (0.5, 1.0), (1.0, 1.0)],
            "the two at 2.0 cross the threshold together"
        );
    }

    #[test]
    fn quantiles_interpolate_and_lie_between_order_statistics() {
        let sample: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        let median = median(&sample);
        assert_eq!((median.value, median.low, median.high), (Some(50.5), Some(41.0), Some(60.0)));
        near(quantile(&sample, 0.95).value, 95.05, 1e-9);
        assert_eq!(quantile(&[f64::NAN], 0.5), Estimated::NONE);
        assert_eq!(quantile(&[2.0, f64::INFINITY], 1.0).value, Some(f64::INFINITY));
    }

    /// The ranks of Conover's table A3 (binomial, p = 0.5), and none if the smallest and the largest value do not reach
    /// 95 %.
    #[test]
    fn a_small_sample_has_no_interval_that_it_cannot_have() {
        let ranks = |count: usize, at: f64| {
            let sample: Vec<f64> = (1..=count).map(|n| n as f64).collect();
            let quantile = quantile(&sample, at);
            assert_eq!(quantile.low.is_some(), quantile.high.is_some());
            quantile.low.zip(quantile.high)
        };
        for count in 1..=5 {
            assert_eq!(ranks(count, 0.5), None, "{count}: 1 - 2 / 2^{count} is less than 95 %");
        }
        assert_eq!(ranks(6, 0.5), Some((1.0, 6.0)), "1 - 2 / 64 is 97 %");
        assert_eq!((ranks(10, 0.5), ranks(20, 0.5)), (Some((2.0, 9.0)), Some((6.0, 15.0))));
        assert_eq!((ranks(20, 0.95), ranks(40, 0.95)), (None, None), "0.95^40 = 0.13 have all of it below");
        assert_eq!(ranks(100, 0.95), Some((91.0, 100.0)));
        assert_eq!((ranks(30, 1.0), ranks(9, 1.0), ranks(9, 0.0)), (None, None, None));
    }

    /// Against the table of Student's t, and a mean of two errors, which is not below 0.
    #[test]
    fn a_mean_of_few_numbers_has_a_wide_interval() {
        for (freedom, t) in [(1, 12.706), (2, 4.303), (3, 3.182), (4, 2.776), (9, 2.262), (10, 2.228), (120, 1.980)] {
            near(Some(student_t(freedom)), t, 5e-4);
        }
        near(Some(student_t(1199)), 1.9620, 1e-4);
        let errors = mean(&[0.02, 0.08]);
        near(errors.high, 0.05 + 12.706 * 0.03, 1e-4);
        assert_eq!(errors.low, Some(0.0));
        assert!(mean(&[-0.02, 0.08]).low < Some(-0.3));
    }

    #[test]
    fn means_and_rates_have_their_intervals() {
        let mean = mean(&[1.0, 2.0, 3.0, 4.0]);
        near(mean.value, 2.5, 1e-12);
        near(mean.high, 2.5 + 3.182 * (5.0f64 / 3.0 / 4.0).sqrt(), 1e-3);
        near(rate_per_h(0, 2.0).high, 1.498, 1e-3);
        near(rate_per_h(3, 1.0).high, 7.754, 1e-3); // Garwood's table
        assert_eq!(rate_per_h(3, 2.0).value, Some(1.5));
        for events in [700, 1000, 5000, 100_000] {
            let high = rate_per_h(events, 1.0).high.expect("a bound");
            assert!(high > events as f64, "at most {high} an hour, of {events} in one");
        }
        near(rate_per_h(1000, 1.0).high, 1053.5, 1.0); // half the 95th percentile of chi square with 2002 degrees of freedom
    }
}
