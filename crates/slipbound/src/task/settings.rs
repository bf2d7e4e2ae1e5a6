//! All settings of a task, as in one TOML file.

use super::lift::{Lift, LiftSettings};
use super::place::{Place, PlaceSettings};
use super::screw::{Screw, ScrewEnd, ScrewSettings};
use super::step::Task;
use super::unscrew::{Unscrew, UnscrewSettings};
use crate::grip::{GripLimits, Guard, Law, MarginSettings, OnSlipSettings};
use crate::sensor::Sensor;
use crate::setting::{SettingError, named};
use serde::{Deserialize, Serialize};

/// The tasks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TaskKind {
    /// Close a cap.
    Screw,
    /// Open a cap.
    Unscrew,
    /// Lay a tool down.
    Place,
    /// Lift and hold.
    Lift,
}

/// The controllers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControllerKind {
    /// A constant force.
    Constant,
    /// A force step at each incipient slip; tasks end on evidence.
    #[default]
    OnSlip,
    /// Exactly as in the paper: the same, but screwing ends at incipient slip at the largest force, and what cannot be
    /// judged keeps its force.
    Paper,
    /// Holds a slip margin.
    Margin,
}

const TASKS: [(TaskKind, &str); 4] =
    [(TaskKind::Screw, "screw"), (TaskKind::Unscrew, "unscrew"), (TaskKind::Place, "place"), (TaskKind::Lift, "lift")];

const CONTROLLERS: [(ControllerKind, &str); 4] = [
    (ControllerKind::Constant, "constant"),
    (ControllerKind::OnSlip, "on_slip"),
    (ControllerKind::Paper, "paper"),
    (ControllerKind::Margin, "margin"),
];

named!(TaskKind, "task", TASKS);
named!(ControllerKind, "controller", CONTROLLERS);

/// Longest time to hold, s.
const HOLD_MOST_S: f64 = 1e6;

/// The time of an endless hold, ns: eleven days.
const HOLD_WITHOUT_END_NS: u64 = 1_000_000_000_000_000;

/// All settings of a task.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct TaskSettings {
    /// The controller.
    pub controller: ControllerKind,
    /// Force limits of every controller.
    pub grip: GripLimits,
    /// The controllers `on_slip` and `paper`.
    pub on_slip: OnSlipSettings,
    /// The controller `margin`.
    pub margin: MarginSettings,
    /// The task of this name.
    pub screw: ScrewSettings,
    /// The task of this name.
    pub unscrew: UnscrewSettings,
    /// The task of this name.
    pub place: PlaceSettings,
    /// The task of this name.
    pub lift: LiftSettings,
}

impl TaskSettings {
    /// The same with another controller.
    #[must_use]
    pub const fn with_controller(self, controller: ControllerKind) -> Self {
        TaskSettings { controller, ..self }
    }

    /// The same with these force limits.
    #[must_use]
    pub const fn with_grip(self, grip: GripLimits) -> Self {
        TaskSettings { grip, ..self }
    }

