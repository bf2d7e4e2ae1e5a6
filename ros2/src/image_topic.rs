//! The topic of a finger's images, and the same as a source of the library's control loop.

use crate::config::{Finger, ImageQos, ImageType};
use crate::counters::FingerCounters;
use crate::error::Error;
use crate::image_decode::ReceivedImage;
use crate::msg::{CompressedImage, Image};
use crate::ros::{Inbox, RELIABLE, Received, Ros, SENSOR_DATA};
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Longest wait for an image before its reader looks after something else.
pub const LONGEST_WAIT: Duration = Duration::from_millis(20);

/// The topic of a finger's images.
pub enum ImageTopic {
    /// `sensor_msgs/CompressedImage`.
    Compressed(Inbox<CompressedImage>),
    /// `sensor_msgs/Image`.
    Raw(Inbox<Image>),
}

impl ImageTopic {
    /// Subscribes to the images of this finger.
    pub fn new(ros: &mut Ros, finger: &Finger, qos: ImageQos) -> Result<Self, Error> {
        let qos = match qos {
            ImageQos::SensorData => SENSOR_DATA,
            ImageQos::Reliable => RELIABLE,
        };
        Ok(match finger.image_type {
            ImageType::Compressed => ImageTopic::Compressed(ros.inbox(&finger.image_topic, &qos)?),
            ImageType::Raw => ImageTopic::Raw(ros.inbox(&finger.image_topic, &qos)?),
        })
    }

    /// As [`Inbox::wait`].
    pub fn wait(&mut self, longest: Duration) {
        match self {
            ImageTopic::Compressed(inbox) => inbox.wait(longest),
            ImageTopic::Raw(inbox) => inbox.wait(longest),
        }
    }

    /// As [`Inbox::count_from`].
    pub fn count_from(&mut self, last_seq: i64) {
        match self {
            ImageTopic::Compressed(inbox) => inbox.count_from(last_seq),
            ImageTopic::Raw(inbox) => inbox.count_from(last_seq),
        }
    }

    /// As [`Inbox::last_seq`].
    pub fn last_seq(&self) -> i64 {
        match self {
            ImageTopic::Compressed(inbox) => inbox.last_seq(),
            ImageTopic::Raw(inbox) => inbox.last_seq(),
        }
    }

    /// As [`Inbox::take`]: the next image and its number.
    pub fn take(&mut self) -> Result<Option<(ReceivedImage, u64)>, String> {
        Ok(match self {
            ImageTopic::Compressed(inbox) => {
                inbox.take()?.map(|Received { message, seq }| (ReceivedImage::Compressed(message), seq))
            }
            ImageTopic::Raw(inbox) => inbox.take()?.map(|Received { message, seq }| (ReceivedImage::Raw(message), seq)),
        })
    }
}

/// A finger's images for a control loop, which reads them on a thread of its own ([`slipbound_rig::source::Newest`]).
pub struct ImageSource {
    images: ImageTopic,
    counters: Arc<Mutex<FingerCounters>>,
    /// `frame_id` of the last image, for the headers of the reports.
    frame_id: Arc<Mutex<String>>,
}

impl ImageSource {
    /// The images of this topic; counts them, and shows the `frame_id` of the last one.
    pub fn new(images: ImageTopic, counters: Arc<Mutex<FingerCounters>>, frame_id: Arc<Mutex<String>>) -> Self {
        ImageSource { images, counters, frame_id }
    }
}

impl FrameSource for ImageSource {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let taken = self.images.take();
        let mut counters = self.counters.lock().unwrap_or_else(PoisonError::into_inner);
        let (image, seq) = match taken {
            Ok(Some(received)) => received,
            Ok(None) => {
                drop(counters);
                self.images.wait(LONGEST_WAIT);
                return Ok(Next::Silent);
            }
            Err(why) => {
                counters.failed(why);
                return Ok(Next::Silent);
            }
        };
        counters.received(seq);
        drop(counters);
        self.frame_id.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&image.header().frame_id);
        Ok(match image.decode(seq, into) {
            Ok(()) => Next::Frame,
            Err(reason) => {
                self.counters.lock().unwrap_or_else(PoisonError::into_inner).torn(&reason);
                Next::Torn { reason }
            }
        })
    }
}
