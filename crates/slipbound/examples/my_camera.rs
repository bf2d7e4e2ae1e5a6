//! A camera of your own: implement `FrameSource`, find the finger at rest, judge every frame. `--example my_camera`
#![allow(clippy::disallowed_macros)] // an example prints

use slipbound::finger_pipeline::RestFinder;
use slipbound::image::SizePx;
use slipbound::monitor::{Settings, SlipMonitor};
use slipbound::port::{Clock, FrameBuffer, FrameSource, Next, PixelFormat, SourceError};
use slipbound::sensor::{Flip, Polarity, Sensor, Skin};

/// Replace it by your camera's driver. It sees 6 px dots on a 20 px grid; from frame 25 on they are dragged along.
struct MyCamera {
    seq: u64,
}

impl FrameSource for MyCamera {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let shift_px = self.seq.saturating_sub(25) as usize;
        let dot = |at: usize| (8..14).contains(&(at % 20));
        let level = |i: usize| if dot(i % 320 + 20 - shift_px % 20) && dot(i / 320) { 60 } else { 150 };
        into.pixels = (0..320 * 240).map(level).collect(); // and into.encoded, where the camera sends JPEG
        (into.format, into.size) = (PixelFormat::Gray, SizePx::new(320, 240));
        (into.seq, into.time_ns, into.clock) = (self.seq, Some(self.seq * 1_000_000_000 / 30), Clock::Device);
        self.seq += 1;
        Ok(if self.seq > 35 { Next::End } else { Next::Frame })
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The facts of the finger; `slipbound calibrate` finds them from a photo, `slipbound_rig::sensors` reads them.
    let sensor = Sensor {
        name: "mine".into(),
        description: "6 px dots at 20 px".into(),
        serial: None,
        image_px: SizePx::new(320, 240),
        flip: Flip::None,
        grey_weights_rgb: [1.0 / 3.0; 3],
        polarity: Polarity::Dark,
        pitch_px: 20.0,
        pitch_mm: Some(1.5),
        gel_mm: None,
        marker_diameter_px: 6.0,
        skin: Skin::Smooth,
        bare_sharpness: None,
        edge_bands: vec![],
        rectification: None,
        defects_px: vec![],
        shear: None,
    };
    let (mut camera, mut frame, settings) = (MyCamera { seq: 0 }, FrameBuffer::default(), Settings::default());
    let mut finder = RestFinder::new(&sensor, &settings, sensor.image_px)?;
    while !finder.is_full() && camera.next(&mut frame)? == Next::Frame {
        finder.see(&frame)?;
    }
    let mut monitor = SlipMonitor::new(&sensor, &settings, finder.find()?.rest)?;
    while camera.next(&mut frame)? == Next::Frame {
        let (report, marker) = (monitor.step(&frame.frame()?, None), monitor.markers()[50]);
        println!("{:2}: {:?}, marker 50 moved {:.2} px", report.seq, report.state, marker.now_from_rest().x);
    }
    Ok(())
}
