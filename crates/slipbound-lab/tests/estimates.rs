//! Stick ratio, margin, load and friction against the truth of simulated trials.

use slipbound::monitor::{Estimate, RestBuilder, RestKind, Settings, SlipMonitor, SlipReport, SlipState};
use slipbound::plane::Vec2;
use slipbound::port::{FrameBuffer, FrameSource, GripSample, Next};
use slipbound::sensor::Sensor;
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::{FrameTruth, World, complete};

fn world(trial: &str) -> World {
    let trial = Trial::parse(&format!("{trial}&grid=fast&rest_frames=12")).expect("a trial");
    World::new(&trial).expect("a sound trial")
}

/// A monitor after the frames at rest.
fn at_rest(world: &mut World, sensor: &Sensor, settings: &Settings, frame: &mut FrameBuffer) -> SlipMonitor {
    world.next(frame).expect("a frame");
    let mut rest = RestBuilder::new(sensor, settings, frame.size).expect("valid");
    for _ in 0..10 {
        rest.add(&frame.frame().expect("whole")).expect("bright");
        world.next(frame).expect("a frame");
    }
    SlipMonitor::new(sensor, settings, rest.build(RestKind::Unloaded).expect("markers")).expect("valid")
}

/// The reports of a trial after rest, with the ground truth.
fn watch(trial: &str, knows_grip: bool, of: impl Fn(Sensor) -> Sensor) -> Vec<(SlipReport, FrameTruth)> {
    let mut world = world(trial);
    let sensor = of(world.sensor());
    let mut frame = FrameBuffer::default();
    let mut monitor = at_rest(&mut world, &sensor, &Settings::default(), &mut frame);
    let (mut reports, mut truths) = (Vec::new(), Vec::new());
    while world.next(&mut frame).expect("a frame") == Next::Frame {
        let truth = world.truth().clone();
        let grip = knows_grip.then_some(GripSample { force_n: truth.grip_force_n });
        reports.push(monitor.step(&frame.frame().expect("whole"), grip));
        truths.push(truth);
    }
    complete(&mut truths, world.gross());
    reports.into_iter().zip(truths).collect()
}

fn alarm(seen: &[(SlipReport, FrameTruth)]) -> Option<&(SlipReport, FrameTruth)> {
    seen.iter().find(|(report, _)| report.state.is_slip())
}

const RAMP: &str = "ramp?object=tape_roll&force_n=20&mu=0.5&direction_deg=40&ramp_s=0.8&seed=5";

#[test]
fn a_load_raises_the_alarm_and_a_squeeze_does_not() {
    let ramp = watch(RAMP, true, |sensor| sensor);
    let (report, truth) = alarm(&ramp).expect("it slides in the end");
    let used = truth.load_fraction.expect("it slides");
    assert!((0.3..0.75).contains(&used), "an alarm at f = {used}: {report:?}");
    for quiet in [
        "quiet_grip_steps?object=bottle_cap&force_n=10&step_n=10&most_n=60&hold_s=0.3&seed=6",
        "roll?object=blue_tube&force_n=20&distance_mm=4&direction_deg=90&seed=7",
        "roll?object=screwdriver&force_n=20&mu=0.72&distance_mm=5&direction_deg=90&seed=12",
        "ramp?object=scissors&force_n=30&mu=0.6&peak_fraction=0.19&ramp_s=1&hold_s=1&seed=8",
    ] {
        let seen = watch(quiet, true, |sensor| sensor);
        assert!(alarm(&seen).is_none(), "{quiet}: {:?}", alarm(&seen));
        assert!(seen.iter().filter(|(report, _)| report.estimates.margin.is_some()).count() > 20, "{quiet}");
    }
}

/// From images alone, nothing tells how large the load is that the gel carries; how fast it grows must not stand in for
/// it. The alarm comes when the mean of the margin (first order, 80 ms) is small, in the second frame with a small margin or
/// later.
#[test]
fn a_slow_load_is_not_taken_for_a_large_one() {
    let ramp = |ramp_s: f64| {
        let seen = watch(
            &format!("ramp?object=crayons_box&force_n=25&mu=0.5&direction_deg=10&ramp_s={ramp_s}&seed=3"),
            false,
            |sensor| sensor,
        );
        let (report, truth) = alarm(&seen).expect("it slides in the end");
        assert_eq!(report.state, SlipState::Incipient, "{ramp_s} s");
        let (mut mean, mut last_ns, mut small_count) = (1.0, None, 0);
        let mut is_due = |(report, truth): &&(SlipReport, FrameTruth)| {
            let Some(margin) = report.estimates.margin else { return false };
            let elapsed_ns = last_ns.replace(truth.time_ns).map_or(100_000_000, |then_ns| truth.time_ns - then_ns);
            mean += (1.0 - libm::exp(-(elapsed_ns as f64) / 80e6)) * (margin.value - mean);
            small_count = if margin.value <= 0.5 { small_count + 1 } else { 0 };
            mean <= 0.5 && small_count >= 2
        };
        let due = seen.iter().find(|frame| is_due(frame)).expect("a small margin");
        assert_eq!(
            due.1.time_ns, truth.time_ns,
            "{ramp_s} s: due at f = {:?}, said at {:?}",
            due.1.load_fraction, truth.load_fraction
        );
        truth.load_fraction.expect("it slides")
    };
    let used = [0.5, 1.0, 8.0].map(ramp);
    assert!(used.iter().all(|used| (0.3..0.8).contains(used)), "alarms at f = {used:?}");
}

