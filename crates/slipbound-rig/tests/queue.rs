//! An observer that blocks does not stop the loop: the cycles that it misses are counted.

#[path = "run/screw.rs"]
#[allow(dead_code)] // one made-up cycle is enough
mod screw;

use slipbound::control::{ControlLoop, Cycle, CycleObserver, CycleOutcome, CycleView, Fault, FaultKind};
use slipbound::finger_pipeline::{FingerPipeline, FingerView, RestFinder};
use slipbound::hand::{Mounting, Side};
use slipbound::monitor::{Settings, SlipMonitor};
use slipbound::plant::PlantTruth;
use slipbound::port::{DriverEvent, FrameBuffer, FrameSource, Next, SourceError};
use slipbound::task::{TaskKind, TaskSettings};
use slipbound_rig::realtime::QueuedObserver;
use slipbound_rig::run::RunRecorder;
use slipbound_rig::{gripper, sensors, source, wrist};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
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

/// Waits for permission before each cycle; keeps what it was shown.
struct Waiting {
    leave: Receiver<()>,
    seqs: Vec<u64>,
    encoded: Vec<Vec<u8>>,
    events: Vec<DriverEvent>,
}

impl CycleObserver for Waiting {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let _ = self.leave.recv(); // continues when nobody can give permission any more
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
    run(&mut queue); // returns although the observer never got permission
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

/// Writes a run on a disk that waits for permission before each cycle.
struct SlowDisk {
    leave: Receiver<()>,
    recorder: RunRecorder,
}

impl CycleObserver for SlowDisk {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let _ = self.leave.recv(); // continues when nobody can give permission any more
        self.recorder.after_cycle(view);
    }
}

/// A replay goes cycle by cycle: after a missing cycle, frames and reports would be assigned to the wrong ones.
#[test]
fn a_cycle_that_is_lost_on_the_way_to_a_run_is_a_gap_after_which_no_frame_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let info = screw::info();
    let recorder = RunRecorder::create(folder.path(), &info, true).expect("creates");
    let (leave, waits) = sync_channel(0);
    let disk = SlowDisk { leave: waits, recorder };
    let told = |disk: &mut SlowDisk, count| disk.recorder.lost_cycles(count);
    let mut queue = QueuedObserver::reporting_losses(disk, DEPTH_COUNT, true, told);
    let cycles = screw::cycles();
    let show = |queue: &mut QueuedObserver<SlowDisk>, n: usize| {
        let frame = FrameBuffer { seq: n as u64, encoded: vec![n as u8; 3], ..FrameBuffer::default() };
        let outcome = CycleOutcome::Commanded(cycles[n]);
        let finger = |name| FingerView {
            name,
            next: &Next::Frame,
            frame: &frame,
            report: None,
            monitor: None,
            rest_kind: None,
            rest_error: None,
        };
        let fingers: Vec<FingerView<'_>> = info.fingers.iter().map(|of| finger(of.name.as_str())).collect();
        queue.after_cycle(&CycleView {
            now_ns: cycles[n].time_ns,
            outcome: Some(&outcome),
            fingers: &fingers,
            fault: None,
            refused_lowering: None,
            driver_events: &[],
            truth: None,
        });
    };
    (0..10).for_each(|n| show(&mut queue, n)); // the disk is blocked
    (0..DEPTH_COUNT).for_each(|_| leave.send(()).expect("it waits"));
    std::thread::sleep(Duration::from_millis(200)); // the last snapshot is on its way back
    (10..13).for_each(|n| show(&mut queue, n));
    drop(leave);
    let finished = queue.finish(Duration::from_secs(60));
    assert_eq!(finished.lost_count as usize, 10 - DEPTH_COUNT);
    let recorder = finished.observer.expect("it answers").recorder;
    assert!(recorder.failures().1.is_none() && recorder.unkept_count() == 3, "nothing has failed");
    let lines = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("lines").lines().count();
    assert_eq!(lines("reports.jsonl"), DEPTH_COUNT + 3, "all that came");
    assert_eq!(lines("frames.jsonl"), DEPTH_COUNT, "those before the gap");
    let events = std::fs::read_to_string(folder.path().join("events.jsonl")).expect("events");
    assert!(events.contains("6 cycles before this were not written"), "{events}");
    assert_eq!(events.matches("frames are not kept from here on").count(), 1, "{events}");
}

