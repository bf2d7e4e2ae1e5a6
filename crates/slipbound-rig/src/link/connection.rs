//! A link that reconnects: moves bytes between it and an [`Endpoint`], and connects again when it is lost.

use super::clock;
use super::endpoint::Endpoint;
use super::stream::{Connector, Link};
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;
use std::time::Duration;

/// Time between two attempts to connect again, ns.
const RECONNECT_NS: u64 = 250_000_000;

/// A link that ended sooner, ns, was accepted and closed: it is tried again like one that was refused.
const SHORT_LIVED_NS: u64 = 1_000_000_000;

/// Number of such links in a row after which a likely cause is told.
const SHORT_LIVED_COUNT: u32 = 3;

/// Most reads of one call; with 4 kB each that is more than any gripper sends in a second.
const MOST_READS: usize = 16;

/// Time between two attempts to send what is left, in [`Connection::flush`].
const FLUSH_PAUSE: Duration = Duration::from_millis(1);

type Attempt = io::Result<Box<dyn Link>>;

/// A link and what connects it again.
pub struct Connection {
    connector: Option<Arc<dyn Connector>>,
    link: Option<Box<dyn Link>>,
    attempt: Option<Receiver<Attempt>>,
    attempt_from_ns: u64,
    /// When the link was connected again, ns.
    linked_ns: Option<u64>,
    /// How many links in a row were short-lived.
    short_lived_count: u32,
    inbox: Vec<u8>,
}

impl Connection {
    /// Takes a link; with a connector it is reconnected when it is lost.
    pub fn new(link: Option<Box<dyn Link>>, connector: Option<Arc<dyn Connector>>) -> Self {
        Connection {
            connector,
            link,
            attempt: None,
            attempt_from_ns: 0,
            linked_ns: None,
            short_lived_count: 0,
            inbox: Vec::with_capacity(8192),
        }
    }

    /// Whether the link is up.
    pub fn is_up(&self) -> bool {
        self.link.is_some()
    }

    /// Whether a lost link is reconnected.
    pub fn reconnects(&self) -> bool {
        self.connector.is_some()
    }

    /// Receives, advances the time, sends. Does not wait.
    pub fn poll_io(&mut self, now_ns: u64, endpoint: &mut dyn Endpoint) {
        self.reconnect(now_ns, endpoint);
        self.read(now_ns, endpoint);
        endpoint.tick(now_ns);
        self.send(now_ns, endpoint);
    }

    fn read(&mut self, now_ns: u64, endpoint: &mut dyn Endpoint) {
        for _ in 0..MOST_READS {
            let Some(link) = &mut self.link else { return };
            self.inbox.clear();
            match link.read(&mut self.inbox) {
                Ok(0) => return,
                Ok(_) => endpoint.receive(now_ns, &self.inbox),
                Err(e) => return self.give_up(now_ns, endpoint, &e.to_string()),
            }
        }
    }

    /// Sends what is waiting. Does not wait.
    pub fn send(&mut self, now_ns: u64, endpoint: &mut dyn Endpoint) {
        let Some(link) = &mut self.link else { return };
        let outgoing = endpoint.outgoing();
        if outgoing.is_empty() {
            return;
        }
        match link.write(outgoing) {
            Ok(count) => drop(outgoing.drain(..count)),
            Err(e) => self.give_up(now_ns, endpoint, &e.to_string()),
        }
    }

    /// Sends all that is waiting, for at most this time. It is the only call here that waits: a device that is being
    /// closed sends its farewell with it.
    pub fn flush(&mut self, endpoint: &mut dyn Endpoint, longest_ns: u64) {
        let from_ns = clock::now_ns();
        while self.is_up() && !endpoint.outgoing().is_empty() && clock::now_ns() - from_ns < longest_ns {
            self.send(clock::now_ns(), endpoint);
            thread::sleep(FLUSH_PAUSE);
        }
    }

    /// Closes the link; with a connector it is reconnected.
    pub fn give_up(&mut self, now_ns: u64, endpoint: &mut dyn Endpoint, why: &str) {
        self.link = None;
        let is_short_lived =
            self.linked_ns.take().is_some_and(|from_ns| now_ns.saturating_sub(from_ns) < SHORT_LIVED_NS);
        self.short_lived_count = if is_short_lived { self.short_lived_count + 1 } else { 0 };
        self.attempt_from_ns = now_ns + if is_short_lived { RECONNECT_NS } else { 0 };
        if self.short_lived_count < SHORT_LIVED_COUNT {
            endpoint.unlinked(now_ns, why);
        } else {
            endpoint.unlinked(now_ns, &format!("{why}, as soon as it was made: another program may be connected"));
        }
    }

