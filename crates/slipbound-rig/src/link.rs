//! The thin ends of the drivers: bytes in and out of a socket or a serial line without waiting, and the clock.

#[cfg(feature = "serial")]
mod serial;
mod tcp;
mod wire;

#[cfg(all(feature = "serial", target_os = "linux"))]
pub use serial::PseudoTerminal;
#[cfg(feature = "serial")]
pub use serial::{SerialDial, SerialLink};
pub use tcp::{TcpDial, TcpLink};
pub use wire::Wire;

use std::io;
use std::sync::OnceLock;
use std::time::Instant;

/// Nanoseconds since this was first asked for in this program: the clock of every driver and of the loop around them.
pub fn now_ns() -> u64 {
    static START: OnceLock<Instant> = OnceLock::new();
    u64::try_from(START.get_or_init(Instant::now).elapsed().as_nanos()).unwrap_or(u64::MAX)
}

/// Bytes both ways. Neither call waits.
pub trait Link: Send {
    /// Appends what has come, at most some kilobytes. `Ok(0)`: nothing yet. An error is final: the link is gone; the
    /// other side closing it is `UnexpectedEof`.
    fn read(&mut self, into: &mut Vec<u8>) -> io::Result<usize>;

    /// Sends what goes into the system's buffer now; how many bytes of `from` that were.
    fn write(&mut self, from: &[u8]) -> io::Result<usize>;
}

/// What can make a link anew; called on a thread of its own, where it may wait.
pub trait Dial: Send + Sync {
    /// Makes the link, or says why not.
    fn dial(&self) -> io::Result<Box<dyn Link>>;
}

/// A state machine at one end of a link: it is told the time, eats bytes and leaves bytes to be sent. Whoever owns it
/// carries them. Time never goes back.
pub trait Talker: Send {
    /// The link is there: nothing of an earlier one is left. Asks for what is, moves nothing.
    fn linked(&mut self, now_ns: u64);

    /// The link is gone.
    fn unlinked(&mut self, now_ns: u64, why: &str);

    /// Bytes have come.
    fn receive(&mut self, now_ns: u64, bytes: &[u8]);

    /// Time has passed. To be called often: every few ms.
    fn tick(&mut self, now_ns: u64);

    /// Bytes to be sent; whoever sends them takes them away from the front.
    fn outgoing(&mut self) -> &mut Vec<u8>;
}

impl<T: Talker + ?Sized> Talker for Box<T> {
    fn linked(&mut self, now_ns: u64) {
        (**self).linked(now_ns);
    }

    fn unlinked(&mut self, now_ns: u64, why: &str) {
        (**self).unlinked(now_ns, why);
    }

    fn receive(&mut self, now_ns: u64, bytes: &[u8]) {
        (**self).receive(now_ns, bytes);
    }

    fn tick(&mut self, now_ns: u64) {
        (**self).tick(now_ns);
    }

    fn outgoing(&mut self) -> &mut Vec<u8> {
        (**self).outgoing()
    }
}

/// Nothing to read or write at the moment is no error.
fn later(result: io::Result<usize>) -> io::Result<usize> {
    match result {
        Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => Ok(0),
        Err(e) if e.kind() == io::ErrorKind::Interrupted => Ok(0),
        other => other,
    }
}
