//! Measures whether a gripper keeps its grip while its force is changed: up, down, up, down, with an object that may
//! fall. For a WSG-50 this is not published.

use slipbound::grip::ForceSense;
use slipbound::port::{GripCommand, GripperState, Jaws};

/// Time for jaws that hold to settle at a force, ns.
const SETTLE_NS: u64 = 1_500_000_000;

/// Longest time for the first grasp, ns.
const GRASP_NS: u64 = 10_000_000_000;

/// Longest time until jaws that are told to grasp report that they close, ns.
const BEGIN_NS: u64 = 1_000_000_000;

/// How often the force goes up and down.
const ROUNDS_COUNT: u32 = 3;

/// Deepest dip below the lower of the two forces that still counts as holding, as a fraction of it.
const DIP_FRACTION: f64 = 0.2;

/// How far below that floor a dip must be to count at once, in standard deviations of the reading. One that is less deep
/// counts as soon as the force stands there.
const DIP_SD: f64 = 3.0;

/// Largest difference between a force and its measurement after settling, as a fraction of it.
const REACH_FRACTION: f64 = 0.2;

/// Furthest the jaws may open meanwhile, mm.
const OPENED_MM: f64 = 0.3;

/// What to do next.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// Give this command.
    Command(GripCommand),
    /// Wait.
    Wait,
    /// It is over.
    Done(Verdict),
}

/// The result.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// It kept its grip during every change.
    Held {
        /// Least force measured after the first grasp had settled, N per finger; None where it measures none.
        least_n: Option<f64>,
        /// How far the jaws opened, mm; None where they do not say.
        opened_mm: Option<f64>,
    },
    /// It did not, or that could not be determined.
    Failed {
        /// What was expected and what was got.
        why: String,
    },
}

/// The trial as a state machine that receives the time and the state of the gripper.
#[derive(Debug)]
pub struct CheckHold {
    low_n: f64,
    high_n: f64,
    changes_count: u32,
    since_ns: Option<u64>,
    /// Since when they hold, ns.
    holding_ns: Option<u64>,
    held_mm: Option<f64>,
    least_n: Option<f64>,
    opened_mm: Option<f64>,
    force: ForceSense,
}

impl CheckHold {
    /// Alternates between these forces, N per finger.
    pub fn new(low_n: f64, high_n: f64) -> Self {
        let (low_n, high_n) = (low_n.min(high_n), low_n.max(high_n));
        CheckHold {
            low_n,
            high_n,
            changes_count: 0,
            since_ns: None,
            holding_ns: None,
            held_mm: None,
            least_n: None,
            opened_mm: None,
            force: ForceSense::default(),
        }
    }

    fn force_n(&self) -> f64 {
        if self.changes_count.is_multiple_of(2) { self.low_n } else { self.high_n }
    }

    fn command(&mut self, now_ns: u64) -> Step {
        self.since_ns = Some(now_ns);
        Step::Command(GripCommand::Hold { force_n: self.force_n() })
    }

    /// What to do now.
    pub fn step(&mut self, now_ns: u64, state: &GripperState) -> Step {
        let state = &self.force.see(now_ns, state, self.since_ns.is_some());
        let Some(since_ns) = self.since_ns else { return self.command(now_ns) };
        let waited_ns = now_ns.saturating_sub(since_ns);
        let failed = |why: String| Step::Done(Verdict::Failed { why });
        match state.jaws {
            Jaws::Holding => {}
            // A failed grasp from before stays reported until this one has begun.
            Jaws::Nothing | Jaws::Lost if self.holding_ns.is_none() && waited_ns < BEGIN_NS => return Step::Wait,
            Jaws::Open | Jaws::Closing | Jaws::Unknown if self.changes_count == 0 && waited_ns < GRASP_NS => {
                return Step::Wait;
            }
            // It presses anew what it holds.
            Jaws::Closing if self.holding_ns.is_some() && waited_ns < SETTLE_NS => {
                return self.watch(state).map_or(Step::Wait, failed);
            }
            jaws if self.holding_ns.is_none() => {
                return failed(format!("expected something between the jaws to hold, got jaws {}", jaws.name()));
            }
            jaws => return failed(format!("expected the object to stay held, got jaws {}", jaws.name())),
        }
        if let Some(why) = self.watch(state) {
            return failed(why);
        }
        // The first grasp begins with the way to the object.
        let holding_ns = *self.holding_ns.get_or_insert(now_ns);
        if now_ns.saturating_sub(since_ns.max(holding_ns)) < SETTLE_NS {
            return Step::Wait;
        }
        let (asked_n, reach_n) = (self.force_n(), REACH_FRACTION * self.force_n());
        if let Some(got_n) = state.force_n.filter(|got_n| (got_n - asked_n).abs() > reach_n) {
            return failed(format!(
                "expected {asked_n} N per finger to be reached within {reach_n:.1} N, got {got_n:.1} N"
            ));
        }
        if state.target_n.is_none_or(|target_n| (target_n - asked_n).abs() > reach_n) {
            let got = state.target_n.map_or("an unknown force".into(), |target_n| format!("{target_n} N"));
            return failed(format!("expected {asked_n} N to be taken over, got {got}"));
        }
        self.held_mm = self.held_mm.or(state.opening_mm);
        self.changes_count += 1;
        if self.changes_count > 2 * ROUNDS_COUNT {
            return Step::Done(Verdict::Held { least_n: self.least_n, opened_mm: self.opened_mm });
        }
        self.command(now_ns)
    }

