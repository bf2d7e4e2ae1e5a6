//! One finger and one object, stepped in time.

use super::body::{Drive, Motion, complex, length};
use super::grid::Region;
use super::normal::Normal;
use super::response::Response;
use super::responses::{Material, Responses};
use super::settings::{Command, FingerSettings};
use super::shape::Shape;
use super::tangential::Tangential;
use super::truth::{Events, Truth};
use num_complex::Complex64;
use slipbound::setting::SettingError;
use std::sync::Arc;

/// Largest travel of the object over the gel in one increment of a step, in mm. The force is then within 0.7 % of the
/// limit of fine steps; ordinary scenes stay below this in whole steps.
const MOST_WAY_MM: f64 = 0.06;

/// Most increments of a step, enough for 230 mm/s in steps of 1/120 s: a faster object flies off.
const MOST_INCREMENTS_COUNT: u32 = 32;

/// In-plane and normal parts of a displacement field.
#[derive(Debug, Clone)]
pub(super) struct Field {
    pub shift: Vec<Complex64>,
    pub depth: Vec<f64>,
}

impl Field {
    fn new(cells: usize) -> Self {
        Field { shift: vec![Complex64::ZERO; cells], depth: vec![0.0; cells] }
    }
}

/// A part of a step. Creep and a rail use the duration of the whole step, in which increments are stages of loading;
/// inertia uses that of the increment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Increment {
    pub of_count: u32,
    pub first: bool,
    pub last: bool,
}

/// How creep enters one implicit step: u_v' = keep u_v + gain A q.
#[derive(Debug, Clone, Copy)]
pub(super) struct CreepStep {
    pub keep: f64,
    pub gain: f64,
}

/// The part of the state that exists only if the compliances of gel and interface differ.
#[derive(Debug, Clone)]
pub(super) struct GelApart {
    pub response: Response,
    pub creep: Option<CreepStep>,
    /// u_v, the creep part.
    pub crept: Field,
}

/// A finger in contact with an object. All memory is allocated in [`Finger::new`]; a clone is an independent branch of
/// the run.
#[derive(Debug, Clone)]
pub struct Finger {
    pub(super) settings: FingerSettings,
    pub(super) shape: Arc<dyn Shape>,
    pub(super) at_rest: Vec<Complex64>,
    /// How far the gel lies below its middle at rest, mm; empty if it is flat up to the border of the grid.
    pub(super) below: Vec<f64>,
    pub(super) interface: Responses,
    pub(super) apart: Option<GelApart>,
    pub(super) normal: Normal,
    pub(super) tangential: Tangential,
    pub(super) truth: Truth,
    pub(super) velocity: Motion,
    /// The last command.
    pub(super) asked: Option<Command>,
    /// Distance of the farthest cell in contact from the object's reference point, in mm.
    pub(super) reach_mm: f64,
    pub(super) window: Option<Region>,
    pub(super) cells: Vec<u32>,
    pub(super) gap: Vec<f64>,
    pub(super) pressure: Vec<f64>,
    pub(super) pressure_before: Vec<f64>,
    pub(super) traction: Vec<Complex64>,
    /// Traction, and pressure, of the step before the last, for extrapolation.
    pub(super) traction_before: Vec<Complex64>,
    /// Gradient of the gap, and the in-plane traction of the pressure that follows from it.
    pub(super) slope: Vec<Complex64>,
    pub(super) push: Vec<Complex64>,
    /// Sum of the part of `push` that comes from the profile alone.
    pub(super) on_profile: Complex64,
    pub(super) bound: Vec<f64>,
    /// Interface compliance; empty if friction has none.
    pub(super) compliance: Vec<f64>,
    pub(super) lever: Vec<Complex64>,
    pub(super) target: Vec<Complex64>,
    /// Stick displacement of each cell: the displacement a stuck cell should have, free of the solver's last error.
    pub(super) anchor: Vec<Complex64>,
    pub(super) of_pressure: Field,
    pub(super) of_traction: Field,
    /// Displacement of the gel relative to a soft object.
    pub(super) relative: Vec<Complex64>,
    pub(super) gel: Field,
    pub(super) contact: Vec<bool>,
    pub(super) stick: Vec<bool>,
    pub(super) slip: Vec<Complex64>,
    pub(super) slipped: Vec<f64>,
}

