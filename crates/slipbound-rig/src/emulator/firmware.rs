//! What differs between emulated grippers.

use super::fault::Fault;
use super::jaws::EmulatedJaws;
use slipbound::plant::Plant;

/// The firmware of an emulated gripper: the gripper's side of its protocol, and the jaws that it commands. The
/// [`Emulator`](super::Emulator) around it keeps the bytes to be sent and applies the faults of the link.
pub trait Firmware: Send {
    /// A client has connected.
    fn connected(&mut self, now_ns: u64, outgoing: &mut Vec<u8>);

    /// The connection was closed. An object that is held stays held.
    fn disconnected(&mut self);

    /// Bytes have been received; answers are appended.
    fn receive(&mut self, now_ns: u64, bytes: &[u8], outgoing: &mut Vec<u8>);

    /// Time has passed: the jaws move and press; answers and periodic states fall due.
    fn tick(&mut self, now_ns: u64, plant: &mut dyn Plant, outgoing: &mut Vec<u8>);

    /// Injects a fault that does not concern the jaws alone. False if this kind of gripper cannot have it.
    fn inject(&mut self, fault: Fault, outgoing: &mut Vec<u8>) -> bool;

    /// Its jaws.
    fn jaws(&self) -> &EmulatedJaws;

    /// Its jaws.
    fn jaws_mut(&mut self) -> &mut EmulatedJaws;
}
