//! The two panels of a frame: what moved, and what slips.

use super::backdrop::Backdrop;
use super::canvas::{Canvas, Colour};
use super::input::OverlayInput;
use super::palette::{BACKGROUND, CONTACT, INNER, LOST, MEASURED, PAPER, RIGID, SLIP, SLIPPING};
use super::regions::Region;
use super::strips;
use slipbound::image::{Frame, Mask, SizePx};
use slipbound::monitor::{Marker, MotionReport, SlipReport, SlipState};
use slipbound::pixels::morphology::Morphology;
use slipbound::plane::{RigidMotion, Vec2};
use slipbound::sensor::Sensor;

/// A panel's shorter side has at least this many pixels.
const PANEL_MIN_PX: f64 = 720.0;
/// An arrow of the slip threshold's order (0.3 pitches) is at least this long, else arrows are magnified ...
const ARROW_MIN_PX: f64 = 45.0;
/// ... but not more than this: they would run into each other.
const MAGNIFICATION_MAX: f64 = 3.0;
/// On still images the longest arrow is brought up to one pitch by one of these.
const STILL_MAGNIFICATIONS: [f64; 5] = [20.0, 10.0, 5.0, 2.0, 1.0];
/// With it, the longest arrow has at most this length, in pitches, and in general more than half a pitch.
const STILL_MOST_PITCH: f64 = 1.5;
/// Shorter arrows (in canvas pixels) are left out: they would be blots.
const ARROW_SHOWN_PX: f64 = 5.0;
/// Gap between the panels.
const GAP_PX: usize = 8;

/// Draws frames of one finger. The image buffer is reused.
#[derive(Debug, Clone)]
pub struct Overlay {
    canvas: Canvas,
    /// Buffer for one panel at a time: drawing is clipped at its border.
    panel: Canvas,
    backdrop: Backdrop,
    contact: Region,
    inner: Region,
    /// The inner region as a mask, and the erosion that makes it.
    eroded: Mask,
    erosion: Morphology,
    scale: f64,
    /// Arrows are drawn this many times as long as the displacement in the image.
    magnification: f64,
    /// Whether each panel has a magnification of its own instead.
    for_stills: bool,
}

impl Overlay {
    /// For frames of this finger at the size that its sensor states. A frame of another size changes the size of the
    /// images.
    pub fn new(sensor: &Sensor) -> Self {
        let rectified = sensor.rectified_px();
        let shorter = rectified.width.min(rectified.height) as f64;
        let scale = (PANEL_MIN_PX / shorter).max(1.0);
        let even = |px: usize| ((px as f64 * scale).round() as usize).next_multiple_of(2); // video codecs need even sizes
        let panel = SizePx::new(even(rectified.width), even(rectified.height));
        let magnification = (ARROW_MIN_PX / (0.3 * sensor.pitch_px * scale)).ceil().clamp(1.0, MAGNIFICATION_MAX);
        let size = SizePx::new(2 * panel.width + GAP_PX, strips::HEAD_PX + panel.height + strips::LEGEND_PX);
        Overlay {
            canvas: Canvas::new(size),
            panel: Canvas::new(panel),
            backdrop: Backdrop::new(sensor, panel, scale),
            contact: Region::new(rectified, panel, scale),
            inner: Region::new(rectified, panel, scale),
            eroded: Mask::new(rectified),
            erosion: Morphology::new(rectified),
            scale,
            magnification,
            for_stills: false,
        }
    }

    /// For still images: the arrows of each panel are magnified until the longest is about one pitch long, so that a
    /// small slip can be seen, too. The caption tells how much. In a video the arrows of all frames have one scale.
    #[must_use]
    pub fn for_stills(self) -> Self {
        Overlay { for_stills: true, ..self }
    }

    /// Size of the image.
    pub fn size(&self) -> SizePx {
        self.canvas.size()
    }

    /// The image drawn last: red, green, blue, rows without gaps.
    pub fn rgb(&self) -> Vec<u8> {
        let mut rgb = Vec::new();
        self.rgb_into(&mut rgb);
        rgb
    }

