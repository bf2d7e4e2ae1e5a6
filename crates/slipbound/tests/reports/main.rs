//! Reports of whole motion profiles on synthetic fingers, to the last bit, as tables beside this file: they detect any
//! change of arithmetic between image and report. After an intended change regenerate them with
//!
//! ```text
//! REGENERATE=1 cargo test -p slipbound --test reports --test cycles
//! ```
//!
//! Review the difference before you commit it: the columns show what has changed. If only the checksums changed, the
//! change is below the last digit or in a value without a column (a marker, a feature).

mod motion_profile;
#[path = "../picture/mod.rs"]
mod picture;
#[path = "../snapshot/mod.rs"]
mod snapshot;
mod table;

use motion_profile::{Arrives, MotionProfile, Pose};
use picture::{Painter, frame};
use slipbound::image::{Frame, SizePx};
use slipbound::monitor::{RestBuilder, RestLook, Settings, SlipMonitor, SlipRule};
use slipbound::plane::{Homography, Vec2};
use slipbound::port::GripSample;
use slipbound::sensor::{Flip, Polarity, Rectification, Sensor, Shear, Skin};
use snapshot::Checksum;

const SIZE: SizePx = SizePx::new(320, 240);
const PITCH_PX: f64 = 18.0;
const FRAME_NS: u64 = 33_333_333;

/// A finger and its known properties.
struct Finger {
    painter: Painter,
    settings: Settings,
    knows_grip: bool,
    has_times: bool,
    /// Whether the image shows a contact, or only the markers do.
    shows_contact: bool,
    /// Poses of the frames for its rest frame.
    first: Vec<Pose>,
}

impl Finger {
    fn new(skin: Skin, seed: u64) -> Self {
        Finger::with_pitch(PITCH_PX, skin, seed)
    }

    fn with_pitch(pitch_px: f64, skin: Skin, seed: u64) -> Self {
        let mut painter = Painter::new(SIZE, pitch_px, pitch_px / 3.0, skin, 0.6, seed);
        painter.jpeg_quality = None;
        painter.noise_levels = 2.0;
        painter.sensor.shear = Some(Shear { stiffness_n_per_pitch: 0.32, provenance: "made up by the tests".into() });
        // Two frames of the motion are skipped.
        let moving = Pose { press: 1.0, size: 0.8, grip_n: 5.0, ..Pose::OPEN };
        let first = vec![moving, Pose::OPEN, Pose::OPEN, Pose::OPEN, Pose::OPEN];
        let settings = Settings::default();
        Finger { painter, settings, knows_grip: true, has_times: true, shows_contact: true, first }
    }

    fn with_sensor(mut self, change: impl FnOnce(&mut Sensor)) -> Self {
        change(&mut self.painter.sensor);
        self
    }

    /// The table of a profile.
    fn table(&self, profile: &MotionProfile) -> String {
        let (mut monitor, mut text) = self.at_rest();
        let mut sum = Checksum::new();
        text += &table::titles();
        let (mut seq, mut last_state, mut last_picture) = (100, None, Vec::new());
        for (i, step) in profile.steps.iter().enumerate() {
            seq += if let Arrives::After(missed) = step.arrives { 1 + missed } else { 1 };
            let time_ns = self.has_times.then_some(seq * FRAME_NS);
            let mut size = SIZE;
            let mut rgb = motion_profile::picture(&self.painter, &step.pose, self.shows_contact, seq);
            match step.arrives {
                Arrives::Dark => rgb.iter_mut().for_each(|value| *value /= 40),
                Arrives::Cropped => {
                    size = SizePx::new(SIZE.width, SIZE.height - 1);
                    rgb.truncate(3 * size.area());
                }
                Arrives::Again => rgb.clone_from(&last_picture),
                _ => {}
            }
            let grip = self.knows_grip.then_some(GripSample { force_n: step.pose.grip_n + 0.01 * (seq % 7) as f64 });
            let report = match step.arrives {
                Arrives::Torn => monitor.torn(seq, time_ns),
                _ => monitor.step(&Frame { pixels: frame(&rgb, size, seq).pixels, seq, time_ns }, grip),
            };
            last_picture = rgb;
            table::add(&mut sum, &report, &monitor);
            if i % 4 == 3 || last_state.replace(report.state) != Some(report.state) || i + 1 == profile.steps.len() {
                table::add_regions(&mut sum, &monitor);
                text += &table::row(step, &report, &sum);
            }
        }
        text
    }

