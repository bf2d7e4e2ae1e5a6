//! The last fifth of a second of a contact.

/// Most frames remembered: 0.2 s at 240 frames/s.
const MOST_COUNT: usize = 48;

/// How long the window is.
const WINDOW_S: f64 = 0.18;

/// What is remembered of a frame.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sample {
    /// When, in s since the contact began.
    pub at_s: f64,
    /// Grip force per finger.
    pub grip_n: Option<f64>,
    /// Area of the contact region.
    pub area_px2: f64,
    /// Shear load as a length: see [`Load`](super::load::Load).
    pub load_px3: f64,
    /// Root mean square of the rigid displacement.
    pub rigid_px: f64,
}

/// The last frames of a contact, newest last.
#[derive(Debug, Clone)]
pub(super) struct Window {
    samples: [Sample; MOST_COUNT],
    count: usize,
}

impl Window {
    pub fn new() -> Self {
        Window { samples: [Sample::default(); MOST_COUNT], count: 0 }
    }

    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds a frame; forgets those that are older than the window, but for one.
    pub fn push(&mut self, sample: Sample) {
        let old = |s: &Sample| sample.at_s - s.at_s > WINDOW_S + 1e-9;
        while self.count > 1 && old(&self.samples[1]) || self.count == MOST_COUNT {
            self.samples.copy_within(1..self.count, 0);
            self.count -= 1;
        }
        self.samples[self.count] = sample;
        self.count += 1;
    }

    /// The newest frame.
    pub fn newest(&self) -> Option<&Sample> {
        self.samples[..self.count].last()
    }

    /// The newest frame, to be completed.
    pub fn newest_mut(&mut self) -> Option<&mut Sample> {
        self.samples[..self.count].last_mut()
    }

    /// The oldest frame.
    pub fn oldest(&self) -> Option<&Sample> {
        self.samples[..self.count].first()
    }

    /// Mean of the later half less mean of the earlier half, and the mean of both; None while the window is not full or
    /// a value is missing.
    pub fn change(&self, of: impl Fn(&Sample) -> Option<f64>) -> Option<(f64, f64)> {
        let (first, last) = (self.oldest()?, self.newest()?);
        if last.at_s - first.at_s < WINDOW_S - 0.04 || self.count < 4 {
            return None;
        }
        let mean = |samples: &[Sample]| -> Option<f64> {
            let mut sum = 0.0;
            for sample in samples {
                sum += of(sample)?;
            }
            Some(sum / samples.len() as f64)
        };
        let (earlier, later) = self.samples[..self.count].split_at(self.count / 2);
        let (before, after) = (mean(earlier)?, mean(later)?);
        Some((after - before, (after + before) / 2.0))
    }
}
