//! No two modules need each other: what both need is in a file of its own. Looked for over `use` and paths in the sources.
#![allow(missing_docs, clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A path, word by word from the crate's root.
type Words = Vec<String>;

/// The sources of a crate: module (`lines::tcp`, the root is empty) and code without comments, texts and tests.
fn modules(folder: &Path, name: &str, all: &mut BTreeMap<String, String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let inner = [name, &stem].into_iter().filter(|word| !word.is_empty());
        let inner = inner.collect::<Vec<_>>().join("::");
        if path.is_dir() {
            // Programs of their own.
            if inner != "bin" {
                modules(&path, &inner, all);
            }
        } else if !stem.ends_with("tests") && (stem != "main" || !folder.join("lib.rs").exists()) {
            let text = std::fs::read_to_string(&path).unwrap();
            let module = match stem.as_str() {
                "mod" | "lib" | "main" => name.to_owned(),
                _ => inner,
            };
            all.insert(module, bare(&text));
        }
    }
}

/// Without what is there in tests only: a module in a file of its own, or an item with all that is in its braces.
fn untested(text: &str) -> String {
    let margin = |line: &str| line.len() - line.trim_start().len();
    let mut kept = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line.trim() == "#[cfg(test)]" {
            let mut is_open = false;
            let ends = |end: &str| {
                is_open |= end.ends_with('{');
                margin(end) == margin(line) && (end.trim() == "}" || !is_open && end.ends_with(';'))
            };
            assert!(lines.any(ends), "an item of the tests has no end");
        } else {
            kept.push_str(line);
            kept.push('\n');
        }
    }
    kept
}

/// Without the tests, comments and texts, which name modules without needing them.
fn bare(text: &str) -> String {
    let mut kept = String::new();
    for line in untested(text)
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
    {
        let mut inside = false;
        let mut escaped = false;
        for (at, c) in line.char_indices() {
            match c {
                _ if escaped => escaped = false,
                '\\' if inside => escaped = true,
                '"' => inside = !inside,
                '/' if !inside && line[at..].starts_with("//") => break,
                _ if inside => {}
                c => kept.push(c),
            }
        }
        kept.push('\n');
    }
    kept
}

/// `a::{b, c::{d, e as f}}` as `a::b`, `a::c::d`, `a::c::e`.
fn expanded(tree: &str) -> Vec<String> {
    let Some(open) = tree.find('{') else {
        let path = tree.split(" as ").next().unwrap();
        return vec![path.split_whitespace().collect()];
    };
    let (before, inner) = (&tree[..open], &tree[open + 1..tree.rfind('}').unwrap()]);
    let mut parts = vec![String::new()];
    let mut depth = 0;
    for c in inner.chars() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        match c {
            ',' if depth == 0 => parts.push(String::new()),
            c => parts.last_mut().unwrap().push(c),
        }
    }
    let parts = parts.iter().filter(|part| !part.trim().is_empty());
    parts
        .flat_map(|part| expanded(&format!("{before}{part}")))
        .collect()
}

struct Crate {
    modules: BTreeMap<String, String>,
    /// What a module hands on from below itself, and where it is: its front, for which nothing needs the module.
    handed_on: BTreeMap<(String, String), Words>,
}

impl Crate {
    fn read(source: &Path) -> Self {
        let mut modules = BTreeMap::new();
        modules.insert(String::new(), String::new());
        self::modules(source, "", &mut modules);
        Self {
            modules,
            handed_on: BTreeMap::new(),
        }
    }

    /// The path `path` in `module`, from the root; `None` for another crate's.
    fn absolute(&self, module: &str, path: &str) -> Option<Words> {
        let mut at: Words = module.split("::").map(str::to_owned).collect();
        at.retain(|word| !word.is_empty());
        let mut words: Words = path
            .split("::")
            .map(|word| word.trim().to_owned())
            .collect();
        match words[0].as_str() {
            "crate" => {
                words.remove(0);
                return Some(words);
            }
            "self" => drop(words.remove(0)),
            "super" => {
                while words.first().is_some_and(|word| word == "super") {
                    words.remove(0);
                    at.pop();
                }
            }
            first => {
                let child = [&at[..], &[first.to_owned()]].concat().join("::");
                self.modules.get(&child)?;
            }
        }
        Some([at, words].concat())
    }

    /// The paths that each module needs; what it only hands on is kept apart.
    fn needed(&mut self) -> BTreeMap<String, Vec<Words>> {
        let mut needed: BTreeMap<String, Vec<Words>> = BTreeMap::new();
        for (module, code) in &self.modules {
            let paths = needed.entry(module.clone()).or_default();
            let mut body = String::new();
            let mut lines = code.lines();
            while let Some(line) = lines.next() {
                let start = line.trim_start();
                let Some((visibility, tree)) = used(start) else {
                    body.push_str(line);
                    body.push('\n');
                    continue;
                };
                let mut tree = tree.to_owned();
                while !tree.contains(';') {
                    tree.push(' ');
                    tree.push_str(lines.next().unwrap());
                }
                for path in expanded(tree.split(';').next().unwrap()) {
                    let Some(path) = self.absolute(module, &path) else {
                        continue;
                    };
                    let below = path.join("::").starts_with(&format!("{module}::"));
                    match visibility && (below || module.is_empty()) {
                        true => {
                            let name = path.last().unwrap().clone();
                            self.handed_on.insert((module.clone(), name), path);
                        }
                        false => paths.push(path),
                    }
                }
            }
            let apart = |c: char| !(c.is_alphanumeric() || c == '_' || c == ':');
            let inline = body.split(apart).filter(|word| word.contains("::"));
            let inline = inline.map(|word| word.trim_matches(':'));
            paths.extend(inline.filter_map(|path| self.absolute(module, path)));
        }
        needed
    }

