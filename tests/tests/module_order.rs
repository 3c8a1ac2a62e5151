//! The order of the modules of `quest-core` that ARCHITECTURE.md promises: imports run one way.
#![expect(clippy::unwrap_used, reason = "a source that cannot be read is a failed test")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Rooms from the first to the last: none imports one that stands after it in its line.
const ORDERS: [&[&str]; 6] = [
    &["algebra", "pose", "solver", "lanes", "robust", "servo"],
    &["robust::data", "robust::refine", "robust::search", "robust::conclude"],
    &["solver::shared", "solver::published", "solver::many_matches", "solver::quaternions"],
    &["solver::quest::cubics", "solver::quest::five_matches", "solver::many_matches", "solver::quest"],
    &["servo::laws", "servo::estimators", "servo::controller", "servo::simulation"],
    &["camera", "pose", "correspondence", "structure", "feasibility", "solver"],
];

/// Every module and the modules that it imports, tests left out.
fn imports() -> BTreeMap<String, BTreeSet<String>> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/quest-core/src");
    let mut files = Vec::new();
    collect(&source, &mut files);
    let modules: BTreeMap<String, String> =
        files.iter().map(|file| (module(&source, file), std::fs::read_to_string(file).unwrap())).collect();
    let of = |name: &str, text: &str| {
        let text: String = text
            .split("#[cfg(test)]\nmod tests {")
            .next()
            .unwrap_or_default()
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"))
            .collect::<Vec<_>>()
            .join("\n");
        let paths = text.split("use ").skip(1).filter_map(|rest| rest.split(';').next()).map(str::to_owned);
        paths.flat_map(|path| expanded(name, &path)).filter_map(|path| owner(&modules, &path)).collect()
    };
    modules
        .iter()
        .map(|(name, text)| {
            let mut imported: BTreeSet<String> = of(name, text);
            imported.remove(name);
            (name.clone(), imported)
        })
        .collect()
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let is_test = path.file_stem().is_some_and(|stem| stem.to_string_lossy().starts_with("test"));
        if path.is_dir() && !is_test {
            collect(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") && !is_test {
            files.push(path);
        }
    }
}

/// `robust/search/mod.rs` is `robust::search`.
fn module(source: &Path, file: &Path) -> String {
    let path = file.strip_prefix(source).unwrap().with_extension("");
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    parts.join("::").trim_end_matches("::mod").to_owned()
}

/// The full paths of one `use`, from the root of the crate.
fn expanded(name: &str, path: &str) -> Vec<String> {
    let (stem, items) = path.split_once('{').map_or((path, ""), |(stem, items)| (stem, items));
    let mut base: Vec<&str> = match stem.trim().split("::").next() {
        Some("crate") => Vec::new(),
        Some("self") => name.split("::").collect(),
        Some("super") => {
            let parent = name.rsplit_once("::").map_or("", |(parent, _)| parent);
            parent.split("::").filter(|part| !part.is_empty()).collect()
        }
        _ => return Vec::new(),
    };
    base.extend(stem.split("::").skip(1).map(str::trim).filter(|part| !part.is_empty()));
    let base = base.join("::");
    let items = items.trim_end_matches('}').split([',', '{', '}']).map(str::trim);
    items.map(|item| format!("{base}::{item}")).chain([base.clone()]).collect()
}

/// The module that a path leads to: the longest part of it that is one.
fn owner(modules: &BTreeMap<String, String>, path: &str) -> Option<String> {
    let parts: Vec<_> = path.split("::").collect();
    (1..=parts.len()).rev().map(|n| parts[..n].join("::")).find(|name| modules.contains_key(name))
}

fn is_within(module: &str, room: &str) -> bool {
    module == room || module.strip_prefix(room).is_some_and(|rest| rest.starts_with("::"))
}

#[test]
fn rooms_import_one_way() {
    let imports = imports();
    assert!(imports.len() > 100, "{} modules were found", imports.len());
    for order in ORDERS {
        for room in order {
            assert!(imports.keys().any(|module| is_within(module, room)), "there is no {room}");
        }
        // The room that a module belongs to is the most specific one of the line.
        let place = |module: &str| {
            let rooms = order.iter().enumerate().filter(|(_, room)| is_within(module, room));
            rooms.max_by_key(|(_, room)| room.len()).map(|(place, _)| place)
        };
        for (module, imported) in &imports {
            for other in imported {
                if let (Some(from), Some(to)) = (place(module), place(other)) {
                    assert!(to <= from, "{module} imports {other}, against the order {order:?}");
                }
            }
        }
    }
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let imports = imports();
    let mut circles = Vec::new();
    for start in imports.keys() {
        // Everything that the module leads to.
        let mut reached = BTreeSet::new();
        let mut open: Vec<&String> = imports[start].iter().collect();
        while let Some(module) = open.pop() {
            if reached.insert(module) {
                open.extend(&imports[module]);
            }
        }
        if reached.contains(start) {
            circles.push(start.clone());
        }
    }
    assert!(circles.is_empty(), "{circles:#?}");
}
