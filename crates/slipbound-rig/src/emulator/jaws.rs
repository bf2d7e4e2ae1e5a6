//! The jaws behind every emulated protocol.

use super::force_sensor::{ForceSensor, SensorFaults};
use slipbound::plant::{JawCommand, JawDrive, JawSettings, Plant};

/// Share of the force asked for at which a grasp counts as established.
const ESTABLISHED: f64 = 0.9;

/// Time for which jaws on their way have to stand still to be called blocked, ns.
const BLOCKED_NS: u64 = 50_000_000;

/// Jaws that press on a plant. They move by [`JawDrive`], as those of the simulator.
#[derive(Debug, Clone)]
pub struct EmulatedJaws {
    drive: JawDrive,
    sensor: ForceSensor,
    is_part_gone: bool,
    refuses_force: bool,
    /// The newest command; the jaws follow it after their delay.
    newest: JawCommand,
    newest_ns: u64,
    now_ns: u64,
    /// Since when they stand still, ns.
    stands_ns: u64,
}

impl EmulatedJaws {
    /// Wide open. Settings out of range give the default's.
    pub fn new(settings: JawSettings) -> Self {
        let drive = JawDrive::new(settings).or_else(|_| JawDrive::new(JawSettings::default()));
        let drive = drive.unwrap_or_else(|_| unreachable!("the default settings are valid"));
        EmulatedJaws {
            drive,
            sensor: ForceSensor::new(SensorFaults::default(), 0),
            is_part_gone: false,
            refuses_force: false,
            newest: JawCommand::Stay,
            newest_ns: 0,
            now_ns: 0,
            stands_ns: 0,
        }
    }

    /// Lets time pass: the jaws move, and press on the plant. Does not advance the plant.
    pub fn advance_to(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        let width_mm = plant.width_mm().filter(|_| !self.is_part_gone);
        let before_mm = self.drive.opening_mm();
        self.now_ns = now_ns;
        self.drive.advance_to(now_ns, width_mm);
        if self.drive.opening_mm() != before_mm {
            self.stands_ns = now_ns;
        }
        plant.press(self.drive.force_n());
        self.sensor.see(now_ns, self.drive.force_n(), self.drive.touches());
    }

    /// Closes with this force, N per finger.
    pub fn grasp(&mut self, force_n: f64) {
        self.give(JawCommand::Grasp { force_n });
    }

    /// Moves to this opening, mm, without pressing.
    pub fn move_to(&mut self, opening_mm: f64) {
        self.give(JawCommand::MoveTo { opening_mm });
    }

    /// Stays where it is, with the force it has.
    pub fn stay(&mut self) {
        self.give(JawCommand::Stay);
    }

    fn give(&mut self, command: JawCommand) {
        (self.newest, self.newest_ns) = (command, self.now_ns);
        self.drive.command(command);
    }

    /// The object is gone.
    pub fn lose_part(&mut self) {
        self.is_part_gone = true;
    }

    /// From now on every new force is refused.
    pub fn refuse_force(&mut self) {
        self.refuses_force = true;
    }

    /// Whether every new force is refused.
    pub fn refuses_force(&self) -> bool {
        self.refuses_force
    }

    /// Whether the newest command has taken effect.
    pub fn has_begun(&self) -> bool {
        self.now_ns >= self.newest_ns + self.drive.settings().delay_ns
    }

    /// Whether the object is touched.
    pub fn touches(&self) -> bool {
        self.drive.touches()
    }

    /// Whether a grasp is established.
    pub fn holds(&self) -> bool {
        self.drive.target_n().is_some_and(|target_n| self.touches() && self.force_n() >= ESTABLISHED * target_n)
    }

    /// Whether a motion to an opening has got there.
    pub fn is_there(&self) -> bool {
        match self.newest {
            JawCommand::MoveTo { opening_mm } => {
                self.has_begun() && (self.opening_mm() - opening_mm.min(self.settings().stroke_mm)).abs() < 1e-6
            }
            _ => false,
        }
    }

    /// From now on its force is read with these faults, whose noise is drawn from `seed`.
    pub fn set_sensor(&mut self, faults: SensorFaults, seed: u64) {
        self.sensor = ForceSensor::new(faults, seed);
    }

    /// What its sensor reads of that force, N per finger.
    pub fn reading_n(&self) -> f64 {
        self.sensor.reading_n()
    }

    /// Whether a motion to an opening stands still before it has got there: something is in the way.
    pub fn is_blocked(&self) -> bool {
        let moves = matches!(self.newest, JawCommand::MoveTo { .. });
        moves
            && self.has_begun()
            && self.now_ns > self.stands_ns.max(self.newest_ns + self.drive.settings().delay_ns) + BLOCKED_NS
            && !self.is_there()
    }

    /// What the sensor reads now counts as no force.
    pub fn tare(&mut self) {
        self.sensor.tare();
    }

    /// Normal force per finger, N.
    pub fn force_n(&self) -> f64 {
        self.drive.force_n()
    }

    /// Distance between the fingertips, mm.
    pub fn opening_mm(&self) -> f64 {
        self.drive.opening_mm()
    }

    /// How they move.
    pub fn settings(&self) -> &JawSettings {
        self.drive.settings()
    }
}
