//! Mirrors a grey image in place.

/// Reverses the order of the columns.
pub fn columns(image: &mut [u8], width: usize) {
    image.chunks_exact_mut(width).for_each(<[u8]>::reverse);
}

/// Reverses the order of the rows.
pub fn rows(image: &mut [u8], width: usize) {
    // Reversing the whole image mirrors both axes; reversing its columns undoes one.
    image.reverse();
    columns(image, width);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_mirrors_one_axis() {
        let mut image = [1, 2, 3, 4, 5, 6];
        columns(&mut image, 3);
        assert_eq!(image, [3, 2, 1, 6, 5, 4]);
        rows(&mut image, 3);
        assert_eq!(image, [6, 5, 4, 3, 2, 1]);
    }
}
