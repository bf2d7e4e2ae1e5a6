//! The library's control loop in ROS: its fingers' images, its gripper and its wrist are topics of other nodes, and what it
//! sees is published on the topics of the node `slipbound`.
//!
//! ```text
//!   image topics --ImageSource, a thread each--> FingerPipeline --.                      .--> gripper, wrist
//!                                                                 +--> ControlLoop::cycle +
//!   gripper, wrist: state topics ---------------------------------'                      '--> ReportTopics, Overlays
//! ```

use crate::config::{Config, Control, Finger, GripperAddress, ImageQos, ImageType};
use crate::counters::{DIAGNOSTICS_NS, FingerCounters};
use crate::error::Error;
use crate::finger_topics::{self, FingerTopics};
use crate::gripper::TopicGripper;
use crate::gripper_action::ActionGripper;
use crate::image_topic::{ImageSource, ImageTopic};
use crate::lifecycle::State;
use crate::msg::{DiagnosticArray, GripCommand, HandReport, Header, Time, TopicType, WristCommand};
use crate::overlay::OverlayThread;
use crate::ros::{RELIABLE, Ros, SENSOR_DATA, stamp, unix_ns};
use crate::wrist::TopicWrist;
use ros2_client::Publisher;
use slipbound::control::{CycleObserver, CycleView};
use slipbound::finger_pipeline::{FingerPipeline, FingerView};
use slipbound::port::{Gripper, Wrist};
use slipbound_rig::source::{Arrivals, Newest};
use slipbound_rig::wrist::Dry;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Longest wait for the nodes of gripper and wrist before the loop begins: discovery takes seconds on a busy computer.
const LONGEST_DISCOVERY: Duration = Duration::from_secs(20);

/// Time for which the commands of other nodes are listened for: a loop sends one in every cycle, ten a second or more.
const LISTENING: Duration = Duration::from_millis(500);
/// The same where another node is known that could send them: on a busy computer its first command arrived 0.9 s after
/// it was discovered.
const LISTENING_TO_KNOWN: Duration = Duration::from_secs(5);

/// What a control loop needs of ROS.
pub struct RosHand {
    /// The gripper.
    pub gripper: Box<dyn Gripper>,
    /// The wrist; one that does nothing where there is none.
    pub wrist: Box<dyn Wrist>,
    /// The fingers, for [`ControlLoop::new`](slipbound::control::ControlLoop::new).
    pub fingers: Vec<FingerPipeline>,
    /// Their images, to see when a cycle is due.
    pub arrivals: Vec<Arrivals>,
    /// Publishes what the loop sees; belongs behind a queue.
    pub reports: ReportTopics,
    /// Publishes overlay images; needs the monitors, and waits for nothing.
    pub overlays: Overlays,
    /// Counts of every finger's images.
    pub counters: Vec<Arc<Mutex<FingerCounters>>>,
    /// Name of the gripper's action, if it has one.
    action: Option<String>,
    /// For every finger, what is missing as long as no image came.
    no_images: Vec<String>,
    /// Whether another node has commanded the gripper or the wrist; none once the loop begins, which commands there itself.
    others: Vec<Others>,
    /// The node, which lives as long as its topics.
    ros: Ros,
}

