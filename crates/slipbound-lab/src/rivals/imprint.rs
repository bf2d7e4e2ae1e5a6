//! The imprint of the object against the markers, after Dong, Yuan and Adelson (IROS 2017): the imprint of the object
//! in the gel moves with the object, the markers move with the gel.
//!
//! ```text
//!   reference: a patch in the middle of four markers     now: looked for where those markers have gone,
//!                                                             and up to half a pitch around
//! ```

use super::detector::Detector;
use super::reference::Reference;
use slipbound::image::Gray;
use slipbound::monitor::{Marker, SlipMonitor, SlipReport};
use slipbound::plane::Vec2;

/// Half the side of a patch, and its search radius, in pitches. Ours: what fits between markers.
const PATCH_PITCH: f64 = 0.3;
const SEARCH_PITCH: f64 = 0.45;

/// Standard deviation in grey levels below which a patch has no contrast.
const LEAST_LEVELS: f64 = 3.0;

/// Correlation below which a patch is lost.
const LEAST_ALIKE: f64 = 0.5;

/// Fewest patches that are judged.
const LEAST_PATCHES: usize = 4;

/// Mean motion relative to the markers, in pitches, above which it raises an alarm. Ours, see docs/eval.md.
const THRESHOLD_PITCH: f64 = 0.02;

/// A patch of the reference.
#[derive(Debug, Clone)]
struct Patch {
    middle_px: Vec2,
    /// The four markers nearest to it, by number.
    around: [usize; 4],
    levels: Vec<f32>,
    /// Last match, in whole pixels relative to the position expected from its markers.
    found: (i32, i32),
}

/// Score: length of the mean motion of the imprint relative to the markers around it, in pitches.
#[derive(Debug, Clone, Default)]
pub struct Imprint {
    reference: Reference,
    taken_count: u32,
    wants_image: bool,
    patches: Vec<Patch>,
    at_px: Vec<Option<Vec2>>,
}

impl Imprint {
    fn take(&mut self, monitor: &SlipMonitor) {
        let half = half_px(monitor.sensor().pitch_px);
        let markers = monitor.markers();
        self.at_px.clear();
        self.at_px.extend(markers.iter().map(|m| (m.matched && m.whole).then_some(m.now)));
        self.patches.clear();
        let picture = monitor.imprint();
        for at in cells(markers, monitor.sensor().pitch_px) {
            let middle_px = Vec2::new(at.0.x.round(), at.0.y.round());
            let Some(levels) = cut(&picture, middle_px, half) else { continue };
            if deviation(&levels) >= LEAST_LEVELS {
                self.patches.push(Patch { middle_px, around: at.1, levels, found: (0, 0) });
            }
        }
    }
}

/// Motion of a patch relative to its markers, px; None if markers or image are lost. Hill climbing from the last match
/// to the nearest maximum of the correlation: an imprint moves by less than a patch in a frame.
fn motion_px(
    patch: &mut Patch,
    at_px: &[Option<Vec2>],
    markers: &[Marker],
    picture: &Gray<'_>,
    pitch_px: f64,
) -> Option<Vec2> {
    let mut carried_px = Vec2::ZERO;
    for &marker in &patch.around {
        carried_px += markers.get(marker).filter(|m| m.matched).map(|m| m.now)? - at_px[marker]?;
    }
    let expected_px = patch.middle_px + carried_px / 4.0;
    let (x, y) = (expected_px.x.round() as i32, expected_px.y.round() as i32);
    let reach = (SEARCH_PITCH * pitch_px).round() as i32;
    let half = half_px(pitch_px);
    let alike = |(dx, dy): (i32, i32)| alike(&patch.levels, picture, (x + dx, y + dy), half);
    let mut found = patch.found;
    let mut best = alike(found)?;
    loop {
        let mut next = (found, best);
        for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)] {
            let there = (found.0 + dx, found.1 + dy);
            let alike = alike(there)?;
            if alike > next.1 {
                next = (there, alike);
            }
        }
        if next.0 == found {
            break;
        }
        (found, best) = next;
        if found.0.abs() >= reach || found.1.abs() >= reach {
            patch.found = (0, 0);
            return None;
        }
    }
    if best < LEAST_ALIKE {
        patch.found = (0, 0);
        return None;
    }
    let vertex = |before: f64, after: f64| {
        let bend = before - 2.0 * best + after;
        if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
    };
    let part = Vec2::new(
        vertex(alike((found.0 - 1, found.1))?, alike((found.0 + 1, found.1))?),
        vertex(alike((found.0, found.1 - 1))?, alike((found.0, found.1 + 1))?),
    );
    let at = Vec2::new(f64::from(x + found.0), f64::from(y + found.1)) + part;
    patch.found = found;
    Some(at - expected_px)
}

