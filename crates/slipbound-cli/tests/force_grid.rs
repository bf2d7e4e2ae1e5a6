//! A lift with a gripper whose force readings are wrong, over a grid of bias, gain and noise: `docs/force-grid.md`. In
//! lock-step through driver and emulator, so the same every time.
//! `REGENERATE=1 cargo test -p slipbound-cli --test force_grid` runs the whole grid and writes the file again; without
//! it a few of its cells are run and compared.

mod program;

use program::{command, printed};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

const HEAD: &str = "# A lift with a gripper whose force reads wrong\n\n\
    A bottle is lifted with 10 N per finger and filled, through the driver of a WSG-50 and its emulator, whose\n\
    force sensor has a bias, a gain and noise; one finger with a camera, seed 1, held for three and a half seconds, in which it\n\
    gets so heavy that 10 N do not carry it. *slip unanswered*: longest time for which the object slid and no higher force was\n\
    commanded. *most*: largest force commanded, N per finger. The text interface (gcl) takes no other force while it holds: there\n\
    the 10 N stay, and the bottle slides out. Written by `REGENERATE=1 cargo test -p slipbound-cli --test force_grid`.\n\n\
    | gripper | bias N | gain | noise N rms | outcome | slip unanswered s | most N | slid mm |\n|---|---|---|---|---|---|---|---|\n";

/// Faults of a sensor other than those of the grid.
const OTHERS: [&str; 6] = ["idle=4", "idle=9", "step=2", "drift=0.2", "lag=150", "late-every=5"];

struct Cell {
    gripper: &'static str,
    /// The first columns, then the faults.
    row: String,
    fault: String,
}

fn cells() -> Vec<Cell> {
    let mut cells = Vec::new();
    for bias in ["-3", "0", "3"] {
        for gain in ["0.85", "1", "1.15"] {
            for noise in ["0", "1", "2"] {
                let fault = format!("bias={bias},gain={gain},noise={noise},seed=1");
                cells.push(Cell { gripper: "wsg50", row: format!("wsg50 | {bias} | {gain} | {noise}"), fault });
            }
        }
    }
    for other in OTHERS {
        cells.push(Cell { gripper: "wsg50", row: format!("wsg50, {other} | 0 | 1 | 0"), fault: other.into() });
    }
    for gripper in ["gcl", "line"] {
        let fault = "bias=-3,gain=0.85,noise=2,seed=1".into();
        cells.push(Cell { gripper, row: format!("{gripper} | -3 | 0.85 | 2"), fault });
    }
    cells
}

/// Runs a cell; returns its row.
fn row(cell: &Cell, scratch: &Path, number: usize) -> String {
    let (run, settings) = (scratch.join(format!("run{number}")), scratch.join("settings.toml"));
    let output = command(&[
        "demo",
        "--fingers",
        "1",
        "--task",
        "lift",
        "--set",
        "fill_after_s=2",
        "--set",
        "fill_kg_per_s=0.5",
        "--emulated",
        cell.gripper,
        "--gripper-fault",
        &cell.fault,
    ])
    .args([Path::new("--settings"), &settings, Path::new("-o"), &run])
    .output()
    .expect("runs");
    let told = printed(&output);
    let cycles: Vec<Value> = fs::read_to_string(run.join("reports.jsonl"))
        .expect("reports")
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect();
    let (mut slides_since, mut longest_s, mut most_n, mut slid_mm) = (None, 0.0f64, 0.0f64, 0.0f64);
    let mut before_n = 0.0;
    for cycle in &cycles {
        let now_s = cycle["time_ns"].as_f64().expect("a time") * 1e-9;
        let force_n = cycle["grip_command"]["force_n"].as_f64().unwrap_or(before_n);
        let slides = cycle["truth"]["gross"] == true;
        slid_mm = cycle["truth"]["slid_mm"].as_f64().unwrap_or(slid_mm);
        most_n = most_n.max(force_n);
        slides_since = slides.then(|| slides_since.filter(|_| force_n <= before_n).unwrap_or(now_s));
        longest_s = longest_s.max(slides_since.map_or(0.0, |since_s| now_s - since_s));
        before_n = force_n;
    }
    let phase = cycles.last().map_or(&Value::Null, |cycle| &cycle["phase"]);
    let ended = phase["ending"].as_str().or(phase["phase"].as_str()).unwrap_or("nothing").to_owned();
    // Never: exit 0 with nothing held.
    let is_done = output.status.success();
    assert!(!is_done || ended == "held" && slid_mm < 15.0, "{}: exit 0, but {ended}: {told}", cell.fault);
    let outcome = match is_done {
        true => "held".into(),
        false => {
            let why = told.lines().rfind(|line| line.starts_with("slipbound: ")).expect("a reason");
            format!("failed: {}", why.trim_start_matches("slipbound: "))
        }
    };
    format!("| {} | {outcome} | {longest_s:.2} | {most_n:.0} | {slid_mm:.1} |", cell.row)
}

#[test]
fn a_force_that_reads_wrong_is_held_on_with_or_refused_with_a_reason() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs/force-grid.md");
    let regenerates = std::env::var_os("REGENERATE").is_some();
    let cells = cells();
    // The two corners that are furthest from the truth, an idle reading, and a gripper that accepts no other force.
    let wanted: Vec<usize> = if regenerates { (0..cells.len()).collect() } else { vec![2, 26, 27, cells.len() - 2] };
    let scratch = tempfile::tempdir().expect("a folder");
    fs::write(scratch.path().join("settings.toml"), "[lift]\nhold_ns = 3500000000\n").expect("written");
    let (next, rows) = (AtomicUsize::new(0), Mutex::new(vec![String::new(); wanted.len()]));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let place = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&cell) = wanted.get(place) else { return };
                    let row = row(&cells[cell], scratch.path(), cell);
                    rows.lock().expect("no run panicked")[place] = row;
                }
            });
        }
    });
    let rows = rows.into_inner().expect("no run panicked");
    if regenerates {
        fs::write(&path, format!("{HEAD}{}\n", rows.join("\n"))).expect("docs can be written");
    }
    let expected = fs::read_to_string(&path).expect("docs/force-grid.md is there");
    for row in rows {
        assert!(expected.contains(&row), "not in docs/force-grid.md: {row}");
    }
}
