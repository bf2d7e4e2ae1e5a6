//! Streams that only the installed program `ffmpeg` reads: `rtsp://`, `https://`, `udp://` and the like.
//!
//! Its own buffers are made small (`nobuffer`, `low_delay`, short probing); its remaining delay is unknown, because the
//! stream carries no clock of ours. Times are arrival times. When it ends, or gives no frame for a while, it is
//! restarted.
//!
//! ```text
//!   ffmpeg --PPM--> reading thread --an image---> next: waits a tenth of a second at most
//!      ^                 '<--------a buffer---------'  |
//!      '------- ended, and restarted after a while-----'
//! ```

use super::Error;
use super::camera::{Camera, CameraTally};
use super::ffmpeg::{EVERY_FRAME_ONCE, Pictures, Running, is_older, read_ppm};
use crate::link::now_ns;
use crate::printable::without_passwords;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use std::io::{self, ErrorKind};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

/// Addresses that are handed to the program.
pub(super) const SCHEMES: [&str; 8] =
    ["rtsp://", "rtsps://", "rtmp://", "https://", "udp://", "rtp://", "srt://", "tcp://"];

/// Options before the address: small buffers.
const LOW_LATENCY: [&str; 10] = [
    "-fflags",
    "nobuffer",
    "-flags",
    "low_delay",
    "-probesize",
    "65536",
    "-analyzeduration",
    "500000",
    "-max_delay",
    "100000",
];

/// Wait before the first restart, and the longest: it doubles.
const FIRST_RETRY: Duration = Duration::from_millis(200);
const LONGEST_RETRY: Duration = Duration::from_secs(3);

/// Longest time without a frame before the program is ended: until its first one, including connecting and probing at
/// every start, and later.
const LONGEST_START: Duration = Duration::from_secs(15);
const LONGEST_SILENCE: Duration = Duration::from_secs(3);

/// Longest wait of one call.
const LONGEST_WAIT: Duration = Duration::from_millis(100);

/// The frames of a stream.
#[derive(Debug)]
pub struct FfmpegLive {
    uri: String,
    started: Option<Started>,
    /// Which of [`EVERY_FRAME_ONCE`] the program knows.
    dialect: usize,
    retry: Duration,
    retry_at: Instant,
    seq: u64,
    tally: Arc<CameraTally>,
}

/// The program and the thread that reads its images; the thread ends with the program.
#[derive(Debug)]
struct Started {
    running: Running,
    pictures: Receiver<Result<FrameBuffer, String>>,
    buffers: Sender<FrameBuffer>,
    /// Whether a frame came.
    has_given: bool,
    /// When the last frame came, or the program was started.
    heard_at: Instant,
}

impl FfmpegLive {
    /// Starts the program. Whether the stream is there shows with its first frame.
    pub fn open(uri: &str) -> Result<Camera, Error> {
        let shown = without_passwords(uri).into_owned();
        let started = Started::new(uri, 0).map_err(|source| match source.kind() {
            ErrorKind::NotFound => Error::FfmpegMissing { path: shown.as_str().into(), codec: "a stream".into() },
            _ => Error::FfmpegStart { path: shown.as_str().into(), source },
        })?;
        let tally = Arc::new(CameraTally::default());
        let source = FfmpegLive {
            uri: uri.into(),
            started: Some(started),
            dialect: 0,
            retry: FIRST_RETRY,
            retry_at: Instant::now(),
            seq: 0,
            tally: tally.clone(),
        };
        let facts = vec![("stream".into(), shown), ("format".into(), "whatever ffmpeg reads".into())];
        Ok(Camera { source: Box::new(source), facts, tally })
    }

    /// Restarts the program when it is time; silent meanwhile.
    fn start_again(&mut self) -> Next {
        let rest = self.retry_at.saturating_duration_since(Instant::now());
        if !rest.is_zero() {
            thread::sleep(rest.min(LONGEST_WAIT));
            return Next::Silent;
        }
        self.retry = (2 * self.retry).min(LONGEST_RETRY);
        self.retry_at = Instant::now() + self.retry;
        self.started = Started::new(&self.uri, self.dialect).ok();
        Next::Silent
    }

