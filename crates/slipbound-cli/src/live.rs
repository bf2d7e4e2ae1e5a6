//! The loop in real time, around a gripper and a wrist at their links.

use crate::closed_loop::{ClosedLoop, Told, Turned};
use anyhow::anyhow;
use slipbound::port::{Gripper, Wrist};
use slipbound::task::Phase;
use slipbound_rig::gripper;
use slipbound_rig::link::now_ns;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Time between two looks at the links while no frame is due.
const PAUSE: Duration = Duration::from_millis(1);

/// Longest time between two turns, ns: a camera that is silent is noticed, and the wrist told, before its last motion
/// has run out.
const LONGEST_TURN_NS: u64 = 100_000_000;

/// Time in which the last commands get away, ns.
const LAST_WORDS_NS: u64 = 150_000_000;

/// Turns until the task has ended, a source has, or it is interrupted, which is an error. `is_due` says whether it is
/// time for a turn: the frames are there. Whatever ends the loop, the wrist stands and the gripper keeps its force.
pub fn run(
    around: &mut ClosedLoop,
    gripper: &mut gripper::Device,
    wrist: &mut dyn Wrist,
    interrupted: &AtomicBool,
    mut is_due: impl FnMut() -> bool,
    mut see: impl FnMut(&mut ClosedLoop, &Told<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let ran = turn_after_turn(around, gripper, wrist, interrupted, &mut is_due, &mut see);
    around.leave(gripper, wrist);
    let until_ns = now_ns() + LAST_WORDS_NS;
    while gripper.is_busy() && now_ns() < until_ns {
        carry(gripper, wrist);
    }
    ran
}

fn turn_after_turn(
    around: &mut ClosedLoop,
    gripper: &mut gripper::Device,
    wrist: &mut dyn Wrist,
    interrupted: &AtomicBool,
    is_due: &mut impl FnMut() -> bool,
    see: &mut impl FnMut(&mut ClosedLoop, &Told<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut notes = Vec::new();
    loop {
        let latest_ns = now_ns() + LONGEST_TURN_NS;
        while !is_due() && now_ns() < latest_ns {
            carry(gripper, wrist);
            if interrupted.load(Ordering::Relaxed) {
                break;
            }
        }
        if interrupted.load(Ordering::Relaxed) {
            return Err(anyhow!("interrupted; the wrist was paused, the gripper keeps its force"));
        }
        let now_ns = now_ns();
        let turned = around.turn(now_ns, gripper, wrist);
        notes.clear();
        notes.extend(std::iter::from_fn(|| gripper.next_note()).map(|note| note.to_string()));
        let turned = turned?;
        see(around, &Told { now_ns, turned, notes: &notes })?;
        match turned {
            Turned::Over => return around.trouble.take().map_or(Ok(()), |trouble| Err(anyhow!(trouble.why))),
            Turned::Commanded(turn) if matches!(turn.step.phase, Phase::Ended(_)) => return Ok(()),
            _ => {}
        }
    }
}

fn carry(gripper: &mut gripper::Device, wrist: &mut dyn Wrist) {
    gripper.carry();
    wrist.carry();
    thread::sleep(PAUSE);
}
