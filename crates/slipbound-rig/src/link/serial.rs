//! A serial line, 115200 baud, 8 bits, no parity, one stop bit.

use super::stream::{Connector, Link, zero_if_not_ready};
use serial2::SerialPort;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

/// Bits a second on the line.
const BAUD: u32 = 115_200;

/// Longest wait of one call. The library has no call that does not wait at all; on a line that is quiet, a read costs this.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);

/// A serial line on which no call waits for longer than 1 ms.
#[derive(Debug)]
pub struct SerialLink {
    port: SerialPort,
}

impl SerialLink {
    /// Takes over an open port, or one end of a pseudo-terminal.
    pub fn new(mut port: SerialPort) -> io::Result<Self> {
        port.set_read_timeout(SHORTEST_WAIT)?;
        port.set_write_timeout(SHORTEST_WAIT)?;
        Ok(SerialLink { port })
    }
}

impl Link for SerialLink {
    fn read(&mut self, into: &mut Vec<u8>) -> io::Result<usize> {
        let mut bytes = [0; 1024];
        match self.port.read(&mut bytes) {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()), // hung up: one that is quiet times out
            Ok(count) => {
                into.extend_from_slice(&bytes[..count]);
                Ok(count)
            }
            Err(e) => zero_if_not_ready(Err(e)),
        }
    }

    fn write(&mut self, from: &[u8]) -> io::Result<usize> {
        zero_if_not_ready(self.port.write(from))
    }
}

/// A serial line without hardware: our end of a pseudo-terminal, and the device to be opened at the other.
#[cfg(target_os = "linux")]
#[derive(Debug)]
pub struct PseudoTerminal {
    /// Our end.
    pub link: SerialLink,
    /// The other end, as in `/dev/pts/3`.
    pub device: PathBuf,
    /// Keeps the other end open until somebody opens it.
    _other: SerialPort,
}

#[cfg(target_os = "linux")]
impl PseudoTerminal {
    /// Opens a new pair.
    pub fn new() -> io::Result<Self> {
        use std::os::fd::AsRawFd;
        let (ours, other) = SerialPort::pair()?;
        let device = std::fs::read_link(format!("/proc/self/fd/{}", other.as_raw_fd()))?;
        Ok(PseudoTerminal { link: SerialLink::new(ours)?, device, _other: other })
    }
}

/// A serial device, opened again whenever the link is lost.
#[derive(Debug, Clone)]
pub struct SerialConnector {
    /// The device, as in `/dev/ttyUSB0`.
    pub device: PathBuf,
}

impl Connector for SerialConnector {
    fn connect(&self) -> io::Result<Box<dyn Link>> {
        Ok(Box::new(SerialLink::new(SerialPort::open(&self.device, BAUD)?)?))
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_quiet_is_not_one_that_has_hung_up() {
        let terminal = PseudoTerminal::new().expect("a pseudo-terminal");
        let port = SerialPort::open(&terminal.device, BAUD).expect("opens");
        let (mut link, mut bytes) = (SerialLink::new(port).expect("a link"), Vec::new());
        assert_eq!(link.read(&mut bytes).expect("nothing yet"), 0);
        drop(terminal);
        let said = link.read(&mut bytes);
        assert!(said.is_err(), "{said:?}");
    }
}
