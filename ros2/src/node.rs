//! The node `slipbound`: one thread per finger, and this one for the hand, the services and the diagnostics.

mod states;

use crate::config::Config;
use crate::counters::{DIAGNOSTICS_NS, FingerCounters};
use crate::error::Error;
use crate::finger_thread::{FingerEvent, FingerRequest, FingerState, FingerThread, Shared, ThreadChannels};
use crate::lifecycle::{Lifecycle, State};
use crate::managed::Managed;
use crate::msg::{DiagnosticArray, Empty, GripperState, HandReport, Header, TriggerResponse};
use crate::reconnect::ReconnectWatcher;
use crate::ros::{Inbox, RELIABLE, Ros, SENSOR_DATA, stamp, unix_ns};
use crate::tare::Tare;
use ros2_client::service::RmwRequestId;
use ros2_client::{Publisher, Server};
use slipbound::hand::{Hand, Mounting};
use slipbound::port::GripSample;
use slipbound_rig::link::now_ns;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Longest time for which the report of one finger waits for those of the others, ns.
const LONGEST_WAIT_NS: u64 = 25_000_000;

/// Longest time between two reports of the hand once it is active, ns: without images they report that it is blind.
const LONGEST_SILENCE_NS: u64 = 100_000_000;

/// Age up to which a force reported by a gripper is used, ns.
const GRIP_AGE_NS: u64 = 500_000_000;

/// Polling period of services and topics.
const LOOK: Duration = Duration::from_millis(5);

/// The node's connections to the network.
struct Network {
    ros: Ros,
    reconnects: ReconnectWatcher,
    hand_reports: Publisher<HandReport>,
    diagnostics: Publisher<DiagnosticArray>,
    managed: Managed,
    tare_service: Server<Empty, TriggerResponse>,
    gripper: Option<Inbox<GripperState>>,
}

impl Network {
    fn new(config: &Config) -> Result<Self, Error> {
        let ros = Ros::new(&config.namespace, &config.node, config.domain_id)?;
        let mut ros = ros.with_services(config.service_mapping);
        Ok(Network {
            reconnects: ReconnectWatcher::new(&ros),
            hand_reports: ros.publisher("hand/report", &RELIABLE)?,
            diagnostics: ros.publisher("/diagnostics", &RELIABLE)?,
            managed: Managed::new(&mut ros)?,
            tare_service: ros.server("tare", "std_srvs", "Trigger")?,
            gripper: config.gripper_state_topic.as_deref().map(|topic| ros.inbox(topic, &SENSOR_DATA)).transpose()?,
            ros,
        })
    }
}

/// The node, ready to run.
pub struct SlipNode {
    config: Config,
    network: Network,
    fingers: Vec<FingerOfNode>,
    events: Receiver<(usize, FingerEvent)>,
    shared: Arc<Shared>,
    hand: Hand,
    /// Which fingers have reported since the last report of the hand.
    is_fresh: Vec<bool>,
    fresh_since_ns: Option<u64>,
    hand_reported_ns: u64,
    diagnosed_ns: u64,
    tare: Option<Tare>,
    gripped_ns: u64,
    lifecycle: Lifecycle,
    /// Whether it is to configure and activate itself: until it has, or until a transition is requested.
    starts_itself: bool,
    /// When the first rest frame was found, ns.
    rest_since_ns: Option<u64>,
    /// The request of the transition in progress, and its time, ns.
    transition_request: Option<(RmwRequestId, u64)>,
    /// Number of requests to the fingers to forget their rest frames.
    forgotten_count: u64,
}

struct FingerOfNode {
    name: String,
    serial: String,
    counters: Arc<Mutex<FingerCounters>>,
    requests: Sender<FingerRequest>,
    has_rest: bool,
    thread: Option<JoinHandle<FingerState>>,
}

impl SlipNode {
    /// Joins the network and starts the fingers' threads.
    pub fn start(config: &Config) -> Result<Self, Error> {
        let hand = hand(config)?;
        let nobody = channel().1;
        let fingers = config.fingers.iter().map(|finger| FingerOfNode {
            name: finger.finger.name.clone(),
            serial: finger.finger.serial.clone(),
            counters: Arc::default(),
            requests: channel().0,
            has_rest: false,
            thread: None,
        });
        let mut node = SlipNode {
            network: Network::new(config)?,
            is_fresh: vec![false; config.fingers.len()],
            fresh_since_ns: None,
            hand_reported_ns: now_ns(),
            diagnosed_ns: now_ns(),
            tare: None,
            gripped_ns: 0,
            lifecycle: Lifecycle::default(),
            starts_itself: config.autostart,
            rest_since_ns: None,
            transition_request: None,
            forgotten_count: 0,
            hand,
            shared: Arc::default(),
            events: nobody,
            fingers: fingers.collect(),
            config: config.clone(),
        };
        let fingers =
            config.fingers.iter().map(|finger| FingerState::new(finger, &config.settings, config.autostart, 0));
        node.spawn(fingers.collect())?;
        Ok(node)
    }