    /// Its monitor after the first frames, and a description of the rest frame.
    fn at_rest(&self) -> (SlipMonitor, String) {
        let mut builder = RestBuilder::new(&self.painter.sensor, &self.settings, SIZE).expect("valid");
        let shown =
            |(i, pose): (usize, &Pose)| motion_profile::picture(&self.painter, pose, self.shows_contact, i as u64);
        let pictures: Vec<Vec<u8>> = self.first.iter().enumerate().map(shown).collect();
        let look = |(i, rgb): (usize, &Vec<u8>)| builder.look(&frame(rgb, SIZE, i as u64));
        let looks: Vec<RestLook> = pictures.iter().enumerate().map(look).collect();
        let mut text = table::HEAD.to_owned();
        for (i, look) in looks.iter().enumerate() {
            let RestLook { change_levels, sharpness, touched, .. } = look;
            let mean_levels = look.mean_levels.unwrap_or(f64::NAN);
            text += &format!(
                "look {i}: mean {mean_levels:.4} change {change_levels:.4} sharpness {sharpness:.6}{}\n",
                if *touched { " touched" } else { "" }
            );
        }
        let choice = builder.choose(&looks).expect("a finger at rest");
        for i in choice.frames.clone() {
            builder.add(&frame(&pictures[i], SIZE, i as u64)).expect("bright");
        }
        let rest = builder.build(choice.kind).expect("markers");
        let mut sum = Checksum::new();
        sum.add(&serde_json::to_vec(&rest).expect("data"));
        text += &format!(
            "rest: frames {:?}, {:?}, {} markers, sum {}\n\n",
            choice.frames,
            rest.kind(),
            rest.markers_count(),
            sum.shown()
        );
        let monitor = SlipMonitor::new(&self.painter.sensor, &self.settings, rest).expect("valid");
        (monitor, text)
    }
}

/// Pressed, sheared, turned, gripped harder, rolled, until the rim lags and the object slides; then all kinds of frame
/// faults, and contacts of other sizes.
fn whole_profile() -> MotionProfile {
    pressed(MotionProfile::from(Pose::OPEN).stay("open", 4))
        .go("shear", 10, |p| (p.object, p.lag) = (Vec2::new(4.0, 1.6), 0.15))
        .go("turn", 8, |p| (p.turn_rad, p.lag) = (0.055, 0.25))
        .go("regrip", 6, |p| p.grip_n = 15.0)
        .go("roll", 10, |p| p.rolled = Vec2::new(11.0, -6.0))
        .go("rim", 10, |p| (p.object, p.lag) = (Vec2::new(9.0, 3.4), 0.8))
        .go("slide", 10, |p| (p.object, p.slid, p.lag) = (Vec2::new(24.0, 9.0), Vec2::new(16.0, 6.0), 0.9))
        .stay("held", 4)
        .meet("torn", Arrives::Torn)
        .meet("again", Arrives::Again)
        .meet("dark", Arrives::Dark)
        .meet("cropped", Arrives::Cropped)
        .go("light", 6, |p| p.light = 0.94)
        .meet("gap", Arrives::After(14))
        .stay("held", 3)
        .go("back", 5, |p| (p.object, p.slid, p.turn_rad, p.lag) = (Vec2::new(5.0, 0.0), Vec2::ZERO, -0.02, 0.3))
        .go("open", 3, |p| (p.press, p.size, p.grip_n) = (0.0, 0.5, 0.0))
        .go("open", 3, |p| *p = Pose { light: p.light, ..Pose::OPEN })
        .go("small", 8, |p| (p.press, p.size, p.grip_n, p.rolled) = (0.8, 0.45, 3.0, Vec2::new(-60.0, 40.0)))
        .go("large", 8, |p| (p.press, p.size, p.grip_n, p.rolled) = (1.2, 1.5, 30.0, Vec2::ZERO))
        .go("spin", 8, |p| p.turn_rad = 0.12)
        .go("open", 4, |p| *p = Pose { light: p.light, ..Pose::OPEN })
}

fn pressed(profile: MotionProfile) -> MotionProfile {
    profile.go("press", 6, |p| (p.press, p.size, p.grip_n) = (1.0, 1.0, 10.0)).stay("settle", 9)
}

/// Sheared, turned and slid.
fn short_profile(profile: MotionProfile) -> MotionProfile {
    profile
        .go("shear", 8, |p| (p.object, p.lag) = (Vec2::new(-3.0, 3.5), 0.2))
        .go("turn", 6, |p| (p.turn_rad, p.lag) = (-0.05, 0.5))
        .go("slide", 10, |p| (p.object, p.slid, p.lag) = (Vec2::new(-12.0, 14.0), Vec2::new(-8.0, 9.5), 0.9))
        .stay("held", 4)
        .go("open", 4, |p| *p = Pose::OPEN)
}