    /// The module in which `path` is.
    fn home(&self, path: &[String], depth: usize) -> String {
        let known = |count: &usize| self.modules.contains_key(&path[..*count].join("::"));
        let count = (0..=path.len()).rev().find(known).unwrap();
        let module = path[..count].join("::");
        // A file of another package.
        let beside = path.get(count).map(|name| format!("mod {name};"));
        if beside.is_some_and(|beside| self.modules[&module].contains(&beside)) {
            return path[..=count].join("::");
        }
        let handed = path
            .get(count)
            .and_then(|name| self.handed_on.get(&(module.clone(), name.clone())));
        match handed {
            Some(there) if depth < 5 => {
                self.home(&[&there[..], &path[count + 1..]].concat(), depth + 1)
            }
            _ => module,
        }
    }

    /// Sets of modules each of which needs all the others, some of them by way of others.
    fn circles(mut self) -> Vec<Vec<String>> {
        let needed = self.needed();
        let mut reached: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (module, paths) in &needed {
            let homes = paths.iter().map(|path| self.home(path, 0));
            let others = homes.filter(|home| home != module).collect();
            reached.insert(module.clone(), others);
        }
        loop {
            let before: usize = reached.values().map(BTreeSet::len).sum();
            let names: Vec<String> = reached.keys().cloned().collect();
            for name in names {
                let further: BTreeSet<String> = (reached[&name].iter())
                    .flat_map(|next| reached.get(next).into_iter().flatten().cloned())
                    .collect();
                reached.get_mut(&name).unwrap().extend(further);
            }
            if reached.values().map(BTreeSet::len).sum::<usize>() == before {
                break;
            }
        }
        let mut circles: Vec<Vec<String>> = Vec::new();
        for (module, all) in reached.iter().filter(|(module, all)| all.contains(*module)) {
            let mutual = all.iter().filter(|other| {
                let back = reached.get(*other);
                back.is_some_and(|back| back.contains(module))
            });
            let circle: Vec<String> = mutual.cloned().collect();
            if !circles.contains(&circle) {
                circles.push(circle);
            }
        }
        circles
    }
}

/// Whether a line begins a `use`: whether it hands on, and the tree.
fn used(line: &str) -> Option<(bool, &str)> {
    if let Some(tree) = line.strip_prefix("use ") {
        return Some((false, tree));
    }
    let public = line.strip_prefix("pub")?;
    let public = match public.strip_prefix('(') {
        Some(rest) => rest.split_once(')')?.1,
        None => public,
    };
    Some((true, public.trim_start().strip_prefix("use ")?))
}

/// The sources of all packages below `folder`: what lies beside a `Cargo.toml`, and programs of several files.
fn packages(folder: &Path, found: &mut Vec<PathBuf>) {
    let source = folder.join("src");
    if folder.join("Cargo.toml").exists() && source.exists() {
        let programs = std::fs::read_dir(source.join("bin"));
        let programs = programs.into_iter().flatten();
        let programs = programs.map(|entry| entry.unwrap().path());
        found.extend(programs.filter(|path| path.is_dir()));
        found.push(source);
    }
    for entry in std::fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        let is_searched = !name.starts_with('.') && !["target", "src"].contains(&name.as_str());
        if is_searched && entry.file_type().unwrap().is_dir() {
            packages(&entry.path(), found);
        }
    }
}

#[test]
fn no_module_of_any_package_is_in_a_circle() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut sources = Vec::new();
    packages(&root, &mut sources);
    let mut modules = 0;
    let mut circles = BTreeMap::new();
    for source in &sources {
        let read = Crate::read(source);
        modules += read.modules.len();
        let found = read.circles();
        if !found.is_empty() {
            circles.insert(source, found);
        }
    }
    assert!(
        sources.len() > 10 && modules > 600,
        "{sources:?}: {modules}"
    );
    assert!(circles.is_empty(), "{circles:#?}");
}

#[test]
fn a_circle_is_found_by_way_of_a_third_and_a_front_is_none() {
    let source = |modules: &[(&str, &str)]| Crate {
        modules: (modules.iter())
            .map(|(name, code)| ((*name).to_owned(), bare(code)))
            .collect(),
        handed_on: BTreeMap::new(),
    };
    let round = source(&[
        ("", "pub mod a;\npub mod b;"),
        ("a", "use crate::{b::{self, B}};"),
        ("b", "fn f() { super::c::g() }"),
        (
            "c",
            "// of `a`\nuse crate::a::{\n    A,\n};\nconst A: &str = \"crate::b\";",
        ),
    ]);
    assert_eq!(round.circles(), [["a", "b", "c"]]);
    let front = source(&[
        (
            "a",
            "mod one;\nmod two;\npub use one::One;\npub struct Zero;",
        ),
        ("a::one", "use super::Zero;"),
        ("a::two", "use super::One;"),
    ]);
    assert!(front.circles().is_empty());
    let tested = source(&[
        ("a", "#[cfg(test)]\nmod tests;\nuse crate::b::B;"),
        (
            "b",
            "#[cfg(test)]\nmod tests {\n    use crate::c::C;\n}\nuse crate::a::A;",
        ),
        ("c", "use crate::b::B;"),
    ]);
    assert_eq!(tested.circles(), [["a", "b"]]);
    let back = source(&[
        ("a", "mod one;\nuse one::One;\npub struct Zero;"),
        ("a::one", "use super::Zero;"),
    ]);
    assert_eq!(back.circles(), [["a", "a::one"]]);
}
