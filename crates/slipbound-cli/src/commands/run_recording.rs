//! The recording in one file of `run`, `hold` and `demo`: its description before the run, what is missing from it after.

use crate::outcome::Failure;
use crate::run_output::{LONGEST_DISK, RunOutput};
use slipbound_rig::container::{Recorder, Written};
use slipbound_rig::run::RunInfo;

/// Writes the description of a run into its recording, with the sensor of every finger and the settings of the
/// monitors.
pub fn describe(recorder: &Recorder, info: &RunInfo) -> Result<(), Failure> {
    for finger in &info.fingers {
        let sensor = toml::to_string(&finger.sensor).map_err(|e| Failure::work("sensor", e))?;
        recorder.attach(&finger.sensor_file(), "text/toml", sensor.into_bytes());
        if let Some((name, bytes)) = finger.rest_file().map_err(|e| Failure::work("rest", e))? {
            recorder.attach(&name, "application/octet-stream", bytes);
        }
    }
    let settings = toml::to_string(&info.monitor_settings).map_err(|e| Failure::work("settings", e))?;
    recorder.attach("settings.toml", "text/toml", settings.into_bytes());
    let run = info.to_toml().map_err(|e| Failure::work("run.toml", e))?;
    recorder.attach("run.toml", "text/toml", run.into_bytes());
    Ok(())
}

/// Closes a recording, and reports what is missing from it.
pub fn finish(recorder: Option<Recorder>, output: &mut RunOutput) {
    match recorder.map(|recorder| recorder.finish_within(LONGEST_DISK)) {
        None => {}
        Some(Ok(written)) if written.lost_count == 0 => {}
        Some(Ok(Written { lost_count, .. })) => {
            output.lost(format!("{lost_count} frames or lines were not recorded: the disk did not keep up"));
        }
        Some(Err(e)) => output.lost(e.to_string()),
    }
}
