//! Random faults of single frames. The faults of a frame are drawn from the seed and the frame number alone, so they do
//! not depend on when it is read.

use super::image::{copy_image, encode_again};
use super::paint::{blur_rows, hide_spots, multiply};
use crate::random::Random;
use serde::Serialize;
use slipbound::image::SizePx;
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use slipbound::setting::SettingError;

/// How often each fault occurs. `Faults::default()` is none at all.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Faults {
    /// Share of frames that never arrive. Their numbers are skipped.
    pub drop_fraction: f64,
    /// Share of frames that arrive late: the source is first silent one to three times.
    pub late_fraction: f64,
    /// Share of frames with the image of the previous frame, under their own number and time.
    pub stale_fraction: f64,
    /// Share of frames that are cut off in the middle.
    pub torn_fraction: f64,
    /// Share of frames that are blurred along the rows, over 9 px.
    pub blur_fraction: f64,
    /// Number of spots of 20 px, at fixed random positions, where the image is painted over: a marker there is dead.
    pub dead_count: u32,
    /// Relative change of the exposure per minute; negative when it fades.
    pub drift_per_min: f64,
    /// Relative amplitude of light that flickers at 100 Hz.
    pub flicker_fraction: f64,
}

/// Names in [`Faults::parse`] with the least and the largest value.
const NAMES: [(&str, f64, f64); 8] = [
    ("drop", 0.0, 0.9),
    ("late", 0.0, 1.0),
    ("stale", 0.0, 0.9),
    ("torn", 0.0, 0.9),
    ("blur", 0.0, 1.0),
    ("dead", 0.0, 200.0),
    ("drift", -0.9, 10.0),
    ("flicker", 0.0, 0.9),
];

const FLICKER_HZ: f64 = 100.0;
const BLUR_PX: usize = 9;
const DEAD_PX: usize = 20;
/// Frame rate assumed for drift and flicker if frames have no time.
const ASSUMED_HZ: f64 = 30.0;

impl Faults {
    /// Reads `drop=0.02,torn=0.01,dead=5`. Names: drop, late, stale, torn, blur (shares of frames), dead (spots),
    /// drift (exposure per minute), flicker (amplitude).
    pub fn parse(text: &str) -> Result<Self, SettingError> {
        let mut faults = Faults::default();
        for part in text.split(',') {
            let refuse = |expected: String| SettingError { key: "fault".into(), got: part.into(), expected };
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            let Some((_, low, high)) = NAMES.iter().find(|(known, _, _)| *known == name) else {
                return Err(refuse(format!(
                    "{} with a value, as drop=0.02",
                    NAMES.map(|(name, _, _)| name).join(", ")
                )));
            };
            let value: f64 = value
                .parse()
                .ok()
                .filter(|value| (*low..=*high).contains(value))
                .ok_or_else(|| refuse(format!("{name}= and a number from {low} to {high}")))?;
            match name {
                "drop" => faults.drop_fraction = value,
                "late" => faults.late_fraction = value,
                "stale" => faults.stale_fraction = value,
                "torn" => faults.torn_fraction = value,
                "blur" => faults.blur_fraction = value,
                "dead" => faults.dead_count = value.round() as u32,
                "drift" => faults.drift_per_min = value,
                _ => faults.flicker_fraction = value,
            }
        }
        Ok(faults)
    }

    fn changes_every_frame(&self) -> bool {
        self.dead_count > 0 || self.drift_per_min != 0.0 || self.flicker_fraction > 0.0
    }
}

/// A source whose frames have faults.
#[derive(Debug)]
pub struct Faulty<S> {
    source: S,
    faults: Faults,
    seed: u64,
    silent_count: u32,
    /// A late frame, delivered after the silence.
    waiting: Option<(FrameBuffer, Next)>,
    /// The image of the previous frame, as delivered.
    before: Option<FrameBuffer>,
}

impl<S: FrameSource> Faulty<S> {
    /// A source with faults drawn from a seed.
    pub fn new(source: S, faults: Faults, seed: u64) -> Self {
        Faulty { source, faults, seed, silent_count: 0, waiting: None, before: None }
    }

