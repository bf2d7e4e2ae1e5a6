//! What differs between emulated grippers.

use super::fault::Fault;
use super::jaws::EmulatedJaws;
use slipbound::plant::Plant;

/// What runs in an emulated gripper: its protocol from the other side, and the jaws that it commands. The
/// [`Emulator`](super::Emulator) around it keeps the bytes to be sent and makes the faults of the link.
pub trait Firmware: Send {
    /// Somebody has connected.
    fn connected(&mut self, now_ns: u64, outgoing: &mut Vec<u8>);

    /// The connection is gone. What is held stays held.
    fn disconnected(&mut self);

    /// Bytes have been received; answers are appended.
    fn receive(&mut self, now_ns: u64, bytes: &[u8], outgoing: &mut Vec<u8>);

    /// Time has passed: the jaws move and press; answers and periodic states fall due.
    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant, outgoing: &mut Vec<u8>);

    /// Something happens to it that is not a matter of the jaws alone. False where it cannot happen to its kind.
    fn inject(&mut self, fault: Fault, outgoing: &mut Vec<u8>) -> bool;

    /// Its jaws.
    fn jaws(&self) -> &EmulatedJaws;

    /// Its jaws.
    fn jaws_mut(&mut self) -> &mut EmulatedJaws;
}
