//! The facts of a finger: how its camera sees the gel and what the markers on it look like.
//!
//! A sensor file (`sensors/*.toml`) holds these facts; there is no default finger. Lengths in px are in the
//! rectified image at the stated [`Sensor::image_px`]; [`Sensor::at_size`] converts them to another resolution.

mod rectification;

pub(crate) use rectification::MOST_TERMS;
pub use rectification::{Distortion, Rectification};

use crate::image::SizePx;
use crate::plane::Vec2;
use crate::setting::{SettingError, within};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Largest marker of a sensor, px.
pub(crate) const MOST_MARKER_DIAMETER_PX: f64 = 64.0;

/// Whether markers are darker or brighter than the gel around them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Polarity {
    /// Dark markers, as on GelSlim and GelSight.
    Dark,
    /// Bright markers.
    Bright,
}

/// How the camera mirrors its image; undone before anything else.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Flip {
    /// The frame is as the finger frame has it.
    None,
    /// Top and bottom are exchanged.
    Vertical,
    /// Left and right are exchanged.
    Horizontal,
    /// Both: the frame is upside down.
    Both,
}

impl Flip {
    /// Every flip.
    pub const ALL: [Flip; 4] = [Flip::None, Flip::Vertical, Flip::Horizontal, Flip::Both];

    /// Whether left and right are exchanged.
    pub fn is_horizontal(self) -> bool {
        matches!(self, Flip::Horizontal | Flip::Both)
    }

    /// Whether top and bottom are exchanged.
    pub fn is_vertical(self) -> bool {
        matches!(self, Flip::Vertical | Flip::Both)
    }
}

/// As written in a sensor file.
impl fmt::Display for Flip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Flip::None => "none",
            Flip::Vertical => "vertical",
            Flip::Horizontal => "horizontal",
            Flip::Both => "both",
        })
    }
}

/// What covers the gel, which decides how contact becomes visible.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Skin {
    /// A fabric whose weave shows where it is pressed (GelSlim): contact is texture.
    Fabric,
    /// A smooth coating (GelSight): contact is a change of shading.
    Smooth,
}

impl Skin {
    /// Its name, as in a sensor file.
    pub const fn name(self) -> &'static str {
        match self {
            Skin::Fabric => "fabric",
            Skin::Smooth => "smooth",
        }
    }
}

/// Edge thresholds of a part of the image; illumination differs from top to bottom.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EdgeBand {
    /// The band ends at this fraction of the rectified height; bands follow each other from the top, the last ends at 1.
    pub rows_to_fraction: f64,
    /// Canny's lower threshold, in grey levels of the flattened image times the Sobel gain.
    pub low_levels: u16,
    /// Canny's upper threshold.
    pub high_levels: u16,
}

/// The facts of one finger. Built from a sensor file; see `sensors/` for the built-in ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// The name of the kind of finger.
    pub name: String,
    /// Where and how the numbers were measured.
    #[serde(default)]
    pub description: String,
    /// Serial number of this one finger.
    #[serde(default)]
    pub serial: Option<String>,
    /// Size of the camera image at which the px values hold.
    pub image_px: SizePx,
    /// How the camera mirrors its image.
    pub flip: Flip,
    /// Weights of red, green and blue in the grey image; their sum is at most 1.
    pub grey_weights_rgb: [f64; 3],
    /// Whether markers are dark or bright.
    pub polarity: Polarity,
    /// Distance between neighbouring markers in the rectified image.
    pub pitch_px: f64,
    /// The same distance on the gel in mm; None where it was not measured; then no millimetre is reported.
    #[serde(default)]
    pub pitch_mm: Option<f64>,
    /// Length of the whole gel along x and along y in mm, if the camera sees less of it: a contact cut by the view then
    /// extends to the end of the gel. The view is assumed to be in the middle of the gel. None if not stated: gel out
    /// of view then counts as free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gel_mm: Option<[f64; 2]>,
    /// Diameter of a marker in the rectified image.
    pub marker_diameter_px: f64,
    /// What covers the gel.
    pub skin: Skin,
    /// Sharpness of the untouched finger (its illumination, glare and scratches), as
    /// [`crate::monitor::RestLook::sharpness`] measures it: grey levels for a smooth skin, a share of the image for
    /// fabric. None where it was not measured.
    #[serde(default)]
    pub bare_sharpness: Option<f64>,
    /// Edge thresholds from top to bottom; needed for a fabric skin only.
    #[serde(default)]
    pub edge_bands: Vec<EdgeBand>,
    /// Rectification; None when the camera looks straight at the gel.
    #[serde(default)]
    pub rectification: Option<Rectification>,
    /// Damaged parts of the skin: left, top, right, bottom (exclusive) in the rectified image. Edges there do not count
    /// as contact, and dots there are not markers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub defects_px: Vec<[usize; 4]>,
    /// How stiff the skin is against shear; None where it was not measured; then no tangential force is reported.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shear: Option<Shear>,
}

