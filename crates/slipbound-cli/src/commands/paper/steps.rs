//! The method step by step on a simulated frame, and the two objects that fail.

use crate::outcome::Failure;
use anyhow::anyhow;
use slipbound::image::{Mask, SizePx};
use slipbound::monitor::{SlipMonitor, SlipReport, SlipState};
use slipbound::pixels::canny::Canny;
use slipbound::pixels::flatten::Flatten;
use slipbound::pixels::gaussian::Gaussian;
use slipbound::port::FrameBuffer;
use slipbound_lab::eval::outcome::fractions;
use slipbound_lab::eval::watch::{Onlooker, Restarts, Watch, watch};
use slipbound_lab::rivals::{Entry, named};
use slipbound_lab::scenes::Trial;
use slipbound_rig::html_page::{Figure, Part};
use slipbound_rig::overlay::Overlay;
use std::collections::BTreeMap;

/// The detector whose steps are shown: the paper exactly as written.
const SHOWN: &str = "paper_as_written";

/// The detector by which the same frame is shown beside it.
const OURS: &str = "ours";

/// The load fraction at which, or above which, a frame is shown.
const SHOWN_FRACTION: f64 = 0.85;

/// The paper's background: kernel and sigma of 31 px of 427, offset, gain and bias, in the released code.
const BACKGROUND_FRACTION: f64 = 31.0 / 427.0;
const FLATTEN: (f64, f64, f64) = (50.0, 2.0, 20.0);

/// The trial for the steps, and those of the objects that fail.
const METHOD: &str = "ramp?object=screwdriver&force_n=30&direction_deg=30&twist_fraction=0.3&seed=3";
const FAILING: [(&str, &str); 2] = [
    ("Crayons box", "ramp?object=crayons_box&force_n=15&direction_deg=0&seed=3"),
    ("Scrub sponge", "ramp?object=scrub_sponge&force_n=15&direction_deg=0&seed=3"),
];

/// A frame of a trial.
struct Chosen {
    what: Watch,
    frame: u64,
    /// Load over the load that makes the object slide.
    f: f64,
}

impl Chosen {
    /// The first frame of a trial at [`SHOWN_FRACTION`] or above that is in this state by the paper's rule; any, for None.
    fn of(text: &str, state: Option<SlipState>) -> Result<Self, Failure> {
        let entry: &'static Entry = named(SHOWN).map_err(Failure::arguments)?;
        let what = Watch::new(Trial::parse(text).map_err(Failure::arguments)?, Restarts::All);
        let mut states = BTreeMap::new();
        let mut onlooker = |buffer: &FrameBuffer, report: &SlipReport, _: &SlipMonitor| {
            states.insert(buffer.seq, report.state);
        };
        let onlooker: &mut Onlooker<'_> = &mut onlooker;
        let watched = watch(&what, &[entry], Some((entry.name, onlooker))).map_err(|e| Failure::work(text, e))?;
        let frames = watched.truth.iter().map(|truth| truth.frame).zip(fractions(&watched));
        let mut loaded = frames.filter(|(_, f)| *f >= SHOWN_FRACTION);
        let found = loaded.find(|(frame, _)| state.is_none() || states.get(frame).copied() == state);
        let (frame, f) = found.ok_or_else(|| anyhow!("{text}: no frame of f {SHOWN_FRACTION} or more is {state:?}"))?;
        Ok(Chosen { what, frame, f })
    }

    /// Passes the frame as this detector sees it to a closure.
    fn look(
        &self,
        detector: &str,
        look: &mut dyn FnMut(&FrameBuffer, &SlipReport, &SlipMonitor) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let entry: &'static Entry = named(detector).map_err(Failure::arguments)?;
        let mut shown = Ok(());
        let mut onlooker = |buffer: &FrameBuffer, report: &SlipReport, monitor: &SlipMonitor| {
            if buffer.seq == self.frame && shown.is_ok() {
                shown = look(buffer, report, monitor);
            }
        };
        let onlooker: &mut Onlooker<'_> = &mut onlooker;
        watch(&self.what, &[entry], Some((entry.name, onlooker))).map_err(|e| Failure::work(&self.what.trial, e))?;
        shown
    }
}

