//! `slipbound convert`: a run folder as an MCAP recording, and back.

use super::inputs;
use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use anyhow::anyhow;
use slipbound_rig::container::{self, ConvertError};
use slipbound_rig::run::Error;
use slipbound_rig::source;
use std::path::PathBuf;

/// The arguments of `slipbound convert`.
#[derive(Debug, clap::Args)]
pub struct Convert {
    /// The folder of a run, or an MCAP recording
    #[arg(value_name = "FOLDER|FILE.mcap")]
    from: PathBuf,
    /// The recording, which is replaced, or a new or empty folder
    #[arg(short, long, value_name = "FILE.mcap|FOLDER")]
    output: PathBuf,
}

impl Convert {
    /// Writes the other form.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let (from, to) = (&self.from, &self.output);
        inputs::refuse_stdout("--output", to, "the name of a file or folder")?;
        let is_mcap = |path: &PathBuf| source::has_ending(path, "mcap");
        let converted = match (from.is_dir(), is_mcap(to)) {
            (true, true) => {
                inputs::refuse_within("--output", to, from)?;
                inputs::refuse_recording("--output", to, &[], &[])?;
                container::to_mcap(from, to)
            }
            (false, false) if from.is_file() && !inputs::is_recording(from) => {
                return Err(Failure::Arguments(anyhow!(
                    "{}: expected FILE.mcap, got a file of another kind",
                    from.display()
                )));
            }
            (false, false) => container::to_folder(from, to),
            (true, false) => {
                let got = to.display();
                return Err(Failure::Arguments(anyhow!(
                    "--output: expected FILE.mcap for the run in a folder, got {got}"
                )));
            }
            (false, true) => {
                let got = from.display();
                return Err(Failure::Arguments(anyhow!(
                    "expected the folder of a run for {}, got {got}",
                    to.display()
                )));
            }
        };
        let converted = converted.map_err(|error| match error {
            ConvertError::Folder(Error::NotEmpty { .. } | Error::Syntax { .. } | Error::Read { .. })
            | ConvertError::Source(_) => Failure::arguments(error),
            other => Failure::Work(other.into()),
        })?;
        let mut terminal = Terminal::plain();
        let (frames, lines, files) = (converted.frames_count, converted.lines_count, converted.files_count);
        terminal.say(&format!("{}: {frames} frames, {lines} lines, {files} other files", to.display()))?;
        converted.left_out.iter().for_each(|what| terminal.note(&format!("left out: {what}")));
        // Parts that follow from the rest are no loss.
        let is_whole = converted.left_out.iter().all(|what| what.contains("follow from"));
        Ok(if is_whole { Outcome::Done } else { Outcome::DataLost })
    }
}
