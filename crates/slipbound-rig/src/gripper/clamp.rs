//! The forces of a task clamped to the range of a gripper.

use super::config::{Config, Lowering};
use slipbound::setting::SettingError;
use slipbound::task::{TaskKind, TaskSettings};

/// The settings with every force inside the gripper's range; what changed, in words. Fails for a task that this gripper
/// must not do: laying down needs a looser grip.
pub fn clamp_to_gripper(
    settings: &TaskSettings,
    task: TaskKind,
    config: &Config,
) -> Result<(TaskSettings, Option<String>), SettingError> {
    if task == TaskKind::Place && config.lowering == Lowering::Refuse {
        return Err(SettingError {
            key: "place: it loosens the grip to lay something down".into(),
            got: "\"refuse\" (see check-hold)".into(),
            expected: "a gripper with lowering = \"allow\"".into(),
        });
    }
    let mut clamped = *settings;
    let (low_n, high_n) = (config.least_n, config.most_n);
    let grip = &mut clamped.grip;
    for force_n in [&mut grip.least_n, &mut grip.start_n, &mut grip.most_n].into_iter().chain(&mut grip.blind_force_n) {
        *force_n = force_n.clamp(low_n, high_n);
    }
    let words = (clamped.grip != settings.grip).then(|| {
        let grip = &clamped.grip;
        format!(
            "the gripper presses with {low_n} to {high_n} N per finger: start {} N, least {} N, most {} N",
            grip.start_n, grip.least_n, grip.most_n
        )
    });
    Ok((clamped, words))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper::config::Kind;

    #[test]
    fn forces_are_brought_inside_and_a_gripper_that_must_not_loosen_lays_nothing_down() {
        let settings = TaskSettings::default();
        let (same, words) =
            clamp_to_gripper(&settings, TaskKind::Screw, &Config::of(Kind::Wsg50)).expect("within its range");
        assert_eq!((same, words), (settings, None));
        let (clamped, words) =
            clamp_to_gripper(&settings, TaskKind::Lift, &Config::of(Kind::Robotiq)).expect("within its range");
        assert_eq!((clamped.grip.least_n, clamped.grip.start_n, clamped.grip.most_n), (20.0, 20.0, 60.0));
        assert!(words.is_some_and(|words| words.contains("20 to 235 N")));
        let narrow = Config { most_n: 30.0, lowering: Lowering::Allow, ..Config::of(Kind::Wsg50) };
        let (clamped, _) = clamp_to_gripper(&settings, TaskKind::Place, &narrow).expect("may loosen");
        assert_eq!(clamped.grip.most_n, 30.0);
        let refused =
            clamp_to_gripper(&settings, TaskKind::Place, &Config::of(Kind::Wsg50)).expect_err("must not loosen");
        assert!(refused.to_string().contains("lowering = \"allow\", got \"refuse\""), "{refused}");
    }
}
