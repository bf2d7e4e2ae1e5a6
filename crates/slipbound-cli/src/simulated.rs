//! A simulated hand brought together with the loop.

use crate::closed_loop::{ClosedLoop, Eye, Told, Turned};
use crate::spoiled::{Spoiled, Spoiler};
use crate::through::{Emulated, LinkFaults, Through};
use slipbound::hand::{Mounting, Side};
use slipbound::monitor::Settings;
use slipbound::setting::SettingError;
use slipbound::task::{Phase, TaskKind, TaskSettings};
use slipbound_lab::hand::{HandScene, HandTruth, SimGripper, SimHand, SimWrist};

/// Sides of the fingers 0 and 1, and their names.
const SIDES: [(Side, &str); 2] = [(Side::Left, "left"), (Side::Right, "right")];

/// A task in simulation, before or between two turns.
pub struct Simulated {
    /// The hand.
    pub hand: SimHand,
    /// The loop around it.
    pub around: ClosedLoop,
    reach: Reach,
}

/// How gripper and wrist are reached.
enum Reach {
    /// The simulator's own.
    Direct { gripper: SimGripper, wrist: SimWrist },
    /// Drivers and emulators.
    Emulated(Box<Emulated>),
}

/// How a finger of the simulated hand is mounted, and its name; taken one for the other when they are swapped.
pub fn mounting(finger: usize, swapped: bool) -> (Mounting, &'static str) {
    let side = if swapped { SIDES[1 - finger].0 } else { SIDES[finger].0 };
    (Mounting::on(side), SIDES[finger].1)
}

/// The task a scene is of.
pub fn kind(scene: &HandScene) -> Result<TaskKind, SettingError> {
    match scene.task_name() {
        "screw" => Ok(TaskKind::Screw),
        "unscrew" => Ok(TaskKind::Unscrew),
        "place" => Ok(TaskKind::Place),
        "lift" => Ok(TaskKind::Lift),
        other => Err(SettingError {
            key: "task".into(),
            got: other.into(),
            expected: "one of screw, unscrew, place, lift".into(),
        }),
    }
}

impl Simulated {
    /// The hand of a scene with a task around it. Refuses what either cannot be.
    pub fn new(
        scene: &HandScene,
        settings: &TaskSettings,
        monitor: &Settings,
        spoiler: Option<Spoiler>,
    ) -> anyhow::Result<Self> {
        let hand = SimHand::new(scene)?;
        let mut eyes = Vec::new();
        for finger in 0..scene.fingers_count() {
            let (mounting, name) = mounting(finger, spoiler.is_some_and(|spoiler| spoiler.swaps()));
            let camera = hand.camera(finger);
            let source = Spoiled::new(camera, spoiler.filter(|spoiler| spoiler.hits(finger)));
            eyes.push(Eye::new(name, mounting, hand.sensor(finger), monitor.clone(), Box::new(source)));
        }
        let task = settings.task(kind(scene)?, hand.sensor(0).shear_stiffness_mpa_per_mm())?;
        let reach = Reach::Direct { gripper: hand.gripper(), wrist: hand.wrist() };
        Ok(Simulated { around: ClosedLoop::new(eyes, task)?, hand, reach })
    }

    /// The same, with gripper and wrist reached through drivers and emulators.
    pub fn through(mut self, scene: &HandScene, through: &Through, faults: &LinkFaults) -> anyhow::Result<Self> {
        self.reach = Reach::Emulated(Box::new(Emulated::new(&self.hand, scene.width_mm(), through, faults)?));
        Ok(self)
    }

    /// One turn of the loop, then 1/30 s of the world. The truth is of the time of the frames.
    fn turn(&mut self) -> anyhow::Result<(Turned, HandTruth)> {
        let (now_ns, truth) = (self.hand.now_ns(), self.hand.truth());
        let turned = match &mut self.reach {
            Reach::Direct { gripper, wrist } => self.around.turn(now_ns, gripper, wrist),
            Reach::Emulated(emulated) => self.around.turn(now_ns, &mut emulated.gripper, &mut emulated.wrist),
        };
        if turned.is_err() {
            // What is held when the loop has been left is held on, or is not: that shows within two seconds.
            (0..ABANDONED_FRAMES_COUNT).for_each(|_| self.advance_frame());
        } else {
            self.advance_frame();
        }
        if let Some(error) = self.hand.error() {
            return Err(error.into());
        }
        Ok((turned?, truth))
    }

    fn advance_frame(&mut self) {
        match &mut self.reach {
            Reach::Direct { .. } => self.hand.advance_frame(),
            Reach::Emulated(emulated) => emulated.advance_frame(&self.hand),
        }
    }

    fn notes(&mut self) -> Vec<String> {
        match &mut self.reach {
            Reach::Direct { .. } => Vec::new(),
            Reach::Emulated(emulated) => {
                std::iter::from_fn(|| emulated.gripper.next_note()).map(|note| note.to_string()).collect()
            }
        }
    }

    /// Turns until the task has ended and a little longer, or the scene has. Shows every turn.
    pub fn run(
        &mut self,
        mut see: impl FnMut(&mut ClosedLoop, &Told<'_>, &HandTruth) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let mut after_count = 0;
        loop {
            let now_ns = self.hand.now_ns();
            let (turned, truth) = self.turn()?;
            let notes = self.notes();
            see(&mut self.around, &Told { now_ns, turned, notes: &notes }, &truth)?;
            match turned {
                Turned::Over => return Ok(()),
                Turned::Commanded(turn) if matches!(turn.step.phase, Phase::Ended(_)) => {
                    after_count += 1;
                    if after_count > AFTER_TURNS_COUNT {
                        return Ok(());
                    }
                }
                _ => {}
            }
        }
    }
}

/// Frames that the world goes on for after the loop was left.
const ABANDONED_FRAMES_COUNT: u32 = 60;

/// Turns after the end of a task: half a second in which a hold that was none would show.
const AFTER_TURNS_COUNT: u32 = 15;
