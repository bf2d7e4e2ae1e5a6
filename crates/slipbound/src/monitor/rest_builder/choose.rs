//! Which of the first frames show the finger at rest.

use crate::monitor::contact::ContactSettings;
use crate::monitor::rest::{RestError, RestKind, RestSettings};
use std::ops::Range;

/// Fewer stationary frames in a row than this may be the turning point of a motion.
pub(super) const STATIONARY_FRAMES_COUNT: usize = 3;
/// Noise changes an image by the same over two frames as over one (within 4 % in compressed images of a finger that stands
/// still), a steady motion by twice as much: what changes by less than this many times the noise, in the middle between
/// both, is noise.
const NOISE_RATIO: f64 = 1.5;

/// Features of one candidate frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestLook {
    /// Mean grey level; None when the frame cannot be judged at all.
    pub mean_levels: Option<f64>,
    /// 99th percentile of the change of a cell since the previous frame, in levels; infinite for the first.
    pub change_levels: f64,
    /// Sharpness of the image between the markers: high for an imprint, low for illumination alone. Smooth gel: grey
    /// levels (compare [`imprint_levels`](crate::monitor::RestSettings::imprint_levels)); fabric: the share of the
    /// image that looks like pressed weave. Not a number where markers leave too little of a smooth gel between them to
    /// tell: then no frame counts as touched.
    pub sharpness: f64,
    /// Whether the frame shows an imprint.
    pub touched: bool,
}

/// Which frames make the rest frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RestChoice {
    /// Indices into the list of looks.
    pub frames: Range<usize>,
    /// Whether the finger is in contact in them.
    pub kind: RestKind,
}

/// The run to average, by the rules of [`RestBuilder::choose`](crate::monitor::RestBuilder::choose). `images`: the
/// cells of the same frames, in the same order; runs without them are taken to show the same, and no noise is told from a
/// motion without them.
pub(super) fn choose(
    looks: &[RestLook],
    images: &[CellImage],
    settings: &RestSettings,
    contact: &ContactSettings,
) -> Result<RestChoice, RestError> {
    let usual = of_usual_brightness(looks, settings)?;
    let has_long = |runs: &[RestChoice]| runs.iter().any(is_long);
    let mut runs = calm_runs(&usual, looks, settings);
    if !has_long(&runs) {
        let noisy = noisy_runs(&usual, looks, images, settings);
        runs = if has_long(&noisy) { noisy } else { runs };
    }
    // If an image with an imprint does not come to rest, no frame of it is that of an untouched finger, whatever it looks
    // like: a sliding imprint is blurred. Without an imprint in any frame it may be the light that flickers.
    let has_imprint = usual.iter().any(|&i| looks[i].touched);
    let moves = usual.len() >= STATIONARY_FRAMES_COUNT && has_imprint && !has_long(&runs);
    let mut choice = match settings.held || moves {
        true => RestChoice { kind: RestKind::InContact, ..long_runs(&runs)[0].clone() },
        false => best_run(&runs, looks, settings, |a, b| differ(a, b, images, contact)),
    };
    choice.frames.end = choice.frames.end.min(choice.frames.start + settings.average_count as usize);
    Ok(choice)
}

fn is_long(run: &RestChoice) -> bool {
    run.frames.len() >= STATIONARY_FRAMES_COUNT
}

/// The long runs, or all if there is none.
fn long_runs(runs: &[RestChoice]) -> Vec<&RestChoice> {
    let long: Vec<&RestChoice> = runs.iter().filter(|r| is_long(r)).collect();
    if long.is_empty() { runs.iter().collect() } else { long }
}

