//! Frame rates, clocks and readings other than those of a camera at 30 Hz: the same press and pull give the same
//! estimates.

use crate::picture::{Painter, Touch, frame};
use slipbound::image::{Frame, SizePx};
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor, SlipReport, SlipState};
use slipbound::plane::Vec2;
use slipbound::port::GripSample;
use slipbound::sensor::{Shear, Skin};

const SIZE: SizePx = SizePx::new(320, 240);
const GRIP_N: f64 = 20.0;

/// A smooth finger whose stiffness is known.
struct Finger {
    painter: Painter,
    monitor: SlipMonitor,
    seq: u64,
}

impl Finger {
    fn new() -> Self {
        let mut painter = Painter::new(SIZE, 20.0, 7.0, Skin::Smooth, 0.0, 3);
        painter.sensor.shear = Some(Shear { stiffness_n_per_pitch: 1.0, provenance: "painted".into() });
        let mut builder = RestBuilder::new(&painter.sensor, &Settings::default(), SIZE).expect("valid");
        for i in 0..4 {
            builder.add(&frame(&painter.paint(&painter.rest, None, 900 + i), SIZE, i)).expect("bright");
        }
        let rest = builder.build(RestKind::Unloaded).expect("markers");
        let monitor = SlipMonitor::new(&painter.sensor, &Settings::default(), rest).expect("valid");
        Finger { painter, monitor, seq: 0 }
    }

    /// A frame: pressed over a radius, and the gel under it pulled along x.
    fn see(&mut self, time_ns: Option<u64>, radius_px: f64, pulled_px: f64, grip_n: Option<f64>) -> SlipReport {
        let middle = Vec2::new(160.0, 120.0);
        let moved = |&p: &Vec2| {
            let far = (p - middle).length() / 60.0;
            p + Vec2::new(pulled_px, 0.0) * (-far * far).exp()
        };
        let places: Vec<Vec2> = self.painter.rest.iter().map(moved).collect();
        let touch = Touch { centre: middle, radii_px: Vec2::new(1.1, 0.9) * radius_px, strength_levels: 32.0 };
        let rgb = self.painter.paint(&places, (radius_px > 0.0).then_some(&touch), self.seq);
        let shown = Frame { time_ns, ..frame(&rgb, SIZE, self.seq) };
        self.seq += 1;
        self.monitor.step(&shown, grip_n.map(|force_n| GripSample { force_n }))
    }
}

fn ramp(at_s: f64, from_s: f64, within_s: f64) -> f64 {
    ((at_s - from_s) / within_s).clamp(0.0, 1.0)
}

#[test]
fn a_contact_ends_whatever_the_clock_of_its_source_does() {
    for clock in [|_| None, |_| Some(0), |i: u64| Some(1_000_000_000 * (i / 40)), |i| Some(5_000_000_000 - i)] {
        let mut finger = Finger::new();
        let states: Vec<SlipState> =
            (0..20).map(|i| finger.see(clock(i), if i < 10 { 55.0 } else { 0.0 }, 0.0, Some(GRIP_N)).state).collect();
        assert_ne!(states[9], SlipState::NoContact, "{:?}: {states:?}", clock(1));
        assert_eq!(states[19], SlipState::NoContact, "{:?}: {states:?}", clock(1));
    }
}

#[test]
fn a_contact_settles_and_its_load_is_told_from_10_frames_a_second_on() {
    for frames_per_s in [10, 12, 30, 60] {
        let mut finger = Finger::new();
        let (mut first_s, mut shear_n) = (None, 0.0);
        for i in 0..2 * frames_per_s {
            let at_s = i as f64 / frames_per_s as f64;
            let pulled_px = 1.5 * ramp(at_s, 0.8, 0.2);
            let report = finger.see(Some(i * 1_000_000_000 / frames_per_s), 60.0, pulled_px, Some(GRIP_N));
            first_s = first_s.or(report.estimates.margin.map(|_| at_s));
            shear_n = report.estimates.shear_n.map_or(0.0, |told| told.value);
        }
        let first_s = first_s.expect("a margin");
        assert!(first_s < 0.75 && (shear_n - 2.18).abs() < 0.15, "{frames_per_s} Hz: {first_s} s, {shear_n} N");
    }
}

#[test]
fn evidence_begins_when_the_press_is_over_at_every_rate() {
    for frames_per_s in [30, 90, 125, 250] {
        let mut finger = Finger::new();
        let mut reports = Vec::new();
        for i in 0..7 * frames_per_s / 10 {
            let radius_px = 30.0 + 60.0 * ramp(i as f64 / frames_per_s as f64, 0.0, 0.4);
            reports.push(finger.see(Some(i * 1_000_000_000 / frames_per_s), radius_px, 0.0, Some(GRIP_N)));
        }
        let last = reports.last().expect("frames");
        let evidence = last.evidence.expect("a contact that has settled");
        let then_px2 = reports[evidence.reference_seq as usize].contact.area_px2;
        assert!(then_px2 > 0.9 * last.contact.area_px2, "{frames_per_s} Hz: {then_px2} of {}", last.contact.area_px2);
        assert!(evidence.slide_score < 0.1, "{frames_per_s} Hz: nothing slides: {evidence:?}");
    }
}

#[test]
fn a_reading_of_the_grip_that_is_missing_changes_nothing() {
    let told = |missing: &dyn Fn(u64) -> bool| {
        let mut finger = Finger::new();
        let mut shown = |i: u64| {
            let grip_n = (!missing(i)).then_some(GRIP_N);
            finger.see(Some(i * 33_333_333), 60.0, 2.5 * ramp(i as f64 / 30.0, 0.6, 0.5), grip_n)
        };
        (0..90).map(&mut shown).last().expect("frames").estimates
    };
    let [whole, one, two_in_three] = [told(&|_| false), told(&|i| i == 60), told(&|i| i > 20 && i % 3 > 0)];
    for holes in [one, two_in_three] {
        let [margin, stick] = [holes.margin, holes.stick_ratio].map(|told| told.expect("told").value);
        let [whole_margin, whole_stick] = [whole.margin, whole.stick_ratio].map(|told| told.expect("told").value);
        assert!((margin - whole_margin).abs() < 0.02 && (stick - whole_stick).abs() < 0.02, "{holes:?} {whole:?}");
    }
    // Half a second without readings: the estimates come from the image alone until readings return.
    let silent = told(&|i| i > 70);
    assert_eq!(silent.friction, None, "{silent:?}");
}
