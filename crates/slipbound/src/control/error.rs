//! Errors that end a control loop before its task has ended.

use super::fault::Fault;
use crate::image::ImageError;
use crate::monitor::RestError;
use crate::port::SourceError;
use crate::setting::SettingError;
use std::fmt;

/// Why the loop ended early. In all cases the wrist was paused first, and the gripper keeps its force or raises it to
/// the blind force of [`GripLimits`](crate::grip::GripLimits), never lowers it.
#[derive(Debug)]
#[non_exhaustive]
pub enum ControlError {
    /// A finger's source of frames failed.
    Source {
        /// The finger.
        finger: String,
        /// Why.
        source: SourceError,
    },
    /// The buffer of a frame does not match its stated size.
    Frame {
        /// The finger.
        finger: String,
        /// Expected and got.
        source: ImageError,
    },
    /// A finger's settings or facts cannot be used with its frames.
    Setting {
        /// The finger.
        finger: String,
        /// Key, expected, got.
        source: SettingError,
    },
    /// No rest frame could be made from the first frames of a finger.
    Rest {
        /// The finger.
        finger: String,
        /// Why.
        source: RestError,
    },
    /// Something touches a finger that was required to start unloaded.
    Touched {
        /// The finger.
        finger: String,
    },
    /// The thread that runs a finger's monitor has panicked.
    Monitor {
        /// The finger.
        finger: String,
    },
    /// The gripper held something, since before the loop or since somebody else grasped it, and did not tell with which
    /// force. Nothing was commanded.
    HeldForceUnknown,
    /// A fault of gripper or wrist lasted longer than the loop waits.
    Fault {
        /// The fault.
        fault: Fault,
        /// How long the loop waited for it to clear, ns; 0 when the source, or the time of the task, ended
        /// meanwhile.
        waited_ns: u64,
    },
    /// The driver of the loop was asked to stop.
    Interrupted,
}

impl fmt::Display for ControlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ControlError::Source { finger, source } => write!(f, "{finger}: {source}"),
            ControlError::Frame { finger, source } => write!(f, "{finger}: {source}"),
            ControlError::Setting { finger, source } => write!(f, "{finger}: {source}"),
            ControlError::Rest { finger, source } => write!(f, "{finger}: no rest frame: {source}"),
            ControlError::Touched { finger } => {
                write!(
                    f,
                    "{finger}: expected a finger that nothing touches, got one in contact: free it and start again"
                )
            }
            ControlError::Monitor { finger } => write!(f, "{finger}: the thread of its monitor has broken down"),
            ControlError::HeldForceUnknown => f.write_str(
                "gripper: expected the force with which it holds something already, got none: any command could lower it; \
                 release the object first",
            ),
            ControlError::Fault { fault, waited_ns: 0 } => write!(f, "{fault}"),
            ControlError::Fault { fault, waited_ns } => write!(f, "{fault}; waited {} s", waited_ns / 1_000_000_000),
            ControlError::Interrupted => f.write_str(
                "interrupted; the wrist was paused, the gripper keeps its force, or holds with grip.blind_force_n if that is \
                 higher",
            ),
        }
    }
}

impl std::error::Error for ControlError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            ControlError::Source { source, .. } => source.source(),
            ControlError::Frame { source, .. } => source.source(),
            ControlError::Setting { source, .. } => source.source(),
            ControlError::Rest { source, .. } => source.source(),
            ControlError::Touched { .. }
            | ControlError::Monitor { .. }
            | ControlError::HeldForceUnknown
            | ControlError::Fault { .. }
            | ControlError::Interrupted => None,
        }
    }
}
