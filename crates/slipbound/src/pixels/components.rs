//! Mask -> its connected components: area, box, centroid; and the mask without the small ones, or without its holes.

use super::runs::{Corners, Runs};
use crate::image::{Mask, SizePx};
use crate::plane::Vec2;

/// A component of a mask: pixels connected along sides or at corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Component {
    /// Number of pixels.
    pub area_px2: usize,
    /// First column.
    pub left_px: usize,
    /// First row.
    pub top_px: usize,
    /// Last column + 1.
    pub right_px: usize,
    /// Last row + 1.
    pub bottom_px: usize,
    /// Mean position of the pixels, in px with pixel centres at whole numbers.
    pub centroid_px: Vec2,
}

/// A run and the index of the first run of its component.
#[derive(Debug, Clone)]
pub(crate) struct ComponentRun {
    pub(crate) row: usize,
    pub(crate) columns: std::ops::Range<usize>,
    pub(crate) component: usize,
}

/// The scratch memory of the labelling.
#[derive(Debug, Clone)]
pub struct Components {
    size: SizePx,
    runs: Runs,
    /// Per run the index of its component.
    component_of: Vec<u32>,
    components: Vec<Component>,
    /// Sums of x and y over the pixels of each component.
    sums: Vec<[u64; 2]>,
    /// Per root run: whether its component reaches the border.
    reaches_border: Vec<bool>,
    /// Per component, the area that another mask fills.
    filled_px2: Vec<u32>,
}

impl Components {
    /// Scratch memory for masks of `size`, enough for the most runs and components such a mask can have.
    pub fn new(size: SizePx) -> Self {
        let runs = Runs::new(size);
        let most_runs = runs.all.capacity();
        let most_components = size.width.div_ceil(2) * size.height.div_ceil(2);
        Components {
            size,
            runs,
            component_of: Vec::with_capacity(most_runs),
            components: Vec::with_capacity(most_components),
            sums: Vec::with_capacity(most_components),
            reaches_border: Vec::with_capacity(most_runs),
            filled_px2: Vec::with_capacity(most_components),
        }
    }

    /// Finds the components of `mask`, in the order of their first pixel, row by row.
    pub fn label(&mut self, mask: &Mask) -> &[Component] {
        self.runs.find(mask, 0, Corners::Join);
        self.components.clear();
        self.sums.clear();
        self.component_of.clear();
        for (i, (run, root)) in self.runs.with_roots().enumerate() {
            let root = root as usize;
            let component = if root == i { self.components.len() } else { self.component_of[root] as usize };
            self.component_of.push(component as u32);
            let (from, to, y) = (run.from as usize, run.to as usize, run.row as usize);
            if root == i {
                self.components.push(Component {
                    area_px2: 0,
                    left_px: from,
                    top_px: y,
                    right_px: to,
                    bottom_px: y + 1,
                    centroid_px: Vec2::ZERO,
                });
                self.sums.push([0; 2]);
            }
            let c = &mut self.components[component];
            c.area_px2 += to - from;
            c.left_px = c.left_px.min(from);
            c.right_px = c.right_px.max(to);
            c.bottom_px = y + 1;
            let [sum_x, sum_y] = &mut self.sums[component];
            *sum_x += ((from + to - 1) * (to - from) / 2) as u64;
            *sum_y += (y * (to - from)) as u64;
        }
        for (c, [x, y]) in self.components.iter_mut().zip(&self.sums) {
            c.centroid_px = Vec2::new(*x as f64, *y as f64) / c.area_px2 as f64;
        }
        &self.components
    }

    /// The components found last.
    pub fn components(&self) -> &[Component] {
        &self.components
    }

    /// Clears every component of `mask` that `keep` rejects.
    pub fn retain(&mut self, mask: &mut Mask, keep: impl Fn(&Component) -> bool) {
        self.label(mask);
        for (run, &component) in self.runs.all.iter().zip(&self.component_of) {
            if !keep(&self.components[component as usize]) {
                run.write(mask, false);
            }
        }
    }

    /// Clears the components of fewer than `min_area_px2` pixels. The method does not need it; the comparison with other
    /// implementations does (`examples/parity.rs`).
    pub fn remove_small(&mut self, mask: &mut Mask, min_area_px2: usize) {
        self.retain(mask, |c| c.area_px2 >= min_area_px2);
    }

