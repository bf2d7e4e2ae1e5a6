//! The ways in which a command can end.

use anyhow::anyhow;
use slipbound::port::SourceError;
use slipbound::task::{Ending, Missing};
use slipbound_lab::eval::FolderError;
use slipbound_rig::gripper::{self, SessionError};
use slipbound_rig::{container, run};
use std::error::Error;
use std::fmt::Display;

/// A command that finished.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Everything was done.
    Done,
    /// Everything was done that could be, but frames were torn or of another size, or something could not be written.
    DataLost,
}

/// A command that did not finish.
#[derive(Debug)]
pub enum Failure {
    /// A wrong argument.
    Arguments(anyhow::Error),
    /// Something failed on the way.
    Work(anyhow::Error),
    /// The reader of standard output closed it, which is not an error.
    ReaderLeft,
}

impl Failure {
    /// A failure caused by the arguments.
    pub fn arguments(e: impl Error + Send + Sync + 'static) -> Self {
        Failure::Arguments(e.into())
    }

    /// A failure on the way, with the action that failed.
    pub fn work(doing: impl Display, e: impl Error + Send + Sync + 'static) -> Self {
        Failure::Work(anyhow::Error::new(e).context(doing.to_string()))
    }

    /// A task that ended while it was still taking hold. `refused_lowering`: a lower force that the gripper refused.
    pub fn never_began(missing: Option<Missing>, refused_lowering: Option<&str>) -> Self {
        // Without a frame that can be judged the task never runs.
        let why = missing.map_or("no finger has shown a frame that can be judged", Missing::in_words);
        Failure::Work(match refused_lowering {
            Some(refused) => anyhow!("the work never began: {why}; {refused}"),
            None => anyhow!("the work never began: {why}"),
        })
    }

    /// A task that ended without what it was for. `refused_lowering`: a lower force that the gripper refused, so that
    /// the jaws may never have closed.
    pub fn ended(ending: Ending, refused_lowering: Option<&str>) -> Self {
        Failure::Work(match refused_lowering.filter(|_| ending == Ending::NothingHeld) {
            Some(refused) => anyhow!("{}; {refused}", ending.evidence()),
            None => anyhow!("{}", ending.evidence()),
        })
    }
}

/// What was said at the end of work that is kept elsewhere: a reader who has gone misses nothing of it.
pub fn unless_reader_left(said: Result<(), Failure>) -> Result<(), Failure> {
    match said {
        Err(Failure::ReaderLeft) => Ok(()),
        said => said,
    }
}

impl From<anyhow::Error> for Failure {
    fn from(e: anyhow::Error) -> Self {
        Failure::Work(e)
    }
}

/// A source that failed on the way.
impl From<SourceError> for Failure {
    fn from(e: SourceError) -> Self {
        Failure::Work(e.into())
    }
}

/// The folder of a run that cannot be written to; what it holds, or the name of a finger, was a wrong argument.
impl From<run::Error> for Failure {
    fn from(e: run::Error) -> Self {
        match e {
            run::Error::Write { .. } | run::Error::Encode { .. } => Failure::Work(e.into()),
            other => Failure::arguments(other),
        }
    }
}

/// A recording that cannot be written.
impl From<container::Error> for Failure {
    fn from(e: container::Error) -> Self {
        Failure::Work(e.into())
    }
}

/// The folder of a sweep that cannot be written to; one that cannot be read, or holds something else, was a wrong argument.
impl From<FolderError> for Failure {
    fn from(e: FolderError) -> Self {
        match e {
            FolderError::Write { .. } => Failure::Work(e.into()),
            other => Failure::arguments(other),
        }
    }
}

/// A gripper that could not be opened: a wrong argument, or no answer.
impl From<gripper::Error> for Failure {
    fn from(e: gripper::Error) -> Self {
        match e {
            gripper::Error::Address { .. } | gripper::Error::Config(_) => Failure::arguments(e),
            other => Failure::Work(other.into()),
        }
    }
}

/// A session with a gripper that failed; a force that is not a number was a wrong argument.
impl From<SessionError> for Failure {
    fn from(e: SessionError) -> Self {
        match e {
            SessionError::Gripper(gripper::Error::Force { .. }) => Failure::arguments(e),
            other => Failure::Work(other.into()),
        }
    }
}
