//! The part of a driver that differs between grippers: messages and their order.

use super::driver_state::DriverState;
use super::error::Error;
use slipbound::port::{GripCommand, Jaws};

/// How often in a row a question may go unanswered before what it asks for is not known: one answer may be lost.
pub(super) const MISSES_COUNT: u32 = 2;

/// A gripper's protocol: reads its messages into the [`DriverState`] and decides what to send next. The
/// [`Driver`](super::Driver) around it does the rest, sets the time ([`DriverState::now_ns`]) and calls
/// [`Protocol::advance`] after every other call, as long as something may be sent.
pub trait Protocol: Send {
    /// The link is up: forget everything that belongs to an earlier one. This must not move the jaws.
    fn linked(&mut self, driver: &mut DriverState);

    /// Bytes have been received: split and merged arbitrarily, possibly corrupted.
    fn receive(&mut self, driver: &mut DriverState, bytes: &[u8]);

    /// Time has passed: deadlines and periodic requests. Not called while the link is down or after the farewell.
    fn tick(&mut self, driver: &mut DriverState);

    /// Sends the next message that is due, if one is.
    fn advance(&mut self, driver: &mut DriverState);

    /// Whether the gripper may be commanded: its state is known, it is homed and not stopped. The error says what is missing.
    fn check_ready(&self, driver: &DriverState) -> Result<(), Error>;

    /// Accepts a grip or release as the newest goal. The force, N per finger, has been admitted; the gripper is ready.
    fn grip(&mut self, driver: &mut DriverState, command: GripCommand) -> Result<(), Error>;

    /// Accepts homing; refused while an object is held.
    fn home(&mut self, driver: &mut DriverState) -> Result<(), Error>;

    /// Accepts the acknowledgement of a fast stop.
    fn acknowledge(&mut self, driver: &mut DriverState) -> Result<(), Error> {
        Err(Error::Unable { address: driver.address(), command: "acknowledge" })
    }

    /// Sends the message that announces the end of the connection, if the protocol has one.
    fn leave(&mut self, _driver: &mut DriverState) {}

    /// The force of a command that was sent and is not yet answered, N per finger.
    fn force_on_its_way(&self, _driver: &DriverState) -> Option<f64> {
        None
    }

    /// Since when a gripper that answers has not told what its jaws do, ns, although it was asked; None while it does.
    /// Longer than the silence allowed, that is a fault.
    fn jaws_untold_since_ns(&self, _driver: &DriverState) -> Option<u64> {
        None
    }

    /// Fails where nothing that comes through the link can be understood, whatever else is wrong with it.
    fn check_version(&self, _driver: &DriverState) -> Result<(), Error> {
        Ok(())
    }

    /// Whether a request is still in progress, or the first state is still awaited.
    fn is_busy(&self, driver: &DriverState) -> bool;

    /// Whether there is a link at all.
    fn needs_link(&self) -> bool {
        true
    }

    /// What is known of the jaws before anything was received.
    fn jaws_at_start(&self) -> Jaws {
        Jaws::Unknown
    }
}

impl<P: Protocol + ?Sized> Protocol for Box<P> {
    fn linked(&mut self, driver: &mut DriverState) {
        (**self).linked(driver);
    }

    fn receive(&mut self, driver: &mut DriverState, bytes: &[u8]) {
        (**self).receive(driver, bytes);
    }

    fn tick(&mut self, driver: &mut DriverState) {
        (**self).tick(driver);
    }

    fn advance(&mut self, driver: &mut DriverState) {
        (**self).advance(driver);
    }

    fn check_ready(&self, driver: &DriverState) -> Result<(), Error> {
        (**self).check_ready(driver)
    }

    fn grip(&mut self, driver: &mut DriverState, command: GripCommand) -> Result<(), Error> {
        (**self).grip(driver, command)
    }

    fn home(&mut self, driver: &mut DriverState) -> Result<(), Error> {
        (**self).home(driver)
    }

    fn acknowledge(&mut self, driver: &mut DriverState) -> Result<(), Error> {
        (**self).acknowledge(driver)
    }

    fn leave(&mut self, driver: &mut DriverState) {
        (**self).leave(driver);
    }

    fn force_on_its_way(&self, driver: &DriverState) -> Option<f64> {
        (**self).force_on_its_way(driver)
    }

    fn jaws_untold_since_ns(&self, driver: &DriverState) -> Option<u64> {
        (**self).jaws_untold_since_ns(driver)
    }

    fn check_version(&self, driver: &DriverState) -> Result<(), Error> {
        (**self).check_version(driver)
    }

    fn is_busy(&self, driver: &DriverState) -> bool {
        (**self).is_busy(driver)
    }

    fn needs_link(&self) -> bool {
        (**self).needs_link()
    }

    fn jaws_at_start(&self) -> Jaws {
        (**self).jaws_at_start()
    }
}