#[test]
fn a_smooth_gel_whose_grip_is_known() {
    snapshot::check("reports/smooth.txt", &Finger::new(Skin::Smooth, 1).table(&whole_profile()));
}

#[test]
fn a_fabric_skin_whose_grip_is_known() {
    snapshot::check("reports/fabric.txt", &Finger::new(Skin::Fabric, 2).table(&whole_profile()));
}

/// Oblique view, mirrored both ways, with a damaged corner; grip, pitch in mm and times are unknown.
#[test]
fn a_rectified_finger_of_which_little_is_known() {
    let homography = Homography([[0.97, 0.06, 10.0], [-0.05, 0.98, 14.0], [4.0e-5, -9.0e-5, 1.0]]);
    let mut finger = Finger::new(Skin::Smooth, 3).with_sensor(|sensor| {
        sensor.rectification = Some(Rectification { homography, crop_px: [8, 4, 300, 224], distortion: None });
        (sensor.flip, sensor.pitch_mm, sensor.shear) = (Flip::Both, None, None);
        sensor.defects_px = vec![[0, 0, 40, 30]];
    });
    (finger.knows_grip, finger.has_times) = (false, false);
    snapshot::check("reports/rectified.txt", &finger.table(&whole_profile()));
}

#[test]
fn the_paper_as_written() {
    let finger = Finger { settings: Settings::paper(), ..Finger::new(Skin::Fabric, 4) };
    snapshot::check("reports/paper.txt", &finger.table(&whole_profile()));
}

#[test]
fn bright_markers_judged_by_the_markers_alone() {
    let mut finger = Finger::new(Skin::Smooth, 5).with_sensor(|sensor| sensor.polarity = Polarity::Bright);
    finger.painter.contrast_levels = -60.0;
    finger.settings = Settings::default().with(|s| s.slip.rule = SlipRule::Markers);
    let profile = short_profile(pressed(MotionProfile::from(Pose::OPEN).stay("open", 2)));
    snapshot::check("reports/bright.txt", &finger.table(&profile));
}

#[test]
fn fingers_that_are_touched_when_they_are_first_seen() {
    for (skin, pitch_px, size, name) in [
        (Skin::Smooth, 27.0, 0.65, "reports/touched_smooth.txt"),
        (Skin::Fabric, PITCH_PX, 1.0, "reports/touched_fabric.txt"),
    ] {
        let held = Pose { press: 1.0, size, grip_n: 10.0, ..Pose::OPEN };
        let finger = Finger { first: vec![held; 4], ..Finger::with_pitch(pitch_px, skin, 6) };
        let finger =
            finger.with_sensor(|sensor| sensor.bare_sharpness = Some(if skin == Skin::Smooth { 3.0 } else { 0.1 }));
        let profile = short_profile(MotionProfile::from(held).stay("held", 4));
        snapshot::check(name, &finger.table(&pressed(profile)));
    }
}

/// A flat face over the whole pad: the image shows no contact, only the markers do.
#[test]
fn a_contact_that_only_displacement_shows() {
    let finger = Finger { shows_contact: false, first: vec![Pose::OPEN; 3], ..Finger::new(Skin::Smooth, 7) };
    let profile = MotionProfile::from(Pose { press: 1.0, size: 2.0, ..Pose::OPEN }).stay("flat", 3);
    snapshot::check("reports/displaced.txt", &finger.table(&short_profile(profile)));
}

/// Contacts of two markers and slightly more: the fewest that can be evaluated.
#[test]
fn contacts_of_few_markers() {
    let finger = Finger { first: vec![Pose::OPEN; 3], ..Finger::with_pitch(38.0, Skin::Smooth, 8) };
    let mut profile = MotionProfile::from(Pose::OPEN).stay("open", 2);
    for (size, x) in [(0.2, 0.0), (0.24, 12.0), (0.28, -9.0), (0.34, 6.0)] {
        let at = Pose { size, rolled: Vec2::new(x, 0.5 * x), ..Pose::OPEN };
        profile = profile
            .go("press", 2, |p| *p = Pose { press: 1.0, grip_n: 6.0, ..at })
            .stay("settle", 8)
            .go("shear", 4, |p| p.object = Vec2::new(7.0, -3.0))
            .go("slide", 6, |p| (p.object, p.slid) = (Vec2::new(21.0, -9.0), Vec2::new(14.0, -6.0)))
            .go("open", 2, |p| *p = at);
    }
    snapshot::check("reports/few.txt", &finger.table(&profile));
}
