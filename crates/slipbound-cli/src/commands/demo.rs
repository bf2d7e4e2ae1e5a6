//! `slipbound demo`: a simulated hand does a task of the paper.

use crate::outcome::{Failure, Outcome};
use crate::simulated::Simulated;
use crate::spoiled::Spoiler;
use anyhow::anyhow;
use slipbound::monitor::Settings;
use slipbound::task::ControllerKind;
use slipbound_lab::hand::HandScene;
use slipbound_rig::config;
use std::path::PathBuf;

/// The arguments of `slipbound demo`.
#[derive(Debug, clap::Args)]
pub struct Demo {
    /// The task
    #[arg(long, default_value = "screw", value_parser = ["screw", "unscrew", "place", "lift"])]
    task: String,
    /// Who holds: the paper's law ending on evidence, the paper to the letter, ours by slip margin, one force
    #[arg(long, default_value = "on_slip", value_parser = ["on_slip", "paper", "margin", "constant"])]
    controller: String,
    /// Fingers with a camera
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=2))]
    fingers: u8,
    /// What noise and disturbances are drawn from
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Set a parameter of the scene, as mu=0.6; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Settings of grip, controllers and tasks that replace the defaults
    #[arg(long, value_name = "FILE.toml")]
    settings: Option<PathBuf>,
    /// Something that goes wrong: lost, frozen, torn, dark or swapped, with @SECONDS and :left or :right as wanted
    #[arg(long, value_name = "WHAT@SECONDS:FINGER")]
    fault: Option<Spoiler>,
    /// The folder of the run: new or empty
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

impl Demo {
    /// Runs the task to its end.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let mut settings = config::load_task_settings(self.settings.as_deref()).map_err(Failure::arguments)?;
        settings.controller = controller(&self.controller)?;
        let mut text = format!("{}?seed={}&fingers={}", self.task, self.seed, self.fingers);
        for setting in &self.set {
            text = format!("{text}&{setting}");
        }
        let scene = HandScene::parse(&text).map_err(Failure::arguments)?;
        let start = std::time::Instant::now();
        let mut sim =
            Simulated::new(&scene, &settings, &Settings::default(), self.fault).map_err(Failure::Arguments)?;
        sim.run(|around, now_ns, turn, truth| {
            let h = &turn.hand;
            println!("{:.3} {:?} P {:.1}->{:.1} {:?} wrist {:.2} | {:?} live {} sh {:.3?} piv {:.3?} max {:.2?} A {:.0?} slip {:?} | m {:.2?} | cap {:?} st {:.2?} fu {:.2?} gross {} slid {:.2} req {:.1} strain {:.2}{} over {:?}",
                now_ns as f64 * 1e-9, turn.step.phase, turn.gripper.force_n.unwrap_or(0.0), turn.step.grip.force_n, turn.step.grip.motion, turn.wrist.angle_rad.to_degrees(),
                h.state, h.live_count, h.shear_mm.map(|s| [s.along, s.across, s.around]), h.pivot_rad, h.slip_max_mm, h.contact_area_mm2, h.slip.map(|s| [s.direction.along, s.direction.across, s.direction.around]),
                slipbound::grip::GripController::margin(around.task.grip()), truth.cap.as_ref().map(|c| (c.angle_rad.to_degrees() as f32, c.torque_n_mm as f32, c.limit_n_mm as f32)), truth.stick_ratio, truth.friction_used_fraction, truth.gross, truth.slid_mm, truth.required_n, truth.largest_strain_fraction, if truth.at_border {" BORDER"} else {""},
                around.eyes.iter().map(|e| e.report.map(|r| (r.slip.markers_over, r.slip.markers_needed, (r.slip.threshold_pitch*100.0) as u32, r.markers.lost))).collect::<Vec<_>>());
            Ok(())
        }).map_err(Failure::Work)?;
        eprintln!("{:.1} s simulated in {:.1} s", sim.hand.now_ns() as f64 * 1e-9, start.elapsed().as_secs_f64());
        Ok(Outcome::Done)
    }
}

/// The controller of a name.
pub fn controller(name: &str) -> Result<ControllerKind, Failure> {
    Ok(match name {
        "constant" => ControllerKind::Constant,
        "on_slip" => ControllerKind::OnSlip,
        "paper" => ControllerKind::Paper,
        "margin" => ControllerKind::Margin,
        other => {
            return Err(Failure::Arguments(anyhow!(
                "controller: expected one of constant, on_slip, paper, margin, got `{other}`"
            )));
        }
    })
}
