//! Tasks of the paper and one more: state machines that see what the hand sees and say what gripper and wrist shall
//! do. The same for simulation and hardware.
//!
//! ```text
//!   Observation { hand, gripper, wrist } --> Task --> TaskStep { grip, wrist, phase }
//!                                        |
//!                                    GripController
//! ```
//!
//! The loop around a task is [`control`](crate::control). Every wrist motion a task asks for is bounded and lives 200 ms, so a loop that stops leaves a wrist that
//! stops; the gripper keeps its force.
//!
//! One step: a hand whose cameras are blind, and a gripper that stands open. Nothing is lifted blind. A whole lift is the example `step_a_task`.
//!
//! ```
//! use slipbound::hand::{Hand, Mounting, Side};
//! use slipbound::port::{GripperState, Jaws, WristMotion, WristState};
//! use slipbound::task::{Observation, TaskKind, TaskSettings};
//!
//! let mut task = TaskSettings::default().task(TaskKind::Lift, None)?;
//! let hand = Hand::new(&[Mounting::on(Side::Left)])?.report(0);
//! let gripper = GripperState {
//!     time_ns: 0, force_n: Some(0.0), force_error_n: None, target_n: None, opening_mm: Some(32.0), jaws: Jaws::Open,
//! };
//! let wrist = WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, moving: false };
//! let step = task.step(&Observation { now_ns: 0, hand: &hand, gripper: &gripper, wrist: &wrist });
//! assert!(!matches!(step.wrist.motion, WristMotion::Lower { .. }));
//! # Ok::<(), slipbound::setting::SettingError>(())
//! ```

mod grasp;
mod lift;
mod place;
mod screw;
mod settings;
mod shear_watch;
mod step;
mod tare;
mod turning;
mod unscrew;

pub use lift::{Lift, LiftSettings};
pub use place::{Place, PlaceSettings};
pub use screw::{Screw, ScrewEnd, ScrewSettings};
pub use settings::{ControllerKind, TaskKind, TaskSettings};
pub use step::{Ending, Missing, Observation, Phase, Task, TaskStep};
pub use turning::SlideSettings;
pub use unscrew::{Unscrew, UnscrewSettings};
