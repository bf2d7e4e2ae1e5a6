//! Cameras of this computer, through the kernel's Video4Linux2: `v4l2:CAMERA?key=value&key=value`.
//!
//! ```text
//!   choose by path, serial or name -> negotiate -> settle -> lock -> stream --> MJPG, YUYV, GREY -> frame
//!      ^                                                               | gone, or silent for 3 s
//!      '---------------------- look for it every half second ----------'
//! ```
//!
//! | key | what it sets | without it |
//! |---|---|---|
//! | `format` | `mjpg`, `yuyv` or `grey` | the first of these that the camera has |
//! | `size` | `640x480` | what the camera is set to |
//! | `rate_hz` | frames per second | what the camera is set to |
//! | `exposure` `gain` `white_balance` `focus` | the camera's own number, or `auto` | locked where the camera has settled |
//!
//! The time of a frame is the driver's, on the system's monotonic clock. A gap in the driver's numbers is a frame that was
//! lost, and counted.
//!
//! A camera that comes back is known by its serial number, or where that is not its own by its USB port, not by its
//! address, which another camera may have by then (`nodes.rs`). It gets its first settings again (`negotiated.rs`). If its rate or a locked value differs, its
//! first frame is torn and states the difference: the frames that follow do not match the rest frame. If it no longer
//! has the format or size, or another camera is at its address, it stays away, and one torn frame says why.

mod locks;
mod negotiated;
mod nodes;
mod options;
mod sys;

pub use nodes::cameras;

use super::camera::{Camera, CameraTally, IS_BACK};
use super::{Error, picture};
use crate::devices::CameraNode;
use crate::link::now_ns;
use negotiated::{NegotiatedSettings, difference, pinned};
use nodes::{CameraId, choose, choose_again, four_letters};
use options::{Lock, Options, PixelKind};
use slipbound::image::SizePx;
use slipbound::pixels::yuyv;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, PixelFormat, SourceError};
use std::fs;
use std::io;
use std::sync::Arc;
use std::thread;
use std::time::Duration;
use sys::{Device, Picture, PictureLayout, Stream};

/// Longest wait of one call, ms.
const LONGEST_WAIT_MS: u16 = 100;
/// A camera without a frame for this long is reopened, ns; a slow one for this many of its periods.
const SILENT_NS: u64 = 3_000_000_000;
const SILENT_PERIODS: f64 = 3.0;
/// Time between two searches for a camera that is gone, ns.
const RETRY_NS: u64 = 500_000_000;
/// Buffers of the driver: few, because a waiting image gets old, but enough for one late turn of this thread.
const BUFFERS_COUNT: u32 = 4;
/// Frames skipped before exposure and the like are locked, and the longest time for that, ns.
const SETTLE_COUNT: u32 = 15;
const SETTLE_NS: u64 = 1_500_000_000;
/// Frames skipped after that, beyond those that wait: the first ones were exposed in part before.
const LOCKED_COUNT: u32 = 3;

/// The frames of a camera. It comes back by itself after it was unplugged.
#[derive(Debug)]
pub struct V4l2 {
    /// What is requested when it comes back.
    options: Options,
    /// Which camera it is, and what it was set to first.
    id: CameraId,
    first: NegotiatedSettings,
    /// Why it stays away, or how its settings differ since it is back, until that is reported.
    news: Option<String>,
    /// Why it stays away, as last reported.
    refused: Option<String>,
    open: Option<Open>,
    retry_at_ns: u64,
    seq: u64,
    tally: Arc<CameraTally>,
}

/// A camera that streams.
#[derive(Debug)]
struct Open {
    stream: Stream,
    kind: PixelKind,
    layout: PictureLayout,
    /// Longest silence, ns.
    silent_ns: u64,
    heard_ns: u64,
    last_sequence: Option<u32>,
}