impl RosHand {
    /// Joins the network. `wrist`: the base name of its topics, if it is to be commanded. Waits for nothing, commands nothing.
    pub fn join(config: &Config, control: &Control, wrist: Option<&str>) -> Result<Self, Error> {
        let ros = Ros::new(&config.namespace, &config.node, config.domain_id)?;
        let mut ros = ros.with_services(config.service_mapping);
        let action = match &control.gripper {
            GripperAddress::Topics(_) => None,
            GripperAddress::Action(action) => Some(action.action.clone()),
        };
        let mut others = Vec::new();
        let gripper: Box<dyn Gripper> = match &control.gripper {
            GripperAddress::Topics(base) => {
                others.push(Others::new::<GripCommand>(&mut ros, base, "gripper")?);
                Box::new(TopicGripper::new(&mut ros, base)?)
            }
            GripperAddress::Action(action) => Box::new(ActionGripper::new(&mut ros, action.clone())?),
        };
        let wrist: Box<dyn Wrist> = match wrist {
            Some(base) => {
                others.push(Others::new::<WristCommand>(&mut ros, base, "wrist")?);
                Box::new(TopicWrist::new(&mut ros, base)?)
            }
            None => Box::new(Dry::default()),
        };
        let (mut fingers, mut outputs, mut overlays) = (Vec::new(), Vec::new(), Vec::new());
        for (place, finger) in config.fingers.iter().enumerate() {
            let (counters, frame_id) = (Arc::default(), Arc::default());
            let images = ImageTopic::new(&mut ros, finger, config.image_qos)?;
            let source = Newest::new(Box::new(ImageSource::new(images, Arc::clone(&counters), Arc::clone(&frame_id))));
            outputs.push(FingerOutput {
                topics: FingerTopics::new(&mut ros, config, place, 0, Arc::clone(&counters))?,
                serial: finger.finger.serial.clone(),
                counters,
                frame_id: Arc::clone(&frame_id),
                arrivals: source.arrivals(),
            });
            overlays.push((finger_topics::overlay(&mut ros, config, place)?, frame_id));
            let (finger, settings) = (finger.finger.clone(), config.settings.clone());
            fingers.push(FingerPipeline::new(&finger.name, finger.mounting, finger.sensor, settings, Box::new(source)));
        }
        Ok(RosHand {
            gripper,
            wrist,
            fingers,
            arrivals: outputs.iter().map(|output| output.arrivals.clone()).collect(),
            counters: outputs.iter().map(|output| output.counters.clone()).collect(),
            reports: ReportTopics {
                hand_frame: config.hand_frame.clone(),
                hand_reports: ros.publisher("hand/report", &RELIABLE)?,
                diagnostics: ros.publisher("/diagnostics", &RELIABLE)?,
                node: ros.full_name().trim_start_matches('/').to_owned(),
                fingers: outputs,
                diagnosed_ns: 0,
            },
            overlays: Overlays(overlays),
            no_images: config
                .fingers
                .iter()
                .enumerate()
                .map(|(place, finger)| no_images(config, place, finger))
                .collect(),
            others,
            action,
            ros,
        })
    }

    /// Waits for the nodes of gripper and wrist and for the first image of every finger: the patience of the loop is for
    /// links that are lost later. Then nobody else may command gripper and wrist. The error is what is missing. `waits`
    /// is called with each thing that is waited for.
    pub fn await_all(&mut self, stop: &AtomicBool, waits: &mut dyn FnMut(&str)) -> Result<(), String> {
        let until = Instant::now() + LONGEST_DISCOVERY;
        let mut told = None;
        while let Some((device, missing)) = self.missing() {
            if told.as_ref() != Some(&device) {
                waits(&missing);
                told = Some(device);
            }
            if Instant::now() >= until {
                return Err(missing);
            }
            self.pause(stop)?;
        }
        let (begun, mut told) = (Instant::now(), false);
        loop {
            self.others.iter_mut().try_for_each(Others::check)?;
            let known = self.others.iter().find(|others| others.are_known(&self.ros));
            if begun.elapsed() >= if known.is_some() { LISTENING_TO_KNOWN } else { LISTENING } {
                break;
            }
            if let Some(others) = known.filter(|_| !told) {
                waits(&format!("{}: another node can publish here; no command of it for 5 s", others.topic));
                told = true;
            }
            self.pause(stop)?;
        }
        self.others.clear();
        Ok(())
    }

    /// The first thing that is not there yet, by its number and in words.
    fn missing(&mut self) -> Option<(usize, String)> {
        if let Err(e) = self.gripper.poll() {
            return Some((0, format!("gripper: {e}")));
        }
        // A publisher of the feedback is the server.
        let is_absent = |action: &&String| self.ros.node().publisher_count(&format!("{action}/_action/feedback")) == 0;
        if let Some(action) = self.action.as_ref().filter(is_absent) {
            return Some((1, format!("gripper: {action}: expected an action server, got none")));
        }
        if let Err(e) = self.wrist.poll() {
            return Some((2, format!("wrist: {e}")));
        }
        let place = self.arrivals.iter().position(|arrivals| !arrivals.is_waiting())?;
        Some((3 + place, self.no_images[place].clone()))
    }

    /// A short time, in which gripper and wrist are listened to: what nobody reads counts as silence. The error is that of
    /// the user who does not want to wait.
    fn pause(&mut self, stop: &AtomicBool) -> Result<(), String> {
        sleep(Duration::from_millis(10));
        self.gripper.poll_io();
        self.wrist.poll_io();
        if stop.load(Ordering::Relaxed) { Err("interrupted; nothing was commanded".into()) } else { Ok(()) }
    }
}

