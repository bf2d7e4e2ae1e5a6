//! Writes the images of a simulated finger and the library's reports on them, for tests in other languages:
//! `interop_frames FOLDER` makes `000.jpg`, ..., `sensor.toml`, `reports.jsonl` and `hands.jsonl`, one
//! `slipbound_msgs/SlipReport` and one `HandReport` per line with null for NaN. The first 20 images are for the rest frame; the first line belongs to the image after them.

use slipbound::finger_pipeline::RestFinder;
use slipbound::hand::{Hand, Mounting, Side};
use slipbound::monitor::{Settings, SlipMonitor};
use slipbound::port::{FrameBuffer, FrameSource as _, Next};
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;
use slipbound_rig::{sensors, source::decode_image};
use slipbound_ros2::msg::{HandReport, Header, SlipReport, Time};
use std::error::Error;
use std::io::Write as _;
use std::path::PathBuf;

/// Stamp of the first image, ns since 1970.
const BEGIN_NS: u64 = 1_700_000_000_000_000_000;

/// The simulated scene.
const SCENE: &str =
    "shear?distance_mm=3&speed_mm_per_s=10&grid=fast&rest_frames=24&press_s=0.2&settle_s=0.1&jpeg_quality=75";

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("expected a folder, got no argument")?);
    std::fs::create_dir_all(&folder)?;
    let mut world = World::new(&Trial::parse(SCENE)?)?;
    let (sensor, settings) = (world.sensor(), Settings::default());
    std::fs::write(folder.join("sensor.toml"), sensors::to_toml(&sensor)?)?;
    let mut lines = std::fs::File::create(folder.join("reports.jsonl"))?;
    let mut hand_lines = std::fs::File::create(folder.join("hands.jsonl"))?;
    let mut hand = Hand::new(&[Mounting::on(Side::Left)])?;
    let mut frame = FrameBuffer::default();
    let (mut finder, mut monitor): (Option<RestFinder>, Option<SlipMonitor>) = (None, None);
    let mut reports_count = 0;
    for seq in 0u64.. {
        if world.next(&mut frame)? != Next::Frame {
            break;
        }
        std::fs::write(folder.join(format!("{seq:03}.jpg")), &frame.encoded)?;
        decode_image(&mut frame)?;
        (frame.seq, frame.time_ns) = (seq, frame.time_ns.map(|ns| BEGIN_NS + ns));
        if let Some(monitor) = &mut monitor {
            let report = monitor.step(&frame.frame()?, None);
            let stamp = Time::from_ns(frame.time_ns.unwrap_or(0));
            let header = Header { stamp, frame_id: "left_gel".into() };
            let message = SlipReport::of(header, "left", reports_count, &report);
            writeln!(lines, "{}", serde_json::to_string(&message)?)?;
            hand.see(0, &report);
            let message = HandReport::of("hand", &hand.report(report.time_ns.unwrap_or(0)));
            writeln!(hand_lines, "{}", serde_json::to_string(&message)?)?;
            reports_count += 1;
            continue;
        }
        let looking = match &mut finder {
            Some(finder) => finder,
            None => finder.insert(RestFinder::new(&sensor, &settings, frame.size)?),
        };
        looking.see(&frame)?;
        if looking.is_full() {
            let found = finder.take().ok_or("looked")?.find()?;
            monitor = Some(SlipMonitor::new(&sensor, &settings, found.rest)?);
        }
    }
    println!("{reports_count} reports");
    Ok(())
}
