//! The control loop around a simulated hand, in lock-step: one cycle, then 1/30 s of the world, as fast as the computer
//! allows.
//!
//! ```text
//!   SimHand cameras --> ControlLoop::cycle --> Actuators (the simulator's own, or drivers and emulators) --> SimHand
//!                            '--> observer, with the truth filled in; RunScore
//! ```
//!
//! ```no_run
#![doc = include_str!("../examples/hold_simulated.rs")]
//! ```

use crate::faults::{CameraFault, CameraFaults, Faulty};
use crate::hand::{HandScene, SimGripper, SimHand, SimWrist};
use crate::random::Random;
use crate::score::RunScore;
use slipbound::control::{ControlError, ControlLoop, CycleObserver, CycleOutcome, CycleView};
use slipbound::finger_pipeline::{FingerPipeline, MonitorRunner};
use slipbound::hand::{Mounting, Side};
use slipbound::monitor::Settings;
use slipbound::plant::PlantTruth;
use slipbound::port::{FrameSource, Gripper, Wrist};
use slipbound::setting::SettingError;
use slipbound::task::{Task, TaskSettings};

/// Frames that the world continues for after the loop was left: two seconds show whether the object stays held.
const FRAMES_AFTER_LEAVING_COUNT: u32 = 60;

/// Cycles after the end of a task: a failed hold becomes visible within half a second.
const CYCLES_AFTER_END_COUNT: u32 = 15;

/// Sides of the fingers 0 and 1.
const SIDES: [Side; 2] = [Side::Left, Side::Right];

/// The gripper and wrist that act on the simulated world.
pub trait Actuators {
    /// Gripper and wrist, as the loop commands them.
    fn ports(&mut self) -> (&mut dyn Gripper, &mut dyn Wrist);

    /// Advances the time to the hand's next frame.
    fn advance_frame(&mut self, hand: &SimHand);
}

/// The simulator's own gripper and wrist, without a protocol in between.
struct Direct {
    gripper: SimGripper,
    wrist: SimWrist,
}

impl Actuators for Direct {
    fn ports(&mut self) -> (&mut dyn Gripper, &mut dyn Wrist) {
        (&mut self.gripper, &mut self.wrist)
    }

    fn advance_frame(&mut self, hand: &SimHand) {
        hand.advance_frame();
    }
}

/// Why a run in lock-step ended before its task.
#[derive(Debug, thiserror::Error)]
pub enum LockStepError {
    /// The loop ended with an error.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// The simulated world cannot continue.
    #[error("the simulated hand: {0}")]
    World(#[from] SettingError),
}

/// A task in simulation, before or between two cycles.
pub struct LockStep {
    hand: SimHand,
    control: ControlLoop,
    actuators: Box<dyn Actuators + Send>,
    score: RunScore,
}

/// A finger of the hand of a scene, with the scene's faults of the cameras, drawn for each finger, then `fault`. Its name
/// is that of its side; so is its mounting, unless the two fingers are swapped.
pub fn finger(
    scene: &HandScene,
    hand: &SimHand,
    finger: usize,
    monitor: &Settings,
    fault: Option<CameraFault>,
    source: Box<dyn FrameSource + Send>,
) -> FingerPipeline {
    let is_swapped = fault.is_some_and(|fault| fault.swaps_fingers());
    let mounted = if is_swapped { SIDES[1 - finger] } else { SIDES[finger] };
    let seed = Random::of(scene.seed(), finger as u64).next_u64();
    let source = Faulty::new(source, scene.faults().unwrap_or_default(), seed);
    let source = CameraFaults::new(source, fault.filter(|fault| fault.applies_to(finger)));
    let sensor = hand.sensor(finger);
    FingerPipeline::new(SIDES[finger].name(), Mounting::on(mounted), sensor, monitor.clone(), Box::new(source))
}

impl LockStep {
    /// The hand of a scene with its task around it. Fails for invalid settings of either.
    pub fn new(
        scene: &HandScene,
        settings: &TaskSettings,
        monitor: &Settings,
        fault: Option<CameraFault>,
    ) -> Result<Self, SettingError> {
        let hand = SimHand::new(scene)?;
        let task = settings.task(scene.task(), hand.sensor(0).shear_stiffness_mpa_per_mm())?;
        LockStep::around(scene, hand, task, monitor, fault)
    }

    /// The same around a user's own task, or a task with a user's own controller. `hand` is the hand of the scene.
    pub fn around(
        scene: &HandScene,
        hand: SimHand,
        task: Box<dyn Task + Send>,
        monitor: &Settings,
        fault: Option<CameraFault>,
    ) -> Result<Self, SettingError> {
        let of = |i: usize| finger(scene, &hand, i, monitor, fault, Box::new(hand.camera(i)));
        let fingers = (0..scene.fingers_count()).map(of);
        let control = ControlLoop::new(fingers.collect(), task)?;
        let actuators = Box::new(Direct { gripper: hand.gripper(), wrist: hand.wrist() });
        let score = RunScore::new(control.task().grip().limits().most_n);
        Ok(LockStep { hand, control, actuators, score })
    }

