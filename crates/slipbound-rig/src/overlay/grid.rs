//! The image of a calibration: the camera image with the grid drawn in.

use super::canvas::{Canvas, Colour, Text};
use slipbound::calibrate::{Calibration, GridMarker};
use slipbound::image::SizePx;
use slipbound::plane::Vec2;
use std::collections::BTreeMap;

const LINE: Colour = Colour::new(255, 222, 0);
const MARKER: Colour = Colour::new(255, 255, 255);
const OFF_GRID: Colour = Colour::new(232, 28, 36);
const DEFECT: Colour = Colour::new(200, 60, 230);
const PAPER: Colour = Colour::new(22, 25, 30);
/// The image's longer side has at least this many pixels.
const LONGER_MIN_PX: usize = 1280;
/// Straight segments between two nodes: the lines follow the lens distortion.
const PIECES_COUNT: usize = 6;
/// Height of the strip below the image.
const STRIP_PX: usize = 28;

/// Red, green and blue of the image, and its size: lines through the nodes of the map, a ring round every marker, red
/// for markers off the grid that were left out of the fit, defects in purple.
pub fn grid_picture(calibration: &Calibration) -> (Vec<u8>, SizePx) {
    let sensor = &calibration.sensor;
    let camera = sensor.image_px;
    let times = LONGER_MIN_PX.div_ceil(camera.width.max(camera.height)).max(1);
    let scale = times as f64;
    let shown = SizePx::new(camera.width * times, camera.height * times);
    let mut canvas = Canvas::new(shown);
    canvas.put(&enlarged(&calibration.mean_rgb, camera, times));
    let place = |p: Vec2| (p + Vec2::new(0.5, 0.5)) * scale;

    let markers: BTreeMap<[i32; 2], Vec2> = calibration.markers.iter().map(|m| (m.node, m.camera_px)).collect();
    let first = |axis: usize| markers.keys().map(|n| n[axis]).min().unwrap_or(0);
    let first = [first(0), first(1)];
    // The margin of the rectified image before the first node.
    let origin = calibration.origin_px();
    let camera_of = |node: [f64; 2]| {
        let at = Vec2::new(node[0] - f64::from(first[0]), node[1] - f64::from(first[1])) * sensor.pitch_px + origin;
        place(sensor.camera_from_rectified(at))
    };
    for node in markers.keys() {
        for (next, by) in [([node[0] + 1, node[1]], [1.0, 0.0]), ([node[0], node[1] + 1], [0.0, 1.0])] {
            if markers.contains_key(&next) {
                let points: Vec<Vec2> = (0..=PIECES_COUNT)
                    .map(|i| i as f64 / PIECES_COUNT as f64)
                    .map(|t| camera_of([f64::from(node[0]) + t * by[0], f64::from(node[1]) + t * by[1]]))
                    .collect();
                canvas.line(&points, 1.5, LINE.with_alpha(0.8));
            }
        }
    }
    let mut ring = |marker: &GridMarker, colour: Colour| {
        canvas.ring(place(marker.camera_px), 0.25 * sensor.pitch_px * scale, 1.5, colour);
    };
    calibration.markers.iter().for_each(|m| ring(m, MARKER));
    calibration.off_grid.iter().for_each(|m| ring(m, OFF_GRID));
    for &[left, top, right, bottom] in &sensor.defects_px {
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        let points: Vec<Vec2> = corners
            .map(|(x, y)| place(sensor.camera_from_rectified(Vec2::new(x as f64 - 0.5, y as f64 - 0.5))))
            .to_vec();
        canvas.line(&points, 2.0, DEFECT);
    }
    let mut whole = Canvas::new(SizePx::new(shown.width, shown.height + STRIP_PX));
    whole.fill(PAPER);
    whole.paste(&canvas, (0, 0));
    let said = format!(
        "{} markers, pitch {:.1} px, {:.3} pitch RMS off the grid; red: {} off it, not used; purple: defects",
        calibration.markers.len(),
        sensor.pitch_px,
        calibration.residual_pitch,
        calibration.off_grid.len()
    );
    whole.text((10, shown.height as i32 + 6), Text::Small, MARKER, &said);
    let mut rgb = Vec::new();
    whole.rgb_into(&mut rgb);
    (rgb, whole.size())
}

/// Every pixel as a square of `times` x `times`.
fn enlarged(rgb: &[u8], size: SizePx, times: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(rgb.len() * times * times);
    for row in rgb.chunks_exact(3 * size.width) {
        let from = out.len();
        row.chunks_exact(3).for_each(|pixel| (0..times).for_each(|_| out.extend_from_slice(pixel)));
        let wide = out[from..].to_vec();
        (1..times).for_each(|_| out.extend_from_slice(&wide));
    }
    out
}
