//! `vargeo explain`: why two stored jobs have different keys.

use super::Exit;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Compares the jobs of two keys in the store and names the first field that differs.
#[derive(clap::Args)]
pub struct Arguments {
    /// A key, or enough of its first digits.
    first: String,
    /// The other key.
    second: String,
    /// The folder of results.
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
}

/// Prints what differs.
pub fn execute(arguments: Arguments) -> Exit {
    let store = arguments.results.join("store");
    let jobs = find(&store, &arguments.first).and_then(|first| Ok((first, find(&store, &arguments.second)?)));
    let ((first_key, first), (second_key, second)) = match jobs {
        Ok(jobs) => jobs,
        Err(message) => {
            tell!("error: {message}");
            return Exit::FileWrong;
        }
    };
    let mut differences = Vec::new();
    compare(&first, &second, String::new(), &mut differences);
    match differences.split_first() {
        None if first_key == second_key => answer!("both are the job {first_key}"),
        None => answer!(
            "the jobs are the same, and the keys are not: one of the records is damaged; run `vargeo store verify`"
        ),
        Some(((field, first, second), rest)) => {
            answer!("the jobs differ in {field}");
            answer!("  {}  {first}", short(&first_key));
            answer!("  {}  {second}", short(&second_key));
            if !rest.is_empty() {
                let fields: Vec<&str> = rest.iter().map(|(field, _, _)| field.as_str()).collect();
                answer!("and in {}", fields.join(", "));
            }
        }
    }
    Exit::Well
}

fn short(key: &str) -> &str {
    key.get(..12).unwrap_or(key)
}

/// The key that begins with these digits, and its job.
fn find(store: &Path, digits: &str) -> Result<(String, Value), String> {
    if digits.len() < 4 || digits.len() > 64 || !digits.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return Err(format!(
            "\"{digits}\" is no key; give at least four of its 64 hexadecimal digits, as `vargeo plan` shows them"
        ));
    }
    let digits = digits.to_lowercase();
    let shard = store.join(&digits[..2]);
    let mut found = Vec::new();
    for entry in std::fs::read_dir(&shard).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with(&digits) && entry.path().join("record.json").is_file() {
            found.push(name);
        }
    }
    found.sort();
    let key = match found.as_slice() {
        [] => {
            return Err(format!(
                "{} has no record of {digits}; run its experiment first",
                store.display()
            ));
        }
        [key] => key.clone(),
        several => {
            return Err(format!(
                "{digits} begins {} keys: {}; give more digits",
                several.len(),
                several.join(", ")
            ));
        }
    };
    let path = shard.join(&key).join("record.json");
    let text =
        std::fs::read_to_string(&path).map_err(|error| format!("{}: cannot be read: {error}", path.display()))?;
    let record: Value = serde_json::from_str(&text)
        .map_err(|error| format!("{}: damaged ({error}); run `vargeo store verify`", path.display()))?;
    match record.get("job") {
        Some(job) => Ok((key, job.clone())),
        None => Err(format!(
            "{}: damaged (no job in it); run `vargeo store verify`",
            path.display()
        )),
    }
}

/// Fields by dotted path with both values, in the order of the keys.
fn compare(first: &Value, second: &Value, path: String, differences: &mut Vec<(String, String, String)>) {
    match (first, second) {
        (Value::Object(first), Value::Object(second)) => {
            let mut names: Vec<&String> = first.keys().chain(second.keys()).collect();
            names.sort();
            names.dedup();
            for name in names {
                let inner = if path.is_empty() {
                    name.clone()
                } else {
                    format!("{path}.{name}")
                };
                compare(
                    first.get(name).unwrap_or(&Value::Null),
                    second.get(name).unwrap_or(&Value::Null),
                    inner,
                    differences,
                );
            }
        }
        _ if first != second => differences.push((path, show(first), show(second))),
        _ => {}
    }
}

fn show(value: &Value) -> String {
    match value {
        Value::Null => "absent".to_owned(),
        other => other.to_string(),
    }
}
