//! One finger, one object, one camera, stepped through a trial: frames as a camera would deliver them, and the ground
//! truth.
//!
//! ```text
//!   Trial --> LoadProfile --> Finger (contact, 120 steps a second) --> Renderer (`rate_hz`, 30 frames a second) --> JPEG --> frame
//!                               `--------------------------------------------------> FrameTruth
//! ```
//!
//! Frame n shows the finger at n/30 s (n/`rate_hz`) by the world's own clock ([`Clock::Device`]). The exposure is instantaneous, so
//! that time is its middle. Frames before the object touches show the finger at rest. A frame is encoded as JPEG and
//! decoded again, so a live run sees the same pixels as a recording of it.
//!
//! Gross slip, and with it the load fraction f, is defined by [`Gross`], mostly by [`GROSS_FRICTION_FRACTION`].

mod gross;
mod load;
mod physics;
mod truth;

pub use crate::contact::GROSS_FRICTION_FRACTION;
pub(crate) use gross::FULL_SLIP_STICK_RATIO;
pub use gross::Gross;
pub(crate) use gross::Sliding;
pub use physics::Physics;
pub use truth::{FrameTruth, SlipTruth, TRUTH_FORMAT_VERSION, TimedEvent, TruthHeader, complete, runs, unpacked};

use crate::contact::{Command, Displacement, Drive, Event, Finger, FingerSettings, Friction, Grid, Grip, Pose, Wrench};
use crate::jpeg::Codec;
use crate::random::Random;
use crate::render::{CameraSettings, Renderer, Surface};
use crate::scenes::{LoadProfile, Pull, Trial};
use gross::GrossWatch;
use slipbound::plane::Vec2;
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, SourceError};
use slipbound::sensor::Sensor;
use slipbound::setting::SettingError;

/// Frames per second, unless a trial has its own `rate_hz`.
pub const FRAME_RATE_HZ: u64 = 30;

/// Steps of the contact between two of these frames. Between frames that come faster there are fewer, so that a step is
/// never longer.
pub const SUBSTEPS_COUNT: u64 = 4;

/// How far an object that is pulled may slide after gross slip before the trial ends, in mm. Beyond that it only leaves
/// the pad.
const LAST_SLIDE_MM: f64 = 3.0;

/// A trial as it runs.
#[derive(Debug)]
pub struct World {
    trial: Trial,
    profile: LoadProfile,
    start: Pose,
    finger: Finger,
    camera: Renderer,
    codec: Codec,
    rest_frames: u64,
    frames_count: u64,
    next_frame: u64,
    rate_hz: u64,
    substeps_count: u64,
    least_after_gross_frames: u64,
    steps_count: u64,
    /// The wrench of full slip when a ramp begins.
    full_slip: Option<Wrench>,
    load: f64,
    gross: GrossWatch,
    /// Every event so far, and the number of those before the last frame.
    events: Vec<TimedEvent>,
    events_before_count: usize,
    displacement: Vec<Displacement>,
    rgb: Vec<u8>,
    truth: FrameTruth,
}

impl World {
    /// The world of a trial, before its first frame. Refuses invalid settings of the scene, the object or the contact.
    pub fn new(trial: &Trial) -> Result<Self, SettingError> {
        Self::with(trial, trial.load_profile()?, &Physics::default())
    }

