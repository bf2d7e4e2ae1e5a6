//! Tasks of the paper and one more: state machines that see what the hand sees and say what gripper and wrist shall
//! do. The same for simulation and hardware.
//!
//! ```text
//!   Observation { hand, gripper, wrist } --> Task --> TaskStep { grip, wrist, ended }
//!                                        |
//!                                    GripController
//! ```
//!
//! The loop around a task is [`control`](crate::control). Every wrist motion a task asks for is bounded and lives 200 ms, so a loop that stops leaves a wrist that
//! stops; the gripper keeps its force.

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
