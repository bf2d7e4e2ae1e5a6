//! Runs a control loop in real time until it ends.

use crate::link::now_ns;
use slipbound::control::{ControlError, ControlLoop, CycleObserver};
use slipbound::port::{Gripper, Wrist};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Polling period of the links while no frame is due.
const PAUSE: Duration = Duration::from_millis(1);

/// Longest time between two cycles, ns: a silent camera is noticed, and the wrist commanded, before its last motion has
/// expired.
const LONGEST_CYCLE_NS: u64 = 100_000_000;

/// Time for the last commands to be sent, ns.
const LAST_COMMANDS_NS: u64 = 150_000_000;

/// Runs cycles until the task has ended, a source has, or `stop` is set, which is [`ControlError::Interrupted`].
/// `is_due` returns whether it is time for a cycle. Whatever ends the loop, the wrist is paused and the gripper keeps
/// its force. Times are those of [`now_ns`].
pub fn run(
    control: &mut ControlLoop,
    gripper: &mut dyn Gripper,
    wrist: &mut dyn Wrist,
    stop: &AtomicBool,
    is_due: &mut dyn FnMut() -> bool,
    observer: &mut dyn CycleObserver,
) -> Result<(), ControlError> {
    run_at_least_every(LONGEST_CYCLE_NS, control, gripper, wrist, stop, is_due, observer)
}

/// The same with a cycle at least every `longest_cycle_ns`, for recordings that are played more slowly than a camera
/// would: a wrist's motion then expires between two frames.
pub fn run_at_least_every(
    longest_cycle_ns: u64,
    control: &mut ControlLoop,
    gripper: &mut dyn Gripper,
    wrist: &mut dyn Wrist,
    stop: &AtomicBool,
    is_due: &mut dyn FnMut() -> bool,
    observer: &mut dyn CycleObserver,
) -> Result<(), ControlError> {
    let ran = cycles(longest_cycle_ns, control, gripper, wrist, stop, is_due, observer);
    control.leave(gripper, wrist);
    let until_ns = now_ns() + LAST_COMMANDS_NS;
    while gripper.is_busy() && now_ns() < until_ns {
        poll_io(gripper, wrist);
    }
    ran
}

fn cycles(
    longest_cycle_ns: u64,
    control: &mut ControlLoop,
    gripper: &mut dyn Gripper,
    wrist: &mut dyn Wrist,
    stop: &AtomicBool,
    is_due: &mut dyn FnMut() -> bool,
    observer: &mut dyn CycleObserver,
) -> Result<(), ControlError> {
    loop {
        let latest_ns = now_ns() + longest_cycle_ns;
        while !is_due() && now_ns() < latest_ns && !stop.load(Ordering::Relaxed) {
            poll_io(gripper, wrist);
        }
        if stop.load(Ordering::Relaxed) {
            return Err(ControlError::Interrupted);
        }
        let outcome = control.cycle(now_ns(), gripper, wrist, observer)?;
        if outcome.is_over(control.fault())? {
            return Ok(());
        }
    }
}

fn poll_io(gripper: &mut dyn Gripper, wrist: &mut dyn Wrist) {
    gripper.poll_io();
    wrist.poll_io();
    thread::park_timeout(PAUSE); // shorter when a frame comes: a source on a thread of its own unparks this one
}
