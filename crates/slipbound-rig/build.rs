//! Lists the sensor files of the repository, so that a new finger needs only a new file.

use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

fn main() {
    let here = env::var("CARGO_MANIFEST_DIR").expect("set by cargo");
    let folder = Path::new(&here).join("sensors");
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut files: Vec<_> = fs::read_dir(&folder)
        .expect("a link to the folder sensors/ of the repository, or a copy in a package")
        .map(|entry| entry.expect("can be listed").path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    let mut list = String::from("&[\n");
    for file in files {
        let name = file.file_stem().expect("a name").to_string_lossy();
        writeln!(list, "    ({name:?}, include_str!({:?})),", file.display().to_string()).expect("a String takes all");
    }
    list.push(']');
    let out = env::var("OUT_DIR").expect("set by cargo");
    fs::write(Path::new(&out).join("sensors.rs"), list).expect("the build folder can be written");

    // The schema of a report goes into every recording.
    let schema = Path::new(&here).join("report.schema.json");
    println!("cargo::rerun-if-changed={}", schema.display());
    fs::copy(&schema, Path::new(&out).join("report.schema.json"))
        .expect("a link to docs/report.schema.json, or a copy in a package");
}