/// Shear stiffness of the skin, measured with a known weight.
///
/// In a soft layer bonded to a stiff back the traction on each patch of the surface is the stiffness times the
/// displacement of that patch. Every marker represents a patch of a pitch squared, so the tangential force on the
/// finger is the sum over all markers of their displacement in pitches, times [`Shear::stiffness_n_per_pitch`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shear {
    /// Newtons for one marker displaced by one pitch.
    pub stiffness_n_per_pitch: f64,
    /// What it was measured with: the weight, the recording, the scatter.
    pub provenance: String,
}

impl Sensor {
    /// Checks every fact; the error names the first invalid key.
    pub fn check(&self) -> Result<(), SettingError> {
        let bad = |key: &str, got: String, expected: &str| {
            Err(SettingError { key: key.into(), got, expected: expected.into() })
        };
        within("image_px.width", self.image_px.width as f64, 32.0, 8192.0)?;
        within("image_px.height", self.image_px.height as f64, 32.0, 8192.0)?;
        for weight in self.grey_weights_rgb {
            within("grey_weights_rgb", weight, 0.0, 1.0)?;
        }
        within("grey_weights_rgb (sum)", self.grey_weights_rgb.iter().sum(), 0.01, 1.0 + 1e-9)?;
        within("marker_diameter_px", self.marker_diameter_px, 3.0, MOST_MARKER_DIAMETER_PX)?;
        // Both may be rounded, or scaled to another image.
        within("pitch_px", self.pitch_px, 1.5 * self.marker_diameter_px * (1.0 - 1e-6), 512.0)?;
        if let Some(pitch_mm) = self.pitch_mm {
            within("pitch_mm", pitch_mm, 0.1, 20.0)?;
        }
        if let Some([x_mm, y_mm]) = self.gel_mm {
            let Some(pitch_mm) = self.pitch_mm else {
                return bad("gel_mm", format!("[{x_mm}, {y_mm}] without pitch_mm"), "pitch_mm as well");
            };
            within("gel_mm (x)", x_mm, 1.0, 500.0)?;
            within("gel_mm (y)", y_mm, 1.0, 500.0)?;
            let SizePx { width, height } = self.rectified_px();
            let [view_x_mm, view_y_mm] = [width, height].map(|px| px as f64 / self.pitch_px * pitch_mm);
            // The view may reach beyond the gel a little; centimetres for millimetres it does not.
            if x_mm < view_x_mm / 2.0 || y_mm < view_y_mm / 2.0 {
                let expected = format!("the whole gel, of which {view_x_mm:.1} x {view_y_mm:.1} mm are in view");
                return bad("gel_mm", format!("[{x_mm}, {y_mm}]"), &expected);
            }
        }
        if let Some(sharpness) = self.bare_sharpness {
            within("bare_sharpness", sharpness, 0.0, 100.0)?;
        }
        if self.skin == Skin::Fabric && self.edge_bands.is_empty() {
            return bad("edge_bands", "none".into(), "at least one band for a fabric skin");
        }
        let mut from = 0.0;
        for band in &self.edge_bands {
            if !(band.rows_to_fraction > from && band.rows_to_fraction <= 1.0) {
                let expected = match from < 1.0 {
                    true => format!("a number above {from}, at most 1"),
                    false => "no band after the one that ends at 1".into(),
                };
                return bad("edge_bands.rows_to_fraction", band.rows_to_fraction.to_string(), &expected);
            }
            if band.low_levels > band.high_levels {
                return bad("edge_bands.low_levels", band.low_levels.to_string(), "at most high_levels");
            }
            from = band.rows_to_fraction;
        }
        if !self.edge_bands.is_empty() && from != 1.0 {
            return bad("edge_bands.rows_to_fraction", from.to_string(), "1 in the last band");
        }
        if let Some(r) = &self.rectification {
            r.check()?;
        }
        let size = self.rectified_px();
        for &[left, top, right, bottom] in &self.defects_px {
            if left >= right || top >= bottom || right > size.width || bottom > size.height {
                let got = format!("{:?}", [left, top, right, bottom]);
                return bad("defects_px", got, &format!("left, top, right, bottom within {size}"));
            }
        }
        if let Some(shear) = &self.shear {
            within("shear.stiffness_n_per_pitch", shear.stiffness_n_per_pitch, 1e-6, 1e3)?;
            if shear.provenance.trim().is_empty() {
                return bad("shear.provenance", "nothing".into(), "what it was measured with");
            }
        }
        Ok(())
    }