    /// The same with other actuators, for example drivers and emulators.
    #[must_use]
    pub fn with_actuators(self, actuators: Box<dyn Actuators + Send>) -> Self {
        LockStep { actuators, ..self }
    }

    /// The same with the monitors run by `runner`; the reports do not differ.
    #[must_use]
    pub fn with_runner(self, runner: Box<dyn MonitorRunner>) -> Self {
        LockStep { control: self.control.with_runner(runner), ..self }
    }

    /// The hand.
    pub fn hand(&self) -> &SimHand {
        &self.hand
    }

    /// The loop around it.
    pub fn control(&self) -> &ControlLoop {
        &self.control
    }

    /// The score of the cycles so far.
    pub fn score(&self) -> &RunScore {
        &self.score
    }

    /// Runs cycles until half a second after the end of the task, or until the scene ends. An error where a fault has
    /// ended the task ([`CycleOutcome::is_over`]). `stop` ends the run with [`ControlError::Interrupted`]: the wrist is
    /// paused and the grip kept.
    pub fn run(&mut self, stop: &dyn Fn() -> bool, observer: &mut dyn CycleObserver) -> Result<(), LockStepError> {
        let mut after_count = 0;
        loop {
            let outcome = self.cycle(observer)?;
            let is_over = outcome.is_over(self.control.fault());
            if let (Err(fault), 0) = (is_over, after_count) {
                self.leave();
                return Err(fault.into());
            }
            if outcome == CycleOutcome::SourceEnded {
                return Ok(());
            }
            after_count += u32::from(outcome.has_ended());
            if after_count > CYCLES_AFTER_END_COUNT {
                return Ok(());
            }
            if stop() {
                self.leave();
                return Err(ControlError::Interrupted.into());
            }
        }
    }

    /// One cycle of the loop, then 1/30 s of the world, for callers that drive it cycle by cycle. The ground truth is
    /// of the time of the frames. After an error the loop has been left.
    pub fn cycle(&mut self, observer: &mut dyn CycleObserver) -> Result<CycleOutcome, LockStepError> {
        let (now_ns, truth) = (self.hand.now_ns(), self.hand.truth());
        let mut observer = WithTruth { observer, truth: truth.record() };
        let (gripper, wrist) = self.actuators.ports();
        let outcome = self.control.cycle(now_ns, gripper, wrist, &mut observer);
        match outcome.as_ref().ok().and_then(CycleOutcome::commanded) {
            Some(cycle) => self.score.add_cycle(cycle, Some(&truth)),
            None => self.score.add_truth(&truth),
        }
        match outcome {
            Ok(_) => self.actuators.advance_frame(&self.hand),
            Err(_) => self.advance_after_leaving(),
        }
        match self.hand.error() {
            Some(error) => Err(error.into()),
            None => Ok(outcome?),
        }
    }

    /// Leaves the hand before its task has ended: the wrist pauses, the grip stays, and the world continues for two
    /// seconds.
    pub fn leave(&mut self) {
        let (gripper, wrist) = self.actuators.ports();
        self.control.leave(gripper, wrist);
        self.advance_after_leaving();
    }

    fn advance_after_leaving(&mut self) {
        (0..FRAMES_AFTER_LEAVING_COUNT).for_each(|_| self.actuators.advance_frame(&self.hand));
        self.score.add_truth(&self.hand.truth());
    }
}

/// Adds the ground truth to what an observer sees.
struct WithTruth<'a> {
    observer: &'a mut dyn CycleObserver,
    truth: PlantTruth,
}

impl CycleObserver for WithTruth<'_> {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        self.observer.after_cycle(&CycleView { truth: Some(&self.truth), ..*view });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::port::Next;

    /// When a frame of each finger was torn, ns.
    #[derive(Default)]
    struct Torn([Vec<u64>; 2]);

    impl CycleObserver for Torn {
        fn after_cycle(&mut self, view: &CycleView<'_>) {
            for (at_ns, finger) in self.0.iter_mut().zip(view.fingers) {
                at_ns.extend(matches!(finger.next, Next::Torn { .. }).then_some(view.now_ns));
            }
        }
    }

    #[test]
    fn the_faults_of_a_scene_hit_each_finger_on_its_own() {
        let torn = |fault: &str| {
            let scene = format!("screw?height_px=240&longest_s=0.6&fault={fault}");
            let scene = HandScene::parse(&scene).expect("a scene");
            let mut run = LockStep::new(&scene, &TaskSettings::default(), &Settings::default(), None).expect("a hand");
            let mut torn = Torn::default();
            run.run(&|| false, &mut torn).expect("runs to its end");
            torn.0
        };
        let [left, right] = torn("torn=0.5");
        assert!(left.len() > 2 && right.len() > 2 && left != right, "{left:?} {right:?}");
        assert!(torn("none").iter().all(Vec::is_empty));
    }
}