impl Finger {
    /// A finger at rest with an object above it. Fails for invalid settings and for shapes that do not fit on the gel.
    pub fn new(settings: FingerSettings, shape: impl Shape + 'static) -> Result<Self, SettingError> {
        settings.check()?;
        shape.check()?;
        settings.check_size(shape.half_size_mm())?;
        let FingerSettings { grid, gel, soft_object, .. } = settings;
        let creep = gel.creep.map(|creep| {
            let rate = settings.substep_s / creep.time_s;
            CreepStep { keep: 1.0 / (1.0 + rate), gain: creep.share_fraction * rate / (1.0 + rate) }
        });
        let compliance_factor = 1.0 + creep.map_or(0.0, |creep| creep.gain);
        let interface = Material { grid, gel, compliance_factor, soft_object };
        let cells = grid.cells_count();
        let apart = (creep.is_some() || soft_object.is_some()).then(|| GelApart {
            response: Responses::of(&Material { compliance_factor: 1.0, soft_object: None, ..interface })
                .whole()
                .clone(),
            creep,
            crept: Field::new(cells),
        });
        Ok(Finger {
            settings,
            shape: Arc::new(shape),
            at_rest: (0..cells).map(|cell| complex(grid.centre_mm(cell))).collect(),
            below: settings
                .edge
                .map_or(Vec::new(), |edge| (0..cells).map(|cell| edge.below_mm(grid.centre_mm(cell))).collect()),
            interface: Responses::of(&interface),
            apart,
            normal: Normal::new(cells),
            tangential: Tangential::new(cells),
            truth: Truth::default(),
            velocity: Motion::ZERO,
            asked: None,
            reach_mm: 0.0,
            window: None,
            cells: Vec::with_capacity(cells),
            gap: vec![0.0; cells],
            pressure: vec![0.0; cells],
            pressure_before: vec![0.0; cells],
            traction: vec![Complex64::ZERO; cells],
            traction_before: vec![Complex64::ZERO; cells],
            slope: vec![Complex64::ZERO; cells],
            push: vec![Complex64::ZERO; cells],
            on_profile: Complex64::ZERO,
            bound: vec![0.0; cells],
            compliance: vec![0.0; if settings.friction.yield_mm > 0.0 { cells } else { 0 }],
            lever: vec![Complex64::ZERO; cells],
            target: vec![Complex64::ZERO; cells],
            anchor: vec![Complex64::ZERO; cells],
            of_pressure: Field::new(cells),
            of_traction: Field::new(cells),
            relative: vec![Complex64::ZERO; cells],
            gel: Field::new(cells),
            contact: vec![false; cells],
            stick: vec![false; cells],
            slip: vec![Complex64::ZERO; cells],
            slipped: vec![0.0; cells],
        })
    }

    /// Advances by one step to the command. Fails for negative forces and for numbers that are not finite; the state is
    /// then unchanged.
    pub fn step(&mut self, command: &Command) -> Result<&Truth, SettingError> {
        command.check()?;
        let before = self.begin_step();
        let count = self.increments_count(command);
        let from = self.begun(command);
        for n in 1..=count {
            let now = from.part(command, n, count);
            self.advance(&now, Increment { of_count: count, first: n == 1, last: n == count });
        }
        self.end_step(command, &before);
        Ok(&self.truth)
    }

    /// Resets what is counted per step; returns the truth before it.
    pub(super) fn begin_step(&mut self) -> Truth {
        let before = self.truth;
        self.truth.dissipated_n_mm = 0.0;
        self.truth.normal_iterations_count = 0;
        self.truth.tangential_iterations_count = 0;
        self.truth.converged = true;
        before
    }

    pub(super) fn end_step(&mut self, command: &Command, before: &Truth) {
        self.truth.time_s += self.settings.substep_s;
        self.truth.events = Events::between(before, &self.truth);
        self.asked = Some(*command);
    }

    /// Number of increments of a step. The gap follows the slip with a lag of one increment, which would take 8 % per
    /// mm off the force of a sliding sphere; without contact there is nothing to follow.
    pub(super) fn increments_count(&self, command: &Command) -> u32 {
        if self.cells.is_empty() {
            return 1;
        }
        let way_mm = |shift_mm: f64, turn_rad: f64| shift_mm + turn_rad.abs() * self.reach_mm;
        let pose = self.truth.pose;
        let commanded_mm =
            way_mm((command.pose.position_mm - pose.position_mm).length(), command.pose.turn_rad - pose.turn_rad);
        let carried_mm = way_mm(length(self.velocity.shift), self.velocity.turn) * self.settings.substep_s;
        let way_mm = match self.settings.body.drive {
            Drive::Guided => commanded_mm,
            _ => carried_mm,
        };
        // A value that is too large, or NaN, ends at a limit of the range.
        ((way_mm / MOST_WAY_MM).ceil() as u32).clamp(1, MOST_INCREMENTS_COUNT)
    }

    /// Whether the contact reaches the border of the grid, or the rounded edge of the gel: closer to its free side than
    /// the gel is thick, where the endless layer is a poor model of it.
    pub(super) fn is_at_border(&self) -> bool {
        let grid = self.settings.grid;
        let is_on_edge = |&cell: &u32| self.below.get(cell as usize).is_some_and(|below_mm| *below_mm > 0.0);
        let reaches = |w: Region| {
            w.column == 0
                || w.row == 0
                || w.column + w.width_cells == grid.width_cells
                || w.row + w.height_cells == grid.height_cells
        };
        self.window.is_some_and(reaches) || self.cells.iter().any(is_on_edge)
    }

    /// The command from which this step starts: the object's present pose, and the last command.
    pub(super) fn begun(&self, command: &Command) -> Command {
        let asked = self.asked.unwrap_or(*command);
        let guided = matches!(self.settings.body.drive, Drive::Guided | Drive::Railed(_));
        Command { pose: if guided { self.truth.pose } else { asked.pose }, ..asked }
    }
}
