//! Whether the node at the other end is still publishing.

use slipbound::port::DriverEvent;

/// Longest time without a state, ns: beyond it the link is lost.
pub const SILENCE_NS: u64 = 300_000_000;

/// Time of the last message of a node.
#[derive(Debug)]
pub struct Heartbeat {
    topic: String,
    last_ns: Option<u64>,
    is_linked: bool,
    events: Vec<DriverEvent>,
}

impl Heartbeat {
    /// Nothing received on this topic yet.
    pub fn new(topic: &str) -> Self {
        Heartbeat { topic: topic.into(), last_ns: None, is_linked: false, events: Vec::new() }
    }

    /// A state was received.
    pub fn received(&mut self, now_ns: u64) {
        self.last_ns = Some(now_ns);
        if !std::mem::replace(&mut self.is_linked, true) {
            self.events.push(DriverEvent::Linked);
        }
    }

    /// Whether nothing was received for too long.
    pub fn is_silent(&self, now_ns: u64) -> bool {
        self.last_ns.is_none_or(|last_ns| now_ns.saturating_sub(last_ns) > SILENCE_NS)
    }

    /// The error of the link, if there is one.
    pub fn check(&mut self, now_ns: u64) -> Result<(), String> {
        let expected = format!("{}: expected a state every {} ms, got", self.topic, SILENCE_NS / 1_000_000);
        let why = match self.last_ns {
            None => format!("{expected} none so far"),
            Some(last_ns) => match now_ns.saturating_sub(last_ns) {
                silent_ns if silent_ns <= SILENCE_NS => return Ok(()),
                silent_ns => format!("{expected} none for {} ms", silent_ns / 1_000_000),
            },
        };
        if std::mem::take(&mut self.is_linked) {
            self.events.push(DriverEvent::Unlinked { why: why.clone() });
        }
        Err(why)
    }

    /// The next event, oldest first.
    pub fn next_event(&mut self) -> Option<DriverEvent> {
        (!self.events.is_empty()).then(|| self.events.remove(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_is_told_once_and_so_is_the_return() {
        let mut heartbeat = Heartbeat::new("/gripper/state");
        assert!(heartbeat.check(0).expect_err("nothing yet").contains("/gripper/state: expected a state every 300 ms"));
        heartbeat.received(1_000_000_000);
        assert_eq!((heartbeat.check(1_300_000_000), heartbeat.next_event()), (Ok(()), Some(DriverEvent::Linked)));
        assert!(heartbeat.check(1_400_000_000).expect_err("silent").contains("none for 400 ms"));
        assert!(heartbeat.check(1_500_000_000).is_err());
        assert!(matches!(heartbeat.next_event(), Some(DriverEvent::Unlinked { .. })));
        assert_eq!(heartbeat.next_event(), None);
        heartbeat.received(1_600_000_000);
        assert_eq!((heartbeat.check(1_600_000_000), heartbeat.next_event()), (Ok(()), Some(DriverEvent::Linked)));
    }
}
