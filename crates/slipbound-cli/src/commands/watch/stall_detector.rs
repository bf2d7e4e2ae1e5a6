//! A camera that gives no frames for a while: reported once, and again when it is back.

use crate::terminal::Terminal;

/// How long a camera has been silent.
pub struct StallDetector {
    longest_ns: u64,
    heard_ns: Option<u64>,
    is_reported: bool,
}

impl StallDetector {
    /// The longest silence of a camera that is not reported where no option says it, ms.
    pub const LONGEST_MS: u64 = 300;

    /// A silence beyond this is reported, ms.
    pub fn new(longest_ms: u64) -> Self {
        StallDetector { longest_ns: longest_ms.saturating_mul(1_000_000), heard_ns: None, is_reported: false }
    }

    /// The camera gave a frame or was silent; returns a line when there is something to report.
    pub fn see(&mut self, now_ns: u64, is_silent: bool) -> Option<String> {
        let heard_ns = *self.heard_ns.get_or_insert(now_ns);
        let silent_ns = now_ns.saturating_sub(heard_ns);
        if !is_silent {
            self.heard_ns = Some(now_ns);
            let was_reported = std::mem::take(&mut self.is_reported);
            return was_reported.then(|| format!("frames again after {:.1} s", silent_ns as f64 * 1e-9));
        }
        if self.is_reported || silent_ns <= self.longest_ns {
            return None;
        }
        self.is_reported = true;
        Some(format!("no frame for {:.1} s", silent_ns as f64 * 1e-9))
    }

    /// The same, told on standard error.
    pub fn note(&mut self, source: &str, now_ns: u64, is_silent: bool, terminal: &Terminal) {
        self.see(now_ns, is_silent).iter().for_each(|line| terminal.note(&format!("{source}: {line}")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stall_is_told_once_and_its_end_with_its_length() {
        let mut stalls = StallDetector::new(300);
        let ms = |ms: u64| ms * 1_000_000;
        assert_eq!((stalls.see(ms(0), false), stalls.see(ms(300), true)), (None, None));
        assert_eq!(stalls.see(ms(400), true), Some("no frame for 0.4 s".into()));
        assert_eq!(stalls.see(ms(500), true), None);
        assert_eq!(stalls.see(ms(2000), false), Some("frames again after 2.0 s".into()));
        assert_eq!((stalls.see(ms(2033), false), stalls.see(ms(2100), true)), (None, None));
    }
}
