//! A folder of recorded clips with their labels.
//!
//! ```text
//!   FOLDER/clip/...     --names--> trials, their frames: clip_watch
//!   FOLDER/labels.csv   --truth, for scoring alone--> records, tables
//! ```

use super::clip_watch::{OpenSource, RestFrom, Seen, watch};
use super::digest::Digest;
use super::error::EvalError;
use super::folder::SWEEP_FILE;
use crate::rivals::Entry;
use slipbound::sensor::Sensor;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Why a folder of clips cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ClipsError {
    /// The folder cannot be read.
    #[error("{path}: expected a folder of clips")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// There are no folders in it.
    #[error("{path}: expected folders with clips, got none")]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// The name of a clip is not text.
    #[error("{path:?}: expected the name of a clip in UTF-8")]
    Name {
        /// The folder of the clip.
        path: PathBuf,
    },
    /// labels.csv cannot be read.
    #[error("{path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// labels.csv is not as expected.
    #[error("{path}: {problem}")]
    Labels {
        /// The file.
        path: PathBuf,
        /// What was expected and got.
        problem: String,
    },
}

/// The label of a clip in labels.csv.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    /// The held object.
    pub object: String,
    /// Whether it slipped.
    pub slips: bool,
}

/// A folder of clips.
#[derive(Debug, Clone)]
pub struct Clips {
    folder: PathBuf,
    open: OpenSource,
    /// Names of the clips, in alphabetical order, whatever their labels.
    pub names: Vec<String>,
    /// Labels by clip; empty without labels.csv.
    pub labels: BTreeMap<String, Label>,
    /// The number of clips, and a digest of their names, the names and sizes of their files, and their labels.
    pub contents: String,
    /// Raised where no further recording is to be watched.
    stop: Arc<AtomicBool>,
}

impl Clips {
    /// Reads a folder: each folder in it is a clip, to be read by `open`, except hidden ones and those of
    /// sweeps. The first column of the optional `labels.csv`
    /// is the name of the clip; it also has columns `object` and `slip`. A clip may be without a label, but no label
    /// without its clip, or twice.
    pub fn open(folder: &Path, open: OpenSource) -> Result<Self, ClipsError> {
        let path = || folder.to_owned();
        let entries = fs::read_dir(folder).map_err(|source| ClipsError::Folder { path: path(), source })?;
        let mut names = Vec::new();
        for entry in entries {
            let entry = entry.map_err(|source| ClipsError::Read { path: path(), source })?;
            if entry.path().is_dir() && !entry.path().join(SWEEP_FILE).exists() {
                let name = entry.file_name().into_string().map_err(|_| ClipsError::Name { path: entry.path() })?;
                names.extend(Some(name).filter(|name| !name.starts_with('.')));
            }
        }
        if names.is_empty() {
            return Err(ClipsError::Empty { path: path() });
        }
        names.sort();
        let file = folder.join("labels.csv");
        let labels = match file.exists() {
            true => {
                let text = fs::read_to_string(&file);
                let text = text.map_err(|source| ClipsError::Read { path: file.clone(), source })?;
                labels(&text, &names).map_err(|problem| ClipsError::Labels { path: file, problem })?
            }
            false => BTreeMap::new(),
        };
        let contents = contents(folder, &names, &labels)?;
        Ok(Clips { folder: folder.to_owned(), open, names, labels, contents, stop: Arc::default() })
    }

    /// The same until `stop` is raised: a protocol that watches all clips for its first trial watches no further one.
    #[must_use]
    pub fn until(self, stop: Arc<AtomicBool>) -> Self {
        Clips { stop, ..self }
    }

    /// Folder of a clip.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Runs detectors on a recording, in the order of `entries`; the results by detector, then by frame; none for a
    /// detector whose monitor cannot be created for the recording. [`EvalError::Unjudged`] where the recording has no
    /// frames or cannot be decoded, or where no frame could be judged by the monitor that all but the paper's own method
    /// share, or by that method's if it is asked alone. Another error once it is stopped: see [`Clips::until`].
    pub fn watch(
        &self,
        path: &Path,
        sensor: &Sensor,
        rest_from: RestFrom,
        entries: &[&'static Entry],
    ) -> Result<Vec<Vec<Seen>>, EvalError> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(EvalError::other("interrupted"));
        }
        watch(self.open, path, sensor, rest_from, entries)
    }

    /// How an error names the trial of a clip.
    pub(super) fn trial(&self, number: u64) -> String {
        let name = self.names.get(number as usize).map_or("", String::as_str);
        format!("trial {number}, {name}")
    }

    /// Whether a clip's object slipped; None without a label.
    pub fn truth(&self, name: &str) -> Option<bool> {
        self.labels.get(name).map(|label| label.slips)
    }
}

