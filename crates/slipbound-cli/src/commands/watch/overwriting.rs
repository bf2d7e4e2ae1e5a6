//! Outputs must not destroy inputs, nor each other.

use super::args::{RestArgument, Watch};
use crate::commands::inputs::{self, FileIdentity};
use crate::outcome::Failure;
use anyhow::anyhow;
use slipbound_rig::{overlay::is_numbered, sensors, source::image_files};
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Refuses names whose ending stands for another format than the one written.
fn refuse_endings(args: &Watch) -> Result<(), Failure> {
    const FORMATS: [&str; 28] = [
        "json", "jsonl", "ndjson", "csv", "tsv", "xlsx", "parquet", "feather", "pkl", "html", "htm", "pdf", "md",
        "txt", "png", "jpg", "jpeg", "gif", "webp", "svg", "bmp", "avi", "mp4", "mkv", "mov", "webm", "m4v", "mcap",
    ];
    const LINES: [&str; 4] = ["json", "jsonl", "ndjson", "txt"];
    for (name, path, own, expected) in [
        ("--overlay", &args.overlay, &["avi"][..], "a folder for pictures, or FILE.avi for a video"),
        ("--json", &args.json, &LINES, "a file of JSON lines (--csv FILE.csv writes a table)"),
        ("--csv", &args.csv, &["csv", "txt"], "a file of comma-separated values"),
        ("--slips", &args.slips, &LINES, "a file of JSON lines"),
        ("--report", &args.report, &["html", "htm"], "a page, FILE.html"),
        ("--timings", &args.timings, &LINES, "a file of JSON lines"),
    ] {
        let Some(path) = path else { continue };
        if name != "--json" {
            inputs::refuse_stdout(name, path, "the name of a file")?;
        }
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if FORMATS.contains(&ending.as_str()) && !own.contains(&ending.as_str()) {
            let path = path.display();
            return Err(Failure::Arguments(anyhow!(
                "{name} {path}: expected {expected}, got a name that ends in .{ending}"
            )));
        }
    }
    args.record.as_deref().map_or(Ok(()), |path| inputs::refuse_ending("--record", path))
}

/// Refuses outputs that would overwrite an input or each other, of any of the recordings, and names that promise another
/// format.
pub fn refuse(clips: &[Watch]) -> Result<(), Failure> {
    let mut taken = Taken::default();
    clips.iter().for_each(|clip| taken.add_inputs(clip));
    clips.iter().try_for_each(|clip| taken.add_outputs(clip))?;
    clips.iter().try_for_each(refuse_endings)
}

/// Places where nothing may be written, each with what is there.
#[derive(Default)]
struct Taken {
    places: HashMap<PathBuf, String>,
    files: HashMap<FileIdentity, String>,
}

impl Taken {
    fn add(&mut self, place: &Path, what: &str) {
        self.places.entry(place.to_owned()).or_insert_with(|| what.to_owned());
        if let Some(file) = FileIdentity::of(place) {
            self.files.entry(file).or_insert_with(|| what.to_owned());
        }
    }

    fn at(&self, place: &Path) -> Option<&String> {
        self.places.get(place).or_else(|| self.files.get(&FileIdentity::of(place)?))
    }

    fn add_inputs(&mut self, args: &Watch) {
        let rest = match &args.rest {
            Some(RestArgument::File(path)) => Some(path.as_path()),
            _ => None,
        };
        // For `FILE.mcap#TOPIC`, the file.
        let source =
            Path::new(slipbound_rig::source::mcap_file(&args.source).map_or(args.source.as_str(), |(file, _)| file));
        let sensor_beside = args.sensor.is_none().then(|| sensors::beside(&args.source)).flatten();
        let inputs = [
            ("SOURCE", Some(source)),
            ("SOURCE/sensor.toml", sensor_beside.as_deref()),
            ("--rest", rest),
            ("--sensor", args.sensor.as_deref().map(Path::new)),
            ("--settings", args.settings.as_deref().map(Path::new)),
        ];
        for (name, path) in inputs {
            let there = path.filter(|path| path.exists()).and_then(place);
            there.iter().for_each(|place| self.add(place, name));
        }
        if let (false, Some(folder)) = (source.is_dir(), source.parent()) {
            // Images are named by number, and those of the source may be, too.
            if slipbound_rig::source::reads_images(&args.source) {
                place(folder).iter().for_each(|folder| self.add(folder, "SOURCE"));
            }
        }
        for frame in image_files(&args.source).iter().filter_map(|file| fs::canonicalize(file).ok()) {
            let what = format!("the frame {}", frame.display());
            self.add(&frame, &what);
            frame.parent().into_iter().for_each(|folder| self.add(folder, &what));
        }
    }

    fn add_outputs(&mut self, args: &Watch) -> Result<(), Failure> {
        let outputs = [
            ("--json", args.json.as_deref().filter(|_| !args.json_on_stdout())),
            ("--csv", args.csv.as_deref()),
            ("--slips", args.slips.as_deref()),
            ("--report", args.report.as_deref()),
            ("--timings", args.timings.as_deref()),
            ("--overlay", args.overlay.as_deref()),
            ("--record", args.record.as_deref()),
        ];
        for (name, path) in outputs {
            let (Some(path), Some(place)) = (path, path.and_then(place)) else {
                continue;
            };
            if let Some(other) = self.at(&place) {
                let path = path.display();
                let expected = "expected a place of its own";
                return Err(Failure::Arguments(anyhow!("{name} {path}: {expected}, got that of {other}")));
            }
            if !args.force {
                if name == "--record" {
                    inputs::refuse_recorded(name, &place)?;
                }
                refuse_foreign(name, &place)?;
            }
            self.add(&place, name);
        }
        Ok(())
    }
}

/// Refuses an existing file that we did not write, and a folder with such an image that would be overwritten.
fn refuse_foreign(name: &str, place: &Path) -> Result<(), Failure> {
    let files: Vec<PathBuf> = match fs::read_dir(place) {
        Ok(entries) => entries.flatten().map(|entry| entry.path()).filter(|path| is_numbered(path)).collect(),
        Err(_) => vec![place.to_owned()],
    };
    files.iter().try_for_each(|file| inputs::refuse_foreign(name, file))
}

/// The path of an existing or future file; None for devices and pipes, which hold nothing, and for missing folders.
fn place(path: &Path) -> Option<PathBuf> {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    match fs::canonicalize(path) {
        Ok(there) => (there.is_file() || there.is_dir()).then_some(there),
        Err(_) => {
            let folder = path.parent()?;
            let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            Some(fs::canonicalize(folder).ok()?.join(path.file_name()?))
        }
    }
}
