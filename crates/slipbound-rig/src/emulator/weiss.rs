//! What a WSG-50 does, whichever interface commands it.

use super::fault::Fault;
use super::jaws::EmulatedJaws;
use crate::gripper::wsg50::words::{grasp, status};
use slipbound::plant::{JawSettings, Plant};

/// Settings of the gripper's web page. Unconfirmed: the numbers are not from a gripper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The jaws.
    pub jaws: JawSettings,
    /// Contact half of this before the part's width is a collision, mm.
    pub part_width_tolerance_mm: f64,
    /// How far the fingers go beyond the part's width to find it, mm.
    pub clamping_travel_mm: f64,
    /// Whether a connection that breaks without a farewell latches a fast stop.
    pub stops_on_disconnect: bool,
    /// Whether it knows where its jaws are.
    pub is_homed: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            jaws: JawSettings::default(),
            part_width_tolerance_mm: 10.0,
            clamping_travel_mm: 5.0,
            stops_on_disconnect: true,
            is_homed: true,
        }
    }
}

/// A motion. Openings in mm, speed in mm/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Task {
    /// To its end: the open one, or the closed one.
    Home {
        closes: bool,
    },
    /// `clamps`: an object in the way is pressed on with the force limit.
    Move {
        opening_mm: f64,
        speed: f64,
        clamps: bool,
    },
    /// Without a width: whatever stops the fingers is the part, even the other finger.
    Grasp {
        width_mm: Option<f64>,
        speed: f64,
    },
    Release {
        opening_mm: f64,
        speed: f64,
    },
}

/// How the last motion ended, until the next begins.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum End {
    #[default]
    Other,
    /// At its target.
    Reached,
    /// Something was in the way of closing fingers.
    Blocked,
    /// By a stop command.
    Stopped,
}

/// The gripper behind its interfaces.
#[derive(Debug)]
pub(crate) struct Weiss {
    pub settings: Settings,
    pub jaws: EmulatedJaws,
    pub limit_n: f64,
    /// mm/s2; nothing here depends on it.
    pub acceleration: f64,
    pub grasp: u8,
    pub running: Option<Task>,
    pub end: End,
    pub is_homed: bool,
    pub is_stopped: bool,
    pub is_farewell_said: bool,
    ended: Vec<(Task, u16)>,
    /// Whether it presses on an object that was in the way of a MOVE.
    is_clamping: bool,
    is_limit_fixed: bool,
    is_regrasp_allowed: bool,
}

impl Weiss {
    pub fn new(settings: Settings) -> Self {
        Weiss {
            jaws: EmulatedJaws::new(settings.jaws),
            limit_n: settings.jaws.most_n,
            acceleration: 1000.0,
            grasp: grasp::IDLE,
            running: None,
            end: End::Other,
            is_homed: settings.is_homed,
            is_stopped: false,
            is_farewell_said: false,
            ended: Vec::new(),
            is_clamping: false,
            is_limit_fixed: false,
            is_regrasp_allowed: false,
            settings,
        }
    }

    pub fn advance_to(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        self.jaws.advance_to(now_ns, plant);
        self.see();
    }

    pub fn connected(&mut self) {
        self.is_farewell_said = false;
    }

    /// The motions that have ended since the last call, with their status.
    pub fn take_ended(&mut self) -> Vec<(Task, u16)> {
        std::mem::take(&mut self.ended)
    }

    pub fn disconnected(&mut self) {
        if self.settings.stops_on_disconnect && !self.is_farewell_said {
            self.stop_fast();
        }
        self.ended.clear(); // there is no link to report them on
    }

    /// A farewell ends any motion.
    pub fn bid_farewell(&mut self) {
        self.is_farewell_said = true;
        if self.running.is_some() {
            self.abort();
        }
    }

    pub fn stop(&mut self) {
        if self.running.is_some() {
            self.end = End::Stopped;
        }
        self.abort();
        self.grasp = grasp::IDLE;
    }

    pub fn stop_fast(&mut self) {
        if !self.is_stopped {
            self.is_stopped = true;
            self.abort();
            self.grasp = grasp::ERROR;
        }
    }

    fn abort(&mut self) {
        self.jaws.stay();
        self.is_clamping = false;
        self.ended.extend(self.running.take().map(|task| (task, status::ABORTED)));
    }

    pub fn acknowledge(&mut self) {
        if self.is_stopped {
            (self.is_stopped, self.grasp) = (false, grasp::IDLE);
        }
    }

    pub fn set_limit(&mut self, limit_n: f64) -> u16 {
        let jaws = &self.settings.jaws;
        if !(jaws.least_n..=jaws.most_n).contains(&limit_n) || self.jaws.refuses_force() {
            return status::RANGE;
        }
        self.limit_n = limit_n;
        if self.presses_by_force() && !self.is_limit_fixed && !self.is_stopped {
            self.jaws.grasp(limit_n);
        }
        status::OK
    }

    fn presses_by_force(&self) -> bool {
        self.is_clamping || matches!(self.grasp, grasp::HOLDING | grasp::GRASPING)
    }

    pub fn set_acceleration(&mut self, acceleration: f64) -> u16 {
        if !(100.0..=5000.0).contains(&acceleration) {
            return status::RANGE;
        }
        self.acceleration = acceleration;
        status::OK
    }