/// An image with a title.
fn figure(title: &str, caption: &str, rgb: &[u8], size: SizePx) -> Result<Figure, Failure> {
    Figure::new(title, caption, rgb, size).map_err(|error| Failure::Work(error.into()))
}

/// What the colours of an overlay mean.
const COLOURS: &str = "Left: contact green, inner region white, measured yellow, rigid light blue. Right: slip field black, purple \
                       where it is over the threshold.";

/// Both panels of the overlay: displacement and rigid motion, slip field.
fn overlay(title: &str, buffer: &FrameBuffer, report: &SlipReport, monitor: &SlipMonitor) -> Result<Figure, Failure> {
    let mut overlay = Overlay::new(monitor.sensor()).for_stills();
    overlay.draw(buffer.frame().ok().as_ref(), report, monitor);
    figure(title, COLOURS, &overlay.rgb(), overlay.size())
}

/// The steps, in the paper's order.
pub fn method() -> Result<Vec<Part>, Failure> {
    let (mut figures, mut said) = (Vec::new(), String::new());
    let chosen = Chosen::of(METHOD, Some(SlipState::Incipient))?;
    chosen.look(SHOWN, &mut |buffer, report, monitor| {
        figures.push(figure("Camera", "the picture as it is delivered", &buffer.pixels, buffer.size)?);
        let grey = monitor.imprint();
        let size = grey.size();
        let levels: Vec<u8> = (0..size.height).flat_map(|y| grey.row(y)).copied().collect();
        figures.push(figure("Imprint", "rectified, grey", &rgb_of(&levels), size)?);
        let flat = flattened(&levels, size);
        figures.push(figure("Flattened", "background taken off", &rgb_of(&flat), size)?);
        figures.push(figure("Edges", "Canny on the pressed weave", &rgb_of(&edges(&flat, monitor)), size)?);
        let (contact, inner) = (monitor.contact_region(), monitor.inner_region());
        let mask = tinted(&levels, size, &[(contact, [60, 200, 90])]);
        figures.push(figure("Mask", "contact region: edges closed, eroded, dilated", &mask, size)?);
        let mut markers = rgb_of(&levels);
        for marker in monitor.markers().iter().filter(|marker| marker.matched) {
            dot(&mut markers, size, (marker.now.x, marker.now.y), 3.0);
        }
        figures.push(figure("Markers", "found, and matched to the reference", &markers, size)?);
        let regions = tinted(&levels, size, &[(contact, [60, 200, 90]), (&inner, [255, 255, 255])]);
        figures.push(figure("Inner region", "the contact eroded: what moves as a rigid body", &regions, size)?);
        figures.push(overlay("Displacement and slip field", buffer, report, monitor)?);
        let slip = &report.slip;
        said = format!(
            "Reference: frame {}, anew after each slip. Verdict: incipient slip, {} markers over {:.2} pitch, {} are needed.",
            report.reference_seq, slip.markers_over, slip.threshold_pitch, slip.markers_needed
        );
        Ok(())
    })?;
    chosen.look(OURS, &mut |buffer, report, monitor| {
        figures.push(overlay("The same frame by the settings of slipbound", buffer, report, monitor)?);
        Ok(())
    })?;
    let text = format!(
        "The paper's settings on a simulated frame: {METHOD}, frame {}, the first at {SHOWN_FRACTION} or more of the load that \
         makes the object slide in which the paper's rule reports slip; f {:.2}. {said} With these settings edges of light and \
         scratches pass for contact, too; the last picture is the same frame by ours.",
        chosen.frame, chosen.f
    );
    Ok(vec![Part::Text(text), Part::Figures(figures)])
}

/// The objects that the paper's rule misses most.
pub fn failing() -> Result<Vec<Part>, Failure> {
    let mut figures = Vec::new();
    for (name, trial) in FAILING {
        let chosen = Chosen::of(trial, None)?;
        chosen.look(SHOWN, &mut |buffer, report, monitor| {
            let slip_px = report.slip.max_pitch * monitor.sensor().pitch_px;
            let threshold_px = report.slip.threshold_pitch * monitor.sensor().pitch_px;
            let title = format!(
                "{name} at 15 N, f {:.2}: longest slip {slip_px:.1} px, threshold {threshold_px:.1} px",
                chosen.f
            );
            figures.push(overlay(&title, buffer, report, monitor)?);
            Ok(())
        })?;
    }
    let text = "A flat face has no rim of shading and little pressure, and at a light grip the whole gel shears by less than the paper's \
                threshold before the object slides. Published: right in 49.97 % (box) and 33.33 % (sponge) of the trials; ours are in Table I.";
    Ok(vec![Part::Text(text.into()), Part::Figures(figures)])
}