    /// What is wrong while the force changes.
    fn watch(&mut self, state: &GripperState) -> Option<String> {
        if self.changes_count == 0 {
            return None; // not before the first grasp has settled
        }
        if let Some(force_n) = state.force_n {
            let least_n = self.least_n.map_or(force_n, |least_n| least_n.min(force_n));
            self.least_n = Some(least_n);
            let floor_n = (1.0 - DIP_FRACTION) * self.low_n;
            let noise_n = if self.force.is_still() { 0.0 } else { DIP_SD * self.force.noise_n() };
            if force_n < floor_n - noise_n {
                return Some(format!("expected the force never below {floor_n:.1} N per finger, got {force_n:.1} N"));
            }
        }
        if let (Some(held_mm), Some(now_mm)) = (self.held_mm, state.opening_mm) {
            let opened_mm = (now_mm - held_mm).max(self.opened_mm.unwrap_or(0.0));
            self.opened_mm = Some(opened_mm);
            if opened_mm > OPENED_MM {
                return Some(format!("expected the jaws to open by at most {OPENED_MM} mm, got {opened_mm:.2} mm"));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The verdict on a gripper that follows at once, whose readings scatter by `noise_n`, and whose force falls to
    /// `dip_n` for so many readings when it is lowered.
    fn verdict(noise_n: f64, dip_n: f64, dip_count: u32) -> Verdict {
        let (mut trial, mut target_n, mut since_count, mut random) = (CheckHold::new(20.0, 30.0), 20.0, 0, 7u64);
        for message in 0.. {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let scatter = 12f64.sqrt() * ((random >> 11) as f64 / (1u64 << 53) as f64 - 0.5);
            let dips = trial.changes_count == 2 && since_count < dip_count;
            let state = GripperState {
                time_ns: message * 20_000_000,
                force_n: Some(if dips { dip_n } else { target_n } + noise_n * scatter),
                force_error_n: Some(1.5 + 0.15 * target_n),
                target_n: Some(target_n),
                opening_mm: Some(50.0),
                jaws: Jaws::Holding,
            };
            since_count += 1;
            match trial.step(state.time_ns, &state) {
                Step::Command(command) => (target_n, since_count) = (command.force_n().expect("a hold"), 0),
                Step::Wait => {}
                Step::Done(verdict) => return verdict,
            }
        }
        unreachable!("the trial ends");
    }

    #[test]
    fn a_dip_is_found_at_once_and_under_noise_where_it_is_deeper_or_stands() {
        assert!(matches!(verdict(0.0, 20.0, 0), Verdict::Held { .. }));
        assert!(matches!(verdict(1.0, 20.0, 0), Verdict::Held { .. }));
        for (noise_n, dip_n, dip_count) in [(0.0, 15.5, 1), (1.0, 6.0, 10), (1.0, 14.0, 40)] {
            let found = verdict(noise_n, dip_n, dip_count);
            assert!(matches!(found, Verdict::Failed { .. }), "{noise_n} {dip_n} {dip_count}: {found:?}");
        }
    }

    /// The verdict on jaws that report a failed grasp from before for `before_ms`, then what comes of this one.
    fn verdict_after_failed_grasp(before_ms: u64, then: Jaws) -> Verdict {
        let mut trial = CheckHold::new(20.0, 30.0);
        let mut target_n = 20.0;
        for ms in (0..20_000u64).step_by(20) {
            let jaws = if ms < before_ms { Jaws::Nothing } else { then };
            let state = GripperState {
                time_ns: ms * 1_000_000,
                force_n: Some(if jaws == Jaws::Holding { target_n } else { 0.0 }),
                force_error_n: Some(1.5 + 0.15 * target_n),
                target_n: Some(target_n),
                opening_mm: Some(50.0),
                jaws,
            };
            match trial.step(state.time_ns, &state) {
                Step::Command(command) => target_n = command.force_n().expect("a hold"),
                Step::Wait => {}
                Step::Done(verdict) => return verdict,
            }
        }
        unreachable!("the trial ends");
    }

    /// The verdict on jaws that report `closing` for so long after each new force, and tell their opening from the
    /// second force on.
    fn verdict_while_closing(closing_ms: u64) -> Verdict {
        let (mut trial, mut target_n, mut since_ms) = (CheckHold::new(20.0, 30.0), 20.0, 0);
        for ms in (0..40_000u64).step_by(20) {
            let state = GripperState {
                time_ns: ms * 1_000_000,
                force_n: None,
                force_error_n: None,
                target_n: Some(target_n),
                opening_mm: (trial.changes_count > 0).then_some(50.0),
                jaws: if ms - since_ms < closing_ms { Jaws::Closing } else { Jaws::Holding },
            };
            match trial.step(state.time_ns, &state) {
                Step::Command(command) => (target_n, since_ms) = (command.force_n().expect("a hold"), ms),
                Step::Wait => {}
                Step::Done(verdict) => return verdict,
            }
        }
        unreachable!("the trial ends");
    }

    /// As a 2F-85 does, of which an answer may be lost.
    #[test]
    fn jaws_that_press_anew_and_an_opening_told_late_are_held() {
        let held = verdict_while_closing(300);
        assert!(matches!(held, Verdict::Held { opened_mm: Some(0.0), .. }), "{held:?}");
        let long = verdict_while_closing(30_000);
        assert!(matches!(long, Verdict::Failed { .. }), "{long:?}");
    }

    #[test]
    fn a_failed_grasp_from_before_is_no_verdict_and_nothing_was_dropped_that_was_never_held() {
        let held = verdict_after_failed_grasp(200, Jaws::Holding);
        assert!(matches!(held, Verdict::Held { .. }), "{held:?}");
        let Verdict::Failed { why } = verdict_after_failed_grasp(200, Jaws::Nothing) else { panic!("nothing is held") };
        assert_eq!(why, "expected something between the jaws to hold, got jaws nothing");
    }
}
