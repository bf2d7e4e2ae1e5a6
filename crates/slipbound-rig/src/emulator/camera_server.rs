//! An emulated camera: JPEGs over HTTP, served as by a Raspberry Pi; every client gets the newest.

use std::io::{self, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// Longest head of a request, bytes.
const LONGEST_HEAD_BYTES: usize = 16 << 10;
/// A client that accepts no byte for this long is gone.
const LONGEST_WRITE: Duration = Duration::from_secs(2);
/// Time between two checks for a client, and for the end.
const PAUSE: Duration = Duration::from_millis(20);

/// The newest image.
#[derive(Default)]
struct Shot {
    jpeg: Vec<u8>,
    time_ns: u64,
    /// Images so far.
    count: u64,
    is_over: bool,
}

type Slot = Arc<(Mutex<Shot>, Condvar)>;

/// Serves images on a port as `multipart/x-mixed-replace`, each with its time as `X-Timestamp`, to any number of
/// clients; a slow one misses images.
pub struct CameraServer {
    address: SocketAddr,
    slot: Slot,
}

impl CameraServer {
    /// Takes a port.
    pub fn new(listener: TcpListener) -> io::Result<Self> {
        let address = listener.local_addr()?;
        listener.set_nonblocking(true)?;
        let slot = Slot::default();
        let theirs = slot.clone();
        thread::spawn(move || {
            while !theirs.0.lock().unwrap_or_else(PoisonError::into_inner).is_over {
                match listener.accept() {
                    Ok((socket, _)) => {
                        let slot = theirs.clone();
                        thread::spawn(move || drop(serve(socket, &slot))); // a client may hang up at any time
                    }
                    Err(_) => thread::sleep(PAUSE),
                }
            }
        });
        Ok(CameraServer { address, slot })
    }

    /// Its address.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Shows the next image and its time.
    pub fn show(&self, jpeg: &[u8], time_ns: u64) {
        let mut shot = self.slot.0.lock().unwrap_or_else(PoisonError::into_inner);
        shot.jpeg.clear();
        shot.jpeg.extend_from_slice(jpeg);
        shot.time_ns = time_ns;
        shot.count += 1;
        self.slot.1.notify_all();
    }
}

impl Drop for CameraServer {
    fn drop(&mut self) {
        self.slot.0.lock().unwrap_or_else(PoisonError::into_inner).is_over = true;
        self.slot.1.notify_all();
    }
}

fn serve(mut socket: TcpStream, slot: &Slot) -> io::Result<()> {
    socket.set_nonblocking(false)?;
    socket.set_nodelay(true)?;
    socket.set_read_timeout(Some(LONGEST_WRITE))?;
    socket.set_write_timeout(Some(LONGEST_WRITE))?;
    let (mut head, mut byte) = (Vec::new(), [0]);
    while !head.ends_with(b"\r\n\r\n") && head.len() < LONGEST_HEAD_BYTES {
        socket.read_exact(&mut byte)?;
        head.push(byte[0]);
    }
    if !head.starts_with(b"GET ") {
        return socket.write_all(b"HTTP/1.0 405 Method Not Allowed\r\n\r\n");
    }
    socket
        .write_all(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n\r\n--frame\r\n")?;
    let (mut seen_count, mut part) = (0, Vec::new());
    loop {
        let shot = slot.0.lock().unwrap_or_else(PoisonError::into_inner);
        let shot = slot.1.wait_while(shot, |shot| shot.count == seen_count && !shot.is_over);
        let shot = shot.unwrap_or_else(PoisonError::into_inner);
        if shot.is_over {
            return Ok(());
        }
        seen_count = shot.count;
        let (seconds, micros) = (shot.time_ns / 1_000_000_000, shot.time_ns / 1000 % 1_000_000);
        let count = shot.jpeg.len();
        part.clear();
        write!(
            part,
            "Content-Type: image/jpeg\r\nContent-Length: {count}\r\nX-Timestamp: {seconds}.{micros:06}\r\n\r\n"
        )?;
        part.extend_from_slice(&shot.jpeg);
        part.extend_from_slice(b"\r\n--frame\r\n");
        drop(shot);
        socket.write_all(&part)?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead as _, BufReader};

    fn client(server: &CameraServer, request: &str) -> BufReader<TcpStream> {
        let mut socket = TcpStream::connect(server.address()).expect("it listens");
        socket.set_read_timeout(Some(Duration::from_secs(10))).expect("a socket");
        socket.write_all(request.as_bytes()).expect("sent");
        BufReader::new(socket)
    }

    /// The lines up to an empty one.
    fn head(client: &mut BufReader<TcpStream>) -> String {
        let mut text = String::new();
        while client.read_line(&mut text).is_ok_and(|count| count > 2) {}
        text
    }

    /// The next image with its header.
    fn picture(client: &mut BufReader<TcpStream>, count: usize) -> (String, Vec<u8>) {
        let head = head(client);
        let mut bytes = vec![0; count + 2];
        client.read_exact(&mut bytes).expect("a picture");
        assert_eq!(bytes.split_off(count), b"\r\n");
        let mut boundary = String::new();
        client.read_line(&mut boundary).expect("a boundary");
        assert_eq!(boundary, "--frame\r\n");
        (head, bytes)
    }

    #[test]
    fn every_client_gets_the_newest_picture_then_each_new_one_and_an_end() {
        let server = CameraServer::new(TcpListener::bind("127.0.0.1:0").expect("a port")).expect("served");
        server.show(b"old", 0);
        server.show(b"first", 1_250_000_000);
        let mut early = client(&server, "GET /stream HTTP/1.1\r\nHost: x\r\n\r\n");
        assert!(head(&mut early).starts_with("HTTP/1.0 200 OK\r\n"));
        let mut boundary = String::new();
        early.read_line(&mut boundary).expect("a boundary");
        let (told, bytes) = picture(&mut early, 5);
        assert!(told.contains("Content-Length: 5\r\n") && told.contains("X-Timestamp: 1.250000\r\n"), "{told}");
        assert_eq!(bytes, b"first");
        server.show(b"second", 2_000_000_000);
        assert_eq!(picture(&mut early, 6).1, b"second");

        let mut wrong = client(&server, "POST / HTTP/1.1\r\n\r\n");
        assert!(head(&mut wrong).starts_with("HTTP/1.0 405 "));
        let address = server.address();
        drop(server);
        let mut rest = Vec::new();
        early.read_to_end(&mut rest).expect("it ends");
        assert!(rest.is_empty());
        let refused = |_: &u32| {
            thread::sleep(PAUSE);
            TcpStream::connect(address).is_err()
        };
        assert!((0..250).find(refused).is_some(), "nobody listens any more");
    }
}
