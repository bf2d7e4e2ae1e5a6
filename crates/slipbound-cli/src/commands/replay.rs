//! `slipbound replay`: a recorded run once more, from its frames, and whether every command comes out the same.

use crate::closed_loop::{ClosedLoop, Eye, Turned};
use crate::frames;
use crate::outcome::{Failure, Outcome};
use crate::simulated::{kind, mounting};
use crate::terminal::Terminal;
use anyhow::{Context, anyhow};
use slipbound::monitor::Settings;
use slipbound::port::{GripCommand, Gripper, GripperError, GripperState, Wrist, WristCommand, WristError, WristState};
use slipbound::task::TaskSettings;
use slipbound_lab::hand::{HandScene, SimHand};
use slipbound_rig::run::{self, Cycle};
use std::collections::VecDeque;
use std::path::PathBuf;

/// The arguments of `slipbound replay`.
#[derive(Debug, clap::Args)]
pub struct Replay {
    /// The folder of a run made with `slipbound demo --record`
    folder: PathBuf,
}

/// A gripper and a wrist that say what they said; None: nothing that could be worked with.
struct Past<'a> {
    cycle: Option<&'a Cycle>,
}

impl Gripper for Past<'_> {
    fn command(&mut self, _: GripCommand) -> Result<(), GripperError> {
        Ok(())
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        Ok(self.cycle.ok_or("it was in trouble")?.gripper)
    }
}

impl Wrist for Past<'_> {
    fn command(&mut self, _: WristCommand) -> Result<(), WristError> {
        Ok(())
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        Ok(self.cycle.ok_or("it was in trouble")?.wrist)
    }
}

impl Replay {
    /// Runs the loop over what was recorded; fails at the first command that differs.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let (info, cycles) = run::read(&self.folder).map_err(Failure::arguments)?;
        let (mut around, mut waiting) = self.around(&info).map_err(Failure::Arguments)?;
        let mut next = 0;
        while let Some(cycle) = cycles.get(next) {
            let cycle_now = Some(cycle).filter(|_| !waiting.pop_front().unwrap_or_default());
            let past = || Past { cycle: cycle_now };
            match around.turn(cycle.time_ns, &mut past(), &mut past()).map_err(Failure::Work)? {
                Turned::AtRest | Turned::Waiting => {}
                Turned::Over => return Err(anyhow!("frames.jsonl: ends before cycle {next} of reports.jsonl").into()),
                Turned::Commanded(turn) => {
                    let same = turn.step.grip == cycle.grip_command
                        && turn.step.grip.force_n.to_bits() == cycle.grip_command.force_n.to_bits()
                        && turn.step.wrist == cycle.wrist_command
                        && turn.step.phase == cycle.phase
                        && turn.hand == cycle.hand;
                    if !same {
                        return Err(anyhow!(
                            "cycle {next} at {:.3} s: recorded {:?} {:?} {:?}, replayed {:?} {:?} {:?}",
                            cycle.time_ns as f64 * 1e-9,
                            cycle.grip_command,
                            cycle.wrist_command,
                            cycle.phase,
                            turn.step.grip,
                            turn.step.wrist,
                            turn.step.phase,
                        )
                        .into());
                    }
                    next += 1;
                }
            }
        }
        Terminal::plain()
            .say(&format!("{}: {next} cycles, every report and command the same", self.folder.display()))?;
        Ok(Outcome::Done)
    }

    fn around(&self, info: &toml::Table) -> anyhow::Result<(ClosedLoop, VecDeque<bool>)> {
        let path = self.folder.join("run.toml");
        let text = |key: &str| {
            let value = info.get(key).and_then(toml::Value::as_str);
            value.with_context(|| format!("{}: {key}: expected text, got nothing", path.display()))
        };
        let scene = HandScene::parse(text("source")?)?;
        let settings = info.get("settings").with_context(|| format!("{}: no settings", path.display()))?;
        let part =
            |key: &str| settings.get(key).cloned().with_context(|| format!("{}: settings.{key}", path.display()));
        let task: TaskSettings = part("task")?.try_into()?;
        let monitor: Settings = part("monitor")?.try_into()?;
        let swapped = settings.get("fault").and_then(toml::Value::as_str).is_some_and(|f| f.starts_with("swapped"));
        let hand = SimHand::new(&scene)?;
        let recording = frames::recorded(&self.folder, scene.fingers_count())?;
        let eyes = recording.sources.into_iter().enumerate().map(|(finger, source)| {
            let (mounting, name) = mounting(finger, swapped);
            Eye::new(name, mounting, hand.sensor(finger), monitor.clone(), Box::new(source))
        });
        let stiffness_mpa_per_mm = hand.sensor(0).shear_stiffness_mpa_per_mm();
        let around = ClosedLoop::new(eyes.collect(), task.task(kind(&scene)?, stiffness_mpa_per_mm)?)?;
        Ok((around, recording.waiting))
    }
}
