//! `--rest` of a hand: its first frames, or the file that `slipbound tare` wrote for every finger.

use super::watch::live_count;
use crate::outcome::Failure;
use anyhow::anyhow;
use slipbound::monitor::Settings;
use slipbound_rig::rest_file::{RestFileError, SavedRest};
use slipbound_rig::run::FingerInfo;
use std::path::PathBuf;
use std::sync::Arc;

/// The argument `--rest`.
#[derive(Debug, Clone)]
pub enum HandRest {
    /// The number of first frames, in which nothing may touch the fingers.
    Live(u32),
    /// A saved rest frame.
    File(PathBuf),
}

impl HandRest {
    /// `live:N`, or the name of a file.
    pub fn parse(text: &str) -> Result<Self, String> {
        live_count(text).map_or_else(|| Ok(HandRest::File(text.into())), |count| count.map(HandRest::Live))
    }
}

/// The fingers, each with its saved rest frame if `rests` names such files.
pub fn saved(
    rests: &[HandRest],
    mut fingers: Vec<FingerInfo>,
    settings: &Settings,
) -> Result<Vec<FingerInfo>, Failure> {
    if let [] | [HandRest::Live(_)] = rests {
        return Ok(fingers);
    }
    let files = rests.iter().filter_map(|rest| match rest {
        HandRest::Live(_) => None,
        HandRest::File(path) => Some(path),
    });
    let files: Vec<&PathBuf> = files.collect();
    if files.len() != rests.len() || files.len() != fingers.len() {
        let (count, got) = (fingers.len(), rests.len());
        return Err(Failure::Arguments(anyhow!("--rest: expected live:N once or {count} FILE, got {got} values")));
    }
    let refused = |e: RestFileError| Failure::Arguments(anyhow!("--rest {e}"));
    for (finger, path) in fingers.iter_mut().zip(files) {
        let saved = SavedRest::read(path).map_err(refused)?;
        saved.check(&finger.sensor, settings, &path.display().to_string()).map_err(refused)?;
        finger.rest = Some(Arc::new(saved));
    }
    Ok(fingers)
}
