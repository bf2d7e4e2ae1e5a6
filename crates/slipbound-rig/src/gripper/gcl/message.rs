//! What is sent to a WSG-50 at its text interface.

use crate::gripper::goal::Goal;

/// Questions, asked in turn.
pub(super) const QUESTIONS: [&str; 3] = ["POS", "FORCE", "GRIPSTATE"];

/// A message to the gripper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Message {
    /// One of [`QUESTIONS`].
    Question(&'static str),
    /// N per finger.
    Grip { force_n: f64 },
    /// A command without a force, by its name.
    Command(&'static str),
}

impl Message {
    pub fn name(self) -> &'static str {
        match self {
            Message::Question(name) | Message::Command(name) => name,
            Message::Grip { .. } => "GRIP",
        }
    }

    /// The goal of the jaws that it is for; `Keep` where it is for none.
    pub fn goal(self) -> Goal {
        match self {
            Message::Grip { force_n } => Goal::Hold { force_n },
            Message::Command("RELEASE" | "MOVE") => Goal::Open,
            Message::Question(_) | Message::Command(_) => Goal::Keep,
        }
    }

    /// The force to grip with, N per finger.
    pub fn force_n(self) -> Option<f64> {
        match self {
            Message::Grip { force_n } => Some(force_n),
            Message::Question(_) | Message::Command(_) => None,
        }
    }
}

/// Whether it may be the name of a value.
pub(super) fn is_name(text: &str) -> bool {
    !text.is_empty() && text.len() <= 16 && text.bytes().all(|byte| byte.is_ascii_uppercase())
}
