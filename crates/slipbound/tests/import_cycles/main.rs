//! No file of the workspace imports itself, directly or through other files.
//!
//! ```text
//!   src/**/*.rs --lex--> use trees, paths in code --resolve through mod and re-exports--> file graph --> cycles
//! ```
//! What counts: every `use`, and every path with `::` in code, public or private, followed through re-exports to the
//! file that defines the item. A re-export of a child by its parent is an import as well: it is harmless as long as the
//! child uses nothing that the parent itself defines. What does not count: `mod` declarations, comments, `#[cfg(test)]`
//! modules. Between crates the manifests count, dev-dependencies included.

#![allow(clippy::disallowed_methods)] // it reads the sources

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

mod lexer;
mod modules;

use modules::Modules;

/// Every cycle of a crate, one line each: `a -> b (by the path that is used) -> a`.
fn cycles(crate_name: &str) -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(crate_name).join("src");
    let roots: Vec<PathBuf> = ["lib.rs", "main.rs"].iter().map(|f| folder.join(f)).filter(|f| f.exists()).collect();
    assert!(!roots.is_empty(), "no crate in {}", folder.display());
    roots.iter().flat_map(|root| describe(&Modules::read(root, &read_file), &folder)).collect()
}

fn read_file(path: &Path) -> Option<String> {
    fs::read_to_string(path).ok()
}

fn describe(modules: &Modules, folder: &Path) -> Vec<String> {
    let name = |file: &PathBuf| file.strip_prefix(folder).unwrap_or(file).display().to_string();
    let line = |cycle: &Vec<PathBuf>| {
        let mut line = name(&cycle[0]);
        for (i, file) in cycle.iter().enumerate() {
            let next = &cycle[(i + 1) % cycle.len()];
            let by = modules.imports().get(file).and_then(|to| to.get(next)).cloned().unwrap_or_default();
            line += &format!(" -> {} (by {by})", name(next));
        }
        line
    };
    shortest_cycles(modules.imports()).iter().map(line).collect()
}

/// For every file on a cycle the shortest cycle through it, each cycle once.
fn shortest_cycles(imports: &BTreeMap<PathBuf, BTreeMap<PathBuf, String>>) -> BTreeSet<Vec<PathBuf>> {
    let mut found = BTreeSet::new();
    for start in imports.keys() {
        let mut came_from: BTreeMap<&PathBuf, &PathBuf> = BTreeMap::new();
        let mut queue = std::collections::VecDeque::from([start]);
        'search: while let Some(file) = queue.pop_front() {
            for next in imports.get(file).into_iter().flat_map(|to| to.keys()) {
                if next == start {
                    let mut cycle = vec![file.clone()];
                    while cycle[cycle.len() - 1] != *start {
                        cycle.push(came_from[&cycle[cycle.len() - 1]].clone());
                    }
                    cycle.reverse();
                    let first = (0..cycle.len()).min_by_key(|i| &cycle[*i]).unwrap_or(0);
                    cycle.rotate_left(first);
                    found.insert(cycle);
                    break 'search;
                }
                if !came_from.contains_key(next) {
                    came_from.insert(next, file);
                    queue.push_back(next);
                }
            }
        }
    }
    found
}

fn assert_none(crate_name: &str) {
    let found = cycles(crate_name);
    assert!(found.is_empty(), "import cycles in {crate_name}:\n  {}", found.join("\n  "));
}

#[test]
fn the_method_has_no_import_cycle() {
    assert_none("slipbound");
}

#[test]
fn the_hardware_crate_has_no_import_cycle() {
    assert_none("slipbound-rig");
}

#[test]
fn the_simulator_has_no_import_cycle() {
    assert_none("slipbound-lab");
}

#[test]
fn the_command_line_has_no_import_cycle() {
    assert_none("slipbound-cli");
}

#[test]
fn no_crate_is_forgotten() {
    let crates = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("..")).expect("the folder of crates");
    let names: BTreeSet<String> = crates
        .map(|e| e.expect("an entry").path())
        .filter(|p| p.join("Cargo.toml").exists())
        .filter_map(|p| Some(p.file_name()?.to_string_lossy().into_owned()))
        .collect();
    assert_eq!(names.iter().collect::<Vec<_>>(), ["slipbound", "slipbound-cli", "slipbound-lab", "slipbound-rig"]);
}

