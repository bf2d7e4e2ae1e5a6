//! An endless series in bounded memory: every value while they are few, then one of two, one of four ..

/// Chooses which of two neighbours stays, and whether it is the second.
pub(super) type Choose<T> = fn(T, T) -> (T, bool);

/// The values of a series that are kept, each with its number.
#[derive(Debug)]
pub(super) struct Thinned<T> {
    kept: Vec<(u64, T)>,
    most_count: usize,
    choose: Choose<T>,
    /// How many values each that is kept stands for.
    stride: u64,
    /// The one of the later values to be kept.
    next: Option<(u64, T)>,
    count: u64,
    /// The last value.
    pub last: Option<(u64, T)>,
}

impl<T: Copy> Thinned<T> {
    /// Keeps fewer than `most_count`, except for two at the end.
    pub fn new(most_count: usize, choose: Choose<T>) -> Self {
        Thinned { kept: Vec::new(), most_count, choose, stride: 1, next: None, count: 0, last: None }
    }

    /// Takes the next value.
    pub fn push(&mut self, value: T) {
        let choose = self.choose;
        let of_two = move |(n, a): (u64, T), (m, b): (u64, T)| {
            let (chosen, is_second) = choose(a, b);
            (if is_second { m } else { n }, chosen)
        };
        let now = (self.count, value);
        self.last = Some(now);
        self.next = Some(self.next.map_or(now, |next| of_two(next, now)));
        self.count += 1;
        if !self.count.is_multiple_of(self.stride) {
            return;
        }
        self.kept.extend(self.next.take());
        if self.kept.len() >= self.most_count {
            self.kept = self.kept.chunks(2).filter_map(|pair| pair.iter().copied().reduce(of_two)).collect();
            self.stride *= 2;
        }
    }

    /// Those that are kept and the last one, in their order.
    pub fn all(&self) -> Vec<T> {
        let ends = self.next.or(self.kept.last().copied());
        let last = self.last.filter(|(n, _)| ends.is_some_and(|(end, _)| end < *n));
        self.kept.iter().copied().chain(self.next).chain(last).map(|(_, value)| value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_series_of_any_length_keeps_its_order_its_peak_and_its_last_value_in_a_limited_place() {
        let larger = |a: (u64, f64), b: (u64, f64)| if b.1 > a.1 { (b, true) } else { (a, false) };
        for (count, expected) in [(0, 0..1), (1, 1..2), (7, 7..8), (8, 4..7), (1000, 4..11), (100_003, 4..11)] {
            let mut series = Thinned::new(8, larger);
            for i in 0..count {
                series.push((i, if i == count / 3 { 9.0 } else { 1.0 }));
                assert!(series.kept.len() < 8, "{i} of {count}");
            }
            let all = series.all();
            assert!(expected.contains(&all.len()), "{count}: {all:?}");
            assert!(all.windows(2).all(|two| two[0].0 < two[1].0), "{count}: {all:?}");
            assert_eq!(all.last().map(|(i, _)| i + 1), Some(count).filter(|count| *count > 0));
            assert_eq!(all.iter().any(|(_, value)| *value == 9.0), count > 0, "{count}: {all:?}");
        }
    }
}
