//! report.html: curves, histograms, tables, the worst failures.

use super::pictures::{self, Failed};
use slipbound_lab::eval::coverage;
use slipbound_lab::eval::outcome::{FALSE_BELOW_FRACTION, Outcome, SCORE_BELOW, never_slides};
use slipbound_lab::eval::{Cell, Estimated, Sweep, Table, TrialRecord, auc, roc};
use slipbound_lab::rivals::DETECTORS;
use slipbound_rig::html_page::{Chart, Draw, Figure, HtmlPage, Part, Range, Series};

/// Places along the axis at which a cumulative share may rise.
const PLACES_COUNT: usize = 200;

/// Load fractions near that at which ours is to raise the alarm: half of the load that makes the object slide.
const SET_POINT: (f64, f64) = (0.45, 0.55);

/// The detector in front of the others, with a thicker line.
const SHOWN: &str = "ours";

/// The page of a sweep. `pictures_most`: how many pictures were asked for.
pub fn of(
    sweep: &Sweep,
    records: &[TrialRecord],
    tables: &[Table],
    pictures: Vec<Figure>,
    pictures_most: usize,
) -> HtmlPage {
    let settings: String = sweep.settings.iter().map(|(key, value)| format!(", {key} {value}")).collect();
    let mut parts = Vec::new();
    let detectors_count = detectors(records).count().max(1);
    let charts: Vec<Chart> = [roc_chart(records), load_chart(records), lead_chart(records), coverage_chart(records)]
        .into_iter()
        .flatten()
        .collect();
    if !charts.is_empty() {
        parts.push(Part::Heading("Curves".into()));
    }
    parts.extend(charts.into_iter().map(Part::Chart));
    for table in tables {
        parts.push(Part::Heading(table.title.clone()));
        if !table.note.is_empty() {
            parts.push(Part::Text(table.note.clone()));
        }
        parts.extend(table_parts(table));
    }
    parts.push(Part::Heading("Worst failures of ours".into()));
    match pictures.is_empty() {
        true => parts.extend(failures(&sweep.protocol, records, pictures_most)),
        false => parts.push(Part::Figures(pictures)),
    }
    let lines = records.len() / detectors_count;
    HtmlPage {
        above: "Slipbound evaluation".into(),
        title: sweep.protocol.clone(),
        below: format!(
            "seed {}, {lines} of {} trials, version {}{settings}. In brackets 95 % intervals.",
            sweep.seed, sweep.trials_count, sweep.software_version
        ),
        parts,
    }
}

/// The failures of ours by name, where there are no pictures of them.
fn failures(protocol: &str, records: &[TrialRecord], pictures_most: usize) -> Vec<Part> {
    let failed = match pictures::all(records) {
        None if records.is_empty() => return vec![Part::Text("No trials.".into())],
        None => return vec![Part::Text("Not judged: `ours` is not among the detectors.".into())],
        Some(none) if none.is_empty() => return vec![Part::Text("None.".into())],
        Some(failed) => failed,
    };
    let why = match pictures_most {
        0 => "no pictures were asked for (--pictures 0)".to_owned(),
        _ => format!("{protocol} draws no pictures of these"),
    };
    let columns = ["trial", "object", "what", "score"].map(str::to_owned).to_vec();
    let row = |failed: &Failed<'_>| {
        let record = failed.record;
        vec![record.trial.clone(), record.object.clone(), failed.what.into(), format!("{:.2}", record.score)]
    };
    vec![
        Part::Text(format!("{} of ours, the worst first; {why}.", failed.len())),
        Part::Table(columns, failed.iter().map(row).collect()),
    ]
}