/// The same for a recording in one file: the frames that the loop took are listed up to the gap, and never without
/// their cycle.
#[cfg(feature = "mcap")]
#[test]
fn a_cycle_that_is_lost_on_the_way_to_a_recording_is_a_gap_after_which_no_frame_is_listed() {
    use slipbound_rig::container::{McapObserver, Recorder, to_folder};
    let scratch = tempfile::tempdir().expect("a folder");
    let (file, folder) = (scratch.path().join("run.mcap"), scratch.path().join("run"));
    let (info, cycles) = (screw::info(), screw::cycles());
    let recorder = Recorder::create(&file, &info.finger_names(), false).expect("creates");
    recorder.begin();
    let mut observer = McapObserver::new(recorder.inlet(), info.clone(), Vec::new());
    for n in (0..4).chain(10..13) {
        if n == 10 {
            observer.lost_cycles(6);
        }
        let frame = FrameBuffer { seq: n as u64, ..FrameBuffer::default() };
        let finger = |name| FingerView {
            name,
            next: &Next::Frame,
            frame: &frame,
            report: None,
            monitor: None,
            rest_kind: None,
            rest_error: None,
        };
        let fingers: Vec<FingerView<'_>> = info.fingers.iter().map(|of| finger(of.name.as_str())).collect();
        observer.after_cycle(&CycleView {
            now_ns: cycles[n].time_ns,
            outcome: Some(&CycleOutcome::Commanded(cycles[n])),
            fingers: &fingers,
            fault: None,
            refused_lowering: None,
            driver_events: &[],
            truth: None,
        });
    }
    drop(observer);
    recorder.finish().expect("closes");
    to_folder(&file, &folder).expect("converts");
    let text = |name: &str| std::fs::read_to_string(folder.join(name)).expect("lines");
    assert_eq!((text("reports.jsonl").lines().count(), text("frames.jsonl").lines().count()), (7, 4));
    let events = text("events.jsonl");
    assert!(events.contains("6 cycles before this were not written"), "{events}");
    assert_eq!(events.matches("a replay goes to here").count(), 1, "{events}");
}

/// Passes what it was shown to the test's thread, one cycle at a time.
struct Mirror(SyncSender<Shown>);

#[derive(Debug, PartialEq)]
struct Shown {
    pixels: Vec<u8>,
    has_monitor: bool,
    events_count: usize,
    fault: Option<FaultKind>,
    truth: Option<PlantTruth>,
}

impl CycleObserver for Mirror {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let finger = &view.fingers[0];
        let _ = self.0.send(Shown {
            pixels: finger.frame.pixels.clone(),
            has_monitor: finger.monitor.is_some(),
            events_count: view.driver_events.len(),
            fault: view.fault.map(|fault| fault.kind),
            truth: view.truth.copied(),
        });
    }
}

/// A monitor of the test recording.
fn monitor() -> SlipMonitor {
    let testdata = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata");
    let sensor = sensors::load(&format!("{testdata}/painted.toml")).expect("a sensor");
    let mut source = source::open(&format!("{testdata}/twist.avi")).expect("a recording");
    let mut finder = RestFinder::new(&sensor, &Settings::default(), sensor.image_px).expect("valid");
    let mut frame = FrameBuffer::default();
    while !finder.is_full() && source.next(&mut frame).expect("reads") == Next::Frame {
        finder.see(&frame).expect("a frame");
    }
    SlipMonitor::new(&sensor, &Settings::default(), finder.find().expect("rest").rest).expect("valid")
}

/// Snapshots are reused: nothing of an earlier cycle may be shown again, and expensive data are copied only at a slip.
#[test]
fn a_recycled_snapshot_shows_this_cycle_and_pixels_and_monitor_when_a_slip_begins() {
    let (monitor, cycle) = (monitor(), screw::cycles()[150]);
    let fault = Fault { kind: FaultKind::GripperStopped, text: "stopped".into() };
    let truth = PlantTruth { slid_mm: Some(0.5), ..cycle.truth.expect("simulated") };
    let (send, shown) = sync_channel(1);
    let mut queue = QueuedObserver::new(Mirror(send), 2, true);
    for (n, slips_count) in [3, 4, 4, 4, 5, 5].into_iter().enumerate() {
        let frame = FrameBuffer { pixels: vec![n as u8; 4], ..FrameBuffer::default() };
        let outcome = CycleOutcome::Commanded(Cycle { slips_count, ..cycle });
        let is_odd = n % 2 == 1;
        let finger = FingerView {
            name: "left",
            next: &Next::Frame,
            frame: &frame,
            report: None,
            monitor: Some(&monitor),
            rest_kind: None,
            rest_error: None,
        };
        queue.after_cycle(&CycleView {
            now_ns: n as u64,
            outcome: Some(&outcome),
            fingers: &[finger],
            fault: is_odd.then_some(&fault),
            refused_lowering: None,
            driver_events: if is_odd { &[DriverEvent::Linked] } else { &[] },
            truth: is_odd.then_some(&truth),
        });
        let shown = shown.recv_timeout(Duration::from_secs(60)).expect("shown, for snapshots come back");
        let slip_begins = [0, 1, 4].contains(&n);
        assert_eq!(shown.pixels == frame.pixels, slip_begins, "cycle {n}: {:?}", shown.pixels);
        assert_eq!(shown.has_monitor, slip_begins, "cycle {n}");
        assert_eq!(shown.events_count, usize::from(is_odd), "cycle {n}");
        assert_eq!(shown.fault, is_odd.then_some(FaultKind::GripperStopped), "cycle {n}");
        assert_eq!(shown.truth, is_odd.then_some(truth), "cycle {n}");
        std::thread::sleep(Duration::from_millis(5)); // the snapshot is on its way back
    }
    assert_eq!(queue.finish(Duration::from_secs(60)).lost_count, 0);
}
