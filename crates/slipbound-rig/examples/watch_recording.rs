//! Judges a recording: `cargo run --release -p slipbound-rig --example watch_recording -- RECORDING SENSOR`, by default
//! the test recording of this repository.

use slipbound::events::SlipEvents;
use slipbound::finger_pipeline::{RecordingMonitor, RestFinder};
use slipbound::monitor::{Settings, SlipMonitor};
use slipbound::port::{FrameBuffer, Next};
use slipbound_rig::{sensors, source};

fn main() -> std::process::ExitCode {
    match judge() {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            std::process::ExitCode::FAILURE
        }
    }
}

fn judge() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let testdata = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata");
    let recording = args.next().unwrap_or(format!("{testdata}/twist.avi"));
    let sensor = sensors::load(&args.next().unwrap_or(format!("{testdata}/painted.toml")))?;
    let settings = Settings::default();

    // The finger at rest, found among the first frames.
    let mut frame = FrameBuffer::default();
    let mut first_frames = source::open(&recording)?;
    let mut finder = RestFinder::new(&sensor, &settings, sensor.image_px)?;
    while !finder.is_full() && first_frames.next(&mut frame)? == Next::Frame {
        finder.see(&frame)?;
    }
    // None of the first frames is judged by a later one.
    let monitor = SlipMonitor::new(&sensor, &settings, finder.find()?.rest)?;
    let mut monitor = RecordingMonitor::with_rest_of_first_frames(monitor)?;

    // Every frame from the first on.
    let (mut frames, mut events) = (source::open(&recording)?, SlipEvents::new());
    loop {
        let report = match frames.next(&mut frame)? {
            Next::Frame => monitor.step(&frame, &mut (), &mut |_, _| {})?,
            Next::Torn { .. } => monitor.torn(frame.seq, frame.time_ns),
            Next::Silent => continue,
            Next::End => break,
        };
        for event in events.see(&report) {
            println!("{event:?}");
        }
    }
    events.end().iter().for_each(|event| println!("{event:?}"));
    Ok(())
}