    /// Clears the components of fewer than `least_area_px2` pixels, and those of which `other` fills less than
    /// `least_fraction` times the share that it fills of the largest component.
    pub fn remove_weak(&mut self, mask: &mut Mask, other: &Mask, least_area_px2: usize, least_fraction: f64) {
        self.label(mask);
        self.filled_px2.clear();
        self.filled_px2.resize(self.components.len(), 0);
        for (run, &component) in self.runs.all.iter().zip(&self.component_of) {
            self.filled_px2[component as usize] += run.count(other);
        }
        let share =
            |component: usize| f64::from(self.filled_px2[component]) / self.components[component].area_px2 as f64;
        let Some(largest) = (0..self.components.len()).max_by_key(|&component| self.components[component].area_px2)
        else {
            return;
        };
        let least = least_fraction * share(largest);
        for (run, &component) in self.runs.all.iter().zip(&self.component_of) {
            if self.components[component as usize].area_px2 < least_area_px2 || share(component as usize) < least {
                run.write(mask, false);
            }
        }
    }

    /// Sets the clear pixels that are not connected along sides of clear pixels to the border.
    pub fn fill_holes(&mut self, mask: &mut Mask) {
        self.runs.find(mask, u64::MAX, Corners::Part);
        self.reaches_border.clear();
        self.reaches_border.resize(self.runs.all.len(), false);
        let (right, bottom) = (self.size.width as u32, self.size.height as u32 - 1);
        for (run, root) in self.runs.with_roots() {
            if run.from == 0 || run.to == right || run.row == 0 || run.row == bottom {
                self.reaches_border[root as usize] = true;
            }
        }
        for (run, root) in self.runs.with_roots() {
            if !self.reaches_border[root as usize] {
                run.write(mask, true);
            }
        }
        // These runs were the clear ones: no labelling is valid now.
        self.components.clear();
    }

    /// The runs of a mask, row by row, and their components when only sides connect.
    pub(crate) fn runs_by_sides(&mut self, mask: &Mask) -> impl Iterator<Item = ComponentRun> + Clone {
        self.runs_of(mask, 0)
    }

    /// The same for the clear pixels.
    pub(crate) fn clear_runs_by_sides(&mut self, mask: &Mask) -> impl Iterator<Item = ComponentRun> + Clone {
        self.runs_of(mask, u64::MAX)
    }

