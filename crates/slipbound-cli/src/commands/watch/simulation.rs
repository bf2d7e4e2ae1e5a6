//! `sim:SCENE?key=value&key=value` as a source: the simulator brought together with the watching.

use crate::outcome::Failure;
use slipbound::port::FrameSource;
use slipbound::sensor::Sensor;
use slipbound_lab::faults::Faulty;
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;

/// The scene that a source names; None when it names no scene.
pub fn scene(source: &str) -> Option<&str> {
    source.strip_prefix("sim:")
}

/// Runs a scene live.
pub fn open(scene: &str) -> Result<Box<dyn FrameSource + Send>, Failure> {
    let trial = Trial::parse(scene).map_err(Failure::arguments)?;
    let world = World::new(&trial).map_err(Failure::arguments)?;
    Ok(match trial.faults() {
        Some(faults) => Box::new(Faulty::new(world, faults, trial.seed)),
        None => Box::new(world),
    })
}

/// The finger of a scene.
pub fn sensor(scene: &str) -> Result<Sensor, Failure> {
    let trial = Trial::parse(scene).map_err(Failure::arguments)?;
    World::new(&trial).map(|world| world.sensor()).map_err(Failure::arguments)
}
