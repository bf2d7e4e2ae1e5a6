//! SOURCE of `watch` and `calibrate`: a recording, or `sim:SCENE?key=value&key=value` for a simulated one.

use crate::outcome::Failure;
use slipbound::port::FrameSource;
use slipbound::sensor::Sensor;
use slipbound_lab::faults::Faulty;
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use slipbound_rig::source::{self, ReadAhead};

/// Opens a recording or starts a simulation.
pub fn open(source: &str) -> Result<ReadAhead, Failure> {
    let source = match scene(source) {
        Some(scene) => simulate(scene)?,
        None => source::open(source).map_err(|e| match e {
            source::Error::Missing { .. } | source::Error::Pattern { .. } | source::Error::NoImages { .. } => {
                Failure::arguments(e)
            }
            other => Failure::Work(other.into()),
        })?,
    };
    Ok(ReadAhead::new(source))
}

/// The finger of a simulated source; None for a recording.
pub fn simulated_sensor(source: &str) -> Result<Option<Sensor>, Failure> {
    let Some(scene) = scene(source) else { return Ok(None) };
    let trial = Trial::parse(scene).map_err(Failure::arguments)?;
    World::new(&trial).map(|world| Some(world.sensor())).map_err(Failure::arguments)
}

fn scene(source: &str) -> Option<&str> {
    source.strip_prefix("sim:")
}

fn simulate(scene: &str) -> Result<Box<dyn FrameSource + Send>, Failure> {
    let trial = Trial::parse(scene).map_err(Failure::arguments)?;
    let world = World::new(&trial).map_err(Failure::arguments)?;
    Ok(match trial.faults() {
        Some(faults) => Box::new(Faulty::new(world, faults, trial.seed)),
        None => Box::new(world),
    })
}
