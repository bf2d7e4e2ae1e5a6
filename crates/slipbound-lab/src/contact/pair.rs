//! Two different fingers that hold one object between them.
//!
//! ```text
//!   left:  gap, pressure, bounds --.                                    .--> displacement, slip, truth
//!                                  +--> one tangential problem, one body
//!   right: gap, pressure, bounds --'    over the cells of both pads     '--> displacement, slip, truth
//! ```
//!
//! The jaws close with one force, so both pads carry the same normal force. In the plane they share the motion of the
//! object, and their total load on it balances its external load and its inertia: the solution determines the share of
//! each pad. This is the same convex problem as for one finger (see `tangential`), over the contact cells of both.
//!
//! The right pad is computed in axes in which it would equal the left one if both were identical; its results are in
//! these axes. They may be rotated in the plane of the left finger, if a pad is not mounted straight.

use super::body::{Body, Motion, Wrench, complex, plane, rotation};
use super::finger::{Finger, Increment};
use super::settings::{Command, FingerSettings};
use super::shape::Shape;
use super::tangential::{OneSurface, Surface, Tangential, TangentialProblem, TangentialSolution};
use super::truth::{Events, Truth};
use num_complex::Complex64;
use slipbound::plane::Vec2;
use slipbound::setting::SettingError;

/// Two fingers that hold one object; 0 is the left one.
#[derive(Debug, Clone)]
pub struct FingerPair {
    fingers: [Finger; 2],
    /// Rotation of the right pad relative to the left one, in rad, and as a unit complex number.
    turn_rad: f64,
    turned: Complex64,
    tangential: Tangential,
    joint: Joint,
    truth: Truth,
}

/// The data of both fingers in the axes of the left one, its cells first.
#[derive(Debug, Clone)]
struct Joint {
    cells: Vec<u32>,
    push: Vec<Complex64>,
    bound: Vec<f64>,
    target: Vec<Complex64>,
    lever: Vec<Complex64>,
    /// Empty if friction has none.
    compliance: Vec<f64>,
    traction: Vec<Complex64>,
    /// The tractions on the right pad in its own axes.
    right: Vec<Complex64>,
}

/// The surfaces of both gels; None for a gel without contact.
struct BothSurfaces<'a> {
    left: Option<OneSurface<'a>>,
    right: Option<OneSurface<'a>>,
    turned: Complex64,
    scratch: &'a mut [Complex64],
}

impl Surface for BothSurfaces<'_> {
    fn shift_of_traction(&mut self, traction: &[Complex64], shift: &mut [Complex64]) {
        let count = self.scratch.len();
        let (left, right) = shift.split_at_mut(count);
        if let Some(surface) = &mut self.left {
            surface.shift_of_traction(&traction[..count], left);
        }
        if let Some(surface) = &mut self.right {
            let back = self.turned.conj();
            self.scratch.iter_mut().zip(&traction[count..]).for_each(|(own, q)| *own = q * back);
            surface.shift_of_traction(self.scratch, right);
            right.iter_mut().for_each(|shift| *shift *= self.turned);
        }
    }
}

impl FingerPair {
    /// Two fingers at rest with an object above them: the settings of the left and the right one, which may differ only
    /// in gel and friction, and the rotation of the right pad about the closing direction relative to the left one, in
    /// rad. Refuses invalid settings of either finger.
    pub fn new(
        settings: [FingerSettings; 2],
        turn_rad: f64,
        shape: impl Shape + Clone + 'static,
    ) -> Result<Self, SettingError> {
        let [left, right] = settings;
        if left.grid != right.grid || left.substep_s != right.substep_s {
            return Err(SettingError {
                key: "fingers".into(),
                got: "two grids or lengths of a step".into(),
                expected: "one for both".into(),
            });
        }
        let fingers = [Finger::new(left, shape.clone())?, Finger::new(right, shape)?];
        let cells = left.grid.cells_count();
        let is_compliant = fingers.iter().any(|finger| !finger.compliance.is_empty());
        Ok(FingerPair {
            turn_rad,
            turned: rotation(turn_rad),
            tangential: Tangential::new(2 * cells),
            joint: Joint {
                cells: Vec::with_capacity(2 * cells),
                push: vec![Complex64::ZERO; 2 * cells],
                bound: vec![0.0; 2 * cells],
                target: vec![Complex64::ZERO; 2 * cells],
                lever: vec![Complex64::ZERO; 2 * cells],
                compliance: vec![0.0; if is_compliant { 2 * cells } else { 0 }],
                traction: vec![Complex64::ZERO; 2 * cells],
                right: vec![Complex64::ZERO; cells],
            },
            truth: Truth::default(),
            fingers,
        })
    }