/// The detectors that have records, with the numbers of their colours.
fn detectors(records: &[TrialRecord]) -> impl Iterator<Item = (&'static str, usize)> + '_ {
    let names = DETECTORS.iter().enumerate().map(|(n, entry)| (entry.name, n + 1));
    names.filter(|(name, _)| records.iter().any(|record| record.detector == *name))
}

fn roc_chart(records: &[TrialRecord]) -> Option<Chart> {
    let scores = |name: &str, truth: bool| -> Vec<f64> {
        let of = records.iter().filter(|r| r.detector == name && r.truth == Some(truth) && !never_slides(r));
        of.map(|record| record.score).collect()
    };
    // Where every trial slips in the end, its own beginning is the part in which no alarm may be raised.
    let begun = |name: &str| -> Vec<f64> {
        let of = records.iter().filter(|r| r.detector == name && !never_slides(r));
        of.filter_map(|r| r.number_of(SCORE_BELOW)).collect()
    };
    let all_slip = records.iter().filter(|r| !never_slides(r)).all(|r| r.truth == Some(true));
    let series: Vec<(&str, Series)> = detectors(records)
        .filter_map(|(name, colour)| {
            let positives = scores(name, true);
            let negatives = if all_slip { begun(name) } else { scores(name, false) };
            let area = auc(&positives, &negatives).value?;
            let points = roc(&positives, &negatives);
            Some((name, Series { name: format!("{name}, AUC {area:.3}"), points, draw: Draw::Line, colour }))
        })
        .collect();
    let series = with_ours_last(series);
    (!series.is_empty()).then(|| Chart {
        title: "ROC of the highest causal score of a trial".into(),
        x_label: if all_slip { "share of the trials at f < 0.2" } else { "share of the trials without slip" }.into(),
        y_label: "share of the trials with slip".into(),
        // A curve along the frame can be seen.
        x: (-0.02, 1.0),
        y: (0.0, 1.03),
        series,
        lines_at: Vec::new(),
        ranges: Vec::new(),
    })
}

/// Share of our correct answers against the share of the ramps that are judged.
fn coverage_chart(records: &[TrialRecord]) -> Option<Chart> {
    type Right = fn(&TrialRecord) -> Option<bool>;
    let answers: [(&str, Right); 3] = [
        ("alarm in time", coverage::in_time),
        ("kind of slip right", coverage::kind_right),
        ("margin within 0.1", coverage::margin_right),
    ];
    let of = |(n, (name, right)): (usize, (&str, Right))| {
        let points = coverage::curve(records, "ours", right);
        (!points.is_empty()).then(|| Series { name: name.into(), points, draw: Draw::Line, colour: n + 1 })
    };
    let series: Vec<Series> = answers.into_iter().enumerate().filter_map(of).collect();
    let least = series.iter().flat_map(|s| &s.points).map(|point| point.1).fold(1.0, f64::min);
    let low = (10.0 * least).floor() / 10.0 - 0.1;
    (!series.is_empty()).then(|| Chart {
        title: "Accuracy against coverage: margins stated as less sure called unsure".into(),
        x_label: "share of the ramps that are judged".into(),
        y_label: "share of them that is right".into(),
        x: (0.0, 1.0),
        // A curve along the frame can be seen.
        y: (low, 1.0 + 0.03 * (1.0 - low)),
        series,
        lines_at: Vec::new(),
        ranges: Vec::new(),
    })
}

/// Ours in front of the others, with a thicker line.
fn with_ours_last(named: Vec<(&str, Series)>) -> Vec<Series> {
    let (mut ours, others): (Vec<_>, Vec<_>) = named.into_iter().partition(|(name, _)| *name == SHOWN);
    ours.iter_mut().for_each(|(_, series)| series.draw = Draw::Thick);
    others.into_iter().chain(ours).map(|(_, series)| series).collect()
}

/// The load at the alarm.
fn load_chart(records: &[TrialRecord]) -> Option<Chart> {
    let texts =
        ["Load fraction at the alarm", "f at the first alarm, or less", "share of the alarms before gross slip"];
    let chart = cumulative(records, "f_at_alarm", texts, Some(1.0), Outcome::is_before_gross)?;
    let range = |name: &str, x, is_good| Range { name: name.into(), x, is_good };
    let ranges = vec![
        range("false: below 0.2", (0.0, FALSE_BELOW_FRACTION), false),
        range("set point of ours: 0.45 to 0.55", SET_POINT, true),
    ];
    Some(Chart { ranges, ..chart })
}

/// The lead of the alarms in time on ramps of 1 s, as in the table; where no record tells how long its ramp took, of
/// all. An alarm is no better for being false.
fn lead_chart(records: &[TrialRecord]) -> Option<Chart> {
    let tells = records.iter().any(|r| r.number_of("ramp_s").is_some());
    let is_shown = |r: &&TrialRecord| !tells || r.number_of("ramp_s") == Some(1.0);
    let shown: Vec<TrialRecord> = records.iter().filter(is_shown).cloned().collect();
    let title = if tells { "Lead on ramps of 1 s, without false alarms" } else { "Lead, without false alarms" };
    let texts = [title, "from the alarm to gross slip, ms, or less", "share of the alarms in time"];
    cumulative(&shown, "lead_ms", texts, None, |outcome| outcome == Outcome::InTime)
}

/// Share of the ramps with a certain outcome at which a number is at most that of the axis, which goes from 0 to `most`,
/// or to the largest number.
fn cumulative(
    records: &[TrialRecord],
    key: &str,
    [title, x_label, y_label]: [&str; 3],
    most: Option<f64>,
    counts: fn(Outcome) -> bool,
) -> Option<Chart> {
    let values = |name: &str| -> Vec<f64> {
        let alarmed = |r: &&TrialRecord| {
            r.detector == name && r.truth == Some(true) && !never_slides(r) && Outcome::of(r).is_some_and(counts)
        };
        records.iter().filter(alarmed).filter_map(|r| r.number_of(key)).collect()
    };
    let of: Vec<(&str, usize, Vec<f64>)> =
        detectors(records).map(|(name, colour)| (name, colour, values(name))).filter(|(.., v)| !v.is_empty()).collect();
    let most = most.unwrap_or_else(|| of.iter().flat_map(|(.., v)| v).fold(f64::MIN_POSITIVE, |a, b| a.max(*b)));
    let steps = |values: &[f64]| {
        let (mut points, mut reached) = (vec![(0.0, 0.0)], 0.0);
        for n in 0..=PLACES_COUNT {
            let x = most * n as f64 / PLACES_COUNT as f64;
            let share = values.iter().filter(|value| **value <= x).count() as f64 / values.len() as f64;
            if share > reached {
                points.extend([(x, reached), (x, share)]);
                reached = share;
            }
        }
        points.push((most, reached));
        points
    };
    let series = of.iter().map(|(name, colour, values)| {
        (*name, Series { name: (*name).into(), points: steps(values), draw: Draw::Line, colour: *colour })
    });
    (!of.is_empty()).then(|| Chart {
        title: title.into(),
        x_label: x_label.into(),
        y_label: y_label.into(),
        x: (0.0, most),
        y: (0.0, 1.03),
        series: with_ours_last(series.collect()),
        lines_at: Vec::new(),
        ranges: Vec::new(),
    })
}

/// A table; a sentence instead of its column of coverages where all of them are 100 %. A rival has none.
pub fn table_parts(table: &Table) -> Vec<Part> {
    let (mut columns, mut rows) = (table.columns.clone(), table.shown());
    // Not by its text, which rounds 99.96 % up.
    let is_whole = |cell: &Cell| matches!(cell, Cell::None | Cell::Share(Estimated { value: Some(1.0) | None, .. }));
    let place = columns.iter().position(|column| column == "coverage %");
    let Some(place) = place.filter(|place| table.rows.iter().all(|row| is_whole(&row[*place]))) else {
        return vec![Part::Table(columns, rows)];
    };
    columns.remove(place);
    let coverages: Vec<String> = rows.iter_mut().map(|row| row.remove(place)).collect();
    let rows_said =
        if coverages.iter().any(|one| one == "-") { "where there is one; rivals have none" } else { "in every row" };
    vec![Part::Table(columns, rows), Part::Text(format!("Coverage: 100 % {rows_said}."))]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The part of the page about failures, as text.
    fn failures_of(records: &[TrialRecord], pictures_most: usize) -> String {
        let sweep = Sweep {
            protocol: "lifts".into(),
            seed: 0,
            trials_count: 2,
            software_version: "0".into(),
            settings: Default::default(),
        };
        let page = of(&sweep, records, &[], Vec::new(), pictures_most).to_string();
        page.split("Worst failures of ours</h2>").nth(1).expect("the heading").to_owned()
    }

    #[test]
    fn failures_without_pictures_are_listed_and_none_are_said_only_where_all_is_right() {
        let record = |trial: &str, truth: bool, verdict: bool| TrialRecord {
            number: 0,
            trial: trial.into(),
            object: "cup".into(),
            detector: "ours".into(),
            truth: Some(truth),
            verdict,
            score: 0.25,
            first_alarm_frame: verdict.then_some(7),
            more: Default::default(),
        };
        let right = [record("cup_1", true, true), record("cup_2", false, false)];
        assert!(failures_of(&right, 6).contains("None."));
        let wrong = [record("cup_1", true, false), record("cup_2", false, true)];
        let listed = failures_of(&wrong, 6);
        assert!(!listed.contains("None.") && listed.contains("lifts draws no pictures"), "{listed}");
        assert!(listed.contains("<td>cup_1</td><td>cup</td><td>missed</td><td>0.25</td>"), "{listed}");
        assert!(listed.contains("<td>cup_2</td><td>cup</td><td>false alarm</td>"), "{listed}");
        assert!(failures_of(&wrong, 0).contains("--pictures 0"));
        let unlabelled = [TrialRecord { truth: None, ..record("cup_1", true, true) }];
        assert!(failures_of(&unlabelled, 6).contains("None."));
        let rival = [TrialRecord { detector: "paper".into(), ..record("cup_1", true, false) }];
        assert!(failures_of(&rival, 6).contains("Not judged") && failures_of(&[], 6).contains("No trials."));
    }

    #[test]
    fn a_page_has_curves_for_those_who_have_records() {
        let record = |number: u64, truth: bool, score: f64| TrialRecord {
            number,
            trial: format!("t{number}"),
            object: "scissors".into(),
            detector: "paper".into(),
            truth: Some(truth),
            verdict: truth,
            score,
            first_alarm_frame: None,
            more: Default::default(),
        };
        let records = [record(0, true, 2.0).with("outcome", "in_time").with("f_at_alarm", 0.5), record(1, false, 1.0)];
        let chart = roc_chart(&records).expect("both kinds");
        assert_eq!(chart.series.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["paper, AUC 1.000"]);
        let share = load_chart(&records).expect("an alarm in time");
        assert_eq!(share.series[0].points, [(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (1.0, 1.0)]);
        assert!(lead_chart(&records).is_none());
    }

    #[test]
    fn a_trial_that_never_slides_is_in_no_curve() {
        let record = |number: u64, reaches_gross: bool| {
            TrialRecord {
                number,
                trial: format!("t{number}"),
                object: "scissors".into(),
                detector: "ours".into(),
                truth: Some(true),
                verdict: true,
                score: if reaches_gross { 2.0 } else { 0.5 },
                first_alarm_frame: None,
                more: Default::default(),
            }
            .with("outcome", "in_time")
            .with("reaches_gross", reaches_gross)
            .with("f_at_alarm", if reaches_gross { 0.5 } else { 8.6 })
            .with(SCORE_BELOW, 1.0)
        };
        let slides = record(0, true);
        let now = TrialRecord { truth: None, ..record(1, false) }.with("outcome", None::<&str>);
        let steps = |records: &[TrialRecord]| load_chart(records).expect("an alarm").series;
        let curve = |records: &[TrialRecord]| roc_chart(records).expect("a curve").series;
        let alone = [slides.clone()];
        // In the present format, and in the older one.
        for never in [now, record(1, false)] {
            let both = [slides.clone(), never];
            assert_eq!(steps(&both)[0].points, steps(&alone)[0].points);
            assert_eq!(curve(&both)[0].name, curve(&alone)[0].name);
        }
    }

    #[test]
    fn the_curve_of_a_detector_that_is_always_right_is_inside_the_frame() {
        let line = r#"{"number":0,"trial":"t","object":"o","detector":"ours","truth":true,"verdict":true,"score":1.0,
            "first_alarm_frame":1,"outcome":"in_time","margin_sd":0.1}"#;
        let chart = coverage_chart(&vec![TrialRecord::parse(line).expect("a record"); 20]).expect("a curve");
        assert!(chart.series[0].points.iter().all(|point| point.1 == 1.0) && chart.y.1 > 1.0, "{:?}", chart.y);
    }

    /// Leads of the ramps that the table takes, of no false alarm, none beyond the axis, and ours in front of the others.
    #[test]
    fn the_lead_is_that_of_ramps_of_one_second() {
        let record = |detector: &str, ramp_s: f64, lead_ms: f64| {
            TrialRecord {
                number: 0,
                trial: "t".into(),
                object: "scissors".into(),
                detector: detector.into(),
                truth: Some(true),
                verdict: true,
                score: 1.0,
                first_alarm_frame: None,
                more: Default::default(),
            }
            .with("outcome", "in_time")
            .with("ramp_s", ramp_s)
            .with("lead_ms", lead_ms)
        };
        let early = record("paper", 1.0, 900.0).with("outcome", "false").with("f_at_alarm", 0.1);
        let records = [record("ours", 1.0, 400.0), record("ours", 2.0, 1900.0), record("paper", 1.0, 300.0), early];
        let chart = lead_chart(&records).expect("leads");
        assert_eq!(chart.x, (0.0, 400.0), "a false alarm has no lead");
        let at_load = load_chart(&records).expect("a load").ranges;
        assert_eq!(
            at_load.iter().map(|range| (range.x, range.is_good)).collect::<Vec<_>>(),
            [((0.0, 0.2), false), (SET_POINT, true)]
        );
        let drawn: Vec<(&str, Draw)> = chart.series.iter().map(|s| (s.name.as_str(), s.draw)).collect();
        assert_eq!(drawn, [("paper", Draw::Line), ("ours", Draw::Thick)]);
        assert_eq!(chart.series[1].points, [(0.0, 0.0), (400.0, 0.0), (400.0, 1.0), (400.0, 1.0)]);
    }

    #[test]
    fn coverage_is_left_out_where_it_is_whole_everywhere() {
        let of = |count| Cell::Share(slipbound_lab::eval::share(count, 2500));
        let parts = |coverages: [Cell; 2]| {
            let mut table = Table::new("", "", &["detector", "coverage %", "AUC"]);
            table.rows.extend(coverages.map(|coverage| vec!["one".into(), coverage, Cell::Count(1)]));
            table_parts(&table)
        };
        assert!(matches!(&parts([of(2500), of(2499)])[..], [Part::Table(columns, _)] if columns.len() == 3));
        for (paper, told) in [(of(2500), "100 % in every row."), (Cell::None, "where there is one; rivals have none.")]
        {
            let [Part::Table(columns, _), Part::Text(said)] = &parts([of(2500), paper])[..] else { panic!("{told}") };
            assert!(columns.len() == 2 && said.ends_with(told), "{said}");
        }
    }
}
