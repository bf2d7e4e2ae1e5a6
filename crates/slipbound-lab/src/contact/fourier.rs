//! Fourier transforms of several signals at once, the same bits on every machine.
//!
//! ```text
//!                signal 0   1   2 .. 7
//!   sample 0 [ re: # # # # # # # # ]  [ im: # # # # # # # # ]      a row: one sample of each signal
//!   sample 1 [ ...                 ]  [ ...                 ]
//!   ...                                                            a butterfly takes whole rows: no value ever
//!   sample n [ ...                 ]  [ ...                 ]      meets one of another signal
//! ```
//!
//! Lengths are 2^a 3^b 5^c. The forward transform is a decimation in frequency, in place, which leaves the frequencies
//! in a permuted order ([`Fourier::places`]); the inverse is a decimation in time that takes them in that order, so
//! nothing is ever sorted. The inverse is the forward transform with real and imaginary parts exchanged. Twiddle
//! factors come from `libm`, each from an angle of at most an eighth of a turn. Products are never contracted with sums
//! (Rust never does so), so vectors of any width give the same bits.

use slipbound::pixels::wide::wide;
use std::sync::Arc;

/// Signals transformed together: a vector of AVX-512, two of AVX2, four of SSE2 and NEON.
pub(super) const LANES: usize = 8;

/// A real number of each signal.
pub(super) type Lanes = [f64; LANES];

pub(super) const NOTHING: Lanes = [0.0; LANES];

/// Doubles in a cache line. A row begins at the start of one: vectors across two lines take twice as long to load.
const LINE: usize = 8;

/// Samples of each signal.
#[derive(Debug)]
pub(super) struct Rows {
    numbers: Vec<f64>,
    count: usize,
}

impl Rows {
    pub fn zeros(count: usize) -> Self {
        Rows { numbers: vec![0.0; 2 * LANES * count + LINE - 1], count }
    }

    /// Real and imaginary parts.
    #[inline(always)]
    pub fn parts(&self) -> [&[Lanes]; 2] {
        let (rows, _) = self.numbers[aligned(&self.numbers)..].as_chunks();
        [&rows[..self.count], &rows[self.count..2 * self.count]]
    }

    /// The same, mutable.
    #[inline(always)]
    pub fn parts_mut(&mut self) -> [&mut [Lanes]; 2] {
        let from = aligned(&self.numbers);
        let (rows, _) = self.numbers[from..].as_chunks_mut();
        let (re, im) = rows[..2 * self.count].split_at_mut(self.count);
        [re, im]
    }

    /// Clears all but some rows.
    pub fn clear_outside(&mut self, kept: std::ops::Range<usize>) {
        for part in self.parts_mut() {
            part[..kept.start].fill(NOTHING);
            part[kept.end..].fill(NOTHING);
        }
    }
}

impl Clone for Rows {
    /// The alignment to cache lines differs in the copy.
    fn clone(&self) -> Self {
        let mut copy = Rows::zeros(self.count);
        copy.parts_mut().into_iter().zip(self.parts()).for_each(|(to, from)| to.copy_from_slice(from));
        copy
    }
}

/// Index of the first number at the start of a cache line.
#[inline(always)]
fn aligned(numbers: &[f64]) -> usize {
    numbers.as_ptr().align_offset(LINE * size_of::<f64>()).min(LINE - 1)
}

/// One stage: transforms of `radix` rows that are `span` rows apart.
#[derive(Debug)]
pub(super) struct Stage {
    radix: usize,
    span: usize,
    /// exp(-2 pi i j k / (radix span)), k = 1 to radix - 1 for each j below span.
    twiddles: Vec<Number>,
}

/// Transforms of one length.
#[derive(Debug, Clone)]
pub(super) struct Fourier {
    stages: Arc<[Stage]>,
    places: Arc<[u32]>,
}

impl Fourier {
    /// A transform of a length 2^a 3^b 5^c.
    pub fn new(length: usize) -> Self {
        let (mut stages, mut span) = (Vec::new(), length);
        for radix in radices(length) {
            let whole = span;
            span /= radix;
            let twiddles = (0..span).flat_map(|j| (1..radix).map(move |k| twiddle(j * k, whole))).collect();
            stages.push(Stage { radix, span, twiddles });
        }
        let places = (0..length).map(|k| place(&stages, k) as u32).collect();
        Fourier { stages: stages.into(), places }
    }

    /// The row of each frequency between a forward and an inverse transform.
    pub fn places(&self) -> &[u32] {
        &self.places
    }

    /// Samples in, frequencies out.
    pub fn forward(&self, rows: &mut Rows) {
        let [re, im] = rows.parts_mut();
        in_frequency(&self.stages, re, im);
    }