impl V4l2 {
    /// Finds, sets and starts the camera.
    pub fn open(uri: &str) -> Result<Camera, Error> {
        let options = Options::parse(uri).map_err(|expected| Error::Address { uri: uri.into(), expected })?;
        let refused = |problem| match problem {
            Problem::Missing(expected) | Problem::Asked(expected) | Problem::Other(expected) => {
                Error::Address { uri: uri.into(), expected }
            }
            Problem::Device(source) => Error::Stream { uri: uri.into(), source },
        };
        let (node, id) = find(&options.camera).map_err(refused)?;
        let (open, facts, first) = start(&node, &options).map_err(refused)?;
        let tally = Arc::new(CameraTally::default());
        let options = pinned(&options, &first);
        let source = V4l2 { open: Some(open), tally: tally.clone(), ..V4l2::away(options, id, first) };
        Ok(Camera { source: Box::new(source), facts, tally })
    }

    /// A camera that is not open.
    fn away(options: Options, id: CameraId, first: NegotiatedSettings) -> Self {
        let tally = Arc::default();
        V4l2 { options, id, first, news: None, refused: None, open: None, retry_at_ns: 0, seq: 0, tally }
    }

    /// Searches for the camera when it is time for that; otherwise waits for a moment.
    fn look_for_it(&mut self) {
        let now = now_ns();
        if now < self.retry_at_ns {
            thread::sleep(Duration::from_nanos(self.retry_at_ns - now).min(Duration::from_millis(100)));
            return;
        }
        let found = find_again(&self.options.camera, &self.id);
        match found.and_then(|node| start(&node, &self.options)) {
            Ok((open, _, now)) => {
                self.open = Some(open);
                self.refused = None;
                self.news =
                    difference(&self.first, &now).map(|changed| format!("{IS_BACK}, and is set otherwise: {changed}"));
                self.tally.change(|counts| counts.returns_count += 1);
            }
            Err(problem) => self.stays_away(problem),
        }
    }

    /// Searches again later. A camera that is there and cannot be set as before is reported once, and so is another one at
    /// its address.
    fn stays_away(&mut self, problem: Problem) {
        self.retry_at_ns = now_ns() + RETRY_NS;
        // If it is not there, the reason does not matter.
        let (news, expected) = match problem {
            Problem::Missing(_) | Problem::Device(_) => return,
            Problem::Asked(expected) => ("and cannot be set as at first", expected),
            Problem::Other(expected) => ("but it is another one", expected),
        };
        if self.refused.as_ref() != Some(&expected) {
            self.news = Some(format!("{IS_BACK}, {news}: expected {expected}"));
            self.refused = Some(expected);
        }
    }

    fn give_up(&mut self) {
        self.open = None;
        self.retry_at_ns = now_ns() + RETRY_NS;
    }

    /// A torn frame that reports news of the camera.
    fn torn_with_news(&mut self, into: &mut FrameBuffer, reason: String) -> Next {
        into.encoded.clear();
        into.label.clear();
        (into.seq, into.time_ns, into.clock) = (self.seq, None, Clock::Unknown);
        self.seq += 1;
        self.tally.change(|counts| counts.torn_count += 1);
        Next::Torn { reason }
    }
}

impl FrameSource for V4l2 {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        if let Some(news) = self.news.take() {
            return Ok(self.torn_with_news(into, news));
        }
        let Some(open) = &mut self.open else {
            self.look_for_it();
            return Ok(Next::Silent);
        };
        match open.next(into) {
            Err(_) => {
                self.give_up();
                Ok(Next::Silent)
            }
            Ok(None) => {
                if now_ns().saturating_sub(open.heard_ns) > open.silent_ns {
                    self.give_up();
                }
                Ok(Next::Silent)
            }
            Ok(Some((missing_count, read))) => {
                into.seq = self.seq + u64::from(missing_count);
                self.seq = into.seq + 1;
                into.label.clear();
                self.tally.change(|counts| counts.missing_count += u64::from(missing_count));
                match read {
                    Ok(()) => {
                        self.tally.frame(now_ns(), into.clock == Clock::Device);
                        Ok(Next::Frame)
                    }
                    Err(reason) => {
                        self.tally.change(|counts| counts.torn_count += 1);
                        Ok(Next::Torn { reason })
                    }
                }
            }
        }
    }
}