/// The best of the runs, which are at least one.
fn best_run(
    runs: &[RestChoice],
    looks: &[RestLook],
    settings: &RestSettings,
    differ: impl Fn(&RestChoice, &RestChoice) -> bool,
) -> RestChoice {
    let untouched = |r: &&RestChoice| r.kind == RestKind::Unloaded;
    let candidates = long_runs(runs);
    let Some(&first) = candidates.iter().find(|r| untouched(r)) else {
        return candidates[0].clone();
    };
    let sharpness =
        |r: &RestChoice| looks[r.frames.clone()].iter().map(|l| l.sharpness).sum::<f64>() / r.frames.len() as f64;
    let others = || candidates.iter().filter(|r| untouched(r) && r.frames != first.frames);
    let mut choice = first.clone();
    if others().any(|other| differ(first, other)) {
        let sharper = others().any(|other| differ(first, other) && sharpness(first) > sharpness(other));
        choice.kind = if sharper { RestKind::InContact } else { RestKind::Unloaded };
    } else if 2 * choice.frames.len() < settings.average_count as usize {
        for other in others() {
            if other.frames.len() > choice.frames.len() {
                choice = (*other).clone();
            }
        }
    }
    choice
}

/// The frames of the usual brightness, in order; at least one.
fn of_usual_brightness(looks: &[RestLook], settings: &RestSettings) -> Result<Vec<usize>, RestError> {
    let mut brightness: Vec<f64> = looks.iter().filter_map(|l| l.mean_levels).collect();
    let unusable_count = looks.len() - brightness.len();
    brightness.sort_unstable_by(f64::total_cmp);
    let Some(&median) = brightness.get(brightness.len() / 2) else {
        return Err(RestError::NoStationaryFrame { looked_at_count: looks.len(), unusable_count });
    };
    let bright =
        |l: &RestLook| l.mean_levels.is_some_and(|m| (m - median).abs() <= settings.brightness_fraction * median);
    Ok((0..looks.len()).filter(|&i| bright(&looks[i])).collect())
}

/// Runs of frames without motion, by the settings.
fn calm_runs(usual: &[usize], looks: &[RestLook], settings: &RestSettings) -> Vec<RestChoice> {
    runs(usual, looks, settings, |_, i| looks[i].change_levels < settings.calm_levels)
}

/// Runs of frames that differ by noise alone, where that is more than the settings call calm. Noise is in every change:
/// it is no more than the least one, but for repeated images.
fn noisy_runs(usual: &[usize], looks: &[RestLook], images: &[CellImage], settings: &RestSettings) -> Vec<RestChoice> {
    let changes = usual.iter().map(|&i| looks[i].change_levels);
    let noise = changes.filter(|change| *change > 0.0).fold(f64::INFINITY, f64::min);
    let limit = settings.calm_levels.max(NOISE_RATIO * noise);
    // A slow motion exceeds noise once it has gone on for some frames, a quick one to and fro between its ends.
    let since = |before: usize, i: usize| match (images.get(before), images.get(i)) {
        (Some(before), Some(now)) => now.change_levels(before),
        _ => f64::INFINITY,
    };
    let mut runs = runs(usual, looks, settings, |first, i| {
        looks[i].change_levels < limit && (first..i).all(|before| since(before, i) < limit)
    });
    // Three frames may lie about one end of it.
    runs.retain(|run| run.frames.len() > STATIONARY_FRAMES_COUNT);
    runs
}

/// The frames in runs. `goes_on`: whether a run that began with one frame goes on with another.
fn runs(
    usual: &[usize],
    looks: &[RestLook],
    settings: &RestSettings,
    goes_on: impl Fn(usize, usize) -> bool,
) -> Vec<RestChoice> {
    let mut runs: Vec<RestChoice> = Vec::new();
    for &i in usual {
        let kind = if looks[i].touched { RestKind::InContact } else { RestKind::Unloaded };
        match runs.last_mut() {
            Some(run) if run.frames.end == i && (settings.held || run.kind == kind) && goes_on(run.frames.start, i) => {
                run.frames.end = i + 1;
            }
            _ => runs.push(RestChoice { frames: i..i + 1, kind }),
        }
    }
    runs
}

