//! One finger and one object, stepped in time.

use super::body::{Motion, complex, plane};
use super::grid::Region;
use super::normal::{Grip, Normal};
use super::response::{Response, Responses};
use super::settings::{Command, FingerSettings};
use super::shape::Shape;
use super::strain::largest_gradient;
use super::tangential::{Held, Question, Tangential};
use super::transform::Area;
use super::truth::{Events, LINEAR_STRAIN, Truth};
use crate::layer::Compliance;
use rustfft::num_complex::Complex64;
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;
use std::sync::Arc;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Cells around the last contact on which the next one is first looked for.
const GROWTH_CELLS: usize = 3;

/// In-plane and normal parts of a displacement field.
#[derive(Debug, Clone)]
pub(super) struct Field {
    pub shift: Vec<Complex64>,
    pub depth: Vec<f64>,
}

impl Field {
    fn new(cells: usize) -> Self {
        Field { shift: vec![ZERO; cells], depth: vec![0.0; cells] }
    }
}

/// How creep enters one implicit step: u_v' = keep u_v + gain A q.
#[derive(Debug, Clone, Copy)]
struct CreepStep {
    keep: f64,
    gain: f64,
}

/// Where an object is on the gel.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// From the gel's axes to the object's.
    back: Complex64,
    origin: Complex64,
    roll: Complex64,
}

impl Place {
    /// A point of the gel from the object's lowest point, and on its skin, in the object's axes.
    #[inline(always)]
    fn of(&self, at: Complex64) -> (Vec2, Vec2) {
        let skin = self.back * (at - self.origin);
        (plane(skin - self.roll), plane(skin))
    }
}

/// The part of the state that exists only when gel and interface yield differently.
#[derive(Debug, Clone)]
struct GelApart {
    response: Response,
    creep: Option<CreepStep>,
    /// u_v, the crept part.
    crept: Field,
}

/// A finger in contact with an object. All memory is taken in [`Finger::new`]; a clone is a branch of the run.
#[derive(Debug, Clone)]
pub struct Finger {
    pub(super) settings: FingerSettings,
    shape: Arc<dyn Shape>,
    at_rest: Vec<Complex64>,
    interface: Responses,
    apart: Option<GelApart>,
    normal: Normal,
    tangential: Tangential,
    pub(super) truth: Truth,
    velocity: Motion,
    window: Option<Region>,
    cells: Vec<u32>,
    gap: Vec<f64>,
    pub(super) pressure: Vec<f64>,
    pressure_before: Vec<f64>,
    pub(super) traction: Vec<Complex64>,
    /// Traction, and pressure, of the step before the last: loads mostly go on as they went.
    traction_before: Vec<Complex64>,
    /// Gradient of the gap, and what pressure does in the plane by it.
    pub(super) slope: Vec<Complex64>,
    pub(super) push: Vec<Complex64>,
    /// Sum of the part of `push` that comes from the profile alone.
    on_profile: Complex64,
    pub(super) bound: Vec<f64>,
    /// Interface compliance; empty when friction has none.
    give: Vec<f64>,
    lever: Vec<Complex64>,
    target: Vec<Complex64>,
    /// Where each cell is held: the displacement a stuck cell should have, free of the solver's last error.
    anchor: Vec<Complex64>,
    of_pressure: Field,
    of_traction: Field,
    /// Displacement of the gel relative to a soft object.
    relative: Vec<Complex64>,
    pub(super) gel: Field,
    pub(super) contact: Vec<bool>,
    pub(super) stick: Vec<bool>,
    pub(super) slip_step: Vec<Complex64>,
    pub(super) slip: Vec<Complex64>,
    pub(super) slipped: Vec<f64>,
}

