//! The page of a run: self-contained, correct, and of bounded size.

use crate::{any_number, events, screw, written};
use proptest::prelude::*;
use roxmltree::{Document, ParsingOptions};
use slipbound::control::Cycle;
use slipbound::hand::Health;
use slipbound::image::{Rgb, SizePx};
use slipbound::monitor::{
    ContactReport, Estimate, Estimates, MarkerCounts, MotionReport, SlipReport, SlipRule, SlipState, SlipSummary,
};
use slipbound::plane::Vec2;
use slipbound::port::GripCommand;
use slipbound::task::Ending;
use slipbound_rig::run::{Event, Row, RunFolder, RunInfo, TimedEvent};
use std::fs;

/// The page of a run; with an image of every finger at each slip.
fn page(info: &RunInfo, cycles: &[Cycle]) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let mut run = RunFolder::create(folder.path(), info).expect("creates");
    let (pixels, size) = ([90u8; 3 * 8 * 6], SizePx::new(8, 6));
    for cycle in cycles {
        let before = run.slips_count();
        run.cycle(cycle).expect("writes");
        let begins = run.slips_count() > before;
        for finger in info.fingers.iter().filter(|_| begins) {
            run.picture(cycle.time_ns, &finger.name, &info.source, Rgb::new(&pixels, size).expect("whole"))
                .expect("writes");
        }
    }
    run.note(5, &info.source).expect("writes");
    let path = run.finish(&screw::results(), Some(Ending::Tight)).expect("finishes");
    let html = fs::read_to_string(path).expect("reads");
    (folder, html)
}

/// Reads the page as XML, which is stricter than any browser.
fn parsed(html: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(html, options).unwrap_or_else(|e| panic!("{e}"))
}

/// Numbers of the slips that are marked, of each plot with axes; the same in those for wide and for narrow windows.
fn marked(document: &Document<'_>) -> Vec<Vec<u32>> {
    let [wide, narrow] = ["wide", "narrow"].map(|class| marked_in(document, class));
    assert_eq!(wide, narrow);
    wide
}

fn marked_in(document: &Document<'_>, class: &str) -> Vec<Vec<u32>> {
    let plots = document.descendants().filter(|n| n.has_tag_name("svg") && n.attribute("class") == Some(class));
    let marks = |n: roxmltree::Node<'_, '_>| {
        n.descendants().filter_map(|n| n.attribute("data-slip")).filter_map(|n| n.parse().ok()).collect()
    };
    plots.skip(1).map(marks).collect() // the first one is that of the phases
}

#[test]
fn the_page_needs_no_other_file() {
    let (_folder, html) = page(&screw::info(), &screw::cycles());
    for fetches in ["http", "//", "url(", "@import", "<script", "<link", "<iframe", "srcset"] {
        let found = html.match_indices(fetches).map(|(at, _)| &html[at.saturating_sub(60)..(at + 60).min(html.len())]);
        // A clip path is in the page itself; base 64 may hold any two slashes.
        let elsewhere = |text: &&str| !text.contains("url(#clip-") && !text.contains("base64") && !is_base64(text);
        let found: Vec<&str> = found.filter(elsewhere).collect();
        assert!(found.is_empty(), "`{fetches}` in {found:?}");
    }
    let document = parsed(&html);
    for node in document.descendants() {
        for name in ["href", "src", "data", "action", "poster"] {
            let value = node.attribute(name).unwrap_or("data:image/jpeg;base64,");
            assert!(value.starts_with("data:image/jpeg;base64,"), "{name}={value}");
        }
    }
    assert_eq!(document.descendants().filter(|n| n.has_tag_name("img")).count(), 2 * screw::SLIPS.len());
}

fn is_base64(text: &str) -> bool {
    text.chars().all(|c| c.is_ascii_alphanumeric() || "+/=".contains(c))
}

#[test]
fn every_slip_of_the_events_is_marked_in_every_plot_and_has_a_card() {
    let (folder, html) = page(&screw::info(), &screw::cycles());
    let slips: Vec<u32> = events(folder.path())
        .iter()
        .filter_map(|e| if let Event::SlipBegins { slip, .. } = e.event { Some(slip) } else { None })
        .collect();
    assert_eq!(slips, [1, 2, 3, 4]);
    let document = parsed(&html);
    let plots = marked(&document);
    assert_eq!(plots.len(), 6, "force, angle, torque, margin, slip, shear");
    assert!(plots.iter().all(|marks| *marks == slips), "{plots:?}");
    for slip in slips {
        let id = format!("slip-{slip}");
        assert!(document.descendants().any(|n| n.attribute("id") == Some(&id)), "{id}");
        assert!(folder.path().join(format!("slip_{slip:03}_right.png")).exists());
    }
}