/// Whether only one of two runs shows a contact: as many cells as in a contact differ by as much as in a contact.
fn differ(a: &RestChoice, b: &RestChoice, images: &[CellImage], contact: &ContactSettings) -> bool {
    // The middle frame represents a stationary run.
    let middle = |r: &RestChoice| images.get((r.frames.start + r.frames.end) / 2);
    let (Some(a), Some(b)) = (middle(a), middle(b)) else { return false };
    a.changed_share(b, contact.change_levels as f32) > contact.on_area_fraction
}

/// The cells of an examined frame; empty when it could not be judged.
#[derive(Debug, Clone, Default)]
pub(super) struct CellImage {
    pub(super) cells: Vec<[f32; 3]>,
    pub(super) covered: Vec<bool>,
}

impl CellImage {
    /// Change of the most changed channel of every cell.
    fn changes<'a>(&'a self, other: &'a CellImage) -> impl Iterator<Item = f32> + 'a {
        let most = |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
        self.cells.iter().zip(&other.cells).map(move |(a, b)| most(a, b))
    }

    /// 99th percentile of the change.
    pub(super) fn change_levels(&self, other: &CellImage) -> f64 {
        let mut changes: Vec<f32> = self.changes(other).collect();
        let at = (changes.len() * 99 / 100).min(changes.len() - 1);
        f64::from(*changes.select_nth_unstable_by(at, f32::total_cmp).1)
    }

