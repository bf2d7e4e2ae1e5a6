//! Camera, gripper, wrist and plant of a simulated hand, as ports. Each is a handle of the same hand, and each can be
//! moved to a thread.

use super::shared::{HandParts, SharedHand};
use slipbound::plant::{JawCommand, Plant};
use slipbound::port::{
    FrameBuffer, FrameSource, GripCommand, Gripper, GripperError, GripperErrorKind, GripperState, Jaws, Next,
    SourceError, Wrist, WristCommand, WristError, WristErrorKind, WristState,
};

/// The jaws of a [`SimHand`](super::SimHand).
#[derive(Debug, Clone)]
pub struct SimGripper {
    hand: SharedHand,
    /// Whether an object was held since the jaws last opened.
    held: bool,
}

impl SimGripper {
    pub(super) fn new(hand: SharedHand) -> Self {
        SimGripper { hand, held: false }
    }
}

impl Gripper for SimGripper {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        let mut hand = self.hand.lock();
        hand.check_usable()?;
        let order = match command {
            GripCommand::Release => JawCommand::MoveTo { opening_mm: hand.jaws.settings().stroke_mm },
            GripCommand::Hold { force_n } if force_n.is_finite() && force_n >= 0.0 => JawCommand::Grasp { force_n },
            GripCommand::Hold { force_n } => {
                let text =
                    format!("gripper of the simulator: expected a finite force of 0 N or above, got {force_n} N");
                return Err(GripperError::new(GripperErrorKind::Value, text));
            }
        };
        if matches!(order, JawCommand::MoveTo { .. }) {
            self.held = false;
        }
        hand.jaws.command(order);
        Ok(())
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        let hand = self.hand.lock();
        hand.check_usable()?;
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
            force_error_n: None,
            target_n: jaws.target_n(),
            opening_mm: Some(jaws.opening_mm()),
            jaws: doing,
        })
    }
}

/// The wrist of a [`SimHand`](super::SimHand).
#[derive(Debug, Clone)]
pub struct SimWrist {
    hand: SharedHand,
}

impl SimWrist {
    pub(super) fn new(hand: SharedHand) -> Self {
        SimWrist { hand }
    }
}

impl Wrist for SimWrist {
    fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
        let mut hand = self.hand.lock();
        hand.check_usable()?;
        if hand.wrist.command(command) {
            return Ok(());
        }
        let text = format!(
            "wrist of the simulator: expected finite rates it can do and bounds of 0 or above, got {}",
            command.motion
        );
        Err(WristError::new(WristErrorKind::Refused, text))
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        let hand = self.hand.lock();
        hand.check_usable()?;
        Ok(WristState { time_ns: hand.now_ns(), ..hand.wrist.state() })
    }
}

/// The world of a [`SimHand`](super::SimHand) as a [`Plant`].
#[derive(Debug, Clone)]
pub struct SimPlant(SharedHand);

impl SimPlant {
    pub(super) fn new(hand: SharedHand) -> Self {
        SimPlant(hand)
    }
}

impl Plant for SimPlant {
    fn width_mm(&self) -> Option<f64> {
        self.0.lock().world.width_mm()
    }

    fn press(&mut self, force_n: f64) {
        self.0.lock().world.press(force_n);
    }

    fn place_wrist(&mut self, angle_rad: f64, lowered_mm: f64) {
        self.0.lock().world.place_wrist(angle_rad, lowered_mm);
    }

    fn advance_to(&mut self, now_ns: u64) {
        self.0.lock().world.advance_to(now_ns);
    }
}

/// The camera of a finger of a [`SimHand`](super::SimHand): delivers the present frame once, is silent until time has
/// advanced, and ends after the scene's `longest_s`.
#[derive(Debug, Clone)]
pub struct SimCamera {
    hand: SharedHand,
    finger: usize,
    delivered: Option<u64>,
}

impl SimCamera {
    pub(super) fn new(hand: SharedHand, finger: usize) -> Self {
        SimCamera { hand, finger, delivered: None }
    }
}

impl FrameSource for SimCamera {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let HandParts { world, cameras, longest_ns, .. } = &mut *self.hand.lock();
        if let Some(error) = world.error() {
            return Err(error.clone().into());
        }
        if world.now_ns() > *longest_ns {
            return Ok(Next::End);
        }
        let frame = world.frame();
        if self.delivered == Some(frame) {
            return Ok(Next::Silent);
        }
        cameras.draw(frame, world);
        cameras.deliver(self.finger, into)?;
        self.delivered = Some(frame);
        Ok(Next::Frame)
    }
}
