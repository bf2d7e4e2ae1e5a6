//! Motion JPEG over HTTP: `http://HOST[:PORT]/PATH`, as cameras on a network and small computers serve it.
//!
//! ```text
//!   connect --> head --> multipart parts --> JPEG --> frame       a part that is no whole JPEG is torn
//!      ^                    | cut, silent for 3 s, cannot be followed
//!      '--- wait 0.1 s, 0.2 s .. 3 s
//! ```
//!
//! The time of a frame is the server's `X-Timestamp` where it sends one (clock: device), else the arrival time. Once a
//! stamp is not later than the one before it, or missing, arrival times are used for the rest of the source
//! ([`Stamps`]). A torn frame has the time of its own stamp; without one it has no time among stamped frames.

use super::camera::{Camera, CameraTally};
use super::chunked::{self, Chunked};
use super::multipart::{Found, Multipart};
use super::stamps::Stamps;
use super::{Error, picture};
use crate::link::now_ns;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// Longest wait of one call.
const LONGEST_WAIT: Duration = Duration::from_millis(100);
/// Longest wait for a connection.
const CONNECT: Duration = Duration::from_secs(2);
/// A stream without a byte for this long is reopened, ns; so is a request without an answer.
const SILENT_NS: u64 = 3_000_000_000;
/// Wait before the first try to connect again, and the longest, ns: it doubles.
const FIRST_RETRY_NS: u64 = 100_000_000;
const LONGEST_RETRY_NS: u64 = 3_000_000_000;
/// Longest head of an answer, bytes.
const LONGEST_HEAD_BYTES: usize = 16 << 10;

/// What a URL names.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Address {
    host: String,
    port: u16,
    path: String,
}

/// The frames of a stream. It reconnects by itself after it was cut off.
#[derive(Debug)]
pub struct MjpegHttp {
    address: Address,
    stream: Option<Stream>,
    retry_at_ns: u64,
    retry_ns: u64,
    seq: u64,
    stamps: Stamps,
    tally: Arc<CameraTally>,
    bytes: Vec<u8>,
}

/// An open connection.
#[derive(Debug)]
struct Stream {
    socket: TcpStream,
    /// Decodes the chunks, where the answer comes in chunks.
    chunked: Option<Chunked>,
    parts: Multipart,
    has_ended: bool,
    heard_ns: u64,
}

impl MjpegHttp {
    /// Connects. Fails when nobody answers, or when the answer is not a stream of images.
    pub fn open(url: &str) -> Result<Camera, Error> {
        let address = Address::parse(url).map_err(|expected| Error::Address { uri: url.into(), expected })?;
        let stream = Stream::open(&address).map_err(|source| Error::Stream { uri: url.into(), source })?;
        let tally = Arc::new(CameraTally::default());
        let source = MjpegHttp {
            address,
            stream: Some(stream),
            retry_at_ns: 0,
            retry_ns: FIRST_RETRY_NS,
            seq: 0,
            stamps: Stamps::default(),
            tally: tally.clone(),
            bytes: vec![0; 64 << 10],
        };
        let facts = vec![("stream".into(), url.into()), ("format".into(), "Motion JPEG over HTTP".into())];
        Ok(Camera { source: Box::new(source), facts, tally })
    }

    /// Tries to reconnect when it is time for that; otherwise waits for a moment.
    fn reconnect(&mut self) {
        let now = now_ns();
        if now < self.retry_at_ns {
            thread::sleep(Duration::from_nanos(self.retry_at_ns - now).min(LONGEST_WAIT));
            return;
        }
        match Stream::open(&self.address) {
            Ok(stream) => {
                self.stream = Some(stream);
                self.stamps.connect();
                self.tally.change(|counts| counts.returns_count += 1);
            }
            Err(_) => {
                // Nobody answers yet: the reason does not matter.
                self.retry_at_ns = now_ns() + self.retry_ns;
                self.retry_ns = (2 * self.retry_ns).min(LONGEST_RETRY_NS);
            }
        }
    }

    /// Gives up the connection.
    fn give_up(&mut self) {
        self.stream = None;
        self.retry_at_ns = now_ns() + self.retry_ns;
        self.retry_ns = (2 * self.retry_ns).min(LONGEST_RETRY_NS);
    }

    /// `stamp_ns`: the stamp of its part, where that came.
    fn torn(&mut self, into: &mut FrameBuffer, reason: String, stamp_ns: Option<u64>) -> Next {
        let stamp_ns = stamp_ns.filter(|ns| *ns > 0);
        let device_ns = stamp_ns.and_then(|ns| self.stamps.device_ns(Some(ns)));
        self.stamp(into, device_ns);
        if device_ns.is_none() && self.stamps.are_used() {
            // Its arrival would be the time of another clock, between frames of the server's.
            (into.time_ns, into.clock) = (None, Clock::Unknown);
        }
        self.tally.change(|counts| counts.torn_count += 1);
        Next::Torn { reason }
    }

