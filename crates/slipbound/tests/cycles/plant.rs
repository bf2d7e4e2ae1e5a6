//! A numerical model of a hand, a gripper and a wrist: reports follow from load, grip and friction, and are disturbed
//! as a test requires.

use slipbound::hand::{Mounting, Side};
use slipbound::monitor::{
    ContactReport, Estimate, Estimates, MarkerCounts, Reason, ShearReport, SlipKind, SlipReport, SlipState, SlipSummary,
};
use slipbound::plane::Vec2;
use slipbound::plant::{JawCommand, JawDrive, JawSettings, WristDrive};
use slipbound::port::{GripCommand, GripperState, Jaws, WristCommand, WristState};

/// Shear stiffness of the gels, MPa/mm.
pub const STIFFNESS_MPA_PER_MM: f64 = 0.05;

const WIDTH_MM: f64 = 30.0;

/// Load per finger, N: along the fingers, across them, around their axis; and by how much the object has pivoted, rad.
#[derive(Clone, Copy, Default)]
pub struct Load {
    pub along_n: f64,
    pub across_n: f64,
    pub around_n: f64,
    pub pivot_rad: f64,
}

/// What happens to a finger's frame, one letter per cycle.
#[derive(Clone, Copy, PartialEq)]
pub enum Frame {
    Judged,
    Missed,
    Torn,
    /// The measurements of the previous frame under a new number.
    Frozen,
    /// The previous frame again.
    Again,
    /// A camera that is 0.15 s behind.
    Late,
    /// A camera whose clock was reset.
    NewClock,
    Unsure,
    /// A finger without margin and friction, or without a pitch in mm.
    NoMargin,
    NoMm,
}

impl Frame {
    pub fn of(letter: char) -> Frame {
        match letter {
            '_' => Frame::Missed,
            't' => Frame::Torn,
            'f' => Frame::Frozen,
            'a' => Frame::Again,
            'l' => Frame::Late,
            'c' => Frame::NewClock,
            'u' => Frame::Unsure,
            'n' => Frame::NoMargin,
            'm' => Frame::NoMm,
            _ => Frame::Judged,
        }
    }
}

/// Uniform numbers in -1..1, always the same sequence.
pub struct Noise(u64);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Noise(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub fn next(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0 >> 40) as f64 / (1u64 << 23) as f64 - 1.0
    }
}

/// A finger that reports its simulated load.
pub struct Finger {
    pub mounting: Mounting,
    seq: u64,
    clock_ns: u64,
    last: Option<SlipReport>,
    noise: Noise,
    noise_mm: f64,
}

impl Finger {
    pub fn new(mounting: Mounting, number: u64, noise_mm: f64) -> Self {
        Finger { mounting, seq: 0, clock_ns: 7_000_000_000 * number, last: None, noise: Noise::new(number), noise_mm }
    }

    /// The report of a cycle; None where no frame arrives. It grips with `grip_n`, of which friction can carry `mu`.
    pub fn report(&mut self, now_ns: u64, frame: Frame, load: &Load, grip_n: f64, mu: f64) -> Option<SlipReport> {
        self.seq += u64::from(!matches!(frame, Frame::Missed | Frame::Again));
        if frame == Frame::NewClock {
            self.clock_ns += 5_000_000_000;
        }
        // Its clock is fast by one ten-thousandth.
        let time_ns = self.clock_ns + now_ns + now_ns / 10_000;
        let time_ns = Some(if frame == Frame::Late { time_ns.saturating_sub(150_000_000) } else { time_ns });
        let mut report = match (frame, self.last) {
            (Frame::Missed, _) => return None,
            (Frame::Again, Some(last)) => return Some(last),
            (Frame::Frozen, Some(last)) => SlipReport { seq: self.seq, time_ns, ..last },
            _ => SlipReport { seq: self.seq, time_ns, ..self.felt(load, grip_n, mu) },
        };
        match frame {
            Frame::Torn => {
                (report.state, report.reason, report.shear) = (SlipState::Unjudged, Some(Reason::Torn), None)
            }
            Frame::Unsure => {
                (report.state, report.reason) = (SlipState::Unsure, Some(Reason::ContactQuality));
                report.estimates = Estimates::default();
            }
            Frame::NoMargin => report.estimates = Estimates::default(),
            Frame::NoMm => {
                (report.contact.area_mm2, report.slip.max_mm) = (None, None);
                report.shear = report.shear.map(|shear| ShearReport { translation_mm: None, ..shear });
            }
            _ => {}
        }
        self.last = Some(report);
        Some(report)
    }

