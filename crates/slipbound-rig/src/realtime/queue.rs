//! An observer behind a bounded queue, on a thread of its own: a slow disk or a blocked terminal does not delay a cycle.
//!
//! ```text
//!   loop --after_cycle--> copy into a free snapshot --queue--> thread: inner.after_cycle
//!                         none free: lost, counted     '------ snapshot free again
//! ```
//!
//! The next snapshot says how many were lost before it, so that an observer that needs them all knows where one is missing.
//!
//! Snapshots are recycled, so a running queue allocates nothing but a copy of each finger's monitor when a slip begins.

use slipbound::control::{CycleObserver, CycleOutcome, CycleView, Fault};
use slipbound::finger_pipeline::FingerView;
use slipbound::monitor::{RestError, RestKind, SlipMonitor, SlipReport};
use slipbound::plant::PlantTruth;
use slipbound::port::{DriverEvent, FrameBuffer, Next};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, sync_channel};
use std::thread;
use std::time::Duration;

/// The result of a queue that was ended.
#[derive(Debug)]
pub struct Finished<O> {
    /// The observer; None when it was still busy at the end of the wait, or has panicked.
    pub observer: Option<O>,
    /// Cycles that the observer did not see.
    pub lost_count: u64,
}

/// Passes cycles to an observer on another thread.
pub struct QueuedObserver<O> {
    filled: SyncSender<Box<Snapshot>>,
    free: Receiver<Box<Snapshot>>,
    observer: Receiver<O>,
    keeps_frames: bool,
    slips_count: u32,
    lost_count: u64,
    /// Of these, those that the observer has not been told of.
    untold_count: u64,
    queued_count: u64,
    shown: Arc<AtomicU64>,
}

impl<O: CycleObserver + Send + 'static> QueuedObserver<O> {
    /// A queue of at most `depth_count` cycles to this observer. `keeps_frames`: whether the observer needs the encoded
    /// bytes of every frame, not only those of the frames in which a slip begins.
    pub fn new(observer: O, depth_count: usize, keeps_frames: bool) -> Self {
        QueuedObserver::reporting_losses(observer, depth_count, keeps_frames, |_, _| {})
    }

    /// The same; `lost` is called with how many cycles were lost, before the observer is shown the one after them.
    pub fn reporting_losses(
        mut observer: O,
        depth_count: usize,
        keeps_frames: bool,
        lost: impl Fn(&mut O, u64) + Send + 'static,
    ) -> Self {
        let (filled, to_show) = sync_channel::<Box<Snapshot>>(depth_count);
        let (recycle, free) = sync_channel(depth_count);
        let (give_back, at_end) = sync_channel(1);
        for _ in 0..depth_count {
            let _ = recycle.try_send(Box::default()); // there is room for as many
        }
        let shown = Arc::new(AtomicU64::new(0));
        let count = shown.clone();
        thread::spawn(move || {
            for mut snapshot in to_show {
                if snapshot.lost_count > 0 {
                    lost(&mut observer, snapshot.lost_count);
                }
                snapshot.show(&mut observer);
                count.fetch_add(1, Ordering::Relaxed);
                let _ = recycle.try_send(snapshot); // the loop is over: nobody needs it
            }
            let _ = give_back.send(observer); // nobody waited so long
        });
        QueuedObserver {
            filled,
            free,
            observer: at_end,
            keeps_frames,
            slips_count: 0,
            lost_count: 0,
            untold_count: 0,
            queued_count: 0,
            shown,
        }
    }

    /// Ends the queue: waits at most `longest` for the observer to process what is queued.
    pub fn finish(self, longest: Duration) -> Finished<O> {
        drop(self.filled);
        let observer = self.observer.recv_timeout(longest).ok();
        let shown_count = self.shown.load(Ordering::Relaxed);
        Finished { observer, lost_count: self.lost_count + self.queued_count.saturating_sub(shown_count) }
    }
}

