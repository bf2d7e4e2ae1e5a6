//! An emulator at a socket or a serial line: the thin end that knows the clock.

use super::{Emulator, Faulty};
use crate::link::{Link, TcpLink, now_ns};
use slipbound::port::Plant;
use std::io;
use std::net::TcpListener;
use std::thread;
use std::time::Duration;

/// Time between two looks at link and jaws.
const PAUSE: Duration = Duration::from_millis(1);

/// Bytes a client may leave unread before it is taken for dead.
const MOST_UNREAD_BYTES: usize = 1 << 16;

/// One connection served a little: bytes in, time on, bytes out. An error: the connection is over.
fn serve_a_little(link: &mut dyn Link, emulator: &mut Faulty, inbox: &mut Vec<u8>) -> io::Result<()> {
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

/// Serves one connection after the other until `go_on` says no; a new one takes the place of an old. Times of faults
/// count from the call.
pub fn serve_tcp(
    listener: &TcpListener,
    emulator: &mut Faulty,
    plant: &mut dyn Plant,
    mut go_on: impl FnMut() -> bool,
) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let mut inbox = Vec::with_capacity(8192);
    let mut link: Option<TcpLink> = None;
    while go_on() {
        match listener.accept() {
            Ok((stream, _)) => {
                if let Some(mut old) = link.take() {
                    // What it still had to say, a farewell perhaps, came before the new one.
                    inbox.clear();
                    while old.read(&mut inbox).is_ok_and(|count| count > 0) {
                        emulator.receive(now_ns(), &inbox);
                        inbox.clear();
                    }
                    emulator.disconnected(now_ns());
                }
                inbox.clear();
                link = Some(TcpLink::new(stream)?);
                emulator.connected(now_ns());
            }
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => {}
            Err(e) if matches!(e.kind(), io::ErrorKind::ConnectionAborted | io::ErrorKind::Interrupted) => {}
            Err(e) => return Err(e),
        }
        tick(emulator, plant);
        let served = link.as_mut().map_or(Ok(()), |link| serve_a_little(link, emulator, &mut inbox));
        if link.is_some() && (emulator.take_hang_up() || served.is_err()) {
            link = None;
            emulator.disconnected(now_ns());
        }
        thread::sleep(PAUSE);
    }
    Ok(())
}

/// Serves one link, a serial line say, until `go_on` says no or the link is over.
pub fn serve_link(
    link: &mut dyn Link,
    emulator: &mut Faulty,
    plant: &mut dyn Plant,
    mut go_on: impl FnMut() -> bool,
) -> io::Result<()> {
    let mut inbox = Vec::with_capacity(8192);
    emulator.connected(now_ns());
    while go_on() && !emulator.take_hang_up() {
        tick(emulator, plant);
        serve_a_little(link, emulator, &mut inbox)?;
        thread::sleep(PAUSE);
    }
    emulator.disconnected(now_ns());
    Ok(())
}

fn tick(emulator: &mut Faulty, plant: &mut dyn Plant) {
    let now_ns = now_ns();
    emulator.tick(now_ns, plant);
    plant.advance_to(now_ns);
}
