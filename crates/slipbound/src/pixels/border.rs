//! Index of the pixel that replaces one beyond the border.

/// The index in `0..len` that mirrors `i` about the centres of the border pixels: for 0 1 2 3 it reads 2 1 0 1 2 3 2 1.
pub(crate) fn reflect_101(i: isize, len: usize) -> usize {
    let period = 2 * (len as isize - 1);
    if period == 0 {
        return 0;
    }
    let i = i.rem_euclid(period);
    i.min(period - i) as usize
}

/// The index in `0..len` that mirrors `i` about the outer edges of the border pixels: for 0 1 2 it reads 1 0 0 1 2 2 1.
pub(crate) fn reflect(i: isize, len: usize) -> usize {
    let period = 2 * len as isize;
    let i = i.rem_euclid(period);
    i.min(period - 1 - i) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirrors_about_centres_and_about_edges() {
        let at = |f: fn(isize, usize) -> usize| (-4..8).map(|i| f(i, 4)).collect::<Vec<_>>();
        assert_eq!(at(reflect_101), [2, 3, 2, 1, 0, 1, 2, 3, 2, 1, 0, 1]);
        assert_eq!(at(reflect), [3, 2, 1, 0, 0, 1, 2, 3, 3, 2, 1, 0]);
        assert_eq!(reflect_101(-5, 1), 0);
    }
}
