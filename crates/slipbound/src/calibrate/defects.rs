//! Damaged skin: places that stand out in the rectified image at rest and are not markers.

use super::grid::Grid;
use crate::image::Mask;
use crate::pixels::background::Background;
use crate::pixels::components::Components;
use crate::pixels::dots::DotFinder;
use crate::pixels::morphology::{Element, Morphology};
use crate::pixels::patch::write_disc;
use crate::pixels::threshold::far_from;
use crate::pixels::warp::WarpTable;

/// A defect differs from its surroundings by this much.
const DEEP_LEVELS: u8 = 30;
/// And is at least this wide, in pitches.
const WIDE_PITCH: f64 = 0.25;
/// Defects kept, the largest first.
const MOST_COUNT: usize = 32;

/// Rectangles (left, top, right, bottom, exclusive) in rectified px.
pub(super) fn find(rectified: &[u8], table: &WarpTable, grid: &Grid) -> Vec<[usize; 4]> {
    let size = table.out_size();
    let mut background = vec![0; size.area()];
    Background::new(size, 0.58 * grid.pitch_px).apply(rectified, &mut background);
    let mut differs = Mask::new(size);
    far_from(rectified, &background, DEEP_LEVELS, &mut differs);
    let mut morphology = Morphology::new(size);
    let wide = (WIDE_PITCH * grid.pitch_px).round().max(2.0) as usize;
    // Left out: what the camera does not see, and its rim, where the background is too low.
    let mut seen = Mask::new(size);
    let rim = (0.6 * grid.pitch_px).round() as usize * 2 + 1;
    morphology.erode(table.valid(), &Element::rect(rim, rim), &mut seen);
    differs.words_mut().iter_mut().zip(seen.words()).for_each(|(d, s)| *d &= s);
    // Left out: markers, doubled ones too, and the light halo that the background leaves around them.
    let mut finder = DotFinder::new(size, grid.diameter_px, grid.pitch_px, grid.polarity);
    let radius_px = 0.5 * grid.diameter_px + 0.2 * grid.pitch_px;
    let spots = finder.run(rectified, 4.0).iter().map(|s| s.position);
    for centre in spots.chain(grid.dots.keys().map(|n| grid.plane(*n))) {
        write_disc(&mut differs, centre, radius_px, false);
    }
    let mut opened = Mask::new(size);
    morphology.open(&differs, &Element::rect(wide, wide), &mut opened);
    let mut components = Components::new(size);
    let mut found: Vec<_> = components.label(&opened).to_vec();
    found.sort_by(|p, q| q.area_px2.cmp(&p.area_px2).then(p.top_px.cmp(&q.top_px)).then(p.left_px.cmp(&q.left_px)));
    found.truncate(MOST_COUNT);
    found.iter().map(|c| [c.left_px, c.top_px, c.right_px, c.bottom_px]).collect()
}
