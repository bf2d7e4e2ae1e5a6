//! Observers of the loop: recorder, terminal, ROS and Python attach here.

use super::cycle::{Cycle, CycleOutcome};
use super::fault::Fault;
use crate::finger_pipeline::FingerView;
use crate::plant::PlantTruth;
use crate::port::DriverEvent;

/// What an observer receives after a cycle. All of it is borrowed: an observer copies what it keeps.
#[derive(Debug, Clone, Copy)]
pub struct CycleView<'a> {
    /// Time of the cycle, ns.
    pub now_ns: u64,
    /// Result of the cycle; None when an error has ended the loop: [`ControlLoop::cycle`](super::ControlLoop::cycle)
    /// returns that error.
    pub outcome: Option<&'a CycleOutcome>,
    /// Every finger, in the order of [`HandReport::health`](crate::hand::HandReport::health).
    pub fingers: &'a [FingerView<'a>],
    /// The fault of gripper or wrist that is present, or was present less than half a second ago.
    pub fault: Option<&'a Fault>,
    /// The first lower force that the gripper refused, in words; it keeps the higher one.
    pub refused_lowering: Option<&'a str>,
    /// Events of the gripper's driver since the last cycle.
    pub driver_events: &'a [DriverEvent],
    /// Ground truth, filled in by a simulation; None otherwise.
    pub truth: Option<&'a PlantTruth>,
}

impl CycleView<'_> {
    /// The record of the cycle, with the ground truth if there is one; None when nothing was commanded.
    pub fn cycle(&self) -> Option<Cycle> {
        let cycle = self.outcome?.commanded()?;
        Some(Cycle { truth: self.truth.copied(), ..*cycle })
    }
}

/// Called after every cycle. It cannot disturb the loop: it keeps its own errors and reports them when the run is over.
/// An observer that may block (a disk, a terminal, a socket) belongs behind a queue, on a separate thread:
/// `slipbound_rig::realtime::QueuedObserver`.
pub trait CycleObserver {
    /// A cycle has ended.
    fn after_cycle(&mut self, view: &CycleView<'_>);
}

/// No observer.
impl CycleObserver for () {
    fn after_cycle(&mut self, _: &CycleView<'_>) {}
}

/// An observer that may be missing.
impl<T: CycleObserver> CycleObserver for Option<T> {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        if let Some(observer) = self {
            observer.after_cycle(view);
        }
    }
}

/// Two observers, one after the other.
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
