//! Outputs must not destroy inputs, nor each other.

use super::args::{RestArgument, Watch};
use crate::commands::inputs::{self, is_same};
use crate::outcome::Failure;
use anyhow::anyhow;
use slipbound_rig::{overlay::is_numbered, source::image_files};
use std::fs;
use std::path::{Path, PathBuf};

/// Refuses names whose ending stands for another format than the one written.
pub fn refuse_endings(args: &Watch) -> Result<(), Failure> {
    const PICTURES: [&str; 9] = ["mp4", "mkv", "mov", "webm", "m4v", "gif", "png", "jpg", "jpeg"];
    const TABLES: [&str; 6] = ["csv", "tsv", "xlsx", "parquet", "feather", "pkl"];
    for (name, path, refused, expected) in [
        ("--overlay", &args.overlay, &PICTURES[..], "a folder for pictures, or FILE.avi for a video"),
        ("--json", &args.json, &TABLES[..], "a file of JSON lines (--csv FILE.csv writes a table)"),
        (
            "--csv",
            &args.csv,
            &["json", "jsonl", "xlsx", "parquet", "feather", "pkl"],
            "a file of comma-separated values",
        ),
        ("--slips", &args.slips, &["csv", "html", "xlsx", "parquet", "pkl"], "a file of JSON lines"),
        ("--report", &args.report, &["pdf", "md", "json", "jsonl", "csv", "png"], "a page, FILE.html"),
    ] {
        let Some(path) = path else { continue };
        if path.as_os_str() == "-" && name != "--json" {
            return Err(Failure::Arguments(anyhow!(
                "{name} -: expected the name of a file; only --json writes to standard output"
            )));
        }
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if refused.contains(&ending.as_str()) {
            let path = path.display();
            return Err(Failure::Arguments(anyhow!(
                "{name} {path}: expected {expected}, got a name that ends in .{ending}"
            )));
        }
    }
    args.record.as_deref().map_or(Ok(()), |path| inputs::refuse_ending("--record", path))
}

/// Refuses outputs that would overwrite an input or each other.
pub fn refuse(args: &Watch) -> Result<(), Failure> {
    let rest = match &args.rest {
        Some(RestArgument::File(path)) => Some(path.as_path()),
        _ => None,
    };
    // For `FILE.mcap#TOPIC`, the file.
    let source =
        Path::new(slipbound_rig::source::mcap_file(&args.source).map_or(args.source.as_str(), |(file, _)| file));
    let inputs = [
        ("SOURCE", Some(source)),
        ("--rest", rest),
        ("--sensor", args.sensor.as_deref().map(Path::new)),
        ("--settings", args.settings.as_deref().map(Path::new)),
    ];
    let outputs = [
        ("--json", args.json.as_deref().filter(|_| !args.json_on_stdout())),
        ("--csv", args.csv.as_deref()),
        ("--slips", args.slips.as_deref()),
        ("--report", args.report.as_deref()),
        ("--timings", args.timings.as_deref()),
        ("--overlay", args.overlay.as_deref()),
        ("--record", args.record.as_deref()),
    ];
    let mut taken: Vec<(&str, PathBuf)> =
        inputs.into_iter().filter_map(|(name, path)| Some((name, place(path.filter(|p| p.exists())?)?))).collect();
    if let (false, Some(folder)) = (source.is_dir(), source.parent()) {
        // Images are named by number, and those of the source may be, too.
        if slipbound_rig::source::reads_images(&args.source) {
            taken.extend(place(folder).map(|folder| ("SOURCE", folder)));
        }
    }
    let frames: Vec<PathBuf> =
        image_files(&args.source).iter().filter_map(|file| fs::canonicalize(file).ok()).collect();
    for (name, path) in outputs {
        let (Some(path), Some(place)) = (path, path.and_then(place)) else {
            continue;
        };
        if let Some((other, _)) = taken.iter().find(|(_, there)| is_same(there, &place) || *there == place) {
            let path = path.display();
            return Err(Failure::Arguments(anyhow!("{name} {path}: expected a place of its own, got that of {other}")));
        }
        let falls_on = |frame: &&PathBuf| **frame == place || frame.parent() == Some(&place) || is_same(frame, &place);
        if let Some(frame) = frames.iter().find(falls_on) {
            let (path, frame) = (path.display(), frame.display());
            return Err(Failure::Arguments(anyhow!(
                "{name} {path}: expected a place of its own, got that of the frame {frame}"
            )));
        }
        if !args.force {
            if name == "--record" {
                inputs::refuse_recorded(name, &place)?;
            }
            refuse_foreign(name, &place)?;
        }
        taken.push((name, place));
    }
    Ok(())
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