    /// The same with another load profile than the scene's, and with other physics than the object's and the standard
    /// gel's.
    pub fn with(trial: &Trial, profile: LoadProfile, physics: &Physics) -> Result<Self, SettingError> {
        let rate_hz = trial.number("rate_hz") as u64;
        let substeps_count = (FRAME_RATE_HZ * SUBSTEPS_COUNT).div_ceil(rate_hz);
        let object = physics.object.unwrap_or(*trial.object());
        let grid = if trial.word("grid") == "fast" { Grid::fast() } else { Grid::standard() };
        let camera = CameraSettings::of_words(trial.word("camera"), trial.word("surroundings"));
        let settings = FingerSettings {
            grid,
            edge: camera.gel_edge(&grid),
            gel: physics.gel,
            soft_object: physics.softness.or(object.softness),
            friction: physics.friction.unwrap_or(Friction::constant(trial.mu())),
            substep_s: 1.0 / (rate_hz * substeps_count) as f64,
            ..FingerSettings::standard()
        };
        let start = Pose {
            position_mm: Vec2::new(trial.number("at_x_mm"), trial.number("at_y_mm")),
            turn_rad: trial.number("turn_deg").to_radians(),
        };
        let surface = object.surface();
        check_place(&grid, &start, &surface)?;
        let gross =
            GrossWatch::new(profile.load_from_s, profile.pull != Pull::None, profile.may_bend(), settings.substep_s);
        let finger = Finger::new(settings, surface)?;
        let camera = Renderer::new(camera, trial.seed);
        let size = camera.size();
        let rest_frames = trial.number("rest_frames") as u64;
        let moving_frames = (profile.path.seconds_s() * rate_hz as f64 - 1e-9).ceil() as u64;
        let mut world = World {
            gross,
            frames_count: rest_frames + moving_frames,
            codec: Codec::new(size, trial.number("jpeg_quality") as u8),
            rgb: vec![0; 3 * size.area()],
            displacement: vec![Displacement::default(); grid.cells_count()],
            truth: FrameTruth::default(),
            trial: trial.clone(),
            profile,
            start,
            finger,
            camera,
            rest_frames,
            next_frame: 0,
            rate_hz,
            substeps_count,
            least_after_gross_frames: 0,
            steps_count: 0,
            full_slip: None,
            load: 0.0,
            events: Vec::new(),
            events_before_count: 0,
        };
        world.put_in_place()?;
        Ok(world)
    }

    /// The facts of the finger as its camera sees it, with the stiffness of its gel.
    pub fn sensor(&self) -> Sensor {
        let sensor = self.camera.sensor();
        let gel = self.finger.settings().gel;
        Sensor { shear: sensor.pitch_mm.map(|pitch_mm| gel.shear_of_marker(pitch_mm)), ..sensor }
    }

    /// The trial.
    pub fn trial(&self) -> &Trial {
        &self.trial
    }

    /// The cells of the gel.
    pub fn grid(&self) -> Grid {
        self.finger.settings().grid
    }

    /// The contact at the last frame.
    pub fn finger(&self) -> &Finger {
        &self.finger
    }

    /// Positions of the markers on the gel at rest, in mm.
    pub fn markers_at_rest_mm(&self) -> &[Vec2] {
        self.camera.markers_at_rest_mm()
    }

    /// Ground truth of the last frame.
    pub fn truth(&self) -> &FrameTruth {
        &self.truth
    }

    /// Every event so far, in the order in which they were found. A frame that is dropped on the way takes the events in
    /// its truth with it, not those here.
    pub fn events(&self) -> &[TimedEvent] {
        &self.events
    }

    /// When the object began to slide as a whole, and under which load; None until then.
    pub fn gross(&self) -> Option<Gross> {
        self.gross.found()
    }

    /// Largest possible number of frames; there are fewer when a pulled object slides away.
    pub fn most_frames_count(&self) -> u64 {
        self.frames_count
    }

    /// Advances to the next frame without rendering it. None when the trial is over.
    pub fn advance(&mut self) -> Result<Option<&FrameTruth>, SettingError> {
        if self.next_frame >= self.frames_count || self.is_over() {
            return Ok(None);
        }
        let frame = self.next_frame;
        self.next_frame += 1;
        self.events_before_count = self.events.len();
        if frame >= self.rest_frames {
            for _ in 0..self.substeps_count {
                self.substep()?;
            }
        }
        for (cell, displacement) in self.displacement.iter_mut().enumerate() {
            *displacement = self.finger.displacement(cell);
        }
        self.truth = self.truth_of(frame);
        Ok(Some(&self.truth))
    }

    /// The image of the frame that [`World::advance`] reached, as an encoded JPEG.
    pub fn render_jpeg(&mut self, jpeg: &mut Vec<u8>) -> Result<(), SourceError> {
        self.render_jpeg_with(Random::of(self.trial.seed, self.truth.frame).next_u64(), jpeg)
    }

    /// Another image of the finger at rest, with its own noise. Before the first frame only: it shows the gel in its
    /// present state.
    pub fn render_rest(&mut self, jpeg: &mut Vec<u8>) -> Result<(), SourceError> {
        self.render_jpeg_with(Random::of(self.trial.seed, u64::MAX).next_u64(), jpeg)
    }

