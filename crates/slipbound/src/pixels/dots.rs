//! Approximate positions of dots, to about half a pixel: grey image -> spots, by the difference of two box means.
//!
//! ```text
//!   +-----------+     response = mean of the ring - mean of the core (dark dots; reversed for bright ones)
//!   |   ring    |     on an image decimated, at most fourfold, to dots of 3 to 6 px: irregular, hollow and
//!   |  +-----+  |     doubled dots fuse into one peak, shading and grid lines of light cancel.
//!   |  |core |  |     A spot is a local maximum of the response, the strongest first, none within
//!   |  +-----+  |     SEPARATION_PITCH of a stronger one.
//!   +-----------+
//! ```

mod peaks;
mod response;

use crate::image::SizePx;
use crate::sensor::Polarity;
use peaks::Peaks;
pub use peaks::Spot;
use response::Response;

/// Finds spots of one dot size; owns all scratch memory.
#[derive(Debug, Clone)]
pub struct DotFinder {
    response: Response,
    peaks: Peaks,
}

impl DotFinder {
    /// A finder of dots of `diameter_px` on a grid of `pitch_px`, in grey images of `size`.
    pub fn new(size: SizePx, diameter_px: f64, pitch_px: f64, polarity: Polarity) -> Self {
        let response = Response::new(size, diameter_px, pitch_px, polarity);
        let peaks = Peaks::new(&response, pitch_px);
        DotFinder { response, peaks }
    }

    /// Spots whose contrast is at least `min_levels`, strongest first. `grey` holds the rows without gaps.
    pub fn run(&mut self, grey: &[u8], min_levels: f32) -> &[Spot] {
        self.response.run(grey);
        self.peaks.run(&self.response, min_levels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Vec2;

    /// Grey 150 with square dots of `side` px at the given places, `depth` levels darker.
    fn draw(size: SizePx, dots: &[(usize, usize)], side: usize, depth: u8) -> Vec<u8> {
        let mut grey = vec![150u8; size.area()];
        for &(cx, cy) in dots {
            for y in cy - side / 2..=cy + side / 2 {
                grey[y * size.width + cx - side / 2..][..2 * (side / 2) + 1].fill(150 - depth);
            }
        }
        grey
    }

    #[test]
    fn every_dot_is_one_spot_within_a_pixel() {
        let size = SizePx::new(130, 101);
        let dots = [(20, 20), (50, 22), (80, 19), (110, 20), (20, 60), (50, 61), (80, 62), (110, 85)];
        for side in [5, 9, 13] {
            let mut finder = DotFinder::new(size, side as f64, 30.0, Polarity::Dark);
            let spots = finder.run(&draw(size, &dots, side, 40), 8.0);
            assert_eq!(spots.len(), dots.len(), "side {side}");
            for &(x, y) in &dots {
                let dot = Vec2::new(x as f64, y as f64);
                let nearest = spots.iter().map(|s| (s.position - dot).length()).fold(f64::MAX, f64::min);
                assert!(nearest < 1.0, "side {side}, dot {dot:?}: {nearest} px off");
            }
        }
    }

    #[test]
    fn a_slope_of_light_and_a_bright_dot_are_no_dark_spots() {
        let size = SizePx::new(96, 96);
        let slope: Vec<u8> = (0..size.area()).map(|i| (40 + (i % 96) * 2) as u8).collect();
        let mut finder = DotFinder::new(size, 8.0, 30.0, Polarity::Dark);
        assert_eq!(finder.run(&slope, 2.0), &[]);
        let bright: Vec<u8> = draw(size, &[(48, 48)], 9, 60).iter().map(|v| 255 - v).collect();
        assert!(finder.run(&bright, 12.0).iter().all(|s| (s.position - Vec2::new(48.0, 48.0)).length() > 4.0));
        let mut finder = DotFinder::new(size, 8.0, 30.0, Polarity::Bright);
        assert_eq!(finder.run(&bright, 12.0).len(), 1);
    }

    #[test]
    fn a_doubled_dot_is_one_spot() {
        let size = SizePx::new(96, 96);
        let mut finder = DotFinder::new(size, 9.0, 30.0, Polarity::Dark);
        assert_eq!(finder.run(&draw(size, &[(44, 48), (52, 48)], 7, 50), 8.0).len(), 1);
    }
}