impl<O> CycleObserver for QueuedObserver<O> {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let mut snapshot = match self.free.try_recv() {
            Ok(snapshot) => snapshot,
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => {
                self.lose();
                return;
            }
        };
        let slips_count = view.outcome.and_then(CycleOutcome::commanded).map(|cycle| cycle.slips_count);
        let slip_begins = slips_count.is_some_and(|count| count > self.slips_count);
        self.slips_count = slips_count.unwrap_or(self.slips_count);
        snapshot.take(view, self.keeps_frames, slip_begins);
        snapshot.lost_count = self.untold_count;
        match self.filled.try_send(snapshot) {
            Ok(()) => {
                self.queued_count += 1;
                self.untold_count = 0;
            }
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => self.lose(),
        }
    }
}

impl<O> QueuedObserver<O> {
    fn lose(&mut self) {
        self.lost_count += 1;
        self.untold_count += 1;
    }
}

/// A copy of what an observer is shown.
#[derive(Default)]
struct Snapshot {
    /// Cycles that were lost since the snapshot before it.
    lost_count: u64,
    now_ns: u64,
    outcome: Option<CycleOutcome>,
    fingers: Vec<FingerSnapshot>,
    fault: Option<Fault>,
    refused_lowering: Option<String>,
    driver_events: Vec<DriverEvent>,
    truth: Option<PlantTruth>,
}

struct FingerSnapshot {
    name: String,
    next: Next,
    frame: FrameBuffer,
    report: Option<SlipReport>,
    monitor: Option<Box<SlipMonitor>>,
    rest_kind: Option<RestKind>,
    rest_error: Option<RestError>,
}

impl Snapshot {
    fn take(&mut self, view: &CycleView<'_>, keeps_frames: bool, slip_begins: bool) {
        self.now_ns = view.now_ns;
        self.outcome = view.outcome.copied();
        self.fault = view.fault.cloned();
        self.refused_lowering = view.refused_lowering.map(str::to_owned);
        self.driver_events.clear();
        self.driver_events.extend_from_slice(view.driver_events);
        self.truth = view.truth.copied();
        if self.fingers.len() != view.fingers.len() {
            self.fingers = view.fingers.iter().map(|finger| FingerSnapshot::new(finger.name)).collect();
        }
        for (into, finger) in self.fingers.iter_mut().zip(view.fingers) {
            into.take(finger, keeps_frames, slip_begins);
        }
    }

    fn show(&mut self, observer: &mut impl CycleObserver) {
        let fingers: Vec<FingerView<'_>> = self.fingers.iter().map(FingerSnapshot::view).collect();
        observer.after_cycle(&CycleView {
            now_ns: self.now_ns,
            outcome: self.outcome.as_ref(),
            fingers: &fingers,
            fault: self.fault.as_ref(),
            refused_lowering: self.refused_lowering.as_deref(),
            driver_events: &self.driver_events,
            truth: self.truth.as_ref(),
        });
        for finger in &mut self.fingers {
            finger.monitor = None;
        }
    }
}

impl FingerSnapshot {
    fn new(name: &str) -> Self {
        FingerSnapshot {
            name: name.to_owned(),
            next: Next::Silent,
            frame: FrameBuffer::default(),
            report: None,
            monitor: None,
            rest_kind: None,
            rest_error: None,
        }
    }

    fn take(&mut self, finger: &FingerView<'_>, keeps_frames: bool, slip_begins: bool) {
        self.next.clone_from(finger.next);
        (self.report, self.rest_kind) = (finger.report.copied(), finger.rest_kind);
        self.rest_error = finger.rest_error.cloned();
        let from = finger.frame;
        (self.frame.seq, self.frame.time_ns, self.frame.clock) = (from.seq, from.time_ns, from.clock);
        self.frame.encoded.clear();
        if keeps_frames {
            self.frame.encoded.extend_from_slice(&from.encoded);
        }
        if slip_begins {
            (self.frame.format, self.frame.size) = (from.format, from.size);
            self.frame.pixels.clone_from(&from.pixels);
            self.monitor = finger.monitor.map(|monitor| Box::new(monitor.clone()));
        }
    }

    fn view(&self) -> FingerView<'_> {
        FingerView {
            name: &self.name,
            next: &self.next,
            frame: &self.frame,
            report: self.report.as_ref(),
            monitor: self.monitor.as_deref(),
            rest_kind: self.rest_kind,
            rest_error: self.rest_error.as_ref(),
        }
    }
}