impl Detector for Imprint {
    fn see(&mut self, monitor: &SlipMonitor, report: &SlipReport) -> f64 {
        if self.reference.moved(monitor, report).is_empty() {
            return 0.0;
        }
        if self.wants_image || self.reference.taken_count != self.taken_count {
            self.taken_count = self.reference.taken_count;
            self.wants_image = false;
            self.take(monitor);
            return 0.0;
        }
        let (picture, pitch_px) = (monitor.imprint(), monitor.sensor().pitch_px);
        let (mut sum, mut count) = (Vec2::ZERO, 0usize);
        for patch in &mut self.patches {
            if let Some(motion_px) = motion_px(patch, &self.at_px, monitor.markers(), &picture, pitch_px) {
                sum += motion_px;
                count += 1;
            }
        }
        if count < LEAST_PATCHES { 0.0 } else { sum.length() / count as f64 / pitch_px }
    }

    fn threshold(&self) -> f64 {
        THRESHOLD_PITCH
    }

    /// The patches are taken from the next frame, because the last image is no longer available.
    fn restart(&mut self) {
        self.reference.restart();
        self.wants_image = true;
    }
}

fn half_px(pitch_px: f64) -> i32 {
    (PATCH_PITCH * pitch_px).round().max(2.0) as i32
}

/// Centres between markers in contact, and the four markers around each: the nearest to a point half a pitch right and
/// below a marker, all of them within one and a half pitches.
fn cells(markers: &[Marker], pitch_px: f64) -> Vec<(Vec2, [usize; 4])> {
    let usable: Vec<usize> = (0..markers.len()).filter(|&i| markers[i].in_contact && markers[i].matched).collect();
    let mut cells = Vec::new();
    for &corner in &usable {
        let near = markers[corner].now + Vec2::new(0.5, 0.5) * pitch_px;
        let mut by_distance: Vec<(f64, usize)> =
            usable.iter().map(|&i| ((markers[i].now - near).length_squared(), i)).collect();
        by_distance.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some(four) = by_distance.get(..4).filter(|four| four[3].0.sqrt() < 1.1 * pitch_px) else { continue };
        let around = [four[0].1, four[1].1, four[2].1, four[3].1];
        let middle = around.iter().fold(Vec2::ZERO, |sum, &i| sum + markers[i].now) / 4.0;
        cells.push((middle, around));
    }
    cells
}

/// A patch around a whole pixel, without its mean; None if it extends beyond the image.
fn cut(picture: &Gray<'_>, middle_px: Vec2, half: i32) -> Option<Vec<f32>> {
    let size = picture.size();
    let (x, y) = (middle_px.x as i32, middle_px.y as i32);
    if x < half || y < half || x + half >= size.width as i32 || y + half >= size.height as i32 {
        return None;
    }
    let mut levels = Vec::with_capacity(((2 * half + 1) * (2 * half + 1)) as usize);
    for row in y - half..=y + half {
        let row = &picture.row(row as usize)[(x - half) as usize..=(x + half) as usize];
        levels.extend(row.iter().map(|&level| f32::from(level)));
    }
    let mean = levels.iter().sum::<f32>() / levels.len() as f32;
    levels.iter_mut().for_each(|level| *level -= mean);
    Some(levels)
}

