//! A mask -> the closed polygons around it.
//!
//! ```text
//!   + - - - +        Traced along the sides of the pixels, the region on the right: around a region from x to y,
//!   | # # # +-+      around a hole the other way, so that the signed areas add up to that of the mask. Corners that lie
//!   | # # # # |      within a pixel of the line without them are left out.
//!   +---------+
//! ```

use slipbound::image::Mask;
use slipbound::plane::Vec2;

/// How far a corner that is left out may lie off the line, px. The steps of a slanted border are 0.7 px deep.
const STRAIGHT_PX: f64 = 1.0;

/// Steps along the sides of pixels: right, down, left, up.
const STEPS: [(isize, isize); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// The outlines of a mask in the order of their upper left corners, each without its first corner repeated at the end;
/// pixel centres are at whole numbers. A piece or a hole too small for three corners has none.
pub(super) fn outlines(mask: &Mask) -> Vec<Vec<Vec2>> {
    let mut traced = Mask::new(mask.size());
    let mut all = Vec::new();
    for y in 0..mask.size().height as isize {
        for x in 0..mask.size().width as isize {
            if mask.get(x, y) && !mask.get(x, y - 1) && !traced.get(x, y) {
                all.push(straightened(&trace(mask, (x, y), &mut traced)));
            }
        }
    }
    all.retain(|outline| outline.len() > 2);
    all
}

/// The corners of the outline whose first step runs along the upper side of pixel `first`. `traced`: the pixels whose
/// upper side is part of an outline.
fn trace(mask: &Mask, first: (isize, isize), traced: &mut Mask) -> Vec<Vec2> {
    let (mut at, mut heading) = (first, 0);
    let mut corners = Vec::new();
    loop {
        if heading == 0 {
            if traced.get(at.0, at.1) {
                return corners; // only the first step can be met again
            }
            traced.set(at.0 as usize, at.1 as usize, true);
        }
        let (dx, dy) = STEPS[heading];
        at = (at.0 + dx, at.1 + dy);
        // Of the four pixels at this corner, those ahead: pixels that touch at a corner are connected.
        let ahead = |right: isize| {
            let (x, y) = ((dx - right * dy - 1) / 2, (dy + right * dx - 1) / 2);
            mask.get(at.0 + x, at.1 + y)
        };
        let turn = match (ahead(-1), ahead(1)) {
            (true, _) => 3,
            (false, true) => continue,
            (false, false) => 1,
        };
        heading = (heading + turn) % 4;
        corners.push(Vec2::new(at.0 as f64 - 0.5, at.1 as f64 - 0.5));
    }
}

/// A closed line without the corners that lie within [`STRAIGHT_PX`] of the line without them (Douglas and Peucker).
fn straightened(corners: &[Vec2]) -> Vec<Vec2> {
    let (first, last) = (0, corners.len());
    let off = |i: usize| (corners[i] - corners[0]).length();
    let opposite = (first..last).max_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(first);
    let mut kept = vec![first, opposite];
    let mut open = vec![(first, opposite), (opposite, last)];
    while let Some((from, to)) = open.pop() {
        let along = corners[to % last] - corners[from];
        let off = |i: usize| {
            let to = corners[i] - corners[from];
            let share = along.dot(to) / along.length_squared().max(f64::MIN_POSITIVE);
            (to - along * share.clamp(0.0, 1.0)).length()
        };
        let Some(corner) = (from + 1..to).max_by(|a, b| off(*a).total_cmp(&off(*b))) else { continue };
        if off(corner) > STRAIGHT_PX {
            kept.push(corner);
            open.extend([(from, corner), (corner, to)]);
        }
    }
    kept.sort_unstable();
    kept.into_iter().map(|corner| corners[corner]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::image::SizePx;

    fn area_px2(outline: &[Vec2]) -> f64 {
        outline.iter().zip(outline.iter().cycle().skip(1)).map(|(a, b)| a.cross(*b)).sum::<f64>() / 2.0
    }

    #[test]
    fn a_hole_and_pieces_that_touch_at_a_corner_are_traced_along_the_sides_of_pixels() {
        let mask = Mask::from_picture(
            "####....
             #..#....
             #..#....
             ####....
             ....####
             #...####
             ....####",
        );
        let points = |all: &[(f64, f64)]| all.iter().map(|&(x, y)| Vec2::new(x, y)).collect::<Vec<_>>();
        let around = points(&[
            (-0.5, -0.5),
            (3.5, -0.5),
            (3.5, 3.5),
            (7.5, 3.5),
            (7.5, 6.5),
            (3.5, 6.5),
            (3.5, 3.5),
            (-0.5, 3.5),
        ]);
        let hole = points(&[(2.5, 2.5), (2.5, 0.5), (0.5, 0.5), (0.5, 2.5)]);
        let found = outlines(&mask);
        assert_eq!(found.len(), 2, "not the single pixel: {found:?}");
        let turned = |outline: &[Vec2], first: Vec2| {
            let at = outline.iter().position(|corner| *corner == first).expect("a corner");
            [&outline[at..], &outline[..at]].concat()
        };
        assert_eq!(turned(&found[0], around[0]), around);
        assert_eq!(turned(&found[1], hole[0]), hole);
        assert_eq!(found.iter().map(|outline| area_px2(outline)).sum::<f64>(), (mask.area_px2() - 1) as f64);
    }

    #[test]
    fn a_disc_has_few_corners_and_nearly_its_area() {
        for radius_px in [6.0, 25.0, 60.3] {
            let mut mask = Mask::new(SizePx::new(130, 130));
            for i in 0..130 * 130 {
                let from_middle = Vec2::new((i % 130) as f64 - 64.2, (i / 130) as f64 - 63.7);
                mask.set(i % 130, i / 130, from_middle.length() <= radius_px);
            }
            let [outline] = &outlines(&mask)[..] else { panic!("one outline") };
            let (area, expected) = (area_px2(outline), mask.area_px2() as f64);
            assert!((area / expected - 1.0).abs() < 0.1, "{area} of {expected} px");
            assert!(outline.len() <= 32, "{} corners", outline.len());
        }
    }
}