    /// Connects a lost link again, on a thread of its own.
    fn reconnect(&mut self, now_ns: u64, endpoint: &mut dyn Endpoint) {
        let (None, Some(connector)) = (&self.link, &self.connector) else { return };
        match self.attempt.as_ref().map(Receiver::try_recv) {
            Some(Ok(Ok(link))) => {
                (self.link, self.attempt, self.linked_ns) = (Some(link), None, Some(now_ns));
                endpoint.linked(now_ns);
            }
            Some(Ok(Err(_)) | Err(TryRecvError::Disconnected)) => {
                (self.attempt, self.attempt_from_ns) = (None, now_ns + RECONNECT_NS);
            }
            Some(Err(TryRecvError::Empty)) => {}
            None if now_ns >= self.attempt_from_ns => {
                let (connector, (sender, receiver)) = (connector.clone(), channel());
                thread::spawn(move || {
                    let _ = sender.send(connector.connect()); // nobody waits for it any more: the link is dropped
                });
                self.attempt = Some(receiver);
            }
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// A connector that always fails; counts its attempts.
    #[derive(Default)]
    struct Nobody {
        tries_count: AtomicU32,
    }

    impl Connector for Nobody {
        fn connect(&self) -> Attempt {
            self.tries_count.fetch_add(1, Ordering::SeqCst);
            Err(io::ErrorKind::ConnectionRefused.into())
        }
    }

    /// A connector whose links are closed by the other side at once; counts them.
    #[derive(Default)]
    struct Busy {
        links_count: AtomicU32,
    }

    impl Connector for Busy {
        fn connect(&self) -> Attempt {
            self.links_count.fetch_add(1, Ordering::SeqCst);
            Ok(Box::new(Closed))
        }
    }

    struct Closed;

    impl Link for Closed {
        fn read(&mut self, _: &mut Vec<u8>) -> io::Result<usize> {
            Err(io::ErrorKind::UnexpectedEof.into())
        }

        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Ok(0)
        }
    }

    #[derive(Default)]
    struct Silent {
        outgoing: Vec<u8>,
        whys: Vec<String>,
    }

    impl Endpoint for Silent {
        fn linked(&mut self, _now_ns: u64) {}
        fn unlinked(&mut self, _now_ns: u64, why: &str) {
            self.whys.push(why.into());
        }
        fn receive(&mut self, _now_ns: u64, _bytes: &[u8]) {}
        fn tick(&mut self, _now_ns: u64) {}
        fn outgoing(&mut self) -> &mut Vec<u8> {
            &mut self.outgoing
        }
    }

    #[test]
    fn where_nobody_answers_it_is_tried_again_after_a_pause() {
        let nobody = Arc::new(Nobody::default());
        let (mut connection, mut endpoint) = (Connection::new(None, Some(nobody.clone())), Silent::default());
        let tries_count = || nobody.tries_count.load(Ordering::SeqCst);
        // The attempt runs on a thread of its own: the test's clock stands still until it has failed.
        let mut poll = |now_ns: u64, until: &dyn Fn(&Connection) -> bool| {
            for _ in 0..1000 {
                connection.poll_io(now_ns, &mut endpoint);
                if until(&connection) {
                    break;
                }
                thread::sleep(Duration::from_millis(1));
            }
        };
        let has_failed = |connection: &Connection| connection.attempt.is_none() && connection.attempt_from_ns > 0;
        poll(1_000_000_000, &has_failed);
        assert_eq!(tries_count(), 1);
        for _ in 0..5 {
            poll(1_000_000_000 + RECONNECT_NS - 1, &|_| true);
        }
        thread::sleep(Duration::from_millis(20));
        assert_eq!(tries_count(), 1, "tried again before the pause was over");
        poll(1_000_000_000 + RECONNECT_NS, &|_| tries_count() == 2);
        assert_eq!(tries_count(), 2);
    }

    #[test]
    fn where_links_are_accepted_and_closed_it_is_tried_again_after_a_pause_and_the_likely_cause_is_told() {
        let busy = Arc::new(Busy::default());
        let (mut connection, mut endpoint) =
            (Connection::new(Some(Box::new(Closed)), Some(busy.clone())), Silent::default());
        for ms in (0..1000u64).step_by(10) {
            // The attempt runs on a thread of its own: the test's clock stands still meanwhile.
            for _ in 0..1000 {
                connection.poll_io(ms * 1_000_000, &mut endpoint);
                if connection.attempt.is_none() {
                    break;
                }
                thread::sleep(Duration::from_millis(1));
            }
        }
        assert_eq!(busy.links_count.load(Ordering::SeqCst), 4);
        let told = endpoint.whys.iter().map(|why| why.contains("another program may be connected")).collect::<Vec<_>>();
        assert_eq!(told, [false, false, false, true, true], "{:?}", endpoint.whys);
    }
}
