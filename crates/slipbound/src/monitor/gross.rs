//! Whether the object slides as a whole: by what its imprint does, and by what the load does.
//!
//! ```text
//!   imprint goes on over the gel (evidence)  and  much of the friction is used, little sticks --\
//!   all of the friction is used, nothing sticks, two frames in a row ----------------------------> gross, until friction is left
//! ```
//!
//! Either alone falls short: the outline of a pressed patch moves over the gel while a quarter of the contact still sticks, and
//! a slide of half a millimetre a second moves it less than its noise. What is used and what sticks are estimates
//! (step 5), whose error is a tenth.

use super::report::Estimates;

/// Used fraction and stick ratio with which an imprint that goes on is a slide.
const IMPRINT_USED: f64 = 0.85;
const IMPRINT_STICK: f64 = 0.12;

/// Used fraction and stick ratio that are a slide by themselves, and in how many frames in a row.
const ALL_USED: f64 = 0.95;
const NONE_STICKS: f64 = 0.08;
const ALL_USED_FRAMES: u32 = 2;

/// A slide goes on while at least so much is used and at most so much sticks, ...
const GOES_ON_USED: f64 = 0.8;
const GOES_ON_STICK: f64 = 0.3;

/// ... or while the imprint goes on and no more margin than this is estimated.
const GOES_ON_IMPRINT_USED: f64 = 0.65;

/// Remembers whether it slides.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct GrossWatch {
    slides: bool,
    all_used_frames_count: u32,
}

impl GrossWatch {
    /// Nothing touches, or nothing is known any more.
    pub fn clear(&mut self) {
        *self = GrossWatch::default();
    }

    /// Takes a frame; whether the object slides as a whole. Where nothing is estimated the imprint alone tells.
    pub fn see(&mut self, estimates: &Estimates, imprint_slides: bool) -> bool {
        let (Some(margin), Some(stick)) = (estimates.margin, estimates.stick_ratio) else {
            self.all_used_frames_count = 0;
            self.slides = imprint_slides;
            return self.slides;
        };
        let (used, stick) = (1.0 - margin.value, stick.value);
        let all_used = used >= ALL_USED && stick <= NONE_STICKS;
        self.all_used_frames_count = if all_used { self.all_used_frames_count + 1 } else { 0 };
        let begins = imprint_slides && used >= IMPRINT_USED && stick <= IMPRINT_STICK
            || self.all_used_frames_count >= ALL_USED_FRAMES;
        let goes_on = used >= GOES_ON_USED && stick <= GOES_ON_STICK || imprint_slides && used >= GOES_ON_IMPRINT_USED;
        self.slides = begins || self.slides && goes_on;
        self.slides
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::report::Estimate;

    fn estimates(used: f64, stick: f64) -> Estimates {
        let of = |value: f64| Some(Estimate { value, sd: 0.1, age_frames: 0 });
        Estimates { margin: of(1.0 - used), stick_ratio: of(stick), ..Estimates::default() }
    }

    #[test]
    fn a_moving_outline_is_no_slide_while_a_part_sticks() {
        let mut watch = GrossWatch::default();
        for (used, stick, slides) in [(0.75, 0.2, false), (0.9, 0.2, false), (0.8, 0.1, false), (0.9, 0.1, true)] {
            watch.clear();
            assert_eq!(watch.see(&estimates(used, stick), true), slides, "{used} {stick}");
            watch.clear();
            assert!(!watch.see(&estimates(used, stick), false), "{used} {stick}: the imprint stands");
        }
    }

    #[test]
    fn a_slide_too_slow_for_the_imprint_is_told_by_the_load_and_kept_until_friction_is_left() {
        let mut watch = GrossWatch::default();
        assert!(!watch.see(&estimates(1.0, 0.0), false), "one frame is no slide");
        assert!(!watch.see(&estimates(0.9, 0.0), false));
        assert!(!watch.see(&estimates(1.0, 0.0), false), "in a row");
        assert!(watch.see(&estimates(1.0, 0.05), false));
        assert!(watch.see(&estimates(0.85, 0.2), false), "it goes on");
        assert!(watch.see(&estimates(0.7, 0.4), true), "the imprint does");
        assert!(!watch.see(&estimates(0.7, 0.4), false));
        assert!(!watch.see(&estimates(0.9, 0.1), false), "and would have to begin anew");
    }

    #[test]
    fn without_estimates_the_imprint_alone_tells() {
        let mut watch = GrossWatch::default();
        let nothing = Estimates::default();
        assert_eq!([false, true, false].map(|slides| watch.see(&nothing, slides)), [false, true, false]);
    }
}