    /// The same finger at another camera resolution: lengths scale in proportion; in a smaller image, edge thresholds
    /// rise with the square root of the scale. The shape of the image must be the same (to 1 px in the height of the
    /// smaller of the two); else the error states what was expected.
    pub fn at_size(&self, size: SizePx) -> Result<Sensor, SettingError> {
        if size == self.image_px {
            return Ok(self.clone());
        }
        let scale = size.width as f64 / self.image_px.width as f64;
        // 427x320 is 4 to 3, rounded to whole pixels: the rounding error grows with the scale.
        if (self.image_px.height as f64 * scale - size.height as f64).abs() > scale.max(1.0) {
            let turned = size.is_turned_from(self.image_px);
            let hint = if turned { "; are the images turned by 90 degrees?" } else { "" };
            return Err(SettingError {
                key: "image_px".into(),
                got: format!("frames of {size}{hint}"),
                expected: format!("{} or the same shape at another scale", self.image_px),
            });
        }
        // In a smaller image edges are steeper, and a weave of three to ten px per thread is less resolved: its
        // gradients grow with the square root of the scale, and bare weave would look pressed. In a larger image the
        // thresholds stay: lower ones would admit noise.
        let levels = |levels: u16| (f64::from(levels) / scale.min(1.0).sqrt()).round() as u16;
        let edge_bands = self.edge_bands.iter().map(|band| EdgeBand {
            low_levels: levels(band.low_levels),
            high_levels: levels(band.high_levels),
            ..*band
        });
        let scaled = Sensor {
            image_px: size,
            pitch_px: self.pitch_px * scale,
            edge_bands: edge_bands.collect(),
            marker_diameter_px: self.marker_diameter_px * scale,
            rectification: self.rectification.map(|r| r.scaled(scale)),
            ..self.clone()
        };
        // Rounded outwards to whole pixels: a thin defect is never lost.
        let whole = scaled.rectified_px();
        let down = |value: usize| (value as f64 * scale).floor() as usize;
        let up = |value: usize, most: usize| ((value as f64 * scale).ceil() as usize).min(most);
        let defects = self.defects_px.iter().map(|&[left, top, right, bottom]| {
            [down(left), down(top), up(right, whole.width), up(bottom, whole.height)]
        });
        Ok(Sensor { defects_px: defects.collect(), ..scaled })
    }

    /// Size of the rectified image.
    pub fn rectified_px(&self) -> SizePx {
        match &self.rectification {
            None => self.image_px,
            Some(r) => SizePx::new(r.crop_px[2] - r.crop_px[0], r.crop_px[3] - r.crop_px[1]),
        }
    }

    /// Where a point of the rectified image lies in the upright camera image, its flip undone.
    pub fn upright_from_rectified(&self, p: Vec2) -> Vec2 {
        match &self.rectification {
            None => p,
            Some(r) => r.upright_from_plane(p + Vec2::new(r.crop_px[0] as f64, r.crop_px[1] as f64)),
        }
    }

    /// Where a point of the upright camera image lies in the rectified image, also beyond its border. None where the
    /// distortion has no such point.
    pub fn rectified_from_upright(&self, p: Vec2) -> Option<Vec2> {
        match &self.rectification {
            None => Some(p),
            Some(r) => Some(r.plane_from_upright(p)? - Vec2::new(r.crop_px[0] as f64, r.crop_px[1] as f64)),
        }
    }

