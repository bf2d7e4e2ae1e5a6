//! One increment of a step of a finger: gap, pressure, friction bounds, tractions, displacement, slip.

use super::body::{Drive, Motion, Resistance, complex, length, plane};
use super::finger::{Finger, GelApart, Increment};
use super::grid::Region;
use super::normal::{Grip, NormalProblem};
use super::settings::Command;
use super::strain::largest_gradient;
use super::tangential::{OneSurface, TangentialProblem, TangentialSolution};
use super::transform::Area;
use super::truth::LINEAR_STRAIN;
use num_complex::Complex64;
use slipbound::plane::Vec2;

/// Margin in cells around the last contact in which the next contact is searched for first.
const GROWTH_CELLS: usize = 3;

/// Cells whose gap is computed at a time.
const CHUNK_CELLS: usize = 64;

/// Pose of an object on the gel.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// From the gel's axes to the object's.
    back: Complex64,
    origin: Complex64,
    roll: Complex64,
}

impl Place {
    /// Position of a point of the gel relative to the object's lowest point, and on its skin, in the object's axes.
    #[inline(always)]
    fn of(&self, at: Complex64) -> (Vec2, Vec2) {
        let skin = self.back * (at - self.origin);
        (plane(skin - self.roll), plane(skin))
    }
}

impl Finger {
    /// Advances by a part of a step.
    pub(super) fn advance(&mut self, command: &Command, increment: Increment) {
        self.touch(command, increment);
        let (motion, solution) = self.hold(command, increment);
        self.follow(command, motion, solution, increment);
    }

    /// Gap, pressure and friction bounds at the object's pose after the last increment.
    pub(super) fn touch(&mut self, command: &Command, increment: Increment) {
        self.find_gap(command);
        self.foresee_pressure();
        self.press(command.grip);
        self.bound_friction(command, increment);
    }

    /// Displacement, slip and numbers once tractions and motion are known. Returns the work of friction on the motion,
    /// and the largest possible work, per cell area.
    pub(super) fn follow(
        &mut self,
        command: &Command,
        motion: Motion,
        solution: TangentialSolution,
        increment: Increment,
    ) -> (f64, f64) {
        self.displace(increment.last);
        let used = self.slide(motion);
        self.account(command, motion, solution, increment);
        used
    }

    /// Gap of every cell at zero depth without pressure: the object's height over each piece of gel at the present
    /// position of that piece, plus the contributions of the gel's rounded edge, the last tractions and creep to the
    /// depth.
    fn find_gap(&mut self, command: &Command) {
        let place = self.place(command);
        let mut points = [(Vec2::ZERO, Vec2::ZERO); CHUNK_CELLS];
        let cells = self.at_rest.chunks(CHUNK_CELLS).zip(self.relative.chunks(CHUNK_CELLS));
        let gaps = self.gap.chunks_mut(CHUNK_CELLS).zip(self.of_traction.depth.chunks(CHUNK_CELLS));
        for ((at_rest, relative), (gap, depth)) in cells.zip(gaps) {
            for (point, (at_rest, relative)) in points.iter_mut().zip(at_rest.iter().zip(relative)) {
                *point = place.of(at_rest + relative);
            }
            self.shape.gaps_mm(&points[..gap.len()], gap);
            gap.iter_mut().zip(depth).for_each(|(gap, depth)| *gap += depth);
        }
        self.gap.iter_mut().zip(&self.below).for_each(|(gap, below)| *gap += below);
        if let Some(GelApart { creep: Some(creep), crept, .. }) = &self.apart {
            for (gap, depth) in self.gap.iter_mut().zip(&crept.depth) {
                *gap += creep.keep * depth;
            }
        }
    }

    /// Pose of the object after the last increment.
    fn place(&self, command: &Command) -> Place {
        let pose = self.truth.pose;
        let mounting = self.settings.shape_in_object;
        let (s, c) = libm::sincos(pose.turn_rad + mounting.turn_rad);
        let back = Complex64::new(c, -s);
        let (ps, pc) = libm::sincos(pose.turn_rad);
        let origin = complex(pose.position_mm) + Complex64::new(pc, ps) * complex(mounting.position_mm);
        Place { back, origin, roll: back * complex(command.roll_mm) }
    }

    /// First guess of the pressure: extrapolated, in cells that keep some.
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

