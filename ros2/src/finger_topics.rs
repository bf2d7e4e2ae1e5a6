//! The topics on which a finger's reports are published.

use crate::config::Config;
use crate::counters::FingerCounters;
use crate::error::Error;
use crate::msg::{Header, SlipReport, WrenchStamped};
use crate::overlay::OverlayThread;
use crate::ros::{RELIABLE, Ros, SENSOR_DATA, unix_ns};
use crate::wrench::wrench;
use ros2_client::Publisher;
use slipbound::monitor;
use std::sync::{Arc, Mutex, PoisonError};

/// The topics `report` and `wrench` of a finger.
pub struct FingerTopics {
    name: String,
    wrench_frame: String,
    frames_count: u64,
    reports: Publisher<SlipReport>,
    wrenches: Publisher<WrenchStamped>,
    counters: Arc<Mutex<FingerCounters>>,
}

impl FingerTopics {
    /// Makes the topics of finger number `place`, which has published `frames_count` reports before.
    pub fn new(
        ros: &mut Ros,
        config: &Config,
        place: usize,
        frames_count: u64,
        counters: Arc<Mutex<FingerCounters>>,
    ) -> Result<Self, Error> {
        let finger = &config.fingers[place];
        let (name, wrench_frame) = (finger.finger.name.clone(), finger.wrench_frame.clone());
        Ok(FingerTopics {
            reports: ros.publisher(&format!("{name}/report"), &RELIABLE)?,
            wrenches: ros.publisher(&format!("{name}/wrench"), &SENSOR_DATA)?,
            name,
            wrench_frame,
            frames_count,
            counters,
        })
    }

    /// Reports published so far.
    pub fn frames_count(&self) -> u64 {
        self.frames_count
    }

    /// Publishes the report on the image with this header, and the wrench where it is known.
    pub fn publish(&mut self, header: Header, report: &monitor::SlipReport) {
        let stamp = header.stamp;
        let message = SlipReport::of(header, &self.name, self.frames_count, report);
        self.frames_count += 1;
        let state = message.state.clone();
        let sent = self.reports.publish(message).map_err(|e| e.to_string());
        {
            let mut counters = self.counters.lock().unwrap_or_else(PoisonError::into_inner);
            match sent {
                Ok(()) => counters.published(unix_ns(), report.time_ns, &state),
                Err(why) => counters.failed(why),
            }
        }
        if let Some(wrench) = wrench(stamp, &self.wrench_frame, report) {
            let _ = self.wrenches.publish(wrench); // best effort: the report has the same numbers
        }
    }
}

/// The overlay images of finger number `place`; None where none are wanted.
pub fn overlay(ros: &mut Ros, config: &Config, place: usize) -> Result<Option<OverlayThread>, Error> {
    let topic = format!("{}/overlay/compressed", config.fingers[place].finger.name);
    config.overlay.then(|| ros.publisher(&topic, &SENSOR_DATA).map(OverlayThread::new)).transpose()
}