    /// The source behind.
    pub fn source(&self) -> &S {
        &self.source
    }

    fn drawn(&self, fault: u64, seq: u64) -> Random {
        Random::of(Random::of(self.seed, 0xFA01 + fault).next_u64(), seq)
    }

    fn is_hit_by(&self, fault: u64, seq: u64, fraction: f64) -> bool {
        fraction > 0.0 && self.drawn(fault, seq).fraction() < fraction
    }

    /// Applies the faults that change pixels.
    fn damage(&self, frame: &mut FrameBuffer) -> Result<(), SourceError> {
        let faults = &self.faults;
        let blurred = self.is_hit_by(3, frame.seq, faults.blur_fraction);
        if !blurred && !faults.changes_every_frame() {
            return Ok(());
        }
        let row_bytes = frame.size.width * frame.format.bytes_per_pixel();
        if blurred {
            blur_rows(&mut frame.pixels, row_bytes, frame.format.bytes_per_pixel(), BLUR_PX);
        }
        hide_spots(&mut frame.pixels, frame.size, frame.format, &self.dead_spots(frame.size));
        let time_s = frame.time_ns.map_or(frame.seq as f64 / ASSUMED_HZ, |ns| ns as f64 * 1e-9);
        let wave = libm::sin(std::f64::consts::TAU * FLICKER_HZ * time_s);
        let gain = (1.0 + faults.drift_per_min * time_s / 60.0) * (1.0 + faults.flicker_fraction * wave);
        multiply(&mut frame.pixels, gain.max(0.0));
        encode_again(frame)
    }

    fn dead_spots(&self, size: SizePx) -> Vec<[usize; 3]> {
        let mut random = self.drawn(5, 0);
        let mut place = |side: usize| (random.fraction() * side.saturating_sub(DEAD_PX) as f64) as usize;
        (0..self.faults.dead_count).map(|_| [place(size.width), place(size.height), DEAD_PX]).collect()
    }

    /// The next frame that is not dropped, with its faults.
    fn fetch(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let next = loop {
            let next = self.source.next(into)?;
            let comes = matches!(next, Next::Frame | Next::Torn { .. });
            if !(comes && self.is_hit_by(0, into.seq, self.faults.drop_fraction)) {
                break next;
            }
        };
        if next != Next::Frame {
            return Ok(next);
        }
        self.damage(into)?;
        if self.faults.stale_fraction > 0.0 {
            if self.is_hit_by(2, into.seq, self.faults.stale_fraction)
                && let Some(before) = &self.before
            {
                copy_image(before, into);
            }
            self.before = Some(into.clone());
        }
        if self.is_hit_by(4, into.seq, self.faults.torn_fraction) && !into.encoded.is_empty() {
            let kept = self.drawn(6, into.seq).between(0.2, 0.95);
            let (whole, cut) = (into.encoded.len(), (into.encoded.len() as f64 * kept) as usize);
            into.encoded.truncate(cut);
            return Ok(Next::Torn {
                reason: format!("JPEG cut off: {cut} of {whole} bytes (a fault that was asked for)"),
            });
        }
        Ok(Next::Frame)
    }
}

impl<S: FrameSource> FrameSource for Faulty<S> {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        if self.silent_count > 0 {
            self.silent_count -= 1;
            return Ok(Next::Silent);
        }
        if let Some((frame, next)) = self.waiting.take() {
            *into = frame;
            return Ok(next);
        }
        let next = self.fetch(into)?;
        let came = matches!(next, Next::Frame | Next::Torn { .. });
        if came && self.is_hit_by(1, into.seq, self.faults.late_fraction) {
            self.silent_count = (self.drawn(7, into.seq).next_u64() % 3) as u32;
            self.waiting = Some((into.clone(), next));
            return Ok(Next::Silent);
        }
        Ok(next)
    }

    fn frames_count(&self) -> Option<u64> {
        self.source.frames_count().filter(|_| self.faults.drop_fraction == 0.0)
    }
}
