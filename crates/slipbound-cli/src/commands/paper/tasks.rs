//! The paper's tasks in simulation: grip force over time with the slips that raised it.

use crate::outcome::Failure;
use slipbound::control::{CycleObserver, CycleView};
use slipbound::monitor::Settings;
use slipbound::task::{ControllerKind, Ending, TaskSettings};
use slipbound_lab::hand::HandScene;
use slipbound_lab::lockstep::LockStep;
use slipbound_rig::html_page::{Chart, Draw, Part, Series};
use std::sync::atomic::{AtomicBool, Ordering};

/// A task, its controller, what the second line shows, and the paper's result.
struct Shown {
    scene: &'static str,
    title: &'static str,
    controller: ControllerKind,
    published: &'static str,
}

const SHOWN: [Shown; 3] = [
    Shown {
        scene: "screw",
        title: "Screwing a cap on",
        controller: ControllerKind::Paper,
        published: "from 10 N, 10 N more at each incipient slip, stops at 60 N; three of three succeeded",
    },
    Shown {
        scene: "unscrew",
        title: "Unscrewing it",
        controller: ControllerKind::Paper,
        published: "the same law, ends when the cap turns freely; three of three succeeded",
    },
    Shown {
        scene: "place",
        title: "Laying a tool down",
        controller: ControllerKind::OnSlip,
        published: "a tilted screwdriver slips rotationally when it meets the ground; the grip is lowered to lay it down",
    },
];

/// What is recorded of a run.
#[derive(Debug, Default)]
struct RunCurves {
    force_n: Vec<(f64, f64)>,
    angle_deg: Vec<(f64, f64)>,
    ground_n: Vec<(f64, f64)>,
    slips_s: Vec<f64>,
    slips_count: u32,
}

impl CycleObserver for RunCurves {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let Some(cycle) = view.cycle() else { return };
        let time_s = cycle.time_ns as f64 * 1e-9;
        self.force_n.extend(cycle.gripper.force_n.map(|force_n| (time_s, force_n)));
        let truth = cycle.truth.unwrap_or_default();
        self.angle_deg.extend(truth.cap_angle_rad.map(|rad| (time_s, rad.to_degrees())));
        self.ground_n.extend(truth.ground_force_n.map(|force_n| (time_s, force_n)));
        if cycle.slips_count > self.slips_count {
            self.slips_count = cycle.slips_count;
            self.slips_s.push(time_s);
        }
    }
}

/// A chart over the time of a run, with a dashed line at each slip.
fn chart(
    title: String,
    y_label: &str,
    points: &[(f64, f64)],
    least_most: f64,
    curves: &RunCurves,
    colour: usize,
) -> Chart {
    let end_s = curves.force_n.last().map_or(1.0, |point| point.0);
    let (low, high) =
        points.iter().fold((0.0f64, least_most), |(low, high), point| (low.min(point.1), high.max(point.1)));
    Chart {
        title,
        x_label: "time, s".into(),
        y_label: y_label.into(),
        x: (0.0, end_s),
        y: (low, 1.05 * high),
        series: vec![Series { name: y_label.into(), points: points.to_vec(), draw: Draw::Line, colour }],
        lines_at: curves.slips_s.clone(),
        ranges: Vec::new(),
    }
}

/// All tasks of the paper.
pub fn all(seed: u64, stop: &AtomicBool) -> Result<Vec<Part>, Failure> {
    let mut rows = Vec::new();
    let mut parts = vec![Part::Text("Dashed: incipient slips, as the hand saw them.".into())];
    for shown in SHOWN {
        let scene = HandScene::parse(&format!("{}?seed={seed}", shown.scene)).map_err(Failure::arguments)?;
        let task = scene.task();
        let settings = TaskSettings::default().with_controller(shown.controller);
        let mut run = LockStep::new(&scene, &settings, &Settings::default(), None).map_err(Failure::arguments)?;
        let mut curves = RunCurves::default();
        let ran = run.run(&|| stop.load(Ordering::Relaxed), &mut curves);
        ran.map_err(|error| Failure::work(&scene, error))?;
        let score = run.score();
        parts.push(Part::Chart(chart(
            format!("{}: grip force", shown.title),
            "force per finger, N",
            &curves.force_n,
            1.0,
            &curves,
            1,
        )));
        for (what, unit, points) in
            [("cap angle", "angle, deg", &curves.angle_deg), ("ground", "force on the ground, N", &curves.ground_n)]
        {
            if !points.is_empty() {
                parts.push(Part::Chart(chart(format!("{}: {what}", shown.title), unit, points, 1.0, &curves, 2)));
            }
        }
        rows.push(vec![
            shown.title.into(),
            settings.controller.to_string(),
            score.ending.map_or("not ended", Ending::name).into(),
            if score.succeeded(task) { "yes" } else { "no" }.into(),
            curves.slips_s.len().to_string(),
            format!("{:.0} N", score.most_n),
            shown.published.into(),
        ]);
    }
    let columns =
        ["task", "controller", "ended", "as it should", "slips", "largest force", "as published, on real touch"];
    parts.insert(0, Part::Table(columns.map(String::from).to_vec(), rows));
    Ok(parts)
}
