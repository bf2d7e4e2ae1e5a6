//! A gripper that is a separate node, by a pair of topics.
//!
//! ```text
//!   control loop --command--> BASE/command  slipbound_msgs/GripCommand   reliable, the last one
//!                <--poll----- BASE/state    slipbound_msgs/GripperState  10 Hz or more; 0.3 s of silence is a fault
//! ```
//!
//! Missing states mean a lost link: the loop pauses the wrist and commands nothing, so the gripper keeps its force. The
//! node at the other end must also keep it when it receives nothing.

use crate::error::Error;
use crate::heartbeat::Heartbeat;
use crate::msg::{GripCommand as GripCommandMessage, GripperState as GripperStateMessage, Header};
use crate::ros::{Inbox, LAST_RELIABLE, Ros, SENSOR_DATA, stamp};
use ros2_client::Publisher;
use slipbound::port::{DriverEvent, GripCommand, Gripper, GripperError, GripperErrorKind, GripperState, Jaws};
use slipbound_rig::link::now_ns;

/// The gripper at a pair of topics.
pub struct TopicGripper {
    commands: Publisher<GripCommandMessage>,
    states: Inbox<GripperStateMessage>,
    heartbeat: Heartbeat,
    topic: String,
    /// The newest state, or why it is none.
    state: Option<Result<GripperState, String>>,
}

impl TopicGripper {
    /// The gripper whose topics are `base/command` and `base/state`. Waits for nothing.
    pub fn new(ros: &mut Ros, base: &str) -> Result<Self, Error> {
        let topic = format!("{base}/state");
        Ok(TopicGripper {
            commands: ros.publisher(&format!("{base}/command"), &LAST_RELIABLE)?,
            states: ros.inbox(&topic, &SENSOR_DATA)?,
            heartbeat: Heartbeat::new(&topic),
            topic,
            state: None,
        })
    }
}

/// A force that a gripper can exert, N; invalid numbers are rejected.
pub(crate) fn checked_force_n(force_n: f64) -> Result<f64, GripperError> {
    match force_n.is_finite() && force_n >= 0.0 {
        true => Ok(force_n),
        false => {
            let text = format!("force_n: expected a number not below 0, got {force_n}");
            Err(GripperError::new(GripperErrorKind::Value, text))
        }
    }
}

impl Gripper for TopicGripper {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        let (jaws, force_n) = match command {
            GripCommand::Hold { force_n } => ("hold", checked_force_n(force_n)?),
            GripCommand::Release => ("release", f64::NAN),
        };
        self.poll_io();
        let lost = |why: String| GripperError::new(GripperErrorKind::Link, why);
        self.heartbeat.check(now_ns()).map_err(lost)?;
        let header = Header { stamp: stamp(), frame_id: String::new() };
        let message = GripCommandMessage { header, jaws: jaws.into(), force_n };
        self.commands.publish(message).map_err(|e| lost(e.to_string()))
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        self.poll_io();
        self.heartbeat.check(now_ns()).map_err(|why| GripperError::new(GripperErrorKind::Link, why))?;
        match &self.state {
            None => Err(GripperError::new(GripperErrorKind::NotReady, "expected a state, got none so far")),
            Some(state) => state.clone().map_err(|why| GripperError::new(GripperErrorKind::Link, why)),
        }
    }

    fn poll_io(&mut self) {
        if let Some(message) = self.states.newest() {
            let now_ns = now_ns();
            self.heartbeat.received(now_ns);
            self.state = Some(state(now_ns, &message).map_err(|why| format!("{}: {why}", self.topic)));
        }
    }

    fn next_event(&mut self) -> Option<DriverEvent> {
        self.heartbeat.next_event()
    }
}

/// The state in the loop's type; NaN and infinity count as unknown. The error quotes a word for the jaws that the message
/// does not have.
fn state(now_ns: u64, message: &GripperStateMessage) -> Result<GripperState, String> {
    let known = |value: f64| value.is_finite().then_some(value);
    let word = &message.jaws;
    let wrong = |_| format!("expected jaws to be one of {}, got `{word}`", Jaws::NAMES.join(", "));
    Ok(GripperState {
        time_ns: now_ns,
        force_n: known(message.force_n),
        force_error_n: known(message.force_error_n),
        target_n: known(message.target_n),
        opening_mm: known(message.opening_mm),
        jaws: word.parse().map_err(wrong)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jaws_are_those_of_the_message_and_another_word_is_quoted() {
        let state = |jaws: &str| {
            let header = Header { stamp: stamp(), frame_id: String::new() };
            let (force_n, force_error_n, target_n, opening_mm) = (12.0, f64::NAN, f64::INFINITY, 40.0);
            let jaws = jaws.into();
            state(7, &GripperStateMessage { header, force_n, force_error_n, target_n, opening_mm, jaws })
        };
        for name in Jaws::NAMES {
            let state = state(name).expect("of the message");
            assert_eq!((state.jaws.name(), state.time_ns), (name, 7));
            assert_eq!((state.force_n, state.force_error_n, state.target_n), (Some(12.0), None, None));
        }
        for word in ["grasped", "Holding", ""] {
            let told = state(word).expect_err("no such state");
            assert!(told.starts_with("expected jaws to be one of unknown, open, closing, "), "{told}");
            assert!(told.ends_with(&format!("got `{word}`")), "{told}");
        }
    }
}
