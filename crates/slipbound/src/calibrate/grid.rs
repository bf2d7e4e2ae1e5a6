//! Refinement of the grid: dots are detected again in the rectified image, where they are round and evenly spaced, and
//! the map is fitted to them again.
//!
//! ```text
//!   rough grid --fit--> map --> rectified image --spots, edge pull--> dots --fit--> map ... three times
//! ```

use super::fit::{Pair, PlaneMap, bounds, fit_as_needed, homography, median, robust_sigma};
use super::search::Found;
use crate::image::SizePx;
use crate::pixels::centroid::EdgeKernel;
use crate::pixels::dots::{DotFinder, Spot};
use crate::pixels::patch::mean_window;
use crate::pixels::warp::WarpTable;
use crate::plane::Vec2;
use crate::sensor::{MOST_MARKER_DIAMETER_PX, Polarity};
use std::collections::BTreeMap;

/// The rectified image ends this far beyond the outermost markers, in pitches.
pub(super) const MARGIN_PITCH: f64 = 0.75;
/// Rounds of detection and fitting.
const ROUNDS_COUNT: usize = 3;
/// Largest distance of a dot from its node, in pitches: in the first round, and later, when the map is good.
const NEAR_PITCH: (f64, f64) = (0.3, 0.22);
/// A dot has at least this share of the median contrast of the dots around it.
const WEAKEST_RATIO: f64 = 0.3;
/// Weakest contrast of a dot.
const LEAST_LEVELS: f32 = 2.0;
/// Nodes within this many steps are neighbours.
const AROUND: i32 = 2;

/// A spot is off the grid when it deviates from both the map and the spots around it by more than this many standard
/// deviations of such deviations over the whole grid,
const OFF_GRID_SIGMAS: f64 = 3.5;
/// and by more than this in pitches: printing is seldom more accurate than a third of it.
const OFF_GRID_LEAST_PITCH: f64 = 0.06;
/// Up to this share of such spots, the robust fit tolerates them and they stay in it: a print with doubled and broken
/// dots but no glare has 3 % (GelSlim 3.0).
const FEW_OFF_GRID_FRACTION: f64 = 0.04;
/// Finally, a dot further than this from its node is off the grid, in pitches.
pub(super) const OFF_GRID_PITCH: f64 = 0.15;
/// Fewest spots around one to predict its position.
const FEWEST_AROUND: usize = 4;

/// A dot of the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dot {
    /// Position in the upright camera image.
    pub seen: Vec2,
    /// Its contrast.
    pub response_levels: f32,
}

/// The grid in the image.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub dots: BTreeMap<(i32, i32), Dot>,
    /// Spots near a node that are not dots of the grid: glare, dirt, double prints. The map is not fitted to them.
    pub off_grid: BTreeMap<(i32, i32), Dot>,
    pub map: PlaneMap,
    pub pitch_px: f64,
    pub diameter_px: f64,
    pub polarity: Polarity,
    /// The node at the origin of the plane, less the margin.
    first: (i32, i32),
}

/// Position of a node in the plane.
fn plane_of((i, j): (i32, i32), first: (i32, i32), pitch_px: f64) -> Vec2 {
    let margin_px = (MARGIN_PITCH * pitch_px).round();
    Vec2::new(f64::from(i - first.0), f64::from(j - first.1)) * pitch_px + Vec2::new(margin_px, margin_px)
}

impl Grid {
    /// The grid as first found. None when its nodes are too few or on a line.
    pub fn rough(found: &Found) -> Option<Grid> {
        let dots = upright(found)?;
        let pairs: Vec<Pair> = dots.iter().map(|(n, d)| Pair { plane: vec_of(*n), seen: d.seen }).collect();
        let map = PlaneMap { camera_from_plane: homography(&pairs)?, distortion: None };
        let scales: Vec<f64> = pairs.iter().map(|p| map.scale_at(p.plane)).filter(|s| s.is_finite()).collect();
        // Rounded to a tenth of a pixel, for readability.
        let pitch_px = (median(&scales) * 10.0).round() / 10.0;
        let mut grid = Grid {
            dots,
            off_grid: BTreeMap::new(),
            map,
            pitch_px,
            diameter_px: found.diameter_px.min(largest_diameter_px(pitch_px)),
            polarity: found.polarity,
            first: (0, 0),
        };
        grid.fit()?;
        Some(grid)
    }

