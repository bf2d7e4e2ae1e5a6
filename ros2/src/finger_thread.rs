//! A finger on a separate thread: images in, reports out.
//!
//! ```text
//!   image topic --Inbox--> the two newest --decode--> Finger --> report, wrench topics; the hand, the counters
//!                                                        '--> overlay thread, if it is free
//! ```

use crate::config::{Config, Finger as FingerConfig, ImageQos};
use crate::counters::FingerCounters;
use crate::error::Error;
use crate::finger::{Finger, FrameOutcome};
use crate::finger_topics::{self, FingerTopics};
use crate::image_decode::ReceivedImage;
use crate::image_topic::{ImageTopic, LONGEST_WAIT};
use crate::msg::Header;
use crate::overlay::OverlayThread;
use crate::ros::Ros;
use crate::tare;
use slipbound::monitor::{self, Settings};
use slipbound::port::{FrameBuffer, GripSample};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};

/// Number of images that may wait; older ones are skipped. With `reliable` every image is judged as far as possible.
const WAITING_COUNT: usize = 2;
const WAITING_RELIABLE_COUNT: usize = 10;

/// State shared by the threads of a node.
#[derive(Debug, Default)]
pub struct Shared {
    /// Whether all threads should end.
    pub stop: AtomicBool,
    /// Whether reports, wrenches and overlays are published; images are judged in either case.
    pub publishes: AtomicBool,
    /// The force per finger, where a gripper reports it.
    pub grip: Mutex<Option<GripSample>>,
}

/// Requests to a finger.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FingerRequest {
    /// Renew the rest frame.
    Tare,
    /// Stop doing so: the request has timed out.
    StopTare,
    /// Look for the rest frame, if there is none.
    Look,
    /// Forget the rest frame, and do not look for one.
    Forget,
}

/// An event of a finger, for the hand.
#[derive(Debug, Clone)]
pub enum FingerEvent {
    /// A report.
    Report(Box<monitor::SlipReport>),
    /// The rest frame is known; with the number of requests to forget that were processed before.
    AtRest(u64),
    /// How a tare has ended.
    Tared(Result<(), String>),
}

/// A finger without topics: what is kept when the network is joined again.
pub struct FingerState {
    finger: Finger,
    frames_count: u64,
    last_seq: i64,
    forgotten_count: u64,
}

impl FingerState {
    /// A finger without any frame, with this number of requests to forget.
    pub fn new(config: &FingerConfig, settings: &Settings, looks_for_rest: bool, forgotten_count: u64) -> Self {
        let mut finger = Finger::new(config.finger.sensor.clone(), settings.clone());
        if looks_for_rest {
            finger.look();
        }
        FingerState { finger, frames_count: 0, last_seq: 0, forgotten_count }
    }

    /// Stops renewing its rest frame and keeps the old one.
    pub fn stop_tare(&mut self) {
        self.finger.stop_tare();
    }
}

/// A finger with its topics.
pub struct FingerThread {
    place: usize,
    finger: Finger,
    images: ImageTopic,
    waiting: VecDeque<(ReceivedImage, u64)>,
    waiting_most_count: usize,
    frame: FrameBuffer,
    forgotten_count: u64,
    topics: FingerTopics,
    overlay: Option<OverlayThread>,
    counters: Arc<Mutex<FingerCounters>>,
    shared: Arc<Shared>,
    requests: Receiver<FingerRequest>,
    hand: Sender<(usize, FingerEvent)>,
}

/// Connections of a finger's thread.
pub struct ThreadChannels {
    /// What the threads share.
    pub shared: Arc<Shared>,
    /// Counts of this finger.
    pub counters: Arc<Mutex<FingerCounters>>,
    /// Requests to the finger.
    pub requests: Receiver<FingerRequest>,
    /// Events of the finger.
    pub hand: Sender<(usize, FingerEvent)>,
}

impl FingerThread {
    /// Makes the topics of finger number `place`.
    pub fn new(
        ros: &mut Ros,
        place: usize,
        config: &Config,
        state: FingerState,
        channels: ThreadChannels,
    ) -> Result<Self, Error> {
        let waiting_most_count = match config.image_qos {
            ImageQos::SensorData => WAITING_COUNT,
            ImageQos::Reliable => WAITING_RELIABLE_COUNT,
        };
        let mut images = ImageTopic::new(ros, &config.fingers[place], config.image_qos)?;
        images.count_from(state.last_seq);
        let overlay = finger_topics::overlay(ros, config, place)?;
        let ThreadChannels { shared, counters, requests, hand } = channels;
        Ok(FingerThread {
            place,
            finger: state.finger,
            images,
            waiting: VecDeque::new(),
            waiting_most_count,
            frame: FrameBuffer::default(),
            forgotten_count: state.forgotten_count,
            topics: FingerTopics::new(ros, config, place, state.frames_count, counters.clone())?,
            overlay,
            counters,
            shared,
            requests,
            hand,
        })
    }

