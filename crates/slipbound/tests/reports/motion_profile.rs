//! Motion of the finger in a table: poses of object and gel, frame by frame, and the resulting camera images.

use crate::picture::{Painter, Touch};
use slipbound::plane::Vec2;
use slipbound::sensor::{Flip, Skin};

/// Object and gel in a frame. Lengths in px of the camera.
#[derive(Clone, Copy)]
pub struct Pose {
    /// 0 no contact, 1 pressed.
    pub press: f64,
    /// Radius of the contact relative to the usual one.
    pub size: f64,
    /// Displacement of the object, and the part of it that the gel has not followed.
    pub object: Vec2,
    pub slid: Vec2,
    pub turn_rad: f64,
    /// Share by which the rim of the contact lags behind its middle.
    pub lag: f64,
    /// Displacement of the contact over the gel by rolling, without sliding.
    pub rolled: Vec2,
    pub grip_n: f64,
    /// Brightness relative to that at rest.
    pub light: f64,
}

impl Pose {
    pub const OPEN: Pose = Pose {
        press: 0.0,
        size: 0.5,
        object: Vec2::ZERO,
        slid: Vec2::ZERO,
        turn_rad: 0.0,
        lag: 0.0,
        rolled: Vec2::ZERO,
        grip_n: 0.0,
        light: 1.0,
    };

    /// Interpolates towards another pose.
    fn towards(self, to: Pose, share: f64) -> Pose {
        let number = |a: f64, b: f64| a + share * (b - a);
        let place = |a: Vec2, b: Vec2| a + (b - a) * share;
        Pose {
            press: number(self.press, to.press),
            size: number(self.size, to.size),
            object: place(self.object, to.object),
            slid: place(self.slid, to.slid),
            turn_rad: number(self.turn_rad, to.turn_rad),
            lag: number(self.lag, to.lag),
            rolled: place(self.rolled, to.rolled),
            grip_n: number(self.grip_n, to.grip_n),
            light: number(self.light, to.light),
        }
    }
}

/// What happens to a frame.
#[derive(Clone, Copy, PartialEq)]
pub enum Arrives {
    Whole,
    Torn,
    Dark,
    /// With one row missing.
    Cropped,
    /// The previous frame again.
    Again,
    /// After this many missed frames.
    After(u64),
}

/// A frame of the profile.
#[derive(Clone, Copy)]
pub struct ProfileStep {
    pub part: &'static str,
    pub pose: Pose,
    pub arrives: Arrives,
}

/// The steps in their order.
pub struct MotionProfile {
    pub steps: Vec<ProfileStep>,
    pose: Pose,
}

impl MotionProfile {
    pub fn from(pose: Pose) -> Self {
        MotionProfile { steps: Vec::new(), pose }
    }

    /// Moves to another pose in this many frames.
    pub fn go(mut self, part: &'static str, frames: usize, change: impl FnOnce(&mut Pose)) -> Self {
        let (from, mut to) = (self.pose, self.pose);
        change(&mut to);
        for i in 1..=frames {
            let pose = from.towards(to, i as f64 / frames as f64);
            self.steps.push(ProfileStep { part, pose, arrives: Arrives::Whole });
        }
        self.pose = to;
        self
    }

    pub fn stay(self, part: &'static str, frames: usize) -> Self {
        self.go(part, frames, |_| ())
    }

    /// Adds a frame of the present pose with this event.
    pub fn meet(mut self, part: &'static str, arrives: Arrives) -> Self {
        self.steps.push(ProfileStep { part, pose: self.pose, arrives });
        self
    }
}

/// Radii of the usual contact, in pitches, and the texture of the object.
const RADII_PITCH: Vec2 = Vec2::new(4.1, 3.3);
const TEXTURE_LEVELS: f64 = 9.0;

/// The position, in this pose, of a gel point given at rest.
pub fn moved(painter: &Painter, pose: &Pose, rest: Vec2) -> Vec2 {
    let touch = touch(painter, pose);
    let arm = rest - touch.centre + pose.object;
    let depth = Touch { centre: Vec2::ZERO, ..touch }.depth(arm);
    let rim = 1.0 - pose.lag * ((depth - 0.55) / 0.45).clamp(0.0, 1.0);
    let follows = if depth <= 1.0 { rim } else { rim * libm::exp(-1.6 * (depth - 1.0)) };
    let rigid = pose.object - pose.slid + arm.rotated(pose.turn_rad) - arm;
    let squeeze = arm * (0.03 * libm::pow(pose.grip_n / 10.0, 0.85) * libm::exp(-depth * depth));
    rest + (rigid * follows + squeeze) * pose.press.min(1.0)
}

/// The contact as the camera sees it.
fn touch(painter: &Painter, pose: &Pose) -> Touch {
    let size = painter.sensor.image_px;
    let middle = Vec2::new(size.width as f64, size.height as f64) / 2.0;
    let radii_px = RADII_PITCH * (painter.sensor.pitch_px * pose.size);
    Touch { centre: middle + pose.rolled + pose.object, radii_px, strength_levels: 34.0 * pose.press }
}

/// The image that the camera delivers: painted, with object texture, light, noise, and this camera's mirroring.
pub fn picture(painter: &Painter, pose: &Pose, shown: bool, seed: u64) -> Vec<u8> {
    let now: Vec<Vec2> = painter.rest.iter().map(|&p| moved(painter, pose, p)).collect();
    let touch = touch(painter, pose);
    let pressed = shown && pose.press > 0.0;
    let (width, height) = (painter.sensor.image_px.width, painter.sensor.image_px.height);
    let textured = pressed && painter.sensor.skin == Skin::Smooth;
    let mut random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut rgb: Vec<u8> = Vec::with_capacity(3 * width * height);
    for (i, levels) in painter.ideal(&now, pressed.then_some(&touch)).iter().enumerate() {
        random ^= random >> 12;
        random ^= random << 25;
        random ^= random >> 27;
        // Uniform noise, the same in all three channels.
        let mut added = painter.noise_levels * ((random >> 40) as f64 / (1u64 << 23) as f64 - 1.0);
        let p = Vec2::new((i % width) as f64, (i / width) as f64);
        if textured && touch.depth(p) < 1.0 {
            let q = (p - touch.centre).rotated(-pose.turn_rad) / painter.sensor.pitch_px;
            added += pose.press * TEXTURE_LEVELS * libm::sin(4.3 * q.x + 1.0) * libm::sin(5.1 * q.y - 0.4);
        }
        rgb.extend(levels.map(|level| ((f64::from(level) + added) * pose.light + 0.5) as u8));
    }
    if painter.sensor.flip != Flip::None {
        mirror(&mut rgb, width, height, painter.sensor.flip);
    }
    rgb
}

fn mirror(rgb: &mut [u8], width: usize, height: usize, flip: Flip) {
    let upright = rgb.to_vec();
    for (i, value) in rgb.iter_mut().enumerate() {
        let (x, y, channel) = (i / 3 % width, i / 3 / width, i % 3);
        let x = if flip.is_horizontal() { width - 1 - x } else { x };
        let y = if flip.is_vertical() { height - 1 - y } else { y };
        *value = upright[3 * (y * width + x) + channel];
    }
}
