//! The finger of a recording, where the user does not name it: for `watch` and `tare`.

use super::recording;
use crate::outcome::Failure;
use anyhow::anyhow;
use slipbound::image::SizePx;
use slipbound::sensor::Sensor;
use slipbound_rig::sensors;

/// Added to messages about frames that stand upright where wide ones are expected, or the other way round.
pub const TURNED: &str = "; are the images turned by 90 degrees?";

/// The requested finger, else that of the scene, that of `sensor.toml` beside the frames, that in an MCAP recording,
/// the one of the rest frame `saved` under a name, or the only built-in one whose frames have exactly this size; with a
/// note where that was a choice.
pub fn of(
    source: &str,
    frames: SizePx,
    asked: Option<&Sensor>,
    saved: Option<(&Sensor, &str)>,
) -> Result<(Sensor, Option<String>), Failure> {
    if let Some(sensor) = asked {
        return Ok((sensor.clone(), None));
    }
    if let Some(sensor) = recording::simulated_sensor(source)? {
        return Ok((sensor, None));
    }
    if let Some((sensor, place)) = recording::enclosed_sensor(source)? {
        return Ok((sensor, Some(format!("no --sensor given: took {place}"))));
    }
    if let Some((sensor, file)) = saved {
        return Ok((sensor.clone(), Some(format!("no --sensor given: took {} of {file}", sensor.name))));
    }
    match sensors::of_frames(frames).map_err(Failure::arguments)?.as_slice() {
        [only] => {
            let note = format!("no --sensor given: took {} for its frames of {frames}", only.name);
            Ok((only.clone(), Some(note)))
        }
        several => {
            let names: Vec<&str> = several.iter().map(|s| s.name.as_str()).collect();
            Err(Failure::Arguments(match names.is_empty() {
                true => anyhow!(
                    "{source}: no built-in finger has frames of {frames}: expected --sensor, got none \
                     (`slipbound sensors` lists the built-in fingers; your own is a FILE.toml){}",
                    if frames.height > frames.width { TURNED } else { "" }
                ),
                false => anyhow!(
                    "{source}: more than one built-in finger has frames of {frames}: expected --sensor with one \
                     of {}, got none (`slipbound sensors` tells them apart)",
                    names.join(", ")
                ),
            }))
        }
    }
}
