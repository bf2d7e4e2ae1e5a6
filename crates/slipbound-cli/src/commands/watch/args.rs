//! The arguments of `slipbound watch`.

use slipbound_rig::config::hand::finger_name;
use std::fmt::{self, Display, Formatter};
use std::ops::Range;
use std::path::PathBuf;

/// The arguments of `slipbound watch`.
#[derive(Debug, Clone, clap::Args)]
pub struct Watch {
    /// An image folder, a quoted pattern ('run/*.png'), an image, a video file, a camera (docs/cameras.md), or a scene to
    /// simulate: 'sim:SCENE?seed=3&force_n=20' (see `slipbound scenes`). Of several recordings each is a row of a table;
    /// what is written has the recording's name in its own: run.csv becomes run-CLIP.csv, a folder F becomes F/CLIP
    #[arg(required = true, value_name = "SOURCE")]
    pub(super) sources: Vec<String>,
    /// The one of them that is judged.
    #[arg(skip)]
    pub(super) source: String,
    /// The finger: a built-in name (see `slipbound sensors`) or a sensor file [default: that of the
    /// scene, SOURCE/sensor.toml, or that in SOURCE.mcap, else by the size of the frames]
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub(super) sensor: Option<String>,
    /// The finger at rest: an image or what `slipbound tare` wrote, frames A (inclusive) to B (exclusive) of SOURCE, its
    /// first N frames, in which nothing may touch it, or `held`: an object is held from the first frame on [default: found
    /// among the first frames]
    #[arg(long, value_name = "FILE|A..B|live:N|held", value_parser = RestArgument::parse)]
    pub(super) rest: Option<RestArgument>,
    /// Write a report of one JSON object a line; `-` is standard output
    #[arg(long, value_name = "FILE|-")]
    pub(super) json: Option<PathBuf>,
    /// Write the report as a table too, one row a frame
    #[arg(long, value_name = "FILE.csv")]
    pub(super) csv: Option<PathBuf>,
    /// Write every slip from its first frame to its last, one JSON object a line
    #[arg(long, value_name = "FILE.jsonl")]
    pub(super) slips: Option<PathBuf>,
    /// Write a page with plots over time and pictures of the first 60 slips
    #[arg(long, value_name = "PAGE.html")]
    pub(super) report: Option<PathBuf>,
    /// Put the displacement and slip of every marker into the report
    #[arg(long, requires = "json")]
    pub(super) markers: bool,
    /// Draw every frame with what was found on it: PNG pictures in a folder, or a video
    #[arg(long, value_name = "FOLDER|FILE.avi")]
    pub(super) overlay: Option<PathBuf>,
    /// Greatest length of such a video instead of the writer's own: for tests.
    #[arg(skip)]
    pub(super) overlay_most_bytes: Option<u64>,
    /// Settings that replace the defaults; `paper` stands for the paper as written
    #[arg(long, value_name = "FILE.toml|paper")]
    pub(super) settings: Option<String>,
    /// Write how many microseconds each step took, one JSON object a line
    #[arg(long, value_name = "FILE")]
    pub(super) timings: Option<PathBuf>,
    /// Overwrite a recording, and files that this program did not write (never a frame that is read)
    #[arg(long)]
    pub(super) force: bool,
    /// Record every frame as it comes, with its report: `watch FILE.mcap` judges it again
    #[arg(long, value_name = "FILE.mcap")]
    pub(super) record: Option<PathBuf>,
    /// Report a camera that gives no frame for longer
    #[arg(long, value_name = "MS", default_value_t = 300)]
    pub(super) max_silence_ms: u64,
    /// Name of the finger in the report
    #[arg(long, value_name = "NAME", default_value = "finger", value_parser = finger_name)]
    pub(super) finger: String,
}

impl Watch {
    /// Whether the report goes to standard output.
    pub(super) fn json_on_stdout(&self) -> bool {
        self.json.as_ref().is_some_and(|path| path.as_os_str() == "-")
    }
}

/// The argument `--rest`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RestArgument {
    /// Frames of the source.
    Frames(Range<u64>),
    /// An image of its own, or a rest frame that was saved: the file says which.
    File(PathBuf),
    /// The first frames of the source, so many; nothing may touch the finger in them.
    Live(u32),
    /// The first stationary frames of the source, in which an object is held already.
    Held,
}

/// The N of `live:N`; None for anything else.
pub fn live_count(text: &str) -> Option<Result<u32, String>> {
    let count = text.strip_prefix("live:")?;
    let is_count = |count: &u32| (1..=10_000).contains(count);
    Some(count.parse().ok().filter(is_count).ok_or(format!("expected live:N with 1 to 10000 frames, got {text}")))
}

impl RestArgument {
    /// `A..B`, `live:N`, `held`, or the name of a file.
    pub fn parse(text: &str) -> Result<Self, String> {
        if let Some(count) = live_count(text) {
            return count.map(RestArgument::Live);
        }
        if text == "held" {
            return Ok(RestArgument::Held);
        }
        let is_range = text.contains("..") && text.chars().all(|c| c == '.' || c.is_ascii_digit());
        let range = text.split_once("..").and_then(|(from, to)| Some(from.parse().ok()?..to.parse().ok()?));
        match range {
            Some(frames) if frames.is_empty() => Err(format!("expected A below B, got {text}")),
            Some(frames) => Ok(RestArgument::Frames(frames)),
            None if is_range => Err(format!("expected two whole numbers A..B, got {text}")),
            None => Ok(RestArgument::File(text.into())),
        }
    }
}

impl Display for RestArgument {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            RestArgument::Frames(range) => write!(f, "--rest {}..{}", range.start, range.end),
            RestArgument::File(path) => write!(f, "--rest {}", path.display()),
            RestArgument::Live(count) => write!(f, "--rest live:{count}"),
            RestArgument::Held => f.write_str("--rest held"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rest_is_parsed_as_frames_file_live_count_or_held() {
        assert_eq!(RestArgument::parse("3..9"), Ok(RestArgument::Frames(3..9)));
        assert_eq!(RestArgument::parse("../a.png"), Ok(RestArgument::File("../a.png".into())));
        assert_eq!(RestArgument::parse("../..jpg"), Ok(RestArgument::File("../..jpg".into())));
        for half in ["3..", "..3", "..", "3...5", "1..99999999999999999999"] {
            assert_eq!(RestArgument::parse(half), Err(format!("expected two whole numbers A..B, got {half}")));
        }
        assert_eq!(RestArgument::parse("live:30"), Ok(RestArgument::Live(30)));
        assert_eq!(RestArgument::parse("held"), Ok(RestArgument::Held));
        assert!(RestArgument::parse("live:0").is_err() && RestArgument::parse("live:x").is_err());
        assert_eq!(RestArgument::parse("9..9"), Err("expected A below B, got 9..9".into()));
    }
}
