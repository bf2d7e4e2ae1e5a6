//! Tables kept as text beside the tests: compared line by line, regenerated with REGENERATE=1.

#![allow(clippy::disallowed_methods)] // kept tables are files

use std::fs;
use std::path::Path;

/// Compares a table with the file of this name in the tests' folder, which `REGENERATE=1` rewrites.
pub fn check(name: &str, table: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(name);
    if std::env::var_os("REGENERATE").is_some() {
        fs::write(&path, table).expect("the folder of the tests can be written");
    }
    let expected = fs::read_to_string(&path).unwrap_or_default();
    let (lines, wanted): (Vec<&str>, Vec<&str>) = (table.lines().collect(), expected.lines().collect());
    let differs = |i: &usize| lines.get(*i) != wanted.get(*i);
    let differing: Vec<usize> = (0..lines.len().max(wanted.len())).filter(differs).collect();
    let shown = differing.iter().take(3).map(|&i| {
        let of = |lines: &[&str]| lines.get(i).map_or("(no such line)".to_owned(), |line| line.to_string());
        format!("line {}\n- {}\n+ {}", i + 1, of(&wanted), of(&lines))
    });
    let shown: Vec<String> = shown.collect();
    assert!(differing.is_empty(), "{name}: {} lines differ, the first:\n{}", differing.len(), shown.join("\n"));
}

/// FNV-1a over everything that was added: values without a column cannot change unnoticed either.
pub struct Checksum(u64);

impl Checksum {
    pub fn new() -> Self {
        Checksum(0xcbf2_9ce4_8422_2325)
    }

    pub fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// As eight digits.
    pub fn shown(&self) -> String {
        format!("{:08x}", (self.0 ^ (self.0 >> 32)) as u32)
    }
}
