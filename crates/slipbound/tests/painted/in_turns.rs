//! A camera at 90 Hz: markers are searched in every third frame, or in every fifth while none is missing, and tracked
//! in the others.

use crate::picture::{Painter, Touch, frame};
use slipbound::image::{Frame, SizePx};
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor, SlipReport};
use slipbound::plane::Vec2;
use slipbound::port::GripSample;
use slipbound::sensor::Skin;

const SIZE: SizePx = SizePx::new(320, 240);
const PITCH_PX: f64 = 16.0;
const PRESSED_FRAMES: u64 = 18;

/// A pressed finger at 90 Hz whose markers in the contact are moved as given, frame by frame.
struct Pressed {
    painter: Painter,
    touch: Touch,
    monitor: SlipMonitor,
    seq: u64,
}

impl Pressed {
    fn new(skin: Skin) -> Self {
        let painter = Painter::new(SIZE, PITCH_PX, 5.5, skin, 0.5, 9);
        let centre = Vec2::new(160.0, 120.0);
        let touch = Touch { centre, radii_px: Vec2::new(105.0, 90.0), strength_levels: 32.0 };
        let mut builder = RestBuilder::new(&painter.sensor, &Settings::default(), SIZE).expect("valid");
        builder.add(&frame(&painter.paint(&painter.rest, None, 0), SIZE, 0)).expect("bright");
        let rest = builder.build(RestKind::Unloaded).expect("markers");
        let monitor = SlipMonitor::new(&painter.sensor, &Settings::default(), rest).expect("valid");
        let mut pressed = Pressed { painter, touch, monitor, seq: 0 };
        for _ in 0..PRESSED_FRAMES {
            pressed.show(&pressed.moved(Vec2::ZERO));
        }
        pressed
    }

    /// All markers, those in the contact moved.
    fn moved(&self, shift: Vec2) -> Vec<Vec2> {
        let inside = |p: Vec2| if self.touch.depth(p) < 0.8 { p + shift } else { p };
        self.painter.rest.iter().map(|&p| inside(p)).collect()
    }

    fn show(&mut self, dots: &[Vec2]) -> SlipReport {
        self.seq += 1;
        let rgb = self.painter.paint(dots, Some(&self.touch), self.seq);
        let time_ns = Some(self.seq * 1_000_000_000 / 90);
        let shown = Frame { time_ns, ..frame(&rgb, SIZE, self.seq) };
        self.monitor.step(&shown, Some(GripSample { force_n: 10.0 }))
    }

    /// Root mean square and largest distance of the whole markers from the dots, px.
    fn off_px(&self, dots: &[Vec2]) -> [f64; 2] {
        let nearest = |now: Vec2| dots.iter().map(|d| (*d - now).length()).fold(f64::MAX, f64::min);
        let offs: Vec<f64> = self.monitor.markers().iter().filter(|m| m.whole).map(|m| nearest(m.now)).collect();
        assert!(offs.len() > 200, "{} whole markers", offs.len());
        let squares: f64 = offs.iter().map(|off| off * off).sum();
        [(squares / offs.len() as f64).sqrt(), offs.iter().fold(0.0, |most, &off| f64::max(most, off))]
    }
}

#[test]
fn markers_that_are_followed_are_as_exact_as_those_that_are_searched() {
    for skin in [Skin::Smooth, Skin::Fabric] {
        let mut pressed = Pressed::new(skin);
        for i in 0..24 {
            // Accelerates, then oscillates.
            let way_px = if i < 12 { 0.06 * f64::from(i * i) } else { 8.6 + 1.8 * f64::from(i % 2) };
            let dots = pressed.moved(Vec2::new(0.8, -0.6) * way_px);
            pressed.show(&dots);
            let [rms, most] = pressed.off_px(&dots);
            assert!(rms < 0.2 && most < 1.0, "{skin:?}, frame {i}: {rms:.3} px, {most:.3} at most");
        }
    }
}

