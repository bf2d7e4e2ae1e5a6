//! Labels shuffled before the fits: do they use what they should not?

use super::refit::{Example, left_out_scale};
use crate::eval::statistics::{auc, mean, share_of};
use crate::eval::table::{Cell, Table};
use crate::random::Random;

/// How many shuffles, and their seed.
const SHUFFLES_COUNT: usize = 200;
const SEED: u64 = 7;

/// Score from which a clip counts as slipped.
const SLIPS: f64 = 1.0;

/// Area under the curve, and wrong clips, by the true labels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scored {
    pub area: f64,
    pub wrong_count: usize,
}

/// The scores of clips, each on the scale fitted to the clips of all other objects with the given labels.
pub(super) fn left_out_scores(clips: &[Example<'_>], labels: &[bool]) -> Vec<f64> {
    let told: Vec<Example<'_>> = clips.iter().zip(labels).map(|(clip, &slips)| Example { slips, ..*clip }).collect();
    let score = |clip: &Example<'_>| left_out_scale(&told, clip.object).map_or(0.0, |scale| clip.latch.score(&scale));
    clips.iter().map(score).collect()
}

/// The result of scores; None unless some clips slipped and some were held.
pub(super) fn result(clips: &[Example<'_>], scores: &[f64]) -> Option<Scored> {
    let of = |slips: bool| -> Vec<f64> {
        clips.iter().zip(scores).filter(|(clip, _)| clip.slips == slips).map(|(_, &score)| score).collect()
    };
    let wrong_count = clips.iter().zip(scores).filter(|(clip, score)| clip.slips != (**score > SLIPS)).count();
    auc(&of(true), &of(false)).value.map(|area| Scored { area, wrong_count })
}

/// Results of a scoring method if the labels for the fits are shuffled.
pub(super) fn shuffled(
    clips: &[Example<'_>],
    scores: impl Fn(&[Example<'_>], &[bool]) -> Vec<f64>,
) -> Vec<Option<Scored>> {
    let mut random = Random::new(SEED);
    let mut labels: Vec<bool> = clips.iter().map(|clip| clip.slips).collect();
    (0..SHUFFLES_COUNT)
        .map(|_| {
            for i in (1..labels.len()).rev() {
                labels.swap(i, (random.next_u64() % (i as u64 + 1)) as usize);
            }
            result(clips, &scores(clips, &labels))
        })
        .collect()
}

/// The table of true and shuffled labels; None unless some clips slipped and some were held.
pub(super) fn table(clips: &[Example<'_>]) -> Option<Table> {
    let labels: Vec<bool> = clips.iter().map(|clip| clip.slips).collect();
    let truly = result(clips, &left_out_scores(clips, &labels))?;
    let others: Vec<Scored> = shuffled(clips, left_out_scores).into_iter().collect::<Option<_>>()?;
    let of = |value: fn(&Scored) -> f64| mean(&others.iter().map(value).collect::<Vec<f64>>());
    let as_good = |is: &dyn Fn(&Scored) -> bool| Cell::Share(share_of(others.iter().map(is)));
    let mut table = Table::new(
        "Shuffled labels",
        "The labels of all clips shuffled 200 times before the fits, and judged by the true ones. A shuffle reaches the area of the true \
         labels once it gets the signs of the three scales right; the wrong clips depend on the scales themselves.",
        &["labels", "AUC", "wrong", "as good in AUC %", "as good in wrong clips %"],
    );
    let one = |value: f64| crate::eval::Estimated { value: Some(value), low: None, high: None, n: clips.len() as u64 };
    table.rows.push(vec![
        "true".into(),
        Cell::Number(one(truly.area), 3),
        Cell::Count(truly.wrong_count as u64),
        Cell::None,
        Cell::None,
    ]);
    table.rows.push(vec![
        format!("{SHUFFLES_COUNT} shuffles, mean").into(),
        Cell::Number(of(|other| other.area), 3),
        Cell::Number(of(|other| other.wrong_count as f64), 1),
        as_good(&|other| other.area >= truly.area),
        as_good(&|other| other.wrong_count <= truly.wrong_count),
    ]);
    Some(table)
}
