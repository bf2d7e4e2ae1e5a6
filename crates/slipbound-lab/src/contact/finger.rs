//! One finger and one object, stepped in time.

use super::body::{Body, Motion, Pose, Wrench, complex};
use super::friction::Friction;
use super::grid::{Grid, Region};
use super::normal::{Grip, Normal, Stop};
use super::response::{Response, Responses};
use super::shape::Shape;
use super::strain::largest_gradient;
use super::tangential::{Held, Question, Tangential};
use super::transform::{Area, Planner};
use super::truth::{Displacement, Events, LINEAR_STRAIN, Truth};
use crate::layer::{Compliance, Gel, SoftObject, above_zero};
use rustfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};
use slipbound::plane::Vec2;
use slipbound::sensor::SettingError;
use std::sync::Arc;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Cells around the last contact on which the next one is first looked for.
const GROWTH_CELLS: usize = 3;

/// Everything that is fixed during a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FingerSettings {
    /// Cells of the gel.
    pub grid: Grid,
    /// The gel.
    pub gel: Gel,
    /// Softness of the object; None for a rigid one.
    pub soft_object: Option<SoftObject>,
    /// Friction between them.
    pub friction: Friction,
    /// How the object moves.
    pub body: Body,
    /// Where the shape sits in the object's frame, whose pose is commanded.
    pub shape_in_object: Pose,
    /// Length of a step in s, above 0. 1/120 is four steps a frame at 30 Hz: as dear as one long step, and finer.
    pub substep_s: f64,
    /// When the normal solver stops.
    pub normal_stop: Stop,
    /// When the tangential solver stops.
    pub tangential_stop: Stop,
    /// Which transforms are used.
    pub planner: Planner,
}

impl FingerSettings {
    /// The standard grid, a rigid guided object, friction 0.8, 4 steps a frame.
    pub fn standard() -> Self {
        FingerSettings {
            grid: Grid::standard(),
            gel: Gel::default(),
            soft_object: None,
            friction: Friction::constant(0.8),
            body: Body::default(),
            shape_in_object: Pose::default(),
            substep_s: 1.0 / 120.0,
            normal_stop: Stop { tolerance_fraction: 1e-4, most_iterations_count: 200 },
            tangential_stop: Stop { tolerance_fraction: 3e-4, most_iterations_count: 400 },
            planner: Planner::Fastest,
        }
    }

    /// The same on the fast grid.
    pub fn fast() -> Self {
        FingerSettings { grid: Grid::fast(), ..Self::standard() }
    }

    /// Refuses numbers outside the ranges of the fields.
    pub fn check(&self) -> Result<(), SettingError> {
        self.grid.check()?;
        self.gel.check()?;
        if let Some(soft) = &self.soft_object {
            soft.check()?;
        }
        self.friction.check()?;
        self.body.check()?;
        check_pose("shape_in_object", &self.shape_in_object)?;
        above_zero("substep_s", self.substep_s)?;
        for (name, stop) in [("normal_stop", self.normal_stop), ("tangential_stop", self.tangential_stop)] {
            if !(1e-14..=0.1).contains(&stop.tolerance_fraction) {
                return Err(SettingError {
                    key: format!("{name}.tolerance_fraction"),
                    got: stop.tolerance_fraction.to_string(),
                    expected: "a number from 1e-14 to 0.1".into(),
                });
            }
            if stop.most_iterations_count == 0 {
                return Err(SettingError {
                    key: format!("{name}.most_iterations_count"),
                    got: "0".into(),
                    expected: "1 or more".into(),
                });
            }
        }
        Ok(())
    }

    /// Refuses a shape that does not fit on the gel.
    fn check_size(&self, half: Vec2) -> Result<(), SettingError> {
        let (s, c) = self.shape_in_object.turn_rad.sin_cos();
        let at = self.shape_in_object.position_mm;
        let reach = Vec2::new(
            at.x.abs() + (c * half.x).abs() + (s * half.y).abs(),
            at.y.abs() + (s * half.x).abs() + (c * half.y).abs(),
        );
        let room = self.grid.half_size_mm() - Vec2::new(self.grid.cell_mm, self.grid.cell_mm);
        if reach.x <= room.x && reach.y <= room.y {
            return Ok(());
        }
        Err(SettingError {
            key: "shape".into(),
            got: format!("an object of {:.2} x {:.2} mm about the middle of the pad", 2.0 * reach.x, 2.0 * reach.y),
            expected: format!("at most {:.2} x {:.2} mm, the pad less a cell all round", 2.0 * room.x, 2.0 * room.y),
        })
    }
}