impl Finger {
    /// A finger at rest with an object above it. Refuses bad settings and shapes that do not fit on the gel.
    pub fn new(settings: FingerSettings, shape: impl Shape + 'static) -> Result<Self, SettingError> {
        settings.check()?;
        shape.check()?;
        settings.check_size(shape.half_size_mm())?;
        let FingerSettings { grid, gel, soft_object, planner, .. } = settings;
        let creep = gel.creep.map(|creep| {
            let rate = settings.substep_s / creep.time_s;
            CreepStep { keep: 1.0 / (1.0 + rate), gain: creep.share_fraction * rate / (1.0 + rate) }
        });
        let now = 1.0 + creep.map_or(0.0, |creep| creep.gain);
        let interface = Response::of_layer(&grid, planner, |k| {
            let (gel, object) = (gel.compliance(k), soft_object.map_or(Compliance::default(), |o| o.compliance(k)));
            Compliance {
                along_mm_per_mpa: now * gel.along_mm_per_mpa + object.along_mm_per_mpa,
                across_mm_per_mpa: now * gel.across_mm_per_mpa + object.across_mm_per_mpa,
                normal_mm_per_mpa: now * gel.normal_mm_per_mpa + object.normal_mm_per_mpa,
                coupling_mm_per_mpa: now * gel.coupling_mm_per_mpa + object.coupling_mm_per_mpa,
            }
        });
        let cells = grid.cells_count();
        let apart = (creep.is_some() || soft_object.is_some()).then(|| GelApart {
            response: Response::of_layer(&grid, planner, |k| gel.compliance(k)),
            creep,
            crept: Field::new(cells),
        });
        Ok(Finger {
            settings,
            shape: Arc::new(shape),
            at_rest: (0..cells).map(|cell| complex(grid.centre_mm(cell))).collect(),
            interface: Responses::new(interface, planner),
            apart,
            normal: Normal::new(cells),
            tangential: Tangential::new(cells),
            truth: Truth::default(),
            velocity: Motion::ZERO,
            window: None,
            cells: Vec::with_capacity(cells),
            gap: vec![0.0; cells],
            pressure: vec![0.0; cells],
            pressure_before: vec![0.0; cells],
            traction: vec![ZERO; cells],
            traction_before: vec![ZERO; cells],
            slope: vec![ZERO; cells],
            push: vec![ZERO; cells],
            on_profile: ZERO,
            bound: vec![0.0; cells],
            give: vec![0.0; if settings.friction.yield_mm > 0.0 { cells } else { 0 }],
            lever: vec![ZERO; cells],
            target: vec![ZERO; cells],
            anchor: vec![ZERO; cells],
            of_pressure: Field::new(cells),
            of_traction: Field::new(cells),
            relative: vec![ZERO; cells],
            gel: Field::new(cells),
            contact: vec![false; cells],
            stick: vec![false; cells],
            slip_step: vec![ZERO; cells],
            slip: vec![ZERO; cells],
            slipped: vec![0.0; cells],
        })
    }

    /// Advances by one step to what is commanded. Refuses commands with negative forces or numbers that are not
    /// finite, and then changes nothing.
    pub fn step(&mut self, command: &Command) -> Result<&Truth, SettingError> {
        command.check()?;
        let before = self.truth;
        self.find_gap(command);
        self.foresee_pressure();
        self.press(command.grip);
        self.bound_friction(command);
        let (motion, held) = self.hold(command);
        self.displace();
        self.slide(motion);
        self.account(command, motion, held, &before);
        Ok(&self.truth)
    }

    /// Gap of every cell at zero depth without pressure: the object's height over each piece of gel where that
    /// piece is now, plus what the last tractions and creep add to the depth.
    fn find_gap(&mut self, command: &Command) {
        let place = self.place(command);
        for (i, gap) in self.gap.iter_mut().enumerate() {
            let (centre, skin) = place.of(self.at_rest[i] + self.relative[i]);
            *gap = self.shape.gap_mm(centre, skin) + self.of_traction.depth[i];
        }
        if let Some(GelApart { creep: Some(creep), crept, .. }) = &self.apart {
            for (gap, depth) in self.gap.iter_mut().zip(&crept.depth) {
                *gap += creep.keep * depth;
            }
        }
    }

    /// Where the object is, as the last step left it.
    fn place(&self, command: &Command) -> Place {
        let pose = self.truth.pose;
        let mounting = self.settings.shape_in_object;
        let (s, c) = (pose.turn_rad + mounting.turn_rad).sin_cos();
        let back = Complex64::new(c, -s);
        let (ps, pc) = pose.turn_rad.sin_cos();
        let origin = complex(pose.position_mm) + Complex64::new(pc, ps) * complex(mounting.position_mm);
        Place { back, origin, roll: back * complex(command.roll_mm) }
    }

