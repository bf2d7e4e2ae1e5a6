//! A driver and its emulator, joined by two byte queues instead of a socket. Time advances only when both are empty, so
//! every run is deterministic, and faster than real time.

use super::emulated::Emulator;
use crate::gripper::{self, Driver, Protocol, Request};
use crate::link::Endpoint;
use crate::wrist::{self, LineWrist};
use slipbound::plant::Plant;
use slipbound::port::{
    DriverEvent, GripCommand, Gripper, GripperError, GripperState, Wrist, WristCommand, WristError, WristState,
};

/// Time after which a lost link is reconnected, ns: that of a driver on a socket.
const RECONNECT_NS: u64 = 250_000_000;

/// Most exchanges at one time: an endless exchange of answers is interrupted.
const MOST_EXCHANGES: u32 = 10_000;

/// A driver joined to an emulator. Its owner passes the time to [`LockstepPair::step`]; as a [`Gripper`] or a [`Wrist`]
/// it is used like a device.
pub struct LockstepPair<D> {
    /// The driver.
    pub driver: D,
    /// The emulator.
    pub emulator: Emulator,
    /// Most bytes moved at once; a small number splits every message.
    pub most_bytes: usize,
    /// Whether bytes are delivered; otherwise they wait, as on a stalled link.
    pub is_delivering: bool,
    /// Whether a lost link is reconnected automatically.
    pub reconnects: bool,
    /// Everything the driver has sent, if that is to be kept.
    pub sent: Option<Vec<u8>>,
    now_ns: u64,
    is_connected: bool,
    lost_ns: u64,
}

impl<D: Endpoint> LockstepPair<D> {
    /// Joins the two at time 0, linked. A lost link is reconnected.
    pub fn new(driver: D, emulator: Emulator, plant: &mut dyn Plant) -> Self {
        let mut pair = LockstepPair::unlinked(driver, emulator, plant);
        pair.connect();
        pair
    }

    /// The two at time 0, not yet linked.
    pub fn unlinked(driver: D, emulator: Emulator, plant: &mut dyn Plant) -> Self {
        let (most_bytes, is_delivering, reconnects) = (usize::MAX, true, true);
        let (sent, now_ns, is_connected, lost_ns) = (None, 0, false, 0);
        let mut pair = LockstepPair {
            driver,
            emulator,
            most_bytes,
            is_delivering,
            reconnects,
            sent,
            now_ns,
            is_connected,
            lost_ns,
        };
        pair.emulator.tick(0, plant);
        pair
    }

    /// Time of both, ns.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Whether they are linked.
    pub fn is_connected(&self) -> bool {
        self.is_connected
    }

    /// Links them.
    pub fn connect(&mut self) {
        self.is_connected = true;
        self.emulator.connected(self.now_ns);
        self.driver.linked(self.now_ns);
        self.exchange();
    }

    /// Cuts the link; both sides see it.
    pub fn cut(&mut self, why: &str) {
        if self.is_connected {
            (self.is_connected, self.lost_ns) = (false, self.now_ns);
            self.emulator.disconnected(self.now_ns);
            self.driver.unlinked(self.now_ns, why);
        }
    }

    /// Moves bytes until neither side has any to send. False if that does not happen.
    pub fn exchange(&mut self) -> bool {
        for _ in 0..MOST_EXCHANGES {
            if !self.is_connected || !self.is_delivering {
                return true;
            }
            let ours = first(self.driver.outgoing(), self.most_bytes);
            let theirs = first(self.emulator.outgoing(), self.most_bytes);
            if ours.is_empty() && theirs.is_empty() {
                return true;
            }
            if let Some(sent) = &mut self.sent {
                sent.extend(&ours);
            }
            self.emulator.receive(self.now_ns, &ours);
            self.driver.receive(self.now_ns, &theirs);
        }
        false
    }

    /// Advances the time of both sides to `now_ns`. The plant is advanced by its owner, because several emulators may
    /// act on it.
    pub fn step(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        self.exchange();
        self.now_ns = now_ns;
        self.emulator.tick(now_ns, plant);
        if self.emulator.take_hang_up() {
            self.cut("closed by the other side");
        }
        if self.reconnects && !self.is_connected && now_ns >= self.lost_ns + RECONNECT_NS {
            self.connect();
        }
        self.driver.tick(now_ns);
        self.exchange();
    }
}

impl<P: Protocol> LockstepPair<Driver<P>> {
    /// Passes a request to the driver. An error means that it was not accepted.
    pub fn request(&mut self, request: Request) -> Result<(), gripper::Error> {
        let taken = self.driver.request(self.now_ns, request);
        self.exchange();
        taken
    }

    /// The newest state, or what is wrong. A silent link is closed, after the protocol's farewell.
    pub fn state(&mut self) -> Result<GripperState, gripper::Error> {
        self.exchange();
        let state = self.driver.state(self.now_ns);
        if matches!(state, Err(gripper::Error::Silent { .. } | gripper::Error::Unread { .. })) && self.reconnects {
            let _ = self.request(Request::Leave); // only its bytes matter: no answer will be read
            self.cut("nothing came through it");
        }
        state
    }
}

impl<P: Protocol> Gripper for LockstepPair<Driver<P>> {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        Ok(self.request(Request::Grip(command))?)
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        Ok(self.state()?)
    }

    fn poll_io(&mut self) {
        self.exchange();
    }

    fn is_busy(&self) -> bool {
        self.driver.is_busy()
    }

    fn next_event(&mut self) -> Option<DriverEvent> {
        self.driver.next_event()
    }
}

impl Wrist for LockstepPair<LineWrist> {
    fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
        let taken = self.driver.command(self.now_ns, command);
        self.exchange();
        Ok(taken?)
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        self.exchange();
        let state = self.driver.report(self.now_ns);
        if matches!(state, Err(wrist::Error::Silent { .. })) && self.reconnects {
            self.cut("no WRIST line came through it");
        }
        Ok(state?)
    }

    fn poll_io(&mut self) {
        self.exchange();
    }
}

/// A view of a plant for an emulator that only moves the wrist: nothing is between its jaws, and its force is ignored.
pub struct OnlyMoved<'a>(pub &'a mut dyn Plant);

impl Plant for OnlyMoved<'_> {
    fn width_mm(&self) -> Option<f64> {
        None
    }

    fn press(&mut self, _force_n: f64) {}

    fn place_wrist(&mut self, angle_rad: f64, lowered_mm: f64) {
        self.0.place_wrist(angle_rad, lowered_mm);
    }

    fn advance_to(&mut self, now_ns: u64) {
        self.0.advance_to(now_ns);
    }
}

fn first(queue: &mut Vec<u8>, most: usize) -> Vec<u8> {
    let count = queue.len().min(most);
    queue.drain(..count).collect()
}
