//! The states that a WSG-50 sends by itself once they are subscribed to.

use super::frame::{self, number};
use super::words::{flag, grasp, id, status};
use crate::gripper::driver_state::DriverState;
use slipbound::port::Jaws;

/// Time after which a missing state is requested again, ns.
const ASK_AGAIN_NS: u64 = 300_000_000;

/// Bytes waiting to be sent beyond which nothing more is requested.
const MOST_UNSENT_BYTES: usize = 1024;

/// The states subscribed to.
const STATES: [u8; 4] = [id::SYSTEM_STATE, id::GRASP_STATE, id::OPENING, id::FORCE];

/// What has been received since the link was made.
#[derive(Debug, Default)]
pub(super) struct Telemetry {
    /// The bits of its system state.
    pub system: Option<u32>,
    /// What it does with a part, one of [`grasp`].
    pub grasp: Option<u8>,
    /// Whether that is from before the last stop or acknowledgement.
    pub is_grasp_old: bool,
    /// The force limit it has, in its own newtons.
    pub limit_own_n: Option<f64>,
    /// When each of [`STATES`] was last received or requested.
    asked_ns: [Option<u64>; STATES.len()],
    /// When each of them was last received, or the link made, ns.
    told_ns: [u64; STATES.len()],
    limit_asked_ns: Option<u64>,
    /// The opening is that of an earlier link: the jaws may have been opened since.
    pub is_opening_old: bool,
}

impl Telemetry {
    /// On a link made at this time; whether an opening is known from an earlier one.
    pub fn new(now_ns: u64, is_opening_old: bool) -> Self {
        Telemetry { told_ns: [now_ns; STATES.len()], is_opening_old, ..Telemetry::default() }
    }

    /// When a state was last received, or the link made, ns.
    fn told_ns(&self, id: u8) -> Option<u64> {
        STATES.into_iter().zip(self.told_ns).find(|(state, _)| *state == id).map(|(_, told_ns)| told_ns)
    }

    /// The same for the force.
    pub fn force_told_ns(&self) -> u64 {
        self.told_ns(id::FORCE).unwrap_or(0)
    }

    /// Since when a state has not been received, ns, if that is longer than the silence allowed and the answer to the
    /// request that follows it.
    fn untold_since_ns(&self, driver: &DriverState, id: u8) -> Option<u64> {
        let most_ns = (driver.config.silence_ms + driver.config.reply_ms) * 1_000_000;
        self.told_ns(id).filter(|told_ns| driver.now_ns().saturating_sub(*told_ns) > most_ns)
    }

    /// The same for what the jaws do.
    pub fn jaws_untold_since_ns(&self, driver: &DriverState) -> Option<u64> {
        let states = [id::SYSTEM_STATE, id::GRASP_STATE];
        states.into_iter().filter_map(|state| self.untold_since_ns(driver, state)).min()
    }

    /// Values that no longer come are not known.
    pub fn forget_untold(&mut self, driver: &mut DriverState) {
        if self.untold_since_ns(driver, id::OPENING).is_some() {
            (driver.gripper.opening_mm, self.is_opening_old) = (None, false);
        }
        if self.untold_since_ns(driver, id::FORCE).is_some() {
            driver.gripper.force_n = None;
        }
    }

    /// Subscribes to states that do not come, and asks for the limit while it is not known.
    pub fn ask(&mut self, driver: &mut DriverState) {
        if driver.outgoing.len() > MOST_UNSENT_BYTES {
            return; // the link is blocked; asking more often would not help
        }
        let now_ns = driver.now_ns();
        let is_due = |asked_ns: Option<u64>| asked_ns.is_none_or(|asked| now_ns.saturating_sub(asked) > ASK_AGAIN_NS);
        let [low, high] = (driver.config.update_ms as u16).to_le_bytes();
        for (id, asked_ns) in STATES.into_iter().zip(&mut self.asked_ns) {
            if is_due(*asked_ns) {
                *asked_ns = Some(now_ns);
                frame::write(&mut driver.outgoing, id, &[1, low, high]);
            }
        }
        if self.limit_own_n.is_none() && is_due(self.limit_asked_ns) {
            self.ask_limit(driver);
        }
    }

    /// Asks for the limit now.
    pub fn ask_limit(&mut self, driver: &mut DriverState) {
        self.limit_asked_ns = Some(driver.now_ns());
        frame::write(&mut driver.outgoing, id::GET_LIMIT, &[]);
    }

    /// Takes a message that is a state or the limit. False: it is an answer to a command.
    pub fn take(&mut self, driver: &mut DriverState, id: u8, code: u16, rest: &[u8]) -> bool {
        if id == id::GET_LIMIT {
            if let (status::OK, Some(own_n)) = (code, number(rest).map(f64::from).filter(|n| n.is_finite())) {
                self.set_limit(driver, own_n);
            }
            return true;
        }
        let Some(place) = STATES.iter().position(|state| *state == id) else { return false };
        (self.asked_ns[place], self.told_ns[place]) = (Some(driver.now_ns()), driver.now_ns());
        self.is_opening_old &= id != id::OPENING;
        // A state that it cannot tell is not known.
        self.take_state(driver, id, if code == status::OK { rest } else { &[] });
        true
    }

    fn take_state(&mut self, driver: &mut DriverState, id: u8, rest: &[u8]) {
        let value = || number(rest).map(f64::from);
        driver.gripper.time_ns = driver.now_ns();
        match id {
            id::SYSTEM_STATE => self.system = rest.first_chunk().map(|bits| u32::from_le_bytes(*bits)),
            id::GRASP_STATE => (self.grasp, self.is_grasp_old) = (rest.first().copied(), false),
            id::OPENING => driver.gripper.opening_mm = value().filter(|mm| (-10.0..=1000.0).contains(mm)),
            _ => driver.gripper.force_n = value().and_then(|own_n| driver.config.from_own_n(own_n)),
        }
        driver.gripper.jaws = self.jaws();
    }

    /// The gripper has this force limit now.
    pub fn set_limit(&mut self, driver: &mut DriverState, own_n: f64) {
        self.limit_own_n = Some(own_n);
        driver.settle_target(driver.config.from_own_n(own_n));
    }

    /// Whether everything that is needed to command it is known.
    pub fn is_complete(&self) -> bool {
        self.system.is_some() && self.grasp.is_some() && self.limit_own_n.is_some()
    }

    pub fn is_stopped(&self) -> bool {
        self.system.is_some_and(|bits| bits & flag::FAST_STOP != 0)
    }

    pub fn is_homed(&self) -> bool {
        self.system.is_some_and(|bits| bits & flag::REFERENCED != 0)
    }

    pub fn is_holding(&self) -> bool {
        self.grasp == Some(grasp::HOLDING)
    }

    /// The faults of the hardware in words; empty when there is none.
    pub fn faults(&self) -> String {
        flag::faults(self.system.unwrap_or(0))
    }

    fn jaws(&self) -> Jaws {
        if self.is_stopped() {
            return Jaws::Stopped;
        }
        if !self.is_homed() || self.is_opening_old {
            return Jaws::Unknown;
        }
        grasp::jaws(self.grasp)
    }
}
