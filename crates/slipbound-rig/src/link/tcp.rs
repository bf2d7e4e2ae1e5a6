//! A TCP connection.

use super::{Dial, Link, later};
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// A connection that never waits.
#[derive(Debug)]
pub struct TcpLink {
    stream: TcpStream,
}

impl TcpLink {
    /// Takes over a connection.
    pub fn new(stream: TcpStream) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?; // commands are small, and late is worse than many
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
            Err(e) => later(Err(e)),
        }
    }

    fn write(&mut self, from: &[u8]) -> io::Result<usize> {
        later(self.stream.write(from))
    }
}

/// `HOST:PORT`, dialled anew whenever it must be.
#[derive(Debug, Clone)]
pub struct TcpDial {
    /// `HOST:PORT`.
    pub authority: String,
    /// Longest wait for a connection.
    pub timeout: Duration,
}

impl Dial for TcpDial {
    fn dial(&self) -> io::Result<Box<dyn Link>> {
        let mut why = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
        for address in self.authority.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, self.timeout).and_then(TcpLink::new) {
                Ok(link) => return Ok(Box::new(link)),
                Err(e) => why = e,
            }
        }
        Err(why)
    }
}
