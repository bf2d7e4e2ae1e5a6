//! Ramps under physics that nothing was tuned to, and with wrong values of grip force and stiffness.

use super::error::EvalError;
use super::protocol::Protocol;
use super::ramp_tables;
use super::ramps::{Draw, draw, records};
use super::record::TrialRecord;
use super::stated_error;
use super::table::Table;
use super::trial_seed::stream;
use super::watch::{Onlooker, Reading, Restarts, Watch, show, watch};
use crate::contact::{Friction, Law};
use crate::layer::{Creep, Gel, SoftObject};
use crate::rivals::{DETECTORS, Entry};

/// Default number of trials: 50 of each variant.
const TRIALS_COUNT: u64 = 650;

/// Largest grip if the camera sees less than the pad, N.
const MINI_MOST_N: f64 = 30.0;

/// A deviation from the standard: its name and the change for a friction coefficient.
#[derive(Debug, Clone, Copy)]
struct Variant {
    name: &'static str,
    change: fn(&mut Watch, f64),
    /// Added to the trial.
    also: &'static str,
    /// Whether friction is Coulomb's with the trial's coefficient.
    has_mu: bool,
}

const PLAIN: Variant = Variant { name: "", change: |_, _| (), also: "", has_mu: true };

/// All variants. Creep, weakening and adhesion are set to estimates of what a real gel does at most.
const VARIANTS: [Variant; 13] = [
    Variant {
        name: "creep",
        change: |watch, _| watch.physics.gel.creep = Some(Creep { share_fraction: 0.12, time_s: 0.8 }),
        ..PLAIN
    },
    Variant {
        name: "slip_weakening",
        change: |watch, mu| {
            watch.physics.friction =
                law(Law::SlipWeakening { mu_static: mu, mu_kinetic: 0.7 * mu, distance_mm: 0.06 }, 0.0)
        },
        has_mu: false,
        ..PLAIN
    },
    Variant {
        name: "pressure_dependent",
        change: |watch, mu| {
            watch.physics.friction =
                law(Law::PressureDependent { adhesion_mpa: 0.004, slope: 0.8 * mu, cap_mpa: 0.12 * mu }, 0.0)
        },
        has_mu: false,
        ..PLAIN
    },
    Variant {
        name: "yielding_interface",
        change: |watch, mu| watch.physics.friction = law(Law::Constant { mu }, 0.03),
        ..PLAIN
    },
    Variant { name: "membrane", change: |watch, _| watch.physics.gel.membrane_n_per_mm = 0.6, ..PLAIN },
    Variant { name: "stiffer_gel", change: |watch, _| watch.physics.gel.modulus_mpa *= 1.6, ..PLAIN },
    Variant {
        name: "softer_thinner_gel",
        change: |watch, _| {
            watch.physics.gel = Gel { modulus_mpa: 0.35, thickness_mm: 2.2, poisson_ratio: 0.47, ..Gel::default() }
        },
        ..PLAIN
    },
    Variant {
        name: "soft_objects",
        change: |watch, _| {
            watch.physics.softness = Some(SoftObject { modulus_mpa: 0.4, poisson_ratio: 0.35, thickness_mm: 6.0 })
        },
        ..PLAIN
    },
    Variant { name: "mini_camera", also: "&camera=gelsight_mini", ..PLAIN },
    Variant {
        name: "force_told_high",
        change: |watch, _| watch.reading = Reading { scale: 1.15, offset_n: 1.0, ..Reading::default() },
        ..PLAIN
    },
    Variant {
        name: "force_told_low",
        change: |watch, _| watch.reading = Reading { scale: 0.85, offset_n: -1.0, ..Reading::default() },
        ..PLAIN
    },
    Variant { name: "stiffness_told_high", change: |watch, _| watch.stiffness_scale = 1.25, ..PLAIN },
    Variant { name: "stiffness_told_low", change: |watch, _| watch.stiffness_scale = 0.75, ..PLAIN },
];