    /// Pressure and its effects. The window around the last contact is tried first, then the whole grid.
    fn press(&mut self, grip: Grip) {
        let grid = self.settings.grid;
        let (stride, stop) = (grid.width_cells, self.settings.normal_stop);
        let whole = grid.whole();
        let mut window = self.window.map_or(whole, |w| w.grown(&grid, GROWTH_CELLS));
        loop {
            let response = self.interface.for_window(window);
            let problem =
                NormalProblem { window, stride, cell_area_mm2: grid.cell_area_mm2(), gap: &self.gap, grip, stop };
            let pressed = self.normal.solve(response, &problem, &mut self.pressure);
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
                    field.shift.fill(Complex64::ZERO);
                    field.depth.fill(0.0);
                }
            }
            let peak = field.depth.iter().fold(0.0f64, |peak, depth| peak.max(depth.abs()));
            let floor = pressed.depth_mm - stop.tolerance_fraction * peak;
            let missed = (0..grid.cells_count()).any(|i| {
                self.pressure[i] == 0.0 && self.gap[i] + field.depth[i] < floor && !window.contains(i, stride)
            });
            // On the whole grid the remaining error is the solver's own tolerance.
            if window == whole || (pressed.converged && !missed) {
                self.window = data;
                self.truth.depth_mm = pressed.depth_mm;
                self.truth.normal_iterations_count += pressed.iterations;
                self.truth.converged &= pressed.converged;
                return;
            }
            window = whole;
        }
    }

    /// The contact, the in-plane traction of its pressure, and its friction bounds. The slope is that of the gap just
    /// found, the direction of friction that of the step before. A cell that has left the contact loses its traction
    /// and slip.
    fn bound_friction(&mut self, command: &Command, increment: Increment) {
        self.cells.clear();
        self.on_profile = Complex64::ZERO;
        let friction = self.settings.friction;
        let place = self.place(command);
        let mut most = 0.0f64;
        for i in 0..self.pressure.len() {
            let touched = std::mem::replace(&mut self.contact[i], self.pressure[i] > 0.0);
            if self.contact[i] {
                if increment.first || !touched {
                    self.stick[i] = true;
                }
                self.cells.push(i as u32);
                let used = if self.bound[i] > 0.0 {
                    (self.traction[i] - self.push[i]) / self.bound[i]
                } else {
                    Complex64::ZERO
                };
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
                self.slope[i] = Complex64::ZERO;
                self.push[i] = Complex64::ZERO;
                self.traction[i] = Complex64::ZERO;
                self.traction_before[i] = Complex64::ZERO;
                self.slip[i] = Complex64::ZERO;
                self.slipped[i] = 0.0;
                self.stick[i] = false;
            }
        }
        if !self.compliance.is_empty() {
            for &i in &self.cells {
                let i = i as usize;
                // At the rim, where the bound goes to 0, this keeps the compliance finite.
                self.compliance[i] = friction.yield_mm / self.bound[i].max(0.01 * most);
            }
        }
    }

    /// The motion of the object without tractions, and its compliance to them. `on_profile` is the sum of the in-plane
    /// traction of the pressure on the profile, over the fingers that are computed.
    pub(super) fn free_motion(
        &self,
        command: &Command,
        increment: Increment,
        on_profile: Complex64,
    ) -> (Motion, Option<Resistance>) {
        let settings = &self.settings;
        let (pose, area) = (self.truth.pose, settings.grid.cell_area_mm2());
        let step_s = match settings.body.drive {
            Drive::Railed(_) => settings.substep_s,
            _ => settings.substep_s / f64::from(increment.of_count),
        };
        settings.body.step((pose, command.pose), command.wrench, self.velocity, step_s, area, on_profile)
    }

    /// First guess of the tractions by extrapolation; stick position of every cell if the object moves by `free`.
    pub(super) fn aim(&mut self, free: Motion) {
        let origin = complex(self.truth.pose.position_mm);
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
            if !self.compliance.is_empty() {
                // Only friction shears the interface.
                self.target[i] += self.push[i] * self.compliance[i];
            }
            if let Some((keep, crept)) = crept {
                self.target[i] -= crept.shift[i] * keep;
            }
        }
    }

    /// Tractions, and the motion of the object.
    fn hold(&mut self, command: &Command, increment: Increment) -> (Motion, TangentialSolution) {
        let (free, resistance) = self.free_motion(command, increment, self.on_profile);
        let Some(window) = self.window else { return (free, TangentialSolution::nothing()) };
        self.aim(free);
        let settings = &self.settings;
        let problem = TangentialProblem {
            cells: &self.cells,
            push: &self.push,
            bound: &self.bound,
            target: &self.target,
            lever: &self.lever,
            resistance,
            interface: &self.compliance,
            stiffness_mpa_per_mm: settings.gel.shear_modulus_mpa() / settings.grid.cell_mm,
            stop: settings.tangential_stop,
        };
        let (response, stride) = (self.interface.for_window(window), settings.grid.width_cells);
        let mut surface = OneSurface { response, window, stride };
        let solution = self.tangential.solve(&mut surface, &problem, &mut self.traction);
        let back = resistance.map_or(Motion::ZERO, |r| r.retreat(solution.load));
        (Motion { shift: free.shift - back.shift, turn: free.turn - back.turn }, solution)
    }

    /// Displacement of the whole surface: of the gel, and relative to the object.
    fn displace(&mut self, last: bool) {
        let grid = self.settings.grid;
        let (stride, whole) = (grid.width_cells, grid.whole());
        let Some(data) = self.window else {
            self.of_traction.shift.fill(Complex64::ZERO);
            self.of_traction.depth.fill(0.0);
            self.relax(None, last);
            return;
        };
        let area = Area { window: whole, data };
        let field = &mut self.of_traction;
        self.interface.whole().all_of_traction(area, stride, &self.traction, &mut field.shift, &mut field.depth);
        self.relax(Some(area), last);
    }

    /// Adds up the displacement: pressure, traction, creep.
    fn relax(&mut self, area: Option<Area>, last: bool) {
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
        if !last {
            return; // creep, and the gel's visible displacement, are those of the whole step
        }
        // The gel's own immediate displacement; `target` and `gap` serve as scratch until the next step.
        gel.shift.fill(Complex64::ZERO);
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

    /// Which cells slid in this step, and how far. Returns the work of friction on the motion and the largest possible
    /// work, both per cell area.
    fn slide(&mut self, motion: Motion) -> (f64, f64) {
        let (mut heat, mut done, mut most, mut reach) = (0.0, 0.0, 0.0, 0.0f64);
        let mut load = Motion::ZERO;
        for &i in &self.cells {
            let i = i as usize;
            let q = self.traction[i] - self.push[i];
            load.add(self.lever[i], q);
            let compliance = if self.compliance.is_empty() { 0.0 } else { self.compliance[i] };
            reach = reach.max(self.lever[i].norm_sqr());
            let way = motion.at(self.lever[i]);
            done += q.re * way.re + q.im * way.im;
            most += self.bound[i] * length(way);
            let held = self.anchor[i] + way;
            let reached = self.relative[i] + q * compliance;
            let slip = held - reached; // of the object over the gel
            let work = q.re * slip.re + q.im * slip.im;
            let slides = work > 0.0 && q.norm_sqr() >= (1.0 - 1e-9) * self.bound[i] * self.bound[i];
            self.anchor[i] = if slides { reached } else { held };
            if slides {
                self.stick[i] = false;
                self.slip[i] += slip;
                self.slipped[i] += length(slip);
                heat += work;
            }
        }
        for i in 0..self.contact.len() {
            if !self.contact[i] {
                self.anchor[i] = self.relative[i];
            }
        }
        let area = self.settings.grid.cell_area_mm2();
        self.truth.dissipated_n_mm += heat * area;
        self.reach_mm = reach.sqrt();
        self.truth.friction_used_fraction = (most > 0.0).then(|| done / most);
        self.truth.friction = load.wrench(area);
        self.truth.on_profile_n = plane(self.on_profile * area);
        (done, most)
    }

    /// The numbers of an increment.
    fn account(&mut self, command: &Command, motion: Motion, solution: TangentialSolution, increment: Increment) {
        let step_s = self.settings.substep_s / f64::from(increment.of_count);
        self.velocity = Motion { shift: motion.shift / step_s, turn: motion.turn / step_s };
        let area = self.settings.grid.cell_area_mm2();
        let truth = &mut self.truth;
        truth.pose.position_mm += Vec2::new(motion.shift.re, motion.shift.im);
        truth.pose.turn_rad += motion.turn;
        if self.settings.body.drive == super::body::Drive::Guided {
            truth.pose = command.pose;
        }
        truth.grip_force_n = self.cells.iter().map(|&i| self.pressure[i as usize]).sum::<f64>() * area;
        truth.wrench = solution.load.wrench(area);
        truth.tangential_iterations_count += solution.iterations;
        truth.converged &= solution.converged;
        if increment.last {
            self.account_cells();
        }
    }

    /// Sums over the cells at the end of a step.
    fn account_cells(&mut self) {
        let grid = self.settings.grid;
        let area = grid.cell_area_mm2();
        let at_border = self.is_at_border();
        let truth = &mut self.truth;
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
        truth.at_border = at_border;
    }
}
