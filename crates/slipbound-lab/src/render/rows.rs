//! Operations on every pixel of a row: light, blur, noise. Each colour is a row of its own until the last step.
//!
//! ```text
//!   light, skin --lit--> blurred along --five rows--> blurred across --noisy--> bytes --woven--> red green blue red ...
//! ```
//!
//! All kernels are compiled for each vector width, with the same bits, see [`slipbound::pixels::wide`].

use slipbound::pixels::wide::wide;

/// The gel under a row of pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Skin<'a> {
    /// Slope of the gel's depth along x and along y.
    pub slope: [&'a [f32]; 2],
    /// Contrast of the texture.
    pub contrast: &'a [f32],
    /// Brightness of the weave, -1 to 1.
    pub threads: &'a [f32],
    /// Darkness of the dots, 0 to 1.
    pub dots: &'a [f32],
    /// Gel coverage of a pixel, 0 to 1.
    pub gel: &'a [f32],
}

wide! {
    /// The light of one colour from the gel: `light * (1 + shade + texture) * (1 - dot)`. `toward`: change of the light
    /// by a slope along x and y.
    pub(super) fn lit(skin: Skin<'_>, toward: [f32; 2], darkness: f32, light: &[f32], out: &mut [f32]) {
        let Skin { slope: [slope_x, slope_y], contrast, threads, dots, gel } = skin;
        let shape = slope_x.iter().zip(slope_y).zip(contrast.iter().zip(threads));
        let lights = light.iter().zip(dots.iter().zip(gel));
        for (out, ((light, (dot, gel)), ((sx, sy), (contrast, thread)))) in out.iter_mut().zip(lights.zip(shape)) {
            let left_over = 1.0 - darkness * dot * gel;
            let texture = contrast * thread;
            *out = light * (1.0 + (toward[0] * sx + toward[1] * sy + texture) * gel) * left_over;
        }
    }

    /// Blurs a row along x by five taps; its outermost two pixels are unchanged.
    pub(super) fn blurred_along(from: &[f32], taps: [f32; 3], to: &mut [f32]) {
        let [middle, near, far] = taps;
        let inner = from.len() - 4;
        to[..2].copy_from_slice(&from[..2]);
        to[2 + inner..].copy_from_slice(&from[2 + inner..]);
        let (a, b, c, d, e) = (&from[..inner], &from[1..], &from[2..], &from[3..], &from[4..]);
        let taps = a.iter().zip(b).zip(c).zip(d).zip(e);
        for (out, ((((a, b), c), d), e)) in to[2..2 + inner].iter_mut().zip(taps) {
            *out = far * (a + e) + near * (b + d) + middle * c;
        }
    }

    /// Blurs across five rows.
    pub(super) fn blurred_across(rows: [&[f32]; 5], taps: [f32; 3], levels: &mut [f32]) {
        let ([a, b, c, d, e], [middle, near, far]) = (rows, taps);
        let five = a.iter().zip(b).zip(c).zip(d).zip(e);
        for (level, ((((a, b), c), d), e)) in levels.iter_mut().zip(five) {
            *level = far * (a + e) + near * (b + d) + middle * c;
        }
    }

    /// Adds noise that grows as the root of the level, and rounds.
    pub(super) fn noisy(levels: &[f32], noise: &[f32], noise_levels: f32, out: &mut [u8]) {
        for (out, (&level, noise)) in out.iter_mut().zip(levels.iter().zip(noise)) {
            let lit = if level > 4.0 { level } else { 4.0 };
            let noisy = level + noise_levels * (lit * (1.0 / 128.0)).sqrt() * noise;
            let held = if noisy > 0.0 { noisy } else { 0.0 };
            let held = if held < 255.0 { held } else { 255.0 };
            // The lowest bits of the sum are the nearest integer.
            *out = (held + (1 << 23) as f32).to_bits() as u8;
        }
    }

    /// Interleaves red, green and blue.
    pub(super) fn woven(red: &[u8], green: &[u8], blue: &[u8], rgb: &mut [u8]) {
        for (rgb, ((red, green), blue)) in rgb.chunks_exact_mut(3).zip(red.iter().zip(green).zip(blue)) {
            (rgb[0], rgb[1], rgb[2]) = (*red, *green, *blue);
        }
    }
}
