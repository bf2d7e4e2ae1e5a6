//! Where single images of a pressed finger show contact, for `bench/real/check_gelslim3.py`.
//!
//! `contact_centre SENSOR REST PICTURE...` takes REST as the untouched finger, shows every PICTURE to a new monitor
//! until contact would have begun, and prints one line each: file, area in rectified px, centre of the region in px of
//! the camera image (two dashes without contact). The first line is `markers COUNT` of the rest frame.

use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor};
use slipbound::plane::Vec2;
use slipbound::port::{FrameBuffer, Next};
use slipbound_rig::{sensors, source};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [sensor, rest, pictures @ ..] = &arguments[..] else {
        return Err("expected SENSOR REST PICTURE...".into());
    };
    let (sensor, settings) = (sensors::load(sensor)?, Settings::default());
    let rest = picture(rest)?;
    let mut builder = RestBuilder::new(&sensor, &settings, rest.size)?;
    builder.add(&rest.frame()?)?;
    let rest = builder.build(RestKind::Unloaded)?;
    println!("markers {}", rest.markers_count());
    for file in pictures {
        let shown = picture(file)?;
        let mut monitor = SlipMonitor::new(&sensor, &settings, rest.clone())?;
        for _ in 0..settings.contact.on_frames_count {
            monitor.step(&shown.frame()?, None);
        }
        let region = monitor.contact_region();
        let size = region.size();
        let (mut sum, mut count) = (Vec2::ZERO, 0);
        for y in 0..size.height {
            for x in (0..size.width).filter(|&x| region.get(x as isize, y as isize)) {
                sum += Vec2::new(x as f64, y as f64);
                count += 1;
            }
        }
        match count {
            0 => println!("{file} 0 - -"),
            _ => {
                let centre = monitor.sensor().camera_from_rectified(sum / f64::from(count));
                println!("{file} {count} {:.1} {:.1}", centre.x, centre.y);
            }
        }
    }
    Ok(())
}

fn picture(file: &str) -> Result<FrameBuffer, Box<dyn Error + Send + Sync>> {
    let mut buffer = FrameBuffer::default();
    match source::open(file)?.next(&mut buffer)? {
        Next::Frame => Ok(buffer),
        _ => Err(format!("{file}: expected a picture").into()),
    }
}
