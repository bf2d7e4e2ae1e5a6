//! The simulated gripper and wrist, as the ports have them.

use super::{Inner, SimHand};
use slipbound::plant::{JawCommand, Plant};
use slipbound::port::{
    GripCommand, Gripper, GripperError, GripperErrorKind, GripperState, Jaws, Wrist, WristCommand, WristError,
    WristErrorKind, WristState,
};
use std::cell::RefCell;
use std::rc::Rc;

/// The jaws of a [`SimHand`].
#[derive(Debug, Clone)]
pub struct SimGripper {
    hand: Rc<RefCell<Inner>>,
    /// Whether something was held since the last time the jaws opened.
    held: bool,
}

/// The wrist of a [`SimHand`].
#[derive(Debug, Clone)]
pub struct SimWrist {
    hand: Rc<RefCell<Inner>>,
}

impl SimHand {
    /// The jaws. [`GripCommand::Release`] opens them wide.
    pub fn gripper(&self) -> SimGripper {
        SimGripper { hand: Rc::clone(&self.0), held: false }
    }

    /// The wrist.
    pub fn wrist(&self) -> SimWrist {
        SimWrist { hand: Rc::clone(&self.0) }
    }
}

impl Gripper for SimGripper {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        let mut hand = self.hand.borrow_mut();
        hand.alive()?;
        let told = match command {
            GripCommand::Release => JawCommand::MoveTo { opening_mm: hand.jaws.settings().stroke_mm },
            GripCommand::Hold { force_n } if force_n.is_finite() && force_n >= 0.0 => JawCommand::Grasp { force_n },
            GripCommand::Hold { force_n } => {
                let text =
                    format!("gripper of the simulator: expected a finite force of 0 N or above, got {force_n} N");
                return Err(GripperError::new(GripperErrorKind::Value, text));
            }
        };
        if matches!(told, JawCommand::MoveTo { .. }) {
            self.held = false;
        }
        hand.jaws.command(told);
        Ok(())
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        let hand = self.hand.borrow();
        hand.alive()?;
        let (jaws, there) = (&hand.jaws, hand.world.width_mm().is_some());
        self.held |= jaws.touches();
        let doing = match jaws.target_n() {
            None => Jaws::Open,
            Some(_) if jaws.touches() => Jaws::Holding,
            Some(_) if !there && self.held => Jaws::Lost,
            Some(_) if jaws.opening_mm() <= 0.0 => Jaws::Nothing,
            Some(_) => Jaws::Closing,
        };
        Ok(GripperState {
            time_ns: hand.now_ns(),
            force_n: Some(jaws.force_n()),
            target_n: jaws.target_n(),
            opening_mm: Some(jaws.opening_mm()),
            jaws: doing,
        })
    }
}

impl Wrist for SimWrist {
    fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
        let mut hand = self.hand.borrow_mut();
        hand.alive()?;
        if hand.wrist.command(command) {
            return Ok(());
        }
        let text = format!(
            "wrist of the simulator: expected finite rates it can do and bounds of 0 or above, got {:?}",
            command.motion
        );
        Err(WristError::new(WristErrorKind::Refused, text))
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        let hand = self.hand.borrow();
        hand.alive()?;
        Ok(WristState { time_ns: hand.now_ns(), ..hand.wrist.state() })
    }
}
