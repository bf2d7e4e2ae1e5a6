//! A link that is kept: bytes carried between it and a [`Talker`], made anew when it is lost.

use super::{Dial, Link, Talker};
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

/// Time between two attempts to make a lost link anew, ns.
const DIAL_AGAIN_NS: u64 = 250_000_000;

/// Most reads of one call; with 4 kB each that is more than any gripper says in a second.
const MOST_READS: usize = 16;

type Dialled = io::Result<Box<dyn Link>>;

/// The link and what makes it anew.
pub struct Wire {
    dial: Option<Arc<dyn Dial>>,
    link: Option<Box<dyn Link>>,
    dialling: Option<Receiver<Dialled>>,
    dial_from_ns: u64,
    inbox: Vec<u8>,
}

impl Wire {
    /// Takes over a link; with `dial` it is made anew when it is lost.
    pub fn new(link: Option<Box<dyn Link>>, dial: Option<Arc<dyn Dial>>) -> Self {
        Wire { dial, link, dialling: None, dial_from_ns: 0, inbox: Vec::with_capacity(8192) }
    }

    /// Whether the link is there.
    pub fn is_linked(&self) -> bool {
        self.link.is_some()
    }

    /// Whether a lost link is made anew.
    pub fn is_kept(&self) -> bool {
        self.dial.is_some()
    }

    /// Carries what has come, lets time pass, carries what is to go. Does not wait.
    pub fn pump(&mut self, now_ns: u64, talker: &mut dyn Talker) {
        self.redial(now_ns, talker);
        self.read(now_ns, talker);
        talker.tick(now_ns);
        self.send(now_ns, talker);
    }

    fn read(&mut self, now_ns: u64, talker: &mut dyn Talker) {
        for _ in 0..MOST_READS {
            let Some(link) = &mut self.link else { return };
            self.inbox.clear();
            match link.read(&mut self.inbox) {
                Ok(0) => return,
                Ok(_) => talker.receive(now_ns, &self.inbox),
                Err(e) => return self.lose(now_ns, talker, &e.to_string()),
            }
        }
    }

    /// Carries what is to go. Does not wait.
    pub fn send(&mut self, now_ns: u64, talker: &mut dyn Talker) {
        let Some(link) = &mut self.link else { return };
        let outgoing = talker.outgoing();
        if outgoing.is_empty() {
            return;
        }
        match link.write(outgoing) {
            Ok(count) => drop(outgoing.drain(..count)),
            Err(e) => self.lose(now_ns, talker, &e.to_string()),
        }
    }

    /// Gives the link up.
    pub fn lose(&mut self, now_ns: u64, talker: &mut dyn Talker, why: &str) {
        self.link = None;
        self.dial_from_ns = now_ns;
        talker.unlinked(now_ns, why);
    }

    /// Makes a lost link anew, on a thread of its own.
    fn redial(&mut self, now_ns: u64, talker: &mut dyn Talker) {
        let (None, Some(dial)) = (&self.link, &self.dial) else { return };
        match self.dialling.as_ref().map(Receiver::try_recv) {
            Some(Ok(Ok(link))) => {
                (self.link, self.dialling) = (Some(link), None);
                talker.linked(now_ns);
            }
            Some(Ok(Err(_)) | Err(TryRecvError::Disconnected)) => {
                (self.dialling, self.dial_from_ns) = (None, now_ns + DIAL_AGAIN_NS);
            }
            Some(Err(TryRecvError::Empty)) => {}
            None if now_ns >= self.dial_from_ns => {
                let (dial, (tell, told)) = (dial.clone(), channel());
                thread::spawn(move || {
                    let _ = tell.send(dial.dial()); // nobody waits for it any more: then the link is dropped
                });
                self.dialling = Some(told);
            }
            None => {}
        }
    }
}