    /// Point of the plane of a node.
    pub fn plane(&self, node: (i32, i32)) -> Vec2 {
        plane_of(node, self.first, self.pitch_px)
    }

    /// Size of the plane with all nodes and the margin around them.
    pub fn size(&self) -> SizePx {
        let (_, last) = node_bounds(&self.dots);
        let corner = self.plane(last);
        let margin_px = (MARGIN_PITCH * self.pitch_px).round();
        SizePx::new((corner.x + margin_px).ceil() as usize + 1, (corner.y + margin_px).ceil() as usize + 1)
    }

    /// Every dot as a pair of plane and camera points.
    pub fn pairs(&self) -> Vec<Pair> {
        self.dots.iter().map(|(n, d)| Pair { plane: self.plane(*n), seen: d.seen }).collect()
    }

    /// How far a dot of a node is from where the map puts it, in pitches.
    pub fn residual_pitch(&self, node: (i32, i32), dot: &Dot) -> f64 {
        self.map.residual_px(&Pair { plane: self.plane(node), seen: dot.seen }) / self.pitch_px
    }

    /// How far dots are from where the map puts them, in pitches.
    pub fn residuals_pitch(&self) -> Vec<f64> {
        self.pairs().iter().map(|p| self.map.residual_px(p) / self.pitch_px).collect()
    }

    fn fit(&mut self) -> Option<()> {
        self.first = node_bounds(&self.dots).0;
        self.map = fit_as_needed(&self.pairs(), self.pitch_px)?;
        Some(())
    }

    /// Finds the dots again, through the map, and fits the map again. Dots larger than a sensor may have are left as they
    /// are: its check says so.
    pub fn refine(&mut self, grey: &[u8], camera_px: SizePx) -> Option<()> {
        for round in 0..ROUNDS_COUNT {
            if self.diameter_px > MOST_MARKER_DIAMETER_PX {
                break;
            }
            let near_pitch = if round == 0 { NEAR_PITCH.0 } else { NEAR_PITCH.1 };
            self.redetect(grey, camera_px, near_pitch);
            self.fit()?;
            if self.reject_outliers() {
                self.fit()?;
            }
        }
        Some(())
    }

    /// The image rectified by the map, and the table that holds which of its pixels the camera sees.
    pub fn rectified(&self, grey: &[u8], camera_px: SizePx) -> (Vec<u8>, WarpTable) {
        let size = self.size();
        let table = WarpTable::new(size, camera_px, |p| self.map.apply(p));
        let mut out = vec![0; size.area()];
        table.apply(grey, &mut out);
        (out, table)
    }

