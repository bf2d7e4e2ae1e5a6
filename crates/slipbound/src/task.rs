//! The tasks of the paper and one more: state machines from the hand report to commands for gripper and wrist. The same
//! code runs in simulation and on hardware.
//!
//! ```text
//!   Observation { hand, gripper, wrist } --> Task --> TaskStep { grip, wrist, phase }
//!                                        |
//!                                    GripController
//! ```
//!
//! The loop around a task is [`control`](crate::control). Every wrist motion commanded by a task is bounded and expires
//! after 200 ms, so when the loop stops, the wrist stops; the gripper keeps its force.
//!
//! One step with a blind hand and an open gripper: nothing is lifted. A complete lift is the example `step_a_task`.
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
mod ground;
mod lift;
mod place;
mod screw;
mod settings;
mod shear_history;
mod shear_offset;
mod step;
mod turning;
mod unscrew;

pub use lift::{Lift, LiftSettings};
pub use place::{Place, PlaceSettings};
pub use screw::{Screw, ScrewEnd, ScrewSettings};
pub use settings::{ControllerKind, TaskKind, TaskSettings};
pub use step::{Ending, Missing, Observation, Phase, Task, TaskStep};
pub use turning::SlideSettings;
pub use unscrew::{Unscrew, UnscrewSettings};
