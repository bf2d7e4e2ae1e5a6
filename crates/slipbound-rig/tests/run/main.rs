//! A run folder: what is written is read back, its events match what happened, and the page is self-contained.

mod events;
mod folder;
mod page;
mod screw;

use proptest::prelude::*;
use slipbound::control::Cycle;
use slipbound_rig::run::{RunFolder, RunInfo, TimedEvent};
use std::fs;
use std::path::Path;

fn written(folder: &Path, info: &RunInfo, cycles: &[Cycle]) -> RunFolder {
    let mut run = RunFolder::create(folder, info).expect("creates");
    for cycle in cycles {
        run.cycle(cycle).expect("writes");
    }
    run
}

fn events(folder: &Path) -> Vec<TimedEvent> {
    let text = fs::read_to_string(folder.join("events.jsonl")).expect("events");
    text.lines().map(|line| serde_json::from_str(line).expect("an event")).collect()
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>(),
        any::<u64>().prop_map(f64::from_bits),
        Just(f64::NAN),
        Just(f64::NEG_INFINITY),
        Just(-0.0),
        Just(10.0)
    ]
}
