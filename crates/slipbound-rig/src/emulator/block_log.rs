//! A block that logs forces and motions, so that another program can check a driver.

use super::block::Block;
use slipbound::plant::Plant;
use std::io::Write;
use std::time::{SystemTime, UNIX_EPOCH};

/// Time between two lines of the log, ns.
const PERIOD_NS: u64 = 10_000_000;

/// A [`Block`] and a log of one JSON object every 10 ms: time of day, force, wrist, whether it is carried.
pub struct LoggedBlock<W> {
    /// The block.
    pub block: Block,
    log: Option<W>,
    due_ns: u64,
}

impl<W: Write> LoggedBlock<W> {
    /// A block, logged if there is a log.
    pub fn new(block: Block, log: Option<W>) -> Self {
        LoggedBlock { block, log, due_ns: 0 }
    }
}

impl<W: Write> Plant for LoggedBlock<W> {
    fn width_mm(&self) -> Option<f64> {
        self.block.width_mm()
    }

    fn press(&mut self, force_n: f64) {
        self.block.press(force_n);
    }

    fn place_wrist(&mut self, angle_rad: f64, lowered_mm: f64) {
        self.block.place_wrist(angle_rad, lowered_mm);
    }

    fn advance_to(&mut self, now_ns: u64) {
        self.block.advance_to(now_ns);
        let (Some(log), true) = (&mut self.log, now_ns >= self.due_ns) else { return };
        self.due_ns = now_ns + PERIOD_NS;
        let unix_ns = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64);
        let Block { force_n, angle_rad, lowered_mm, is_carried, .. } = self.block;
        // A log that cannot be written does not stop the emulator.
        let _ = writeln!(
            log,
            "{{\"unix_ns\":{unix_ns},\"force_n\":{force_n:.3},\"angle_rad\":{angle_rad:.6},\"lowered_mm\":{lowered_mm:.4},\"is_carried\":{is_carried}}}"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_written_every_10_ms() {
        let mut block = LoggedBlock::new(Block::new(28.0), Some(Vec::new()));
        for ms in 0..25 {
            block.press(ms as f64);
            block.advance_to(ms * 1_000_000);
        }
        let log = String::from_utf8(block.log.expect("a log")).expect("UTF-8");
        let lines: Vec<serde_json::Value> = log.lines().map(|l| serde_json::from_str(l).expect("JSON")).collect();
        let forces_n: Vec<Option<f64>> = lines.iter().map(|line| line["force_n"].as_f64()).collect();
        assert_eq!(forces_n, [Some(0.0), Some(10.0), Some(20.0)]);
        assert_eq!((&lines[0]["is_carried"], &lines[1]["is_carried"]), (&false.into(), &true.into()));
    }
}