    /// Zeroes the force sensor; not while it presses by force.
    pub fn tare(&mut self) -> u16 {
        if self.presses_by_force() {
            return status::DENIED;
        }
        self.jaws.tare();
        status::OK
    }

    /// Where this motion goes, mm, and how fast, mm/s.
    fn target(&self, task: Task) -> (f64, f64) {
        let jaws = &self.settings.jaws;
        match task {
            Task::Home { closes } => (if closes { 0.0 } else { jaws.stroke_mm }, jaws.speed_mm_per_s),
            Task::Move { opening_mm, speed, .. } | Task::Release { opening_mm, speed } => (opening_mm, speed),
            Task::Grasp { width_mm, speed } => (width_mm.unwrap_or(0.0), speed),
        }
    }

    /// Why this motion cannot begin; OK if it can.
    pub fn refusal(&self, task: Task) -> u16 {
        if self.is_stopped {
            return status::DENIED;
        }
        if self.running.is_some() {
            return status::ALREADY_RUNNING;
        }
        if !self.is_homed && !matches!(task, Task::Home { .. }) {
            return status::NOT_INITIALIZED;
        }
        let (opening_mm, speed) = self.target(task);
        if !(0.0..=self.settings.jaws.stroke_mm).contains(&opening_mm) || !(5.0..=420.0).contains(&speed) {
            return status::RANGE;
        }
        match task {
            Task::Grasp { .. } if self.grasp == grasp::HOLDING && !self.is_regrasp_allowed => status::DENIED,
            Task::Release { .. } if self.grasp != grasp::HOLDING => status::DENIED,
            _ => status::OK,
        }
    }

    pub fn begin(&mut self, task: Task) -> u16 {
        match self.refusal(task) {
            status::OK => {}
            refused => return refused,
        }
        let (opening_mm, speed) = self.target(task);
        (self.end, self.is_clamping) = (End::Other, false);
        self.jaws.set_speed(speed);
        match task {
            Task::Grasp { width_mm, .. } => {
                self.grasp = grasp::GRASPING;
                self.jaws.let_meet(width_mm.is_none());
                self.jaws.grasp(self.limit_n);
            }
            Task::Release { .. } => {
                self.grasp = grasp::RELEASING;
                self.jaws.move_to(opening_mm);
            }
            Task::Home { .. } | Task::Move { .. } => {
                self.grasp = grasp::POSITIONING;
                self.jaws.move_to(opening_mm);
            }
        }
        self.running = Some(task);
        status::PENDING
    }

    fn finish(&mut self, grasp: u8, status: u16) {
        self.grasp = grasp;
        self.ended.extend(self.running.take().map(|task| (task, status)));
    }

    fn see(&mut self) {
        match self.running {
            Some(Task::Grasp { width_mm, .. }) if self.jaws.has_begun() => self.see_grasp(width_mm),
            Some(Task::Grasp { .. }) | None => {}
            Some(task) => {
                if self.jaws.is_there() {
                    match task {
                        Task::Home { .. } => self.is_homed = true,
                        _ => self.end = End::Reached,
                    }
                    self.finish(grasp::IDLE, status::OK);
                } else if self.jaws.is_blocked() {
                    self.end = End::Blocked;
                    self.is_clamping = matches!(task, Task::Move { clamps: true, .. });
                    match self.is_clamping {
                        true => self.jaws.grasp(self.limit_n),
                        false => self.jaws.stay(),
                    }
                    self.finish(grasp::IDLE, status::BLOCKED);
                }
            }
        }
        if self.grasp == grasp::HOLDING && !self.jaws.touches() {
            self.grasp = grasp::PART_LOST;
            self.jaws.stay();
        }
        if self.is_clamping && self.jaws.has_begun() && !self.jaws.touches() {
            self.is_clamping = false; // nothing is in the way any more
            self.jaws.stay();
        }
    }

    fn see_grasp(&mut self, width_mm: Option<f64>) {
        let Settings { part_width_tolerance_mm, clamping_travel_mm, .. } = self.settings;
        let has_width = width_mm.is_some();
        let beyond_mm = width_mm.map_or(0.0, |width_mm| width_mm - self.jaws.opening_mm());
        if self.jaws.touches() && beyond_mm < -part_width_tolerance_mm / 2.0 {
            self.jaws.stay();
            self.end = End::Blocked;
            self.finish(grasp::ERROR, status::BLOCKED);
        } else if self.jaws.holds() {
            self.finish(grasp::HOLDING, status::OK);
        } else if !self.jaws.touches()
            && (beyond_mm > clamping_travel_mm || (has_width && self.jaws.opening_mm() <= 0.0))
        {
            self.jaws.stay();
            self.finish(grasp::NO_PART, status::FAILED);
        }
    }

    pub fn inject(&mut self, fault: Fault) -> bool {
        match fault {
            Fault::FastStop => self.stop_fast(),
            Fault::PowerCycle => {
                self.jaws.stay();
                (self.running, self.is_homed, self.is_stopped) = (None, false, false);
                (self.end, self.is_clamping) = (End::Other, false);
                (self.grasp, self.limit_n) = (grasp::IDLE, self.settings.jaws.most_n);
                self.is_farewell_said = true; // without power nothing is latched
            }
            Fault::FixedLimit => self.is_limit_fixed = true,
            Fault::AllowRegrasp => self.is_regrasp_allowed = true,
            Fault::LosePart | Fault::RefuseForce => return false, // of the jaws alone
        }
        true
    }
}