fn check_pose(key: &str, pose: &Pose) -> Result<(), SettingError> {
    if pose.position_mm.is_finite() && pose.turn_rad.is_finite() {
        return Ok(());
    }
    Err(SettingError { key: key.into(), got: format!("{pose:?}"), expected: "finite numbers".into() })
}

/// What is asked of the object at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
    /// What holds it against the gel.
    pub grip: Grip,
    /// Where a guided object is, or the hand of a mounted one.
    pub pose: Pose,
    /// How far it has rolled: its lowest point is this far from its reference point, in mm.
    pub roll_mm: Vec2,
    /// External load on an object that is free or mounted, about its reference point.
    pub wrench: Wrench,
}

impl Command {
    /// Refuses negative forces and numbers that are not finite.
    pub fn check(&self) -> Result<(), SettingError> {
        self.grip.check()?;
        check_pose("command.pose", &self.pose)?;
        if self.roll_mm.is_finite() && self.wrench.force_n.is_finite() && self.wrench.torque_n_mm.is_finite() {
            return Ok(());
        }
        Err(SettingError {
            key: "command.roll_mm, command.wrench".into(),
            got: format!("{:?}, {:?}", self.roll_mm, self.wrench),
            expected: "finite numbers".into(),
        })
    }
}

/// In-plane and normal parts of a displacement field.
#[derive(Debug, Clone)]
struct Field {
    shift: Vec<Complex64>,
    depth: Vec<f64>,
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
    settings: FingerSettings,
    shape: Arc<dyn Shape>,
    at_rest: Vec<Complex64>,
    interface: Responses,
    apart: Option<GelApart>,
    normal: Normal,
    tangential: Tangential,
    truth: Truth,
    velocity: Motion,
    window: Option<Region>,
    cells: Vec<u32>,
    gap: Vec<f64>,
    pressure: Vec<f64>,
    traction: Vec<Complex64>,
    /// Traction of the step before the last: loads mostly go on as they went.
    traction_before: Vec<Complex64>,
    bound: Vec<f64>,
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
    gel: Field,
    contact: Vec<bool>,
    stick: Vec<bool>,
    slip_step: Vec<Complex64>,
    slip: Vec<Complex64>,
    slipped: Vec<f64>,
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
            traction: vec![ZERO; cells],
            traction_before: vec![ZERO; cells],
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
        let before = self.truth.stick_ratio;
        self.find_gap(command);
        self.press(command.grip);
        self.bound_friction();
        let (motion, held) = self.hold(command);
        self.displace();
        self.slide(motion);
        self.account(command, motion, held, before);
        Ok(&self.truth)
    }

    /// Gap of every cell at zero depth without pressure: the object's height over each piece of gel where that
    /// piece is now, plus what the last tractions and creep add to the depth.
    fn find_gap(&mut self, command: &Command) {
        let pose = self.truth.pose;
        let mounting = self.settings.shape_in_object;
        let (s, c) = (pose.turn_rad + mounting.turn_rad).sin_cos();
        let back = Complex64::new(c, -s);
        let (ps, pc) = pose.turn_rad.sin_cos();
        let origin = complex(pose.position_mm) + Complex64::new(pc, ps) * complex(mounting.position_mm);
        let roll = back * complex(command.roll_mm);
        for (i, gap) in self.gap.iter_mut().enumerate() {
            let skin = back * (self.at_rest[i] + self.relative[i] - origin);
            let centre = skin - roll;
            *gap = self.shape.gap_mm(Vec2::new(centre.re, centre.im), Vec2::new(skin.re, skin.im))
                + self.of_traction.depth[i];
        }
        if let Some(GelApart { creep: Some(creep), crept, .. }) = &self.apart {
            for (gap, depth) in self.gap.iter_mut().zip(&crept.depth) {
                *gap += creep.keep * depth;
            }
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

    /// The contact, and what friction can carry in it. A cell that has left it forgets its traction and slip.
    fn bound_friction(&mut self) {
        self.cells.clear();
        let friction = self.settings.friction;
        let mut most = 0.0f64;
        for i in 0..self.pressure.len() {
            self.contact[i] = self.pressure[i] > 0.0;
            if self.contact[i] {
                self.cells.push(i as u32);
                self.bound[i] = friction.bound_mpa(self.pressure[i], self.slipped[i]);
                most = most.max(self.bound[i]);
            } else {
                self.bound[i] = 0.0;
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
        let (free, resistance) =
            settings.body.step(pose, command.pose, command.wrench, self.velocity, settings.substep_s, area);
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
            if let Some((keep, crept)) = crept {
                self.target[i] -= crept.shift[i] * keep;
            }
        }
        let question = Question {
            window,
            stride: settings.grid.width_cells,
            cells: &self.cells,
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
        let mut heat = 0.0;
        for &i in &self.cells {
            let i = i as usize;
            let q = self.traction[i];
            let give = if self.give.is_empty() { 0.0 } else { self.give[i] };
            let held = self.anchor[i] + motion.at(self.lever[i]);
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
        self.truth.dissipated_n_mm = heat * self.settings.grid.cell_area_mm2();
    }

    /// The numbers of the step.
    fn account(&mut self, command: &Command, motion: Motion, held: Held, before: Option<f64>) {
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
        truth.wrench = Wrench {
            force_n: Vec2::new(held.load.shift.re, held.load.shift.im) * area,
            torque_n_mm: held.load.turn * area,
        };
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
        truth.events = Events::between(before, truth.stick_ratio);
        truth.tangential_iterations_count = held.iterations;
        truth.converged &= held.converged;
    }

    /// What is known after the last step.
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// The settings.
    pub fn settings(&self) -> &FingerSettings {
        &self.settings
    }

    /// Changes the body during a run (a bottle that fills). Refuses numbers outside their ranges.
    pub fn set_body(&mut self, body: Body) -> Result<(), SettingError> {
        body.check()?;
        self.settings.body = body;
        Ok(())
    }

    /// Pressure of every cell in MPa, 0 or above, row by row.
    pub fn pressure_mpa(&self) -> &[f64] {
        &self.pressure
    }

    /// Largest traction friction could carry in every cell in MPa, row by row.
    pub fn bound_mpa(&self) -> &[f64] {
        &self.bound
    }

    /// Which cells are under pressure, row by row.
    pub fn contact(&self) -> &[bool] {
        &self.contact
    }

    /// Which cells are under pressure and did not slide in the last step, row by row.
    pub fn stick(&self) -> &[bool] {
        &self.stick
    }

    /// In-plane traction of the object on a cell of the gel, in MPa.
    pub fn traction_mpa(&self, cell: usize) -> Vec2 {
        plane(self.traction[cell])
    }

    /// How far the object slid over a cell in the last step, in mm.
    pub fn slip_step_mm(&self, cell: usize) -> Vec2 {
        plane(self.slip_step[cell])
    }

    /// How far the object has slid over a cell since it came into contact, in mm, as a vector.
    pub fn slip_mm(&self, cell: usize) -> Vec2 {
        plane(self.slip[cell])
    }

    /// Length of the way the object has slid over a cell since it came into contact, in mm.
    pub fn slipped_mm(&self, cell: usize) -> f64 {
        self.slipped[cell]
    }

    /// Displacement of a cell of the gel.
    pub fn displacement(&self, cell: usize) -> Displacement {
        Displacement { shift_mm: plane(self.gel.shift[cell]), depth_mm: self.gel.depth[cell] }
    }

    /// Displacement of the piece of gel that lies at `rest_mm` when nothing touches it, bilinear between the middles
    /// of cells; beyond the outermost ones, theirs.
    pub fn displacement_at(&self, rest_mm: Vec2) -> Displacement {
        let grid = &self.settings.grid;
        let place = |at_mm: f64, half_mm: f64, cells: usize| {
            let at = ((at_mm + half_mm) / grid.cell_mm - 0.5).clamp(0.0, (cells - 1) as f64);
            let low = (at as usize).min(cells - 2);
            (low, at - low as f64)
        };
        let half = grid.half_size_mm();
        let (column, fx) = place(rest_mm.x, half.x, grid.width_cells);
        let (row, fy) = place(rest_mm.y, half.y, grid.height_cells);
        let corner = row * grid.width_cells + column;
        let (mut shift, mut depth_mm) = (ZERO, 0.0);
        for (cell, share) in [
            (corner, (1.0 - fx) * (1.0 - fy)),
            (corner + 1, fx * (1.0 - fy)),
            (corner + grid.width_cells, (1.0 - fx) * fy),
            (corner + grid.width_cells + 1, fx * fy),
        ] {
            shift += self.gel.shift[cell] * share;
            depth_mm += self.gel.depth[cell] * share;
        }
        Displacement { shift_mm: plane(shift), depth_mm }
    }
}

fn plane(z: Complex64) -> Vec2 {
    Vec2::new(z.re, z.im)
}
