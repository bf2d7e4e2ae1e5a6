//! Grip controllers: a hand report and the gripper's state in, a grip command out.
//!
//! ```text
//!   HandReport ----> GripController ----> Guard ----> GripDecision { force_n, arm }
//!   GripperState -->  constant            range; force never lowered while blind
//!                     on_slip (the paper)
//!                     margin  (ours)
//! ```
//!
//! Newtons are normal force per finger. A controller never fails: for every input it returns a force in its range, and
//! the force is not lowered while the hand is blind.
//!
//! ```
//! use slipbound::grip::{ArmMotion, GripController, GripLimits, Law, OnSlipSettings};
//! use slipbound::hand::{Hand, Mounting, Side};
//! use slipbound::monitor::SlipState;
//! use slipbound::port::{GripperState, Jaws};
//!
//! let limits = GripLimits::default().with_forces_n(8.0, 5.0, 40.0);
//! let mut controller = Law::OnSlip(OnSlipSettings::default().with_step_n(6.0)).controller(&limits)?;
//!
//! let (time_ns, target_n, opening_mm) = (0, Some(8.0), Some(28.0));
//! let gripper =
//!     GripperState { time_ns, force_n: Some(8.0), force_error_n: None, target_n, opening_mm, jaws: Jaws::Holding };
//! let mut hand = Hand::new(&[Mounting::on(Side::Left)])?.report(0); // of your fingers: `hand::Hand`
//! (hand.state, hand.live_count) = (SlipState::Incipient, 1);
//!
//! let decision = controller.decide(0, &hand, &gripper);
//! assert_eq!((decision.force_n, decision.arm), (14.0, ArmMotion::Pause)); // 6 N more, and the arm waits
//! # Ok::<(), slipbound::setting::SettingError>(())
//! ```

mod constant;
mod controller;
mod force_sense;
mod guard;
mod margin;
mod on_slip;
mod unsure;

pub use constant::Constant;
pub(crate) use controller::arrived;
pub use controller::{ArmMotion, GripController, GripDecision, GripLimits};
pub use force_sense::ForceSense;
pub use guard::Guard;
pub use margin::{Margin, MarginSettings};
pub use on_slip::{OnSlip, OnSlipSettings};

use crate::setting::SettingError;
use serde::{Deserialize, Serialize};

/// A control law and its settings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Law {
    /// [`Constant`]: always the starting force.
    Constant,
    /// [`OnSlip`], the paper's: a force step at each incipient slip.
    OnSlip(OnSlipSettings),
    /// [`Margin`], ours: holds a slip margin.
    Margin(MarginSettings),
}

impl Law {
    /// The controller inside its guard. Fails for invalid limits or settings.
    pub fn controller(&self, limits: &GripLimits) -> Result<Guard, SettingError> {
        limits.check()?;
        let inner: Box<dyn GripController + Send> = match *self {
            Law::Constant => Box::new(Constant::new(limits)),
            Law::OnSlip(settings) => Box::new(OnSlip::new(settings, limits)?),
            Law::Margin(settings) => Box::new(Margin::new(settings, limits)?),
        };
        Ok(Guard::new(inner, *limits))
    }

    /// Its name.
    pub const fn name(&self) -> &'static str {
        match self {
            Law::Constant => "constant",
            Law::OnSlip(_) => "on_slip",
            Law::Margin(_) => "margin",
        }
    }
}
