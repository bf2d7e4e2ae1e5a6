//! The ground truth of a recording: fractions, events and flags agree with one another and with statics.

use slipbound_lab::contact::Event;
use slipbound_lab::record::record;
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::{FrameTruth, Gross, TruthHeader};

/// Header and frames of a recording of a scene.
fn recorded(text: &str) -> (TruthHeader, Vec<FrameTruth>) {
    let trial = Trial::parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
    let folder = tempfile::tempdir().expect("a folder");
    record(&trial, folder.path(), |_| true).unwrap_or_else(|error| panic!("{text}: {error}"));
    let text = std::fs::read_to_string(folder.path().join("truth.jsonl")).expect("a truth file");
    let (header, lines) = text.split_once('\n').expect("a header");
    let truths = lines.lines().map(|line| serde_json::from_str(line).expect("a truth")).collect();
    (serde_json::from_str(header).expect("a header"), truths)
}

fn time_s(truth: &FrameTruth) -> f64 {
    truth.time_ns as f64 * 1e-9
}

/// A flat face slides at mu P also if it lets go while the grip falls, between two frames.
#[test]
fn the_load_fraction_counts_from_the_grip_at_gross_slip_not_from_the_frame_after_it() {
    let (header, truths) = recorded(
        "regrip?object=crayons_box&force_n=20&mu=0.5&grid=fast&regrip_fraction=0.7&regrip_at_fraction=0.84&regrips=1",
    );
    let gross = header.gross.expect("it slides");
    let shown = truths.iter().find(|truth| gross.is_shown_at(time_s(truth))).expect("frames");
    assert!(gross.grip_force_n > 1.1 * shown.grip_force_n, "{gross:?}, {} N", shown.grip_force_n);
    let before = truths.iter().filter(|truth| !gross.is_shown_at(time_s(truth)) && truth.load > Some(0.2));
    assert!(before.clone().count() > 10);
    for truth in before {
        let expected = truth.wrench.force_n.length() / (0.5 * truth.grip_force_n);
        let f = truth.load_fraction.expect("it slides in the end");
        assert!((f / expected - 1.0).abs() < 0.03, "frame {}: {f}, expected {expected}", truth.frame);
    }
}

fn times_of(event: Event, truths: &[FrameTruth]) -> Vec<(usize, f64)> {
    let all = truths.iter().enumerate().flat_map(|(n, truth)| truth.events.iter().map(move |timed| (n, timed)));
    all.filter(|(_, timed)| timed.event == event).map(|(n, timed)| (n, timed.time_s)).collect()
}

fn assert_event_is_gross_slip(gross: Gross, truths: &[FrameTruth]) {
    let shown = truths.iter().position(|truth| gross.is_shown_at(time_s(truth))).expect("frames");
    assert_eq!(times_of(Event::Gross, truths), [(shown, gross.time_s)], "{gross:?}");
}

/// On a bend gross slip is known two frames after it began; header and event must tell the same time.
#[test]
fn the_event_of_gross_slip_on_a_bend_is_in_the_frame_that_shows_it() {
    let (header, truths) = recorded("shear_and_twist?distance_mm=6&angle_deg=36&object=toy_duck&grid=fast");
    let gross = header.gross.expect("it slides");
    assert_event_is_gross_slip(gross, &truths);
    let shown = truths.iter().find(|truth| gross.is_shown_at(time_s(truth))).expect("frames");
    assert!(shown.friction_used_fraction < Some(0.99), "by the rule for bends: {:?}", shown.friction_used_fraction);
}

#[test]
fn events_of_dropped_frames_are_in_the_next_frame_that_arrives() {
    let scene = "ramp?object=crayons_box&grid=fast&ramp_s=0.5";
    let (_, whole) = recorded(scene);
    let (header, truths) = recorded(&format!("{scene}&fault=drop=0.7"));
    assert!(truths.len() < whole.len() / 2, "{} of {}", truths.len(), whole.len());
    assert_event_is_gross_slip(header.gross.expect("it slides"), &truths);
    let events = |truths: &[FrameTruth]| truths.iter().flat_map(|truth| truth.events.clone()).collect::<Vec<_>>();
    assert_eq!(events(&truths), events(&whole));
}

/// The gel of the GelSight Mini ends before the grid does.
#[test]
fn a_contact_that_reaches_the_edge_of_the_gel_is_flagged() {
    let at_border = |object: &str| {
        let scene = format!("press?camera=gelsight_mini&object={object}&grid=fast&hold_s=0.1&press_s=0.1");
        recorded(&scene).1.iter().filter(|truth| truth.at_border).count()
    };
    assert_eq!(at_border("bottle_cap"), 0, "well within the pad");
    assert!(at_border("crayons_box") > 5, "larger than the pad");
}

/// A cap that rolls off the pad with extreme strain: the solvers reach their limits of iterations.
#[test]
fn frames_that_did_not_converge_are_counted() {
    let scene = "roll?distance_mm=30&speed_mm_per_s=60&grid=fast&rest_frames=1&press_s=0.1";
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = record(&Trial::parse(scene).expect("a scene"), folder.path(), |_| true).expect("records");
    let truth = std::fs::read_to_string(folder.path().join("truth.jsonl")).expect("a truth file");
    let unconverged = truth.lines().filter(|line| line.contains("\"converged\":false")).count() as u64;
    assert!(unconverged > 0 && recorded.unconverged_count == unconverged, "{recorded:?}, {unconverged} in the file");
}
