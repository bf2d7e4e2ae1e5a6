//! A TCP connection.

use super::stream::{Connector, Link, zero_if_not_ready};
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// Longest wait for a connection, for each address a name has.
const CONNECT_WAIT: Duration = Duration::from_secs(2);

/// A connection on which no call waits.
#[derive(Debug)]
pub struct TcpLink {
    stream: TcpStream,
}

impl TcpLink {
    /// Takes over a connection.
    pub fn new(stream: TcpStream) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?; // commands are small, and delay is worse than many packets
        Ok(TcpLink { stream })
    }
}

impl Link for TcpLink {
    fn read(&mut self, into: &mut Vec<u8>) -> io::Result<usize> {
        let mut bytes = [0; 4096];
        match self.stream.read(&mut bytes) {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(count) => {
                into.extend_from_slice(&bytes[..count]);
                Ok(count)
            }
            Err(e) => zero_if_not_ready(Err(e)),
        }
    }

    fn write(&mut self, from: &[u8]) -> io::Result<usize> {
        zero_if_not_ready(self.stream.write(from))
    }
}

/// Connects to `HOST:PORT`; waits at most 2 s for each of its addresses.
#[derive(Debug, Clone)]
pub struct TcpConnector {
    authority: String,
}

impl TcpConnector {
    /// For `HOST:PORT`. None when it is not of that form.
    pub fn new(authority: &str) -> Option<Self> {
        let (host, port) = authority.rsplit_once(':')?;
        (!host.is_empty() && port.parse::<u16>().is_ok()).then(|| TcpConnector { authority: authority.into() })
    }
}

impl Connector for TcpConnector {
    fn connect(&self) -> io::Result<Box<dyn Link>> {
        let mut why = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
        for address in self.authority.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, CONNECT_WAIT).and_then(TcpLink::new) {
                Ok(link) => return Ok(Box::new(link)),
                Err(e) => why = e,
            }
        }
        Err(why)
    }
}
