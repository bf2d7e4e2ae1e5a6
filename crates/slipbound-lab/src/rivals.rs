//! Slip detectors of the literature to compare with ours, all on the markers and the contact that our monitor finds.
//!
//! ```text
//!   frame --> SlipMonitor --markers, contact, imprint--> Detector --> score, alarm
//! ```
//!
//! A score is continuous and causal: it uses no later frames, and a larger score means stronger evidence of slip. The
//! thresholds of rivals are the published ones where they exist, otherwise they were set on trials that no table
//! counts; the file of a rival says which.

mod centre_rim;
mod detector;
mod displacement;
mod entropy;
mod imprint;
mod load;
mod ours;
mod paper;
mod reference;

pub use centre_rim::CentreRim;
pub use detector::Detector;
pub use displacement::Displacement;
pub use entropy::Entropy;
pub use imprint::Imprint;
pub use load::Load;
pub use ours::{Ours, ReportEstimates, estimates_of};
pub use paper::{Paper, PaperAsWritten};

use slipbound::monitor::Settings;
use slipbound::setting::SettingError;

/// Inputs of the monitor behind a detector.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Inputs {
    /// Frames, and the grip force as the gripper reads it.
    FramesAndForce,
    /// Frames alone.
    Frames,
    /// Frames alone, with the settings of the paper: its own markers and contact.
    PaperFrames,
}

impl Inputs {
    /// The settings of the monitor.
    pub fn settings(self) -> Settings {
        match self {
            Inputs::PaperFrames => Settings::paper(),
            Inputs::FramesAndForce | Inputs::Frames => Settings::default(),
        }
    }

    /// Whether the monitor receives the grip force.
    pub fn has_force(self) -> bool {
        self == Inputs::FramesAndForce
    }
}

/// A detector by name.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Its name in records and tables.
    pub name: &'static str,
    /// Description in one line.
    pub what: &'static str,
    /// Inputs of its monitor.
    pub inputs: Inputs,
    make: fn() -> Box<dyn Detector>,
}

impl Entry {
    /// A new detector that has seen no frame.
    pub fn make(&self) -> Box<dyn Detector> {
        (self.make)()
    }

    /// Whether it gives no result without a known grip force, as with a recording.
    pub fn needs_force(&self) -> bool {
        self.inputs.has_force() && !self.is_ours()
    }

    /// Whether it is ours.
    pub fn is_ours(&self) -> bool {
        self.name.starts_with("ours")
    }
}

/// All detectors, ours first.
pub const DETECTORS: [Entry; 9] = [
    Entry {
        name: "ours",
        what: "the shipped verdict, told the grip force",
        inputs: Inputs::FramesAndForce,
        make: || Box::new(Ours),
    },
    Entry {
        name: "ours_frames",
        what: "the shipped verdict, from frames alone",
        inputs: Inputs::Frames,
        make: || Box::new(Ours),
    },
    Entry {
        name: "paper_as_written",
        what: "the paper with its own markers and contact (Dong et al. 2019)",
        inputs: Inputs::PaperFrames,
        make: || Box::new(PaperAsWritten),
    },
    Entry {
        name: "paper",
        what: "the paper's rule on our markers and contact",
        inputs: Inputs::Frames,
        make: || Box::<Paper>::default(),
    },
    Entry {
        name: "entropy",
        what: "entropy of the displacement field (after Yuan et al. 2015)",
        inputs: Inputs::Frames,
        make: || Box::<Entropy>::default(),
    },
    Entry {
        name: "centre_rim",
        what: "displacement of the centre over that of the rim (after Dong et al. 2017)",
        inputs: Inputs::Frames,
        make: || Box::<CentreRim>::default(),
    },
    Entry {
        name: "imprint",
        what: "motion of the imprint against the markers (after Dong et al. 2017)",
        inputs: Inputs::Frames,
        make: || Box::<Imprint>::default(),
    },
    Entry {
        name: "displacement",
        what: "mean displacement of the markers in contact",
        inputs: Inputs::Frames,
        make: || Box::<Displacement>::default(),
    },
    Entry {
        name: "load",
        what: "tangential load over 0.6 times the grip force",
        inputs: Inputs::FramesAndForce,
        make: || Box::new(Load),
    },
];

/// The detector of a name; the error lists the names.
pub fn named(name: &str) -> Result<&'static Entry, SettingError> {
    DETECTORS
        .iter()
        .find(|entry| entry.name == name)
        .ok_or_else(|| SettingError::none_of("detector", name, &DETECTORS.map(|entry| entry.name)))
}
