//! `slipbound-ros2 simulate`: a simulated finger as a camera node.

use super::{Done, domain_id};
use slipbound::port::{FrameBuffer, FrameSource as _, Next};
use slipbound::sensor::Sensor;
use slipbound::setting::SettingError;
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use slipbound_rig::sensors;
use slipbound_ros2::error::Error;
use slipbound_ros2::msg::{CompressedImage, Header};
use slipbound_ros2::ros::{Ros, SENSOR_DATA, stamp};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// The arguments of `slipbound-ros2 simulate`.
#[derive(Debug, clap::Args)]
pub struct Simulate {
    /// A scene and its parameters, as `slipbound simulate` takes them
    #[arg(default_value = "shear?distance_mm=3&grid=fast&rest_frames=24&jpeg_quality=75")]
    scene: String,
    /// Topics on which the pictures are published, all alike; may be given again
    #[arg(long, required = true)]
    topic: Vec<String>,
    /// Writes the simulated finger's sensor file, for the node's hand file
    #[arg(long, value_name = "FILE.toml")]
    sensor: Option<PathBuf>,
    /// Pictures per second [default: `rate_hz` of the scene, 30 unless it is given]
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(1..=250))]
    rate_hz: Option<u32>,
    /// How often the scene is shown; 0: until it is stopped
    #[arg(long, value_name = "COUNT", default_value_t = 0)]
    times: u32,
}

/// Pictures per second of a scene.
fn rate_hz(scene: &str) -> Result<u32, SettingError> {
    Ok(Trial::parse(scene)?.number("rate_hz") as u32)
}

/// The finger of a scene, and its images as the simulated camera sends them: JPEG files.
pub fn jpegs(scene: &str) -> Result<(Sensor, Vec<Vec<u8>>), SettingError> {
    let mut world = World::new(&Trial::parse(scene)?)?;
    let mut frame = FrameBuffer::default();
    let mut jpegs = Vec::new();
    while let Ok(Next::Frame | Next::Torn { .. }) = world.next(&mut frame) {
        jpegs.push(frame.encoded.clone());
    }
    Ok((world.sensor(), jpegs))
}

impl Simulate {
    /// Publishes until the scene is over, or it is stopped.
    pub fn run(&self, stop: &AtomicBool) -> Done {
        let (sensor, jpegs) = jpegs(&self.scene).map_err(Error::from)?;
        if let Some(path) = &self.sensor {
            sensors::write(&sensors::to_toml(&sensor)?, path)?;
        }
        let mut ros = Ros::new("/", "slipbound_simulate", domain_id()?)?;
        let publishers: Result<Vec<_>, _> = self.topic.iter().map(|topic| ros.publisher(topic, &SENSOR_DATA)).collect();
        let publishers = publishers?;
        let rate_hz = self.rate_hz.map_or_else(|| rate_hz(&self.scene), Ok).map_err(Error::from)?;
        let period = Duration::from_secs(1) / rate_hz;
        let mut due = Instant::now();
        println!("{} pictures at {} Hz; Ctrl-C ends it", jpegs.len(), rate_hz);
        let mut shown = 0;
        while self.times == 0 || shown < self.times {
            for jpeg in &jpegs {
                if stop.load(Ordering::Relaxed) {
                    return Ok(());
                }
                for (publisher, topic) in publishers.iter().zip(&self.topic) {
                    let frame_id = topic.trim_matches('/').split('/').next().unwrap_or_default().to_owned();
                    let header = Header { stamp: stamp(), frame_id };
                    let image =
                        CompressedImage { header, format: "rgb8; jpeg compressed bgr8".into(), data: jpeg.clone() };
                    publisher.publish(image).map_err(|e| e.to_string())?;
                }
                due += period;
                sleep(due.saturating_duration_since(Instant::now()));
            }
            shown += 1;
        }
        Ok(())
    }
}