    /// Runs until the node stops or joins again; returns what is kept.
    pub fn run(mut self) -> FingerState {
        while !self.shared.stop.load(Ordering::Relaxed) {
            self.take_all();
            self.process_requests();
            match self.waiting.pop_front() {
                Some((image, seq)) => self.judge(image, seq),
                None => self.images.wait(LONGEST_WAIT),
            }
        }
        self.process_requests(); // requests from before the end are still processed
        FingerState {
            last_seq: self.images.last_seq(),
            finger: self.finger,
            frames_count: self.topics.frames_count(),
            forgotten_count: self.forgotten_count,
        }
    }

    /// Processes all requests, in order.
    fn process_requests(&mut self) {
        while let Ok(request) = self.requests.try_recv() {
            match request {
                FingerRequest::Tare => {
                    if let Err(why) = self.finger.tare() {
                        self.send_event(FingerEvent::Tared(Err(why)));
                    }
                }
                FingerRequest::StopTare => {
                    if self.finger.stop_tare() {
                        self.send_event(FingerEvent::Tared(Err(tare::too_few())));
                    }
                }
                FingerRequest::Look => self.finger.look(),
                FingerRequest::Forget => {
                    self.finger.forget();
                    self.forgotten_count += 1;
                    self.counters.lock().unwrap_or_else(PoisonError::into_inner).has_rest = false;
                }
            }
        }
    }

    /// Takes all received images and keeps the newest.
    fn take_all(&mut self) {
        loop {
            let taken = self.images.take();
            let mut counters = self.counters.lock().unwrap_or_else(PoisonError::into_inner);
            match taken {
                Ok(Some((image, seq))) => {
                    counters.received(seq);
                    self.waiting.push_back((image, seq));
                    if self.waiting.len() > self.waiting_most_count {
                        self.waiting.pop_front();
                        counters.passed_over_count += 1;
                    }
                }
                Ok(None) => return,
                Err(why) => {
                    counters.failed(why);
                    return;
                }
            }
        }
    }

    fn judge(&mut self, image: ReceivedImage, seq: u64) {
        if self.finger.is_idle() {
            return;
        }
        let header = image.header().clone();
        let grip = *self.shared.grip.lock().unwrap_or_else(PoisonError::into_inner);
        let report = match image.decode(seq, &mut self.frame) {
            Ok(()) => match self.finger.see(&self.frame, grip) {
                FrameOutcome::Judged(report) => Some(report),
                FrameOutcome::Tared(report, ended) => {
                    self.send_event(FingerEvent::Tared(ended));
                    Some(report)
                }
                FrameOutcome::Idle | FrameOutcome::AtRest => None,
                FrameOutcome::RestFound(_) => {
                    self.counters.lock().unwrap_or_else(PoisonError::into_inner).has_rest = true;
                    self.send_event(FingerEvent::AtRest(self.forgotten_count));
                    None
                }
                FrameOutcome::Refused(why) => {
                    self.counters.lock().unwrap_or_else(PoisonError::into_inner).failed(why);
                    None
                }
            },
            Err(why) => {
                self.counters.lock().unwrap_or_else(PoisonError::into_inner).torn(&why);
                self.finger.torn(seq, self.frame.time_ns)
            }
        };
        let Some(report) = report else { return };
        // Read once, so that subscribers receive all messages for an image, or none.
        match self.shared.publishes.load(Ordering::Relaxed) {
            true => self.publish(header, &report),
            false => self.send_event(FingerEvent::Report(Box::new(report))),
        }
    }

    fn publish(&mut self, header: Header, report: &monitor::SlipReport) {
        self.topics.publish(header.clone(), report);
        self.send_event(FingerEvent::Report(Box::new(*report)));
        if let (Some(overlay), Some(monitor)) = (&mut self.overlay, self.finger.monitor()) {
            overlay.show(header, &self.frame, report, monitor);
        }
    }

    fn send_event(&self, event: FingerEvent) {
        let _ = self.hand.send((self.place, event)); // the node is ending: no receiver is left
    }
}
