//! The control loop around a simulated hand that holds a filling bottle, with an observer of your own.
//! `cargo run --release -p slipbound-lab --example hold_simulated`

use slipbound::control::{CycleObserver, CycleView};
use slipbound::monitor::Settings;
use slipbound::task::{ControllerKind, TaskKind, TaskSettings};
use slipbound_lab::hand::HandScene;
use slipbound_lab::lockstep::LockStep;

/// Prints a line whenever a slip begins. A plot, a ROS publisher or a log is attached in the same way.
#[derive(Default)]
struct Printer {
    slips_count: u32,
}

impl CycleObserver for Printer {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let Some(cycle) = view.cycle() else { return };
        if cycle.slips_count > self.slips_count {
            self.slips_count = cycle.slips_count;
            let mass_kg = cycle.truth.and_then(|truth| truth.mass_kg).unwrap_or(0.0);
            let (time_s, force_n) = (cycle.time_ns as f64 * 1e-9, cycle.gripper.pressed_n().unwrap_or(0.0));
            println!("{time_s:5.2} s: slip {} at {force_n:.0} N, {mass_kg:.2} kg", cycle.slips_count);
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = HandScene::parse("lift?seed=1&fingers=1&mu=0.6")?;
    let mut settings = TaskSettings::default().with_controller(ControllerKind::OnSlip);
    settings.lift.hold_ns = 4_000_000_000;
    let mut run = LockStep::new(&scene, &settings, &Settings::default(), None)?;
    run.run(&|| false, &mut Printer::default())?;
    let score = run.score();
    let held = if score.succeeded(TaskKind::Lift) { "held" } else { "not held" };
    println!("{held}: {:?}, at most {:.0} N, slid {:.2} mm", score.ending, score.most_n, score.slid_mm);
    Ok(())
}
