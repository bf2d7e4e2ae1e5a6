//! report.html: curves, histograms, tables, the worst failures.

use super::pictures::{self, Failed};
use slipbound_lab::eval::coverage;
use slipbound_lab::eval::outcome::{Outcome, SCORE_BELOW, never_slides};
use slipbound_lab::eval::{Sweep, Table, TrialRecord, auc, roc};
use slipbound_lab::rivals::DETECTORS;
use slipbound_rig::html_page::{Chart, Draw, Figure, HtmlPage, Part, Series};

/// Bins of a histogram.
const BINS_COUNT: usize = 40;

/// Largest lead that the histogram shows, ms.
const MOST_LEAD_MS: f64 = 1500.0;

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
    let charts: Vec<Chart> = [
        roc_chart(records),
        histogram(records, "f_at_alarm", "Load fraction at the alarm", "f at the first alarm", 1.0),
        histogram(records, "lead_ms", "Lead", "from the alarm to gross slip, ms", MOST_LEAD_MS),
        coverage_chart(records),
    ]
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
        parts.push(Part::Table(table.columns.clone(), table.shown()));
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
    let series: Vec<Series> = detectors(records)
        .filter_map(|(name, colour)| {
            let positives = scores(name, true);
            let negatives = if all_slip { begun(name) } else { scores(name, false) };
            let area = auc(&positives, &negatives).value?;
            let points = roc(&positives, &negatives);
            Some(Series { name: format!("{name}, AUC {area:.3}"), points, draw: Draw::Line, colour })
        })
        .collect();
    (!series.is_empty()).then(|| Chart {
        title: "ROC of the highest causal score of a trial".into(),
        x_label: if all_slip { "share of the trials at f < 0.2" } else { "share of the trials without slip" }.into(),
        y_label: "share of the trials with slip".into(),
        x: (0.0, 1.0),
        y: (0.0, 1.0),
        series,
        lines_at: Vec::new(),
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
    (!series.is_empty()).then(|| Chart {
        title: "Accuracy against coverage: margins stated as less sure called unsure".into(),
        x_label: "share of the ramps that are judged".into(),
        y_label: "share of them that is right".into(),
        x: (0.0, 1.0),
        y: ((10.0 * least).floor() / 10.0 - 0.1, 1.0),
        series,
        lines_at: Vec::new(),
    })
}

/// Histogram of a number at alarms before gross slip: ours as bars, the others as lines.
fn histogram(records: &[TrialRecord], key: &str, title: &str, x_label: &str, most: f64) -> Option<Chart> {
    let width = most / BINS_COUNT as f64;
    let shares = |name: &str| -> Option<Vec<f64>> {
        let alarmed = |r: &&TrialRecord| {
            r.detector == name
                && r.truth == Some(true)
                && !never_slides(r)
                && Outcome::of(r).is_some_and(Outcome::is_before_gross)
        };
        let values: Vec<f64> = records.iter().filter(alarmed).filter_map(|r| r.number_of(key)).collect();
        let mut bins = vec![0.0; BINS_COUNT];
        for value in &values {
            bins[((value / width).max(0.0) as usize).min(BINS_COUNT - 1)] += 1.0 / values.len() as f64;
        }
        (!values.is_empty()).then_some(bins)
    };
    let mut series = Vec::new();
    for (name, colour) in detectors(records) {
        let Some(bins) = shares(name) else { continue };
        let is_ours = name == "ours";
        let edge = |n: usize| n as f64 * width + if is_ours { 0.0 } else { 0.5 * width };
        let points = bins.iter().enumerate().map(|(n, &share)| (edge(n), share)).collect();
        let draw = if is_ours { Draw::Bars(width) } else { Draw::Line };
        series.push(Series { name: name.into(), points, draw, colour });
    }
    let highest = series.iter().flat_map(|s| &s.points).map(|point| point.1).fold(0.0, f64::max);
    (!series.is_empty()).then(|| Chart {
        title: title.into(),
        x_label: x_label.into(),
        y_label: "share of the alarms before gross slip".into(),
        x: (0.0, most),
        y: (0.0, 1.08 * highest),
        series,
        lines_at: Vec::new(),
    })
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
        assert!(failures_of(&rival, 6).contains("Not judged"));
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
        let bars = histogram(&records, "f_at_alarm", "", "", 1.0).expect("an alarm in time");
        let highest = bars.series[0].points.iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("points");
        assert_eq!(*highest, (0.5125, 1.0));
        assert!(histogram(&records, "lead_ms", "", "", 1.0).is_none());
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
        let bars = |records: &[TrialRecord]| histogram(records, "f_at_alarm", "", "", 1.0).expect("an alarm").series;
        let curve = |records: &[TrialRecord]| roc_chart(records).expect("a curve").series;
        let alone = [slides.clone()];
        // In the present format, and in the older one.
        for never in [now, record(1, false)] {
            let both = [slides.clone(), never];
            assert_eq!(bars(&both)[0].points, bars(&alone)[0].points);
            assert_eq!(curve(&both)[0].name, curve(&alone)[0].name);
        }
    }
}