/// Distance between the detected middle of the contact and that of the touching cells, mm, at the end of a trial.
fn middle_off_mm(trial: &str, dilate_pitch: f64, drop_weak_pieces: bool) -> f64 {
    let mut world = world(trial);
    let (sensor, mut settings) = (world.sensor(), Settings::default());
    (settings.contact.dilate_pitch, settings.contact.drop_weak_pieces) = (dilate_pitch, drop_weak_pieces);
    let mut frame = FrameBuffer::default();
    let mut monitor = at_rest(&mut world, &sensor, &settings, &mut frame);
    while world.next(&mut frame).expect("a frame") == Next::Frame {
        monitor.step(&frame.frame().expect("whole"), None);
    }
    let touching = world.finger().contact().iter().enumerate().filter(|(_, touches)| **touches);
    let places: Vec<Vec2> = touching.map(|(cell, _)| world.grid().centre_mm(cell)).collect();
    let truth_mm = places.iter().fold(Vec2::ZERO, |sum, place| sum + *place) / places.len() as f64;
    let size = sensor.rectified_px();
    let middle_px = Vec2::new((size.width - 1) as f64, (size.height - 1) as f64) / 2.0;
    let seen_px = monitor.contact_region().middle_px().expect("contact");
    ((seen_px - middle_px) * sensor.mm_per_px().expect("simulated") - truth_mm).length()
}

/// Noise and well-lit weave make edges without pressure: they must neither count as contact nor shift its middle.
#[test]
fn a_weave_that_nothing_presses_is_no_part_of_the_contact() {
    let off_mm = |dilate_pitch: f64, drop_weak_pieces: bool| -> f64 {
        let trials = [("tape_roll", 24), ("super_glue", 38), ("toy_duck", 15), ("screwdriver", 16)];
        let trials =
            trials.map(|(object, force_n)| format!("press?object={object}&force_n={force_n}&hold_s=0.2&seed=9"));
        trials.iter().map(|trial| middle_off_mm(trial, dilate_pitch, drop_weak_pieces)).sum::<f64>()
            / trials.len() as f64
    };
    // A region that grows back further gives more weight to a weak piece.
    let (off, with_pieces) = (off_mm(18.0 / 15.2, true), off_mm(18.0 / 15.2, false));
    println!("middle of the contact {off:.2} mm off, {with_pieces:.2} with weak pieces");
    assert!(off < 0.35 && with_pieces > 2.0 * off, "{off} {with_pieces} mm");
    let by_default = off_mm(Settings::default().contact.dilate_pitch, true);
    assert!(by_default < 0.25, "{by_default} mm");
}

/// Half of the load of a long object is outside the Mini's view; the length of the gel shows how far the contact
/// extends.
#[test]
fn the_load_of_a_contact_that_the_view_cuts_is_known_from_the_length_of_the_gel() {
    for (object, force_n) in [("water_bottle", 10), ("crayons_box", 15), ("scrub_sponge", 10)] {
        let trial =
            format!("ramp?object={object}&camera=gelsight_mini&force_n={force_n}&mu=0.6&direction_deg=30&seed=3");
        let told = |of: fn(Sensor) -> Sensor| -> f64 {
            let seen = watch(&trial, true, of);
            let loaded = seen.iter().filter(|(_, truth)| truth.load_fraction.is_some_and(|f| (0.3..0.9).contains(&f)));
            let shares: Vec<f64> = loaded
                .filter_map(|(report, truth)| Some(report.estimates.shear_n?.value / truth.wrench.force_n.length()))
                .collect();
            assert!(shares.len() > 8, "{object}: {} frames", shares.len());
            shares.iter().sum::<f64>() / shares.len() as f64
        };
        let (whole, view) = (told(|sensor| sensor), told(|sensor| Sensor { gel_mm: None, ..sensor }));
        println!("{object}: {whole:.2} of the load, {view:.2} without the length of the gel");
        assert!((0.8..1.25).contains(&whole), "{object}: {whole}");
        assert!(view < 0.85 * whole, "{object}: {view} without the length of the gel, {whole} with it");
    }
}

