//! Kernels for wide vectors and for the baseline give the same reports, to the last bit.

mod picture;

use picture::{Painter, Touch};
use slipbound::image::{Frame, Gray, Pixels, Rgb, SizePx};
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor};
use slipbound::pixels::wide::{Vectors, with_vectors};
use slipbound::plane::{Homography, Vec2};
use slipbound::port::GripSample;
use slipbound::sensor::{Rectification, Shear, Skin};

/// Reports and markers of a press, a pull and a slide, as text.
fn judged(skin: Skin, size: SizePx, rectified: bool, grey: bool, settings: &Settings) -> Vec<String> {
    let mut painter = Painter::new(size, 0.0523 * size.width as f64, 0.0166 * size.width as f64, skin, 0.5, 4);
    painter.sensor.shear = Some(Shear { stiffness_n_per_pitch: 0.2, provenance: "assumed".into() });
    if rectified {
        let homography = Homography([[0.98, 0.03, -3.0], [-0.02, 1.01, 4.0], [1e-5, 2e-5, 1.0]]);
        let crop_px = [4, 3, size.width - 4, size.height - 3];
        painter.sensor.rectification = Some(Rectification { homography, crop_px, distortion: None });
    }
    let (width, height) = (size.width as f64, size.height as f64);
    let touch = Touch {
        centre: Vec2::new(0.5 * width, 0.52 * height),
        radii_px: Vec2::new(0.3 * width, 0.31 * height),
        strength_levels: 30.0,
    };
    let pictures: Vec<Vec<u8>> = (0..14)
        .map(|i| {
            let shift = Vec2::new(0.9, 0.3) * f64::from((i - 5).max(0));
            let moved = |&p: &Vec2| if touch.depth(p) < 0.8 { p + shift } else { p };
            let now: Vec<Vec2> = painter.rest.iter().map(moved).collect();
            let rgb = painter.paint(&now, (i > 0).then_some(&touch), i as u64);
            if grey { rgb.chunks(3).map(|p| p[1]).collect() } else { rgb }
        })
        .collect();
    let frame = |seq: usize| {
        let pixels = if grey {
            Pixels::Gray(Gray::new(&pictures[seq], size).expect("whole"))
        } else {
            Pixels::Rgb(Rgb::new(&pictures[seq], size).expect("whole"))
        };
        Frame { pixels, seq: seq as u64, time_ns: Some(seq as u64 * 33_000_000) }
    };
    let mut builder = RestBuilder::new(&painter.sensor, settings, size).expect("valid");
    builder.add(&frame(0)).expect("bright");
    let rest = builder.build(RestKind::Unloaded).expect("markers");
    let mut monitor = SlipMonitor::new(&painter.sensor, settings, rest).expect("valid");
    (0..pictures.len())
        .map(|seq| {
            let report = monitor.step(&frame(seq), Some(GripSample { force_n: 8.0 }));
            let regions = (monitor.contact_region().area_px2(), monitor.inner_region().area_px2());
            format!("{report:?} {regions:?} {:?}", monitor.markers())
        })
        .collect()
}

#[test]
fn wide_and_plain_kernels_give_the_same_reports() {
    // Widths that are multiples of the vector width, and others.
    for (skin, size, rectified, grey, settings) in [
        (Skin::Smooth, SizePx::new(320, 240), false, false, Settings::default()),
        (Skin::Smooth, SizePx::new(307, 231), true, false, Settings::default()),
        (Skin::Fabric, SizePx::new(307, 231), false, false, Settings::default()),
        (Skin::Fabric, SizePx::new(320, 240), true, false, Settings::default()),
        (Skin::Fabric, SizePx::new(333, 250), false, true, Settings::default()),
        (Skin::Fabric, SizePx::new(320, 240), true, false, Settings::paper()),
    ] {
        let wide = judged(skin, size, rectified, grey, &settings);
        assert!(
            wide.iter().filter(|report| report.contains("motion: Some(")).count() > 5,
            "{skin:?}: hardly a contact"
        );
        for narrower in [Vectors::Avx512, Vectors::Avx2, Vectors::Baseline] {
            let plain = with_vectors(narrower, || judged(skin, size, rectified, grey, &settings));
            for (seq, (wide, plain)) in wide.iter().zip(&plain).enumerate() {
                assert_eq!(
                    wide, plain,
                    "{narrower:?}: {skin:?} {size}, rectified {rectified}, grey {grey}: frame {seq}"
                );
            }
        }
    }
}
