//! Tells the crate which commit it was built from, by reading `.git` itself: no git program is needed.

use std::path::{Path, PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let root = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let commit = packaged(&root)
        .or_else(|| checked_out(&root))
        .unwrap_or_else(|| "unknown".into());
    println!("cargo::rustc-env=VARGEO_COMMIT={commit}");
}

/// The commit that `cargo package` noted.
fn packaged(root: &Path) -> Option<String> {
    let note = std::fs::read_to_string(root.join(".cargo_vcs_info.json")).ok()?;
    let after = note.split("\"sha1\"").nth(1)?;
    hash(after.split('"').nth(1)?)
}

/// The commit of the working tree that holds the crate.
fn checked_out(root: &Path) -> Option<String> {
    let git = git_folder(root)?;
    let head_file = git.join("HEAD");
    println!("cargo::rerun-if-changed={}", head_file.display());
    let head = std::fs::read_to_string(head_file).ok()?;
    let Some(reference) = head.trim().strip_prefix("ref: ") else {
        return hash(head.trim());
    };
    // A linked working tree keeps its branches in the main repository.
    let common = match std::fs::read_to_string(git.join("commondir")) {
        Ok(path) => git.join(path.trim()),
        Err(_) => git.clone(),
    };
    let loose = common.join(reference);
    if let Ok(text) = std::fs::read_to_string(&loose) {
        println!("cargo::rerun-if-changed={}", loose.display());
        return hash(text.trim());
    }
    let packed_file = common.join("packed-refs");
    println!("cargo::rerun-if-changed={}", packed_file.display());
    let packed = std::fs::read_to_string(packed_file).ok()?;
    packed
        .lines()
        .find_map(|line| hash(line.strip_suffix(reference)?.trim()))
}

/// `.git` as a folder, or where the file of this name in a linked working tree points to.
fn git_folder(root: &Path) -> Option<PathBuf> {
    let dot_git = root.join(".git");
    if dot_git.is_dir() {
        return Some(dot_git);
    }
    let text = std::fs::read_to_string(&dot_git).ok()?;
    Some(root.join(text.trim().strip_prefix("gitdir: ")?))
}

/// The first twelve digits, if this is a hash at all.
fn hash(text: &str) -> Option<String> {
    (text.len() >= 40 && text.bytes().all(|byte| byte.is_ascii_hexdigit())).then(|| text[..12].to_string())
}
