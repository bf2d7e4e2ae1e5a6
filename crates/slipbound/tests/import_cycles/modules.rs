//! The modules of a crate: what each defines, imports and names in code, and therefore which file imports which.

use super::lexer::{Token, lex};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Names from the root of the crate down to a module.
type ModulePath = Vec<String>;

/// A `use` of one name.
#[derive(Debug, Clone)]
struct Import {
    path: Vec<String>,
    /// None for a glob.
    name: Option<String>,
    /// Whether it is a re-export: `pub use`, `pub(crate) use`.
    public: bool,
}

#[derive(Debug, Default)]
struct Module {
    file: PathBuf,
    items: BTreeSet<String>,
    imports: Vec<Import>,
    /// Paths of two words and more outside `use`.
    paths: BTreeSet<Vec<String>>,
}

/// The target of a path.
enum Target {
    Module(ModulePath),
    /// An item, by the file that defines it.
    Item(PathBuf),
}

/// Maximum length of a chain of re-exports.
const LONGEST_CHAIN: usize = 16;

/// All modules of a crate.
pub struct Modules {
    all: BTreeMap<ModulePath, Module>,
    imports: BTreeMap<PathBuf, BTreeMap<PathBuf, String>>,
}

impl Modules {
    /// Reads a crate, starting from its root file.
    pub fn read(root: &Path, read: &dyn Fn(&Path) -> Option<String>) -> Modules {
        let mut modules = Modules { all: BTreeMap::new(), imports: BTreeMap::new() };
        let folder = root.parent().unwrap_or(Path::new(""));
        modules.add_file(Vec::new(), root, folder, read);
        modules.imports = modules.file_imports();
        modules
    }

    /// Which file imports which others, each by the path that leads there.
    pub fn imports(&self) -> &BTreeMap<PathBuf, BTreeMap<PathBuf, String>> {
        &self.imports
    }

    fn add_file(&mut self, path: ModulePath, file: &Path, folder: &Path, read: &dyn Fn(&Path) -> Option<String>) {
        let text = read(file).unwrap_or_else(|| panic!("no file {}", file.display()));
        self.add(path, file, folder, &lex(&text), read);
    }

    fn add(
        &mut self,
        path: ModulePath,
        file: &Path,
        folder: &Path,
        t: &[Token],
        read: &dyn Fn(&Path) -> Option<String>,
    ) {
        let mut module = Module { file: file.into(), ..Module::default() };
        let (mut i, mut depth) = (0, 0);
        while i < t.len() {
            match &t[i] {
                Token::Sign('#') if is_test_attribute(&t[i..]) => i = after_item(t, i),
                Token::Sign(v) => {
                    depth += i32::from(*v == '{') - i32::from(*v == '}');
                    i += 1;
                }
                Token::Into => i += 1,
                Token::Word(w) if w == "use" => {
                    let public =
                        i > 0 && (matches!(&t[i - 1], Token::Word(w) if w == "pub") || t[i - 1] == Token::Sign(')'));
                    let from = module.imports.len();
                    i = parse_use(t, i + 1, &mut Vec::new(), &mut module.imports);
                    module.imports[from..].iter_mut().for_each(|import| import.public = public);
                }
                Token::Word(w) if w == "mod" && depth == 0 => {
                    let (name, inner) = (word(t, i + 1), folder.join(word(t, i + 1)));
                    let child: ModulePath = path.iter().cloned().chain([name.clone()]).collect();
                    if t.get(i + 2) == Some(&Token::Sign('{')) {
                        let end = closing(t, i + 2);
                        self.add(child, file, &inner, &t[i + 3..end], read);
                        i = end + 1;
                    } else {
                        let own = [inner.with_extension("rs"), inner.join("mod.rs")];
                        let child_file = own.iter().find(|f| read(f).is_some()).unwrap_or(&own[0]);
                        self.add_file(child, child_file, &inner, read);
                        i += 3;
                    }
                }
                Token::Word(w) => {
                    let defines = ["struct", "enum", "union", "trait", "fn", "const", "static", "type", "macro_rules"];
                    if depth == 0 && defines.contains(&w.as_str()) {
                        let skipped = usize::from(t.get(i + 1) == Some(&Token::Sign('!')));
                        module.items.insert(word(t, i + 1 + skipped));
                    }
                    let end = end_of_path(t, i);
                    if end > i + 1 {
                        let names =
                            t[i..end].iter().filter_map(|t| if let Token::Word(w) = t { Some(w) } else { None });
                        module.paths.insert(names.cloned().collect());
                    }
                    i = end;
                }
            }
        }
        self.all.insert(path, module);
    }

    fn file_imports(&self) -> BTreeMap<PathBuf, BTreeMap<PathBuf, String>> {
        let mut imports: BTreeMap<PathBuf, BTreeMap<PathBuf, String>> = BTreeMap::new();
        for (at, module) in &self.all {
            // Of several imports of a file, one that is more than a re-export is preferred.
            let used = |public: bool| module.imports.iter().filter(move |i| i.public == public);
            let in_code = module.paths.iter().map(|p| (p, false, ""));
            let private = used(false).map(|i| (&i.path, i.name.is_none(), ""));
            let handed_on = used(true).map(|i| (&i.path, i.name.is_none(), "pub use "));
            for (path, glob, how) in private.chain(in_code).chain(handed_on) {
                let to = match self.resolve(at, path, LONGEST_CHAIN) {
                    Some(Target::Item(file)) => file,
                    Some(Target::Module(to)) if glob => self.all[&to].file.clone(),
                    _ => continue,
                };
                if to != module.file {
                    imports
                        .entry(module.file.clone())
                        .or_default()
                        .entry(to)
                        .or_insert_with(|| format!("{how}{}", path.join("::")));
                }
            }
        }
        imports
    }

