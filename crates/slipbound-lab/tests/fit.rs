//! Training data of the trees of the estimates and of gross slip: rows of simulated trials with the ground truth of
//! each frame.

use slipbound_lab::fit::{RANDOM_SHAPE, Row, gross_rows_of, rows_of};
use slipbound_lab::objects::OBJECTS;

/// Trials of the split: a guided slide of a named object, and of a random shape; a ramp to gross slip of a random
/// shape; a load below it.
const SLIDE: u64 = 5;
const SLIDE_OF_BODY: u64 = 2005;
const RAMP_OF_BODY: u64 = 2003;
const HELD: u64 = 6;

/// The labels in the order of the frames, without consecutive repetitions.
fn labels(rows: &[Row]) -> Vec<f64> {
    let mut labels: Vec<f64> = rows.iter().map(|row| row.targets[0]).collect();
    labels.dedup();
    labels
}

#[test]
fn rows_of_gross_slip_say_when_the_object_slides_and_hold_whose_it_is() {
    for (number, slides) in [(SLIDE, true), (SLIDE_OF_BODY, true), (RAMP_OF_BODY, true), (HELD, false)] {
        let [knowing, alone] = gross_rows_of(number).expect("simulated");
        let expected: &[f64] = if slides { &[0.0, 1.0] } else { &[0.0] };
        for rows in [&knowing, &alone] {
            assert_eq!(labels(rows), expected, "trial {number}");
            for row in rows {
                let [label, used] = row.targets;
                assert!(if label == 1.0 { used == 1.0 } else { used < 0.8 }, "trial {number}: {:?}", row.targets);
                assert_eq!(row.trial, number);
                match number >= 2000 {
                    true => assert_eq!(row.object, RANDOM_SHAPE, "trial {number}"),
                    false => assert!(OBJECTS.iter().any(|object| object.name == row.object), "trial {number}"),
                }
            }
        }
        // Without the grip force a frame shows less: some features are never known.
        let known =
            |rows: &[Row]| (0..rows[0].features.len()).filter(|&k| rows.iter().any(|r| r.features[k] != 0.0)).count();
        assert!(known(&alone) < known(&knowing), "trial {number}");
    }
}

#[test]
fn rows_of_the_estimates_go_from_a_contact_that_sticks_to_one_that_slides() {
    for (number, object, weight) in [(1, "super_glue", 1.0), (2402, RANDOM_SHAPE, 0.5)] {
        let rows = rows_of(number).expect("simulated");
        let (first, last) = (rows.first().expect("rows"), rows.last().expect("rows"));
        assert!(first.targets[0] < 0.1 && first.targets[1] > 0.7, "trial {number}: {:?}", first.targets);
        assert_eq!(last.targets, [1.0, 0.0], "trial {number}");
        assert!(rows.iter().all(|row| row.object == object && row.weight == weight && row.mu == first.mu));
        // The load grows, and the stick area shrinks with it.
        let grows = |pair: &[Row]| pair[1].targets[0] >= pair[0].targets[0] - 0.05;
        let shrinks = |pair: &[Row]| pair[1].targets[1] <= pair[0].targets[1] + 0.15;
        assert!(rows.windows(2).all(|pair| grows(pair) && shrinks(pair)), "trial {number}");
    }
}
