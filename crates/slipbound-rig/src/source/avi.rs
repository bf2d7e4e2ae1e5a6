//! Motion-JPEG AVI files, decoded here.

use super::riff::{Item, Video, Walk};
use super::{Error, picture};
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// The frames of a Motion-JPEG AVI file. Time is the frame's number over the rate that the header states; most
/// recorders write a rate they did not keep, so the clock is [`Clock::Assumed`].
#[derive(Debug)]
pub struct Avi {
    path: PathBuf,
    walk: Walk<BufReader<File>>,
    video: Video,
    seq: u64,
    over: bool,
}

impl Avi {
    pub(super) fn new(path: &Path, walk: Walk<BufReader<File>>) -> Self {
        Avi { path: path.to_owned(), video: walk.video(), walk, seq: 0, over: false }
    }
}

/// Number and time of a video's frame.
pub(super) fn stamp(into: &mut FrameBuffer, rate: Option<super::Rate>, seq: u64) {
    into.seq = seq;
    into.time_ns = rate.and_then(|r| r.time_ns(seq));
    into.clock = if into.time_ns.is_some() { Clock::Assumed } else { Clock::Unknown };
    into.label.clear();
}

impl FrameSource for Avi {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        loop {
            if self.over {
                return Ok(Next::End);
            }
            let item =
                self.walk.next(&mut into.encoded).map_err(|source| Error::Read { path: self.path.clone(), source })?;
            let seq = self.seq;
            self.seq += 1;
            stamp(into, Some(self.video.rate), seq);
            match item {
                Item::Dropped => {}
                Item::End => self.over = true,
                Item::Cut(reason) => {
                    self.over = true;
                    into.encoded.clear();
                    return Ok(Next::Torn { reason });
                }
                Item::Frame => {
                    return Ok(match picture::decode(into) {
                        Ok(()) => Next::Frame,
                        Err(reason) => Next::Torn { reason },
                    });
                }
            }
        }
    }

    fn frames_count(&self) -> Option<u64> {
        self.video.frames_claimed()
    }
}