/// A pressed finger of each skin whose next frame is the first, second or third of the search schedule.
fn before_each_turn() -> impl Iterator<Item = (String, Pressed)> {
    [Skin::Smooth, Skin::Fabric].into_iter().flat_map(|skin| [0, 1, 2].map(|later| (skin, later))).map(
        |(skin, later)| {
            let mut pressed = Pressed::new(skin);
            for _ in 0..later {
                pressed.show(&pressed.moved(Vec2::ZERO));
            }
            (format!("{skin:?}, {later} frames later"), pressed)
        },
    )
}

#[test]
fn a_jump_between_two_searches_is_followed_at_once() {
    for (which, mut pressed) in before_each_turn() {
        let dots = pressed.moved(Vec2::new(0.27 * PITCH_PX, 0.0));
        pressed.show(&dots);
        let [rms, most] = pressed.off_px(&dots);
        assert!(rms < 0.2 && most < 1.0, "{which}: {rms:.3} px, {most:.3} at most");
    }
}

#[test]
fn dots_that_vanish_between_two_searches_are_lost_at_once() {
    for (which, mut pressed) in before_each_turn() {
        let dots: Vec<Vec2> = pressed.painter.rest.iter().copied().filter(|p| p.x < 280.0).collect();
        let gone = pressed.painter.rest.len() - dots.len();
        let report = pressed.show(&dots);
        assert!(report.markers.lost as usize >= gone - 2, "{which}: {gone} gone, {:?}", report.markers);
        let report = pressed.show(&pressed.moved(Vec2::ZERO));
        assert!(report.markers.lost <= 2, "{which}: they are back, {:?}", report.markers);
    }
}

#[test]
fn a_marker_that_shows_again_is_found_as_soon_as_in_every_frame_of_a_slow_camera() {
    // The next frame of a camera at 30 Hz would be the fourth.
    for hidden_frames in 4..10 {
        let mut pressed = Pressed::new(Skin::Smooth);
        let dots = pressed.moved(Vec2::ZERO);
        let without: Vec<Vec2> =
            dots.iter().copied().filter(|p| (*p - pressed.touch.centre).length() > 0.7 * PITCH_PX).collect();
        let hidden = (dots.len() - without.len()) as u32;
        let lost = (0..hidden_frames).map(|_| pressed.show(&without).markers.lost).last();
        assert_eq!(lost, Some(hidden), "{hidden_frames} frames");
        let lost = [0; 4].map(|_| pressed.show(&dots).markers.lost);
        assert_eq!(lost[3], 0, "{hidden_frames} frames: {lost:?}");
    }
}

#[test]
fn a_lost_marker_goes_on_with_its_neighbours_between_two_searches() {
    let mut pressed = Pressed::new(Skin::Smooth);
    let away = |p: &Vec2| (*p - pressed.touch.centre).length();
    let lost = (0..pressed.painter.rest.len())
        .min_by(|&a, &b| away(&pressed.painter.rest[a]).total_cmp(&away(&pressed.painter.rest[b])))
        .expect("dots");
    let at_rest = pressed.painter.rest[lost];
    let nearest = |m: &&slipbound::monitor::Marker| (m.rest - at_rest).length() < 1.0;
    let id = pressed.monitor.markers().iter().find(nearest).expect("its marker").id as usize;
    for i in 0..8 {
        let mut dots = pressed.moved(Vec2::new(2.0, -1.0) * f64::from(i));
        let place = dots.remove(lost);
        pressed.show(&dots);
        let marker = pressed.monitor.markers()[id];
        let off_px = (marker.now - place).length();
        assert!(!marker.matched && off_px < 0.7, "frame {i}: {off_px:.2} px off, {marker:?}");
    }
}

#[test]
fn the_imprint_is_looked_at_in_every_third_frame_and_its_age_is_told() {
    let mut pressed = Pressed::new(Skin::Smooth);
    let ages: Vec<u32> = (0..30)
        .map(|_| pressed.show(&pressed.moved(Vec2::ZERO)).evidence.expect("a contact that has settled"))
        .map(|evidence| evidence.imprint_age_frames)
        .collect();
    assert!(ages.windows(2).all(|pair| pair[1] == 0 || pair[1] == pair[0] + 1), "{ages:?}");
    // It waits one frame longer where markers are searched.
    let looks = ages.iter().filter(|age| **age == 0).count();
    assert!(ages.iter().all(|age| *age <= 3) && (9..=10).contains(&looks), "{ages:?}");
}