    /// Starts the threads of the fingers on the present network connection.
    fn spawn(&mut self, fingers: Vec<FingerState>) -> Result<(), Error> {
        self.shared = Arc::new(Shared { publishes: self.publishes().into(), ..Shared::default() });
        let (to_hand, events) = channel();
        self.events = events;
        let mut threads = Vec::new();
        for (place, state) in fingers.into_iter().enumerate() {
            let (requests_to, requests) = channel();
            let counters = self.fingers[place].counters.clone();
            let channels = ThreadChannels { shared: self.shared.clone(), counters, requests, hand: to_hand.clone() };
            threads.push(FingerThread::new(&mut self.network.ros, place, &self.config, state, channels)?);
            self.fingers[place].requests = requests_to;
        }
        for (finger, thread) in self.fingers.iter_mut().zip(threads) {
            finger.thread = Some(thread::spawn(move || thread.run()));
        }
        self.publish_state();
        Ok(())
    }

    /// Joins the network again. The state is kept, fingers keep their rest frames and everything they know; a tare in
    /// progress is dropped.
    fn rejoin(&mut self) -> Result<(), Error> {
        let network = Network::new(&self.config)?;
        self.shared.stop.store(true, Ordering::Relaxed);
        let looks = self.starts_itself || self.lifecycle.state() != State::Unconfigured;
        let mut states = Vec::new();
        for (finger, config) in self.fingers.iter_mut().zip(&self.config.fingers) {
            let ended = finger.thread.take().and_then(|thread| thread.join().ok());
            // A finger whose thread has panicked starts again.
            let is_whole = ended.is_some();
            let anew = || FingerState::new(config, &self.config.settings, looks, self.forgotten_count);
            let mut state = ended.unwrap_or_else(anew);
            // What is answered by nobody must not take effect later.
            state.stop_tare();
            states.push(state);
            finger.has_rest &= is_whole;
            let mut counters = finger.counters.lock().unwrap_or_else(PoisonError::into_inner);
            counters.has_rest &= is_whole;
            counters.rejoined_count += 1;
        }
        while let Ok((finger, event)) = self.events.try_recv() {
            self.handle_event(finger, event);
        }
        (self.tare, self.network) = (None, network);
        self.spawn(states)
    }

    /// Runs until `stop` is set, a service shuts it down, every finger's thread has panicked, or the network cannot be
    /// joined again.
    pub fn run(mut self, stop: &AtomicBool) -> Result<(), Error> {
        while !stop.load(Ordering::Relaxed) {
            match self.events.recv_timeout(LOOK) {
                Ok((finger, event)) => self.handle_event(finger, event),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(Error::FingersBroken),
            }
            self.report_hand();
            self.read_gripper();
            self.serve();
            if self.lifecycle.state() == State::Finalized {
                self.take_leave(stop);
                return Ok(());
            }
            self.diagnose();
            if self.network.reconnects.must_rejoin() {
                self.rejoin()?;
            }
        }
        Ok(())
    }

    /// Its full name on the network.
    pub fn full_name(&self) -> &str {
        self.network.ros.full_name()
    }

    fn handle_event(&mut self, finger: usize, event: FingerEvent) {
        match event {
            FingerEvent::Report(report) => {
                if !self.fingers[finger].has_rest {
                    return; // it is based on a state that was forgotten
                }
                self.hand.see(finger, &report);
                self.is_fresh[finger] = true;
                self.fresh_since_ns.get_or_insert_with(now_ns);
            }
            FingerEvent::AtRest(forgotten_count) => {
                // A rest frame found before the finger received the request to forget it does not count.
                self.fingers[finger].has_rest |= forgotten_count == self.forgotten_count;
                self.rest_since_ns.get_or_insert_with(now_ns);
                self.settle();
            }
            FingerEvent::Tared(ended) => {
                if let Some(tare) = &mut self.tare {
                    tare.ended(finger, ended);
                }
            }
        }
    }

