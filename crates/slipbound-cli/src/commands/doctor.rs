//! `slipbound doctor`: checks everything that a hand needs. One line for each, good or with what to do.

mod finding;
mod finger;

use super::recording;
use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::{self, Terminal};
use anyhow::anyhow;
use finding::{Finding, bad, good, judged, unknown};
use slipbound::monitor::Settings;
use slipbound::port::{Clock, FrameBuffer, FrameSource as _, Next};
use slipbound_rig::gripper::{Device, Session, describe};
use slipbound_rig::link::now_ns;
use slipbound_rig::rest_file::{RestFileError, SavedRest};
use slipbound_rig::sensors;
use slipbound_rig::source::{self, most_common_size};
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

/// Frames that are inspected.
const FRAMES_COUNT: usize = 90;
/// Longest wait for them, ns.
const LONGEST_NS: u64 = 10_000_000_000;
/// Longest wait for a gripper, ns.
const GRIPPER_NS: u64 = 3_000_000_000;
/// If a camera gives less than this share of its rate, the losses are reported.
const RATE_FRACTION: f64 = 0.9;

/// The arguments of `slipbound doctor`.
#[derive(Debug, clap::Args)]
pub struct Doctor {
    /// A camera (docs/cameras.md) or a recording, of a finger that nothing touches
    source: String,
    /// The finger: a built-in name or a sensor file [default: that of --rest, else markers are not looked for]
    #[arg(long, value_name = "NAME|FILE.toml")]
    sensor: Option<String>,
    /// The finger at rest, written by `slipbound tare`, to be compared with the present one
    #[arg(long, value_name = "FILE")]
    rest: Option<PathBuf>,
    /// A gripper to be checked, as in `slipbound gripper`; it does not move
    #[arg(long, value_name = "ADDRESS")]
    gripper: Option<String>,
    /// A TOML file of gripper settings
    #[arg(long, value_name = "FILE")]
    gripper_config: Option<PathBuf>,
}

/// Frames and the findings on their source; a finding alone when there are none.
type Looked = Result<(Vec<FrameBuffer>, Vec<Finding>), Finding>;

