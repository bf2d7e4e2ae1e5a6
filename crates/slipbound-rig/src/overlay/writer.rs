//! Overlay images into a folder or a video, drawn and encoded beside the judging.
//!
//! ```text
//!          +--> draw, encode --+
//!   push --+                   +--in turn--> folder or video --emptied--> push
//!          +--> draw, encode --+
//! ```
//!
//! Frames go to the drawing threads in turn and come back in the same turn, so that the images are in order and the
//! same for any number of threads.

use super::drawing::Overlay;
use super::frame_copy::FrameCopy;
use super::image_file::{Error, ImageFile, ImageKind};
use super::input::OverlayInput;
use slipbound::monitor::SlipReport;
use slipbound::port::FrameBuffer;
use slipbound::sensor::Sensor;
use std::panic;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};

/// More threads than this would wait for the disk.
const MOST_THREADS: usize = 8;

/// Playback, limits and haste of an [`OverlayWriter`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OverlayOptions {
    /// Playback rate of a video, frames per second.
    pub rate_hz: u32,
    /// Greatest length of a video; at most [`crate::avi_writer::MAX_BYTES`].
    pub most_bytes: u64,
    /// Whether [`OverlayWriter::push`] waits for the drawing, as for a recording. Otherwise, as for a camera, a frame for
    /// which the drawing has no time is left out and counted.
    pub waits: bool,
}

/// What was drawn.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Drawn {
    /// Frames left out because the drawing did not keep up.
    pub lost_count: u64,
    /// The first frame for which a full video had no room.
    pub full_at_seq: Option<u64>,
}

/// Writes one image a frame: `000057.png` in a folder, or a Motion-JPEG AVI.
#[derive(Debug)]
pub struct OverlayWriter {
    path: PathBuf,
    waits: bool,
    to_draw: Vec<Sender<Box<FrameCopy>>>,
    emptied: Receiver<Box<FrameCopy>>,
    next: usize,
    lost_count: u64,
    drawing: Vec<JoinHandle<()>>,
    /// Returns the first frame that a full video had no room for.
    writing: Option<JoinHandle<Result<Option<u64>, Error>>>,
}

impl OverlayWriter {
    /// `to`: a name that ends in `.avi`, or a folder, which is created if missing. `sensor`: at the size of the frames.
    pub fn create(to: &Path, sensor: &Sensor, options: OverlayOptions) -> Result<Self, Error> {
        let OverlayOptions { rate_hz, most_bytes, waits } = options;
        let overlay = Overlay::new(sensor);
        let file = ImageFile::create(to, overlay.size(), rate_hz, most_bytes)?;
        let cores = thread::available_parallelism().map_or(1, |cores| cores.get());
        // A camera is not to wait for a core on which its pictures are drawn.
        let threads_count = if waits { cores } else { cores - 1 }.clamp(1, MOST_THREADS);
        let (empty, emptied) = channel();
        let (mut to_draw, mut drawn, mut drawing) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..threads_count {
            for _ in 0..2 {
                empty.send(Box::new(FrameCopy::default())).expect("its receiver is above");
            }
            let (give, jobs) = channel();
            let (give_drawn, take_drawn) = channel();
            let (overlay, kind) = (overlay.clone(), file.kind());
            drawing.push(thread::spawn(move || draw_all(overlay, kind, &jobs, &give_drawn)));
            to_draw.push(give);
            drawn.push(take_drawn);
        }
        let writing = Some(thread::spawn(move || write_all(file, &drawn, &empty)));
        Ok(OverlayWriter { path: to.to_owned(), waits, to_draw, emptied, next: 0, lost_count: 0, drawing, writing })
    }

    /// Takes the frame judged last, for drawing. `frame`: None when it did not arrive whole. Returns false once nothing
    /// more is written; [`OverlayWriter::finish`] tells why.
    pub fn push<'a>(
        &mut self,
        frame: Option<&FrameBuffer>,
        report: &SlipReport,
        found: impl Into<OverlayInput<'a>>,
    ) -> bool {
        let empty = match self.waits {
            true => self.emptied.recv().map_err(|_| TryRecvError::Disconnected),
            false => self.emptied.try_recv(),
        };
        match empty {
            Ok(mut empty) => {
                empty.take(frame, report, &found.into());
                let sent = self.to_draw[self.next].send(empty).is_ok();
                self.next = (self.next + 1) % self.to_draw.len();
                sent
            }
            Err(TryRecvError::Empty) => {
                self.lost_count += 1;
                true
            }
            Err(TryRecvError::Disconnected) => false,
        }
    }

    /// Where the images go.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Waits for the last image and finishes a video.
    pub fn finish(mut self) -> Result<Drawn, Error> {
        let full_at_seq = self.join()?;
        Ok(Drawn { lost_count: self.lost_count, full_at_seq })
    }

    fn join(&mut self) -> Result<Option<u64>, Error> {
        self.to_draw.clear(); // the end, for every thread
        let written = self.writing.take().map_or(Ok(Ok(None)), JoinHandle::join);
        for drawing in self.drawing.drain(..) {
            drawing.join().unwrap_or_else(|panic| panic::resume_unwind(panic));
        }
        written.unwrap_or_else(|panic| panic::resume_unwind(panic))
    }
}

impl Drop for OverlayWriter {
    fn drop(&mut self) {
        if !thread::panicking() {
            let _ = self.join(); // what was pushed is written; who wants to know of errors calls `finish`
        }
    }
}

/// A drawing thread: until there are no more frames, or nobody takes the images.
fn draw_all(mut overlay: Overlay, kind: ImageKind, jobs: &Receiver<Box<FrameCopy>>, drawn: &Sender<Box<FrameCopy>>) {
    let mut rgb = Vec::new();
    for mut job in jobs {
        job.draw(&mut overlay);
        overlay.rgb_into(&mut rgb);
        job.encoded.clear();
        job.refused = kind.encode(&rgb, overlay.size(), &mut job.encoded).err();
        if drawn.send(job).is_err() {
            return;
        }
    }
}

/// The writing thread. The frames come back in the turn in which they were given away.
fn write_all(
    mut file: ImageFile,
    drawn: &[Receiver<Box<FrameCopy>>],
    emptied: &Sender<Box<FrameCopy>>,
) -> Result<Option<u64>, Error> {
    for drawn in drawn.iter().cycle() {
        let Ok(mut job) = drawn.recv() else { break };
        let seq = job.seq();
        if let Some(why) = job.refused.take() {
            return Err(file.refused(seq, why));
        }
        if !file.push(&job.encoded, seq)? {
            file.finish()?;
            return Ok(Some(seq));
        }
        let _ = emptied.send(job); // nobody waits for it after the last frame
    }
    file.finish()?;
    Ok(None)
}