fn law(law: Law, yield_mm: f64) -> Option<Friction> {
    Some(Friction { law, yield_mm })
}

/// The protocol.
#[derive(Debug)]
pub struct Unseen {
    seed: u64,
    trials_count: u64,
}

impl Unseen {
    /// Its name on the command line and in files.
    pub const NAME: &'static str = "unseen";

    /// The trials of a seed.
    pub fn new(seed: u64, trials: Option<u64>) -> Self {
        Unseen { seed, trials_count: trials.unwrap_or(TRIALS_COUNT) }
    }

    fn watch_of(&self, number: u64) -> Result<(&'static Variant, Watch), EvalError> {
        let variants_count = VARIANTS.len() as u64;
        let variant = &VARIANTS[(number % variants_count) as usize];
        // A variant cycles through the objects, with its own draws.
        let seed = stream(self.seed, 2 << 32 | (number % variants_count)).next_u64();
        let mut drawn: Draw = draw(seed, number / variants_count);
        if variant.also.contains("mini") {
            drawn.force_n = drawn.force_n.min(10.0 + (drawn.force_n - 10.0) * (MINI_MOST_N - 10.0) / 50.0);
        }
        let trial = drawn.trial(seed, number, variant.also)?;
        let mut what = Watch::new(trial, Restarts::Rivals);
        (variant.change)(&mut what, drawn.mu);
        Ok((variant, what))
    }
}

impl Protocol for Unseen {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn trials_count(&self) -> u64 {
        self.trials_count
    }

    fn judge(&self, number: u64, detectors: &[&'static Entry]) -> Result<Vec<TrialRecord>, EvalError> {
        let (variant, what) = self.watch_of(number)?;
        let watched = watch(&what, detectors, None)?;
        let name = format!("{}: {}", variant.name, what.trial);
        let mu = variant.has_mu.then(|| what.trial.mu());
        let records = records(number, &name, &what.trial, mu, &watched);
        Ok(records.into_iter().map(|record| record.with("variant", variant.name)).collect())
    }

    fn tables(&self, records: &[TrialRecord]) -> Vec<Table> {
        let mut tables = ramp_tables::tables(records, "All variants: ");
        let of = |name: &'static str| move |r: &TrialRecord| r.word_of("variant") == Some(name);
        let variants: Vec<_> = VARIANTS.iter().map(|variant| (variant.name, of(variant.name))).collect();
        let parts: Vec<ramp_tables::Part<'_>> =
            variants.iter().map(|(name, of)| (*name, of as &dyn Fn(&TrialRecord) -> bool)).collect();
        tables.push(ramp_tables::split("By variant", records, &parts));
        tables.push(ramp_tables::loads("Force, torque and friction beside the error put in", records, &parts));
        tables.extend(stated_error::table(records, DETECTORS.iter().filter(|entry| entry.is_ours()).map(|e| e.name)));
        tables
    }

    fn settings(&self) -> Vec<(String, String)> {
        vec![Restarts::Rivals.setting()]
    }

    fn show(&self, number: u64, detector: &'static Entry, onlooker: &mut Onlooker<'_>) -> Result<(), EvalError> {
        show(&self.watch_of(number)?.1, detector, onlooker)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::World;

    #[test]
    fn every_variant_is_a_sound_world_unlike_the_standard() {
        let unseen = Unseen::new(0, None);
        for number in 0..VARIANTS.len() as u64 {
            let (variant, what) = unseen.watch_of(number).expect("a sound trial");
            let plain = Watch::new(what.trial.clone(), Restarts::Rivals);
            let differs = what.physics != plain.physics
                || what.reading != plain.reading
                || what.stiffness_scale != 1.0
                || what.trial.word("camera") == "gelsight_mini";
            assert!(differs, "{}", variant.name);
            let profile = what.trial.load_profile().expect("a profile");
            World::with(&what.trial, profile, &what.physics).unwrap_or_else(|e| panic!("{}: {e}", variant.name));
        }
    }
}