    fn felt(&mut self, load: &Load, grip_n: f64, mu: f64) -> SlipReport {
        let side = if self.mounting.side == Side::Right { 1.0 } else { -1.0 };
        let felt_n = Vec2::new(load.along_n, load.around_n + side * load.across_n).rotated(self.mounting.turn_rad);
        let touches = grip_n > 0.5;
        let area_mm2 = if touches { 60.0 * libm::pow(grip_n / 10.0, 0.4) } else { 0.0 };
        let used = felt_n.length() / (mu * grip_n).max(1e-6) + 0.01 * self.noise.next();
        let state = match () {
            _ if !touches => SlipState::NoContact,
            _ if grip_n < 2.0 => SlipState::Unsure,
            _ if used >= 1.0 => SlipState::Gross,
            _ if used >= 0.5 => SlipState::Incipient,
            _ => SlipState::Stick,
        };
        let shear_mm = felt_n / (STIFFNESS_MPA_PER_MM * area_mm2.max(1.0))
            + Vec2::new(self.noise.next(), self.noise.next()) * self.noise_mm;
        let slips = state.is_slip();
        let pivots = load.pivot_rad.abs() > 0.015;
        let estimate = |value| Some(Estimate { value, sd: 0.05, age_frames: 0 });
        let estimates = Estimates {
            margin: estimate(1.0 - used.min(1.2)),
            friction: estimate(mu + 0.02 * self.noise.next()),
            ..Estimates::default()
        };
        let shear = ShearReport {
            translation_px: shear_mm * 12.0,
            translation_mm: Some(shear_mm),
            rotation_rad: side * load.pivot_rad,
        };
        let over = (16.0 * (used - 0.2)).clamp(0.0, 40.0) as u32;
        SlipReport {
            seq: 0,
            time_ns: None,
            state,
            reason: None,
            contact: ContactReport {
                area_px2: 144.0 * area_mm2,
                area_mm2: Some(area_mm2),
                quality: (grip_n / 8.0).min(1.0),
            },
            markers: MarkerCounts { detected: 390, matched: 388, lost: 3, inner: 20 },
            reference_seq: 0,
            grip_n: Some(grip_n),
            motion: None,
            shear: touches.then_some(shear),
            slip: SlipSummary {
                markers_over: over,
                markers_needed: 8,
                threshold_pitch: 0.3,
                max_pitch: 0.2 * used,
                max_mm: Some(0.3 * used),
                kind: slips.then_some(if pivots { SlipKind::Both } else { SlipKind::Translation }),
                direction_rad: (slips && felt_n.length() > 0.2).then(|| libm::atan2(felt_n.y, felt_n.x)),
            },
            estimates: if touches { estimates } else { Estimates::default() },
            evidence: None,
        }
    }
}

/// Jaws and wrist, and the errors of the gripper's force sensor.
pub struct Plant {
    pub jaws: JawDrive,
    pub wrist: WristDrive,
    pub bias_n: f64,
    pub gain: f64,
    pub noise_n: f64,
    /// The held object is gone, or was never there.
    pub is_lost: bool,
    pub is_empty: bool,
    told: Option<GripCommand>,
    noise: Noise,
}

impl Plant {
    pub fn new(bias_n: f64, gain: f64, noise_n: f64) -> Self {
        Plant {
            jaws: Plant::jaws(JawSettings::default().least_n),
            wrist: WristDrive::new(),
            bias_n,
            gain,
            noise_n,
            is_lost: false,
            is_empty: false,
            told: None,
            noise: Noise::new(99),
        }
    }

    /// Jaws with this minimum force.
    pub fn jaws(least_n: f64) -> JawDrive {
        JawDrive::new(JawSettings { stroke_mm: 50.0, least_n, ..JawSettings::default() }).expect("valid")
    }

    pub fn command(&mut self, grip: GripCommand, wrist: WristCommand) {
        if self.told != Some(grip) {
            self.jaws.command(match grip {
                GripCommand::Hold { force_n } => JawCommand::Grasp { force_n },
                GripCommand::Release => JawCommand::MoveTo { opening_mm: 45.0 },
            });
        }
        self.told = Some(grip);
        assert!(self.wrist.command(wrist), "{wrist:?}");
    }

    pub fn advance_to(&mut self, now_ns: u64) {
        self.jaws.advance_to(now_ns, (!self.is_empty).then_some(WIDTH_MM));
        self.wrist.advance_to(now_ns);
    }

    /// The states reported by gripper and wrist.
    pub fn states(&mut self, now_ns: u64) -> (GripperState, WristState) {
        let jaws = match self.told {
            _ if self.is_lost => Jaws::Lost,
            Some(GripCommand::Hold { .. }) if self.jaws.touches() => Jaws::Holding,
            Some(GripCommand::Hold { .. }) if self.jaws.opening_mm() <= 0.0 => Jaws::Nothing,
            Some(GripCommand::Hold { .. }) => Jaws::Closing,
            _ => Jaws::Open,
        };
        let force_n = self.jaws.force_n() * self.gain + self.bias_n + self.noise_n * self.noise.next();
        let gripper = GripperState {
            time_ns: now_ns,
            force_n: Some(force_n),
            force_error_n: None,
            target_n: self.jaws.target_n(),
            opening_mm: Some(self.jaws.opening_mm()),
            jaws,
        };
        (gripper, self.wrist.state())
    }
}
