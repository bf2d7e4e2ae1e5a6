//! The imprint of the object against the markers, after Dong, Yuan and Adelson (IROS 2017): what the object draws
//! into the gel moves with the object, the markers move with the gel.
//!
//! ```text
//!   reference: a patch in the middle of four markers     now: looked for where those markers have gone,
//!                                                             and up to half a pitch around
//! ```

use super::Detector;
use super::reference::Reference;
use slipbound::image::Gray;
use slipbound::monitor::{Marker, SlipMonitor, SlipReport};
use slipbound::plane::Vec2;

/// Half the side of a patch, and how far around it is looked for, in pitches. Ours: what fits between markers.
const PATCH_PITCH: f64 = 0.3;
const SEARCH_PITCH: f64 = 0.45;

/// Standard deviation of a patch in grey levels below which it shows nothing.
const LEAST_LEVELS: f64 = 3.0;

/// Fewest patches that are judged.
const LEAST_PATCHES: usize = 4;

/// Mean motion against the markers, in pitches, above which it alarms. Ours; set on training trials, see bench/eval.md.
const THRESHOLD_PITCH: f64 = 0.12;

/// A patch of the reference.
#[derive(Debug, Clone)]
struct Patch {
    middle_px: Vec2,
    /// The four markers nearest to it, by number.
    around: [usize; 4],
    levels: Vec<f32>,
}

/// Score: length of the mean motion of the imprint against the markers around it, in pitches.
#[derive(Debug, Clone, Default)]
pub struct Imprint {
    reference: Reference,
    taken_count: u32,
    wants_picture: bool,
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
                self.patches.push(Patch { middle_px, around: at.1, levels });
            }
        }
    }

    /// How far a patch has moved against its markers, px; None where markers or picture are lost.
    fn motion_px(&self, patch: &Patch, markers: &[Marker], picture: &Gray<'_>, pitch_px: f64) -> Option<Vec2> {
        let mut carried_px = Vec2::ZERO;
        for &marker in &patch.around {
            carried_px += markers.get(marker).filter(|m| m.matched).map(|m| m.now)? - self.at_px[marker]?;
        }
        let expected_px = patch.middle_px + carried_px / 4.0;
        let nearest = Vec2::new(expected_px.x.round(), expected_px.y.round());
        let reach = (SEARCH_PITCH * pitch_px).round() as i32;
        let half = half_px(pitch_px);
        let side = (2 * reach + 1) as usize;
        let mut alike = vec![f64::NEG_INFINITY; side * side];
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let there = cut(picture, nearest + Vec2::new(f64::from(dx), f64::from(dy)), half)?;
                alike[(dy + reach) as usize * side + (dx + reach) as usize] = correlation(&patch.levels, &there);
            }
        }
        let best = (0..alike.len()).max_by(|&a, &b| alike[a].total_cmp(&alike[b]))?;
        let (x, y) = (best % side, best / side);
        if x == 0 || y == 0 || x + 1 == side || y + 1 == side || alike[best] < 0.5 {
            return None;
        }
        let vertex = |before: f64, at: f64, after: f64| {
            let bend = before - 2.0 * at + after;
            if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
        };
        let found = Vec2::new(
            x as f64 + vertex(alike[best - 1], alike[best], alike[best + 1]),
            y as f64 + vertex(alike[best - side], alike[best], alike[best + side]),
        );
        Some(nearest + found - Vec2::new(f64::from(reach), f64::from(reach)) - expected_px)
    }
}

impl Detector for Imprint {
    fn see(&mut self, monitor: &SlipMonitor, report: &SlipReport) -> f64 {
        if self.reference.moved(monitor, report).is_empty() {
            return 0.0;
        }
        if self.wants_picture || self.reference.taken_count != self.taken_count {
            self.taken_count = self.reference.taken_count;
            self.wants_picture = false;
            self.take(monitor);
            return 0.0;
        }
        let (picture, pitch_px) = (monitor.imprint(), monitor.sensor().pitch_px);
        let (mut sum, mut count) = (Vec2::ZERO, 0usize);
        for patch in &self.patches {
            if let Some(motion_px) = self.motion_px(patch, monitor.markers(), &picture, pitch_px) {
                sum += motion_px;
                count += 1;
            }
        }
        if count < LEAST_PATCHES { 0.0 } else { sum.length() / count as f64 / pitch_px }
    }

    fn threshold(&self) -> f64 {
        THRESHOLD_PITCH
    }

    /// The next frame gives the patches: the last picture is no longer there.
    fn restart(&mut self) {
        self.reference.restart();
        self.wants_picture = true;
    }
}

fn half_px(pitch_px: f64) -> i32 {
    (PATCH_PITCH * pitch_px).round().max(2.0) as i32
}

/// Middles between markers in contact, and the four markers around each: the nearest to a point half a pitch right and below a marker,
/// all of them within one and a half pitches.
fn cells(markers: &[Marker], pitch_px: f64) -> Vec<(Vec2, [usize; 4])> {
    let usable: Vec<usize> = (0..markers.len()).filter(|&i| markers[i].in_contact && markers[i].matched).collect();
    let mut cells = Vec::new();
    for &corner in &usable {
        let near = markers[corner].now + Vec2::new(0.5, 0.5) * pitch_px;
        let mut by_distance: Vec<(f64, usize)> =
            usable.iter().map(|&i| ((markers[i].now - near).length_squared(), i)).collect();
        by_distance.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some(four) = by_distance.get(..4).filter(|four| four[3].0 < (1.1 * pitch_px).powi(2)) else { continue };
        let around = [four[0].1, four[1].1, four[2].1, four[3].1];
        let middle = around.iter().fold(Vec2::ZERO, |sum, &i| sum + markers[i].now) / 4.0;
        cells.push((middle, around));
    }
    cells
}

/// A patch round a whole pixel, its mean taken off; None where it reaches beyond the picture.
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

/// Correlation of two patches without mean; 0 where one is flat.
fn correlation(a: &[f32], b: &[f32]) -> f64 {
    let (mut ab, mut aa, mut bb) = (0.0f32, 0.0f32, 0.0f32);
    for (a, b) in a.iter().zip(b) {
        ab += a * b;
        aa += a * a;
        bb += b * b;
    }
    if aa > 0.0 && bb > 0.0 { f64::from(ab) / (f64::from(aa) * f64::from(bb)).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patch_is_alike_to_itself_brighter_and_unlike_when_shifted() {
        let wave = |at: usize| -> Vec<f32> {
            let levels: Vec<f32> = (0..49).map(|i| ((i % 7 + at) as f32).sin() * 20.0).collect();
            let mean = levels.iter().sum::<f32>() / 49.0;
            levels.iter().map(|level| level - mean).collect()
        };
        let brighter: Vec<f32> = wave(0).iter().map(|level| 1.5 * level).collect();
        assert!((correlation(&wave(0), &brighter) - 1.0).abs() < 1e-5);
        assert!(correlation(&wave(0), &wave(3)) < 0.0);
        assert_eq!(correlation(&wave(0), &[0.0; 49]), 0.0);
    }
}