    /// Reports the hand when all fingers have reported, or the wait is over. The report is made even if it is not
    /// published, to keep the hand's time up to date.
    fn report_hand(&mut self) {
        let now_ns = now_ns();
        let waited = self.fresh_since_ns.is_some_and(|since_ns| now_ns - since_ns >= LONGEST_WAIT_NS);
        let is_silent = now_ns - self.hand_reported_ns >= LONGEST_SILENCE_NS;
        if !self.lifecycle.state().is_configured() || !(waited || is_silent || self.is_fresh.iter().all(|fresh| *fresh))
        {
            return;
        }
        for (place, fresh) in self.is_fresh.iter_mut().enumerate() {
            // A finger that has only missed its turn is not blind: the hand knows how old a frame may be.
            if !std::mem::take(fresh) && is_silent {
                self.hand.missed(place);
            }
        }
        (self.fresh_since_ns, self.hand_reported_ns) = (None, now_ns);
        let report = self.hand.report(now_ns);
        if self.publishes() {
            // A slow reader loses reports; the next one is newer.
            let _ = self.network.hand_reports.publish(HandReport::of(&self.config.hand_frame, &report));
        }
    }

    fn read_gripper(&mut self) {
        let Some(inbox) = &mut self.network.gripper else { return };
        let now_ns = now_ns();
        let reported = inbox.newest().map(|state| [state.force_n, state.target_n].into_iter().find(|n| n.is_finite()));
        let is_old = now_ns - self.gripped_ns > GRIP_AGE_NS;
        let grip = match reported {
            Some(force_n) => force_n.map(|force_n| GripSample { force_n }),
            None if is_old => None,
            None => return,
        };
        self.gripped_ns = if reported.is_some() { now_ns } else { self.gripped_ns };
        *self.shared.grip.lock().unwrap_or_else(PoisonError::into_inner) = grip;
    }

    fn serve(&mut self) {
        self.serve_states();
        while let Ok(Some((id, _))) = self.network.tare_service.receive_request() {
            if self.tare.is_some() {
                let message = "the fingers are being tared already".into();
                let _ = self.network.tare_service.send_response(id, TriggerResponse { success: false, message });
                continue;
            }
            let names = self.fingers.iter().map(|finger| finger.name.clone()).collect();
            self.tare = Some(Tare::new(id, names, now_ns()));
            for finger in &self.fingers {
                // A panicked thread does not answer: that is reported.
                let _ = finger.requests.send(FingerRequest::Tare);
            }
        }
        for finger in self.tare.as_mut().map(|tare| tare.stop(now_ns())).unwrap_or_default() {
            let _ = self.fingers[finger].requests.send(FingerRequest::StopTare);
        }
        if let Some((id, answer)) = self.tare.as_ref().and_then(|tare| tare.answer(now_ns())) {
            let _ = self.network.tare_service.send_response(id, answer); // the client may be gone
            self.tare = None;
        }
    }

    fn diagnose(&mut self) {
        let now_ns = now_ns();
        if now_ns - self.diagnosed_ns < DIAGNOSTICS_NS {
            return;
        }
        self.diagnosed_ns = now_ns;
        let node = self.network.ros.full_name().trim_start_matches('/').to_owned();
        let lifecycle = self.lifecycle.state();
        let status = self.fingers.iter().map(|finger| {
            let mut counters = finger.counters.lock().unwrap_or_else(PoisonError::into_inner);
            counters.status(unix_ns(), lifecycle, &node, &finger.name, &finger.serial)
        });
        let header = Header { stamp: stamp(), frame_id: String::new() };
        let _ = self.network.diagnostics.publish(DiagnosticArray { header, status: status.collect() }); // the next one is newer
    }
}

/// A hand without any report.
fn hand(config: &Config) -> Result<Hand, Error> {
    let mountings: Vec<Mounting> = config.fingers.iter().map(|f| f.finger.mounting).collect();
    Ok(Hand::new(&mountings)?)
}

impl Drop for SlipNode {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        for thread in self.fingers.iter_mut().filter_map(|finger| finger.thread.take()) {
            let _ = thread.join(); // it has panicked: that was reported then
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_whose_finger_threads_have_all_panicked_fails() {
        let folder = tempfile::tempdir().expect("a folder");
        let hand =
            "name = \"one\"\n[[fingers]]\nname = \"left\"\nserial = \"A\"\nside = \"left\"\nsensor = \"gelslim\"\n";
        let text = "hand = \"hand.toml\"\n[[fingers]]\nname = \"left\"\nimage_topic = \"/left\"\n";
        std::fs::write(folder.path().join("hand.toml"), hand).expect("writes");
        std::fs::write(folder.path().join("node.toml"), text).expect("writes");
        let domain_id = (1 + std::process::id() % 88).to_string();
        let config = crate::config::load(&folder.path().join("node.toml"), Some(&domain_id)).expect("valid");
        let mut node = SlipNode::start(&config).expect("joins");
        // The same as when every thread has dropped its end.
        node.events = channel().1;
        let error = node.run(&AtomicBool::new(false)).expect_err("nobody judges");
        assert!(!error.is_argument() && error.to_string().contains("panicked"), "{error}");
    }
}
