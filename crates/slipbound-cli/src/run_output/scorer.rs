//! The score of a run that is not in lock-step, and the counts of its frames: cycles in, numbers out.

use slipbound::control::{CycleObserver, CycleView};
use slipbound::finger_pipeline::FingerView;
use slipbound::image::SizePx;
use slipbound::port::Next;
use slipbound::task::Phase;
use slipbound_lab::hand::HandTruth;
use slipbound_lab::score::RunScore;
use std::sync::{Arc, Mutex, PoisonError};

/// Counts the frames of a finger.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrameTally {
    /// Frames that arrived whole.
    pub whole_count: u64,
    /// Frames that did not.
    pub torn_count: u64,
    /// Whole frames of another size than the first, for which the monitor is made.
    pub other_size_count: u64,
    first_size: Option<SizePx>,
}

impl FrameTally {
    fn see(&mut self, finger: &FingerView<'_>) {
        match finger.next {
            Next::Frame => {
                self.whole_count += 1;
                let first_size = *self.first_size.get_or_insert(finger.frame.size);
                self.other_size_count += u64::from(finger.frame.size != first_size);
            }
            Next::Torn { .. } => self.torn_count += 1,
            Next::Silent | Next::End => {}
        }
    }
}

/// Adds up the score of a run that is not in lock-step; `truth` is the present ground truth, where it is known.
pub struct RunScorer {
    /// The score so far.
    pub score: RunScore,
    /// What the task was doing last; None before the first command.
    pub phase: Option<Phase>,
    /// What the source of every finger gave.
    pub tallies: Vec<FrameTally>,
    /// The first lower force that the gripper refused.
    pub refused_lowering: Option<String>,
    /// The present ground truth, set by the thread of the simulated world.
    pub truth: Arc<Mutex<Option<HandTruth>>>,
}

impl RunScorer {
    /// Before the first cycle; see [`RunScore::new`].
    pub fn new(limit_n: f64) -> Self {
        RunScorer {
            score: RunScore::new(limit_n),
            phase: None,
            tallies: Vec::new(),
            refused_lowering: None,
            truth: Arc::default(),
        }
    }
}

impl CycleObserver for RunScorer {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        if self.refused_lowering.is_none() {
            self.refused_lowering = view.refused_lowering.map(str::to_owned);
        }
        self.tallies.resize(view.fingers.len(), FrameTally::default());
        for (tally, finger) in self.tallies.iter_mut().zip(view.fingers) {
            tally.see(finger);
        }
        let truth = self.truth.lock().unwrap_or_else(PoisonError::into_inner);
        match (view.cycle(), truth.as_ref()) {
            (Some(cycle), truth) => {
                self.phase = Some(cycle.phase);
                self.score.add_cycle(&cycle, truth);
            }
            (None, Some(truth)) => self.score.add_truth(truth),
            (None, None) => {}
        }
    }
}