#[test]
fn a_mark_stands_where_the_axis_says_its_time_is() {
    let (_folder, html) = page(&screw::info(), &screw::cycles());
    let document = parsed(&html);
    // After the phases.
    for plot in document.descendants().filter(|n| n.has_tag_name("svg")).skip(2).take(2) {
        a_mark_stands_right(plot);
    }
}

fn a_mark_stands_right(plot: roxmltree::Node<'_, '_>) {
    let number = |n: roxmltree::Node<'_, '_>, name| n.attribute(name).and_then(|x| x.parse::<f64>().ok());
    // Labels of the time axis are the lowest of all texts that are numbers and not those of marks.
    let texts = plot.descendants().filter(|n| n.has_tag_name("text") && n.attribute("text-anchor") == Some("middle"));
    let labels: Vec<(f64, f64)> =
        texts.filter_map(|n| Some((n.text()?.parse::<f64>().ok()?, number(n, "x")?))).collect();
    let (first, last) = (labels[0], labels[labels.len() - 1]);
    assert!(labels.len() >= 4, "{labels:?}");
    for (node, at) in plot.descendants().filter(|n| n.attribute("data-slip").is_some()).zip(screw::SLIPS) {
        let line = node.children().find(|n| n.has_tag_name("line")).expect("a line");
        let fraction = (f64::from(at) / 30.0 - first.0) / (last.0 - first.0);
        let expected_px = first.1 + fraction * (last.1 - first.1);
        assert!((number(line, "x1").expect("a number") - expected_px).abs() < 0.2, "{expected_px}");
    }
}

#[test]
fn names_from_outside_are_escaped() {
    let nasty = "</style><script>alert(\"x\")</script>&amp;'\u{1}\u{FFFF}";
    let info = RunInfo {
        name: nasty.into(),
        source: nasty.into(),
        notes: [(nasty.to_owned(), nasty.into())].into_iter().collect(),
        ..screw::info()
    };
    let (folder, html) = page(&info, &screw::cycles());
    assert!(!html.contains("<script"));
    let document = parsed(&html);
    let texts = document.descendants().filter(|n| n.text().is_some_and(|t| t.contains("alert(\"x\")"))).count();
    assert!(texts > 10, "{texts}");
    let beside = fs::read_dir(folder.path()).expect("reads").count();
    assert_eq!(beside, 6 + 2 * screw::SLIPS.len(), "no picture went elsewhere");
    assert!(folder.path().join("slip_001_right.png").exists());
    // Nor does one of a finger that the run does not know.
    let mut run = RunFolder::create(&folder.path().join("other"), &info).expect("creates");
    let picture = Rgb::new(&[90; 3], SizePx::new(1, 1)).expect("whole");
    assert!(run.picture(0, "../x", "", picture).is_err() && !folder.path().join("other/../slip_000_x.png").exists());
}

/// `hold` goes on until it is ended: its page is drawn from as much data after a day as after minutes.
#[test]
fn the_page_of_a_long_run_is_no_larger_and_keeps_its_peak_its_slips_and_its_end() {
    let (one, info) = (screw::cycles()[150], screw::info());
    let long = |count: u64| {
        let folder = tempfile::tempdir().expect("a folder");
        let mut run = RunFolder::create(folder.path(), &info).expect("creates");
        let (pixels, size) = ([90u8; 3 * 8 * 6], SizePx::new(8, 6));
        for i in 0..count {
            let force_n = if i == count / 3 { 47.3 } else { 20.0 };
            let grip_command = GripCommand::Hold { force_n };
            run.cycle(&Cycle { time_ns: i * 33_000_000, slips_count: 0, grip_command, ..one }).expect("writes");
            if i % 8 == 0 {
                run.note(i * 33_000_000, &format!("note {i}")).expect("writes");
            }
            if i % 400 == 0 {
                run.picture(i, "left", "seen", Rgb::new(&pixels, size).expect("whole")).expect("writes");
            }
        }
        let path = run.finish(&[], None).expect("finishes");
        (fs::read_to_string(path).expect("reads"), folder)
    };
    let (short, _) = long(8_000);
    let (html, folder) = long(40_000);
    assert!(html.len() < 3 * short.len(), "{} after {} bytes", html.len(), short.len());
    let seconds = 39_999.0 * 0.033;
    let all = events(folder.path());
    let left_out_count = all.iter().filter(|e| !matches!(e.event, Event::Picture { .. })).count() - 2000;
    let left_out = format!("{left_out_count} more: in <code>events.jsonl</code>");
    for told in ["47.3 N".to_owned(), format!("{seconds:.2} s"), left_out] {
        assert!(html.contains(&told), "{told}");
    }
    assert!(html.contains("note 0<") && html.contains("note 39992<") && !html.contains("note 20000<"));
    let document = parsed(&html);
    assert_eq!(document.descendants().filter(|n| n.has_tag_name("img")).count(), 60);
    assert!(folder.path().join("slip_000_left_100.png").exists(), "all are in the folder");
    assert_eq!(all.iter().filter(|e| matches!(e.event, Event::Note { .. })).count(), 5_000);
}

