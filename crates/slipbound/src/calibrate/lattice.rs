//! Spots -> which of them are on a grid, and on which of its nodes.
//!
//! ```text
//!      .   o   .        a seed o with neighbours on both sides of two directions;
//!      o - o - o  a     from there node by node: a node next to known ones is predicted by
//!      .   o   .        the affine map of the known ones around it, and the nearest spot
//!          b            within a quarter of a pitch is the dot
//! ```
//! Missing dots leave holes, doubled ones a spot without a node. Perspective and lens distort the grid slowly enough
//! for the local affine map to follow.

use super::fit::median;
use super::solve::Normal;
use crate::pixels::dots::Spot;
use crate::plane::Vec2;
use std::collections::{BTreeMap, BTreeSet};

/// Number of spots nearest to a seed among which its grid neighbours are searched.
const NEIGHBOURS_COUNT: usize = 14;
/// Number of strongest spots considered as seeds.
const CANDIDATES_COUNT: usize = 120;
/// Seeds tried, best first.
const SEEDS_COUNT: usize = 8;
/// A spot this near to a predicted node is its dot, in local pitches.
const NEAR_PITCH: f64 = 0.25;
/// Known nodes within this many nodes predict a new one.
const REACH: i32 = 3;
/// A dot has at least this share of the median contrast of the dots around it.
const WEAKEST_RATIO: f32 = 0.3;

/// Node of the grid -> number of its spot.
pub(super) type Nodes = BTreeMap<(i32, i32), usize>;

/// The largest grid among the spots, which are sorted strongest first; empty when there is none.
pub(super) fn find(spots: &[Spot]) -> Nodes {
    let candidates = 0..spots.len().min(CANDIDATES_COUNT);
    let mut seeds: Vec<(usize, Basis)> = candidates.filter_map(|i| Some((i, Basis::at(spots, i)?))).collect();
    seeds.sort_by(|(i, p), (j, q)| q.supported.cmp(&p.supported).then(i.cmp(j)));
    // Seeds are far apart: one bad corner must not spoil all.
    let mut best = Nodes::new();
    let mut tried: Vec<Vec2> = Vec::new();
    for (seed, basis) in &seeds {
        let at = spots[*seed].position;
        if tried.iter().any(|t| (*t - at).length() < 3.0 * basis.a.length()) {
            continue;
        }
        tried.push(at);
        let nodes = grow(spots, *seed, basis);
        if nodes.len() > best.len() {
            best = nodes;
        }
        if tried.len() == SEEDS_COUNT || 10 * best.len() > 8 * spots.len() {
            break;
        }
    }
    best
}

/// Two steps of the grid at a seed.
#[derive(Debug, Clone, Copy)]
struct Basis {
    a: Vec2,
    b: Vec2,
    /// How many of the eight nodes around have a spot.
    supported: usize,
}

impl Basis {
    fn at(spots: &[Spot], seed: usize) -> Option<Basis> {
        let at = spots[seed].position;
        let others = spots.iter().enumerate().filter(|(i, _)| *i != seed).map(|(i, s)| (i, s.position - at));
        let mut others: Vec<(f64, usize, Vec2)> = others.map(|(i, off)| (off.length_squared(), i, off)).collect();
        let nearer = |p: &(f64, usize, Vec2), q: &(f64, usize, Vec2)| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1));
        if others.len() > 2 * NEIGHBOURS_COUNT {
            others.select_nth_unstable_by(2 * NEIGHBOURS_COUNT, nearer);
            others.truncate(2 * NEIGHBOURS_COUNT);
        }
        others.sort_unstable_by(nearer);
        let around: Vec<Vec2> = others.into_iter().map(|(.., off)| off).collect();
        let nearest = &around[..around.len().min(NEIGHBOURS_COUNT)];
        let mut best: Option<Basis> = None;
        for (i, &a) in nearest.iter().enumerate() {
            for &b in &nearest[i + 1..] {
                let (long, short) = (a.length().max(b.length()), a.length().min(b.length()));
                let sine = a.cross(b) / (long * short);
                if long > 1.9 * short || sine.abs() < 0.7 {
                    continue;
                }
                let (a, b) = if sine > 0.0 { (a, b) } else { (b, a) };
                let near_squared = (0.22 * short) * (0.22 * short);
                let has = |p: Vec2| around.iter().any(|q| (*q - p).length_squared() < near_squared);
                let supported = [a, b, -a, -b, a + b, a - b, b - a, -a - b].into_iter().filter(|p| has(*p)).count();
                // With equal support, shorter steps are better: diagonal ones span every other node, or a slanted grid.
                let better =
                    |o: &Basis| (supported, -a.length() * b.length()) > (o.supported, -o.a.length() * o.b.length());
                if supported >= 5 && best.as_ref().is_none_or(better) {
                    best = Some(Basis { a, b, supported });
                }
            }
        }
        best
    }
}

