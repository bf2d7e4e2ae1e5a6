use super::shuffles::{left_out_scores, result, shuffled};
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

#[test]
fn shuffled_training_labels_centre_on_chance_and_the_true_ones_beat_them() {
    let clips = clips(&mut Random::new(7));
    let labels: Vec<bool> = clips.iter().map(|clip| clip.slips).collect();
    let truly = result(&clips, &left_out_scores(&clips, &labels)).expect("both kinds");
    let areas = |others: Vec<Option<shuffles::Scored>>| -> Vec<f64> {
        others.iter().map(|other| other.expect("both kinds").area).collect()
    };
    let others = areas(shuffled(&clips, left_out_scores));
    let mean = others.iter().sum::<f64>() / others.len() as f64;
    let beaten = others.iter().filter(|area| **area < truly.area).count();
    assert!((mean - 0.5).abs() < 0.1, "mean of shuffles {mean}");
    assert!(beaten >= 198, "{truly:?} beats {beaten} of 200");

    // The check detects a leak: a score that uses the clip's own label stays good with shuffled labels.
    let leaking = |clips: &[Example<'_>], labels: &[bool]| -> Vec<f64> {
        let honest = left_out_scores(clips, labels);
        honest.iter().zip(clips).map(|(score, clip)| score + 3.0 * f64::from(u8::from(clip.slips))).collect()
    };
    let leaked = areas(shuffled(&clips, leaking));
    assert!(leaked.iter().sum::<f64>() / leaked.len() as f64 > 0.9, "a leak is seen");

    let table = shuffles::table(&clips).expect("both kinds");
    assert_eq!(table.rows.len(), 2);
    assert_eq!(table.rows[0][2], Cell::Count(truly.wrong_count as u64));
    let held: Vec<Example<'_>> = clips.into_iter().filter(|clip| !clip.slips).collect();
    assert!(shuffles::table(&held).is_none(), "nothing slipped");
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