fn rgb_of(levels: &[u8]) -> Vec<u8> {
    levels.iter().flat_map(|&level| [level; 3]).collect()
}

fn flattened(levels: &[u8], size: SizePx) -> Vec<u8> {
    let sigma_px = BACKGROUND_FRACTION * 640.0;
    let side = 2 * (0.5 * sigma_px).round() as usize + 1;
    let mut background = vec![0.0; size.area()];
    Gaussian::new(size, [side, side], sigma_px).to_f32(levels, &mut background);
    let mut flat = vec![0; size.area()];
    Flatten::new(FLATTEN.0, FLATTEN.1, FLATTEN.2).from_f32(levels, &background, &mut flat);
    flat
}

/// Edges as white on black, with the thresholds of the finger.
fn edges(flat: &[u8], monitor: &SlipMonitor) -> Vec<u8> {
    let size = monitor.sensor().rectified_px();
    let (mut canny, mut mask, mut from) = (Canny::new(size), Mask::new(size), 0);
    for band in &monitor.sensor().edge_bands {
        let to = ((band.rows_to_fraction * size.height as f64).round() as usize).min(size.height);
        canny.run(flat, from..to, band.low_levels, band.high_levels, &mut mask);
        from = to;
    }
    pixels(size).map(|(x, y)| if mask.get(x, y) { 255 } else { 0 }).collect()
}

fn pixels(size: SizePx) -> impl Iterator<Item = (isize, isize)> {
    (0..size.height as isize).flat_map(move |y| (0..size.width as isize).map(move |x| (x, y)))
}

/// A grey image with regions in colours.
fn tinted(levels: &[u8], size: SizePx, regions: &[(&Mask, [u8; 3])]) -> Vec<u8> {
    let mut rgb = rgb_of(levels);
    for ((x, y), pixel) in pixels(size).zip(rgb.chunks_exact_mut(3)) {
        for (_, colour) in regions.iter().filter(|(mask, _)| mask.get(x, y)) {
            for (channel, &tint) in pixel.iter_mut().zip(colour) {
                *channel = ((u16::from(*channel) * 3 + u16::from(tint) * 2) / 5) as u8;
            }
        }
    }
    rgb
}

/// A yellow dot.
fn dot(rgb: &mut [u8], size: SizePx, (x, y): (f64, f64), radius_px: f64) {
    let reach = radius_px.ceil() as isize;
    let (middle_x, middle_y) = (x.round() as isize, y.round() as isize);
    for (dx, dy) in (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy))) {
        let (x, y) = (middle_x + dx, middle_y + dy);
        let inside = x >= 0 && y >= 0 && (x as usize) < size.width && (y as usize) < size.height;
        if inside && (dx * dx + dy * dy) as f64 <= radius_px * radius_px {
            rgb[3 * (y as usize * size.width + x as usize)..][..3].copy_from_slice(&[255, 222, 0]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_of_the_steps_shows_as_many_slipping_markers_as_the_rule_needs() {
        let mut seen = None;
        let chosen = Chosen::of(METHOD, Some(SlipState::Incipient)).unwrap_or_else(|_| panic!("a frame with slip"));
        let mut look = |_: &FrameBuffer, report: &SlipReport, _: &SlipMonitor| {
            seen = Some((report.state, report.slip));
            Ok(())
        };
        chosen.look(SHOWN, &mut look).unwrap_or_else(|_| panic!("the same frame again"));
        let (state, slip) = seen.expect("the frame");
        assert!(chosen.f >= SHOWN_FRACTION && state == SlipState::Incipient, "f {}, {state:?}", chosen.f);
        assert!(slip.markers_over >= slip.markers_needed, "{slip:?}");
    }
}
