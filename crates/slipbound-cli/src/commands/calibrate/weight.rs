//! `slipbound calibrate --weight-g`: a recording of a mass held and then hanging -> the shear stiffness, put into the sensor file.

use super::args::Calibrate;
use crate::commands::watch::recording::{Arrived, Recording};
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::anyhow;
use slipbound::calibrate::{HangingFrame, outermost, shear_stiffness, stationary_end, stationary_held};
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor};
use slipbound::sensor::Sensor;
use slipbound_rig::{calibration, sensors};
use std::fs;
use std::ops::Range;
use std::path::Path;

/// Heaviest mass that makes sense on a fingertip, in grams.
const HEAVIEST_G: f64 = 20_000.0;

/// Measures and writes.
pub fn run(args: &Calibrate, weight_g: f64) -> Result<Outcome, Failure> {
    if !(weight_g > 0.0 && weight_g <= HEAVIEST_G) {
        return Err(Failure::Arguments(anyhow!(
            "--weight-g: expected grams above 0, at most {HEAVIEST_G}, got {weight_g}"
        )));
    }
    if !(1..=16).contains(&args.fingers) {
        return Err(Failure::Arguments(anyhow!("--fingers: expected 1 to 16, got {}", args.fingers)));
    }
    let name = args.sensor.as_deref().unwrap_or_default();
    let sensor = sensors::load(name).map_err(Failure::arguments)?;
    let mut recording = args.open()?;
    let mut monitor = monitor(args, &mut recording, &sensor)?;
    let outermost = outermost(monitor.sensor(), monitor.markers());
    let mut frames = Vec::new();
    let mut torn_count = 0;
    loop {
        match recording.next()? {
            Arrived::Over => break,
            Arrived::Torn(_) => torn_count += 1,
            Arrived::Whole => {
                let frame = recording.frame().frame().map_err(|e| Failure::work(&args.source, e))?;
                let report = monitor.step(&frame, None);
                frames.push(HangingFrame::new(&report, monitor.markers(), &outermost));
            }
        }
    }
    let within = |range: &Range<u64>| frames.iter().filter(|f| range.contains(&f.seq)).copied().collect::<Vec<_>>();
    let hanging = args.hanging.as_ref().map_or_else(|| stationary_end(&frames).to_vec(), within);
    let first = hanging.first().map_or(u64::MAX, |f| f.seq);
    let before: Vec<HangingFrame> = frames.iter().take_while(|f| f.seq < first).copied().collect();
    let held = args.held.as_ref().map_or_else(|| stationary_held(&before, &hanging).to_vec(), within);
    let what = Path::new(&args.source).file_name().map_or(args.source.clone(), |n| n.to_string_lossy().into_owned());
    let shear = shear_stiffness(monitor.sensor(), &held, &hanging, weight_g, args.fingers, &what)
        .map_err(|e| Failure::Arguments(anyhow!("{}: {e}", args.source)))?;

    let text = with_shear(name, &args.output, &calibration::shear_table(&shear))?;
    args.write_output(&text)?;
    sensors::load(&args.output.display().to_string()).map_err(|e| Failure::Work(e.into()))?;
    let mut terminal = Terminal::plain();
    terminal.say(&format!("{}: {}", args.source, shear.provenance))?;
    terminal.say(&format!("stiffness {:.4} N per marker and pitch", shear.stiffness_n_per_pitch))?;
    terminal.say(&format!("written: {}", args.output.display()))?;
    Ok(if torn_count > 0 { Outcome::DataLost } else { Outcome::Done })
}

/// A monitor whose rest is the start of the recording.
fn monitor(args: &Calibrate, recording: &mut Recording, sensor: &Sensor) -> Result<SlipMonitor, Failure> {
    let settings = Settings::default();
    let failed = |e: &dyn std::fmt::Display| Failure::Arguments(anyhow!("{}: {e}", args.source));
    let whole: Vec<_> = recording
        .read_ahead(settings.rest.window_count as usize)
        .filter(|a| a.torn.is_none())
        .map(|a| a.frame.clone())
        .collect();
    let size = whole.first().map(|f| f.size).ok_or_else(|| failed(&"expected a recording, got no whole frame"))?;
    let mut builder = RestBuilder::new(sensor, &settings, size).map_err(|e| failed(&e))?;
    let mut looks = Vec::new();
    for buffer in &whole {
        looks.push(builder.look(&buffer.frame().map_err(|e| Failure::work(&args.source, e))?));
    }
    let choice = builder.choose(&looks).map_err(|e| failed(&e))?;
    if choice.kind == RestKind::InContact {
        return Err(failed(
            &"expected a recording that begins with the finger untouched, got one that begins in contact",
        ));
    }
    for buffer in &whole[choice.frames] {
        let frame = buffer.frame().map_err(|e| Failure::work(&args.source, e))?;
        builder.add(&frame).map_err(|e| failed(&e))?;
    }
    let rest = builder.build(choice.kind).map_err(|e| failed(&e))?;
    SlipMonitor::new(sensor, &settings, rest).map_err(Failure::arguments)
}

/// The sensor's own file with the table in place of an older one; for a built-in finger or another folder, a file that
/// extends it.
fn with_shear(name: &str, output: &Path, table: &str) -> Result<String, Failure> {
    let path = Path::new(name);
    if !path.exists() {
        return Ok(format!("extends = \"{name}\"\n\n{table}"));
    }
    let text = fs::read_to_string(path).map_err(|e| Failure::work(format!("{name}: cannot read"), e))?;
    if text.lines().any(|l| l.trim_start().starts_with("extends")) && path.parent() != output.parent() {
        return Err(Failure::Arguments(anyhow!(
            "--output: expected a file in the folder of {name}, which extends another, got {}",
            output.display()
        )));
    }
    Ok(format!("{}\n\n{table}", without_shear(&text).trim_end()))
}

/// The text without its table [shear] and the comment above it.
fn without_shear(text: &str) -> String {
    let mut kept: Vec<&str> = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        if line.trim_start().starts_with('[') {
            inside = line.trim() == "[shear]";
            while inside && kept.last().is_some_and(|l| l.starts_with('#')) {
                kept.pop();
            }
        }
        if !inside {
            kept.push(line);
        }
    }
    kept.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_older_measurement_is_replaced() {
        let text =
            "name = \"a\"\n\n# Newtons\n[shear]\nstiffness_n_per_pitch = 1.0\nprovenance = \"x\"\n\n[other]\nb = 1\n";
        assert_eq!(without_shear(text), "name = \"a\"\n\n[other]\nb = 1");
        assert_eq!(without_shear("name = \"a\""), "name = \"a\"");
    }
}
