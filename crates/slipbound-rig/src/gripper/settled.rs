//! When a request counts as carried out: the state is as wanted and nothing moves any more.

use slipbound::port::GripperState;

/// Time for which nothing may change, ns.
const SETTLED_NS: u64 = 300_000_000;

/// Changes below these are none: of the opening, mm, and of the force, N per finger.
const SAME_OPENING_MM: f64 = 0.02;
const SAME_FORCE_N: f64 = 0.1;

/// Told the time and the state of a gripper, says when it has settled.
#[derive(Debug, Clone, Default)]
pub struct Settled {
    last: Option<(GripperState, u64)>,
}

impl Settled {
    /// Whether the gripper is settled now. `is_done`: it has taken the request over and its state is as wanted.
    pub fn see(&mut self, now_ns: u64, state: &GripperState, is_done: bool) -> bool {
        match &self.last {
            Some((last, since_ns)) if is_done && is_same(state, last) => now_ns.saturating_sub(*since_ns) > SETTLED_NS,
            _ => {
                self.last = Some((*state, now_ns));
                false
            }
        }
    }
}

fn is_same(a: &GripperState, b: &GripperState) -> bool {
    let near = |a: Option<f64>, b: Option<f64>, most: f64| a.zip(b).is_none_or(|(a, b)| (a - b).abs() < most);
    a.jaws == b.jaws && near(a.opening_mm, b.opening_mm, SAME_OPENING_MM) && near(a.force_n, b.force_n, SAME_FORCE_N)
}

/// The state of a gripper in words.
pub fn describe(state: &GripperState) -> String {
    let known = |value: Option<f64>, unit| value.map_or("unknown".into(), |value| format!("{value:.2} {unit}"));
    format!(
        "jaws {}, opening {}, force {}, asked for {}",
        format!("{:?}", state.jaws).to_lowercase(),
        known(state.opening_mm, "mm"),
        known(state.force_n, "N per finger"),
        known(state.target_n, "N per finger"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::port::Jaws;

    fn at(opening_mm: f64) -> GripperState {
        GripperState { time_ns: 0, force_n: None, target_n: None, opening_mm: Some(opening_mm), jaws: Jaws::Holding }
    }

    #[test]
    fn settled_is_what_is_done_and_has_not_moved_for_a_while() {
        let ms = |ms: u64| ms * 1_000_000;
        let mut settled = Settled::default();
        assert!(!settled.see(0, &at(50.0), false));
        assert!(!settled.see(ms(400), &at(50.0), false), "not yet done");
        assert!(!settled.see(ms(600), &at(50.0), true), "not yet for long");
        assert!(!settled.see(ms(650), &at(49.9), true), "moved");
        assert!(!settled.see(ms(950), &at(49.91), true), "300 ms are not enough");
        assert!(settled.see(ms(951), &at(49.91), true));
    }

    #[test]
    fn a_state_is_described_with_its_units() {
        let state = GripperState { force_n: Some(20.0), ..at(28.0) };
        assert_eq!(describe(&state), "jaws holding, opening 28.00 mm, force 20.00 N per finger, asked for unknown");
    }
}