/// Standard deviation of a patch without mean.
fn deviation(levels: &[f32]) -> f64 {
    (f64::from(levels.iter().map(|level| level * level).sum::<f32>()) / levels.len() as f64).sqrt()
}

/// Correlation of a patch without mean with the image around a pixel; 0 if one of them is uniform, None if the other
/// extends beyond the image.
fn alike(levels: &[f32], picture: &Gray<'_>, (x, y): (i32, i32), half: i32) -> Option<f64> {
    let size = picture.size();
    if x < half || y < half || x + half >= size.width as i32 || y + half >= size.height as i32 {
        return None;
    }
    let side = (2 * half + 1) as usize;
    let (mut ab, mut aa, mut b, mut bb) = (0.0f32, 0.0f32, 0.0f32, 0.0f32);
    for (row, levels) in (y - half..=y + half).zip(levels.chunks_exact(side)) {
        let row = &picture.row(row as usize)[(x - half) as usize..=(x + half) as usize];
        for (&now, &then) in row.iter().zip(levels) {
            let now = f32::from(now);
            ab += now * then;
            aa += then * then;
            b += now;
            bb += now * now;
        }
    }
    // The patch has zero mean, so the mean of the image cancels in the product.
    let spread = bb - b * b / levels.len() as f32;
    Some(if aa > 0.0 && spread > 0.0 { f64::from(ab) / (f64::from(aa) * f64::from(spread)).sqrt() } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::image::SizePx;

    /// An image of irregular bumps, shifted by a vector.
    fn picture(by: Vec2, brighter: f64) -> Vec<u8> {
        let level =
            |x: f64, y: f64| 60.0 + 25.0 * (libm::sin(0.31 * x) * libm::cos(0.23 * y) + libm::sin(0.17 * x + 0.29 * y));
        (0..100 * 80).map(|i| (brighter * level(f64::from(i % 100) - by.x, f64::from(i / 100) - by.y)) as u8).collect()
    }

    fn gray(bytes: &[u8]) -> Gray<'_> {
        Gray::new(bytes, SizePx::new(100, 80)).expect("whole")
    }

    /// The imprint moves by (2.4, -1.6) px, in small steps, and the light changes; the markers do not move.
    #[test]
    fn an_imprint_that_moves_against_its_markers_is_followed() {
        let first = picture(Vec2::ZERO, 1.0);
        let middle_px = Vec2::new(50.0, 40.0);
        let levels = cut(&gray(&first), middle_px, half_px(22.0)).expect("inside");
        assert!(deviation(&levels) > LEAST_LEVELS);
        let mut patch = Patch { middle_px, around: [0; 4], levels, found: (0, 0) };
        let at = Vec2::new(50.0, 40.0);
        let marker = Marker {
            id: 0,
            rest: at,
            reference: at,
            now: at,
            matched: true,
            whole: true,
            in_reference: true,
            in_contact: true,
            inner: true,
            slip: Vec2::ZERO,
            over: false,
        };
        let mut moved_px = Vec2::ZERO;
        for step in 1..=4 {
            let bytes = picture(Vec2::new(0.6, -0.4) * f64::from(step), 1.3);
            let found = motion_px(&mut patch, &[Some(at)], &[marker], &gray(&bytes), 22.0);
            moved_px = found.expect("followed");
        }
        // Along a ridge of the correlation the parabolas of the two axes have an error of a part of a pixel: 0.02
        // pitch.
        assert!((moved_px - Vec2::new(2.4, -1.6)).length() < 0.45, "{moved_px:?}");
        assert_eq!(alike(&patch.levels, &gray(&first), (3, 40), half_px(22.0)), None, "beyond the picture");
        assert_eq!(alike(&patch.levels, &gray(&[90; 100 * 80]), (50, 40), half_px(22.0)), Some(0.0));
    }
}