/// See [`Clips::contents`].
fn contents(folder: &Path, names: &[String], labels: &BTreeMap<String, Label>) -> Result<String, ClipsError> {
    let mut digest = Digest::new();
    for name in names {
        let mut files = Vec::new();
        add_files(&folder.join(name), name, &mut files)?;
        files.sort();
        digest.add(name);
        files.iter().for_each(|file| digest.add(file));
    }
    for (name, label) in labels {
        [name.as_str(), &label.object, if label.slips { "1" } else { "0" }].iter().for_each(|part| digest.add(part));
    }
    Ok(format!("{} clips, {}", names.len(), digest.word()))
}

/// Name and size of each file below a folder that is not hidden.
fn add_files(folder: &Path, name: &str, files: &mut Vec<String>) -> Result<(), ClipsError> {
    let failed = |source| ClipsError::Read { path: folder.to_owned(), source };
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let own = entry.file_name().to_string_lossy().into_owned();
        let name = format!("{name}/{own}");
        if own.starts_with('.') {
            continue;
        }
        let about = fs::metadata(entry.path()).map_err(|source| ClipsError::Read { path: entry.path(), source })?;
        match about.is_dir() {
            true => add_files(&entry.path(), &name, files)?,
            false => files.push(format!("{name} {}", about.len())),
        }
    }
    Ok(())
}

/// The held object, from the name of a clip: its words up to the first number.
pub fn object_of_name(name: &str) -> &str {
    let is_number = |word: &str| !word.is_empty() && word.bytes().all(|b| b.is_ascii_digit());
    let mut end = 0;
    for word in name.split('_') {
        if end > 0 && is_number(word) {
            return &name[..end - 1];
        }
        end += word.len() + 1;
    }
    name
}

