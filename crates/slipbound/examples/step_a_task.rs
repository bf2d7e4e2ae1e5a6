//! A task stepped by hand: reports of fingers, gripper and wrist go in, commands for gripper and wrist come out. The
//! loop around it is `slipbound::control`; this is for a loop of your own.
//! `cargo run -p slipbound --example step_a_task`
#![allow(clippy::disallowed_macros)] // an example prints

use slipbound::grip::GripLimits;
use slipbound::hand::{Hand, Health, Mounting, Side};
use slipbound::monitor::SlipState;
use slipbound::port::{GripperState, Jaws, WristState};
use slipbound::setting::SettingError;
use slipbound::task::{ControllerKind, Observation, TaskKind, TaskSettings};

fn main() -> Result<(), SettingError> {
    // Start from the default settings; invalid ones are rejected when the task is made.
    let limits = GripLimits::default().with_forces_n(8.0, 5.0, 30.0);
    let settings = TaskSettings::default().with_controller(ControllerKind::OnSlip).with_grip(limits);
    let settings = settings.with(|s| s.lift.hold_ns = 1_000_000_000);
    let mut task = settings.task(TaskKind::Lift, None)?;

    let mut hand = Hand::new(&[Mounting::on(Side::Left)])?;
    let (mut force_n, mut lowered_mm) = (0.0, 0.0);
    for cycle in 0..120 {
        let now_ns = cycle * 33_333_333;
        // Replaces `hand.see(0, &monitor.step(frame, grip))`: from 0.3 s on the finger is in contact, at 2 s slip
        // begins.
        let mut seen = hand.report(now_ns);
        (seen.live_count, seen.health[0], seen.time_ns) = (1, Health::Live, Some(now_ns));
        (seen.state, seen.quality) = match cycle {
            0..10 => (SlipState::NoContact, 0.0),
            60 => (SlipState::Incipient, 1.0),
            _ => (SlipState::Stick, 1.0),
        };
        // Replaces a gripper and a wrist that execute commands at once.
        let jaws = if cycle < 10 { Jaws::Closing } else { Jaws::Holding };
        let (target_n, opening_mm) = (Some(force_n), Some(28.0));
        let force_n_told = Some(if cycle < 10 { 0.0 } else { force_n });
        let gripper =
            GripperState { time_ns: now_ns, force_n: force_n_told, force_error_n: None, target_n, opening_mm, jaws };
        let wrist = WristState { time_ns: now_ns, angle_rad: 0.0, lowered_mm, moving: false };
        let step = task.step(&Observation { now_ns, hand: &seen, gripper: &gripper, wrist: &wrist });
        if step.grip.force_n() != Some(force_n) {
            force_n = step.grip.force_n().unwrap_or(0.0);
            println!(
                "{:.2} s: hold with {force_n:.1} N per finger; wrist: {:?}",
                now_ns as f64 * 1e-9,
                step.wrist.motion
            );
        }
        if let slipbound::port::WristMotion::Lower { rate_mm_per_s, .. } = step.wrist.motion {
            lowered_mm += rate_mm_per_s / 30.0;
        }
    }
    println!("at the end: {force_n:.1} N per finger, lifted by {:.1} mm", -lowered_mm);
    Ok(())
}
