//! The floors hold: no file names a module above its own, and runner and report stay strangers.

use std::fs;
use std::path::{Path, PathBuf};

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The modules in the order of `lib.rs`, bottom first.
fn floors(source: &Path) -> Vec<String> {
    let text = fs::read_to_string(source.join("lib.rs")).unwrap();
    text.lines()
        .filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';').map(str::to_owned))
        .collect()
}

/// Top-level modules that a text names through `crate::`, with the line. A brace group names each of its members.
fn named(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices("crate::") {
        let line = text[..at].matches('\n').count() + 1;
        let rest = &text[at + "crate::".len()..];
        let word = |part: &str| -> String {
            part.trim_start()
                .chars()
                .take_while(|c| c.is_alphanumeric() || *c == '_')
                .collect()
        };
        if let Some(group) = rest.strip_prefix('{') {
            let mut depth = 0;
            let mut start = 0;
            for (index, character) in group.char_indices() {
                match character {
                    '{' => depth += 1,
                    '}' if depth == 0 => {
                        found.push((line, word(&group[start..index])));
                        break;
                    }
                    '}' => depth -= 1,
                    ',' if depth == 0 => {
                        found.push((line, word(&group[start..index])));
                        start = index + 1;
                    }
                    _ => {}
                }
            }
        } else {
            found.push((line, word(rest)));
        }
    }
    found
}

#[test]
fn brace_groups_are_read() {
    assert_eq!(
        named("use crate::{a::{b, c}, d};\ncrate::e::f"),
        [(1, "a".into()), (1, "d".into()), (2, "e".into())]
    );
}

#[test]
fn no_file_names_a_module_above_its_own() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let floors = floors(&source);
    assert!(floors.len() >= 9, "lib.rs lists the floors one a line");
    let height = |name: &str| floors.iter().position(|floor| floor == name);
    let mut files = Vec::new();
    sources(&source, &mut files);
    let mut broken = Vec::new();
    for path in &files {
        let inside = path.strip_prefix(&source).unwrap();
        let own = inside
            .components()
            .next()
            .unwrap()
            .as_os_str()
            .to_str()
            .unwrap()
            .trim_end_matches(".rs")
            .to_owned();
        let Some(own_height) = height(&own) else {
            continue;
        };
        let text = fs::read_to_string(path).unwrap();
        for (line, name) in named(&text) {
            let strangers = own == "report" && name == "run";
            match height(&name) {
                Some(other) if other > own_height => {
                    broken.push(format!("{}:{line}: {own} names {name}", inside.display()))
                }
                _ if strangers => broken.push(format!("{}:{line}: {own} names {name}", inside.display())),
                _ => {}
            }
        }
    }
    assert!(broken.is_empty(), "floors broken:\n{}", broken.join("\n"));
}

#[test]
fn nothing_up_to_the_methods_opens_a_file_reads_a_clock_or_prints() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let floors = floors(&source);
    let top = floors.iter().position(|floor| floor == "method").unwrap();
    let mut broken = Vec::new();
    for floor in &floors[..=top] {
        let mut files = Vec::new();
        sources(&source.join(floor), &mut files);
        for path in files {
            let text = fs::read_to_string(&path).unwrap();
            for (number, line) in text.lines().enumerate() {
                let code = line.split("//").next().unwrap();
                for word in [
                    "std::fs",
                    "File::open",
                    "std::time",
                    "Instant::now",
                    "SystemTime",
                    "println!",
                    "eprintln!",
                    "dbg!",
                ] {
                    if code.contains(word) {
                        broken.push(format!("{}:{}: {word}", path.display(), number + 1));
                    }
                }
            }
        }
    }
    assert!(broken.is_empty(), "these belong higher up:\n{}", broken.join("\n"));
}
