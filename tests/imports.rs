//! No two files of a crate import each other, neither directly nor through other files.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const CRATES: [&str; 7] = [
    "controller",
    "sim-host",
    "robot-slots",
    "robot-link",
    "evolution",
    "replay",
    "evolver",
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Returns the module path of a file.
fn module(source: &Path, root: &Path) -> Vec<String> {
    let relative = source.strip_prefix(root).unwrap().with_extension("");
    let mut module: Vec<String> = relative
        .iter()
        .map(|part| part.to_string_lossy().into_owned())
        .collect();
    if ["mod", "lib"].contains(&module.last().unwrap().as_str()) {
        module.pop();
    }
    module
}

/// Reads a file, leaving out comments and unit tests.
fn code(source: &Path) -> String {
    let text = fs::read_to_string(source).unwrap();
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let lines = text.lines().map(|line| line.split("//").next().unwrap());
    lines.collect::<Vec<_>>().join(" ")
}

/// Collects the paths of a `use` tree, such as `crate::a::{b, c::d}`.
fn paths(tree: &str, prefix: &str, found: &mut Vec<String>) {
    let mut depth = 0;
    let mut start = 0;
    let ends = tree.char_indices().chain([(tree.len(), ',')]);
    for (place, letter) in ends {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let part = tree[start..place].trim();
                start = place + 1;
                match part.split_once('{') {
                    Some((head, rest)) => {
                        let rest = rest.trim_end().trim_end_matches('}');
                        paths(rest, &format!("{prefix}{head}"), found);
                    }
                    None if part.is_empty() => {}
                    None => found.push(format!("{prefix}{part}")),
                }
            }
            _ => {}
        }
    }
}

/// Returns the modules imported by a module.
fn imports(of: &[String], code: &str, modules: &BTreeSet<Vec<String>>) -> BTreeSet<Vec<String>> {
    let mut found = Vec::new();
    for part in code.split("use ").skip(1) {
        if let Some((tree, _)) = part.split_once(';') {
            paths(tree, "", &mut found);
        }
    }
    for start in ["crate::", "super::"] {
        // Not the middle of a path, and not the scope of a visibility.
        let is_start = |place: usize| {
            let before = &code[..place];
            !before.ends_with("::") && !before.ends_with("pub(in ")
        };
        let places = code.match_indices(start).map(|(place, _)| place);
        let inline = places.filter(|&place| is_start(place)).map(|place| {
            let rest = &code[place..];
            let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
            rest[..end.unwrap_or(rest.len())].to_owned()
        });
        found.extend(inline);
    }
    let resolve = |path: &String| {
        let mut base = of.to_vec();
        let mut parts: Vec<&str> = path.split("::").map(str::trim).collect();
        let is_local = matches!(parts.first(), Some(&"crate" | &"super"));
        while matches!(parts.first(), Some(&"crate" | &"super")) {
            if parts.remove(0) == "crate" {
                base.clear();
            } else {
                base.pop();
            }
        }
        // A path that starts with a child of this module needs no `self`.
        let mut full = base;
        full.extend(parts.iter().map(|&part| part.to_owned()));
        if !is_local && !modules.contains(&full[..=of.len()]) {
            return None;
        }
        while !full.is_empty() && !modules.contains(&full) {
            full.pop();
        }
        (full != of && !full.is_empty()).then_some(full)
    };
    found.iter().filter_map(resolve).collect()
}

/// Returns a cycle that begins at a module, if one exists.
fn cycle<'a>(
    from: &'a Vec<String>,
    edges: &'a BTreeMap<Vec<String>, BTreeSet<Vec<String>>>,
    done: &mut BTreeSet<&'a Vec<String>>,
    way: &mut Vec<&'a Vec<String>>,
) -> bool {
    if way.contains(&from) {
        way.push(from);
        return true;
    }
    if !done.insert(from) {
        return false;
    }
    way.push(from);
    if edges[from].iter().any(|to| cycle(to, edges, done, way)) {
        return true;
    }
    way.pop();
    false
}

#[test]
fn no_two_files_import_each_other() {
    let mut read = 0;
    for name in CRATES {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("..")
            .join(name)
            .join("src");
        let mut files = Vec::new();
        sources(&root, &mut files);
        files.retain(|file| !file.ends_with("tests.rs") && !file.ends_with("main.rs"));
        let modules: BTreeSet<_> = files.iter().map(|file| module(file, &root)).collect();
        let edges: BTreeMap<_, _> = files
            .iter()
            .map(|file| {
                let module = module(file, &root);
                // A re-export alone does not count as an import.
                let code = code(file).replace("pub use ", "pub ");
                let imports = imports(&module, &code, &modules);
                (module, imports)
            })
            .collect();
        read += edges.values().flatten().count();
        let mut done = BTreeSet::new();
        for module in edges.keys() {
            let mut way = Vec::new();
            assert!(
                !cycle(module, &edges, &mut done, &mut way),
                "{name}: {way:?}"
            );
        }
    }
    assert!(read > 200, "{read} imports were read");
}
