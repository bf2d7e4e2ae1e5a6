//! `slipbound gripper`: try a gripper by hand.

use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::anyhow;
use clap::Subcommand;
use slipbound::port::{DriverEvent, GripCommand, GripperState, Jaws};
use slipbound_rig::gripper::check_hold::Verdict;
use slipbound_rig::gripper::{self, Device, Request, Session, describe};
use std::path::PathBuf;

/// The arguments of `slipbound gripper`.
#[derive(Debug, clap::Args)]
pub struct Gripper {
    /// wsg50://HOST:1000, gcl://HOST:PORT, robotiq:///dev/ttyUSB0, robotiq://HOST:63352, line://HOST:PORT or dry;
    /// settings may follow, as in wsg50://HOST:1000?part_width_mm=28
    address: String,
    /// A TOML file of settings (docs/grippers.md)
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    #[command(subcommand)]
    action: Action,
}

/// The action.
#[derive(Debug, Subcommand)]
enum Action {
    /// Print its state
    Status,
    /// Home the jaws; they move, so take the object out first
    Home,
    /// Open the jaws
    Open,
    /// Close, and hold with this force
    Grasp {
        /// Newtons per finger
        #[arg(value_name = "NEWTONS", allow_negative_numbers = true)]
        force_n: f64,
    },
    /// Release the object
    Release,
    /// Acknowledge a latched fast stop; moves nothing
    Acknowledge,
    /// Grip, alternate between two forces, and report whether the grip is kept
    CheckHold {
        /// The lower force, newtons per finger
        #[arg(long, value_name = "NEWTONS", default_value_t = 20.0, allow_negative_numbers = true)]
        low: f64,
        /// The higher force, newtons per finger
        #[arg(long, value_name = "NEWTONS", default_value_t = 30.0, allow_negative_numbers = true)]
        high: f64,
    },
}

impl Gripper {
    /// Opens the gripper, carries out the action, prints the resulting state.
    pub fn run(&self) -> Result<Outcome, Failure> {
        if let Action::CheckHold { low, high } = self.action
            && !(low.is_finite() && high.is_finite() && 0.0 < low && low < high)
        {
            let expected = "expected two forces in N per finger, the lower one above 0 and below the higher one";
            return Err(Failure::Arguments(anyhow!("--low, --high: {expected}, got {low} and {high}")));
        }
        self.refuse_forces()?;
        let interrupted = interruption::listen()?;
        let mut device = Device::open(&self.address, self.config.as_deref())?;
        let mut terminal = Terminal::plain();
        let events = Terminal::plain();
        let mut on_event = |event: &DriverEvent| {
            if *event != DriverEvent::Linked {
                events.note(&event.to_string());
            }
        };
        let mut session = Session::new(&mut device, &interrupted, &mut on_event);
        let state = match self.action {
            Action::Status => session.state()?,
            Action::Home => session.carry_out(Request::Home, |state| state.jaws != Jaws::Unknown)?,
            Action::Acknowledge => session.carry_out(Request::Acknowledge, |state| state.jaws != Jaws::Stopped)?,
            Action::Open | Action::Release => {
                session.carry_out(Request::Grip(GripCommand::Release), |state| state.jaws == Jaws::Open)?
            }
            Action::Grasp { force_n } => {
                let is_closed = |state: &GripperState| !matches!(state.jaws, Jaws::Open | Jaws::Closing);
                session.carry_out(Request::Grip(GripCommand::Hold { force_n }), is_closed)?
            }
            Action::CheckHold { low, high } => {
                let on_force = |force_n| terminal.say(&format!("{force_n} N per finger ..."));
                let verdict = session.check_hold(low, high, on_force)?;
                return say_verdict(&mut terminal, &verdict);
            }
        };
        terminal.say(&describe(&state))?;
        match self.action {
            Action::Grasp { force_n } if state.jaws != Jaws::Holding => Err(not_held(force_n, state.jaws)),
            Action::Home if state.jaws == Jaws::Stopped => {
                Err(Failure::Work(anyhow!("expected homed jaws, got jaws that have stopped")))
            }
            _ => Ok(Outcome::Done),
        }
    }
}

impl Gripper {
    /// Refuses forces that the gripper cannot press with, before anything moves.
    fn refuse_forces(&self) -> Result<(), Failure> {
        let forces_n = match self.action {
            Action::Grasp { force_n } => vec![force_n],
            Action::CheckHold { low, high } => vec![low, high],
            _ => return Ok(()),
        };
        let driver = gripper::driver(&self.address, self.config.as_deref())?;
        let (least_n, most_n) = (driver.config().least_n, driver.config().most_n);
        match forces_n.iter().find(|force_n| !(**force_n > 0.0 && (least_n..=most_n).contains(*force_n))) {
            None => Ok(()),
            Some(got) => {
                let expected = format!("expected a force from {least_n} N to {most_n} N per finger");
                Err(Failure::Arguments(anyhow!("{}: {expected}, got {got}", self.address)))
            }
        }
    }
}

/// A grasp that ended without an object, and the reason where the jaws report it.
fn not_held(force_n: f64, jaws: Jaws) -> Failure {
    let got = match jaws {
        Jaws::Nothing => "jaws that closed on nothing",
        Jaws::Lost => "jaws that have lost it",
        Jaws::Stopped => {
            "jaws that have stopped: find out why, then `slipbound gripper ADDRESS acknowledge` (Robotiq: `home`)"
        }
        Jaws::Open => "open jaws",
        Jaws::Closing => "jaws that are still closing",
        Jaws::Unknown | Jaws::Holding => "jaws that do not tell",
    };
    Failure::Work(anyhow!("expected an object held with {force_n} N per finger, got {got}"))
}

fn say_verdict(terminal: &mut Terminal, verdict: &Verdict) -> Result<Outcome, Failure> {
    match verdict {
        Verdict::Held { least_n: None, .. } => {
            let held = "the jaws stayed closed, but this gripper measures no force, so a dip would not have been seen";
            terminal.say(&format!("{held}: put a load cell between the jaws before you allow lowering"))?;
        }
        Verdict::Held { least_n, opened_mm } => {
            let known = |value: &Option<f64>, unit| value.map_or("not told".into(), |v| format!("{v:.2} {unit}"));
            let (least, opened) = (known(least_n, "N per finger"), known(opened_mm, "mm"));
            terminal.say(&format!("it held on: least force {least}, jaws opened by {opened}"))?;
            terminal.say("for this gripper and object the settings may say: lowering = \"allow\"")?;
        }
        Verdict::Failed { why } => {
            return Err(Failure::Work(anyhow!("it did not hold on: {why}; leave lowering as it is")));
        }
    }
    Ok(Outcome::Done)
}
