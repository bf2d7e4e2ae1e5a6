//! The fifth port: whoever looks on. Recorder, terminal, browser view, ROS or Python hang here.

use super::cycle::{Cycle, CycleOutcome};
use super::fault::Fault;
use crate::finger_pipeline::FingerView;
use crate::plant::PlantTruth;
use crate::port::DriverEvent;

/// What an observer is shown after a cycle. All of it is borrowed: what is to be kept is copied.
#[derive(Debug, Clone, Copy)]
pub struct CycleView<'a> {
    /// Time of the cycle, ns.
    pub now_ns: u64,
    /// How it went; None when an error has ended the loop, which whoever drives it has.
    pub outcome: Option<&'a CycleOutcome>,
    /// Every finger, in the order of [`HandReport::health`](crate::hand::HandReport::health).
    pub fingers: &'a [FingerView<'a>],
    /// The fault of gripper or wrist that lasts, or has only just gone.
    pub fault: Option<&'a Fault>,
    /// The first lower force that the gripper refused; it holds on with the higher one.
    pub refused_lowering: Option<&'a str>,
    /// What the gripper's driver did or met since the last cycle.
    pub driver_events: &'a [DriverEvent],
    /// What is true, where somebody knows it: the loop does not, a simulation fills it in.
    pub truth: Option<&'a PlantTruth>,
}

impl CycleView<'_> {
    /// The record of the cycle with the truth, if somebody knows it; None when nothing was commanded.
    pub fn cycle(&self) -> Option<Cycle> {
        let cycle = self.outcome?.commanded()?;
        Some(Cycle { truth: self.truth.copied(), ..*cycle })
    }
}

/// Looks on after every cycle. It cannot disturb the loop: what it fails to do it keeps to itself and tells when the
/// run is over. An observer that may block (a disk, a terminal, a socket) belongs behind a queue to a thread of its
/// own: `slipbound_rig::realtime::QueuedObserver`.
pub trait CycleObserver {
    /// A cycle is over.
    fn after_cycle(&mut self, view: &CycleView<'_>);
}

/// Nobody looks on.
impl CycleObserver for () {
    fn after_cycle(&mut self, _: &CycleView<'_>) {}
}

/// Two look on, one after the other.
impl<A: CycleObserver, B: CycleObserver> CycleObserver for (A, B) {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        self.0.after_cycle(view);
        self.1.after_cycle(view);
    }
}

impl<T: CycleObserver + ?Sized> CycleObserver for &mut T {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        (**self).after_cycle(view);
    }
}

impl<T: CycleObserver + ?Sized> CycleObserver for Box<T> {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        (**self).after_cycle(view);
    }
}
