//! Results of a simulated run for its report.

use slipbound::task::{TaskKind, TaskSettings};
use slipbound_lab::hand::HandScene;
use slipbound_lab::score::{RunScore, most_ground_n};
use slipbound_rig::run::{Row, duration};

/// The table of results. `broke_off`: why the loop ended before the task did, if it was not the end of the scene.
pub fn rows(scene: &HandScene, settings: &TaskSettings, run: &RunScore, broke_off: Option<&str>) -> Vec<Row> {
    let row = |name: &str, value: String, target: &str, ok: Option<bool>| Row {
        name: name.into(),
        value,
        target: target.into(),
        ok,
    };
    let mut rows = Vec::new();
    let right = Some(run.succeeded(scene.task()));
    let unfinished = broke_off.unwrap_or("not before the end of the scene");
    let ending = run.ending.map_or(unfinished, |ending| ending.name());
    rows.push(row("ended", ending.into(), "", right));
    if let Some(fraction) = run.torque_fraction() {
        let value = format!("{:.0} N mm, {:.0} %", run.torque_n_mm, 100.0 * fraction);
        match scene.task() {
            TaskKind::Screw => {
                let target = format!("90 % of 2 mu P R at P = {} N", settings.grip.most_n);
                rows.push(row("largest torque on the cap", value, &target, Some(fraction >= 0.9)))
            }
            _ => rows.push(row("largest torque on the cap", value, "", None)),
        }
    }
    if let Some(bottle) = &run.last.bottle {
        rows.push(row("mass at the end", format!("{:.2} kg", bottle.mass_kg), "", None));
        rows.push(row("dropped", if bottle.dropped { "yes" } else { "no" }.into(), "no", Some(!bottle.dropped)));
    }
    if let Some(ground) = &run.last.ground {
        let most_n = most_ground_n(ground.weight_n);
        let ok = Some(ground.peak_force_n <= most_n);
        rows.push(row(
            "largest force on the ground",
            format!("{:.1} N", ground.peak_force_n),
            &format!("at most {most_n:.1} N"),
            ok,
        ));
        let drop = ground.free_drop_mm.map_or("not let go".into(), |mm| format!("{mm:.2} mm"));
        rows.push(row("free drop", drop, "at most 1 mm", Some(ground.free_drop_mm.is_some_and(|mm| mm <= 1.0))));
    }
    rows.push(row("slid in the fingers", format!("{:.2} mm", run.slid_mm), "", None));
    if let Some(ratio) = run.over_squeeze_ratio() {
        rows.push(row("over-squeeze", format!("{ratio:.2}"), "", None));
    }
    rows.push(row("alarms", run.alarms_count.to_string(), "", None));
    rows.push(row(
        "largest force commanded",
        format!("{:.1} N", run.most_n),
        &format!("at most {:.1} N", settings.grip.most_n),
        Some(run.most_n <= settings.grip.most_n),
    ));
    let (lasted, until) = duration(run.ended_s, run.time_s, run.ending);
    rows.push(row(&format!("time {until}"), lasted, "", None));
    rows
}
