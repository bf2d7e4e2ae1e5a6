//! What a task asks of a gripper, fitted to what this gripper can and may do.

use anyhow::bail;
use slipbound::task::{TaskKind, TaskSettings};
use slipbound_rig::gripper::Config;
use slipbound_rig::gripper::config::Lowering;

/// The settings with every force inside the gripper's range; what changed, in words. Refuses a task that this gripper
/// must not do: laying down needs a looser grip.
pub fn fit(settings: &TaskSettings, kind: TaskKind, config: &Config) -> anyhow::Result<(TaskSettings, Option<String>)> {
    if kind == TaskKind::Place && config.lowering == Lowering::Refuse {
        bail!(
            "place: it loosens the grip to lay something down: expected a gripper with lowering = \"allow\", got \
             \"refuse\" (see check-hold)"
        );
    }
    let mut fitted = *settings;
    let (low_n, high_n) = (config.least_n, config.most_n);
    let grip = &mut fitted.grip;
    for force_n in [&mut grip.least_n, &mut grip.start_n, &mut grip.most_n].into_iter().chain(&mut grip.blind_force_n) {
        *force_n = force_n.clamp(low_n, high_n);
    }
    let words = (fitted.grip != settings.grip).then(|| {
        let grip = &fitted.grip;
        format!(
            "the gripper presses with {low_n} to {high_n} N per finger: start {} N, least {} N, most {} N",
            grip.start_n, grip.least_n, grip.most_n
        )
    });
    Ok((fitted, words))
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound_rig::gripper::config::Kind;

    #[test]
    fn forces_are_brought_inside_and_a_gripper_that_must_not_loosen_lays_nothing_down() {
        let settings = TaskSettings::default();
        let (same, words) = fit(&settings, TaskKind::Screw, &Config::of(Kind::Wsg50)).expect("fits");
        assert_eq!((same, words), (settings, None));
        let (fitted, words) = fit(&settings, TaskKind::Lift, &Config::of(Kind::Robotiq)).expect("fits");
        assert_eq!((fitted.grip.least_n, fitted.grip.start_n, fitted.grip.most_n), (20.0, 20.0, 60.0));
        assert!(words.is_some_and(|words| words.contains("20 to 235 N")));
        let narrow = Config { most_n: 30.0, lowering: Lowering::Allow, ..Config::of(Kind::Wsg50) };
        let (fitted, _) = fit(&settings, TaskKind::Place, &narrow).expect("may loosen");
        assert_eq!(fitted.grip.most_n, 30.0);
        let refused = fit(&settings, TaskKind::Place, &Config::of(Kind::Wsg50)).expect_err("must not loosen");
        assert!(refused.to_string().contains("lowering = \"allow\", got \"refuse\""), "{refused}");
    }
}
