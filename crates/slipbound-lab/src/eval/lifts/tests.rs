use super::*;
use crate::random::Random;

/// Clips of four objects whose evidence separates slipped from held, with some overlap.
fn clips(random: &mut Random) -> Vec<Example<'static>> {
    let mut clips = Vec::new();
    for object in ["cup", "pen", "tube", "box"] {
        for n in 0..9 {
            let slips = n < 4;
            let base = if slips { 1.0 } else { 0.0 };
            clips.push(Example {
                object,
                slips,
                latch: Latch {
                    relaxation: 0.5 * base + random.between(0.0, 0.7),
                    centre_rim_ratio: Some(1.8 + base + random.between(-0.9, 0.9)),
                    imprint_change: Some(0.1 + 0.4 * base + random.between(-0.1, 0.6)),
                },
            });
        }
    }
    clips
}

/// The scores of clips, each on the scale fitted to the clips of all other objects with the given labels.
fn left_out_scores(clips: &[Example<'_>], labels: &[bool]) -> Vec<f64> {
    let told: Vec<Example<'_>> = clips.iter().zip(labels).map(|(clip, &slips)| Example { slips, ..*clip }).collect();
    let score = |clip: &Example<'_>| left_out_scale(&told, clip.object).map_or(0.0, |scale| clip.latch.score(&scale));
    clips.iter().map(score).collect()
}

fn area(clips: &[Example<'_>], scores: &[f64]) -> f64 {
    let of = |slips: bool| -> Vec<f64> {
        clips.iter().zip(scores).filter(|(clip, _)| clip.slips == slips).map(|(_, &score)| score).collect()
    };
    auc(&of(true), &of(false)).value.expect("both kinds")
}

/// Areas under the curve of a scoring method if the labels for the fits are shuffled.
fn shuffled_areas(
    clips: &[Example<'_>],
    random: &mut Random,
    scores: impl Fn(&[Example<'_>], &[bool]) -> Vec<f64>,
) -> Vec<f64> {
    let mut labels: Vec<bool> = clips.iter().map(|clip| clip.slips).collect();
    (0..200)
        .map(|_| {
            for i in (1..labels.len()).rev() {
                labels.swap(i, (random.next_u64() % (i as u64 + 1)) as usize);
            }
            area(clips, &scores(clips, &labels))
        })
        .collect()
}

#[test]
fn shuffled_training_labels_centre_on_chance_and_the_true_ones_beat_them() {
    let mut random = Random::new(7);
    let clips = clips(&mut random);
    let labels: Vec<bool> = clips.iter().map(|clip| clip.slips).collect();
    let truly = area(&clips, &left_out_scores(&clips, &labels));
    let areas = shuffled_areas(&clips, &mut random, left_out_scores);
    let mean = areas.iter().sum::<f64>() / areas.len() as f64;
    let beaten = areas.iter().filter(|area| **area < truly).count();
    assert!((mean - 0.5).abs() < 0.1, "mean of shuffles {mean}");
    assert!(beaten >= 198, "{truly} beats {beaten} of 200");

    // The check detects a leak: a score that uses the clip's own label stays good with shuffled labels.
    let leaking = |clips: &[Example<'_>], labels: &[bool]| -> Vec<f64> {
        let honest = left_out_scores(clips, labels);
        honest.iter().zip(clips).map(|(score, clip)| score + 3.0 * f64::from(u8::from(clip.slips))).collect()
    };
    let leaked = shuffled_areas(&clips, &mut random, leaking);
    assert!(leaked.iter().sum::<f64>() / leaked.len() as f64 > 0.9, "a leak is seen");
}

#[test]
fn a_scale_has_nothing_from_clips_of_the_object_it_judges() {
    let mut random = Random::new(11);
    let mut clips = clips(&mut random);
    let labels: Vec<bool> = clips.iter().map(|clip| clip.slips).collect();
    let before = left_out_scores(&clips, &labels);
    // Other evidence and labels of the other clips of the cup do not change the score of its first.
    for clip in clips.iter_mut().filter(|clip| clip.object == "cup").skip(1) {
        (clip.latch.relaxation, clip.slips) = (9.0, !clip.slips);
    }
    let labels: Vec<bool> = clips.iter().map(|clip| clip.slips).collect();
    assert_eq!(left_out_scores(&clips, &labels)[0], before[0]);
    assert_ne!(left_out_scores(&clips, &labels)[9], before[9], "the pen is judged by the cup's");
}