    /// Where a point of the rectified image lies in the camera image as delivered.
    pub fn camera_from_rectified(&self, p: Vec2) -> Vec2 {
        let p = self.upright_from_rectified(p);
        let (right, bottom) = ((self.image_px.width - 1) as f64, (self.image_px.height - 1) as f64);
        let x = if self.flip.is_horizontal() { right - p.x } else { p.x };
        let y = if self.flip.is_vertical() { bottom - p.y } else { p.y };
        Vec2::new(x, y)
    }

    /// Tangential force, N, per displacement of the gel's surface in rectified px and area in px2; None for a finger
    /// whose shear stiffness was not measured.
    pub fn shear_stiffness_n_per_px3(&self) -> Option<f64> {
        self.shear.as_ref().map(|s| s.stiffness_n_per_pitch / (self.pitch_px * self.pitch_px * self.pitch_px))
    }

    /// Shear traction per displacement of the gel's surface in MPa/mm = N/mm2 per mm, for a wide layer its shear modulus
    /// over its thickness; None for a finger whose shear stiffness or pitch in mm was not measured.
    pub fn shear_stiffness_mpa_per_mm(&self) -> Option<f64> {
        let (shear, pitch_mm) = (self.shear.as_ref()?, self.pitch_mm?);
        Some(shear.stiffness_n_per_pitch / (pitch_mm * pitch_mm * pitch_mm))
    }

    /// Half the length of the whole gel along x and along y in rectified px; None where it is unknown.
    pub fn gel_half_px(&self) -> Option<Vec2> {
        let ([x_mm, y_mm], mm_per_px) = (self.gel_mm?, self.mm_per_px()?);
        Some(Vec2::new(x_mm, y_mm) / (2.0 * mm_per_px))
    }

