//! The jaws behind every emulated protocol.

use super::force_sensor::{ForceSensor, SensorFaults};
use super::paced_drive::PacedDrive;
use slipbound::plant::{JawCommand, JawSettings, Plant};

/// Share of the requested force at which a grasp counts as established.
const ESTABLISHED: f64 = 0.9;

/// Time for which moving jaws must stand still to count as blocked, ns.
const BLOCKED_NS: u64 = 50_000_000;

/// Jaws that press on a plant. They move by [`JawDrive`](slipbound::plant::JawDrive), like those of the simulator, but
/// each command has a speed of its own.
#[derive(Debug, Clone)]
pub struct EmulatedJaws {
    drive: PacedDrive,
    sensor: ForceSensor,
    is_part_gone: bool,
    refuses_force: bool,
    /// The newest command; the jaws follow it after their delay.
    newest: JawCommand,
    newest_ns: u64,
    /// Speed of later commands, mm/s.
    speed_mm_per_s: f64,
    /// Whether closing fingers that find nothing press on each other.
    may_meet: bool,
    /// How fast the opening changes now, mm/s; negative while closing.
    velocity_mm_per_s: f64,
    now_ns: u64,
    /// Since when they stand still, ns.
    stands_ns: u64,
}

impl EmulatedJaws {
    /// Wide open. Settings out of range give the default's.
    pub fn new(settings: JawSettings) -> Self {
        let drive = PacedDrive::new(settings);
        EmulatedJaws {
            speed_mm_per_s: drive.settings().speed_mm_per_s,
            drive,
            sensor: ForceSensor::new(SensorFaults::default(), 0),
            is_part_gone: false,
            refuses_force: false,
            newest: JawCommand::Stay,
            newest_ns: 0,
            may_meet: false,
            velocity_mm_per_s: 0.0,
            now_ns: 0,
            stands_ns: 0,
        }
    }

    /// Advances the time: the jaws move, and press on the plant. Does not advance the plant.
    pub fn advance_to(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        let part_mm = self.between_mm(plant);
        let before_mm = self.drive.opening_mm();
        let meets = self.may_meet && before_mm <= 0.0;
        self.drive.advance_to(now_ns, part_mm.or(meets.then_some(0.0)));
        let moved_mm = self.drive.opening_mm() - before_mm;
        if moved_mm != 0.0 {
            self.stands_ns = now_ns;
        }
        if now_ns > self.now_ns {
            self.velocity_mm_per_s = moved_mm / ((now_ns - self.now_ns) as f64 * 1e-9);
        }
        self.now_ns = now_ns;
        plant.press(if part_mm.is_some() { self.drive.force_n() } else { 0.0 });
        self.sensor.see(now_ns, self.drive.force_n(), self.drive.touches());
    }

    /// Width of what is between them, mm; None: nothing.
    pub fn between_mm(&self, plant: &dyn Plant) -> Option<f64> {
        plant.width_mm().filter(|_| !self.is_part_gone)
    }

    /// Speed of later commands while off the object, mm/s. At first it is that of the settings.
    pub fn set_speed(&mut self, speed_mm_per_s: f64) {
        self.speed_mm_per_s = speed_mm_per_s;
    }

    /// Whether fingers that find nothing press on each other, until the next command to move or to stay.
    pub fn let_meet(&mut self, may_meet: bool) {
        self.may_meet = may_meet;
    }

    /// Closes with this force, N per finger.
    pub fn grasp(&mut self, force_n: f64) {
        self.give(JawCommand::Grasp { force_n });
    }

    /// Moves to this opening, mm, without pressing.
    pub fn move_to(&mut self, opening_mm: f64) {
        self.may_meet = false;
        self.give(JawCommand::MoveTo { opening_mm });
    }

    /// Stays where it is, with the force it has.
    pub fn stay(&mut self) {
        self.may_meet = false;
        self.give(JawCommand::Stay);
    }

    fn give(&mut self, command: JawCommand) {
        (self.newest, self.newest_ns) = (command, self.now_ns);
        self.drive.command(command, self.speed_mm_per_s);
    }

    /// The object is gone.
    pub fn lose_part(&mut self) {
        self.is_part_gone = true;
    }

    /// From here on every new force is refused.
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

    /// Whether a motion to an opening has reached it.
    pub fn is_there(&self) -> bool {
        match self.newest {
            JawCommand::MoveTo { opening_mm } => {
                self.has_begun() && (self.opening_mm() - opening_mm.min(self.settings().stroke_mm)).abs() < 1e-6
            }
            _ => false,
        }
    }

    /// From here on its force is read with these faults, whose noise is drawn from `seed`.
    pub fn set_sensor(&mut self, faults: SensorFaults, seed: u64) {
        self.sensor = ForceSensor::new(faults, seed);
    }

    /// The sensor's reading of that force, N per finger.
    pub fn reading_n(&self) -> f64 {
        self.sensor.reading_n()
    }

    /// Whether a motion to an opening stands still before it has reached it: something is in the way.
    pub fn is_blocked(&self) -> bool {
        let moves = matches!(self.newest, JawCommand::MoveTo { .. });
        moves
            && self.has_begun()
            && self.now_ns > self.stands_ns.max(self.newest_ns + self.drive.settings().delay_ns) + BLOCKED_NS
            && !self.is_there()
    }

    /// The present reading of the sensor counts as no force.
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

    /// Its rate of change, mm/s; negative while closing.
    pub fn velocity_mm_per_s(&self) -> f64 {
        self.velocity_mm_per_s
    }

    /// How they move.
    pub fn settings(&self) -> &JawSettings {
        self.drive.settings()
    }
}
