//! The settings of a camera when it first started, so that it gets the same when it comes back.
//!
//! A rest frame has one exposure and one size: a camera that settles again after it was unplugged may be brighter.

use super::options::{LOCKS, Lock, Options, PixelKind};

/// What was negotiated and locked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NegotiatedSettings {
    /// Pixel format.
    pub kind: PixelKind,
    /// Width and height, px.
    pub size: (u32, u32),
    /// Frames per second, as far as the driver says.
    pub rate_hz: Option<f64>,
    /// The values of [`LOCKS`]; None where the camera has no such control, or it is left to the camera.
    pub locked: [Option<i32>; 4],
}

/// What to request when the camera is back: the first request, with the values chosen then where it left them open.
pub fn pinned(options: &Options, first: &NegotiatedSettings) -> Options {
    let mut locks = options.locks;
    for (lock, value) in locks.iter_mut().zip(first.locked) {
        if let (Lock::Here, Some(value)) = (*lock, value) {
            *lock = Lock::Again(value);
        }
    }
    Options {
        camera: options.camera.clone(),
        kind: Some(first.kind),
        size: Some(first.size),
        rate_hz: first.rate_hz.or(options.rate_hz),
        locks,
    }
}

/// How the settings of a camera that is back differ from the first ones, in words; None when they do not. Format and
/// size are always the same.
pub fn difference(first: &NegotiatedSettings, now: &NegotiatedSettings) -> Option<String> {
    let rate = |of: &NegotiatedSettings| of.rate_hz.map_or("unknown".into(), |hz| format!("{hz:.2}"));
    let mut facts = vec![("rate_hz", rate(first), rate(now))];
    let value = |value: Option<i32>| value.map_or("not locked".into(), |value| value.to_string());
    let locks = LOCKS.iter().zip(first.locked).zip(now.locked);
    facts.extend(locks.map(|((name, was), is)| (*name, value(was), value(is))));
    let differing = facts.iter().filter(|(_, was, is)| was != is);
    let words: Vec<String> =
        differing.map(|(name, was, is)| format!("{name} expected {was} as at first, got {is}")).collect();
    (!words.is_empty()).then(|| words.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first() -> NegotiatedSettings {
        let locked = [Some(120), Some(4), None, Some(30)];
        NegotiatedSettings { kind: PixelKind::Yuyv, size: (640, 480), rate_hz: Some(30.0), locked }
    }

    #[test]
    fn what_the_camera_chose_is_asked_for_again_and_what_was_left_to_it_is_not() {
        let asked = Options::parse("v4l2:Mini?exposure=100&gain=auto").expect("valid");
        let expected = Options {
            camera: "Mini".into(),
            kind: Some(PixelKind::Yuyv),
            size: Some((640, 480)),
            rate_hz: Some(30.0),
            locks: [Lock::At(100), Lock::Auto, Lock::Here, Lock::Again(30)],
        };
        assert_eq!(pinned(&asked, &first()), expected);
        let silent = NegotiatedSettings { rate_hz: None, ..first() };
        let asked = Options::parse("v4l2:Mini?rate_hz=25").expect("valid");
        assert_eq!(pinned(&asked, &silent).rate_hz, Some(25.0), "a driver that does not tell its rate");
    }

    #[test]
    fn a_difference_is_told_with_both_values() {
        assert_eq!(difference(&first(), &first()), None);
        let now = NegotiatedSettings { rate_hz: Some(15.0), locked: [Some(131), Some(4), None, None], ..first() };
        let expected = "rate_hz expected 30.00 as at first, got 15.00, exposure expected 120 as at first, got 131, \
                        focus expected 30 as at first, got not locked";
        assert_eq!(difference(&first(), &now).as_deref(), Some(expected));
    }
}
