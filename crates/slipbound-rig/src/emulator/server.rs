//! An emulator on a socket or a serial line: the part that reads the clock.

use super::emulated::Emulator;
use crate::link::{Link, TcpLink, now_ns};
use slipbound::plant::Plant;
use std::io;
use std::net::TcpListener;
use std::thread;
use std::time::Duration;

/// Time between two updates of link and jaws.
const PAUSE: Duration = Duration::from_millis(1);

/// Bytes a client may leave unread before it counts as dead.
const MOST_UNREAD_BYTES: usize = 1 << 16;

/// Serves one connection once: bytes in, time on, bytes out. An error: the connection is over.
fn serve_once(link: &mut dyn Link, emulator: &mut Emulator, inbox: &mut Vec<u8>) -> io::Result<()> {
    inbox.clear();
    let read = link.read(inbox);
    if let Ok(1..) = read {
        emulator.receive(now_ns(), inbox);
    }
    let written = match emulator.outgoing().len() {
        0 => Ok(0),
        MOST_UNREAD_BYTES.. => Err(io::ErrorKind::TimedOut.into()),
        _ => link.write(emulator.outgoing()),
    };
    if let Ok(count) = written {
        emulator.outgoing().drain(..count);
    }
    read.and(written).map(drop)
}

/// Serves an emulator on a port, one connection at a time; a new one replaces the old.
pub struct Server {
    listener: TcpListener,
    link: Option<TcpLink>,
    inbox: Vec<u8>,
}

impl Server {
    /// Takes a port.
    pub fn new(listener: TcpListener) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        Ok(Server { listener, link: None, inbox: Vec::with_capacity(8192) })
    }

    /// Accepts connections, receives, advances the time, sends; does not wait. To be called about every ms. The plant
    /// is advanced by its owner.
    pub fn serve(&mut self, emulator: &mut Emulator, plant: &mut dyn Plant) -> io::Result<()> {
        match self.listener.accept() {
            Ok((stream, _)) => self.welcome(TcpLink::new(stream)?, emulator),
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => {}
            Err(e) if matches!(e.kind(), io::ErrorKind::ConnectionAborted | io::ErrorKind::Interrupted) => {}
            Err(e) => return Err(e),
        }
        emulator.tick(now_ns(), plant);
        let inbox = &mut self.inbox;
        let served = self.link.as_mut().map_or(Ok(()), |link| serve_once(link, emulator, inbox));
        if self.link.is_some() && (emulator.take_hang_up() || served.is_err()) {
            self.link = None;
            emulator.disconnected(now_ns());
        }
        Ok(())
    }

    fn welcome(&mut self, link: TcpLink, emulator: &mut Emulator) {
        if let Some(mut old) = self.link.take() {
            // The last bytes of the old connection, a farewell perhaps, came before the new one.
            self.inbox.clear();
            while old.read(&mut self.inbox).is_ok_and(|count| count > 0) {
                emulator.receive(now_ns(), &self.inbox);
                self.inbox.clear();
            }
            emulator.disconnected(now_ns());
        }
        self.link = Some(link);
        emulator.connected(now_ns());
    }
}

/// Serves a port until `go_on` returns false; it may change the emulator, about every ms. Times of faults count from the
/// call.
pub fn serve_tcp(
    listener: TcpListener,
    emulator: &mut Emulator,
    plant: &mut dyn Plant,
    mut go_on: impl FnMut(&mut Emulator) -> bool,
) -> io::Result<()> {
    let mut server = Server::new(listener)?;
    while go_on(emulator) {
        server.serve(emulator, plant)?;
        plant.advance_to(now_ns());
        thread::sleep(PAUSE);
    }
    Ok(())
}

/// Serves one link, for example a serial line, until `go_on` returns false or the link is closed; as [`serve_tcp`].
pub fn serve_link(
    link: &mut dyn Link,
    emulator: &mut Emulator,
    plant: &mut dyn Plant,
    mut go_on: impl FnMut(&mut Emulator) -> bool,
) -> io::Result<()> {
    let mut inbox = Vec::with_capacity(8192);
    emulator.connected(now_ns());
    while go_on(emulator) && !emulator.take_hang_up() {
        emulator.tick(now_ns(), plant);
        plant.advance_to(now_ns());
        serve_once(link, emulator, &mut inbox)?;
        thread::sleep(PAUSE);
    }
    emulator.disconnected(now_ns());
    Ok(())
}
