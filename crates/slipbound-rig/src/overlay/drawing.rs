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
        }
    }

    /// Size of the image.
    pub fn size(&self) -> SizePx {
        self.canvas.size()
    }

    /// The image drawn last: red, green, blue, rows without gaps.
    pub fn rgb(&self) -> Vec<u8> {
        self.canvas.rgb()
    }

    /// Draws a frame and the results on it, for example of a monitor that has just judged it. `frame`: None when it did
    /// not arrive completely.
    pub fn draw<'a>(&mut self, frame: Option<&Frame<'_>>, report: &SlipReport, found: impl Into<OverlayInput<'a>>) {
        let found = found.into();
        if found.sensor.rectified_px() != self.eroded.size() {
            // The frames have another size than the sensor file states: the monitor's sensor has theirs.
            *self = Overlay::new(found.sensor);
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
                self.draw_motion(report.motion.as_ref(), found.markers, pitch_px);
                let caption = format!("displacement since the reference, arrows x{:.0}", self.magnification);
                strips::caption(&mut self.panel, &caption);
            }
            self.canvas.paste(&self.panel, left);

            self.backdrop.pale();
            self.panel.put(self.backdrop.rgb());
            if judged {
                self.draw_slip(found.markers, pitch_px);
                let caption = format!("slip field = measured - rigid, arrows x{:.0}", self.magnification);
                strips::caption(&mut self.panel, &caption);
            }
            self.canvas.paste(&self.panel, (self.panel.size().width + GAP_PX, strips::HEAD_PX));
        }
        if seen.is_none() {
            strips::no_picture(&mut self.canvas);
        }
        strips::head(&mut self.canvas, report, found.markers);
        strips::legend(&mut self.canvas);
    }

    /// Measured and rigid displacement since the reference, ICR and reference point.
    fn draw_motion(&mut self, motion: Option<&MotionReport>, markers: &[Marker], pitch_px: f64) {
        let rigid = motion.map(|m| RigidMotion {
            reference: m.reference_px,
            translation: m.translation_px,
            rotation_rad: m.rotation_rad,
        });
        self.panel.region(&self.contact, CONTACT, 0.20);
        self.panel.region(&self.inner, INNER, 0.16);
        let width = self.width(pitch_px);
        for m in markers {
            if !m.matched {
                let at = self.at(m.now);
                self.panel.ring(at, 5.0, 1.5, LOST.with_alpha(0.8));
            } else if m.in_reference {
                let alpha = if m.in_contact { 1.0 } else { 0.55 };
                let moved = m.now_from_reference();
                self.arrow(m.reference, moved * self.magnification, 2.3 * width, MEASURED, alpha);
            }
        }
        let Some(rigid) = rigid else { return };
        for m in markers.iter().filter(|m| m.in_contact && m.in_reference) {
            let moved = rigid.displacement(m.reference);
            self.arrow(m.reference, moved * self.magnification, width, RIGID, 1.0);
        }
        let reference = self.at(rigid.reference);
        self.panel.dot(reference, 3.2 * width, PAPER);
        self.panel.dot(reference, 2.4 * width, RIGID);
        self.arrow(rigid.reference, rigid.translation * self.magnification, 2.2 * width, RIGID, 1.0);
        if let Some(icr) = motion.and_then(|m| m.icr_px) {
            let at = self.at(icr);
            self.panel.dot(at, 4.6 * width, SLIP);
            self.panel.dot(at, 3.8 * width, MEASURED);
        }
    }

    /// The slip field, and which markers slip.
    fn draw_slip(&mut self, markers: &[Marker], pitch_px: f64) {
        self.panel.region(&self.contact, CONTACT, 0.06);
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
            self.arrow(m.now, m.slip * self.magnification, width, SLIP, 1.0);
        }
    }

    /// An arrow from a point of the rectified image, with a halo: light round black, dark round colours.
    fn arrow(&mut self, from: Vec2, by: Vec2, width: f64, colour: Colour, alpha: f32) {
        let (from, by) = (self.at(from), by * self.scale);
        if by.length() < ARROW_SHOWN_PX || !by.is_finite() {
            return;
        }
        // Red is drawn on yellow: a wide halo would hide that both point the same way.
        let halo = match colour {
            SLIP => (1.8, PAPER.with_alpha(0.85)),
            RIGID => (0.8, SLIP.with_alpha(0.35)),
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