/// All nodes that can be reached from a seed.
fn grow(spots: &[Spot], seed: usize, basis: &Basis) -> Nodes {
    let mut nodes = Nodes::from([((0, 0), seed)]);
    let mut used = vec![false; spots.len()];
    used[seed] = true;
    let mut by_height: Vec<usize> = (0..spots.len()).collect();
    by_height.sort_by(|&i, &j| spots[i].position.y.total_cmp(&spots[j].position.y));
    // Nodes tried since the last change around them.
    let mut tried: BTreeSet<(i32, i32)> = BTreeSet::new();
    loop {
        let mut found: Vec<(f64, (i32, i32), usize)> = Vec::new();
        for node in frontier(&nodes) {
            // A node without a spot is tried again when more is known around it.
            if !tried.insert(node) {
                continue;
            }
            let Some((at, pitch_px)) = predict(spots, &nodes, node, basis) else { continue };
            let reach_px = NEAR_PITCH * pitch_px;
            let from = by_height.partition_point(|&i| spots[i].position.y <= at.y - reach_px);
            let beside = by_height[from..].iter().map(|&i| (i, spots[i].position - at));
            let beside = beside.take_while(|(_, off)| off.y < reach_px);
            let near = beside.filter(|(i, off)| off.x.abs() < reach_px && !used[*i]);
            let near = near.map(|(i, off)| (off.length() / pitch_px, i));
            let nearest = near.min_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
            found.extend(nearest.filter(|n| n.0 < NEAR_PITCH).map(|(miss_pitch, i)| (miss_pitch, node, i)));
        }
        found.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
        let before = nodes.len();
        // The best half first: the others are predicted better when these are known.
        let most = (found.len() / 2).max(8);
        for (_, node, i) in found.into_iter().take(most) {
            tried.remove(&node);
            if !used[i] {
                used[i] = true;
                nodes.insert(node, i);
                tried.retain(|other| (other.0 - node.0).abs() > REACH || (other.1 - node.1).abs() > REACH);
            }
        }
        if nodes.len() == before {
            break;
        }
    }
    remove_weak(spots, &mut nodes);
    nodes
}

/// Unknown nodes beside known ones.
fn frontier(nodes: &Nodes) -> BTreeSet<(i32, i32)> {
    let steps = [(1, 0), (-1, 0), (0, 1), (0, -1)];
    let beside = nodes.keys().flat_map(|&(i, j)| steps.map(|(a, b)| (i + a, j + b)));
    beside.filter(|n| !nodes.contains_key(n)).collect()
}

fn known_around(nodes: &Nodes, (i, j): (i32, i32)) -> impl Iterator<Item = ((i32, i32), usize)> + '_ {
    (i - REACH..=i + REACH).flat_map(move |x| nodes.range((x, j - REACH)..=(x, j + REACH))).map(|(n, i)| (*n, *i))
}

