//! The jaws behind every emulated protocol, and what is between them.

use slipbound::plant::Plant;
use slipbound::plant::{JawCommand, JawDrive, JawSettings};

/// Share of the force asked for at which a grasp counts as established.
const ESTABLISHED: f64 = 0.9;

/// Jaws that press on a plant.
#[derive(Debug, Clone)]
pub(crate) struct Hand {
    jaws: JawDrive,
    is_part_gone: bool,
    /// The newest command; the jaws follow it after their delay.
    newest: JawCommand,
    newest_ns: u64,
    now_ns: u64,
}

impl Hand {
    /// Jaws as told. Settings out of range give the default's.
    pub fn new(settings: JawSettings) -> Self {
        let jaws = JawDrive::new(settings).or_else(|_| JawDrive::new(JawSettings::default()));
        let jaws = jaws.unwrap_or_else(|_| unreachable!("the default settings are valid"));
        Hand { jaws, is_part_gone: false, newest: JawCommand::Stay, newest_ns: 0, now_ns: 0 }
    }

    pub fn advance_to(&mut self, now_ns: u64, plant: &mut dyn Plant) {
        let width_mm = plant.width_mm().filter(|_| !self.is_part_gone);
        self.now_ns = now_ns;
        self.jaws.advance_to(now_ns, width_mm);
        plant.press(self.jaws.force_n());
    }

    pub fn grasp(&mut self, force_n: f64) {
        self.give(JawCommand::Grasp { force_n });
    }

    pub fn move_to(&mut self, opening_mm: f64) {
        self.give(JawCommand::MoveTo { opening_mm });
    }

    pub fn stay(&mut self) {
        self.give(JawCommand::Stay);
    }

    fn give(&mut self, command: JawCommand) {
        (self.newest, self.newest_ns) = (command, self.now_ns);
        self.jaws.command(command);
    }

    pub fn lose_part(&mut self) {
        self.is_part_gone = true;
    }

    /// Whether the newest command has taken effect.
    pub fn has_begun(&self) -> bool {
        self.now_ns >= self.newest_ns + self.jaws.settings().delay_ns
    }

    pub fn touches(&self) -> bool {
        self.jaws.touches()
    }

    pub fn holds(&self) -> bool {
        self.jaws.target_n().is_some_and(|target_n| self.touches() && self.force_n() >= ESTABLISHED * target_n)
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

    pub fn force_n(&self) -> f64 {
        self.jaws.force_n()
    }

    pub fn opening_mm(&self) -> f64 {
        self.jaws.opening_mm()
    }

    pub fn settings(&self) -> &JawSettings {
        self.jaws.settings()
    }
}
