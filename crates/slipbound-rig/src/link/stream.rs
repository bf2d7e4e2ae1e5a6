//! A byte stream that never blocks, and the trait that opens one.

use std::io;

/// A byte stream in both directions. No call blocks.
pub trait Link: Send {
    /// Appends what has been received, at most some kilobytes. `Ok(0)`: nothing yet. An error is final: the link is
    /// down; the other side closing it is `UnexpectedEof`.
    fn read(&mut self, into: &mut Vec<u8>) -> io::Result<usize>;

    /// Sends as much as the system's buffer accepts now; returns the number of bytes of `from` that were sent.
    fn write(&mut self, from: &[u8]) -> io::Result<usize>;
}

/// Opens a link, as often as needed. Called on a thread of its own, where it may wait.
pub trait Connector: Send + Sync {
    /// Opens the link, or says why that failed.
    fn connect(&self) -> io::Result<Box<dyn Link>>;
}

/// Nothing to read or write at the moment is not an error.
pub(super) fn zero_if_not_ready(result: io::Result<usize>) -> io::Result<usize> {
    match result {
        Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => Ok(0),
        Err(e) if e.kind() == io::ErrorKind::Interrupted => Ok(0),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_that_is_not_ready_or_was_interrupted_has_nothing_yet_and_a_broken_one_an_error() {
        for kind in [io::ErrorKind::WouldBlock, io::ErrorKind::TimedOut, io::ErrorKind::Interrupted] {
            assert_eq!(zero_if_not_ready(Err(kind.into())).expect("nothing yet"), 0, "{kind:?}");
        }
        for kind in [io::ErrorKind::ConnectionReset, io::ErrorKind::UnexpectedEof, io::ErrorKind::Other] {
            assert_eq!(zero_if_not_ready(Err(kind.into())).expect_err("broken").kind(), kind);
        }
        assert_eq!(zero_if_not_ready(Ok(7)).expect("bytes"), 7);
    }
}
