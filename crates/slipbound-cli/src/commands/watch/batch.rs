//! Several recordings one after the other: a row of a table each, and files of their own.

use super::args::Watch;
use super::{BatchMode, JudgedRecording};
use crate::commands::recording;
use crate::interruption;
use crate::outcome::{Failure, Outcome};
use crate::terminal::{Terminal, in_words};
use anyhow::anyhow;
use slipbound::monitor::SlipState;
use slipbound_rig::printable::without_passwords;
use slipbound_rig::source;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Columns besides the name of the recording: heading, and what is counted.
const STATES: [(&str, SlipState); 6] = [
    ("STICK", SlipState::Stick),
    ("INCIPIENT", SlipState::Incipient),
    ("GROSS", SlipState::Gross),
    ("UNSURE", SlipState::Unsure),
    ("NO CONTACT", SlipState::NoContact),
    ("UNJUDGED", SlipState::Unjudged),
];

impl Watch {
    /// Judges every recording; a failure does not stop the others.
    pub(super) fn run_batch(&self) -> Result<Outcome, Failure> {
        if let Some(camera) = self.sources.iter().find(|source| source::is_live(source)) {
            return Err(Failure::Arguments(anyhow!(
                "{camera}: expected recordings, or one camera alone, got several sources"
            )));
        }
        recording::refuse_images_of_one_folder(&self.sources)?;
        let names = names(&self.sources);
        let clips: Vec<Watch> =
            self.sources.iter().zip(&names).map(|(source, name)| self.of_clip(source, name)).collect();
        // Checked before the first of them is written to.
        for clip in &clips {
            super::rest::refuse_second_reading(clip)?;
        }
        super::overwriting::refuse(&clips)?;
        self.make_folders(&clips)?;
        let batch = BatchMode { interrupted: interruption::listen()? };
        let mut terminal = Terminal::with_bar(None, self.json_on_stdout());
        terminal.clear_bar();
        let width = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(4);
        terminal.say(&head(width))?;
        let (mut failed_count, mut is_lossless) = (0, true);
        for (clip, name) in clips.iter().zip(&names) {
            match clip.judge_all(Some(&batch)) {
                Ok(judged) => {
                    is_lossless &= judged.outcome == Outcome::Done;
                    terminal.say(&row(name, width, &judged))?;
                }
                Err(Failure::ReaderLeft) => return Err(Failure::ReaderLeft),
                Err(Failure::Work(e) | Failure::Arguments(e)) => {
                    failed_count += 1;
                    terminal.say(&format!("{name:<width$}  failed"))?;
                    terminal.note(&in_words(&e));
                }
            }
            if batch.interrupted.load(Ordering::Relaxed) {
                return Err(anyhow!("interrupted; what was judged is kept").into());
            }
        }
        match failed_count {
            0 if is_lossless => Ok(Outcome::Done),
            0 => Ok(Outcome::DataLost),
            count => Err(anyhow!("{count} of {} recordings could not be judged", clips.len()).into()),
        }
    }

    /// The same for one of the recordings, with its own outputs.
    fn of_clip(&self, source: &str, name: &str) -> Watch {
        let named = |path: &Option<PathBuf>| path.as_deref().map(|path| with_name(path, name));
        Watch {
            sources: vec![source.to_owned()],
            source: source.to_owned(),
            json: if self.json_on_stdout() { self.json.clone() } else { named(&self.json) },
            csv: named(&self.csv),
            slips: named(&self.slips),
            report: named(&self.report),
            overlay: named(&self.overlay),
            timings: named(&self.timings),
            record: named(&self.record),
            ..self.clone()
        }
    }

    /// Creates the folder in which each recording has a folder of images.
    fn make_folders(&self, clips: &[Watch]) -> Result<(), Failure> {
        for folder in clips.iter().filter_map(|clip| clip.overlay.as_ref()).filter(|path| path.extension().is_none()) {
            fs::create_dir_all(folder).map_err(|e| Failure::work(format!("{}: cannot write", folder.display()), e))?;
        }
        Ok(())
    }
}

/// `run.csv` as `run-NAME.csv`; for a folder, which has no ending, `FOLDER/NAME`.
fn with_name(path: &Path, name: &str) -> PathBuf {
    match (path.file_stem(), path.extension()) {
        (Some(stem), Some(ending)) => {
            path.with_file_name(format!("{}-{name}.{}", stem.to_string_lossy(), ending.to_string_lossy()))
        }
        _ => path.join(name),
    }
}

/// Names of the recordings, each different: by file, folder or scene.
fn names(sources: &[String]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for source in sources {
        let own = name_of(source);
        let numbered = (2..).map(|n| format!("{own}-{n}"));
        let free = std::iter::once(own.clone()).chain(numbered).find(|name| !names.contains(name));
        names.push(free.unwrap_or(own));
    }
    names
}

fn name_of(source: &str) -> String {
    let source = &*without_passwords(source);
    let scene = source.strip_prefix("sim:").map(|scene| scene.split('?').next().unwrap_or(scene));
    let path = Path::new(scene.unwrap_or(source));
    let is_pattern = |name: &str| name.contains(['*', '?', '[', '%']);
    let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
    let name = match name.map(|name| name.to_string_lossy().into_owned()) {
        Some(name) if !is_pattern(&name) => Some(name),
        _ => path.parent().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned()),
    };
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    name.filter(|name| !name.is_empty()).unwrap_or_else(|| "clip".into()).chars().map(plain).collect()
}

fn head(width: usize) -> String {
    let states: String = STATES.iter().map(|(name, _)| format!("  {name}")).collect();
    format!("{:<width$}  FRAMES  SLIPS  FIRST SLIP{states}", "CLIP")
}

fn row(name: &str, width: usize, judged: &JudgedRecording) -> String {
    let summary = &judged.summary;
    let states = STATES.iter().map(|(name, state)| format!("  {:>1$}", summary.count(*state), name.len()));
    let first = judged.first_slip.as_deref().unwrap_or("-");
    let (frames, slips) = (summary.frames_count(), summary.slips_count());
    format!("{name:<width$}  {frames:>6}  {slips:>5}  {first:>10}{}", states.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_are_told_apart_and_outputs_carry_their_names() {
        let sources =
            ["a/run.avi", "b/run.avi", "clips/07/*.png", "sim:ramp?seed=3", "odd name.mp4", "rtsp://me:secret@cam"];
        let names = names(&sources.map(str::to_owned));
        assert_eq!(names, ["run", "run-2", "07", "ramp", "odd_name", "me_cam"]);
        assert_eq!(with_name(Path::new("out/all.csv"), "run-2"), Path::new("out/all-run-2.csv"));
        assert_eq!(with_name(Path::new("pictures"), "run"), Path::new("pictures/run"));
    }
}
