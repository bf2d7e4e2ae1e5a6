//! Manual operation of a gripper: requests carried out one after the other, in real time.

use super::check_hold::{CheckHold, Step, Verdict};
use super::device::Device;
use super::error::Error;
use super::request::Request;
use super::settle_detector::{SettleDetector, describe};
use crate::link::now_ns;
use slipbound::port::{DriverEvent, Gripper, GripperState};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Polling period of the gripper.
const PAUSE: Duration = Duration::from_millis(5);

/// Longest wait for a request to be carried out, s.
const LONGEST_S: u64 = 30;

/// Why a request was not carried out. The gripper keeps its force.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The gripper failed or refused.
    #[error(transparent)]
    Gripper(#[from] Error),
    /// The user interrupted.
    #[error("interrupted; the gripper keeps its force")]
    Interrupted,
    /// It took too long.
    #[error("expected it to be done within {expected_s} s, got {}", describe(state))]
    Late {
        /// Time allowed, s.
        expected_s: u64,
        /// The state at the end of it.
        state: Box<GripperState>,
    },
}

/// A gripper, a flag that interrupts waiting, and a callback for its events.
pub struct Session<'a> {
    device: &'a mut Device,
    stop: &'a AtomicBool,
    on_event: &'a mut dyn FnMut(&DriverEvent),
}

impl<'a> Session<'a> {
    /// Operates this gripper until `stop` is set.
    pub fn new(device: &'a mut Device, stop: &'a AtomicBool, on_event: &'a mut dyn FnMut(&DriverEvent)) -> Self {
        Session { device, stop, on_event }
    }

    /// The present state; events since the last call are passed to the callback.
    pub fn state(&mut self) -> Result<GripperState, SessionError> {
        let state = self.device.state();
        while let Some(event) = self.device.next_event() {
            (self.on_event)(&event);
        }
        match self.stop.load(Ordering::Relaxed) {
            true => Err(SessionError::Interrupted),
            false => Ok(state?),
        }
    }

    /// Sends a request and waits until it is done, `is_done` holds, and nothing moves any more; returns the state then.
    pub fn carry_out(
        &mut self,
        request: Request,
        is_wanted: impl Fn(&GripperState) -> bool,
    ) -> Result<GripperState, SessionError> {
        self.device.request(request)?;
        let until_ns = now_ns() + LONGEST_S * 1_000_000_000;
        let mut settled = SettleDetector::default();
        loop {
            let state = self.state()?;
            if settled.see(&state, !self.device.is_busy() && is_wanted(&state)) {
                return self.state();
            }
            if now_ns() > until_ns {
                return Err(SessionError::Late { expected_s: LONGEST_S, state: Box::new(state) });
            }
            thread::sleep(PAUSE);
        }
    }

    /// Runs a [`CheckHold`] to its verdict; lower forces are permitted from here on. `on_force`: shown every force, N per
    /// finger, before it is commanded; its error ends the trial.
    pub fn check_hold<E: From<SessionError>>(
        &mut self,
        low_n: f64,
        high_n: f64,
        mut on_force: impl FnMut(f64) -> Result<(), E>,
    ) -> Result<Verdict, E> {
        let mut trial = CheckHold::new(low_n, high_n);
        self.device.permit_lowering(true);
        loop {
            let state = self.state()?;
            match trial.step(now_ns(), &state) {
                Step::Command(command) => {
                    command.force_n().map_or(Ok(()), &mut on_force)?;
                    self.device.request(Request::Grip(command)).map_err(SessionError::from)?;
                }
                Step::Wait => thread::sleep(PAUSE),
                Step::Done(verdict) => return Ok(verdict),
            }
        }
    }
}