    /// A finger: 0 left, 1 right; a larger index gives the right one.
    pub fn finger(&self, finger: usize) -> &Finger {
        &self.fingers[finger.min(1)]
    }

    /// Ground truth of both fingers after the last step, in the form of one of two identical fingers: in the axes of
    /// the left finger, forces and areas as the mean per finger, ratios of both together, the largest pressure and
    /// strain of either. Gross slip means that both slide.
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// Rotation of the right pad relative to the left one, in rad.
    pub fn turn_rad(&self) -> f64 {
        self.turn_rad
    }

    /// Changes the body that both hold; its number of fingers is ignored. Refuses numbers outside their ranges.
    pub fn set_body(&mut self, body: Body) -> Result<(), SettingError> {
        // The loads of both are added up, each counted once.
        let body = Body { fingers_count: 1, ..body };
        self.fingers.iter_mut().try_for_each(|finger| finger.set_body(body))
    }

    /// Advances by one step to the command, in the axes of the left finger. Fails as [`Finger::step`] does.
    pub fn step(&mut self, command: &Command) -> Result<&Truth, SettingError> {
        command.check()?;
        let commands = [*command, self.to_right(command)];
        let before = self.truth;
        let began = [0, 1].map(|i| self.fingers[i].begin_step());
        let from = [0, 1].map(|i| self.fingers[i].begun(&commands[i]));
        let counts = [0, 1].map(|i| self.fingers[i].increments_count(&commands[i]));
        let count = counts[0].max(counts[1]);
        let mut used = (0.0, 0.0);
        for n in 1..=count {
            let now = [0, 1].map(|i| from[i].part(&commands[i], n, count));
            used = self.advance(&now, Increment { of_count: count, first: n == 1, last: n == count });
        }
        for ((finger, command), before) in self.fingers.iter_mut().zip(&commands).zip(&began) {
            finger.end_step(command, before);
        }
        self.account(used);
        self.truth.events = Events::between(&before, &self.truth);
        Ok(&self.truth)
    }

    /// Work of friction on the motion of the object, and the largest possible work.
    fn advance(&mut self, commands: &[Command; 2], increment: Increment) -> (f64, f64) {
        for (finger, command) in self.fingers.iter_mut().zip(commands) {
            finger.touch(command, increment);
        }
        let [left, right] = &mut self.fingers;
        let on_profile = left.on_profile + right.on_profile * self.turned;
        let (free, resistance) = left.free_motion(&commands[0], increment, on_profile);
        left.aim(free);
        right.aim(turned(free, self.turned.conj()));
        self.joint.gather([&*left, &*right], self.turned);
        let joint = &mut self.joint;
        let (stiff, settings) = (|f: &Finger| f.settings.gel.shear_modulus_mpa(), left.settings);
        let problem = TangentialProblem {
            cells: &joint.cells,
            push: &joint.push,
            bound: &joint.bound,
            target: &joint.target,
            lever: &joint.lever,
            resistance,
            interface: &joint.compliance,
            stiffness_mpa_per_mm: stiff(left).max(stiff(right)) / settings.grid.cell_mm,
            stop: settings.tangential_stop,
        };
        let solution = if problem.cells.is_empty() {
            TangentialSolution::nothing()
        } else {
            let scratch = &mut joint.right;
            let mut surfaces =
                BothSurfaces { left: surface(left), right: surface(right), turned: self.turned, scratch };
            self.tangential.solve(&mut surfaces, &problem, &mut joint.traction)
        };
        let back = resistance.map_or(Motion::ZERO, |r| r.retreat(solution.load));
        let motion = Motion { shift: free.shift - back.shift, turn: free.turn - back.turn };
        let loads = joint.scatter([left, right], self.turned);
        let motions = [motion, turned(motion, self.turned.conj())];
        let mut used = (0.0, 0.0);
        for i in 0..2 {
            let own = TangentialSolution { load: loads[i], ..solution };
            let (done, most) = self.fingers[i].follow(&commands[i], motions[i], own, increment);
            used = (used.0 + done, used.1 + most);
        }
        used
    }

