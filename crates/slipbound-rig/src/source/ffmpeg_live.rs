//! Streams that only the installed program `ffmpeg` reads: `rtsp://`, `https://`, `udp://` and the like.
//!
//! Its own buffers are made small (`nobuffer`, `low_delay`, short probing); what is left of its delay cannot be known, for the
//! stream carries no clock of ours. Times are those of arrival. When it ends it is started again.

use super::Error;
use super::camera::{Camera, CameraTally};
use super::ffmpeg::{Running, read_ppm};
use crate::link::now_ns;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use std::io::{self, ErrorKind};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// Addresses that are handed to the program.
pub(super) const SCHEMES: [&str; 8] =
    ["rtsp://", "rtsps://", "rtmp://", "https://", "udp://", "rtp://", "srt://", "tcp://"];

/// Options before the address: small buffers, and an end when nothing comes for five seconds.
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

/// Wait before the first start anew, and the longest: it doubles.
const FIRST_RETRY: Duration = Duration::from_millis(200);
const LONGEST_RETRY: Duration = Duration::from_secs(3);

/// The frames of a stream. `next` waits for as long as the program does: it belongs on a thread of its own.
#[derive(Debug)]
pub struct FfmpegLive {
    uri: String,
    running: Option<Running>,
    retry: Duration,
    seq: u64,
    tally: Arc<CameraTally>,
}

impl FfmpegLive {
    /// Starts the program. Whether the stream is there shows with its first frame.
    pub fn open(uri: &str) -> Result<Camera, Error> {
        let running = start(uri).map_err(|source| match source.kind() {
            ErrorKind::NotFound => Error::FfmpegMissing { path: uri.into(), codec: "a stream".into() },
            _ => Error::FfmpegStart { path: uri.into(), source },
        })?;
        let tally = Arc::new(CameraTally::default());
        let retry = FIRST_RETRY;
        let source = FfmpegLive { uri: uri.into(), running: Some(running), retry, seq: 0, tally: tally.clone() };
        let facts = vec![("stream".into(), uri.into()), ("format".into(), "whatever ffmpeg reads".into())];
        Ok(Camera { source: Box::new(source), facts, tally })
    }
}

impl FrameSource for FfmpegLive {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let Some(running) = &mut self.running else {
            thread::sleep(self.retry);
            self.retry = (2 * self.retry).min(LONGEST_RETRY);
            self.running = start(&self.uri).ok();
            return Ok(Next::Silent);
        };
        into.encoded.clear();
        into.label.clear();
        let read = read_ppm(running.stdout(), into);
        (into.seq, into.time_ns, into.clock) = (self.seq, Some(now_ns()), Clock::Host);
        match read {
            Ok(true) => {
                if self.retry > FIRST_RETRY {
                    self.tally.change(|counts| counts.returns_count += 1);
                    self.retry = FIRST_RETRY;
                }
                self.seq += 1;
                self.tally.frame(now_ns(), false);
                Ok(Next::Frame)
            }
            Ok(false) => {
                let why = self.running.take().map(Running::last_words).unwrap_or_default();
                // A stream that never gave a frame was asked for wrongly, and the program says how.
                match self.seq {
                    0 => Err(Error::Ffmpeg { path: self.uri.as_str().into(), got: "none".into(), stderr: why }.into()),
                    _ => Ok(Next::Silent),
                }
            }
            Err(e) => {
                self.running = None;
                self.seq += 1;
                self.tally.change(|counts| counts.torn_count += 1);
                Ok(Next::Torn { reason: format!("ffmpeg ended within a frame: {e}") })
            }
        }
    }
}

fn start(uri: &str) -> io::Result<Running> {
    let over_tcp = ["-rtsp_transport", "tcp"];
    let transport = if uri.starts_with("rtsp") { &over_tcp[..] } else { &[] };
    Running::start(&[&LOW_LATENCY[..], transport].concat(), uri.as_ref(), "-fps_mode")
}