    /// Another image of the finger in its present state, with its own noise drawn from `seed`, into `into`; its number
    /// and time are the caller's.
    pub fn render_again(&mut self, seed: u64, into: &mut FrameBuffer) -> Result<(), SourceError> {
        self.render_jpeg_with(Random::of(self.trial.seed, seed).next_u64(), &mut into.encoded)?;
        into.clock = Clock::Device;
        into.label.clear();
        self.codec.decode(into)
    }

    fn render_jpeg_with(&mut self, seed: u64, jpeg: &mut Vec<u8>) -> Result<(), SourceError> {
        let grid = self.grid();
        let surface =
            Surface { grid: &grid, displacement: &self.displacement, pressure_mpa: self.finger.pressure_mpa() };
        self.camera.render(&surface, seed, &mut self.rgb);
        self.codec.encode(&self.rgb, jpeg)
    }

    /// Moves the object, still off the gel, to its start pose and brings it to rest there.
    fn put_in_place(&mut self) -> Result<(), SettingError> {
        let off = Command { grip: Grip::ForceN(0.0), pose: self.start, roll_mm: Vec2::ZERO, wrench: Wrench::default() };
        self.finger.step(&off)?;
        self.finger.step(&off)?; // repeated, because the first step left it with a velocity
        self.set_drive(self.profile.drive)
    }

    fn set_drive(&mut self, drive: Drive) -> Result<(), SettingError> {
        let fingers_count = self.profile.fingers_count;
        self.finger.set_body(crate::contact::Body { drive, fingers_count })
    }

    /// Time of the path after a number of substeps, in s.
    fn path_s(&self, steps_count: u64) -> f64 {
        steps_count as f64 * self.finger.settings().substep_s
    }

    /// The same on the clock of the frames.
    fn clock_s(&self, path_s: f64) -> f64 {
        path_s + (self.rest_frames - 1) as f64 / self.rate_hz as f64
    }

    fn substep(&mut self) -> Result<(), SettingError> {
        self.steps_count += 1;
        let now_s = self.path_s(self.steps_count);
        let mut command = self.profile.path.at(now_s);
        command.pose.position_mm += self.start.position_mm;
        command.pose.turn_rad += self.start.turn_rad;
        let since_s = self.profile.load_from_s.map(|from_s| now_s - from_s).filter(|&since_s| since_s > 1e-9);
        if let Some(since_s) = since_s {
            command.wrench = self.pull(since_s)?;
        }
        self.finger.step(&command)?;
        if since_s.is_some() && self.profile.pull == Pull::None {
            self.load = load::along(&self.finger.truth().wrench, self.profile.along);
        }
        let time_s = self.clock_s(now_s);
        self.note_events(time_s);
        let is_found = self.gross.see(&self.finger, now_s, time_s, self.load);
        if let Some(gross) = self.gross.found().filter(|_| is_found) {
            // On a curved path gross slip is confirmed some time after it began.
            self.events.push(TimedEvent { event: Event::Gross, time_s: gross.time_s });
        }
        Ok(())
    }

    /// The wrench that acts in addition to the path, at a time since the load began.
    fn pull(&mut self, since_s: f64) -> Result<Wrench, SettingError> {
        let pull = self.profile.pull;
        if pull != Pull::None {
            self.load = pull.load(since_s);
        }
        match pull {
            Pull::None => Ok(Wrench::default()),
            Pull::Ramp { direction_rad, twist_fraction, .. } => {
                let finger = &self.finger;
                let full = *self.full_slip.get_or_insert_with(|| load::full_slip(finger, direction_rad));
                let (turning, pulling) = libm::sincos(twist_fraction * std::f64::consts::FRAC_PI_2);
                Ok(Wrench {
                    force_n: full.force_n * (self.load * pulling),
                    torque_n_mm: full.torque_n_mm * (self.load * turning),
                })
            }
            Pull::Weight { direction_rad, .. } => {
                if let (Drive::Free(mut inertia), Some(mass_kg)) = (self.profile.drive, pull.mass_kg(since_s)) {
                    inertia.mass_kg = mass_kg;
                    self.set_drive(Drive::Free(inertia))?;
                }
                let (s, c) = libm::sincos(direction_rad);
                Ok(Wrench { force_n: Vec2::new(c, s) * self.load, torque_n_mm: 0.0 })
            }
        }
    }

