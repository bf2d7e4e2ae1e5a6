//! An observer that blocks does not stop the loop: what it is not shown is counted.

use slipbound::control::{ControlLoop, CycleObserver, CycleView};
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::hand::{Mounting, Side};
use slipbound::monitor::Settings;
use slipbound::port::{DriverEvent, FrameBuffer, FrameSource, Next, SourceError};
use slipbound::task::{TaskKind, TaskSettings};
use slipbound_rig::realtime::QueuedObserver;
use slipbound_rig::{gripper, sensors, wrist};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

const DEPTH_COUNT: usize = 4;
const CYCLES_COUNT: u64 = 20;

/// A camera that numbers its frames and never has one.
struct Silent;

impl FrameSource for Silent {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        into.seq += 1;
        into.encoded = vec![into.seq as u8; 3];
        Ok(Next::Silent)
    }
}

/// Waits for leave before each cycle; keeps what it was shown.
struct Waiting {
    leave: Receiver<()>,
    seqs: Vec<u64>,
    encoded: Vec<Vec<u8>>,
    events: Vec<DriverEvent>,
}

impl CycleObserver for Waiting {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let _ = self.leave.recv(); // with nobody left to give leave it goes on
        self.seqs.push(view.fingers[0].frame.seq);
        self.encoded.push(view.fingers[0].frame.encoded.clone());
        self.events.extend_from_slice(view.driver_events);
        assert_eq!((view.fingers.len(), view.fingers[0].name), (1, "left"));
    }
}

fn run(observer: &mut dyn CycleObserver) {
    let (sensor, mounting) = (sensors::load("gelslim").expect("built in"), Mounting::on(Side::Left));
    let finger = FingerPipeline::new("left", mounting, sensor, Settings::default(), Box::new(Silent));
    let task = TaskSettings::default().task(TaskKind::Lift, None).expect("valid");
    let mut control = ControlLoop::new(vec![finger], task).expect("a hand");
    let mut gripper = gripper::open("dry", None).expect("dry");
    let mut wrist = wrist::open("dry").expect("dry");
    for cycle in 0..CYCLES_COUNT {
        control.cycle(cycle * 33_000_000, gripper.as_mut(), wrist.as_mut(), observer).expect("goes on");
    }
}

#[test]
fn a_blocked_observer_loses_cycles_and_stops_nothing() {
    let (leave, waits) = sync_channel(0);
    let waiting = Waiting { leave: waits, seqs: Vec::new(), encoded: Vec::new(), events: Vec::new() };
    let mut queue = QueuedObserver::new(waiting, DEPTH_COUNT, true);
    run(&mut queue); // returns though the observer has not had leave once
    let finished = queue.finish(Duration::from_millis(20));
    assert!(finished.observer.is_none());
    assert_eq!(finished.lost_count, CYCLES_COUNT);
    drop(leave);
}

#[test]
fn what_is_shown_and_what_is_lost_are_all_cycles_in_their_order() {
    let (leave, waits) = sync_channel(0);
    let waiting = Waiting { leave: waits, seqs: Vec::new(), encoded: Vec::new(), events: Vec::new() };
    let mut queue = QueuedObserver::new(waiting, DEPTH_COUNT, true);
    run(&mut queue);
    drop(leave);
    let finished = queue.finish(Duration::from_secs(60));
    let shown = finished.observer.expect("it had leave");
    assert_eq!(shown.seqs.len() as u64 + finished.lost_count, CYCLES_COUNT);
    assert!((1..=DEPTH_COUNT + 1).contains(&shown.seqs.len()), "{:?}", shown.seqs);
    assert_eq!(shown.seqs, (1..=shown.seqs.len() as u64).collect::<Vec<_>>(), "the first ones, in their order");
    assert!(shown.encoded.iter().zip(&shown.seqs).all(|(bytes, seq)| *bytes == [*seq as u8; 3]));
}

#[test]
fn an_observer_that_keeps_up_is_shown_everything() {
    let (_leave, waits) = sync_channel::<()>(0);
    drop(_leave);
    let waiting = Waiting { leave: waits, seqs: Vec::new(), encoded: Vec::new(), events: Vec::new() };
    let mut queue = QueuedObserver::new(waiting, 64, false);
    run(&mut queue);
    let finished = queue.finish(Duration::from_secs(60));
    let shown = finished.observer.expect("at once");
    assert_eq!((shown.seqs.len() as u64, finished.lost_count), (CYCLES_COUNT, 0));
    assert!(shown.encoded.iter().all(Vec::is_empty), "encoded bytes are copied only where they are kept");
}
