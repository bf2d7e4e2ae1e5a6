//! The last fifth of a second of a contact, and the last stretch of its motion.

/// Most frames stored: 0.2 s at 240 frames/s.
const MOST_COUNT: usize = 48;

/// Length of the window, s.
const WINDOW_S: f64 = 0.18;

/// Fewest frames from which a change is computed: those of a camera at 10 Hz.
const LEAST_COUNT: usize = 3;

/// Stored data of a frame.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sample {
    /// Time in s since the contact began.
    pub at_s: f64,
    /// Grip force per finger.
    pub grip_n: Option<f64>,
    /// Area of the contact region.
    pub area_px2: f64,
    /// Root mean square of the rigid displacement.
    pub rigid_px: f64,
}

/// Load and motion at the last two stretches of motion. A stretch is a fifth of the motion so far, and at least above
/// the noise.
///
/// ```text
///   load ^            _.-o  now           tangent stiffness: load gained over motion gained since the stretch before;
///        |        _.-o                    it is kept while nothing moves
///        |     .o'   newest
///        |  .o'  before
///        +--------------------> rigid motion
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stretches {
    newest: Stretch,
    before: Stretch,
    tangent_px2: Option<f64>,
}

/// Start of a stretch.
#[derive(Debug, Clone, Copy, Default)]
struct Stretch {
    load_px3: f64,
    rigid_px: f64,
}

/// Share of the motion so far that makes a stretch.
const STRETCH_FRACTION: f64 = 0.2;

impl Stretches {
    pub fn clear(&mut self) {
        *self = Stretches::default();
    }

    /// Adds a frame: load in px3, rigid motion in px. Changes below `least_px` are noise. Returns the tangent stiffness
    /// in px2; None until the contact has moved.
    pub fn see(&mut self, load_px3: f64, rigid_px: f64, least_px: f64) -> Option<f64> {
        let moved_px = rigid_px - self.before.rigid_px;
        if moved_px.abs() >= least_px {
            self.tangent_px2 = Some((load_px3 - self.before.load_px3) / moved_px);
        }
        if (rigid_px - self.newest.rigid_px).abs() >= least_px.max(STRETCH_FRACTION * rigid_px) {
            (self.before, self.newest) = (self.newest, Stretch { load_px3, rigid_px });
        }
        self.tangent_px2
    }

    /// The grip has changed: load and motion count from here, the tangent is kept.
    pub fn restart(&mut self, load_px3: f64, rigid_px: f64) {
        let now = Stretch { load_px3, rigid_px };
        (self.newest, self.before) = (now, now);
    }
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

    /// Adds a frame; drops all but one of those older than the window.
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

    /// Mean of the later half minus mean of the earlier half, and the mean of both; None while the window is not full
    /// or a value is missing.
    pub fn change(&self, of: impl Fn(&Sample) -> Option<f64>) -> Option<(f64, f64)> {
        let (first, last) = (self.oldest()?, self.newest()?);
        if last.at_s - first.at_s < WINDOW_S - 0.04 || self.count < LEAST_COUNT {
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