impl Open {
    /// The next image, with the number of images that the driver lost before it; None while there is none.
    fn next(&mut self, into: &mut FrameBuffer) -> io::Result<Option<(u32, Result<(), String>)>> {
        if !self.stream.wait(LONGEST_WAIT_MS)? {
            return Ok(None);
        }
        let (kind, layout) = (self.kind, self.layout);
        let Some((sequence, read)) =
            self.stream.take(|picture| (picture.sequence, read(picture, kind, &layout, into)))?
        else {
            return Ok(None);
        };
        self.heard_ns = now_ns();
        if into.clock != Clock::Device {
            into.time_ns = Some(self.heard_ns);
        }
        let step = self.last_sequence.replace(sequence).map_or(1, |last| sequence.wrapping_sub(last));
        // A driver that restarts its count, or does not count, reports no losses.
        let missing_count = if (1..1000).contains(&step) { step - 1 } else { 0 };
        if kind == PixelKind::Mjpg && read.is_ok() {
            return Ok(Some((missing_count, picture::decode(into)))); // after the buffer was given back
        }
        Ok(Some((missing_count, read)))
    }
}

/// Takes an image out of the driver's buffer; the error says why it is torn.
fn read(picture: Picture<'_>, kind: PixelKind, layout: &PictureLayout, into: &mut FrameBuffer) -> Result<(), String> {
    let is_device = picture.flags & sys::STAMP_MASK == sys::STAMP_MONOTONIC && picture.stamp_ns > 0;
    (into.clock, into.time_ns) = if is_device { (Clock::Device, Some(picture.stamp_ns)) } else { (Clock::Host, None) };
    into.encoded.clear();
    if picture.flags & sys::DAMAGED != 0 {
        return Err("the driver marked it as damaged".into());
    }
    into.size = SizePx::new(layout.width as usize, layout.height as usize);
    let row_bytes = layout.row_bytes as usize;
    match kind {
        PixelKind::Mjpg => into.encoded.extend_from_slice(picture.bytes),
        PixelKind::Yuyv => {
            into.format = PixelFormat::Rgb;
            into.pixels.resize(3 * into.size.area(), 0);
            let stride_bytes = if row_bytes > 0 { row_bytes } else { 2 * into.size.width };
            yuyv::to_rgb(picture.bytes, into.size, stride_bytes, &mut into.pixels).map_err(|e| e.to_string())?;
        }
        PixelKind::Grey => {
            into.format = PixelFormat::Gray;
            let stride_bytes = if row_bytes > 0 { row_bytes } else { into.size.width };
            let rows = slipbound::image::Gray::with_stride(picture.bytes, into.size, stride_bytes);
            let rows = rows.map_err(|e| e.to_string())?;
            into.pixels.clear();
            (0..into.size.height).for_each(|y| into.pixels.extend_from_slice(rows.row(y)));
        }
    }
    Ok(())
}

/// Why a camera cannot be used.
enum Problem {
    /// No camera, or more than one, matches; what was expected.
    Missing(String),
    /// The camera does not have what was requested; what was expected.
    Asked(String),
    /// Its address names another camera now; what was expected.
    Other(String),
    /// The device refused.
    Device(io::Error),
}

impl From<io::Error> for Problem {
    fn from(error: io::Error) -> Self {
        Problem::Device(error)
    }
}

/// What a camera's address names: a name from udev is a link to the node.
fn resolved(camera: &str) -> String {
    let path = fs::canonicalize(camera).ok().filter(|_| camera.starts_with('/'));
    path.map_or(camera.to_owned(), |path| path.display().to_string())
}

/// Finds a camera.
fn find(camera: &str) -> Result<(CameraNode, CameraId), Problem> {
    let (cameras, refused) = cameras();
    let node = choose(&cameras, &resolved(camera)).map_err(|expected| match refused.as_slice() {
        [] => Problem::Missing(expected),
        refused => Problem::Missing(format!("{expected}; not readable: {}", refused.join(", "))),
    })?;
    Ok((node.clone(), CameraId::of(node, &cameras)))
}

