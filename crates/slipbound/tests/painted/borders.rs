//! Markers at the camera's border in a rectified image that extends beyond it.

use crate::picture::{Painter, frame};
use slipbound::image::SizePx;
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor};
use slipbound::plane::{Homography, Vec2};
use slipbound::sensor::{Polarity, Rectification, Sensor, Skin};

const SIZE: SizePx = SizePx::new(640, 480);

/// Extent of the rectified image beyond the camera's left border, px.
const BEYOND_PX: f64 = 18.0;

/// A finger whose first column of dots, of 14 px, is this far from the left border of the camera image.
fn finger(inset_px: f64, skin: Skin, is_bright: bool) -> Painter {
    let painter = Painter::new(SIZE, 40.0, 14.0, skin, 0.0, 4);
    let first_px = painter.rest.iter().map(|p| p.x).fold(f64::MAX, f64::min);
    let rest = painter.rest.iter().map(|&p| p + Vec2::new(inset_px - first_px, 0.0)).collect();
    let homography = Homography([[1.0, 0.0, BEYOND_PX], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let crop_px = [0, 0, SIZE.width, SIZE.height];
    let rectification = Some(Rectification { homography, crop_px, distortion: None });
    let polarity = if is_bright { Polarity::Bright } else { Polarity::Dark };
    let sensor = Sensor { rectification, polarity, ..painter.sensor.clone() };
    assert_eq!(sensor.camera_from_rectified(Vec2::ZERO).x, -BEYOND_PX);
    Painter { sensor, rest, contrast_levels: if is_bright { -60.0 } else { 60.0 }, ..painter }
}

#[test]
fn markers_that_are_called_whole_are_where_they_are_and_those_that_leave_the_view_are_cut() {
    for (skin, is_bright) in [(Skin::Smooth, false), (Skin::Smooth, true), (Skin::Fabric, false)] {
        for inset_px in [10.0, 14.0, 20.0] {
            let painter = finger(inset_px, skin, is_bright);
            let settings = Settings::default();
            let mut builder = RestBuilder::new(&painter.sensor, &settings, SIZE).expect("valid");
            for i in 0..5 {
                let rgb = painter.paint(&painter.rest, None, 1000 + i);
                builder.add(&frame(&rgb, SIZE, i)).expect("bright");
            }
            let rest = builder.build(RestKind::Unloaded).expect("markers");
            let mut monitor = SlipMonitor::new(&painter.sensor, &settings, rest).expect("valid");
            let at = format!("{skin:?}, bright {is_bright}, {inset_px} px from the border");
            let (mut seq, mut whole_count) = (0, 0);
            for shift_px in [0.0, -2.0, -4.0, -6.0, -8.0, -10.0, -14.0, -18.0, -24.0] {
                let now: Vec<Vec2> = painter.rest.iter().map(|&p| p + Vec2::new(shift_px, 0.0)).collect();
                for _ in 0..3 {
                    monitor.step(&frame(&painter.paint(&now, None, seq), SIZE, seq), None);
                    seq += 1;
                }
                for m in monitor.markers().iter().filter(|m| m.matched) {
                    let seen = painter.sensor.camera_from_rectified(m.now);
                    let rest = painter.sensor.camera_from_rectified(m.rest);
                    let off_px = |p: &Vec2| (*p - rest).length();
                    let of = painter.rest.iter().min_by(|a, b| off_px(a).total_cmp(&off_px(b))).expect("dots");
                    let error_px = (seen - *of - Vec2::new(shift_px, 0.0)).length();
                    let most_px = if m.whole { 0.3 } else { 2.5 };
                    assert!(error_px <= most_px, "{at}, moved by {shift_px}: {error_px} px, whole {}", m.whole);
                    let is_first = rest.x < inset_px + 5.0;
                    whole_count += u32::from(m.whole && is_first && shift_px == 0.0);
                    let is_cut = seen.x < 7.0;
                    assert!(!(m.whole && is_cut), "{at}, moved by {shift_px}: whole at {} px", seen.x);
                }
            }
            assert!(whole_count >= 8, "{at}: {whole_count} whole at rest");
        }
    }
}