/// The labels in the text of labels.csv, of clips among `names`. The error is what was expected in which line, and got.
fn labels(text: &str, names: &[String]) -> Result<BTreeMap<String, Label>, String> {
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
    let header = lines.next().map_or("", |(_, line)| line);
    let columns: Vec<&str> = header.split(',').map(str::trim).collect();
    let place = |name: &str| {
        let mut found = (0..columns.len()).filter(|&n| columns[n] == name);
        let got = if header.trim().is_empty() { "none".into() } else { columns.join(", ") };
        match (found.next(), found.next()) {
            (Some(place), None) => Ok(place),
            (Some(_), Some(_)) => Err(format!("expected a header with one column {name}, got {got}")),
            _ => Err(format!("expected a header with a column {name}, got {got}")),
        }
    };
    let (object, slip) = (place("object")?, place("slip")?);
    let mut labels = BTreeMap::new();
    let mut line_of: BTreeMap<&str, u64> = BTreeMap::new();
    for (number, line) in lines {
        let refuse = |expected: &str, got: &str| {
            let got = if got.is_empty() { "none" } else { got };
            Err(format!("line {number}: expected {expected}, got {got}"))
        };
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        if cells.len() != columns.len() {
            return refuse(&format!("{} cells, as in the header", columns.len()), &cells.len().to_string());
        }
        let clip = cells[0];
        if !names.iter().any(|name| name == clip) {
            return refuse("the name of a clip in the folder", clip);
        }
        if let Some(before) = line_of.insert(clip, number) {
            return refuse("each clip once", &format!("{clip} again, as in line {before}"));
        }
        if cells[object].is_empty() {
            return refuse("the name of an object", "");
        }
        let slips = match cells[slip] {
            "1" => true,
            "0" => false,
            other => return refuse("slip 0 or 1", other),
        };
        labels.insert(clip.to_owned(), Label { object: cells[object].to_owned(), slips });
    }
    Ok(labels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use slipbound::port::{SourceError, SourceErrorKind};

    #[test]
    fn objects_are_what_names_say_without_their_numbers() {
        assert_eq!(object_of_name("object001_066_60"), "object001");
        assert_eq!(object_of_name("train_ball_white_thread_01"), "train_ball_white_thread");
        assert_eq!(object_of_name("7f3a"), "7f3a");
    }

    #[test]
    fn contents_tell_other_clips_and_other_labels_and_no_order_of_lines() {
        let root = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| {
            let path = root.path().join(name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            fs::write(path, text).expect("written");
        };
        let refuses: OpenSource = |_| Err(SourceError::new(SourceErrorKind::Other, "no clip"));
        let contents = || Clips::open(root.path(), refuses).expect("clips").contents;
        write("a_1/000.jpg", "12");
        write("b_1/left/000.jpg", "345");
        let bare = contents();
        assert!(bare.starts_with("2 clips, ") && bare == contents(), "{bare}");
        write("labels.csv", "clip,object,slip\na_1,a,1\nb_1,b,0\n");
        let labelled = contents();
        write("labels.csv", "clip,slip,object\nb_1,0,b\na_1,1,a\n");
        assert_eq!(contents(), labelled, "the same labels");
        write("labels.csv", "clip,object,slip\na_1,a,0\nb_1,b,0\n");
        let told_otherwise = contents();
        write("b_1/left/000.jpg", "3456");
        let longer = contents();
        write(".ipynb_checkpoints/000.jpg", "");
        write("eval-lifts/sweep.json", "{}");
        assert_eq!(contents(), longer, "neither a hidden folder nor that of a sweep is a clip");
        write("c_1/000.jpg", "");
        let all = [bare, labelled, told_otherwise, longer, contents()];
        assert!((1..all.len()).all(|n| !all[..n].contains(&all[n])), "{all:?}");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_cannot_be_inspected_is_named_and_a_hidden_one_is_not_looked_at() {
        let root = tempfile::tempdir().expect("a folder");
        let refuses: OpenSource = |_| Err(SourceError::new(SourceErrorKind::Other, "no clip"));
        fs::create_dir(root.path().join("a_1")).expect("a folder");
        let link =
            |name: &str| std::os::unix::fs::symlink("nowhere", root.path().join("a_1").join(name)).expect("a link");
        link(".000.jpg");
        assert!(Clips::open(root.path(), refuses).is_ok());
        link("000.jpg");
        let error = Clips::open(root.path(), refuses).map(drop).expect_err("a link to nothing").to_string();
        assert!(error.contains("a_1/000.jpg"), "{error}");
    }

    #[test]
    fn labels_that_cannot_be_meant_are_refused_by_file_and_line() {
        let root = tempfile::tempdir().expect("a folder");
        ["a_1", "b_1"].iter().for_each(|name| fs::create_dir(root.path().join(name)).expect("a folder"));
        let refuses: OpenSource = |_| Err(SourceError::new(SourceErrorKind::Other, "no clip"));
        let refused = |rows: &str| {
            fs::write(root.path().join("labels.csv"), format!("clip,object,slip\n{rows}")).expect("written");
            let error = Clips::open(root.path(), refuses).map(drop).err().map(|error| error.to_string());
            error.map(|text| text.replace(&format!("{}/", root.path().display()), ""))
        };
        assert_eq!(refused("a_1,a,1\n\nb_1,b,0\n"), None);
        assert_eq!(refused("b_1,b,0\n"), None, "a clip without a label has no truth");
        for (rows, problem) in [
            ("a_1,a,yes\n", "line 2: expected slip 0 or 1, got yes"),
            ("a_1,a,\n", "line 2: expected slip 0 or 1, got none"),
            ("a_1,,1\n", "line 2: expected the name of an object, got none"),
            (",b,0\n", "line 2: expected the name of a clip in the folder, got none"),
            ("b_1,b,0\n\na_1,1\n", "line 4: expected 3 cells, as in the header, got 2"),
            ("a_1,cup, red,1\n", "line 2: expected 3 cells, as in the header, got 4"),
            ("a_1,a,1\nb_1,b,0\na_1,a,0\n", "line 4: expected each clip once, got a_1 again, as in line 2"),
            ("a_1,a,1\nb_2,b,0\n", "line 3: expected the name of a clip in the folder, got b_2"),
        ] {
            assert_eq!(refused(rows).as_deref(), Some(format!("labels.csv: {problem}").as_str()), "{rows}");
        }
    }

    #[test]
    fn labels_are_found_by_the_names_of_their_columns() {
        let names = ["a_1", "b_2"].map(String::from);
        let read = labels("clip,object,opening,slip\na_1,cup,3,1\n\nb_2,pen,4,0\n", &names).expect("labels");
        assert_eq!(read["a_1"], Label { object: "cup".into(), slips: true });
        assert!(!read["b_2"].slips);
        let error = labels("clip,slip\na_1,1\n", &names).expect_err("no objects");
        assert_eq!(error, "expected a header with a column object, got clip, slip");
        let error = labels("clip,object,slip,slip\na_1,cup,1,0\n", &names).expect_err("two raters");
        assert_eq!(error, "expected a header with one column slip, got clip, object, slip, slip");
        assert_eq!(labels("\n", &names).expect_err("empty"), "expected a header with a column object, got none");
    }
}
