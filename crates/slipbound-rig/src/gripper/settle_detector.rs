//! When a request counts as carried out: the state is as wanted and nothing moves any more.

use slipbound::grip::ForceSense;
use slipbound::port::{GripperState, Jaws};

/// Time for which nothing may change, ns.
const SETTLED_NS: u64 = 300_000_000;

/// Change of the opening that counts as none, mm.
const SAME_OPENING_MM: f64 = 0.02;

/// Receives the time and the state of a gripper, and reports when it has settled.
#[derive(Debug, Clone, Default)]
pub struct SettleDetector {
    last: Option<(GripperState, u64)>,
    force: ForceSense,
}

impl SettleDetector {
    /// Whether the gripper is settled now. `is_done`: it has accepted the request and its state is as wanted.
    pub fn see(&mut self, now_ns: u64, state: &GripperState, is_done: bool) -> bool {
        self.force.see(now_ns, state, state.jaws != Jaws::Open);
        match &self.last {
            Some((last, since_ns)) if is_done && is_same(state, last) && self.force.is_still() => {
                now_ns.saturating_sub(*since_ns) > SETTLED_NS
            }
            _ => {
                self.last = Some((*state, now_ns));
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

    fn at(opening_mm: f64) -> GripperState {
        GripperState {
            time_ns: 0,
            force_n: None,
            force_error_n: None,
            target_n: None,
            opening_mm: Some(opening_mm),
            jaws: Jaws::Holding,
        }
    }

    #[test]
    fn settled_is_what_is_done_and_has_not_moved_for_a_while() {
        let ms = |ms: u64| ms * 1_000_000;
        let mut settled = SettleDetector::default();
        assert!(!settled.see(0, &at(50.0), false));
        assert!(!settled.see(ms(400), &at(50.0), false), "not yet done");
        assert!(!settled.see(ms(600), &at(50.0), true), "not yet for long");
        assert!(!settled.see(ms(650), &at(49.9), true), "moved");
        assert!(!settled.see(ms(950), &at(49.91), true), "300 ms are not enough");
        assert!(settled.see(ms(951), &at(49.91), true));
    }

    /// 0.3 N rms, as many motor currents have, and a force on its way.
    #[test]
    fn a_force_that_flickers_settles_and_one_on_its_way_does_not() {
        let run = |force_n: &dyn Fn(u64) -> f64| {
            let mut settled = SettleDetector::default();
            (0..400u64).find(|i| {
                let state = GripperState { time_ns: *i, force_n: Some(force_n(*i)), ..at(50.0) };
                settled.see(i * 20_000_000, &state, true)
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
        let state = GripperState { force_n: Some(20.0), ..at(28.0) };
        assert_eq!(describe(&state), "jaws holding, opening 28.00 mm, force 20.00 N per finger, asked for unknown");
    }
}
