//! A wrist that meets the contract of its port: no motion goes further or lasts longer than its command allows.

use crate::port::{FASTEST_TURN_RAD_PER_S, LONGEST_TIME_TO_LIVE_NS, WristCommand, WristMotion, WristState};

/// Maximum rate of lowering or lifting that a command may request, mm/s.
const FASTEST_MM_PER_S: f64 = 100.0;

/// The state of a wrist. It starts and stops instantly: acceleration is not modelled.
#[derive(Debug, Clone)]
pub struct WristDrive {
    now_ns: u64,
    angle_rad: f64,
    lowered_mm: f64,
    running: Option<Running>,
}

/// A motion in progress, along one of the two axes of a wrist.
#[derive(Debug, Clone, Copy)]
struct Running {
    turns: bool,
    rate_per_s: f64,
    left: f64,
    until_ns: u64,
}

impl Default for WristDrive {
    fn default() -> Self {
        WristDrive::new()
    }
}

impl WristDrive {
    /// At rest, at time 0.
    pub fn new() -> Self {
        WristDrive { now_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, running: None }
    }

    /// Accepts a command. False when it is refused because a number in it is not finite, a bound is negative or a rate
    /// exceeds the limit of the wrist, which then pauses.
    pub fn command(&mut self, command: WristCommand) -> bool {
        self.running = None;
        let (turns, rate_per_s, left, fastest) = match command.motion {
            WristMotion::Turn { rate_rad_per_s, most_rad } => (true, rate_rad_per_s, most_rad, FASTEST_TURN_RAD_PER_S),
            WristMotion::Lower { rate_mm_per_s, most_mm } => (false, rate_mm_per_s, most_mm, FASTEST_MM_PER_S),
            WristMotion::Pause => return true,
        };
        if !(rate_per_s.abs() <= fastest && left.is_finite() && left >= 0.0) {
            return false;
        }
        let until_ns = self.now_ns + command.time_to_live_ns.min(LONGEST_TIME_TO_LIVE_NS);
        self.running = Some(Running { turns, rate_per_s, left, until_ns });
        true
    }

    /// Advances the time to `now_ns`.
    pub fn advance_to(&mut self, now_ns: u64) {
        let from_ns = self.now_ns;
        self.now_ns = from_ns.max(now_ns);
        let Some(running) = &mut self.running else { return };
        let elapsed_s = self.now_ns.min(running.until_ns).saturating_sub(from_ns) as f64 * 1e-9;
        let way = (running.rate_per_s.abs() * elapsed_s).min(running.left);
        running.left -= way;
        let way = way.copysign(running.rate_per_s);
        if running.turns {
            self.angle_rad += way;
        } else {
            self.lowered_mm += way;
        }
        if running.left <= 0.0 || self.now_ns >= running.until_ns {
            self.running = None;
        }
    }

    /// Its present state.
    pub fn state(&self) -> WristState {
        WristState {
            time_ns: self.now_ns,
            angle_rad: self.angle_rad,
            lowered_mm: self.lowered_mm,
            moving: self.running.is_some(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn turn(rate_rad_per_s: f64, most_rad: f64) -> WristCommand {
        WristCommand::new(WristMotion::Turn { rate_rad_per_s, most_rad })
    }

    #[test]
    fn a_motion_that_is_not_renewed_pauses_after_its_time_to_live() {
        let mut wrist = WristDrive::new();
        assert!(wrist.command(turn(-0.5, 1.0)));
        wrist.advance_to(150 * MS);
        assert!((wrist.state().angle_rad + 0.075).abs() < 1e-12 && wrist.state().moving);
        wrist.advance_to(900 * MS);
        assert!((wrist.state().angle_rad + 0.1).abs() < 1e-12 && !wrist.state().moving, "{:?}", wrist.state());
    }

    #[test]
    fn no_motion_goes_further_than_it_may() {
        let mut wrist = WristDrive::new();
        wrist.command(turn(0.5, 0.02));
        wrist.advance_to(199 * MS);
        assert!((wrist.state().angle_rad - 0.02).abs() < 1e-12);
        // The wrist must support every rate that a task may request.
        assert!(wrist.command(turn(-FASTEST_TURN_RAD_PER_S, 0.0)));
        let too_fast = 1.01 * FASTEST_TURN_RAD_PER_S;
        for (rate, most) in [(f64::NAN, 1.0), (0.1, f64::INFINITY), (too_fast, 1.0), (0.1, -1.0)] {
            assert!(!wrist.command(turn(rate, most)), "{rate} {most}");
        }
        wrist.advance_to(400 * MS);
        assert!((wrist.state().angle_rad - 0.02).abs() < 1e-12 && !wrist.state().moving);
    }
}