    fn redetect(&mut self, grey: &[u8], camera_px: SizePx, near_pitch: f64) {
        // A ring of nodes further out may hold dots that the rough grid missed.
        let (low, high) = node_bounds(&self.dots);
        self.first = (low.0 - 1, low.1 - 1);
        let beyond = Dot { seen: Vec2::ZERO, response_levels: 0.0 };
        let mut wider = self.clone();
        wider.dots.insert((low.0 - 1, low.1 - 1), beyond);
        wider.dots.insert((high.0 + 1, high.1 + 1), beyond);
        // The map refers to the old origin.
        let shift = plane_of(low, self.first, self.pitch_px) - plane_of(low, low, self.pitch_px);
        let map = self.map;
        let to_camera = |p: Vec2| map.apply(p - shift);
        let size = wider.size();
        // Pixels of the border are repeated beyond it: black would pull the dots there.
        let last = Vec2::new((camera_px.width - 1) as f64, (camera_px.height - 1) as f64);
        let held = |p: Vec2| Vec2::new(p.x.clamp(0.0, last.x), p.y.clamp(0.0, last.y));
        let mut flat = vec![0; size.area()];
        WarpTable::new(size, camera_px, |p| held(to_camera(p))).apply(grey, &mut flat);

        let mut finder = DotFinder::new(size, self.diameter_px, self.pitch_px, self.polarity);
        let spots = finder.run(&flat, LEAST_LEVELS).to_vec();
        let kernel = EdgeKernel::new(self.diameter_px, self.pitch_px, 0.6);
        let radius_px = self.diameter_px / 2.0;
        let whole = |p: Vec2| {
            (0..8).all(|k| {
                let angle = f64::from(k) * std::f64::consts::FRAC_PI_4;
                let rim = p + Vec2::new(libm::cos(angle), libm::sin(angle)) * radius_px;
                let there = to_camera(rim);
                there == held(there)
            })
        };
        let offsets = self.offsets_px();
        let mut found = BTreeMap::new();
        let mut centres = Vec::new();
        for i in low.0 - 1..=high.0 + 1 {
            for j in low.1 - 1..=high.1 + 1 {
                let Some(by) = offset_of_neighbours(&offsets, (i, j), 0.5 * self.pitch_px) else { continue };
                let at = self.plane((i, j)) + by;
                let residual_px = |s: &Spot| (s.position - at).length();
                let near = spots.iter().filter(|s| residual_px(s) < near_pitch * self.pitch_px);
                let Some(spot) = near.min_by(|p, q| residual_px(p).total_cmp(&residual_px(q))) else { continue };
                if !whole(spot.position) {
                    continue;
                }
                let centre = settle(&kernel, &flat, size, spot.position, radius_px).unwrap_or(spot.position);
                found.insert((i, j), (centre, spot.response_levels));
            }
        }
        let strong = |node: &(i32, i32), level: f32| {
            let around =
                found.iter().filter(|((i, j), _)| (i - node.0).abs() <= AROUND && (j - node.1).abs() <= AROUND);
            let levels: Vec<f64> = around.map(|(_, (_, l))| f64::from(*l)).collect();
            levels.len() > 3 && f64::from(level) >= WEAKEST_RATIO * median(&levels)
        };
        let mut dots = BTreeMap::new();
        for (node, (centre, response_levels)) in &found {
            if strong(node, *response_levels) {
                centres.push(*centre);
                dots.insert(*node, Dot { seen: to_camera(*centre), response_levels: *response_levels });
            }
        }
        if let Some(diameter_px) = self.measured_diameter(&flat, size, &centres) {
            self.diameter_px = diameter_px;
        }
        if dots.len() * 2 > self.dots.len() {
            self.dots = dots;
            self.off_grid.clear();
        }
        self.first = low;
    }

    /// Removes spots that deviate from both the map and their neighbours, if they are many; returns whether they were.
    /// Where the map itself is not good yet, neighbours deviate from it alike and stay.
    fn reject_outliers(&mut self) -> bool {
        let offsets = self.offsets_px();
        let from_neighbours_px = |node: (i32, i32), own: Vec2| match median_around(&offsets, node) {
            Some(median) => (own - median).length(),
            None => own.length(),
        };
        let apart: Vec<((i32, i32), f64)> = offsets.iter().map(|(n, by)| (*n, from_neighbours_px(*n, *by))).collect();
        let sigma_px = robust_sigma(&apart.iter().map(|(_, px)| *px).collect::<Vec<_>>());
        let limit_px = (OFF_GRID_SIGMAS * sigma_px).max(OFF_GRID_LEAST_PITCH * self.pitch_px);
        let is_off = |(node, px): &((i32, i32), f64)| *px > limit_px && offsets[node].length() > limit_px;
        let off: Vec<(i32, i32)> = apart.iter().filter(|a| is_off(a)).map(|(node, _)| *node).collect();
        let are_many = off.len() as f64 > FEW_OFF_GRID_FRACTION * self.dots.len() as f64;
        if are_many {
            for node in off {
                self.off_grid.extend(self.dots.remove_entry(&node));
            }
        }
        are_many
    }

