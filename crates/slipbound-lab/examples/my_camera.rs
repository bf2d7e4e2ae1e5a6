//! A camera of your own: implement `FrameSource`, show the untouched finger first, then let every frame be judged.
//! `cargo run --release -p slipbound-lab --example my_camera`

use slipbound::image::SizePx;
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor};
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, PixelFormat, SourceError};
use slipbound_lab::{scenes::Trial, world::World};

/// Stands for the memory of your camera's driver: RGB pictures of one size, 30 of them a second.
struct MyCamera {
    size: SizePx,
    pictures: std::vec::IntoIter<Vec<u8>>,
    seq: u64,
}

impl FrameSource for MyCamera {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let Some(pixels) = self.pictures.next() else { return Ok(Next::End) };
        into.encoded.clear(); // no JPEG; a camera that sends some keeps it here, so that it can be recorded
        into.pixels.clone_from(&pixels);
        (into.format, into.size) = (PixelFormat::Rgb, self.size);
        (into.seq, into.time_ns, into.clock) = (self.seq, Some(self.seq * 1_000_000_000 / 30), Clock::Assumed);
        self.seq += 1;
        Ok(Next::Frame)
    }
}

fn main() -> Result<(), SourceError> {
    // Pictures of scissors pulled out of the grip, and the facts of the finger that took them.
    let mut world = World::new(&Trial::parse("ramp?object=scissors&grid=fast&rest_frames=10&seed=1")?)?;
    let (sensor, mut picture, mut pictures) = (world.sensor(), FrameBuffer::default(), Vec::new());
    while world.next(&mut picture)? == Next::Frame {
        pictures.push(picture.pixels.clone());
    }
    let mut camera = MyCamera { size: picture.size, pictures: pictures.into_iter(), seq: 0 };

    // At rest: the first ten frames, in which nothing touches.
    let settings = Settings::default();
    let mut rest = RestBuilder::new(&sensor, &settings, camera.size)?;
    let mut frame = FrameBuffer::default();
    while rest.frames_count() < 10 && camera.next(&mut frame)? == Next::Frame {
        rest.add(&frame.frame()?)?;
    }
    let mut monitor = SlipMonitor::new(&sensor, &settings, rest.build(RestKind::Unloaded)?)?;

    let mut last = None;
    while camera.next(&mut frame)? == Next::Frame {
        let report = monitor.step(&frame.frame()?, None);
        if last.replace(report.state) != Some(report.state) {
            println!("frame {:3}: {:?}", report.seq, report.state);
        }
    }
    Ok(())
}