    /// The program has ended, or is ended because it is silent. A stream that never gave a frame was requested wrongly,
    /// and the program says how.
    fn ended(&mut self, got: String) -> Result<Next, SourceError> {
        let stderr = self.started.take().map(|started| started.running.stderr_tail()).unwrap_or_default();
        self.retry_at = Instant::now() + self.retry;
        if self.seq > 0 {
            return Ok(Next::Silent);
        }
        if self.dialect == 0 && is_older(&stderr) {
            (self.dialect, self.retry_at) = (1, Instant::now());
            return Ok(Next::Silent);
        }
        let stderr = if stderr.is_empty() { "nothing".into() } else { stderr };
        let stderr = without_passwords(&stderr).into_owned(); // the program tells the whole address
        Err(Error::Ffmpeg { path: without_passwords(&self.uri).as_ref().into(), got, stderr }.into())
    }
}

impl FrameSource for FfmpegLive {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let Some(started) = &mut self.started else { return Ok(self.start_again()) };
        let picture = match started.pictures.recv_timeout(LONGEST_WAIT) {
            Ok(picture) => picture,
            Err(RecvTimeoutError::Disconnected) => return self.ended("none".into()),
            Err(RecvTimeoutError::Timeout) => {
                let longest = if started.has_given { LONGEST_SILENCE } else { LONGEST_START };
                if started.heard_at.elapsed() < longest {
                    return Ok(Next::Silent);
                }
                return self.ended(format!("nothing within {} s", longest.as_secs()));
            }
        };
        into.label.clear();
        (into.seq, into.time_ns, into.clock) = (self.seq, Some(now_ns()), Clock::Host);
        self.seq += 1;
        match picture {
            Ok(picture) => {
                started.heard_at = Instant::now();
                // An older program is started twice before the first frame of all: that is no return.
                let is_first = !std::mem::replace(&mut started.has_given, true);
                let is_back = is_first && self.tally.counts().frames_count > 0;
                self.retry = FIRST_RETRY;
                let time_ns = picture.time_ns.unwrap_or_else(now_ns);
                (into.size, into.format, into.time_ns) = (picture.size, picture.format, Some(time_ns));
                into.encoded.clear();
                let buffer = FrameBuffer {
                    pixels: std::mem::replace(&mut into.pixels, picture.pixels),
                    ..FrameBuffer::default()
                };
                let _ = started.buffers.send(buffer); // the program has ended: its thread needs none
                self.tally.change(|counts| counts.returns_count += u64::from(is_back));
                self.tally.frame(time_ns, false);
                Ok(Next::Frame)
            }
            Err(why) => {
                into.encoded.clear();
                self.tally.change(|counts| counts.torn_count += 1);
                self.ended(String::new())?;
                Ok(Next::Torn { reason: format!("ffmpeg ended within a frame: {why}") })
            }
        }
    }
}

impl Started {
    /// Starts the program and a thread that reads what it gives.
    fn new(uri: &str, dialect: usize) -> io::Result<Started> {
        let over_tcp = ["-rtsp_transport", "tcp"];
        let transport = if uri.starts_with("rtsp") { &over_tcp[..] } else { &[] };
        let options = [&LOW_LATENCY[..], transport].concat();
        let (running, from) = Running::start(&options, uri.as_ref(), EVERY_FRAME_ONCE[dialect])?;
        let (to, pictures) = sync_channel(1);
        let (buffers, emptied) = channel();
        thread::spawn(move || read_all(from, &to, &emptied));
        Ok(Started { running, pictures, buffers, has_given: false, heard_at: Instant::now() })
    }
}

/// Reads images until the program ends or they are no longer taken.
fn read_all(mut from: Pictures, to: &SyncSender<Result<FrameBuffer, String>>, emptied: &Receiver<FrameBuffer>) {
    loop {
        let mut picture = emptied.try_recv().unwrap_or_default();
        let read = match read_ppm(&mut from, &mut picture) {
            Ok(true) => Ok(picture),
            Ok(false) => return,
            Err(e) => Err(e.to_string()),
        };
        let is_last = read.is_err();
        let read = read.map(|picture| FrameBuffer { time_ns: Some(now_ns()), ..picture });
        if to.send(read).is_err() || is_last {
            return;
        }
    }
}
