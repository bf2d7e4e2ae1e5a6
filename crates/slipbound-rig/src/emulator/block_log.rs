//! A block that logs forces and motions, so that another program can check a driver.

use super::block::Block;
use slipbound::plant::Plant;
use std::io::{self, Write};

/// Time between two lines of the log, ns.
const PERIOD_NS: u64 = 10_000_000;

/// A [`Block`] and a log of one JSON object every 10 ms: time of day, force, wrist, whether it is carried.
pub struct LoggedBlock<W> {
    /// The block.
    pub block: Block,
    log: Option<Log<W>>,
}

struct Log<W> {
    to: W,
    /// Time of day at time 0 of the plant, ns.
    day_ns: u64,
    due_ns: u64,
    failed_count: u64,
    first: Option<io::Error>,
}

impl<W: Write> LoggedBlock<W> {
    /// A block, logged if there is a log. `day_ns`: the time of day at time 0 of [`Plant::advance_to`], ns since 1970.
    pub fn new(block: Block, log: Option<W>, day_ns: u64) -> Self {
        let log = log.map(|to| Log { to, day_ns, due_ns: 0, failed_count: 0, first: None });
        LoggedBlock { block, log }
    }

    /// The number of lines that could not be written, if any, and why the first could not.
    pub fn failed_lines(&self) -> Option<(u64, &io::Error)> {
        self.log.as_ref().and_then(|log| Some((log.failed_count, log.first.as_ref()?)))
    }
}

impl<W: Write> Log<W> {
    /// Writes a line if one is due. One that cannot be written is counted: it does not stop the emulator.
    fn see(&mut self, now_ns: u64, block: &Block) {
        if now_ns < self.due_ns {
            return;
        }
        self.due_ns = now_ns + PERIOD_NS;
        let unix_ns = self.day_ns + now_ns;
        let Block { force_n, angle_rad, lowered_mm, is_carried, .. } = block;
        let line = format!(
            "{{\"unix_ns\":{unix_ns},\"force_n\":{force_n:.3},\"angle_rad\":{angle_rad:.6},\"lowered_mm\":{lowered_mm:.4},\"is_carried\":{is_carried}}}\n"
        );
        if let Err(error) = self.to.write_all(line.as_bytes()) {
            self.failed_count += 1;
            self.first.get_or_insert(error);
        }
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
        if let Some(log) = &mut self.log {
            log.see(now_ns, &self.block);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_written_every_10_ms() {
        let mut block = LoggedBlock::new(Block::new(28.0), Some(Vec::new()), 1_000);
        for ms in 0..25 {
            block.press(ms as f64);
            block.advance_to(ms * 1_000_000);
        }
        let log = String::from_utf8(block.log.expect("a log").to).expect("UTF-8");
        let lines: Vec<serde_json::Value> = log.lines().map(|l| serde_json::from_str(l).expect("JSON")).collect();
        let forces_n: Vec<Option<f64>> = lines.iter().map(|line| line["force_n"].as_f64()).collect();
        let times_ns: Vec<Option<u64>> = lines.iter().map(|line| line["unix_ns"].as_u64()).collect();
        assert_eq!(times_ns, [Some(1_000), Some(10_001_000), Some(20_001_000)]);
        assert_eq!(forces_n, [Some(0.0), Some(10.0), Some(20.0)]);
        assert_eq!((&lines[0]["is_carried"], &lines[1]["is_carried"]), (&false.into(), &true.into()));
    }

    /// Takes one line.
    struct Full(bool);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            match std::mem::replace(&mut self.0, true) {
                true => Err(io::Error::other("full")),
                false => Ok(bytes.len()),
            }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn lines_that_cannot_be_written_are_counted() {
        let mut block = LoggedBlock::new(Block::new(28.0), Some(Full(false)), 0);
        block.advance_to(0);
        assert!(block.failed_lines().is_none());
        block.advance_to(10_000_000);
        block.advance_to(20_000_000);
        let (count, first) = block.failed_lines().expect("failed");
        assert_eq!((count, first.to_string().as_str()), (2, "full"));
    }
}