    /// Removes dots further than `beyond_pitch` off the map from the grid and its size: housing, lettering, light
    /// beside the gel.
    pub fn reject_beyond(&mut self, beyond_pitch: f64) -> Option<()> {
        for _ in 0..ROUNDS_COUNT {
            let is_off = |(node, dot): &(&(i32, i32), &Dot)| self.residual_pitch(**node, dot) > beyond_pitch;
            let off: Vec<(i32, i32)> = self.dots.iter().filter(is_off).map(|(node, _)| *node).collect();
            if off.is_empty() {
                break;
            }
            for node in off {
                self.off_grid.extend(self.dots.remove_entry(&node));
            }
            self.fit()?;
        }
        Some(())
    }

    /// Residual vector of every dot, in plane px.
    fn offsets_px(&self) -> BTreeMap<(i32, i32), Vec2> {
        let first = node_bounds(&self.dots).0;
        let plane = |n| plane_of(n, first, self.pitch_px);
        let offset = |n, d: &Dot| self.map.offset_px(&Pair { plane: plane(n), seen: d.seen });
        self.dots.iter().map(|(n, d)| (*n, offset(*n, d))).filter(|(_, by)| by.is_finite()).collect()
    }

    /// Diameter of a disc with the area over which the mean dot has more than half of its depth.
    fn measured_diameter(&self, flat: &[u8], size: SizePx, centres: &[Vec2]) -> Option<f64> {
        let half = (0.5 * self.pitch_px).round() as usize;
        let side = 2 * half + 1;
        let window = mean_window(flat, size, centres.iter().copied(), half)?;
        let r = |i: usize| Vec2::new((i % side) as f64 - half as f64, (i / side) as f64 - half as f64).length();
        let rim: Vec<f64> =
            (0..side * side).filter(|i| r(*i) > 0.42 * self.pitch_px).map(|i| f64::from(window[i])).collect();
        let sign = if self.polarity == Polarity::Dark { 1.0 } else { -1.0 };
        let light = median(&rim);
        let depth: Vec<f64> = window.iter().map(|v| sign * (light - f64::from(*v))).collect();
        let inner = (0..side * side).filter(|i| r(*i) < 0.45 * self.pitch_px);
        let deepest = inner.clone().map(|i| depth[i]).fold(0.0, f64::max);
        // A pixel at half depth counts half: areas grow smoothly.
        let area_px2: f64 = inner.map(|i| (2.0 * (depth[i] / deepest - 0.5) + 0.5).clamp(0.0, 1.0)).sum();
        let diameter_px = 2.0 * (area_px2 / std::f64::consts::PI).sqrt();
        let largest_px = largest_diameter_px(self.pitch_px);
        (deepest > 0.0 && diameter_px.is_finite())
            .then(|| ((diameter_px * 10.0).round() / 10.0).clamp(3.0, largest_px.max(3.0)))
    }
}

/// The largest diameter of markers this far apart that a sensor may have, px: a whole number of tenths.
pub(super) fn largest_diameter_px(pitch_px: f64) -> f64 {
    (pitch_px / 1.5 * 10.0).floor() / 10.0
}

/// Median residual vector of the dots around a node, per axis; None with too few of them.
fn median_around(offsets: &BTreeMap<(i32, i32), Vec2>, (i, j): (i32, i32)) -> Option<Vec2> {
    let columns = (i - AROUND..=i + AROUND).flat_map(|x| offsets.range((x, j - AROUND)..=(x, j + AROUND)));
    let around: Vec<Vec2> = columns.filter(|(node, _)| **node != (i, j)).map(|(_, by)| *by).collect();
    let along = |axis: fn(&Vec2) -> f64| median(&around.iter().map(axis).collect::<Vec<_>>());
    (around.len() >= FEWEST_AROUND).then(|| Vec2::new(along(|v| v.x), along(|v| v.y)))
}

