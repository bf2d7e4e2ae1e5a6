//! Whether an object slides that is held from the first frame: by the slide score, while it grows.
//!
//! ```text
//!   slide score over 1, and at a new maximum --> it slides, until score growth and imprint motion stop for 0.3 s
//! ```
//! The estimates need the unloaded gel, which such a recording does not show; the score starts from the first frame,
//! and is scaled on real lifts that begin like this.

use crate::monitor::evidence::Recent;

/// Slide score over which the object slides: halfway from held to slid in the mean of its parts.
const SLIDES: f64 = 1.0;

/// Growth of the score above its noise: a thirtieth of the way from held to slid in one of its three parts.
const GROWS: f64 = 0.02;

/// Motion of the imprint over the gel within 67 ms that continues a slide, pitches: three times the noise at
/// standstill.
const GOES_ON_PITCH: f64 = 0.03;

/// Index of that window.
const WINDOW: usize = 1;

/// How long a slide is reported after it was last detected, s.
const LASTS_S: f64 = 0.3;

#[derive(Debug, Clone, Copy)]
pub(super) struct ScoreWatch {
    greatest: f64,
    /// When the slide was last detected; None while nothing slides.
    seen_s: Option<f64>,
}

impl ScoreWatch {
    pub fn new() -> Self {
        ScoreWatch { greatest: 0.0, seen_s: None }
    }

    /// Adds the slide score and the recent motion of a frame; returns whether the object slides.
    pub fn see(&mut self, at_s: f64, slide_score: f64, recent: Option<&Recent>) -> bool {
        let grows = slide_score >= self.greatest + GROWS;
        if grows {
            self.greatest = slide_score;
        }
        let begins = grows && slide_score > SLIDES;
        let moves = recent.is_some_and(|recent| recent.windows[WINDOW].over_pitch >= GOES_ON_PITCH);
        let lasts = self.seen_s.is_some_and(|seen_s| at_s - seen_s <= LASTS_S);
        self.seen_s = match lasts {
            _ if begins || lasts && moves => Some(at_s),
            true => self.seen_s,
            false => None,
        };
        self.seen_s.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::evidence::WindowMotion;

    /// Verdicts on frames at 30 Hz, (score, motion of the imprint within 67 ms, pitches) each.
    fn said(frames: &[(f64, f64)]) -> Vec<bool> {
        let mut watch = ScoreWatch::new();
        let mut see = |(frame, &(score, over_pitch)): (usize, &(f64, f64))| {
            let moved = WindowMotion { over_pitch, ..WindowMotion::default() };
            watch.see(frame as f64 / 30.0, score, Some(&Recent { windows: [moved; 4], ..Recent::default() }))
        };
        frames.iter().enumerate().map(&mut see).collect()
    }

    #[test]
    fn it_slides_from_one_on_while_the_score_grows_or_the_imprint_moves() {
        let mut frames = vec![(0.3, 0.1), (0.9, 0.1), (1.01, 0.1)];
        frames.extend([(1.5, 0.04); 20]); // it slides on at a constant score
        frames.extend([(1.5, 0.02); 20]); // it stands still
        let said = said(&frames);
        assert_eq!(said[..3], [false, false, true]);
        let last = said.iter().rposition(|slides| *slides).expect("it slid");
        assert!(said[3..23].iter().all(|slides| *slides));
        assert!((30..=31).contains(&last), "{last}: 0.3 s after the last motion, in frame 22");
    }

    #[test]
    fn what_has_stopped_slides_again_when_the_score_grows_beyond_what_it_was() {
        let mut frames = vec![(1.2, 0.0); 20];
        frames.extend([(1.2, 0.5), (1.21, 0.5), (1.23, 0.5)]);
        let said = said(&frames);
        assert_eq!(said[19..], [false, false, false, true], "a load alone moves the imprint, too");
    }
}
