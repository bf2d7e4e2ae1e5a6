//! A wrist that is a separate node, by a pair of topics.
//!
//! ```text
//!   control loop --command--> BASE/command  slipbound_msgs/WristCommand   reliable, the last one
//!                <--poll----- BASE/state    slipbound_msgs/WristState     10 Hz or more; 0.3 s of silence is a fault
//! ```
//!
//! A state whose angle or lowering is no number says nothing. After a silence the first position has to continue the
//! last one: a node that was restarted counts from a new zero.
//!
//! A motion lasts `time_to_live_ns`, 200 ms at most: the node at the other end must pause by itself when no command has
//! arrived for that long, because this end may be gone.

use crate::error::Error;
use crate::heartbeat::Heartbeat;
use crate::msg::{Header, WristCommand as WristCommandMessage, WristState as WristStateMessage};
use crate::ros::{Inbox, LAST_RELIABLE, Ros, SENSOR_DATA, stamp};
use ros2_client::Publisher;
use slipbound::port::{
    LONGEST_TIME_TO_LIVE_NS, Wrist, WristCommand, WristError, WristErrorKind, WristMotion, WristState,
};
use slipbound_rig::link::now_ns;
use slipbound_rig::wrist::ZeroCheck;

/// The wrist at a pair of topics.
pub struct TopicWrist {
    topic: String,
    commands: Publisher<WristCommandMessage>,
    states: Inbox<WristStateMessage>,
    heartbeat: Heartbeat,
    state: Option<WristState>,
    zero: ZeroCheck,
}

impl TopicWrist {
    /// The wrist whose topics are `base/command` and `base/state`. Waits for nothing.
    pub fn new(ros: &mut Ros, base: &str) -> Result<Self, Error> {
        let topic = format!("{base}/state");
        Ok(TopicWrist {
            commands: ros.publisher(&format!("{base}/command"), &LAST_RELIABLE)?,
            states: ros.inbox(&topic, &SENSOR_DATA)?,
            heartbeat: Heartbeat::new(&format!("angle_rad and lowered_mm of {topic}")),
            state: None,
            zero: ZeroCheck::default(),
            topic,
        })
    }
}

/// The command as a message; an invalid number is rejected.
fn message(command: WristCommand) -> Result<WristCommandMessage, WristError> {
    let refuse = |key: &str, expected: &str, got: f64| {
        Err(WristError::new(WristErrorKind::Refused, format!("{key}: expected {expected}, got {got}")))
    };
    let mut message = WristCommandMessage {
        header: Header { stamp: stamp(), frame_id: String::new() },
        motion: "pause".into(),
        rate_rad_per_s: f64::NAN,
        most_rad: f64::NAN,
        rate_mm_per_s: f64::NAN,
        most_mm: f64::NAN,
        time_to_live_ns: command.time_to_live_ns,
    };
    if command.time_to_live_ns > LONGEST_TIME_TO_LIVE_NS {
        return refuse("time_to_live_ns", "at most 200 ms", command.time_to_live_ns as f64);
    }
    let (rate, most) = match command.motion {
        WristMotion::Turn { rate_rad_per_s, most_rad } => {
            (message.rate_rad_per_s, message.most_rad) = (rate_rad_per_s, most_rad);
            message.motion = "turn".into();
            (("rate_rad_per_s", rate_rad_per_s), ("most_rad", most_rad))
        }
        WristMotion::Lower { rate_mm_per_s, most_mm } => {
            (message.rate_mm_per_s, message.most_mm) = (rate_mm_per_s, most_mm);
            message.motion = "lower".into();
            (("rate_mm_per_s", rate_mm_per_s), ("most_mm", most_mm))
        }
        WristMotion::Pause => return Ok(message),
    };
    if !rate.1.is_finite() {
        return refuse(rate.0, "a number", rate.1);
    }
    if !(most.1.is_finite() && most.1 >= 0.0) {
        return refuse(most.0, "a number not below 0", most.1);
    }
    Ok(message)
}

impl Wrist for TopicWrist {
    fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
        let message = message(command)?;
        self.poll_io();
        let lost = |why: String| WristError::new(WristErrorKind::Link, why);
        // A pause is sent even if nobody seems to listen: the link may fail in one direction only.
        let is_linked = self.heartbeat.check(now_ns()).map_err(lost);
        if command.motion != WristMotion::Pause {
            is_linked?;
            self.zero.commanded(now_ns(), command.motion);
            return self.commands.publish(message).map_err(|e| lost(e.to_string()));
        }
        self.commands.publish(message).map_err(|e| lost(e.to_string()))?;
        is_linked
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        self.poll_io();
        let lost = |why: String| WristError::new(WristErrorKind::Link, why);
        self.heartbeat.check(now_ns()).map_err(lost)?;
        let state = self.state.ok_or_else(|| lost("expected a state, got none so far".into()))?;
        self.zero.check(&self.topic, &state)?;
        Ok(state)
    }

    fn poll_io(&mut self) {
        let Some(WristStateMessage { angle_rad, lowered_mm, moving, .. }) = self.states.newest() else { return };
        if !(angle_rad.is_finite() && lowered_mm.is_finite()) {
            return;
        }
        let now_ns = now_ns();
        if self.heartbeat.is_silent(now_ns) {
            self.zero.interrupted(self.state);
        }
        self.zero.reported(now_ns);
        self.heartbeat.received(now_ns);
        self.state = Some(WristState { time_ns: now_ns, angle_rad, lowered_mm, moving });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_keep_their_numbers_and_what_cannot_be_is_refused() {
        let turn = WristMotion::Turn { rate_rad_per_s: 0.5, most_rad: 1.0 };
        let sent = message(WristCommand::new(turn)).expect("a motion");
        assert_eq!((sent.motion.as_str(), sent.rate_rad_per_s, sent.most_rad), ("turn", 0.5, 1.0));
        assert!(sent.rate_mm_per_s.is_nan() && sent.most_mm.is_nan());
        assert_eq!(sent.time_to_live_ns, 200_000_000);
        let lower = |rate_mm_per_s, most_mm| WristMotion::Lower { rate_mm_per_s, most_mm };
        for (command, part) in [
            (WristCommand::new(lower(f64::NAN, 1.0)), "rate_mm_per_s: expected a number, got NaN"),
            (WristCommand::new(lower(1.0, -1.0)), "most_mm: expected a number not below 0, got -1"),
            (WristCommand { motion: WristMotion::Pause, time_to_live_ns: 200_000_001 }, "at most 200 ms"),
        ] {
            let refused = message(command).expect_err("refused");
            assert!(refused.to_string().contains(part), "{refused}");
        }
    }
}