impl Doctor {
    /// Checks everything; fails when something needs to be fixed.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let sensor = self.sensor.as_deref().map(sensors::load).transpose().map_err(Failure::arguments)?;
        let (sensor, rest) = match &self.rest {
            None => (sensor, None),
            Some(path) => {
                let saved = SavedRest::read(path).map_err(refused)?;
                let sensor = sensor.unwrap_or_else(|| saved.made_of.sensor.clone());
                saved.check(&sensor, &Settings::default(), &path.display().to_string()).map_err(refused)?;
                (Some(sensor), Some(saved.rest))
            }
        };
        let mut terminal = Terminal::plain();
        let mut findings = match self.look()? {
            Ok((frames, mut findings)) => {
                findings.extend(finger::lighting(&frames));
                findings.extend(sensor.iter().flat_map(|sensor| finger::markers(&frames, sensor, rest.clone())));
                findings
            }
            Err(finding) => vec![finding],
        };
        findings.extend(self.gripper.as_deref().map(|address| self.gripper(address)));
        for Finding { name, is, advice, is_bad } in &findings {
            let mark = match (is_bad, advice) {
                (true, _) => "BAD ",
                (false, Some(_)) => "look",
                (false, None) => "good",
            };
            terminal.say(&format!("{mark}  {name}: {is}"))?;
            if let Some(advice) = advice {
                terminal.say(&format!("      {advice}"))?;
            }
        }
        match findings.iter().filter(|finding| finding.is_bad).count() {
            0 => Ok(Outcome::Done),
            count => Err(anyhow!("{count} of {} things are to be mended", findings.len()).into()),
        }
    }

    /// The frames, and the findings on camera, rate and clock; a finding alone when there are none.
    fn look(&self) -> Result<Looked, Failure> {
        let (mut source, camera) = match recording::open_watched(&self.source, None) {
            Ok(opened) => opened,
            // A missing file or folder is not a camera to be plugged in.
            Err(refused @ Failure::Arguments(_)) if !source::is_live(&self.source) => return Err(refused),
            Err(Failure::Work(e) | Failure::Arguments(e)) => {
                let advice = "plug it in and look at `slipbound devices`; of a stream, open its address in a browser";
                return Ok(Err(bad("camera", terminal::in_words(&e), advice)));
            }
            Err(other) => return Err(other),
        };
        let stop = interruption::listen()?;
        let (mut frames, mut torn_count, mut buffer) = (Vec::new(), 0, FrameBuffer::default());
        let until_ns = now_ns() + LONGEST_NS;
        while frames.len() < FRAMES_COUNT && now_ns() < until_ns && !stop.load(Ordering::Relaxed) {
            match source.next(&mut buffer)? {
                Next::Frame => frames.push(buffer.clone()),
                Next::Torn { .. } => torn_count += 1,
                Next::Silent => {}
                Next::End => break,
            }
        }
        let all_count = frames.len();
        let common = most_common_size(&frames);
        frames.retain(|frame: &FrameBuffer| Some(frame.size) == common);
        let Some(first) = frames.first() else {
            let advice = "is the stream the right one, and the camera not in use by another program?";
            return Ok(Err(bad("camera", format!("{} gives no whole frame", self.source), advice)));
        };
        let mut findings = vec![good("camera", format!("{}, frames of {}", self.source, first.size))];
        let advice = "a shorter or shielded cable, another USB port, or fewer cameras on one hub";
        findings.push(judged(
            "whole frames",
            format!("{torn_count} torn of {}", all_count + torn_count),
            torn_count == 0,
            advice,
        ));
        if let other_count @ 1.. = all_count - frames.len() {
            let is = format!("{other_count} of {all_count} frames are not of {}", first.size);
            findings.push(bad("one size", is, "is it one camera, set to one size? the others cannot be judged"));
        }
        if let Some(camera) = &camera {
            findings.push(rate(&camera.tally.counts(), &camera.facts));
            // A stream says nothing about the camera behind it.
            let is_told = camera.facts.iter().any(|(name, _)| name == "exposure");
            let is_loose = |(_, value): &&(String, String)| value.contains("left to") || value.contains("not locked");
            let loose: Vec<&str> = camera.facts.iter().filter(is_loose).map(|(name, _)| name.as_str()).collect();
            let is = if loose.is_empty() { "nothing is left to the camera".into() } else { loose.join(", ") };
            let advice = "set them in the address: ?exposure=..&gain=.. (docs/cameras.md)";
            findings.push(match is_told {
                true => judged("locked", is, loose.is_empty(), advice),
                false => unknown(
                    "locked",
                    "a stream does not tell",
                    "lock exposure, gain, white balance and focus where the camera is",
                ),
            });
            findings.push(match first.clock {
                Clock::Device => good("clock", "the camera or its driver stamps its frames"),
                _ => good("clock", "frames carry no stamps: their time is that of arrival"),
            });
        }
        Ok(Ok((frames, findings)))
    }

    fn gripper(&self, address: &str) -> Finding {
        let advice = "is it switched on, and the address right? `slipbound gripper ADDRESS status` says more";
        let mut device = match Device::open(address, self.gripper_config.as_deref()) {
            Ok(device) => device,
            Err(e) => return bad("gripper", e.to_string(), advice),
        };
        let (stop, until_ns) = (Default::default(), now_ns() + GRIPPER_NS);
        loop {
            match Session::new(&mut device, &stop, &mut |_| {}).state() {
                Ok(state) => return good("gripper", format!("{address}: {}", describe(&state))),
                Err(e) if now_ns() > until_ns => return bad("gripper", e.to_string(), advice),
                Err(_) => thread::sleep(Duration::from_millis(20)),
            }
        }
    }
}

fn refused(e: RestFileError) -> Failure {
    Failure::Arguments(anyhow!("--rest {e}"))
}

fn rate(counts: &slipbound_rig::source::CameraCounts, facts: &[(String, String)]) -> Finding {
    let negotiated = facts.iter().find(|(name, _)| name == "rate_hz").and_then(|(_, value)| value.parse::<f64>().ok());
    let measured = counts.rate_hz().unwrap_or(0.0);
    let expected = negotiated.map_or(String::new(), |hz| format!(", {hz:.1} Hz were negotiated"));
    let is_good = negotiated.map_or(measured >= 10.0, |hz| measured >= RATE_FRACTION * hz);
    let advice = "more light or a shorter exposure, format=mjpg, a smaller size, or a USB port of its own";
    judged("rate", format!("{counts}{expected}"), is_good, advice)
}
