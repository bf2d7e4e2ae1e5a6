//! Missed frames while the finger is held: an unobserved motion by a pitch is not mistaken for no motion.

mod picture;

use picture::{Painter, Random, Touch, frame};
use slipbound::image::{Frame, SizePx};
use slipbound::monitor::{Reason, RestBuilder, RestKind, Settings, SlipMonitor, SlipReport, SlipState};
use slipbound::plane::Vec2;
use slipbound::sensor::Skin;

const SIZE: SizePx = SizePx::new(320, 240);
const PITCH_PX: f64 = 18.0;

/// A finger whose dots extend beyond the camera's view, so that as many come into view as leave it.
struct Finger {
    painter: Painter,
    dots: Vec<Vec2>,
    monitor: SlipMonitor,
    seq: u64,
    now_ns: u64,
}

impl Finger {
    fn new(jitter_px: f64, times_seed: u64) -> Self {
        let painter = Painter::new(SIZE, PITCH_PX, 6.0, Skin::Smooth, jitter_px, times_seed);
        let (first, last) = (painter.rest[0], painter.rest[painter.rest.len() - 1]);
        let mut random = Random::new(times_seed + 1);
        let mut dots = painter.rest.clone();
        let (columns, rows) = ((last.x - first.x) / PITCH_PX, (last.y - first.y) / PITCH_PX);
        let (columns, rows) = (columns.round() as i32, rows.round() as i32);
        for y in -4..=rows + 4 {
            for x in -4..=columns + 4 {
                if !((0..=columns).contains(&x) && (0..=rows).contains(&y)) {
                    let jitter = Vec2::new(random.even() - 0.5, random.even() - 0.5) * (2.0 * jitter_px);
                    dots.push(first + Vec2::new(f64::from(x), f64::from(y)) * PITCH_PX + jitter);
                }
            }
        }
        let settings = Settings::default();
        let mut builder = RestBuilder::new(&painter.sensor, &settings, SIZE).expect("valid");
        builder.add(&frame(&painter.paint(&dots, None, 0), SIZE, 0)).expect("bright");
        let rest = builder.build(RestKind::Unloaded).expect("markers");
        let monitor = SlipMonitor::new(&painter.sensor, &settings, rest).expect("valid");
        Finger { painter, dots, monitor, seq: 0, now_ns: 0 }
    }

    fn see(&mut self, after_ms: u64, moved: Vec2, held: bool) -> SlipReport {
        self.seq += 1;
        self.now_ns += after_ms * 1_000_000;
        let now: Vec<Vec2> = self.dots.iter().map(|&dot| dot + moved).collect();
        let touch = Touch { centre: Vec2::new(160.0, 120.0), radii_px: Vec2::new(90.0, 75.0), strength_levels: 30.0 };
        let rgb = self.painter.paint(&now, held.then_some(&touch), self.seq);
        let pixels = frame(&rgb, SIZE, self.seq).pixels;
        self.monitor.step(&Frame { pixels, seq: self.seq, time_ns: Some(self.now_ns) }, None)
    }

    /// Held still for five frames at 30 Hz.
    fn hold(&mut self, moved: Vec2) {
        for _ in 0..5 {
            let report = self.see(33, moved, true);
            assert_ne!(report.state, SlipState::Unjudged, "{report:?}");
        }
    }

    /// Largest error of the matched markers, px.
    fn worst_px(&self, moved: Vec2) -> f64 {
        let found = self.monitor.markers().iter().filter(|m| m.matched);
        found.map(|m| (m.now_from_rest() - moved).length()).fold(0.0, f64::max)
    }
}

#[test]
fn a_pitch_of_motion_in_half_a_second_without_frames_is_seen() {
    for (i, pitches) in [(0.0, 0.0), (0.7, 0.0), (0.0, -1.0), (1.0, 1.0), (-1.5, 0.4), (2.0, 0.0)].iter().enumerate() {
        let mut finger = Finger::new(0.5, 30 + i as u64);
        finger.hold(Vec2::ZERO);
        let moved = Vec2::new(pitches.0, pitches.1) * PITCH_PX;
        let report = finger.see(500, moved, true);
        assert_ne!(report.state, SlipState::Unjudged, "{pitches:?}: {report:?}");
        assert!(finger.worst_px(moved) < 0.1 * PITCH_PX, "{pitches:?}: {} px off", finger.worst_px(moved));
    }
}

/// The clock of a camera that was plugged in again restarts: the length of the gap is unknown.
#[test]
fn a_clock_that_was_set_back_is_a_gap() {
    let mut finger = Finger::new(0.5, 31);
    finger.now_ns = 5_000_000_000;
    finger.hold(Vec2::ZERO);
    finger.now_ns = 0;
    let moved = Vec2::new(PITCH_PX, 0.0);
    finger.see(1, moved, true);
    assert!(finger.worst_px(moved) < 0.1 * PITCH_PX, "{} px off", finger.worst_px(moved));
}

#[test]
fn where_no_marker_can_be_told_from_the_next_nothing_is_judged_until_the_finger_is_free() {
    let mut finger = Finger::new(0.0, 50);
    finger.hold(Vec2::ZERO);
    let moved = Vec2::new(PITCH_PX, 0.0);
    for (after_ms, since_ms) in [(500, 500), (33, 533)] {
        let report = finger.see(after_ms, moved, true);
        assert_eq!(report.state, SlipState::Unjudged);
        assert_eq!(report.reason, Some(Reason::Gap { since_ns: Some(since_ms * 1_000_000) }));
    }
    let states: Vec<SlipState> = (0..4).map(|_| finger.see(33, Vec2::ZERO, false).state).collect();
    assert_eq!(states[3], SlipState::NoContact, "{states:?}");
    assert!(finger.worst_px(Vec2::ZERO) < 0.1 * PITCH_PX);
    finger.hold(Vec2::ZERO);
}