fn no_images(config: &Config, place: usize, finger: &Finger) -> String {
    let kind = match finger.image_type {
        ImageType::Compressed => "compressed",
        ImageType::Raw => "raw",
    };
    let qos = match config.image_qos {
        ImageQos::SensorData => "best effort",
        ImageQos::Reliable => "reliable",
    };
    format!("fingers[{place}].image_topic {}: expected images ({kind}, {qos}), got none", finger.image_topic)
}

/// Other nodes that command a device.
struct Others {
    topic: String,
    device: &'static str,
    has_heard: Box<dyn FnMut() -> bool + Send>,
}

impl Others {
    fn new<M: TopicType>(ros: &mut Ros, base: &str, device: &'static str) -> Result<Self, Error> {
        let topic = format!("{base}/command");
        let mut inbox = ros.inbox::<M>(&topic, &SENSOR_DATA)?; // reliable, it would wait for what it has missed;
        Ok(Others { topic, device, has_heard: Box::new(move || inbox.newest().is_some()) })
    }

    /// Whether a publisher of another participant was discovered.
    fn are_known(&self, ros: &Ros) -> bool {
        ros.is_published_by_others(&self.topic)
    }

    fn check(&mut self) -> Result<(), String> {
        let Others { topic, device, has_heard } = self;
        match has_heard() {
            true => Err(format!("{topic}: expected no other node that commands this {device}, got one")),
            false => Ok(()),
        }
    }
}

fn lock<T>(shared: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The header of the image that this finger was judged by.
fn header(finger: &FingerView<'_>, frame_id: &Mutex<String>) -> Header {
    Header { stamp: Time::from_ns(finger.frame.time_ns.unwrap_or(0)), frame_id: lock(frame_id).clone() }
}

/// A finger's topics, and its counts.
struct FingerOutput {
    topics: FingerTopics,
    serial: String,
    counters: Arc<Mutex<FingerCounters>>,
    frame_id: Arc<Mutex<String>>,
    arrivals: Arrivals,
}

/// Publishes every cycle: the reports of the fingers and, unless it waits for a gripper, of the hand; diagnostics.
pub struct ReportTopics {
    hand_frame: String,
    hand_reports: Publisher<HandReport>,
    diagnostics: Publisher<DiagnosticArray>,
    node: String,
    fingers: Vec<FingerOutput>,
    diagnosed_ns: u64,
}

impl ReportTopics {
    fn diagnose(&mut self, view: &CycleView<'_>) {
        let is_ready = view.fingers.iter().all(|finger| finger.rest_kind.is_some());
        let state = if is_ready { State::Active } else { State::Unconfigured };
        let status = self.fingers.iter().zip(view.fingers).map(|(output, finger)| {
            let mut counters = lock(&output.counters);
            counters.has_rest = finger.rest_kind.is_some();
            counters.passed_over_count = output.arrivals.replaced_count();
            counters.status(unix_ns(), state, &self.node, finger.name, &output.serial)
        });
        let header = Header { stamp: stamp(), frame_id: String::new() };
        let _ = self.diagnostics.publish(DiagnosticArray { header, status: status.collect() }); // the next one is newer
    }
}

impl CycleObserver for ReportTopics {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        for (output, finger) in self.fingers.iter_mut().zip(view.fingers) {
            if let Some(report) = finger.report {
                output.topics.publish(header(finger, &output.frame_id), report);
            }
        }
        if let Some(cycle) = view.cycle() {
            // A slow reader loses reports; the next one is newer.
            let _ = self.hand_reports.publish(HandReport::of(&self.hand_frame, &cycle.hand));
        }
        if view.now_ns.saturating_sub(self.diagnosed_ns) >= DIAGNOSTICS_NS {
            self.diagnosed_ns = view.now_ns;
            self.diagnose(view);
        }
    }
}

/// Publishes the overlay images of the fingers that have them.
pub struct Overlays(Vec<(Option<OverlayThread>, Arc<Mutex<String>>)>);

impl CycleObserver for Overlays {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        for ((overlay, frame_id), finger) in self.0.iter_mut().zip(view.fingers) {
            if let (Some(overlay), Some(report), Some(monitor)) = (overlay, finger.report, finger.monitor) {
                overlay.show(header(finger, frame_id), finger.frame, report, monitor);
            }
        }
    }
}