    /// First guess of the pressure: it goes on as it went, in cells that keep some.
    fn foresee_pressure(&mut self) {
        for (pressure, before) in self.pressure.iter_mut().zip(&mut self.pressure_before) {
            let last = *pressure;
            let next = last * 2.0 - *before;
            if *before > 0.0 && last > 0.0 && next > 0.0 {
                *pressure = next;
            }
            *before = last;
        }
    }

    /// Pressure and what it does. The window around the last contact is tried first, then the whole grid.
    fn press(&mut self, grip: Grip) {
        let grid = self.settings.grid;
        let (stride, stop, area) = (grid.width_cells, self.settings.normal_stop, grid.cell_area_mm2());
        let whole = grid.whole();
        let mut window = self.window.map_or(whole, |w| w.grown(&grid, GROWTH_CELLS));
        loop {
            let response = self.interface.for_window(window);
            let pressed = self.normal.solve(response, window, stride, area, &self.gap, grip, stop, &mut self.pressure);
            let data = Region::around(&grid, |i| self.pressure[i] > 0.0);
            let field = &mut self.of_pressure;
            match data {
                Some(data) => self.interface.whole().all_of_pressure(
                    Area { window: whole, data },
                    stride,
                    &self.pressure,
                    &mut field.shift,
                    &mut field.depth,
                ),
                None => {
                    field.shift.fill(ZERO);
                    field.depth.fill(0.0);
                }
            }
            let peak = field.depth.iter().fold(0.0f64, |peak, depth| peak.max(depth.abs()));
            let floor = pressed.depth_mm - stop.tolerance_fraction * peak;
            let missed = (0..grid.cells_count()).any(|i| {
                self.pressure[i] == 0.0 && self.gap[i] + field.depth[i] < floor && !window.contains(i, stride)
            });
            // On the whole grid, what is left is the solver's own tolerance.
            if window == whole || (pressed.converged && !missed) {
                self.window = data;
                self.truth.depth_mm = pressed.depth_mm;
                self.truth.normal_iterations_count = pressed.iterations;
                self.truth.converged = pressed.converged;
                return;
            }
            window = whole;
        }
    }

    /// The contact, what pressure does in its plane, and what friction can carry in it. The slope is that of the gap
    /// that was found, the direction of friction that of the step before. A cell that has left the contact forgets its
    /// traction and slip.
    fn bound_friction(&mut self, command: &Command) {
        self.cells.clear();
        self.on_profile = ZERO;
        let friction = self.settings.friction;
        let place = self.place(command);
        let mut most = 0.0f64;
        for i in 0..self.pressure.len() {
            self.contact[i] = self.pressure[i] > 0.0;
            if self.contact[i] {
                self.cells.push(i as u32);
                let used = if self.bound[i] > 0.0 { (self.traction[i] - self.push[i]) / self.bound[i] } else { ZERO };
                let (centre, skin) = place.of(self.at_rest[i] + self.relative[i]);
                let slope = self.shape.slope(centre, skin);
                let by_profile = place.back.conj() * complex(slope.profile);
                self.slope[i] = by_profile + place.back.conj() * complex(slope.skin);
                self.push[i] = self.slope[i] * self.pressure[i];
                self.on_profile += by_profile * self.pressure[i];
                self.bound[i] =
                    friction.bound_on_slope_mpa(self.pressure[i], self.slipped[i], plane(self.slope[i]), plane(used));
                most = most.max(self.bound[i]);
            } else {
                self.bound[i] = 0.0;
                self.slope[i] = ZERO;
                self.push[i] = ZERO;
                self.traction[i] = ZERO;
                self.traction_before[i] = ZERO;
                self.slip[i] = ZERO;
                self.slip_step[i] = ZERO;
                self.slipped[i] = 0.0;
                self.stick[i] = false;
            }
        }
        if !self.give.is_empty() {
            for &i in &self.cells {
                let i = i as usize;
                // The rim, where the bound goes to 0, is kept from being infinitely soft.
                self.give[i] = friction.yield_mm / self.bound[i].max(0.01 * most);
            }
        }
    }