    /// Number and time of the frame.
    fn stamp(&mut self, into: &mut FrameBuffer, device_ns: Option<u64>) {
        into.seq = self.seq;
        self.seq += 1;
        into.time_ns = device_ns.or(self.stream.as_ref().map(|stream| stream.heard_ns)).or_else(|| Some(now_ns()));
        into.clock = if device_ns.is_some() { Clock::Device } else { Clock::Host };
        into.label.clear();
    }

    /// The stream ended in the middle of something, or between two frames.
    fn cut(&mut self, into: &mut FrameBuffer, why: &str) -> Next {
        let begun_bytes = self.stream.as_ref().map_or(0, |stream| stream.parts.begun_bytes());
        self.give_up();
        if begun_bytes == 0 {
            return Next::Silent;
        }
        into.encoded.clear();
        self.torn(into, format!("{why} after {begun_bytes} bytes of a frame"), None)
    }

    /// The stream cannot be followed any further.
    fn lost_track(&mut self, into: &mut FrameBuffer, why: String) -> Next {
        into.encoded.clear();
        let torn = self.torn(into, why, None);
        self.give_up();
        torn
    }
}

impl FrameSource for MjpegHttp {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let from_ns = now_ns();
        loop {
            let Some(stream) = &mut self.stream else {
                self.reconnect();
                return Ok(Next::Silent);
            };
            match stream.parts.next(&mut into.encoded) {
                Ok(Found::Part(head)) => {
                    let decoded = picture::decode(into);
                    if let Err(reason) = decoded {
                        return Ok(self.torn(into, reason, head.time_ns));
                    }
                    self.retry_ns = FIRST_RETRY_NS;
                    let device_ns = self.stamps.device_ns(head.time_ns);
                    self.tally.frame(stream.heard_ns, device_ns.is_some());
                    if self.stamps.are_distrusted() {
                        self.tally.change(|counts| counts.stamps_are_distrusted = true);
                    }
                    self.stamp(into, device_ns);
                    return Ok(Next::Frame);
                }
                Ok(Found::Nothing) if !stream.has_ended => {}
                Ok(Found::Nothing | Found::End) => return Ok(self.cut(into, "the stream ended")),
                Err(fault) => return Ok(self.lost_track(into, fault.to_string())),
            }
            match stream.socket.read(&mut self.bytes) {
                Ok(0) => return Ok(self.cut(into, "the connection was closed")),
                Ok(count) => {
                    stream.heard_ns = now_ns();
                    if let Err(fault) = stream.push(&self.bytes[..count]) {
                        return Ok(self.lost_track(into, fault.to_string()));
                    }
                    // Bytes may trickle in for ever without a frame among them.
                    if stream.heard_ns.saturating_sub(from_ns) > LONGEST_WAIT.as_nanos() as u64 {
                        return Ok(Next::Silent);
                    }
                }
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    return Ok(match now_ns().saturating_sub(stream.heard_ns) > SILENT_NS {
                        true => self.cut(into, "the stream stalled"),
                        false => Next::Silent,
                    });
                }
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Ok(self.cut(into, &format!("the connection broke ({e})"))),
            }
        }
    }
}

impl Stream {
    fn open(address: &Address) -> io::Result<Self> {
        let mut failed = io::Error::other("the host's name has no address");
        for socket_address in (address.host.as_str(), address.port).to_socket_addrs()? {
            match TcpStream::connect_timeout(&socket_address, CONNECT) {
                Ok(socket) => return Stream::ask(socket, address),
                Err(e) => failed = e,
            }
        }
        Err(failed)
    }

    /// Requests the stream.
    fn ask(mut socket: TcpStream, address: &Address) -> io::Result<Self> {
        socket.set_read_timeout(Some(LONGEST_WAIT))?;
        socket.set_write_timeout(Some(CONNECT))?;
        socket.write_all(address.request().as_bytes())?;
        let (head, begun) = read_head(&mut socket)?;
        let parts = Multipart::new(&boundary(&head).map_err(io::Error::other)?);
        let chunked = comes_in_chunks(&head).map_err(io::Error::other)?.then(Chunked::new);
        let mut stream = Stream { socket, chunked, parts, has_ended: false, heard_ns: now_ns() };
        stream.push(&begun).map_err(io::Error::other)?;
        Ok(stream)
    }

    /// Takes received bytes.
    fn push(&mut self, bytes: &[u8]) -> Result<(), chunked::Fault> {
        let Stream { chunked, parts, has_ended, .. } = self;
        match chunked {
            Some(chunked) => *has_ended = !chunked.unpack(bytes, |run| parts.push(run))?,
            None => parts.push(bytes),
        }
        Ok(())
    }
}