/// Predicted position of a node and the pitch there, by the affine map of the known nodes around it.
fn predict(spots: &[Spot], nodes: &Nodes, node: (i32, i32), basis: &Basis) -> Option<(Vec2, f64)> {
    let [mut x, mut y] = [Normal::new(3), Normal::new(3)];
    let mut anchor = None;
    for (known, i) in known_around(nodes, node) {
        let (di, dj) = (f64::from(known.0 - node.0), f64::from(known.1 - node.1));
        let weight = 1.0 / (di * di + dj * dj).powi(2);
        let at = spots[i].position;
        x.add(&[1.0, di, dj], at.x, weight);
        y.add(&[1.0, di, dj], at.y, weight);
        if anchor.is_none_or(|(w, _)| weight > w) {
            anchor = Some((weight, at - basis.a * di - basis.b * dj));
        }
    }
    // The steps of the seed, with a small weight: they decide while too few nodes are known.
    let faint = 1e-3;
    for (n, [first, second]) in [(&mut x, [basis.a.x, basis.b.x]), (&mut y, [basis.a.y, basis.b.y])] {
        n.add(&[0.0, 1.0, 0.0], first, faint);
        n.add(&[0.0, 0.0, 1.0], second, faint);
    }
    anchor?;
    let (x, y) = (x.solve(0.0)?, y.solve(0.0)?);
    let pitch_px = (x[1] * y[2] - x[2] * y[1]).abs().sqrt();
    Some((Vec2::new(x[0], y[0]), pitch_px))
}

/// Removes spots much weaker than the dots around them: specks where a dot is missing.
fn remove_weak(spots: &[Spot], nodes: &mut Nodes) {
    let weak: Vec<(i32, i32)> = nodes
        .iter()
        .filter(|(node, i)| {
            let around: Vec<f64> =
                known_around(nodes, **node).map(|(_, i)| f64::from(spots[i].response_levels)).collect();
            spots[**i].response_levels < WEAKEST_RATIO * median(&around) as f32
        })
        .map(|(node, _)| *node)
        .collect();
    for node in weak {
        nodes.remove(&node);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot(x: f64, y: f64, response_levels: f32) -> Spot {
        Spot { position: Vec2::new(x, y), response_levels }
    }

    /// 10 x 8 nodes, rotated and in perspective; `keep` selects the nodes that are there.
    fn grid(keep: impl Fn(usize) -> bool) -> Vec<Spot> {
        (0..80)
            .filter(|i| keep(*i))
            .map(|i| {
                let (u, v) = ((i % 10) as f64 * 20.0, (i / 10) as f64 * 20.0);
                let w = 1.0 + 0.001 * u + 0.002 * v;
                spot((100.0 + 0.94 * u - 0.34 * v) / w, (40.0 + 0.34 * u + 0.94 * v) / w, 30.0)
            })
            .collect()
    }

    #[test]
    fn every_dot_finds_its_node_and_no_two_the_same() {
        let spots = grid(|i| i % 9 != 4);
        let nodes = find(&spots);
        assert_eq!(nodes.len(), spots.len());
        // Neighbouring nodes are neighbours in the image.
        for (&(i, j), &a) in &nodes {
            if let Some(&b) = nodes.get(&(i + 1, j)) {
                let apart = (spots[b].position - spots[a].position).length();
                assert!((10.0..22.0).contains(&apart), "{apart} px apart");
            }
        }
    }

    #[test]
    fn doubles_and_specks_get_no_node() {
        let mut spots = grid(|i| i % 13 != 5);
        let dots_count = spots.len();
        for i in (0..dots_count).step_by(11) {
            let p = spots[i].position + Vec2::new(7.0, 5.0);
            spots.push(spot(p.x, p.y, 25.0));
        }
        // Where node 5 is missing: a speck of a tenth of the contrast.
        spots.push(spot((100.0 + 94.0) / 1.1, (40.0 + 34.0) / 1.1, 3.0));
        let nodes = find(&spots);
        assert_eq!(nodes.len(), dots_count);
        assert!(nodes.values().all(|&i| i < dots_count));
    }

    /// Growing accepts up to half of random dots. The checks of `calibrate`, by residual and number, reject these
    /// (`dots_on_no_grid_are_refused_with_the_reason`); this test checks only that random spots are not all taken for
    /// nodes.
    #[test]
    fn fewer_than_half_of_randomly_placed_spots_get_a_node() {
        let mut state = 12345u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 16) / 65536.0 * 400.0
        };
        let spots: Vec<Spot> = (0..60).map(|_| spot(next(), next(), 20.0)).collect();
        assert!(find(&spots).len() < 30, "{}", find(&spots).len());
    }
}