    /// Tractions, and the motion of the object.
    fn hold(&mut self, command: &Command) -> (Motion, Held) {
        let settings = &self.settings;
        let (pose, area) = (self.truth.pose, settings.grid.cell_area_mm2());
        let (free, resistance) = settings.body.step(
            pose,
            command.pose,
            command.wrench,
            self.velocity,
            settings.substep_s,
            area,
            self.on_profile,
        );
        let Some(window) = self.window else {
            return (free, Held { iterations: 0, converged: true, load: Motion::ZERO });
        };
        let origin = complex(pose.position_mm);
        let crept = match &self.apart {
            Some(GelApart { creep: Some(creep), crept, .. }) => Some((creep.keep, crept)),
            _ => None,
        };
        for &i in &self.cells {
            let i = i as usize;
            let (last, before) = (self.traction[i], self.traction_before[i]);
            self.traction[i] = last * 2.0 - before;
            self.traction_before[i] = last;
            self.lever[i] = self.at_rest[i] + self.relative[i] - origin;
            self.target[i] = self.anchor[i] + free.at(self.lever[i]) - self.of_pressure.shift[i];
            if !self.give.is_empty() {
                // Friction alone shears the interface.
                self.target[i] += self.push[i] * self.give[i];
            }
            if let Some((keep, crept)) = crept {
                self.target[i] -= crept.shift[i] * keep;
            }
        }
        let question = Question {
            window,
            stride: settings.grid.width_cells,
            cells: &self.cells,
            push: &self.push,
            bound: &self.bound,
            target: &self.target,
            lever: &self.lever,
            resistance,
            interface: &self.give,
            stiffness_mpa_per_mm: settings.gel.shear_modulus_mpa() / settings.grid.cell_mm,
            stop: settings.tangential_stop,
        };
        let held = self.tangential.solve(self.interface.for_window(window), &question, &mut self.traction);
        let back = resistance.map_or(Motion::ZERO, |r| r.retreat(held.load));
        (Motion { shift: free.shift - back.shift, turn: free.turn - back.turn }, held)
    }

    /// Displacement of the whole surface: of the gel, and relative to the object.
    fn displace(&mut self) {
        let grid = self.settings.grid;
        let (stride, whole) = (grid.width_cells, grid.whole());
        let Some(data) = self.window else {
            self.of_traction.shift.fill(ZERO);
            self.of_traction.depth.fill(0.0);
            self.relax(None);
            return;
        };
        let area = Area { window: whole, data };
        let field = &mut self.of_traction;
        self.interface.whole().all_of_traction(area, stride, &self.traction, &mut field.shift, &mut field.depth);
        self.relax(Some(area));
    }

    /// Puts the displacement together: pressure, traction, creep.
    fn relax(&mut self, area: Option<Area>) {
        let Finger { gel, relative, of_pressure, of_traction, .. } = self;
        for (i, relative) in relative.iter_mut().enumerate() {
            *relative = of_pressure.shift[i] + of_traction.shift[i];
            gel.shift[i] = *relative;
            gel.depth[i] = of_pressure.depth[i] + of_traction.depth[i];
        }
        let Some(GelApart { response, creep, crept }) = &mut self.apart else { return };
        if let Some(creep) = creep {
            for (relative, crept) in relative.iter_mut().zip(&crept.shift) {
                *relative += crept * creep.keep;
            }
        }
        // The gel's own immediate displacement; `target` and `gap` are free as scratch until the next step.
        gel.shift.fill(ZERO);
        gel.depth.fill(0.0);
        if let Some(area) = area {
            let stride = self.settings.grid.width_cells;
            response.all_of_pressure(area, stride, &self.pressure, &mut gel.shift, &mut gel.depth);
            response.all_of_traction(area, stride, &self.traction, &mut self.target, &mut self.gap);
            for i in 0..gel.depth.len() {
                gel.shift[i] += self.target[i];
                gel.depth[i] += self.gap[i];
            }
        }
        if let Some(creep) = creep {
            for i in 0..gel.depth.len() {
                crept.shift[i] = crept.shift[i] * creep.keep + gel.shift[i] * creep.gain;
                crept.depth[i] = crept.depth[i] * creep.keep + gel.depth[i] * creep.gain;
                gel.shift[i] += crept.shift[i];
                gel.depth[i] += crept.depth[i];
            }
        }
    }

