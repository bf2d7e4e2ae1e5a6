//! `slipbound gripper`: try a gripper by hand.

use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use clap::Subcommand;
use slipbound::port::{DriverEvent, GripCommand, Gripper as _, GripperState, Jaws};
use slipbound_rig::gripper::check_hold::{CheckHold, Step, Verdict};
use slipbound_rig::gripper::{Device, Error, Request};
use slipbound_rig::link::now_ns;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Time between two looks at the gripper.
const PAUSE: Duration = Duration::from_millis(5);

/// Time for which nothing may change before an order counts as carried out, ns.
const SETTLED_NS: u64 = 300_000_000;

/// Changes of opening, mm, and of force, N, that are none.
const SAME: (f64, f64) = (0.02, 0.1);

/// Longest wait for an order to be carried out, s.
const MOST_S: u64 = 30;

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

/// What is to be done.
#[derive(Debug, Subcommand)]
enum Action {
    /// Say what it says
    Status,
    /// Find out where the jaws are; they move, take the object out first
    Home,
    /// Open the jaws
    Open,
    /// Close, and hold with this force
    Grasp {
        /// Newtons per finger
        #[arg(value_name = "NEWTONS", allow_negative_numbers = true)]
        force_n: f64,
    },
    /// Let go
    Release,
    /// Acknowledge a latched fast stop; moves nothing
    Acknowledge,
    /// Grip, then change the force to and fro, and say whether it holds on meanwhile
    CheckHold {
        /// The lower force, newtons per finger
        #[arg(long, value_name = "NEWTONS", default_value_t = 20.0)]
        low: f64,
        /// The higher force, newtons per finger
        #[arg(long, value_name = "NEWTONS", default_value_t = 30.0)]
        high: f64,
    },
}

impl Gripper {
    /// Opens the gripper, has it do it, says what came of it.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let interrupted = interruption::listen()?;
        let mut device = Device::open(&self.address, self.config.as_deref()).map_err(opening_failed)?;
        let mut session = Session { device: &mut device, terminal: Terminal::plain(), interrupted: &interrupted };
        match self.action {
            Action::Status => session.tell()?,
            Action::Home => session.carry_out(Request::Home, |_| true)?,
            Action::Acknowledge => session.carry_out(Request::Acknowledge, |state| state.jaws != Jaws::Stopped)?,
            Action::Open | Action::Release => {
                session.carry_out(Request::Grip(GripCommand::Release), |state| state.jaws == Jaws::Open)?;
            }
            Action::Grasp { force_n } => {
                let is_settled = |state: &GripperState| !matches!(state.jaws, Jaws::Open | Jaws::Closing);
                session.carry_out(Request::Grip(GripCommand::Hold { force_n }), is_settled)?;
            }
            Action::CheckHold { low, high } => session.check_hold(low, high)?,
        }
        Ok(Outcome::Done)
    }
}

/// A gripper that could not be opened: a wrong argument, or nobody there.
pub fn opening_failed(error: Error) -> Failure {
    match error {
        Error::Address { .. } | Error::Config(_) => Failure::arguments(error),
        other => Failure::Work(other.into()),
    }
}

struct Session<'a> {
    device: &'a mut Device,
    terminal: Terminal,
    interrupted: &'a AtomicBool,
}

impl Session<'_> {
    /// The state now; what is worth telling is told.
    fn look(&mut self) -> Result<GripperState, Failure> {
        let state = self.device.state();
        while let Some(event) = self.device.next_event() {
            if event != DriverEvent::Linked {
                self.terminal.note(&event.to_string());
            }
        }
        if self.interrupted.load(Ordering::Relaxed) {
            return Err(Failure::Work(anyhow::anyhow!("interrupted; the gripper keeps its force")));
        }
        state.map_err(|error| Failure::Work(error.into()))
    }

    fn tell(&mut self) -> Result<(), Failure> {
        let state = self.look()?;
        self.terminal.say(&in_words(&state))
    }

    /// Gives a request and waits until it is done, the state is as wanted, and nothing moves any more.
    fn carry_out(&mut self, request: Request, wanted: impl Fn(&GripperState) -> bool) -> Result<(), Failure> {
        self.device.request(request).map_err(|error| Failure::Work(error.into()))?;
        let until_ns = now_ns() + MOST_S * 1_000_000_000;
        let (mut last, mut since_ns) = (self.look()?, now_ns());
        loop {
            let state = self.look()?;
            if self.device.is_busy() || !wanted(&state) || !is_same(&state, &last) {
                (last, since_ns) = (state, now_ns());
            } else if now_ns() - since_ns > SETTLED_NS {
                return self.tell();
            }
            if now_ns() > until_ns {
                let words = in_words(&state);
                return Err(Failure::Work(anyhow::anyhow!("expected it to be done within {MOST_S} s, got {words}")));
            }
            thread::sleep(PAUSE);
        }
    }

    fn check_hold(&mut self, low_n: f64, high_n: f64) -> Result<(), Failure> {
        let mut trial = CheckHold::new(low_n, high_n);
        self.device.permit_lowering(true);
        loop {
            let state = self.look()?;
            match trial.step(now_ns(), &state) {
                Step::Command(command) => {
                    if let Some(force_n) = command.force_n() {
                        self.terminal.say(&format!("{force_n} N per finger ..."))?;
                    }
                    self.device.request(Request::Grip(command)).map_err(|error| Failure::Work(error.into()))?;
                }
                Step::Wait => thread::sleep(PAUSE),
                Step::Done(Verdict::Held { least_n: None, .. }) => {
                    let said =
                        "the jaws stayed closed, but this gripper measures no force, so a dip would not have been seen";
                    return self
                        .terminal
                        .say(&format!("{said}: put a load cell between the jaws before you allow lowering"));
                }
                Step::Done(Verdict::Held { least_n, opened_mm }) => {
                    let known =
                        |value: Option<f64>, unit| value.map_or("not told".into(), |v| format!("{v:.2} {unit}"));
                    let (least, opened) = (known(least_n, "N per finger"), known(opened_mm, "mm"));
                    self.terminal.say(&format!("it held on: least force {least}, jaws opened by {opened}"))?;
                    return self.terminal.say("for this gripper and object the settings may say: lowering = \"allow\"");
                }
                Step::Done(Verdict::Failed { why }) => {
                    return Err(Failure::Work(anyhow::anyhow!("it did not hold on: {why}; leave lowering as it is")));
                }
            }
        }
    }
}

fn is_same(a: &GripperState, b: &GripperState) -> bool {
    let near = |a: Option<f64>, b: Option<f64>, most: f64| a.zip(b).is_none_or(|(a, b)| (a - b).abs() < most);
    a.jaws == b.jaws && near(a.opening_mm, b.opening_mm, SAME.0) && near(a.force_n, b.force_n, SAME.1)
}

fn in_words(state: &GripperState) -> String {
    let known = |value: Option<f64>, unit| value.map_or("unknown".into(), |value| format!("{value:.2} {unit}"));
    format!(
        "jaws {}, opening {}, force {}, asked for {}",
        format!("{:?}", state.jaws).to_lowercase(),
        known(state.opening_mm, "mm"),
        known(state.force_n, "N per finger"),
        known(state.target_n, "N per finger"),
    )
}