    /// The same with the changes that `change` makes.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut TaskSettings)) -> Self {
        change(&mut self);
        self
    }

    /// The same with a [`TaskKind::Lift`] that only holds: nothing is lifted. `hold_s`: seconds, of which those count in
    /// which a finger feels the object; None: until the loop is ended from outside. Refuses more than 1,000,000 s.
    pub fn holding(self, hold_s: Option<f64>) -> Result<Self, SettingError> {
        let hold_ns = match hold_s {
            None => HOLD_WITHOUT_END_NS,
            Some(s) if (0.0..=HOLD_MOST_S).contains(&s) => (s * 1e9) as u64,
            Some(s) => {
                let (key, expected) = ("hold_s".into(), format!("0 to {HOLD_MOST_S} s"));
                return Err(SettingError { key, expected, got: s.to_string() });
            }
        };
        Ok(self.with(|settings| (settings.lift.lift_mm, settings.lift.hold_ns) = (0.0, hold_ns)))
    }

    /// Checks everything that does not depend on the finger; the error names the first invalid key.
    pub fn check(&self) -> Result<(), SettingError> {
        self.grip.check()?;
        self.on_slip.check()?;
        self.margin.check()?;
        self.screw.check()?;
        self.unscrew.check()?;
        self.place.check()?;
        self.lift.check()
    }

    /// Whether a finger measures what a task and its controller need: turning a cap and feeling the ground need the shear
    /// of the gel in mm, `margin` its stiffness. The error names what is missing. With the literal law of the paper
    /// screwing ends on slip alone.
    pub fn check_finger(&self, kind: TaskKind, sensor: &Sensor) -> Result<(), SettingError> {
        if self.controller == ControllerKind::Margin {
            // The stiffness is per mm: [shear] alone, which counts in pitches, is not enough.
            let missing = if sensor.shear.is_some() { "pitch_mm" } else { "[shear]" };
            let got = || format!("0, and no {missing} in the sensor file of {}", sensor.name);
            let of_finger = self.margin.for_finger(sensor.shear_stiffness_mpa_per_mm());
            of_finger.map_err(|error| SettingError { got: got(), ..error })?;
        }
        let ends_on_slip = self.controller == ControllerKind::Paper || self.screw.end == ScrewEnd::SlipAtMost;
        let goes_by_shear = match kind {
            TaskKind::Lift => false,
            TaskKind::Screw => !ends_on_slip,
            TaskKind::Unscrew | TaskKind::Place => true,
        };
        if !goes_by_shear || sensor.pitch_mm.is_some() {
            return Ok(());
        }
        Err(SettingError {
            key: "pitch_mm".into(),
            got: format!("no pitch_mm in the sensor file of {}", sensor.name),
            expected: format!("the distance of the markers in mm: task {kind} goes by the shear of the gel"),
        })
    }

    /// A task, ready to be stepped. `stiffness_mpa_per_mm` is that of the fingers' gels against shear, which `margin`
    /// needs: [`Sensor::shear_stiffness_mpa_per_mm`](crate::sensor::Sensor::shear_stiffness_mpa_per_mm).
    pub fn task(
        &self,
        kind: TaskKind,
        stiffness_mpa_per_mm: Option<f64>,
    ) -> Result<Box<dyn Task + Send>, SettingError> {
        self.check()?;
        let mut settings = *self;
        if self.controller == ControllerKind::Paper {
            settings.screw.end = ScrewEnd::SlipAtMost;
        }
        let law = match self.controller {
            ControllerKind::Constant => Law::Constant,
            ControllerKind::OnSlip => Law::OnSlip(self.on_slip),
            // The literal law of the paper answers slip alone.
            ControllerKind::Paper => Law::OnSlip(OnSlipSettings { unsure_n_per_s: 0.0, ..self.on_slip }),
            ControllerKind::Margin => Law::Margin(self.margin.for_finger(stiffness_mpa_per_mm)?),
        };
        settings.task_with(kind, law.controller(&self.grip)?, stiffness_mpa_per_mm)
    }

    /// The same with your own controller behind its guard, `Guard::new(Box::new(controller), settings.grip)`; the
    /// controller and the limits in the settings are ignored.
    pub fn task_with(
        &self,
        kind: TaskKind,
        grip: Guard,
        stiffness_mpa_per_mm: Option<f64>,
    ) -> Result<Box<dyn Task + Send>, SettingError> {
        self.check()?;
        Ok(match kind {
            TaskKind::Screw => Box::new(Screw::new(self.screw, grip, stiffness_mpa_per_mm)?),
            TaskKind::Unscrew => Box::new(Unscrew::new(self.unscrew, grip, stiffness_mpa_per_mm)?),
            TaskKind::Place => Box::new(Place::new(self.place, grip, stiffness_mpa_per_mm)?),
            TaskKind::Lift => Box::new(Lift::new(self.lift, grip)?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hold_lifts_nothing_and_lasts_as_long_as_it_is_told() {
        let lift = |hold_s| TaskSettings::default().holding(hold_s).map(|settings| settings.lift);
        for (hold_s, hold_ns) in [(None, 1_000_000_000_000_000), (Some(0.0), 0), (Some(2.5), 2_500_000_000)] {
            let lift = lift(hold_s).expect("a time");
            assert_eq!((lift.lift_mm, lift.hold_ns), (0.0, hold_ns));
            lift.check().expect("in range");
        }
        for hold_s in [-1.0, f64::NAN, 1_000_001.0] {
            let told = lift(Some(hold_s)).expect_err("no such time").to_string();
            assert_eq!(told, format!("hold_s: expected 0 to 1000000 s, got {hold_s}"));
        }
    }
}
