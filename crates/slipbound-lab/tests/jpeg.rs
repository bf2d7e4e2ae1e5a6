//! Effect of JPEG on marker positions: only a loss without a preferred direction.

use slipbound::plane::Vec2;
use slipbound::port::FrameBuffer;
use slipbound_lab::contact::{Displacement, FingerSettings};
use slipbound_lab::jpeg::Codec;
use slipbound_lab::render::{CameraSettings, Renderer, Surface};

/// Centroid of the darkness around a position, in one channel of rows of RGB: weighted by the difference to the
/// brightest sixth of a window of 13 x 13 px.
fn centroid(rgb: &[u8], width_px: usize, place: Vec2, channel: usize) -> Vec2 {
    let (x, y) = (place.x.round() as usize, place.y.round() as usize);
    let window: Vec<(Vec2, f64)> = (y - 6..=y + 6)
        .flat_map(|y| (x - 6..=x + 6).map(move |x| (x, y)))
        .map(|(x, y)| (Vec2::new(x as f64, y as f64), f64::from(rgb[3 * (y * width_px + x) + channel])))
        .collect();
    let mut levels: Vec<f64> = window.iter().map(|(_, level)| *level).collect();
    levels.sort_by(f64::total_cmp);
    let bright = levels[levels.len() * 5 / 6];
    let (sum, weight) = window.iter().fold((Vec2::ZERO, 0.0), |(sum, weight), (at, level)| {
        let dark = (bright - level - 8.0).max(0.0);
        (sum + *at * dark, weight + dark)
    });
    sum / weight
}

#[test]
fn colour_stays_where_it_was_in_a_jpeg() {
    let settings = CameraSettings { noise_levels: 0.0, stuck_pixels_count: 0, ..CameraSettings::gelslim() };
    let mut camera = Renderer::new(settings, 1);
    let size = camera.size();
    let grid = FingerSettings::standard().grid;
    let displacement = vec![Displacement::default(); grid.cells_count()];
    let pressure_mpa = vec![0.0; grid.cells_count()];
    let untouched = Surface { grid: &grid, displacement: &displacement, pressure_mpa: &pressure_mpa };
    let mut rgb = vec![0; 3 * size.area()];
    camera.render(&untouched, 1, &mut rgb);
    let codec = Codec::new(size, 85);
    let mut frame = FrameBuffer::default();
    codec.encode(&rgb, &mut frame.encoded).expect("encodes");
    codec.decode(&mut frame).expect("decodes");
    let places: Vec<Vec2> = (0..camera.markers_at_rest_mm().len())
        .map(|marker| camera.marker_px(marker, &untouched))
        .filter(|at| at.x > 8.0 && at.y > 8.0 && at.x < size.width as f64 - 9.0 && at.y < size.height as f64 - 9.0)
        .collect();
    assert!(places.len() > 300, "{} markers in view", places.len());
    for (channel, name) in ["red", "green", "blue"].into_iter().enumerate() {
        let moved: Vec2 = places
            .iter()
            .map(|&at| centroid(&frame.pixels, size.width, at, channel) - centroid(&rgb, size.width, at, channel))
            .filter(|moved| moved.x.is_finite()) // where a channel is dark, it has no dots
            .fold(Vec2::ZERO, |sum, moved| sum + moved);
        let bias = moved / places.len() as f64;
        println!("{name}: JPEG moves the middle of a dot by {:.3}, {:.3} px in the mean", bias.x, bias.y);
        if name == "green" {
            assert!(bias.length() <= 0.03, "green is moved by {:.3}, {:.3} px", bias.x, bias.y);
        }
    }
}