/// Finds a camera that was lost.
fn find_again(camera: &str, id: &CameraId) -> Result<CameraNode, Problem> {
    let found = choose_again(&cameras().0, &resolved(camera), id).map_err(Problem::Other)?.cloned();
    found.ok_or_else(|| Problem::Missing("the camera that was lost".into()))
}

/// Sets and starts a camera; returns what was negotiated and locked, in words and as values.
fn start(node: &CameraNode, options: &Options) -> Result<(Open, locks::Facts, NegotiatedSettings), Problem> {
    let device = Device::open(&node.path)?;
    let kind = options.kind_of(&device.formats()).map_err(Problem::Asked)?;
    let set = device.layout()?;
    let (width, height) = options.size.unwrap_or((set.width, set.height));
    let layout = device.set_layout(width, height, kind.four_cc())?;
    if options.size.is_some_and(|size| size != (layout.width, layout.height)) || layout.four_cc != kind.four_cc() {
        let sizes: Vec<String> = device.sizes(kind.four_cc()).iter().map(|(w, h)| format!("{w}x{h}")).collect();
        return Err(Problem::Asked(format!(
            "a size that the camera has in {}: {}; got {width}x{height}",
            four_letters(&kind.four_cc()),
            sizes.join(", ")
        )));
    }
    let rate_hz = device.set_rate(options.rate_hz);
    let mut stream = Stream::start(device, BUFFERS_COUNT)?;
    if locks::can_change(stream.device()) {
        settle(SETTLE_COUNT, now_ns, |wait_ms| skip(&mut stream, wait_ms))?;
    }
    let mut facts = vec![
        ("camera".into(), node.name.clone()),
        ("node".into(), node.path.display().to_string()),
        ("serial".into(), node.serial.clone().unwrap_or_else(|| "none".into())),
        ("format".into(), four_letters(&kind.four_cc())),
        ("size_px".into(), format!("{}x{}", layout.width, layout.height)),
        ("rate_hz".into(), rate_hz.map_or("unknown".into(), |hz| format!("{hz:.2}"))),
    ];
    let (lock_facts, locked) = locks::lock(stream.device(), &options.locks).map_err(Problem::Asked)?;
    facts.extend(lock_facts);
    if options.locks != [Lock::Auto; 4] {
        // What waits was exposed before.
        settle(LOCKED_COUNT, now_ns, |wait_ms| skip(&mut stream, wait_ms))?;
    }
    let negotiated = NegotiatedSettings { kind, size: (layout.width, layout.height), rate_hz, locked };
    Ok((
        Open { stream, kind, layout, silent_ns: silent_ns(rate_hz), heard_ns: now_ns(), last_sequence: None },
        facts,
        negotiated,
    ))
}

/// Longest silence of a camera of this rate, ns.
fn silent_ns(rate_hz: Option<f64>) -> u64 {
    rate_hz.map_or(SILENT_NS, |rate_hz| SILENT_NS.max((SILENT_PERIODS * 1e9 / rate_hz) as u64))
}

/// Skips the next frame if it comes within this time.
fn skip(stream: &mut Stream, wait_ms: u16) -> io::Result<bool> {
    Ok(stream.wait(wait_ms)? && stream.take(|_| ())?.is_some())
}

/// Skips what waits and as many frames more, for a limited time: until exposure and white balance have settled, or the
/// frames show what they were locked at. `skip`: skips the next frame if it comes within so many ms.
fn settle(count: u32, now_ns: impl Fn() -> u64, mut skip: impl FnMut(u16) -> io::Result<bool>) -> io::Result<()> {
    let until_ns = now_ns() + SETTLE_NS;
    while skip(0)? && now_ns() < until_ns {}
    let mut seen_count = 0;
    while seen_count < count && now_ns() < until_ns {
        seen_count += u32::from(skip(LONGEST_WAIT_MS)?);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