/// Residual vector at a node, from the dots around it but not its own, which may be half of a double. None far from all
/// dots; at most `longest_px`.
fn offset_of_neighbours(offsets: &BTreeMap<(i32, i32), Vec2>, (i, j): (i32, i32), longest_px: f64) -> Option<Vec2> {
    let (mut sum, mut weights) = (Vec2::ZERO, 0.0);
    for x in i - AROUND..=i + AROUND {
        for ((_, y), by) in offsets.range((x, j - AROUND)..=(x, j + AROUND)) {
            let away = f64::from((x - i).pow(2) + (y - j).pow(2));
            if away > 0.0 {
                sum += *by / (away * away);
                weights += 1.0 / (away * away);
            }
        }
    }
    let mean = sum / weights;
    (weights > 0.0).then(|| mean * (longest_px / mean.length().max(1e-9)).min(1.0)).filter(|m| m.is_finite())
}

/// Position to which the edge pulls a spot; None when it is outside the dot.
fn settle(kernel: &EdgeKernel, grey: &[u8], size: SizePx, start: Vec2, radius_px: f64) -> Option<Vec2> {
    let mut centre = start;
    for _ in 0..2 {
        let stiffness = kernel.stiffness(grey, size, centre)?;
        centre = kernel.centre(grey, size, centre, stiffness, 0.3 * radius_px, 6)?;
    }
    ((centre - start).length() < 0.6 * radius_px).then_some(centre)
}

/// Least and greatest index along each axis.
fn node_bounds(dots: &BTreeMap<(i32, i32), Dot>) -> ((i32, i32), (i32, i32)) {
    let (low, high) = bounds(dots.keys().map(|n| vec_of(*n)));
    ((low.x as i32, low.y as i32), (high.x as i32, high.y as i32))
}

fn vec_of((i, j): (i32, i32)) -> Vec2 {
    Vec2::new(f64::from(i), f64::from(j))
}

/// Rounds of exchanging a long step of the grid for a shorter one; two are enough for any grid a camera sees.
const REDUCTIONS_COUNT: usize = 4;

/// The dots with their nodes indexed along the shortest steps of the grid, rotated by right angles so that i grows
/// nearest to the image's x, and j clockwise of it.
fn upright(found: &Found) -> Option<BTreeMap<(i32, i32), Dot>> {
    let pairs: Vec<Pair> =
        found.nodes.iter().map(|(n, i)| Pair { plane: vec_of(*n), seen: found.spots[*i].position }).collect();
    let map = PlaneMap { camera_from_plane: homography(&pairs)?, distortion: None };
    let (low, high) = bounds(pairs.iter().map(|p| p.plane));
    let middle = (low + high) * 0.5;
    let slope = |by: Vec2| map.apply(middle + by * 0.5) - map.apply(middle - by * 0.5);
    let (mut a, mut b) = (slope(Vec2::new(1.0, 0.0)), slope(Vec2::new(0.0, 1.0)));
    // n = i a + j b = (i + k j) a + j (b - k a): a slanted grid counts the same nodes in longer steps.
    let mut count: [[i32; 2]; 2] = [[1, 0], [0, 1]];
    for _ in 0..REDUCTIONS_COUNT {
        if a.length() <= b.length() {
            let k = (a.dot(b) / a.length_squared()).round();
            b = b - a * k;
            count[0] = [count[0][0] + k as i32 * count[1][0], count[0][1] + k as i32 * count[1][1]];
        } else {
            let k = (a.dot(b) / b.length_squared()).round();
            a = a - b * k;
            count[1] = [count[1][0] + k as i32 * count[0][0], count[1][1] + k as i32 * count[0][1]];
        }
    }
    let turned = |(i, j): (i32, i32)| {
        let (i, j) = (count[0][0] * i + count[0][1] * j, count[1][0] * i + count[1][1] * j);
        match (a.x.abs() >= a.y.abs(), a.x > 0.0, a.y > 0.0) {
            (true, true, _) => (i, j),
            (true, false, _) => (-i, -j),
            (false, _, true) => (-j, i),
            (false, _, false) => (j, -i),
        }
    };
    let dot = |i: &usize| Dot { seen: found.spots[*i].position, response_levels: found.spots[*i].response_levels };
    Some(found.nodes.iter().map(|(n, i)| (turned(*n), dot(i))).collect())
}
