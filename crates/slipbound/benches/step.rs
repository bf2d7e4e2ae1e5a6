//! Time of each step of the method at 640x480 with some 400 markers in contact, and of the whole.
//!
//! Each step is timed in place, by a probe in the single pipeline.
#![allow(missing_docs, clippy::disallowed_types)] // a bench reads the clock

#[path = "../tests/picture/mod.rs"]
mod picture;

use criterion::{Criterion, criterion_group, criterion_main};
use picture::{Painter, Touch, frame};
use slipbound::image::SizePx;
use slipbound::monitor::{Probe, RestBuilder, RestKind, Settings, SlipMonitor, Step};
use slipbound::plane::{Homography, Vec2};
use slipbound::sensor::{Rectification, Sensor, Skin};
use std::time::{Duration, Instant};

const SIZE: SizePx = SizePx::new(640, 480);

struct Clock {
    wanted: Option<Step>,
    since: Instant,
    sum: Duration,
}

impl Probe for Clock {
    fn after(&mut self, step: Step, _: &SlipMonitor) {
        let now = Instant::now();
        if self.wanted == Some(step) {
            self.sum += now - self.since;
        }
        self.since = now;
    }
}

/// A finger in contact whose middle moves: frames to judge repeatedly.
fn recording(painter: &Painter) -> Vec<Vec<u8>> {
    let touch = Touch { centre: Vec2::new(320.0, 240.0), radii_px: Vec2::new(210.0, 180.0), strength_levels: 32.0 };
    (0..12)
        .map(|i| {
            let shift = Vec2::new(0.7, 0.2) * f64::from(6 - (i - 6i32).abs());
            let moved = |&p: &Vec2| if touch.depth(p) < 0.8 { p + shift } else { p };
            let now: Vec<Vec2> = painter.rest.iter().map(moved).collect();
            painter.paint(&now, Some(&touch), i as u64)
        })
        .collect()
}

fn monitor(sensor: &Sensor, settings: &Settings, painter: &Painter) -> SlipMonitor {
    let mut builder = RestBuilder::new(sensor, settings, SIZE).expect("valid");
    builder.add(&frame(&painter.paint(&painter.rest, None, 0), SIZE, 0)).expect("bright");
    SlipMonitor::new(sensor, settings, builder.build(RestKind::Unloaded).expect("markers")).expect("valid")
}

fn bench(c: &mut Criterion) {
    let fingers = [
        ("smooth", Skin::Smooth, false, Settings::default()),
        ("fabric", Skin::Fabric, false, Settings::default()),
        ("fabric rectified", Skin::Fabric, true, Settings::default()),
        ("fabric rectified, paper", Skin::Fabric, true, Settings::paper()),
    ];
    for (name, skin, rectified, settings) in fingers {
        let painter = Painter::new(SIZE, 26.5, 8.4, skin, 0.5, 9);
        let mut sensor = painter.sensor.clone();
        if rectified {
            // A slight rotation, so that every pixel is resampled.
            let homography = Homography([[1.0, 0.02, -5.0], [-0.02, 1.0, 6.0], [0.0, 0.0, 1.0]]);
            sensor.rectification = Some(Rectification { homography, crop_px: [0, 0, 640, 480], distortion: None });
        }
        let frames = recording(&painter);
        let mut monitor = monitor(&sensor, &settings, &painter);
        let mut group = c.benchmark_group(format!("{name}, {} markers", monitor.markers().len()));
        let steps =
            [Step::Imprint, Step::Contact, Step::Markers, Step::Motion, Step::Slip, Step::Evidence, Step::Verdict]
                .map(Some);
        for wanted in [None].into_iter().chain(steps) {
            let label = wanted.map_or("whole".to_string(), |s| format!("{s:?}").to_lowercase());
            group.bench_function(label, |b| {
                b.iter_custom(|rounds| {
                    let mut clock = Clock { wanted, since: Instant::now(), sum: Duration::ZERO };
                    let start = Instant::now();
                    for i in 0..rounds {
                        clock.since = Instant::now();
                        let rgb = &frames[i as usize % frames.len()];
                        monitor.step_probed(&frame(rgb, SIZE, i), None, &mut clock);
                    }
                    if wanted.is_some() { clock.sum } else { start.elapsed() }
                });
            });
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(2)).sample_size(30);
    targets = bench
}
criterion_main!(benches);
