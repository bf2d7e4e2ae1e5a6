//! CPU time of a trial of an evaluation: a few trials of a protocol with all detectors, one after the other on one
//! thread. `cargo run --release -p slipbound-lab --example eval_cost -- table1 8`.

use slipbound_lab::eval::simulated;
use slipbound_lab::rivals::DETECTORS;
use std::time::{Duration, Instant};

/// CPU time of this thread; wall-clock time if the system does not provide it.
fn ran(start: Instant) -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let told = text.split_whitespace().next().and_then(|first| first.parse().ok());
    told.map_or_else(|| start.elapsed(), Duration::from_nanos)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "table1".into());
    let trials_count = arguments.next().map_or(Ok(8), |text| text.parse())?;
    let protocol = simulated(&name, 1, Some(trials_count))?;
    let detectors: Vec<_> = DETECTORS.iter().collect();
    let start = Instant::now();
    let (before, mut records) = (ran(start), String::new());
    for number in 0..protocol.trials_count() {
        for record in protocol.judge(number, &detectors)? {
            records += &record.line()?;
        }
    }
    // FNV-1a of the records: equal before and after a change that leaves every frame unchanged.
    let sum = records
        .bytes()
        .fold(0xCBF2_9CE4_8422_2325u64, |sum, byte| (sum ^ u64::from(byte)).wrapping_mul(0x100_0000_01B3));
    let trial_s = (ran(start) - before).as_secs_f64() / protocol.trials_count() as f64;
    println!("{name}: {} trials, {trial_s:.2} s of one core a trial, records {sum:016x}", protocol.trials_count());
    Ok(())
}