    /// Frequencies in, samples out, times the length.
    pub fn inverse(&self, rows: &mut Rows) {
        let [re, im] = rows.parts_mut();
        in_time(&self.stages, im, re);
    }
}

/// The factors of a length in the order of their stages. The last has no twiddle factors, so it is the largest. An odd
/// factor of two is merged with another factor: alone it makes more loads and stores than sums.
fn radices(length: usize) -> Vec<usize> {
    let (mut rest, mut radices) = (length, Vec::new());
    let odd_twos = length.trailing_zeros() % 2 == 1;
    let last = [8, 6, 2].into_iter().find(|&last| odd_twos && length.is_multiple_of(last));
    rest /= last.unwrap_or(1);
    for radix in [3, 5, 4] {
        while rest.is_multiple_of(radix) {
            radices.push(radix);
            rest /= radix;
        }
    }
    assert!(rest == 1, "{length} is no 2^a 3^b 5^c");
    radices.extend(last);
    radices
}

/// exp(-2 pi i at / whole), from an angle of at most an eighth of a turn.
fn twiddle(at: usize, whole: usize) -> Number {
    // In eighths of a turn: 8 at = octant whole + rest.
    let (octant, rest) = (8 * at / whole % 8, 8 * at % whole);
    let angle = |part: usize| std::f64::consts::FRAC_PI_4 * (part as f64 / whole as f64);
    let (s, c) = if octant % 2 == 0 {
        libm::sincos(angle(rest))
    } else {
        let (s, c) = libm::sincos(angle(whole - rest));
        (c, s)
    };
    match octant / 2 {
        0 => [c, -s],
        1 => [-s, -c],
        2 => [-c, s],
        _ => [s, c],
    }
}

fn place(stages: &[Stage], k: usize) -> usize {
    match stages {
        [] => 0,
        [stage, rest @ ..] => (k % stage.radix) * stage.span + place(rest, k / stage.radix),
    }
}

/// A complex number of one signal: butterflies are written in these.
type Number = [f64; 2];

#[inline(always)]
fn plus(a: Number, b: Number) -> Number {
    [a[0] + b[0], a[1] + b[1]]
}

#[inline(always)]
fn minus(a: Number, b: Number) -> Number {
    [a[0] - b[0], a[1] - b[1]]
}

#[inline(always)]
fn times(a: Number, factor: f64) -> Number {
    [a[0] * factor, a[1] * factor]
}

#[inline(always)]
fn turned(a: Number, [c, s]: Number) -> Number {
    [a[0] * c - a[1] * s, a[1] * c + a[0] * s]
}

/// a - ib
#[inline(always)]
fn minus_i(a: Number, b: Number) -> Number {
    [a[0] + b[1], a[1] - b[0]]
}

/// a + ib
#[inline(always)]
fn plus_i(a: Number, b: Number) -> Number {
    [a[0] - b[1], a[1] + b[0]]
}

#[inline(always)]
fn of_two([a, b]: [Number; 2]) -> [Number; 2] {
    [plus(a, b), minus(a, b)]
}

#[inline(always)]
fn of_three([a, b, c]: [Number; 3]) -> [Number; 3] {
    const SIN: f64 = 0.866_025_403_784_438_6;
    let (sum, difference) = (plus(b, c), times(minus(b, c), SIN));
    let middle = minus(a, times(sum, 0.5));
    [plus(a, sum), minus_i(middle, difference), plus_i(middle, difference)]
}

#[inline(always)]
fn of_four([a, b, c, d]: [Number; 4]) -> [Number; 4] {
    let (even, odd, across, down) = (plus(a, c), plus(b, d), minus(a, c), minus(b, d));
    [plus(even, odd), minus_i(across, down), minus(even, odd), plus_i(across, down)]
}

#[inline(always)]
fn of_five([a, b, c, d, e]: [Number; 5]) -> [Number; 5] {
    // Cosines and sines of one and two fifths of a turn.
    const COS: [f64; 2] = [0.309_016_994_374_947_45, -0.809_016_994_374_947_5];
    const SIN: [f64; 2] = [0.951_056_516_295_153_5, 0.587_785_252_292_473_1];
    let (near, far, beside, beyond) = (plus(b, e), plus(c, d), minus(b, e), minus(c, d));
    let mixed = |p: Number, q: Number, first: f64, second: f64| plus(times(p, first), times(q, second));
    let (one, two) = (plus(a, mixed(near, far, COS[0], COS[1])), plus(a, mixed(near, far, COS[1], COS[0])));
    let (up, down) = (mixed(beside, beyond, SIN[0], SIN[1]), mixed(beside, beyond, SIN[1], -SIN[0]));
    [plus(a, plus(near, far)), minus_i(one, up), minus_i(two, down), plus_i(two, down), plus_i(one, up)]
}