    /// Millimetres per rectified pixel; None where the pitch in mm is unknown.
    pub fn mm_per_px(&self) -> Option<f64> {
        self.pitch_mm.map(|mm| mm / self.pitch_px)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::plane::Homography;

    /// A smooth finger of 320x240 px with 10 px dots at 30 px.
    pub(crate) fn smooth() -> Sensor {
        Sensor {
            name: "smooth".into(),
            description: String::new(),
            serial: None,
            image_px: SizePx::new(320, 240),
            flip: Flip::None,
            grey_weights_rgb: [1.0 / 3.0; 3],
            polarity: Polarity::Dark,
            pitch_px: 30.0,
            pitch_mm: Some(1.5),
            gel_mm: None,
            marker_diameter_px: 10.0,
            skin: Skin::Smooth,
            bare_sharpness: None,
            edge_bands: Vec::new(),
            rectification: None,
            defects_px: Vec::new(),
            shear: None,
        }
    }

    #[test]
    fn a_finger_at_another_resolution_keeps_its_geometry() {
        let homography = Homography([[0.8, -0.34, 41.0], [0.04, 0.84, -24.6], [-1.0e-4, -1.4e-3, 1.0]]);
        let rectification = Some(Rectification { homography, crop_px: [50, 0, 270, 240], distortion: None });
        let small = Sensor { rectification, flip: Flip::Vertical, ..smooth() };
        let large = small.at_size(SizePx::new(640, 480)).expect("same shape");
        assert_eq!(large.rectified_px(), SizePx::new(440, 480));
        assert_eq!(large.pitch_px, 60.0);
        let p = Vec2::new(100.0, 80.0);
        let double = |p: Vec2| p * 2.0 + Vec2::new(0.5, 0.5); // pixel centres at whole numbers
        // The crop is cut at whole pixels: half a pixel of the small image is a whole one of the large.
        let (there, here) =
            (large.camera_from_rectified(p * 2.0 + Vec2::new(0.5, 0.5)), small.camera_from_rectified(p));
        assert!((there - double(here)).length() < 1e-9, "{there:?} {here:?}");
        let thin = Sensor { defects_px: vec![[11, 20, 12, 60], [219, 239, 220, 240]], ..small.clone() };
        let half = thin.at_size(SizePx::new(160, 120)).expect("same shape");
        half.check().expect("a thin defect is still one");
        assert_eq!(half.defects_px, [[5, 10, 6, 30], [109, 119, 110, 120]]);
        let rounded =
            Sensor { image_px: SizePx::new(427, 320), rectification: None, defects_px: Vec::new(), ..smooth() };
        for (width, height) in [(1600, 1200), (1920, 1440), (2592, 1944), (320, 240)] {
            rounded.at_size(SizePx::new(width, height)).expect("4 to 3");
        }
        rounded.at_size(SizePx::new(1920, 1430)).expect_err("another shape");
        let error = small.at_size(SizePx::new(640, 640)).expect_err("another shape");
        assert_eq!(
            error.to_string(),
            "image_px: expected 320x240 or the same shape at another scale, got frames of 640x640"
        );
        let turned = |size: SizePx, frames: SizePx| {
            let sensor = Sensor { image_px: size, rectification: None, defects_px: Vec::new(), ..smooth() };
            let error = sensor.at_size(frames).expect_err("another shape").to_string();
            error.ends_with(&format!("got frames of {frames}; are the images turned by 90 degrees?"))
        };
        let (wide, upright, square) = (SizePx::new(640, 480), SizePx::new(480, 640), SizePx::new(480, 480));
        assert!(turned(wide, upright) && turned(upright, wide) && !turned(wide, square) && !turned(square, upright));
    }

    #[test]
    fn edge_thresholds_rise_with_the_root_of_a_smaller_picture() {
        let edge_bands = vec![EdgeBand { rows_to_fraction: 1.0, low_levels: 90, high_levels: 121 }];
        let facts = Sensor { edge_bands, ..smooth() };
        for (width, expected) in [(160, (127, 171)), (320, (90, 121)), (640, (90, 121))] {
            let sensor = facts.at_size(SizePx::new(width, width * 3 / 4)).expect("same shape");
            let EdgeBand { low_levels, high_levels, .. } = sensor.edge_bands[0];
            assert_eq!((low_levels, high_levels), expected, "{width}");
        }
    }

    #[test]
    fn facts_that_cannot_be_are_refused_by_name() {
        let wrong = Sensor { pitch_px: f64::NAN, ..smooth() };
        assert_eq!(wrong.check().expect_err("NaN").key, "pitch_px");
        let wrong = Sensor { grey_weights_rgb: [-0.5, 0.5, 0.5], ..smooth() };
        assert_eq!(wrong.check().expect_err("negative").key, "grey_weights_rgb");
        let wrong = Sensor { skin: Skin::Fabric, ..smooth() };
        assert_eq!(wrong.check().expect_err("no bands").key, "edge_bands");
        let band = EdgeBand { rows_to_fraction: 1.0, low_levels: 9, high_levels: 9 };
        let wrong = Sensor { edge_bands: vec![band; 2], ..smooth() };
        assert_eq!(
            wrong.check().expect_err("one too many").to_string(),
            "edge_bands.rows_to_fraction: expected no band after the one that ends at 1, got 1"
        );
        let wrong = Sensor { gel_mm: Some([25.0, f64::NAN]), ..smooth() };
        assert_eq!(wrong.check().expect_err("NaN").key, "gel_mm (y)");
        let wrong = Sensor { gel_mm: Some([25.0, 20.0]), pitch_mm: None, ..smooth() };
        assert_eq!(
            wrong.check().expect_err("no scale").to_string(),
            "gel_mm: expected pitch_mm as well, got [25, 20] without pitch_mm"
        );
        let wrong = Sensor { gel_mm: Some([2.5, 2.0]), ..smooth() }.check().expect_err("centimetres").to_string();
        assert!(
            wrong.starts_with("gel_mm: expected the whole gel, of which ") && wrong.ends_with("got [2.5, 2]"),
            "{wrong}"
        );
    }

    /// Two thirds of a pitch, as it is or rounded to ten digits.
    #[test]
    fn dots_as_wide_as_two_thirds_of_the_pitch_pass_however_they_are_rounded() {
        for tenths in 45..900 {
            let pitch_px = f64::from(tenths) / 10.0;
            let exact = pitch_px / 1.5;
            let rounded: f64 = format!("{exact:.9e}").parse().expect("a number");
            for marker_diameter_px in [exact, rounded] {
                let sensor = Sensor { pitch_px, marker_diameter_px, pitch_mm: None, gel_mm: None, ..smooth() };
                assert_eq!(sensor.check(), Ok(()), "{pitch_px}");
            }
            let wide = Sensor { pitch_px, marker_diameter_px: 1.001 * exact, pitch_mm: None, gel_mm: None, ..smooth() };
            assert_eq!(wide.check().expect_err("too wide").key, "pitch_px");
        }
    }
}
