//! What a `v4l2:` address asks for.

use super::nodes::four_letters;

/// The automatic settings that can be locked, in the order of [`Options::locks`].
pub const LOCKS: [&str; 4] = ["exposure", "gain", "white_balance", "focus"];

/// Pixel format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelKind {
    /// One JPEG per image.
    Mjpg,
    /// Two pixels in four bytes.
    Yuyv,
    /// One byte per pixel.
    Grey,
}

impl PixelKind {
    const ALL: [PixelKind; 3] = [PixelKind::Mjpg, PixelKind::Yuyv, PixelKind::Grey];

    /// The kernel's four letters for it.
    pub const fn four_cc(self) -> [u8; 4] {
        match self {
            PixelKind::Mjpg => *b"MJPG",
            PixelKind::Yuyv => *b"YUYV",
            PixelKind::Grey => *b"GREY",
        }
    }
}

/// What to do with an automatic setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Lock {
    /// Locked at the value it has.
    #[default]
    Here,
    /// Locked at this value.
    At(i32),
    /// Locked again at its earlier value, if the camera still accepts it.
    Again(i32),
    /// Left to the camera.
    Auto,
}

/// The request.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Options {
    /// Path, serial or name.
    pub camera: String,
    /// The pixel format.
    pub kind: Option<PixelKind>,
    /// Width and height, px.
    pub size: Option<(u32, u32)>,
    /// Frames per second.
    pub rate_hz: Option<f64>,
    /// One for each of [`LOCKS`].
    pub locks: [Lock; 4],
}

impl Options {
    /// `v4l2:CAMERA?key=value&...`; the error says what was expected.
    pub fn parse(uri: &str) -> Result<Self, String> {
        let rest = uri.strip_prefix("v4l2:").ok_or("v4l2:PATH, NAME or SERIAL")?;
        let (camera, pairs) = rest.split_once('?').unwrap_or((rest, ""));
        // `v4l2:///dev/video0` is the same as `v4l2:/dev/video0`.
        let camera = camera.strip_prefix("//").unwrap_or(camera).to_owned();
        let mut options = Options { camera, ..Options::default() };
        for pair in pairs.split('&').filter(|pair| !pair.is_empty()) {
            let (key, value) = pair.split_once('=').unwrap_or((pair, ""));
            let expected = |what: &str| format!("{key}={what}, got `{value}`");
            if let Some(lock) = LOCKS.iter().position(|name| *name == key) {
                options.locks[lock] = match value {
                    "auto" => Lock::Auto,
                    number => Lock::At(number.parse().map_err(|_| expected("auto or a whole number"))?),
                };
                continue;
            }
            match key {
                "format" => {
                    let is_it = |kind: &PixelKind| four_letters(&kind.four_cc()).eq_ignore_ascii_case(value);
                    let kind = PixelKind::ALL.into_iter().find(is_it);
                    options.kind = Some(kind.ok_or_else(|| expected("mjpg, yuyv or grey"))?);
                }
                "size" => {
                    let size = value.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
                    options.size = Some(size.ok_or_else(|| expected("WIDTHxHEIGHT"))?);
                }
                "rate_hz" => {
                    let rate = value.parse().ok().filter(|hz| (0.1..=1000.0).contains(hz));
                    options.rate_hz = Some(rate.ok_or_else(|| expected("0.1 to 1000"))?);
                }
                _ => return Err(format!("one of format, size, rate_hz, {}, got `{key}`", LOCKS.join(", "))),
            }
        }
        Ok(options)
    }

    /// The pixel format for a camera that offers these; the error says what to do where there is none.
    pub fn kind_of(&self, offered: &[[u8; 4]]) -> Result<PixelKind, String> {
        let wanted = self.kind.map_or(PixelKind::ALL.to_vec(), |kind| vec![kind]);
        if let Some(kind) = wanted.into_iter().find(|kind| offered.contains(&kind.four_cc())) {
            return Ok(kind);
        }
        let names: Vec<String> = offered.iter().map(four_letters).collect();
        let hint = match offered.iter().any(is_bayer) {
            true => {
                " (raw Bayer pixels have no colour of their own yet: have them converted, by the camera's own software or \
                     libcamera's v4l2 layer, and choose YUYV or MJPG)"
            }
            false => "",
        };
        let expected = self.kind.map_or("MJPG, YUYV or GREY".into(), |kind| four_letters(&kind.four_cc()));
        Err(format!("a camera with pixels as {expected}, got one with {}{hint}", names.join(", ")))
    }
}

/// Whether this is a raw Bayer format, of 8 to 16 bits.
fn is_bayer(four_cc: &[u8; 4]) -> bool {
    let orders = [&b"BA"[..], b"GB", b"GR", b"RG", b"BG", b"BY", b"pB", b"pG", b"pR", b"pg"];
    let is_other = four_cc == b"GREY" || four_cc.starts_with(b"RGB") || four_cc.starts_with(b"BGR");
    !is_other && orders.iter().any(|order| four_cc.starts_with(order))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_says_camera_format_size_rate_and_locks() {
        let options = Options::parse("v4l2:Mini 28H8?format=YUYV&size=640x480&rate_hz=25&exposure=120&gain=auto");
        let expected = Options {
            camera: "Mini 28H8".into(),
            kind: Some(PixelKind::Yuyv),
            size: Some((640, 480)),
            rate_hz: Some(25.0),
            locks: [Lock::At(120), Lock::Auto, Lock::Here, Lock::Here],
        };
        assert_eq!(options, Ok(expected));
        for path in ["v4l2:/dev/video2", "v4l2:///dev/video2"] {
            assert_eq!(Options::parse(path).map(|options| options.camera), Ok("/dev/video2".into()));
        }
        for (uri, expected) in [
            ("v4l2:a?size=640", "size=WIDTHxHEIGHT, got `640`"),
            ("v4l2:a?rate_hz=0", "rate_hz=0.1 to 1000, got `0`"),
            ("v4l2:a?format=rggb", "format=mjpg, yuyv or grey"),
            ("v4l2:a?gain=much", "gain=auto or a whole number"),
            ("v4l2:a?speed=9", "one of format, size, rate_hz, exposure"),
        ] {
            let refused = Options::parse(uri).expect_err(uri);
            assert!(refused.starts_with(expected), "{refused}");
        }
    }

    #[test]
    fn what_cannot_be_read_is_refused_and_bayer_with_a_hint() {
        let any = Options::default();
        assert_eq!(any.kind_of(&[*b"NV12", *b"YUYV", *b"GREY"]), Ok(PixelKind::Yuyv));
        let grey = Options { kind: Some(PixelKind::Grey), ..Options::default() };
        assert_eq!(grey.kind_of(&[*b"MJPG", *b"GREY"]), Ok(PixelKind::Grey));
        let refused = any.kind_of(&[*b"RGGB", *b"BA81"]).expect_err("Bayer");
        assert!(refused.contains("RGGB, BA81") && refused.contains("raw Bayer"), "{refused}");
        let refused = any.kind_of(&[*b"NV12", *b"RGB3", *b"BGR3"]).expect_err("others");
        assert!(!refused.contains("Bayer"), "{refused}");
    }
}