    /// Who slid in this step, and how far.
    fn slide(&mut self, motion: Motion) {
        let (mut heat, mut done, mut most) = (0.0, 0.0, 0.0);
        let mut load = Motion::ZERO;
        for &i in &self.cells {
            let i = i as usize;
            let q = self.traction[i] - self.push[i];
            load.add(self.lever[i], q);
            let give = if self.give.is_empty() { 0.0 } else { self.give[i] };
            let way = motion.at(self.lever[i]);
            done += q.re * way.re + q.im * way.im;
            most += self.bound[i] * way.norm();
            let held = self.anchor[i] + way;
            let reached = self.relative[i] + q * give;
            let slip = held - reached; // of the object over the gel
            let work = q.re * slip.re + q.im * slip.im;
            let slides = work > 0.0 && q.norm_sqr() >= (1.0 - 1e-9) * self.bound[i] * self.bound[i];
            self.stick[i] = !slides;
            self.anchor[i] = if slides { reached } else { held };
            self.slip_step[i] = if slides { slip } else { ZERO };
            if slides {
                self.slip[i] += slip;
                self.slipped[i] += slip.norm();
                heat += work;
            }
        }
        for i in 0..self.contact.len() {
            if !self.contact[i] {
                self.anchor[i] = self.relative[i];
            }
        }
        let area = self.settings.grid.cell_area_mm2();
        self.truth.dissipated_n_mm = heat * area;
        self.truth.friction_used_fraction = (most > 0.0).then(|| done / most);
        self.truth.friction = load.wrench(area);
        self.truth.on_profile_n = plane(self.on_profile * area);
    }

    /// The numbers of the step.
    fn account(&mut self, command: &Command, motion: Motion, held: Held, before: &Truth) {
        let grid = self.settings.grid;
        let area = grid.cell_area_mm2();
        self.velocity =
            Motion { shift: motion.shift / self.settings.substep_s, turn: motion.turn / self.settings.substep_s };
        let truth = &mut self.truth;
        truth.time_s += self.settings.substep_s;
        truth.pose.position_mm += Vec2::new(motion.shift.re, motion.shift.im);
        truth.pose.turn_rad += motion.turn;
        if self.settings.body.drive == super::body::Drive::Guided {
            truth.pose = command.pose;
        }
        truth.grip_force_n = self.cells.iter().map(|&i| self.pressure[i as usize]).sum::<f64>() * area;
        truth.wrench = held.load.wrench(area);
        let stuck = self.cells.iter().filter(|&&i| self.stick[i as usize]).count();
        truth.contact_cells_count = self.cells.len() as u32;
        truth.contact_area_mm2 = self.cells.len() as f64 * area;
        truth.stick_ratio = (!self.cells.is_empty()).then(|| stuck as f64 / self.cells.len() as f64);
        truth.peak_pressure_mpa = self.pressure.iter().fold(0.0, |peak, &p| peak.max(p));
        let gel = self.settings.gel;
        truth.largest_strain_fraction = largest_gradient(
            &grid,
            gel.shear_modulus_mpa(),
            gel.poisson_ratio,
            &self.gel.shift,
            &self.gel.depth,
            &self.traction,
            &self.pressure,
        );
        truth.beyond_linear = truth.largest_strain_fraction > LINEAR_STRAIN;
        truth.at_border = self.window.is_some_and(|w| {
            w.column == 0
                || w.row == 0
                || w.column + w.width_cells == grid.width_cells
                || w.row + w.height_cells == grid.height_cells
        });
        truth.events = Events::between(before, truth);
        truth.tangential_iterations_count = held.iterations;
        truth.converged &= held.converged;
    }
}