#[inline(always)]
fn of_six([a, b, c, d, e, f]: [Number; 6]) -> [Number; 6] {
    // Two and three have no common factor (I. J. Good, 1958): sample 3 i + 2 j, a half turn to the ik, a third to the
    // jk.
    let even = of_three([plus(a, d), plus(c, f), plus(e, b)]);
    let odd = of_three([minus(a, d), minus(c, f), minus(e, b)]);
    [even[0], odd[1], even[2], odd[0], even[1], odd[2]]
}

#[inline(always)]
fn of_eight([a, b, c, d, e, f, g, h]: [Number; 8]) -> [Number; 8] {
    let ([e0, e1, e2, e3], [o0, o1, o2, o3]) = (of_four([a, c, e, g]), of_four([b, d, f, h]));
    // An eighth of a turn, and three.
    let (o1, o3) = (minus_i(o1, o1), plus_i(o3, o3));
    let (o1, o3) = (times(o1, std::f64::consts::FRAC_1_SQRT_2), times(o3, -std::f64::consts::FRAC_1_SQRT_2));
    [
        plus(e0, o0),
        plus(e1, o1),
        minus_i(e2, o2),
        plus(e3, o3),
        minus(e0, o0),
        minus(e1, o1),
        plus_i(e2, o2),
        minus(e3, o3),
    ]
}

/// Applies a function of numbers to rows `span` apart, lane by lane. On copies, so that the compiler sees that no two
/// of them are the same row, and vectorises the loop.
#[inline(always)]
fn butterfly<const R: usize>(
    [re, im]: [&mut [Lanes]; 2],
    first: usize,
    span: usize,
    made: impl Fn([Number; R]) -> [Number; R],
) {
    let mut real: [Lanes; R] = std::array::from_fn(|k| re[first + k * span]);
    let mut imaginary: [Lanes; R] = std::array::from_fn(|k| im[first + k * span]);
    for lane in 0..LANES {
        let numbers = made(std::array::from_fn(|k| [real[k][lane], imaginary[k][lane]]));
        for k in 0..R {
            (real[k][lane], imaginary[k][lane]) = (numbers[k][0], numbers[k][1]);
        }
    }
    for k in 0..R {
        re[first + k * span] = real[k];
        im[first + k * span] = imaginary[k];
    }
}

/// A stage of either kind: twiddle factors after the transforms or before them.
#[inline(always)]
#[expect(
    clippy::redundant_closure,
    reason = "a call through `&transform` is not inlined, and then no vectors are made of it"
)]
fn each_group<const R: usize, const AFTER: bool>(
    stage: &Stage,
    [re, im]: [&mut [Lanes]; 2],
    transform: impl Fn([Number; R]) -> [Number; R],
) {
    let span = stage.span;
    for (re, im) in re.chunks_exact_mut(R * span).zip(im.chunks_exact_mut(R * span)) {
        if span == 1 {
            butterfly([re, im], 0, span, |numbers| transform(numbers));
            continue;
        }
        for (j, twiddles) in stage.twiddles.chunks_exact(R - 1).enumerate() {
            let turn = |numbers: [Number; R]| {
                std::array::from_fn(|k| if k == 0 { numbers[0] } else { turned(numbers[k], twiddles[k - 1]) })
            };
            butterfly(
                [re, im],
                j,
                span,
                |numbers| {
                    if AFTER { turn(transform(numbers)) } else { transform(turn(numbers)) }
                },
            );
        }
    }
}

