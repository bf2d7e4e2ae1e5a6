//! Accuracy of the markers on painted fingers with known ground truth.

use crate::picture::{Painter, Random, frame};
use slipbound::image::SizePx;
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor};
use slipbound::plane::{Homography, Vec2};
use slipbound::sensor::{Polarity, Rectification, Sensor, Skin};

const SIZE: SizePx = SizePx::new(640, 480);

fn monitor(painter: &Painter, settings: &Settings) -> SlipMonitor {
    let mut builder = RestBuilder::new(&painter.sensor, settings, SIZE).expect("valid");
    for i in 0..10 {
        let rgb = painter.paint(&painter.rest, None, 1000 + i);
        builder.add(&frame(&rgb, SIZE, i)).expect("bright");
    }
    let rest = builder.build(RestKind::Unloaded).expect("markers");
    SlipMonitor::new(&painter.sensor, settings, rest).expect("valid")
}

/// RMS error per axis of every marker over frames shifted by random fractions of a pixel.
fn centroid_rms_px(painter: &Painter, frames: u64) -> f64 {
    let mut monitor = monitor(painter, &Settings::default());
    let mut random = Random::new(5);
    let (mut sum, mut count) = (0.0, 0u32);
    for i in 0..frames {
        let shift = Vec2::new(random.even() - 0.5, random.even() - 0.5) * 3.0;
        let now: Vec<Vec2> = painter.rest.iter().map(|&p| p + shift).collect();
        let rgb = painter.paint(&now, None, i);
        monitor.step(&frame(&rgb, SIZE, i), None);
        assert_eq!(monitor.markers().len(), painter.rest.len(), "every dot is a marker");
        for m in monitor.markers() {
            assert!(m.matched, "marker {} lost", m.id);
            let truth = now.iter().min_by(|a, b| (**a - m.now).length().total_cmp(&(**b - m.now).length()));
            sum += (m.now - *truth.expect("dots")).length_squared();
            count += 2;
        }
    }
    (sum / f64::from(count)).sqrt()
}

/// RMS error per axis, in px of the camera, of markers found in an image rectified by a homography.
fn rectified_rms_px(painter: &Painter) -> f64 {
    let homography = Homography([[0.97, 0.06, 10.0], [-0.05, 0.98, 22.0], [2.0e-5, -6.0e-5, 1.0]]);
    let rectification = Some(Rectification { homography, crop_px: [0, 0, 640, 480], distortion: None });
    let sensor = Sensor { rectification, ..painter.sensor.clone() };
    let straight = Painter { sensor, ..painter.clone() };
    let mut monitor = monitor(&straight, &Settings::default());
    let mut random = Random::new(6);
    let (mut sum, mut count) = (0.0, 0u32);
    for i in 0..6 {
        let shift = Vec2::new(random.even() - 0.5, random.even() - 0.5) * 3.0;
        let now: Vec<Vec2> = painter.rest.iter().map(|&p| p + shift).collect();
        let rgb = painter.paint(&now, None, i);
        monitor.step(&frame(&rgb, SIZE, i), None);
        for m in monitor.markers().iter().filter(|m| m.whole) {
            let seen = straight.sensor.camera_from_rectified(m.now);
            let truth = now.iter().min_by(|a, b| (**a - seen).length().total_cmp(&(**b - seen).length()));
            sum += (seen - *truth.expect("dots")).length_squared();
            count += 2;
        }
    }
    (sum / f64::from(count)).sqrt()
}

#[test]
fn bright_dots_are_found_like_dark_ones() {
    let dark = Painter::new(SIZE, 23.0, 8.0, Skin::Smooth, 0.5, 1);
    let sensor = Sensor { polarity: Polarity::Bright, ..dark.sensor.clone() };
    let bright = Painter { sensor, contrast_levels: -60.0, ..dark };
    let rms_px = centroid_rms_px(&bright, 4);
    println!("bright dots of 8 px: RMS {rms_px:.4} px per axis");
    assert!(rms_px <= 0.05, "{rms_px} px");
}

/// Rectifying pixels instead of points costs a twentieth of the accuracy.
#[test]
fn rectified_markers_are_as_exact_as_those_of_a_straight_view() {
    for (diameter_px, pitch_px) in [(5.6, 15.2), (8.0, 23.0), (12.0, 40.0)] {
        let painter = Painter::new(SIZE, pitch_px, diameter_px, Skin::Smooth, 0.5, 3);
        let (straight, rectified) = (centroid_rms_px(&painter, 6), rectified_rms_px(&painter));
        println!("diameter {diameter_px:4.1} px: RMS {straight:.4} px straight, {rectified:.4} px rectified");
        assert!(rectified <= 0.05 && rectified <= 1.15 * straight, "diameter {diameter_px}: {rectified} px");
    }
}

/// The Cramer-Rao bound per axis for a dot of this shape in white noise of this strength: no unbiased estimator is
/// better. The light around the dot is assumed known; JPEG, which is applied after the noise, cannot lower the bound.
fn cramer_rao_px(painter: &Painter) -> f64 {
    let noise_levels = painter.noise_levels;
    let mut information = 0.0;
    let (step, reach) = (1e-3, painter.sensor.marker_diameter_px + 6.0);
    let n = reach.ceil() as i32;
    for y in -n..=n {
        for x in -n..=n {
            let p = Vec2::new(f64::from(x) + 0.3, f64::from(y) - 0.2);
            let at = |d: f64| painter.shadow((p + Vec2::new(d, 0.0)).length()) * painter.contrast_levels;
            let slope = (at(step) - at(-step)) / (2.0 * step);
            information += slope * slope;
        }
    }
    noise_levels / information.sqrt()
}

#[test]
fn dots_of_8_px_and_more_are_found_to_a_twentieth_of_a_pixel() {
    for (diameter_px, pitch_px) in [(8.0, 23.0), (9.3, 28.0), (12.0, 40.0), (18.0, 60.0), (25.0, 70.0)] {
        let painter = Painter::new(SIZE, pitch_px, diameter_px, Skin::Smooth, 0.5, 1);
        let rms_px = centroid_rms_px(&painter, 8);
        println!("diameter {diameter_px:4.1} px, contrast 60, noise 3, JPEG 85: RMS {rms_px:.4} px per axis");
        assert!(rms_px <= 0.05, "diameter {diameter_px}: {rms_px} px");
    }
}

#[test]
fn smaller_dots_come_within_a_third_of_the_cramer_rao_bound() {
    for (diameter_px, pitch_px) in [(4.0, 13.0), (5.0, 15.2), (5.6, 15.2), (7.0, 20.0)] {
        for jpeg_quality in [None, Some(85)] {
            let painter = Painter { jpeg_quality, ..Painter::new(SIZE, pitch_px, diameter_px, Skin::Smooth, 0.5, 2) };
            let (rms_px, bound_px) = (centroid_rms_px(&painter, 6), cramer_rao_px(&painter));
            let ratio = rms_px / bound_px;
            println!(
                "diameter {diameter_px:3.1} px, contrast 60, noise 3, JPEG {jpeg_quality:?}: \
                 RMS {rms_px:.4} px, Cramer-Rao bound {bound_px:.4} px, ratio {ratio:.2}"
            );
            assert!(ratio <= 1.3, "diameter {diameter_px}, JPEG {jpeg_quality:?}: {ratio} times the bound");
        }
    }
}