/// As drawn in ARCHITECTURE.md; dev-dependencies, of which cargo allows cycles, too.
#[test]
fn crates_depend_on_each_other_as_drawn() {
    for (name, drawn) in [
        ("slipbound", &[][..]),
        ("slipbound-rig", &["slipbound"]),
        ("slipbound-lab", &["slipbound"]),
        ("slipbound-cli", &["slipbound", "slipbound-lab", "slipbound-rig"]),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name).join("Cargo.toml");
        let manifest = fs::read_to_string(path).expect("a manifest");
        let own = manifest.lines().filter_map(|line| line.split(['.', ' ', '=']).next());
        let own: BTreeSet<&str> = own.filter(|key| key.starts_with("slipbound")).collect();
        assert_eq!(own.into_iter().collect::<Vec<_>>(), drawn, "{name}");
    }
}

/// The cycles of a crate made of these files.
fn cycles_of(files: &[(&str, &str)]) -> Vec<String> {
    let files: BTreeMap<PathBuf, String> =
        files.iter().map(|(name, text)| (PathBuf::from(name), (*text).to_string())).collect();
    describe(&Modules::read(Path::new("lib.rs"), &|path: &Path| files.get(path).cloned()), Path::new(""))
}

#[test]
fn a_cycle_is_found_however_it_is_written() {
    // Through a re-export of the root, a glob, an alias and a path in code.
    let a = "use crate::Second as S; pub struct First; pub fn f(_: S) {}";
    for b in [
        "pub struct Second; use crate::a::First;",
        "pub struct Second; use crate::a::*;",
        "pub struct Second; use super::a::{self}; fn g() { a::f(Second) }",
        "pub struct Second; fn g() { crate::a::f(Second) }",
        "pub struct Second; fn g() { let _: Option<super::First> = None; }",
    ] {
        let found =
            cycles_of(&[("lib.rs", "mod a; mod b; pub use a::First; pub use b::Second;"), ("a.rs", a), ("b.rs", b)]);
        assert_eq!(found.len(), 1, "{b}: {found:?}");
        assert!(found[0].starts_with("a.rs -> b.rs (by crate::Second) -> a.rs (by "), "{found:?}");
    }
}

#[test]
fn a_child_that_uses_what_its_parent_defines_is_a_cycle_and_one_that_does_not_is_none() {
    let child = "use super::Law; pub struct Constant; impl Law for Constant {}";
    let files = |parent| [("lib.rs", "pub mod law;"), ("law.rs", parent), ("law/constant.rs", child)];
    assert_eq!(cycles_of(&files("mod constant; pub use constant::Constant; pub trait Law {}")).len(), 1);
    assert_eq!(cycles_of(&files("mod constant; pub trait Law {}")), Vec::<String>::new());
    let below = [
        ("lib.rs", "pub mod law;"),
        ("law.rs", "mod constant; mod kind; pub use constant::Constant; pub use kind::Law;"),
        ("law/kind.rs", "pub trait Law {}"),
        ("law/constant.rs", child),
    ];
    assert_eq!(cycles_of(&below), Vec::<String>::new());
}

#[test]
fn comments_texts_tests_and_other_crates_do_not_count() {
    let b = r##"//! See crate::a::First.
        /* crate::a::f() /* nested */ */
        use std::fmt; use serde::a::First as Other;
        pub struct Second<'a>(&'a str, char, fmt::Error, Other);
        pub const TEXT: &str = "use crate::a::First;\"";
        pub const RAW: &str = r#"crate::a::f("")"#;
        #[cfg(test)]
        mod tests { use crate::a::First; fn f() { let _ = '}'; } }"##;
    let a = "use crate::b::Second; pub struct First; pub fn f() {}";
    assert_eq!(cycles_of(&[("lib.rs", "mod a; mod b;"), ("a.rs", a), ("b.rs", b)]), Vec::<String>::new());
}
