//! Grey image and its background -> image of even illumination: clip((grey - background + offset) * gain + bias).

use super::wide::wide;

/// The three numbers of the flattening.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flatten {
    gain: f32,
    /// offset * gain + bias.
    level: f32,
}

impl Flatten {
    /// Offset and bias in grey levels. The gain must lie in 0..8, the level of a flat image, offset * gain + bias, in
    /// -1000..=1000; else a panic.
    pub fn new(offset_levels: f64, gain: f64, bias_levels: f64) -> Self {
        let level = offset_levels * gain + bias_levels;
        assert!((0.0..8.0).contains(&gain), "gain {gain}: expected 0 or more and less than 8");
        assert!((-1000.0..=1000.0).contains(&level), "level {level}: expected -1000 to 1000");
        Flatten { gain: gain as f32, level: level as f32 }
    }

    /// With a background in fractions of a level; rounded to the nearest level, an exact half to the even one.
    pub fn from_f32(&self, grey: &[u8], background: &[f32], out: &mut [u8]) {
        assert_eq!(grey.len(), background.len(), "grey image and background differ in size");
        assert_eq!(grey.len(), out.len(), "grey image and output differ in size");
        // Added to a small number, it leaves that number, rounded, in the lowest bits.
        const ROUND: f32 = 12_582_912.0; // 1.5 * 2^23
        let (gain, level) = (self.gain, self.level);
        for ((out, &g), &b) in out.iter_mut().zip(grey).zip(background) {
            let flat = ((f32::from(g) - b) * gain + level).clamp(0.0, 255.0);
            *out = (flat + ROUND).to_bits() as u8;
        }
    }

    /// With a background in whole levels, which is overwritten by the flat image; the product is kept to 1/4 level,
    /// then rounded, an exact half upwards.
    pub fn over_u8(&self, grey: &[u8], background: &mut [u8]) {
        assert_eq!(grey.len(), background.len(), "grey image and background differ in size");
        let gain_4096ths = (self.gain * 4096.0).round().min(32767.0) as i16;
        let level_quarters = (self.level * 4.0).round() as i16 + 2;
        flatten(grey, background, gain_4096ths, level_quarters);
    }
}

wide! {
    fn flatten(grey: &[u8], background: &mut [u8], gain_4096ths: i16, level_quarters: i16) {
        for (b, &g) in background.iter_mut().zip(grey) {
            let difference_64ths = (i16::from(g) - i16::from(*b)) << 6;
            let product_quarters = ((i32::from(difference_64ths) * i32::from(gain_4096ths)) >> 16) as i16;
            *b = ((product_quarters + level_quarters) >> 2).clamp(0, 255) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_formula_of_the_paper() {
        let paper = Flatten::new(50.0, 2.0, 20.0);
        let grey = [100, 100, 100, 100, 0, 255];
        let mut out = [100, 90, 160, 161, 255, 0];
        paper.over_u8(&grey, &mut out);
        assert_eq!(out, [120, 140, 0, 0, 0, 255]);
        paper.from_f32(&grey, &[100.0, 90.3, 159.9, 161.0, 255.0, 0.0], &mut out);
        assert_eq!(out, [120, 139, 0, 0, 0, 255]);
    }

    #[test]
    fn whole_levels_agree_with_fractions_for_every_difference() {
        for (offset, gain, bias) in [(50.0, 2.0, 20.0), (90.0, 1.1, 20.0), (-10.0, 7.99, 0.0), (0.0, 0.37, 128.0)] {
            let flatten = Flatten::new(offset, gain, bias);
            for g in 0..=255u8 {
                let background: Vec<u8> = (0..=255).collect();
                let (mut whole, mut fractions) = (background.clone(), [0; 256]);
                flatten.over_u8(&[g; 256], &mut whole);
                flatten.from_f32(
                    &[g; 256],
                    &background.iter().map(|&b| f32::from(b)).collect::<Vec<_>>(),
                    &mut fractions,
                );
                for (b, (&w, &f)) in whole.iter().zip(&fractions).enumerate() {
                    assert!(w.abs_diff(f) <= 1, "grey {g}, background {b}: {w} and {f}");
                    let exact = ((f64::from(g) - b as f64 + offset) * gain + bias).clamp(0.0, 255.0);
                    assert!((f64::from(w) - exact).abs() < 0.76, "grey {g}, background {b}: {w} for {exact}");
                    assert!((f64::from(f) - exact).abs() < 0.501, "grey {g}, background {b}: {f} for {exact}");
                }
            }
        }
    }
}
