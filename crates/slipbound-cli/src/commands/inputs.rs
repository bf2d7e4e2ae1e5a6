//! Outputs must not destroy inputs, nor files of other programs.

use crate::outcome::Failure;
use anyhow::anyhow;
use slipbound_rig::file_origin;
use slipbound_rig::source::{image_files, mcap_file};
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

/// The first bytes of an MCAP file.
const MCAP: &[u8] = b"\x89MCAP0\r\n";

/// An existing file or folder, the same through links of either kind.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct FileIdentity(#[cfg(unix)] (u64, u64), #[cfg(not(unix))] std::path::PathBuf);

impl FileIdentity {
    /// That of a path; None where there is nothing.
    #[cfg(unix)]
    pub fn of(path: &Path) -> Option<Self> {
        use std::os::unix::fs::MetadataExt;
        fs::metadata(path).ok().map(|there| FileIdentity((there.dev(), there.ino())))
    }

    /// That of a path; None where there is nothing.
    #[cfg(not(unix))]
    pub fn of(path: &Path) -> Option<Self> {
        fs::canonicalize(path).ok().map(FileIdentity)
    }
}

/// Whether both names lead to one file or folder, also through links of either kind.
pub fn is_same(one: &Path, other: &Path) -> bool {
    let first = FileIdentity::of(one);
    first.is_some() && first == FileIdentity::of(other)
}

/// Refuses a file that would be inside a folder that is read.
pub fn refuse_within(option: &str, path: &Path, folder: &Path) -> Result<(), Failure> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (fs::canonicalize(parent), fs::canonicalize(folder)) {
        (Ok(parent), Ok(whole)) if parent.starts_with(&whole) => {
            let (shown, folder) = (path.display(), folder.display());
            Err(Failure::Arguments(anyhow!("{option} {shown}: expected a place outside of {folder}, which is read")))
        }
        _ => Ok(()),
    }
}

/// Refuses an existing file that we did not write.
pub fn refuse_foreign(option: &str, file: &Path) -> Result<(), Failure> {
    match file.is_file() && !file_origin::is_own_file(file).unwrap_or(false) {
        false => Ok(()),
        true => {
            let file = file.display();
            let expected = "expected a new file, or one that slipbound wrote";
            Err(Failure::Arguments(anyhow!("{option}: {expected}, got {file} (--force overwrites it)")))
        }
    }
}

/// Refuses `-` where standard output is never meant; `expected`: what is.
pub fn refuse_stdout(option: &str, path: &Path, expected: &str) -> Result<(), Failure> {
    match path.as_os_str() == "-" {
        true => {
            Err(Failure::Arguments(anyhow!("{option} -: expected {expected}; only --json writes to standard output")))
        }
        false => Ok(()),
    }
}

/// Refuses `-` as the folder of `--output`.
pub fn refuse_stdout_folder(folder: &Path) -> Result<(), Failure> {
    refuse_stdout("--output", folder, "the name of a folder")
}

/// Whether a file begins as an MCAP file does, whichever program wrote it.
pub fn is_recording(path: &Path) -> bool {
    start(path).is_some_and(|start| start == MCAP)
}

/// Refuses an existing recording, whichever program wrote it: its frames may exist nowhere else.
pub fn refuse_recorded(option: &str, path: &Path) -> Result<(), Failure> {
    match is_recording(path) {
        false => Ok(()),
        true => {
            let path = path.display();
            let expected = "expected a new file";
            Err(Failure::Arguments(anyhow!("{option}: {expected}, got {path}, a recording (--force overwrites it)")))
        }
    }
}

/// As many bytes of a file as an MCAP file begins with; None if it cannot be read.
fn start(path: &Path) -> Option<Vec<u8>> {
    let mut start = Vec::new();
    File::open(path).and_then(|file| file.take(MCAP.len() as u64).read_to_end(&mut start)).ok()?;
    Some(start)
}

/// Refuses a recording whose name no reader would recognise: sources are recognised by their ending; pipes and devices
/// have none.
pub fn refuse_ending(option: &str, path: &Path) -> Result<(), Failure> {
    let is_special = fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir());
    if is_special || path.extension().is_some_and(|ending| ending == "mcap") {
        return Ok(());
    }
    let got = match path.extension() {
        Some(ending) => format!("a name that ends in .{}", ending.display()),
        None => "a name without an ending".into(),
    };
    Err(Failure::Arguments(anyhow!("{option} {}: expected a FILE.mcap, got {got}", path.display())))
}

/// Refuses a recording that would overwrite a source, one of its images, another file that is read, or a file that is
/// not a recording; and one whose name is not that of a recording. `option`: the option that names the recording.
pub fn refuse_recording(
    option: &str,
    path: &Path,
    sources: &[String],
    others: &[Option<&Path>],
) -> Result<(), Failure> {
    if !path.is_file() {
        return refuse_ending(option, path);
    }
    let is_read = sources.iter().any(|source| {
        let file = mcap_file(source).map_or(source.as_str(), |(file, _)| file);
        is_same(path, Path::new(file)) || image_files(source).iter().any(|picture| is_same(path, picture))
    });
    let shown = path.display();
    if is_read || others.iter().flatten().any(|other| is_same(path, other)) {
        return Err(Failure::Arguments(anyhow!("{option} {shown}: expected a place of its own, got one that is read")));
    }
    let start = start(path);
    match start.is_some_and(|start| start.is_empty() || start == MCAP) {
        true => refuse_ending(option, path),
        false => Err(Failure::Arguments(anyhow!("{option}: expected a new file or a recording, got {shown}"))),
    }
}