    /// A command in the axes of the right pad.
    fn to_right(&self, command: &Command) -> Command {
        let back = |v: Vec2| plane(complex(v) * self.turned.conj());
        Command {
            grip: command.grip,
            pose: command.pose.seen_turned(self.turn_rad),
            roll_mm: back(command.roll_mm),
            wrench: Wrench { force_n: back(command.wrench.force_n), ..command.wrench },
        }
    }

    /// Combines the ground truth of both.
    fn account(&mut self, (done, most): (f64, f64)) {
        let [left, right] = [0, 1].map(|i| self.fingers[i].truth);
        let out = |v: Vec2| plane(complex(v) * self.turned);
        let mean = |a: Wrench, b: Wrench| Wrench {
            force_n: (a.force_n + out(b.force_n)) * 0.5,
            torque_n_mm: 0.5 * (a.torque_n_mm + b.torque_n_mm),
        };
        let cells = |truth: &Truth| f64::from(truth.contact_cells_count);
        let stuck = |truth: &Truth| truth.stick_ratio.unwrap_or(0.0) * cells(truth);
        let all = cells(&left) + cells(&right);
        self.truth = Truth {
            grip_force_n: 0.5 * (left.grip_force_n + right.grip_force_n),
            depth_mm: 0.5 * (left.depth_mm + right.depth_mm),
            wrench: mean(left.wrench, right.wrench),
            friction: mean(left.friction, right.friction),
            on_profile_n: (left.on_profile_n + out(right.on_profile_n)) * 0.5,
            contact_cells_count: (left.contact_cells_count + right.contact_cells_count).div_ceil(2),
            contact_area_mm2: 0.5 * (left.contact_area_mm2 + right.contact_area_mm2),
            stick_ratio: (all > 0.0).then(|| (stuck(&left) + stuck(&right)) / all),
            friction_used_fraction: (most > 0.0).then(|| done / most),
            peak_pressure_mpa: left.peak_pressure_mpa.max(right.peak_pressure_mpa),
            largest_strain_fraction: left.largest_strain_fraction.max(right.largest_strain_fraction),
            beyond_linear: left.beyond_linear || right.beyond_linear,
            at_border: left.at_border || right.at_border,
            dissipated_n_mm: 0.5 * (left.dissipated_n_mm + right.dissipated_n_mm),
            normal_iterations_count: left.normal_iterations_count + right.normal_iterations_count,
            tangential_iterations_count: left.tangential_iterations_count,
            converged: left.converged && right.converged,
            ..left
        };
    }
}

impl Joint {
    /// Collects the data of both fingers.
    fn gather(&mut self, fingers: [&Finger; 2], turned: Complex64) {
        self.cells.clear();
        let count = self.right.len();
        for (first, finger, turn) in [(0, fingers[0], Complex64::new(1.0, 0.0)), (count, fingers[1], turned)] {
            self.cells.extend(finger.cells.iter().map(|&i| i + first as u32));
            // Tractions outside the contact must be 0, because the surface uses all of them.
            for (i, q) in finger.traction.iter().enumerate() {
                self.traction[first + i] = q * turn;
            }
            for &i in &finger.cells {
                let i = i as usize;
                self.push[first + i] = finger.push[i] * turn;
                self.bound[first + i] = finger.bound[i];
                self.target[first + i] = finger.target[i] * turn;
                self.lever[first + i] = finger.lever[i] * turn;
                if !self.compliance.is_empty() {
                    self.compliance[first + i] = finger.compliance.get(i).copied().unwrap_or(0.0);
                }
            }
        }
    }

    /// Returns the tractions to both fingers; the load of each in its own axes.
    fn scatter(&self, fingers: [&mut Finger; 2], turned: Complex64) -> [Motion; 2] {
        let count = self.right.len();
        let back = [Complex64::new(1.0, 0.0), turned.conj()];
        let mut loads = [Motion::ZERO; 2];
        for (n, finger) in fingers.into_iter().enumerate() {
            for &i in &finger.cells {
                let i = i as usize;
                finger.traction[i] = self.traction[n * count + i] * back[n];
                loads[n].add(finger.lever[i], finger.traction[i]);
            }
        }
        loads
    }
}

/// The gel of a finger; None without contact.
fn surface(finger: &mut Finger) -> Option<OneSurface<'_>> {
    let (window, stride) = (finger.window?, finger.settings.grid.width_cells);
    Some(OneSurface { response: finger.interface.for_window(window), window, stride })
}

/// A motion in axes rotated by a unit complex number.
fn turned(motion: Motion, by: Complex64) -> Motion {
    Motion { shift: motion.shift * by, turn: motion.turn }
}
