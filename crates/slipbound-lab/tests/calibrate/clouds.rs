//! Dots without a grid.

use crate::drawn::{Random, Truth, draw};
use crate::{frame, known, number};
use slipbound::calibrate::calibrate;
use slipbound::image::SizePx;
use slipbound::plane::{Homography, Vec2};
use slipbound::sensor::Polarity;
use std::collections::BTreeMap;

/// How dots without a grid are scattered.
#[derive(Debug, Clone, Copy)]
enum Cloud {
    /// Anywhere, also overlapping.
    Anywhere,
    /// None closer to another than seven tenths of the mean distance: as even as dots without order can be.
    Spaced,
}

/// An image of dots without a grid.
fn cloud(seed: u64, kind: Cloud, dots_count: usize, polarity: Polarity) -> (Vec<u8>, SizePx) {
    let mut random = Random::new(seed);
    let size = SizePx::new(640, 480);
    let (w, h) = (size.width as f64, size.height as f64);
    let mean_px = (w * h / dots_count as f64).sqrt();
    let least_px = if matches!(kind, Cloud::Spaced) { 0.7 * mean_px } else { 0.0 };
    let mut centres: Vec<Vec2> = Vec::new();
    let mut tries_count = 0;
    while centres.len() < dots_count && tries_count < 200 * dots_count {
        tries_count += 1;
        let p = Vec2::new(random.within(0.0, w), random.within(0.0, h));
        if centres.iter().all(|c| (*c - p).length() >= least_px) {
            centres.push(p);
        }
    }
    let truth = Truth { homography: Homography::IDENTITY, bend: [0.0; 5], half_span: 1.0 };
    let diameter_px = (mean_px * random.within(0.22, 0.46)).max(4.0);
    let mut cover = vec![0.0; size.area()];
    centres.iter().for_each(|c| draw(&mut cover, size, &truth, *c, diameter_px));
    let sign = if polarity == Polarity::Dark { -1.0 } else { 1.0 };
    let level = |c: &f64| (125.0 + sign * 60.0 * c + 2.5 * random.normal()).round().clamp(0.0, 255.0) as u8;
    (cover.iter().map(level).collect(), size)
}

/// A few of many dots always fit a grid by chance; a map fitted to those must be rejected.
#[test]
fn dots_on_no_grid_are_refused_with_the_reason() {
    let (from, count) = (number("SLIPBOUND_CALIBRATE_FROM", 0), number("SLIPBOUND_CALIBRATE_COUNT", 3));
    let mut reasons: BTreeMap<String, u32> = BTreeMap::new();
    for seed in from..from + count {
        for dots_count in [60, 120, 250, 500] {
            for kind in [Cloud::Anywhere, Cloud::Spaced] {
                for polarity in [Polarity::Dark, Polarity::Bright] {
                    let (grey, size) = cloud(seed, kind, dots_count, polarity);
                    let what = format!("seed {seed}, {dots_count} {polarity:?} dots, {kind:?}");
                    match calibrate(&[frame(&grey, size)], &known()) {
                        Ok(c) => panic!("{what}: a grid of {} dots, {:.3} pitch", c.markers.len(), c.residual_pitch),
                        Err(e) => {
                            println!("{what}: {e}");
                            let reason = e.to_string();
                            *reasons.entry(reason.split(':').next().unwrap_or_default().into()).or_default() += 1;
                        }
                    }
                }
            }
        }
    }
    println!("refused: {reasons:?}");
    // Each of these reasons applies to a cloud.
    let of_clouds = [
        "no grid of markers",
        "grid with holes",
        "markers off the grid",
        "too few markers for their scatter",
        "ambiguous pitch",
        "grid too narrow",
    ];
    assert!(reasons.keys().all(|r| of_clouds.contains(&r.as_str())), "{reasons:?}");
}

/// In these clouds a dozen or two dots fit a grid, with a third as many beside it: this is not glare on a finger,
/// because most dots are elsewhere.
#[test]
fn a_few_of_many_dots_on_a_grid_are_no_grid_with_glare() {
    for (seed, kind, dots_count, polarity) in [
        (4, Cloud::Anywhere, 250, Polarity::Bright),
        (6, Cloud::Spaced, 120, Polarity::Bright),
        (18, Cloud::Spaced, 250, Polarity::Dark),
        (24, Cloud::Anywhere, 500, Polarity::Dark),
    ] {
        let (grey, size) = cloud(seed, kind, dots_count, polarity);
        let error = calibrate(&[frame(&grey, size)], &known()).expect_err("no grid").to_string();
        assert!(error.starts_with("no grid of markers"), "seed {seed}: {error}");
    }
}
