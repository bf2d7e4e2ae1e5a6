//! Measures whether a gripper keeps its grip while its force is changed: up, down, up, down, with an object that may
//! fall. For a WSG-50 this is not published.

use slipbound::grip::ForceSense;
use slipbound::port::{GripCommand, GripperState, Jaws};

/// Time for the jaws to settle at a force, ns.
const SETTLE_NS: u64 = 1_500_000_000;

/// Longest time for the first grasp, ns.
const GRASP_NS: u64 = 10_000_000_000;

/// How often the force goes up and down.
const ROUNDS_COUNT: u32 = 3;

/// Deepest dip below the lower of the two forces that still counts as holding, as a fraction of it.
const DIP_FRACTION: f64 = 0.2;

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
            Jaws::Nothing | Jaws::Lost | Jaws::Stopped => {
                return failed(format!("expected the object to stay held, got jaws {}", state.jaws.name()));
            }
            _ if self.changes_count == 0 && waited_ns < GRASP_NS => return Step::Wait,
            jaws if self.changes_count == 0 => {
                return failed(format!("expected something held, got jaws {}", jaws.name()));
            }
            jaws => return failed(format!("expected the object to stay held, got jaws {}", jaws.name())),
        }
        if let Some(why) = self.watch(state) {
            return failed(why);
        }
        if waited_ns < SETTLE_NS {
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
        self.held_mm = self.held_mm.or(state.opening_mm).or(Some(0.0));
        self.changes_count += 1;
        if self.changes_count > 2 * ROUNDS_COUNT {
            return Step::Done(Verdict::Held { least_n: self.least_n, opened_mm: self.opened_mm });
        }
        self.command(now_ns)
    }

    /// What is wrong while the force changes.
    fn watch(&mut self, state: &GripperState) -> Option<String> {
        self.held_mm?; // not before the first grasp has settled
        if let Some(force_n) = state.force_n {
            let least_n = self.least_n.map_or(force_n, |least_n| least_n.min(force_n));
            self.least_n = Some(least_n);
            let floor_n = (1.0 - DIP_FRACTION) * self.low_n;
            if least_n < floor_n {
                return Some(format!("expected the force never below {floor_n:.1} N per finger, got {least_n:.1} N"));
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