#[test]
fn a_flat_face_over_the_whole_pad_is_felt_by_what_it_drags_along() {
    // The camera of the Mini shows neither a rim nor a weave.
    for load in ["twist_fraction=-1&force_n=18&mu=0.9", "direction_deg=140&force_n=12&mu=0.7"] {
        let seen = watch(
            &format!("ramp?object=crayons_box&camera=gelsight_mini&{load}&ramp_s=1&peak_fraction=1.8&seed=4"),
            true,
            |sensor| sensor,
        );
        let felt = seen.iter().find(|(report, _)| report.state != SlipState::NoContact);
        let used = felt.and_then(|(_, truth)| truth.load_fraction).expect("felt while it is loaded");
        let margin = felt.and_then(|(report, _)| report.estimates.margin);
        assert!(margin.is_some(), "{load}: what has moved the gel so far is load, not squeeze");
        assert!(used < 0.5, "{load}: no contact until f = {used}");
        let (report, truth) = alarm(&seen).expect("it slides in the end");
        let used = truth.load_fraction.expect("it slides");
        assert!(used > 0.2 && used < 1.0, "{load}: an alarm at f = {used}: {report:?}");
        let at_rest = seen.iter().take_while(|(_, truth)| truth.load_fraction.is_none_or(|f| f == 0.0));
        assert!(at_rest.into_iter().all(|(report, _)| report.state == SlipState::NoContact), "{load}");
    }
}

#[test]
fn a_slide_that_hardly_shears_the_gel_is_said_soon_not_before_and_until_it_ends() {
    // 10 N on a wide face shear the gel by less than a tenth of a pitch.
    let seen = watch(
        "shear?object=crayons_box&force_n=10&mu=0.45&speed_mm_per_s=10&distance_mm=8&at_x_mm=-4&seed=11",
        true,
        |sensor| sensor,
    );
    let began = seen.iter().position(|(_, truth)| truth.load_fraction.is_some_and(|f| f >= 0.99)).expect("it slides");
    let moves: Vec<usize> = (began..seen.len())
        .filter(|&n| seen[n].1.pose.position_mm.x - seen[n - 1].1.pose.position_mm.x > 0.1)
        .collect();
    let gross: Vec<usize> = (0..seen.len()).filter(|&n| seen[n].0.state == SlipState::Gross).collect();
    let first = *gross.first().expect("said");
    assert!(began <= first + 1 && first <= began + 3, "began in {began}, said in {first}");
    assert!(moves.len() > 15, "{}", moves.len());
    assert!(moves.iter().filter(|n| **n >= first).all(|n| gross.contains(n)), "{gross:?} of {moves:?}");
    let (stands, last) = (moves[moves.len() - 1] + 1, gross[gross.len() - 1]);
    assert!(
        seen.len() > stands + 5 && last <= stands + 3,
        "stands from {stands}, said until {last}, of {}",
        seen.len()
    );
}

#[test]
fn estimates_follow_the_truth_of_a_ramp() {
    let seen = watch(RAMP, true, |sensor| sensor);
    let loaded: Vec<_> =
        seen.iter().filter(|(_, truth)| truth.load_fraction.is_some_and(|f| (0.2..0.95).contains(&f))).collect();
    assert!(loaded.len() > 10, "{}", loaded.len());
    let mean = |error: &dyn Fn(&SlipReport, &FrameTruth) -> f64| {
        loaded.iter().map(|(report, truth)| error(report, truth)).sum::<f64>() / loaded.len() as f64
    };
    let value = |estimate: Option<Estimate>| estimate.expect("known under load").value;
    let force = mean(&|report, truth| {
        let truth_n = truth.wrench.force_n.length();
        (value(report.estimates.shear_n) / truth_n - 1.0).abs()
    });
    assert!(force < 0.08, "shear force {force}");
    let margin = mean(&|report, truth| (value(report.estimates.margin) - truth.margin.expect("slides")).abs());
    assert!(margin < 0.15, "margin {margin}");
    let stick =
        mean(&|report, truth| (value(report.estimates.stick_ratio) - truth.stick_ratio.expect("touches")).abs());
    assert!(stick < 0.2, "stick ratio {stick}");
    let (last, _) = loaded.last().expect("some");
    let friction = value(last.estimates.friction);
    assert!((friction / 0.5 - 1.0).abs() < 0.35, "friction {friction}");
    for (report, _) in &loaded {
        let margin = report.estimates.margin.expect("known");
        assert!(margin.sd > 0.0 && margin.sd < 0.5 && margin.age_frames <= 2, "{margin:?}");
    }
}

#[test]
fn what_cannot_be_known_is_not_said() {
    let last = |seen: Vec<(SlipReport, FrameTruth)>| {
        let at = seen.iter().rposition(|(_, truth)| truth.load_fraction.is_some_and(|f| f < 0.8)).expect("loaded");
        (seen[at].0.estimates, seen[0].0.estimates)
    };
    let (no_grip, before) = last(watch(RAMP, false, |sensor| sensor));
    assert!(before.margin.is_none() && before.shear_n.is_none(), "nothing touches: {before:?}");
    assert!(no_grip.friction.is_none() && no_grip.margin.is_some() && no_grip.shear_n.is_some(), "{no_grip:?}");
    let (no_stiffness, _) = last(watch(RAMP, true, |sensor| Sensor { shear: None, ..sensor }));
    assert!(no_stiffness.friction.is_none() && no_stiffness.shear_n.is_none(), "{no_stiffness:?}");
    assert!(no_stiffness.torque_nmm.is_none() && no_stiffness.margin.is_some(), "{no_stiffness:?}");
}