    /// Share of the cells free of markers in both that changed by more than a level.
    fn changed_share(&self, other: &CellImage, level: f32) -> f64 {
        let free = |i: usize| !self.covered[i] && !other.covered[i];
        let (mut changed, mut count) = (0u32, 0u32);
        for (_, change) in self.changes(other).enumerate().filter(|(i, _)| free(*i)) {
            changed += u32::from(change > level);
            count += 1;
        }
        f64::from(changed) / f64::from(count.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(mean_levels: f64, change_levels: f64, touched: bool) -> RestLook {
        RestLook { mean_levels: Some(mean_levels), change_levels, sharpness: if touched { 9.0 } else { 3.0 }, touched }
    }

    fn choose(looks: &[RestLook], images: &[CellImage]) -> Result<RestChoice, RestError> {
        super::choose(looks, images, &RestSettings::default(), &ContactSettings::default())
    }

    #[test]
    fn dark_stale_and_touched_frames_are_passed_over() {
        let mut looks = vec![look(64.0, f64::INFINITY, false)]; // dark
        looks.push(look(90.0, 30.0, true)); // stale: an old touch
        looks.extend((0..6).map(|i| look(90.0, if i == 0 { 30.0 } else { 0.5 }, false)));
        looks.extend((0..9).map(|_| look(91.0, 8.0, true)));
        assert_eq!(choose(&looks, &[]), Ok(RestChoice { frames: 2..8, kind: RestKind::Unloaded }));
    }

    #[test]
    fn touched_from_the_start_takes_the_first_stationary_run() {
        let looks: Vec<_> = (0..21).map(|i| look(90.0, if i < 6 { 0.5 } else { 9.0 }, true)).collect();
        assert_eq!(choose(&looks, &[]), Ok(RestChoice { frames: 0..6, kind: RestKind::InContact }));
    }

    #[test]
    fn noise_above_the_calm_level_is_no_motion_and_no_frame_of_a_motion_is_at_rest() {
        let shows = |levels: f32| CellImage { cells: vec![[levels; 3]; 100], covered: vec![false; 100] };
        let choose_of = |looks: Vec<RestLook>, step: f32| {
            let images: Vec<_> = (0..20).map(|i| shows(step * i as f32)).collect();
            choose(&looks, &images)
        };
        // A slide smears an imprint: one frame of it looks untouched.
        let change = |i: usize| if (7..14).contains(&i) { 40.0 } else { 6.5 };
        let choice = choose_of((0..20).map(|i| look(90.0, change(i), i != 10)).collect(), 0.0);
        assert_eq!(choice, Ok(RestChoice { frames: 0..7, kind: RestKind::InContact }));
        // As much change from frame to frame, but it adds up.
        let choice = choose_of((0..20).map(|i| look(90.0, 6.5, i < 10)).collect(), 6.5);
        assert_eq!(choice, Ok(RestChoice { frames: 0..1, kind: RestKind::InContact }));
        // To and fro, by as much from frame to frame, and by more between the ends.
        let images: Vec<_> = (0..20).map(|i| shows([0.0, 6.5, 0.0, -6.5][i % 4])).collect();
        let choice = choose(&(0..20).map(|i| look(90.0, 6.5, i < 10)).collect::<Vec<_>>(), &images);
        assert_eq!(choice, Ok(RestChoice { frames: 0..1, kind: RestKind::InContact }));
        // A light that flickers over an untouched finger.
        let choice = choose_of((0..20).map(|i| look(90.0, [7.0, 40.0][i % 2], false)).collect(), 0.0);
        assert_eq!(choice, Ok(RestChoice { frames: 0..1, kind: RestKind::Unloaded }));
    }

    /// Looks of a sequence of frames: `u` untouched, `t` touched; capital where the image has changed since the
    /// previous frame.
    fn row(shown: &str) -> Vec<RestLook> {
        let of = |c: char| look(90.0, if c.is_uppercase() { 30.0 } else { 0.5 }, c.eq_ignore_ascii_case(&'t'));
        shown.chars().map(of).collect()
    }

    #[test]
    fn of_untouched_runs_that_show_the_same_a_later_one_counts_only_where_the_first_is_short() {
        for (shown, frames) in [("UuuuuUUuuuuuuuuu", 0..5), ("UuuuUUuuuuuuuuu", 5..15), ("UuuuUUu", 0..4)] {
            assert_eq!(choose(&row(shown), &[]), Ok(RestChoice { frames, kind: RestKind::Unloaded }), "{shown}");
        }
    }

    #[test]
    fn what_is_known_to_be_held_is_in_contact_however_little_shows_and_whatever_comes_later() {
        let settings = RestSettings { held: true, ..RestSettings::default() };
        for (shown, frames) in
            [("UuuuuuUUU", 0..6), ("TtttUUUuuuuuuu", 0..4), ("TuUUuuu", 3..7), ("UUU", 0..1), ("TututtuTTTttttt", 0..7)]
        {
            let choice = super::choose(&row(shown), &[], &settings, &ContactSettings::default());
            assert_eq!(choice, Ok(RestChoice { frames, kind: RestKind::InContact }), "{shown}");
        }
    }

    /// A light touch is too weak to be detected by itself. If the image changes and gets smoother, the first run was
    /// touched. If it changes and gets sharper, the first run was untouched.
    #[test]
    fn a_light_touch_is_detected_by_what_changes() {
        const CELLS_COUNT: usize = 4800;
        let image = |touched: bool| CellImage {
            cells: (0..CELLS_COUNT).map(|i| [if touched && i < CELLS_COUNT / 5 { 100.0 } else { 90.0 }; 3]).collect(),
            covered: vec![false; CELLS_COUNT],
        };
        for (first_touched, kind) in [(true, RestKind::InContact), (false, RestKind::Unloaded)] {
            let shows = |i: usize| (i < 5) == first_touched;
            let images: Vec<CellImage> = (0..15).map(|i| image(shows(i))).collect();
            let looks: Vec<RestLook> = (0..15)
                .map(|i| {
                    let sharpness = if shows(i) { 5.0 } else { 3.5 };
                    RestLook { sharpness, ..look(90.0, if i == 5 { 12.0 } else { 0.5 }, false) }
                })
                .collect();
            assert_eq!(choose(&looks, &images), Ok(RestChoice { frames: 0..5, kind }));
        }
    }

    #[test]
    fn black_frames_only_are_refused() {
        let black = RestLook { mean_levels: None, ..look(0.0, f64::INFINITY, true) };
        let error = RestError::NoStationaryFrame { looked_at_count: 2, unusable_count: 2 };
        assert_eq!(choose(&[black, black], &[]), Err(error));
    }
}