/// The head of the answer, and what came after it.
fn read_head(socket: &mut TcpStream) -> io::Result<(String, Vec<u8>)> {
    let until_ns = now_ns() + SILENT_NS;
    let (mut bytes, mut piece) = (Vec::new(), [0; 1024]);
    loop {
        let ends = [&b"\r\n\r\n"[..], b"\n\n"];
        let end = ends.iter().filter_map(|end| Some(position(&bytes, end)? + end.len())).min();
        if let Some(end) = end {
            let begun = bytes.split_off(end);
            return Ok((String::from_utf8_lossy(&bytes).into_owned(), begun));
        }
        if bytes.len() > LONGEST_HEAD_BYTES {
            return Err(io::Error::other(format!("expected a head of at most {LONGEST_HEAD_BYTES} bytes, got more")));
        }
        match socket.read(&mut piece) {
            Ok(0) => return Err(io::Error::other("expected an answer, got a closed connection")),
            Ok(count) => bytes.extend_from_slice(&piece[..count]),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(e) => return Err(e),
        }
        if now_ns() > until_ns {
            return Err(io::Error::other(format!(
                "expected an answer within {} s, got none",
                SILENT_NS / 1_000_000_000
            )));
        }
    }
}

fn position(bytes: &[u8], of: &[u8]) -> Option<usize> {
    bytes.windows(of.len()).position(|window| window == of)
}

/// The value of this name in the head of an answer.
fn value<'a>(head: &'a str, name: &str) -> Option<&'a str> {
    let mut fields = head.lines().skip(1).filter_map(|line| line.split_once(':'));
    fields.find(|(n, _)| n.trim().eq_ignore_ascii_case(name)).map(|(_, value)| value.trim())
}

/// Whether the answer comes in chunks; the error names an unsupported encoding.
fn comes_in_chunks(head: &str) -> Result<bool, String> {
    match value(head, "transfer-encoding") {
        None => Ok(false),
        Some(encoding) if encoding.eq_ignore_ascii_case("identity") => Ok(false),
        Some(encoding) if encoding.eq_ignore_ascii_case("chunked") => Ok(true),
        Some(encoding) => Err(format!("expected the transfer encoding chunked or none, got `{encoding}`")),
    }
}

/// The boundary that the head of an answer names; the error says what is wrong with it.
fn boundary(head: &str) -> Result<String, String> {
    let status = head.lines().next().unwrap_or_default();
    let code = status.split_whitespace().nth(1).unwrap_or_default();
    match (code, value(head, "location")) {
        ("200", _) => {}
        (_, Some(elsewhere)) => return Err(format!("expected a stream, got `{status}`: try {elsewhere}")),
        ("401", _) => {
            return Err(format!("expected a stream, got `{status}`: streams behind a password are not supported"));
        }
        _ => return Err(format!("expected a stream, got `{status}`")),
    }
    let kind = value(head, "content-type").unwrap_or_default();
    let lower = kind.to_ascii_lowercase();
    if !lower.starts_with("multipart/") {
        return Err(format!(
            "expected the content type multipart/x-mixed-replace, got `{kind}`: is this the address of the stream, not of \
             its page or of a single picture?"
        ));
    }
    // Found in the lower-case copy, which has the same length: taken from the original.
    let name = lower.find("boundary=").map(|at| &kind[at + "boundary=".len()..]).unwrap_or_default();
    let name = name.split(';').next().unwrap_or_default().trim().trim_matches('"');
    if name.trim_start_matches('-').is_empty() {
        return Err(format!("expected a boundary in the content type, got `{kind}`"));
    }
    Ok(name.to_owned())
}

impl Address {
    /// `http://HOST[:PORT][/PATH]`; the error says what was expected.
    fn parse(url: &str) -> Result<Self, String> {
        let rest = url.strip_prefix("http://").ok_or("http://HOST[:PORT]/PATH")?;
        let (authority, path) = rest.find(['/', '?']).map_or((rest, ""), |at| rest.split_at(at));
        if authority.contains('@') {
            return Err("an address without a user and a password, which are not supported".into());
        }
        let (host, port) = match authority.rsplit_once(':').filter(|(_, port)| !port.ends_with(']')) {
            Some((host, port)) => (host, port.parse().map_err(|_| format!("a port of 1 to 65535, got `{port}`"))?),
            None => (authority, 80),
        };
        if host.is_empty() || port == 0 {
            return Err("http://HOST[:PORT]/PATH".into());
        }
        if path.bytes().any(|byte| byte.is_ascii_control() || byte == b' ') {
            return Err("a path without blanks".into());
        }
        let path = if path.starts_with('/') { path.to_owned() } else { format!("/{path}") };
        Ok(Address { host: host.trim_matches(['[', ']']).to_owned(), port, path })
    }

    /// The request of the stream. HTTP/1.0, because few servers answer that in chunks.
    fn request(&self) -> String {
        let Address { host, port, path } = self;
        let host = if host.contains(':') { format!("[{host}]") } else { host.clone() };
        let version = env!("CARGO_PKG_VERSION");
        format!("GET {path} HTTP/1.0\r\nHost: {host}:{port}\r\nUser-Agent: slipbound/{version}\r\n\r\n")
    }
}

#[cfg(test)]
mod tests;