    fn note_events(&mut self, time_s: f64) {
        // The contact's own gross event is replaced by ours, which counts from the beginning of the load.
        let own = self.finger.truth().events.iter().filter(|event| *event != Event::Gross);
        self.events.extend(own.map(|event| TimedEvent { event, time_s }));
    }

    /// Continues the trial for so many frames after the frame that shows gross slip, however far the object slides
    /// meanwhile: the latency of gross slip detection can be judged only if these frames exist.
    pub(crate) fn go_on_after_gross(&mut self, frames: u64) {
        self.least_after_gross_frames = frames;
    }

    fn is_over(&self) -> bool {
        let shown_frame = |gross: Gross| (gross.time_s * self.rate_hz as f64 - 1e-9).ceil() as u64;
        let last_frame = self.gross.found().map(|gross| shown_frame(gross) + self.least_after_gross_frames);
        last_frame.is_none_or(|last_frame| self.next_frame > last_frame) && self.has_slid_away()
    }

    /// Whether an object that nothing holds back has slid away from the position where it let go.
    fn has_slid_away(&self) -> bool {
        let pulled = self.profile.pull != Pull::None;
        pulled
            && self.gross.found().is_some_and(|gross| {
                (self.finger.truth().pose.position_mm - gross.pose.position_mm).length() > LAST_SLIDE_MM
                    || (self.finger.truth().pose.turn_rad - gross.pose.turn_rad).abs() > 0.5
            })
    }

    fn truth_of(&self, frame: u64) -> FrameTruth {
        let surface =
            Surface { grid: &self.grid(), displacement: &self.displacement, pressure_mpa: self.finger.pressure_mpa() };
        let markers = self.camera.markers_at_rest_mm().iter().enumerate().map(|(n, &rest_mm)| {
            let moved = self.finger.displacement_at(rest_mm);
            let px = self.camera.marker_px(n, &surface);
            [moved.shift_mm.x, moved.shift_mm.y, moved.depth_mm, px.x, px.y]
        });
        let time_ns = (frame * 1_000_000_000 + self.rate_hz / 2) / self.rate_hz;
        let mut truth = FrameTruth::of(&self.finger, frame, time_ns, markers);
        truth.friction_used_fraction = self.gross.friction_used_fraction();
        truth.load = self.profile.load_from_s.map(|_| self.load);
        truth.events.extend_from_slice(&self.events[self.events_before_count..]);
        truth
    }
}

/// Refuses a position on the pad at which the object would extend beyond its border.
fn check_place(grid: &Grid, start: &Pose, shape: &dyn crate::contact::shape::Shape) -> Result<(), SettingError> {
    let half = shape.half_size_mm();
    let (s, c) = libm::sincos(start.turn_rad);
    let room = grid.half_size_mm() - Vec2::new(grid.cell_mm, grid.cell_mm);
    let reach = Vec2::new((c * half.x).abs() + (s * half.y).abs(), (s * half.x).abs() + (c * half.y).abs());
    for (key, at, reach, room) in
        [("at_x_mm", start.position_mm.x, reach.x, room.x), ("at_y_mm", start.position_mm.y, reach.y, room.y)]
    {
        if at.abs() + reach > room {
            return Err(SettingError {
                key: format!("object, turn_deg, {key}"),
                got: format!("an object that reaches from {:.2} to {:.2} mm", at - reach, at + reach),
                expected: format!("at most {room:.2} mm to either side, the pad less a cell all round"),
            });
        }
    }
    Ok(())
}

impl FrameSource for World {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        if self.advance()?.is_none() {
            return Ok(Next::End);
        }
        self.render_jpeg(&mut into.encoded)?;
        into.seq = self.truth.frame;
        into.time_ns = Some(self.truth.time_ns);
        into.clock = Clock::Device;
        into.label.clear();
        self.codec.decode(into)?;
        Ok(Next::Frame)
    }

    /// Known if nothing can slide away.
    fn frames_count(&self) -> Option<u64> {
        (self.profile.pull == Pull::None).then_some(self.frames_count)
    }
}