wide! {
    fn in_frequency(stages: &[Stage], re: &mut [Lanes], im: &mut [Lanes]) {
        for stage in stages {
            match stage.radix {
                2 => each_group::<2, true>(stage, [re, im], of_two),
                3 => each_group::<3, true>(stage, [re, im], of_three),
                4 => each_group::<4, true>(stage, [re, im], of_four),
                5 => each_group::<5, true>(stage, [re, im], of_five),
                6 => each_group::<6, true>(stage, [re, im], of_six),
                _ => each_group::<8, true>(stage, [re, im], of_eight),
            }
        }
    }

    fn in_time(stages: &[Stage], re: &mut [Lanes], im: &mut [Lanes]) {
        for stage in stages.iter().rev() {
            match stage.radix {
                2 => each_group::<2, false>(stage, [re, im], of_two),
                3 => each_group::<3, false>(stage, [re, im], of_three),
                4 => each_group::<4, false>(stage, [re, im], of_four),
                5 => each_group::<5, false>(stage, [re, im], of_five),
                6 => each_group::<6, false>(stage, [re, im], of_six),
                _ => each_group::<8, false>(stage, [re, im], of_eight),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::grid::smooth_even_at_least;
    use slipbound::pixels::wide::{Vectors, with_vectors};

    /// Every length a grid of up to 320 cells can be padded to.
    fn lengths() -> impl Iterator<Item = usize> {
        (1..=160).map(|half| 2 * half).filter(|&length| smooth_even_at_least(length) == length)
    }

    /// Pseudo-random numbers, different for every signal.
    fn samples(length: usize) -> Rows {
        let mut rows = Rows::zeros(length);
        for (part, lanes) in rows.parts_mut().into_iter().enumerate() {
            for (i, number) in lanes.as_flattened_mut().iter_mut().enumerate() {
                *number = libm::sin(1e4 * (2 * i + part) as f64 + length as f64);
            }
        }
        rows
    }

    fn bits(rows: &Rows) -> Vec<u64> {
        rows.parts().into_iter().flatten().flatten().map(|number| number.to_bits()).collect()
    }

    /// Sum of the squares of all samples of one signal.
    fn power(rows: &Rows, lane: usize) -> f64 {
        rows.parts().into_iter().flatten().map(|lanes| lanes[lane] * lanes[lane]).sum()
    }

    #[test]
    fn every_length_gives_the_sum_of_its_definition() {
        for length in lengths() {
            let (fourier, before) = (Fourier::new(length), samples(length));
            let mut after = before.clone();
            fourier.forward(&mut after);
            let turns: Vec<(f64, f64)> =
                (0..length).map(|i| libm::sincos(-std::f64::consts::TAU * i as f64 / length as f64)).collect();
            let ([re, im], [after_re, after_im]) = (before.parts(), after.parts());
            for (k, &place) in fourier.places().iter().enumerate() {
                for lane in 0..LANES {
                    let (mut sum, place) = ([0.0, 0.0], place as usize);
                    for j in 0..length {
                        let (s, c) = turns[j * k % length];
                        sum = plus(sum, turned([re[j][lane], im[j][lane]], [c, s]));
                    }
                    let [re, im] = minus(sum, [after_re[place][lane], after_im[place][lane]]);
                    assert!(re.abs() + im.abs() < 1e-14 * length as f64, "{length}: frequency {k} of signal {lane}");
                }
            }
        }
    }

    #[test]
    fn there_and_back_is_times_the_length_and_no_power_is_lost() {
        for length in lengths() {
            let (fourier, before) = (Fourier::new(length), samples(length));
            let mut rows = before.clone();
            fourier.forward(&mut rows);
            for lane in 0..LANES {
                let (was, is) = (power(&before, lane) * length as f64, power(&rows, lane));
                assert!((was - is).abs() < 1e-13 * was, "{length}: {was} {is}");
            }
            fourier.inverse(&mut rows);
            let pairs =
                rows.parts().into_iter().flatten().flatten().zip(before.parts().into_iter().flatten().flatten());
            for (is, was) in pairs {
                assert!((is / length as f64 - was).abs() < 4e-15, "{length}: {is} {was}");
            }
        }
    }

    #[test]
    fn vectors_of_any_width_give_the_same_bits() {
        for length in lengths() {
            let fourier = Fourier::new(length);
            let there_and_back = || {
                let mut rows = samples(length);
                fourier.forward(&mut rows);
                let there = bits(&rows);
                fourier.inverse(&mut rows);
                (there, bits(&rows))
            };
            let widest = there_and_back();
            for narrower in [Vectors::Avx2, Vectors::Baseline] {
                assert!(widest == with_vectors(narrower, there_and_back), "{narrower:?}: {length}");
            }
        }
    }

    /// Exact at the quarters of a turn; to rounding for symmetry and for their length.
    #[test]
    fn twiddle_factors_are_on_the_circle() {
        let quarters = [0, 2, 4, 6].map(|at| twiddle(at, 8));
        assert_eq!(quarters, [[1.0, 0.0], [0.0, -1.0], [-1.0, 0.0], [0.0, 1.0]]);
        for whole in lengths() {
            for at in 1..whole {
                let ([c, s], [c_back, s_back]) = (twiddle(at, whole), twiddle(whole - at, whole));
                let off = (c - c_back).abs().max((s + s_back).abs()).max((c * c + s * s - 1.0).abs());
                assert!(off < 5e-16, "{at} of {whole}: {off}");
            }
        }
    }
}