#[test]
fn a_run_without_a_cycle_or_with_one_has_a_page() {
    for count in [0, 1, 2] {
        let (_folder, html) = page(&screw::info(), &screw::cycles()[..count]);
        assert!(parsed(&html).descendants().any(|n| n.has_tag_name("h1")));
        assert_eq!(html.contains("No cycle was run"), count == 0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn no_number_breaks_the_page(numbers in proptest::collection::vec(any_number(), 60), slips in proptest::collection::vec(any::<bool>(), 40)) {
        let mut cycles = screw::cycles()[100..140].to_vec();
        for (i, (cycle, slips)) in cycles.iter_mut().zip(slips).enumerate() {
            let number = |j: usize| numbers[(7 * i + j) % numbers.len()];
            cycle.gripper.force_n = Some(number(0));
            cycle.grip_command = GripCommand::Hold { force_n: number(1) };
            cycle.wrist.angle_rad = number(2);
            cycle.margin = Some(number(3));
            cycle.hand.slip_max_mm = Some(number(4));
            cycle.hand.state = if slips { SlipState::Gross } else { SlipState::Stick };
            cycle.time_ns = if i % 9 == 8 { 0 } else { cycle.time_ns };
            if let Some(truth) = &mut cycle.truth {
                truth.required_n = Some(number(5));
                truth.torque_n_mm = Some(number(6));
            }
        }
        let cycles = screw::numbered(cycles);
        let (folder, html) = page(&screw::info(), &cycles);
        let document = parsed(&html);
        for word in ["NaN", "inf\"", "inf "] {
            prop_assert!(!html.contains(word), "{} in the page", word);
        }
        let begun = events(folder.path()).iter().filter(|e| matches!(e.event, Event::SlipBegins { .. })).count();
        let plots = marked(&document);
        prop_assert!(plots.iter().all(|marks| marks.len() == begun), "{:?} of {}", plots, begun);
    }
}

#[test]
fn a_run_that_held_to_its_end_is_not_called_broken_off() {
    let folder = tempfile::tempdir().expect("a folder");
    let cycles = &screw::cycles()[..200];
    let ends = |ending| {
        let scratch = tempfile::tempdir_in(folder.path()).expect("a folder");
        let run = written(scratch.path(), &screw::info(), cycles);
        fs::read_to_string(run.finish(&[], ending).expect("finishes")).expect("reads")
    };
    let (held, left) = (ends(Some(Ending::Held)), ends(None));
    assert!(held.contains("</b> in all") && !held.contains("until it broke off"), "{held}");
    assert!(left.contains("</b> until it broke off"), "{left}");
}

/// A tool can stand, and have been put down too hard.
#[test]
fn a_missed_target_is_told_beside_the_ending() {
    let folder = tempfile::tempdir().expect("a folder");
    let ends = |oks: &[Option<bool>]| {
        let scratch = tempfile::tempdir_in(folder.path()).expect("a folder");
        let run = written(scratch.path(), &screw::info(), &screw::cycles()[..20]);
        let row = |ok: &Option<bool>| Row { name: format!("force {ok:?}"), ok: *ok, ..Row::default() };
        let rows: Vec<Row> = oks.iter().map(row).collect();
        fs::read_to_string(run.finish(&rows, Some(Ending::Placed)).expect("finishes")).expect("reads")
    };
    let (met, missed) = (ends(&[None, Some(true)]), ends(&[Some(true), Some(false)]));
    assert!(
        met.contains("<p class=\"ending good\"><strong>Placed</strong>") && !met.contains("target missed"),
        "{met}"
    );
    assert!(missed.contains("<p class=\"ending bad\"><strong>Placed</strong>"), "{missed}");
    assert!(missed.contains("; target missed: force Some(false).</p>"), "{missed}");
}

#[test]
fn the_slip_of_a_finger_whose_pitch_is_unknown_is_shown_in_pitches() {
    let mut info = screw::info();
    info.fingers.iter_mut().for_each(|finger| finger.sensor.pitch_mm = None);
    let folder = tempfile::tempdir().expect("a folder");
    let mut run = RunFolder::create(folder.path(), &info).expect("creates");
    for (i, mut cycle) in screw::cycles().into_iter().enumerate() {
        cycle.hand.slip_max_mm = None;
        let mut report = report(SlipState::Stick, None, 0);
        report.slip.max_pitch = 0.01 * i as f64;
        run.cycle_with_reports(&cycle, &[Some(&report), None]).expect("writes");
    }
    let html = fs::read_to_string(run.finish(&[], None).expect("finishes")).expect("reads");
    let plot = html.split("<b>Slip</b>").nth(1).expect("a plot of the slip");
    assert!(plot.starts_with(", marker pitches") && !html.contains("<b>Slip</b>, mm"), "{}", &plot[..80]);
    assert!(plot.contains("largest deviation of a marker from rigid motion"), "{}", &plot[..400]);
}

/// The report of a finger in contact, with a margin and some of the 8 markers needed.
fn report(state: SlipState, margin: Option<f64>, markers_over: u32) -> SlipReport {
    SlipReport {
        seq: 0,
        time_ns: None,
        state,
        reason: None,
        contact: ContactReport::default(),
        markers: MarkerCounts::default(),
        reference_seq: 0,
        grip_n: None,
        motion: Some(MotionReport {
            reference_px: Vec2::ZERO,
            translation_px: Vec2::ZERO,
            translation_mm: None,
            rotation_rad: 0.0,
            icr_px: None,
        }),
        shear: None,
        slip: SlipSummary { markers_over, markers_needed: 8, ..SlipSummary::default() },
        estimates: Estimates {
            margin: margin.map(|value| Estimate { value, sd: 0.05, age_frames: 0 }),
            ..Estimates::default()
        },
        evidence: None,
    }
}

/// Also where every finger sticks for itself.
#[test]
fn a_card_says_which_finger_shows_the_slip_and_what_decided_it() {
    use SlipState::{Gross, Incipient, Stick};
    for (rule, left, right, expected) in [
        (
            SlipRule::Margin,
            report(Incipient, Some(0.412), 9),
            report(Stick, Some(0.62), 0),
            "left: incipient slip, margin 0.41; right: stick, margin 0.62",
        ),
        (
            SlipRule::Margin,
            report(Stick, None, 5),
            report(Gross, None, 3),
            "left: stick, 5 markers over the threshold, 8 needed; right: gross slip",
        ),
        (
            SlipRule::Markers,
            report(Stick, Some(0.412), 5),
            report(Stick, None, 4),
            "left: stick, 5 markers over the threshold, 8 needed; right: stick, 4 markers over the threshold, 8 needed; \
             half of those needed on each of two fingers mean slip",
        ),
    ] {
        let mut info = screw::info();
        info.monitor_settings.slip.rule = rule;
        let folder = tempfile::tempdir().expect("a folder");
        let mut run = RunFolder::create(folder.path(), &info).expect("creates");
        for cycle in screw::cycles() {
            run.cycle_with_reports(&cycle, &[Some(&left), Some(&right)]).expect("writes");
        }
        let html = fs::read_to_string(run.finish(&[], None).expect("finishes")).expect("reads");
        let card = html.split("<article id=\"slip-2\">").nth(1).expect("a card");
        let said = card.split("<p>").nth(1).and_then(|text| text.split("</p>").next());
        assert_eq!(said, Some(expected), "{rule:?}");
        assert!(!card.contains("seen by"), "the fingers are named instead");
    }
}

/// A blind finger has no part in it, and the events of older runs have no fingers.
#[test]
fn only_live_fingers_are_evidence_and_older_events_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut run = RunFolder::create(folder.path(), &screw::info()).expect("creates");
    let report = report(SlipState::Incipient, Some(0.4), 0);
    for mut cycle in screw::cycles() {
        cycle.hand.health[0] = Health::Blind;
        run.cycle_with_reports(&cycle, &[Some(&report), Some(&report)]).expect("writes");
    }
    run.finish(&[], None).expect("finishes");
    let slip = events(folder.path()).into_iter().find(|e| matches!(e.event, Event::SlipBegins { .. }));
    let slip = slip.expect("a slip");
    let Event::SlipBegins { fingers, .. } = &slip.event else { unreachable!() };
    assert_eq!(fingers.iter().map(|verdict| verdict.finger.as_str()).collect::<Vec<_>>(), ["right"]);
    let mut older = serde_json::to_value(&slip).expect("JSON");
    for added in ["fingers", "force_measured"] {
        assert!(older.as_object_mut().expect("an object").remove(added).is_some(), "{added}");
    }
    let older: TimedEvent = serde_json::from_value(older).expect("an event");
    assert!(matches!(older.event, Event::SlipBegins { ref fingers, .. } if fingers.is_empty()));
}
