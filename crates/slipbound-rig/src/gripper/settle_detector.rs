//! When a request counts as carried out: the state is as wanted and nothing moves any more.

use slipbound::grip::ForceSense;
use slipbound::port::{GripperState, Jaws};

/// Time for which nothing may change, ns.
const SETTLED_NS: u64 = 300_000_000;

/// How many new messages must show that: a GCL gripper says in three what its state is.
const MESSAGES_COUNT: u32 = 3;

/// Change of the opening that counts as none, mm.
const SAME_OPENING_MM: f64 = 0.02;

/// Receives the state of a gripper, and reports when it has settled. Time counts by the states: one that is read again
/// and again because the next is late shows nothing of what became of the request.
#[derive(Debug, Clone, Default)]
pub struct SettleDetector {
    /// The state since which nothing has changed.
    since: Option<GripperState>,
    /// Messages since then, and the time of the newest, ns.
    messages_count: u32,
    newest_ns: u64,
    force: ForceSense,
}

impl SettleDetector {
    /// Whether the gripper is settled now. `is_done`: it has accepted the request and its state is as wanted.
    pub fn see(&mut self, state: &GripperState, is_done: bool) -> bool {
        self.force.see(state.time_ns, state, state.jaws != Jaws::Open);
        self.messages_count += u32::from(state.time_ns != self.newest_ns);
        self.newest_ns = state.time_ns;
        match &self.since {
            Some(since) if is_done && is_same(state, since) && self.force.is_still() => {
                state.time_ns.saturating_sub(since.time_ns) > SETTLED_NS && self.messages_count >= MESSAGES_COUNT
            }
            _ => {
                (self.since, self.messages_count) = (Some(*state), 0);
                false
            }
        }
    }
}

fn is_same(a: &GripperState, b: &GripperState) -> bool {
    let near = |a: Option<f64>, b: Option<f64>, most: f64| a.zip(b).is_none_or(|(a, b)| (a - b).abs() < most);
    a.jaws == b.jaws && near(a.opening_mm, b.opening_mm, SAME_OPENING_MM)
}

/// The state of a gripper in words.
pub fn describe(state: &GripperState) -> String {
    let known = |value: Option<f64>, unit| value.map_or("unknown".into(), |value| format!("{value:.2} {unit}"));
    format!(
        "jaws {}, opening {}, force {}, asked for {}",
        state.jaws.name(),
        known(state.opening_mm, "mm"),
        known(state.force_n, "N per finger"),
        known(state.target_n, "N per finger"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time_ms: u64, opening_mm: f64) -> GripperState {
        GripperState {
            time_ns: time_ms * 1_000_000,
            force_n: None,
            force_error_n: None,
            target_n: None,
            opening_mm: Some(opening_mm),
            jaws: Jaws::Holding,
        }
    }

    #[test]
    fn settled_is_what_is_done_and_has_not_moved_for_a_while() {
        let mut settled = SettleDetector::default();
        assert!(!settled.see(&at(0, 50.0), false));
        assert!(!settled.see(&at(400, 50.0), false), "not yet done");
        assert!((0..1000).all(|_| !settled.see(&at(400, 50.0), true)), "read again: nothing is known of later");
        assert!(!settled.see(&at(600, 50.0), true), "not yet for long");
        assert!(!settled.see(&at(650, 49.9), true), "moved");
        assert!(!settled.see(&at(800, 49.9), true));
        assert!(!settled.see(&at(950, 49.91), true), "300 ms are not enough");
        assert!(settled.see(&at(951, 49.91), true));
        assert!(!settled.see(&at(1000, 60.0), true), "moved");
        let late = [1400, 1800, 2200].map(|ms| settled.see(&at(ms, 60.0), true));
        assert_eq!(late, [false, false, true], "one late message of three says nothing of the opening");
    }

    /// 0.3 N rms, as many motor currents have, and a force on its way.
    #[test]
    fn a_force_that_flickers_settles_and_one_on_its_way_does_not() {
        let run = |force_n: &dyn Fn(u64) -> f64| {
            let mut settled = SettleDetector::default();
            (0..400u64).find(|i| {
                let state = GripperState { force_n: Some(force_n(*i)), ..at(20 * i, 50.0) };
                settled.see(&state, true)
            })
        };
        // +-0.52 N in an order that does not repeat: 0.3 N rms.
        let flickers = |i: u64| 20.0 + 1.04 * ((i * i * 2_654_435_761 % 1024) as f64 / 1024.0 - 0.5);
        let at = run(&flickers).expect("it settles");
        assert!(at < 100, "after {at} readings");
        assert_eq!(run(&|i| 20.0 + 0.1 * i as f64), None);
    }

    #[test]
    fn a_state_is_described_with_its_units() {
        let state = GripperState { force_n: Some(20.0), ..at(0, 28.0) };
        assert_eq!(describe(&state), "jaws holding, opening 28.00 mm, force 20.00 N per finger, asked for unknown");
    }
}