    fn runs_of(&mut self, mask: &Mask, flip: u64) -> impl Iterator<Item = ComponentRun> + Clone {
        self.runs.find(mask, flip, Corners::Part);
        self.components.clear();
        self.runs.with_roots().map(|(run, root)| ComponentRun {
            row: run.row as usize,
            columns: run.from as usize..run.to as usize,
            component: root as usize,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn three_pieces_measured() {
        let mask = Mask::from_picture(
            "##....#.
             .#...#..
             ..#.....
             #......#
             #......#",
        );
        let mut components = Components::new(mask.size());
        let found = components.label(&mask).to_vec();
        assert_eq!(found.len(), 4);
        assert_eq!(
            found[0],
            Component {
                area_px2: 4,
                left_px: 0,
                top_px: 0,
                right_px: 3,
                bottom_px: 3,
                centroid_px: Vec2::new(1.0, 0.75)
            }
        );
        assert_eq!((found[1].left_px, found[1].right_px, found[1].area_px2), (5, 7, 2));
        assert_eq!(found[3].centroid_px, Vec2::new(7.0, 3.5));
    }

    #[test]
    fn small_pieces_go_and_those_that_little_fills() {
        let mut mask = Mask::from_picture(
            "####..##.##..###
             ####..##.##..###
             ####..##.....###",
        );
        // 8 of 12, 2 of 6, 3 of 4, 5 of 9.
        let filled = Mask::from_picture(
            "####..#..##...#.
             ####..#..#...###
             ..............#.",
        );
        let mut components = Components::new(mask.size());
        components.remove_weak(&mut mask, &filled, 5, 0.6);
        let kept = Mask::from_picture(
            "####.........###
             ####.........###
             ####.........###",
        );
        assert_eq!(mask, kept);
        components.remove_weak(&mut mask, &filled, 5, 0.9);
        assert_eq!(mask.area_px2(), 12, "5 of 9 is less than nine tenths of 8 of 12");
        mask.clear();
        components.remove_weak(&mut mask, &filled, 5, 0.6);
        assert_eq!(mask.area_px2(), 0);
    }

    #[test]
    fn the_small_go() {
        let mut mask = Mask::from_picture(
            "##...###
             .#......
             ..#....#",
        );
        let mut components = Components::new(mask.size());
        components.remove_small(&mut mask, 3);
        assert_eq!(
            mask,
            Mask::from_picture(
                "##...###
                 .#......
                 ..#....."
            )
        );
    }

    #[test]
    fn holes_are_filled_and_bays_are_not() {
        let mut mask = Mask::from_picture(
            ".####....
             .#..#.###
             .#.##.#..
             .####.###
             ..#......
             .#.#.....
             ..#......",
        );
        Components::new(mask.size()).fill_holes(&mut mask);
        assert_eq!(
            mask,
            Mask::from_picture(
                ".####....
                 .####.###
                 .####.#..
                 .####.###
                 ..#......
                 .###.....
                 ..#......"
            )
        );
    }

    #[test]
    fn the_mask_with_the_most_runs_fits_the_scratch() {
        let size = SizePx::new(129, 67);
        let mut mask = Mask::new(size);
        for y in (0..67).step_by(2) {
            (0..129).step_by(2).for_each(|x| mask.set(x, y, true));
        }
        let mut components = Components::new(size);
        let reserved = (components.runs.all.capacity(), components.components.capacity());
        assert_eq!(components.label(&mask).len(), 65 * 34);
        components.fill_holes(&mut mask);
        for y in 0..67 {
            (0..129).for_each(|x| mask.set(x, y, (x + y) % 2 == 0));
        }
        assert_eq!(components.label(&mask).len(), 1);
        components.fill_holes(&mut mask);
        assert_eq!(mask.area_px2(), size.area() - 2 * (64 + 33), "all but the clear pixels at the border");
        assert_eq!((components.runs.all.capacity(), components.components.capacity()), reserved);
    }

    /// Labels the components by flood fill from every pixel; 0 where the mask is not `of`.
    fn flood(mask: &Mask, of: bool, corners: bool) -> Vec<usize> {
        let SizePx { width, height } = mask.size();
        let mut numbers = vec![0; width * height];
        let mut number = 0;
        for start in 0..width * height {
            if numbers[start] != 0 || mask.get((start % width) as isize, (start / width) as isize) != of {
                continue;
            }
            number += 1;
            let mut open = vec![start];
            while let Some(i) = open.pop() {
                if numbers[i] != 0 {
                    continue;
                }
                numbers[i] = number;
                let (x, y) = ((i % width) as isize, (i / width) as isize);
                for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)] {
                    let (nx, ny) = (x + dx, y + dy);
                    let inside = nx >= 0 && ny >= 0 && nx < width as isize && ny < height as isize;
                    if (corners || dx * dy == 0) && inside && mask.get(nx, ny) == of {
                        open.push(ny as usize * width + nx as usize);
                    }
                }
            }
        }
        numbers
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(96))]
        #[test]
        fn equals_flooding(width in 1usize..150, height in 1usize..24, seed: u64, share in 1u64..16) {
            let size = SizePx::new(width, height);
            let mut mask = Mask::new(size);
            let mut state = seed;
            for i in 0..size.area() {
                state = crate::random::next(state);
                mask.set(i % width, i / width, (state >> 40) % 16 < share);
            }
            let numbers = flood(&mask, true, true);
            let mut components = Components::new(size);
            let found = components.label(&mask).to_vec();
            prop_assert_eq!(found.len(), numbers.iter().copied().max().unwrap_or(0));
            for (n, c) in found.iter().enumerate() {
                let pixels: Vec<(usize, usize)> =
                    (0..size.area()).filter(|&i| numbers[i] == n + 1).map(|i| (i % width, i / width)).collect();
                prop_assert_eq!(c.area_px2, pixels.len());
                prop_assert_eq!(Some(c.left_px), pixels.iter().map(|p| p.0).min());
                prop_assert_eq!(Some(c.top_px), pixels.iter().map(|p| p.1).min());
                prop_assert_eq!(Some(c.right_px - 1), pixels.iter().map(|p| p.0).max());
                prop_assert_eq!(Some(c.bottom_px - 1), pixels.iter().map(|p| p.1).max());
                let sum = pixels.iter().fold(Vec2::ZERO, |s, p| s + Vec2::new(p.0 as f64, p.1 as f64));
                prop_assert!((c.centroid_px - sum / pixels.len() as f64).length() < 1e-9);
            }
            let clear = flood(&mask, false, false);
            let mut filled = mask.clone();
            components.fill_holes(&mut filled);
            for i in 0..size.area() {
                let (x, y) = (i % width, i / width);
                let open = clear[i] != 0 && (0..size.area()).any(|j| {
                    let border = j % width == 0 || j % width == width - 1 || j / width == 0 || j / width == height - 1;
                    border && clear[j] == clear[i]
                });
                prop_assert_eq!(filled.get(x as isize, y as isize), !open);
            }
            let min_area_px2 = 4;
            components.remove_small(&mut mask, min_area_px2);
            for i in 0..size.area() {
                let keep = numbers[i] != 0 && found[numbers[i] - 1].area_px2 >= min_area_px2;
                prop_assert_eq!(mask.get((i % width) as isize, (i / width) as isize), keep);
            }
        }
    }
}
