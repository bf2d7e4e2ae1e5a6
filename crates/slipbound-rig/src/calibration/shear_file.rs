//! Puts a measured shear stiffness into an existing sensor file.

use super::sensor_file::{STIFFNESS_COMMENT, shear_table};
use crate::config::read_most;
use crate::config::sensors::is_file;
use slipbound::sensor::Shear;
use std::io;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Why a sensor file cannot take a shear stiffness.
#[derive(Debug, thiserror::Error)]
pub enum ShearFileError {
    /// The sensor file cannot be read.
    #[error("{}: cannot read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// The sensor file extends another file by a relative path, which is valid only in its own folder.
    #[error(
        "expected a file in the folder of {}, which extends another file, got {}", path.display(), output.display()
    )]
    Folder {
        /// The sensor file.
        path: PathBuf,
        /// The file to be written.
        output: PathBuf,
    },
}

/// The text of the sensor's own file, with the shear stiffness replacing an older one; for a built-in finger a file
/// that extends it. `sensor`: a built-in name or a sensor file; `output`: where the text will be written.
pub fn sensor_file_with_shear(sensor: &str, output: &Path, shear: &Shear) -> Result<String, ShearFileError> {
    let (path, table) = (Path::new(sensor), shear_table(shear));
    if !is_file(sensor) {
        return Ok(format!("extends = \"{sensor}\"\n\n{table}"));
    }
    let text = read_most(path).map_err(|source| ShearFileError::Read { path: path.to_owned(), source })?;
    if extends_relative_file(&text) && folder(path) != folder(output) {
        return Err(ShearFileError::Folder { path: path.to_owned(), output: output.to_owned() });
    }
    Ok(format!("{}\n\n{table}", without_shear(&text).trim_end()))
}

/// Whether a sensor file extends another file, which is searched in its own folder.
fn extends_relative_file(text: &str) -> bool {
    let extends = text.parse::<Table>().ok().and_then(|mut table| table.remove("extends"));
    matches!(extends, Some(Value::String(name)) if is_file(&name) && Path::new(&name).is_relative())
}

/// The folder of a file, however its path is written; None where there is no such folder.
fn folder(file: &Path) -> Option<PathBuf> {
    let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty());
    parent.unwrap_or(Path::new(".")).canonicalize().ok()
}

/// The text without its table [shear] and our comment above it. Comments above the table that follows are kept.
fn without_shear(text: &str) -> String {
    let mut kept: Vec<&str> = Vec::new();
    let mut above_next: Vec<&str> = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        if line.trim_start().starts_with('[') {
            kept.append(&mut above_next);
            inside = is_shear_header(line);
            if inside && kept.last() == Some(&STIFFNESS_COMMENT) {
                kept.pop();
            }
        }
        match inside {
            false => kept.push(line),
            true if line.trim_start().starts_with('#') => above_next.push(line),
            true => above_next.clear(),
        }
    }
    kept.join("\n")
}

/// Whether a line is the header of the table `shear`, in any of the forms that TOML has for it.
fn is_shear_header(line: &str) -> bool {
    let parts = line.trim().strip_prefix('[').and_then(|rest| rest.split_once(']'));
    parts.is_some_and(|(name, after)| {
        let after = after.trim_start();
        ["shear", "\"shear\"", "'shear'"].contains(&name.trim()) && (after.is_empty() || after.starts_with('#'))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_older_measurement_is_replaced() {
        let text = "name = \"a\"\n\n# Mine.\n[shear]\nstiffness_n_per_pitch = 1.0\n# by me\nprovenance = \"x\"\n\n# Of the other.\n[other]\nb = 1\n";
        let rest = "name = \"a\"\n\n# Mine.\n# Of the other.\n[other]\nb = 1";
        assert_eq!(without_shear(text), rest);
        let ours = shear_table(&Shear { stiffness_n_per_pitch: 1.0, provenance: "x".into() });
        assert_eq!(
            without_shear(&format!("name = \"a\"\n{ours}\n# Of the other.\n[other]")),
            "name = \"a\"\n# Of the other.\n[other]"
        );
        assert_eq!(without_shear("name = \"a\""), "name = \"a\"");
        for header in ["[shear]  # by [me]", "[ shear ]", "  [shear]\t", "[\"shear\"]", "['shear'] #"] {
            let text = format!("name = \"a\"\n{header}\nstiffness_n_per_pitch = 1.0\n[[other]]\nb = 1\n");
            assert_eq!(without_shear(&text), "name = \"a\"\n[[other]]\nb = 1", "{header}");
        }
        for header in ["[shears]", "[[shear]]", "[shear.more]", "[shear] x"] {
            assert!(!is_shear_header(header), "{header}");
        }
    }

    #[test]
    fn a_file_that_extends_another_stays_in_its_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        let (path, shear) =
            (folder.path().join("a.toml"), Shear { stiffness_n_per_pitch: 0.5, provenance: "x".into() });
        std::fs::write(&path, "extends = \"base.toml\"\n").expect("writes");
        let name = path.to_str().expect("UTF-8");
        std::fs::create_dir(folder.path().join("sub")).expect("makes a folder");
        for output in ["b.toml", "a.toml", "sub/../b.toml"] {
            let text = sensor_file_with_shear(name, &folder.path().join(output), &shear).expect("the same folder");
            assert!(text.starts_with("extends = \"base.toml\"\n\n# Newtons"), "{text}");
        }
        let refused = sensor_file_with_shear(name, Path::new("b.toml"), &shear).expect_err("another folder");
        assert_eq!(
            refused.to_string(),
            format!("expected a file in the folder of {name}, which extends another file, got b.toml")
        );
        for anywhere in ["gelslim".to_owned(), folder.path().join("base.toml").display().to_string()] {
            std::fs::write(&path, format!("extends = {anywhere:?}\n")).expect("writes");
            sensor_file_with_shear(name, Path::new("b.toml"), &shear).expect("found from any folder");
        }
        let built_in = sensor_file_with_shear("gelslim", Path::new("b.toml"), &shear).expect("built in");
        assert!(built_in.starts_with("extends = \"gelslim\"\n\n# Newtons"), "{built_in}");
        // A folder of that name, as `src` is here, is no finger.
        sensor_file_with_shear("src", Path::new("b.toml"), &shear).expect("a built-in name");
    }
}