    /// The target of a path written in a module; None for a path of another crate.
    fn resolve(&self, from: &ModulePath, path: &[String], chain: usize) -> Option<Target> {
        let (first, mut rest) = path.split_first()?;
        let mut target = match first.as_str() {
            "crate" => Target::Module(Vec::new()),
            "self" => Target::Module(from.clone()),
            "super" => Target::Module(from.split_last()?.1.to_vec()),
            name => self.look_up(from, name, rest.is_empty(), chain)?,
        };
        while let (Target::Module(module), Some((name, further))) = (&target, rest.split_first()) {
            target = match name.as_str() {
                "super" => Target::Module(module.split_last()?.1.to_vec()),
                name => self.look_up(module, name, further.is_empty(), chain)?,
            };
            rest = further;
        }
        Some(target)
    }

    /// The meaning of a name in a module. A function may have the name of a module: the last name of a path is taken as
    /// the function.
    fn look_up(&self, at: &ModulePath, name: &str, last: bool, chain: usize) -> Option<Target> {
        let module = self.all.get(at)?;
        let chain = chain.checked_sub(1)?;
        let child: ModulePath = at.iter().cloned().chain([name.to_string()]).collect();
        let child = self.all.contains_key(&child).then_some(Target::Module(child));
        let item = || module.items.contains(name).then(|| Target::Item(module.file.clone()));
        let named = module.imports.iter().filter(|i| i.name.as_deref() == Some(name));
        let mut imported = named.filter_map(|i| self.resolve(at, &i.path, chain));
        let found = match last {
            true => item().or_else(|| imported.next()).or(child),
            false => child.or_else(|| imported.next()).or_else(item),
        };
        found.or_else(|| {
            let globs = module.imports.iter().filter(|i| i.name.is_none());
            globs.filter_map(|i| self.resolve(at, &i.path, chain)).find_map(|target| match target {
                Target::Module(from) if from != *at => self.look_up(&from, name, last, chain),
                _ => None,
            })
        })
    }
}

fn word(t: &[Token], i: usize) -> String {
    if let Some(Token::Word(w)) = t.get(i) { w.clone() } else { String::new() }
}

/// The position after the last word of the path that begins at `from`.
fn end_of_path(t: &[Token], from: usize) -> usize {
    let mut end = from + 1;
    while let [Token::Into, Token::Word(_), ..] = t[end..] {
        end += 2;
    }
    end
}

/// Where the bracket at `open` is closed.
fn closing(t: &[Token], open: usize) -> usize {
    let mut depth = 0;
    for (i, token) in t.iter().enumerate().skip(open) {
        match token {
            Token::Sign('{' | '[' | '(') => depth += 1,
            Token::Sign('}' | ']' | ')') => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return i;
        }
    }
    t.len()
}

fn is_test_attribute(t: &[Token]) -> bool {
    let words: Vec<&str> =
        t.iter().take(5).filter_map(|t| if let Token::Word(w) = t { Some(w.as_str()) } else { None }).collect();
    words == ["cfg", "test"]
}

/// The position after the item that the attribute at `from` belongs to.
fn after_item(t: &[Token], from: usize) -> usize {
    let mut i = from;
    let mut is_use = false;
    while i < t.len() {
        match &t[i] {
            Token::Sign('[' | '(') => i = closing(t, i),
            Token::Sign('{') if is_use => i = closing(t, i),
            Token::Sign('{') => return closing(t, i) + 1,
            Token::Sign(';') => return i + 1,
            Token::Word(w) => is_use |= w == "use",
            _ => {}
        }
        i += 1;
    }
    i
}

/// Parses one tree of a `use` after its prefix; returns the position after it.
fn parse_use(t: &[Token], from: usize, path: &mut Vec<String>, imports: &mut Vec<Import>) -> usize {
    let (known, mut i) = (path.len(), from);
    let mut name = None;
    loop {
        match t.get(i) {
            Some(Token::Word(w)) if w == "as" => {
                name = Some(word(t, i + 1));
                i += 2;
            }
            Some(Token::Word(w)) => {
                path.push(w.clone());
                i += 1;
            }
            Some(Token::Into) => i += 1,
            Some(Token::Sign('*')) => {
                imports.push(Import { path: path.clone(), name: None, public: false });
                path.truncate(known);
                return i + 1;
            }
            Some(Token::Sign('{')) => {
                let end = closing(t, i);
                i += 1;
                while i < end {
                    i = parse_use(t, i, path, imports);
                    i += usize::from(t.get(i) == Some(&Token::Sign(',')));
                }
                path.truncate(known);
                return end + 1;
            }
            _ => break,
        }
    }
    if path.len() > known {
        // `{self, ...}` names the prefix itself.
        if known > 0 && path[known..] == ["self"] {
            path.truncate(known);
        }
        let name = name.or_else(|| path.last().cloned());
        imports.push(Import { path: path.clone(), name, public: false });
    }
    path.truncate(known);
    i
}
