//! The cameras of the fingers.

use super::scene::HandScene;
use super::world::HandWorld;
use crate::contact::{Displacement, Grid};
use crate::jpeg::Codec;
use crate::layer::Gel;
use crate::random::Random;
use crate::render::{Renderer, Surface};
use slipbound::plane::Vec2;
use slipbound::port::{Clock, FrameBuffer, SourceError, SourceErrorKind};
use slipbound::sensor::Sensor;

/// The camera of one finger, with its own markers, threads and defects, and its last frame.
#[derive(Debug)]
struct FingerCamera {
    renderer: Renderer,
    codec: Codec,
    grid: Grid,
    seed: u64,
    displacement: Vec<Displacement>,
    pressure_mpa: Vec<f64>,
    rgb: Vec<u8>,
    frame: FrameBuffer,
    failed: Option<String>,
}

/// The cameras of a hand: one or two.
#[derive(Debug)]
pub(super) struct Cameras {
    fingers: Vec<FingerCamera>,
    /// Of the left and of the right finger.
    gels: [Gel; 2],
    /// The frame that the images show; None before the first.
    drawn: Option<u64>,
}

impl Cameras {
    pub fn new(scene: &HandScene, world: &HandWorld) -> Self {
        let settings = world.finger(0).settings();
        let cells_count = settings.grid.cells_count();
        let quality = scene.number("jpeg_quality").map_or(85, |quality| quality as u8);
        let fingers = (0..scene.fingers_count()).map(|finger| {
            let seed = Random::of(scene.seed(), finger as u64).next_u64();
            let height_px = scene.number("height_px").map_or(480, |rows| rows as usize);
            let renderer = Renderer::new(scene.camera().at_height(height_px), seed);
            let size = renderer.size();
            FingerCamera {
                codec: Codec::new(size, quality),
                grid: settings.grid,
                seed,
                displacement: vec![Displacement::default(); cells_count],
                pressure_mpa: vec![0.0; cells_count],
                rgb: vec![0; 3 * size.area()],
                frame: FrameBuffer::default(),
                failed: None,
                renderer,
            }
        });
        let gels = [0, 1].map(|finger| world.finger(finger).settings().gel);
        Cameras { fingers: fingers.collect(), gels, drawn: None }
    }

    /// The facts of a finger; an index beyond the last finger gives those of the last.
    pub fn sensor(&self, finger: usize) -> Sensor {
        let finger = finger.min(self.fingers.len() - 1);
        let camera = &self.fingers[finger];
        let sensor = camera.renderer.sensor();
        let shear = sensor.pitch_mm.map(|pitch_mm| self.gels[finger.min(1)].shear_of_marker(pitch_mm));
        Sensor { shear, ..sensor }
    }

    /// In-plane displacement of every marker of a finger, in its own frame, in mm.
    pub fn marker_shifts_mm(&mut self, finger: usize, world: &HandWorld) -> Vec<Vec2> {
        let Some(camera) = self.fingers.get_mut(finger) else { return Vec::new() };
        world.show(finger, &mut camera.displacement, &mut camera.pressure_mpa);
        let surface = camera.surface();
        camera.renderer.markers_at_rest_mm().iter().map(|&rest_mm| surface.displacement_at(rest_mm).shift_mm).collect()
    }

    /// Draws the present frame of all fingers, each on its own thread, unless already drawn.
    pub fn draw(&mut self, frame: u64, world: &HandWorld) {
        if self.drawn == Some(frame) {
            return;
        }
        self.drawn = Some(frame);
        for (finger, camera) in self.fingers.iter_mut().enumerate() {
            world.show(finger, &mut camera.displacement, &mut camera.pressure_mpa);
        }
        let time_ns = world.now_ns();
        if let [camera] = &mut self.fingers[..] {
            return camera.draw(frame, time_ns);
        }
        std::thread::scope(|scope| {
            for camera in &mut self.fingers {
                scope.spawn(move || camera.draw(frame, time_ns));
            }
        });
    }

    /// The last image of a finger, into a recycled buffer.
    pub fn deliver(&self, finger: usize, into: &mut FrameBuffer) -> Result<(), SourceError> {
        let camera = self.fingers.get(finger).ok_or_else(|| {
            let why = format!("camera: expected finger 0 to {}, got {finger}", self.fingers.len() - 1);
            SourceError::new(SourceErrorKind::Settings, why)
        })?;
        if let Some(failed) = &camera.failed {
            return Err(SourceError::new(SourceErrorKind::Format, failed.clone()));
        }
        // Field by field, so that the buffer keeps its memory.
        into.encoded.clone_from(&camera.frame.encoded);
        into.pixels.clone_from(&camera.frame.pixels);
        (into.format, into.size) = (camera.frame.format, camera.frame.size);
        (into.seq, into.time_ns, into.clock) = (camera.frame.seq, camera.frame.time_ns, camera.frame.clock);
        into.label.clear();
        Ok(())
    }
}

impl FingerCamera {
    fn surface(&self) -> Surface<'_> {
        Surface { grid: &self.grid, displacement: &self.displacement, pressure_mpa: &self.pressure_mpa }
    }

    fn draw(&mut self, frame: u64, time_ns: u64) {
        let surface = Surface { grid: &self.grid, displacement: &self.displacement, pressure_mpa: &self.pressure_mpa };
        self.renderer.render(&surface, Random::of(self.seed, frame).next_u64(), &mut self.rgb);
        self.frame.seq = frame;
        self.frame.time_ns = Some(time_ns);
        self.frame.clock = Clock::Device;
        let coded = self.codec.encode(&self.rgb, &mut self.frame.encoded);
        self.failed = coded.and_then(|()| self.codec.decode(&mut self.frame)).err().map(|error| error.to_string());
    }
}