    /// The same in a buffer that is used again.
    pub(super) fn rgb_into(&self, rgb: &mut Vec<u8>) {
        self.canvas.rgb_into(rgb);
    }

    /// Draws a frame and the results on it, for example of a monitor that has just judged it. `frame`: None when it did
    /// not arrive completely.
    pub fn draw<'a>(&mut self, frame: Option<&Frame<'_>>, report: &SlipReport, found: impl Into<OverlayInput<'a>>) {
        let found = found.into();
        if found.sensor.rectified_px() != self.eroded.size() {
            // The frames have another size than the sensor file states: the monitor's sensor has theirs.
            *self = Overlay { for_stills: self.for_stills, ..Overlay::new(found.sensor) };
        }
        let seen = frame.filter(|f| f.pixels.size() == found.sensor.image_px);
        let judged = seen.is_some() && report.state != SlipState::Unjudged;
        self.canvas.fill(BACKGROUND);
        if let Some(frame) = seen {
            self.backdrop.take(frame);
            self.contact.take(found.contact_region);
            match found.inner_erosion {
                Some(element) => self.erosion.erode(found.contact_region, element, &mut self.eroded),
                None => self.eroded.clear(),
            }
            self.inner.take(&self.eroded);
            let pitch_px = found.sensor.pitch_px;
            let left = (0, strips::HEAD_PX);
            self.panel.put(self.backdrop.rgb());
            if judged {
                let moved = found.markers.iter().filter(|m| m.matched && m.in_reference);
                let times = self.magnification_of(moved.map(Marker::now_from_reference), pitch_px);
                self.draw_motion(report.motion.as_ref(), found.markers, pitch_px, times);
                let caption = format!("displacement since the reference, arrows x{times:.0}");
                strips::caption(&mut self.panel, &caption);
            }
            self.canvas.paste(&self.panel, left);

            self.backdrop.pale();
            self.panel.put(self.backdrop.rgb());
            if judged {
                let slipped = found.markers.iter().filter(|m| m.matched && m.in_contact);
                let times = self.magnification_of(slipped.map(|m| m.slip), pitch_px);
                self.draw_slip(found.markers, pitch_px, times);
                let caption = format!("slip field = measured - rigid, arrows x{times:.0}");
                strips::caption(&mut self.panel, &caption);
            }
            self.canvas.paste(&self.panel, (self.panel.size().width + GAP_PX, strips::HEAD_PX));
        }
        if seen.is_none() {
            strips::no_picture(&mut self.canvas);
        }
        strips::head(&mut self.canvas, report, found.markers, found.alarm_margin);
        strips::legend(&mut self.canvas, report.slip.threshold_pitch);
    }

    /// How much to magnify these vectors of a panel.
    fn magnification_of(&self, vectors: impl Iterator<Item = Vec2>, pitch_px: f64) -> f64 {
        let longest_px = vectors.map(Vec2::length).fold(0.0, f64::max);
        if !self.for_stills || longest_px == 0.0 {
            return self.magnification;
        }
        STILL_MAGNIFICATIONS.into_iter().find(|times| times * longest_px <= STILL_MOST_PITCH * pitch_px).unwrap_or(1.0)
    }

    /// Measured and rigid displacement since the reference, ICR and reference point.
    fn draw_motion(&mut self, motion: Option<&MotionReport>, markers: &[Marker], pitch_px: f64, times: f64) {
        let rigid = motion.map(|m| RigidMotion {
            reference: m.reference_px,
            translation: m.translation_px,
            rotation_rad: m.rotation_rad,
        });
        self.panel.region(&mut self.contact, CONTACT, 0.20);
        self.panel.region(&mut self.inner, INNER, 0.16);
        let width = self.width(pitch_px);
        for m in markers {
            if !m.matched {
                let at = self.at(m.now);
                self.panel.ring(at, 5.0, 1.5, LOST.with_alpha(0.8));
            } else if m.in_reference {
                let alpha = if m.in_contact { 1.0 } else { 0.55 };
                let moved = m.now_from_reference();
                self.arrow(m.reference, moved * times, 2.3 * width, MEASURED, alpha);
            }
        }
        let Some(rigid) = rigid else { return };
        for m in markers.iter().filter(|m| m.in_contact && m.in_reference) {
            let moved = rigid.displacement(m.reference);
            self.arrow(m.reference, moved * times, 1.4 * width, RIGID, 1.0);
        }
        let reference = self.at(rigid.reference);
        self.panel.dot(reference, 3.2 * width, PAPER);
        self.panel.dot(reference, 2.4 * width, RIGID);
        self.arrow(rigid.reference, rigid.translation * times, 2.2 * width, RIGID, 1.0);
        if let Some(icr) = motion.and_then(|m| m.icr_px) {
            let at = self.at(icr);
            self.panel.dot(at, 4.6 * width, SLIP);
            self.panel.dot(at, 3.8 * width, MEASURED);
        }
    }

    /// The slip field, and which markers slip.
    fn draw_slip(&mut self, markers: &[Marker], pitch_px: f64, times: f64) {
        self.panel.region(&mut self.contact, CONTACT, 0.06);
        let width = self.width(pitch_px);
        for m in markers.iter().filter(|m| m.matched && m.in_contact) {
            let at = self.at(m.now);
            if m.over {
                self.panel.dot(at, 4.4 * width, PAPER);
                self.panel.dot(at, 3.6 * width, SLIPPING);
            } else {
                self.panel.dot(at, 1.2 * width, SLIP);
            }
        }
        for m in markers.iter().filter(|m| m.matched && m.in_contact) {
            self.arrow(m.now, m.slip * times, width, SLIP, 1.0);
        }
    }

    /// An arrow from a point of the rectified image, with a halo: light round black, dark round colours.
    fn arrow(&mut self, from: Vec2, by: Vec2, width: f64, colour: Colour, alpha: f32) {
        let (from, by) = (self.at(from), by * self.scale);
        if by.length() < ARROW_SHOWN_PX || !by.is_finite() {
            return;
        }
        // Blue is drawn on yellow: a wide halo would hide that both point the same way.
        let halo = match colour {
            SLIP => (1.8, PAPER.with_alpha(0.85)),
            RIGID => (1.0, SLIP.with_alpha(0.6)),
            _ => (1.8, SLIP.with_alpha(0.45 * alpha)),
        };
        self.panel.arrow(from, from + by, width, colour.with_alpha(alpha), halo);
    }

    /// Width of the thinnest arrows: thinner where markers are closer.
    fn width(&self, pitch_px: f64) -> f64 {
        (0.03 * pitch_px * self.scale).clamp(1.6, 3.2)
    }

    /// Position on the panel of a point of the rectified image. Pixel centres are at whole numbers in the image, at
    /// halves on the panel.
    fn at(&self, p: Vec2) -> Vec2 {
        (p + Vec2::new(0.5, 0.5)) * self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors;

    #[test]
    fn the_longest_arrow_of_a_still_is_about_a_pitch_long_and_those_of_a_video_have_one_scale() {
        let sensor = sensors::load("gelslim").expect("built in");
        let (video, still) = (Overlay::new(&sensor), Overlay::new(&sensor).for_stills());
        for (longest_pitch, times) in [(0.01, 20.0), (0.07, 20.0), (0.14, 10.0), (0.28, 5.0), (0.64, 2.0), (4.0, 1.0)] {
            let vectors = [0.2, 1.0].map(|share| Vec2::new(0.0, share * longest_pitch * sensor.pitch_px));
            assert_eq!(still.magnification_of(vectors.into_iter(), sensor.pitch_px), times, "{longest_pitch}");
            assert_eq!(video.magnification_of(vectors.into_iter(), sensor.pitch_px), video.magnification);
        }
        assert_eq!(still.magnification_of(std::iter::empty(), sensor.pitch_px), still.magnification);
    }
}
