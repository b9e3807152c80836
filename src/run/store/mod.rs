//! The store: every finished job's record and artifacts under the job's key, published whole and verified when read.
//!
//! ```text
//! <root>/<aa>/<key>/{record.json, mesh.vtu, manifest.json, ...}    aa: the first two digits of the key
//! <root>/failures/<key>.json    crashes and limits: shown in reports, tried again by the next run
//! <root>/quarantine/            damaged entries, and results that contradict a stored one
//! <root>/locks/                 one process computes, the others wait
//! <root>/tmp/                   entries being written
//! ```
//!
//! Guarantees. An entry is there whole or not at all, whatever instant its writer is killed at: its files are written
//! beside the store's entries, synced, and the folder is renamed into place. An entry that differs from its manifest in
//! any byte is never returned: it is moved to `quarantine/` and reads as a miss. Any number of processes and machines may
//! read and write at once; no lock is needed for correctness. Nothing is overwritten except a measurement by a
//! newer one of the same result.
//!
//! Not guaranteed: protection against someone who forges manifests, or against a file system whose rename is not atomic.

mod lock;
mod manifest;
mod publish;
mod upkeep;

pub use lock::{Lock, Sharing};
pub use publish::{Publication, Step};
pub use upkeep::{Damage, Garbage, GarbageKind, Statistics};

use crate::experiment::job::{Key, sha256};
use crate::experiment::record::{JobResult, RECORD_SCHEMA, Record};
use manifest::Manifest;
use std::collections::BTreeMap;
use std::fs::{File, Permissions};
use std::io;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// The record's name within an entry.
pub const RECORD: &str = "record.json";
/// The result mesh's name within an entry.
pub const MESH: &str = "mesh.vtu";
const MANIFEST: &str = "manifest.json";

/// Files of a result by their name within an entry.
pub type Artifacts = BTreeMap<String, Vec<u8>>;

/// A folder of results by key.
#[derive(Clone, Debug)]
pub struct Store {
    root: PathBuf,
}

/// What a store could not do: the path and the system's reason.
#[derive(Debug)]
pub struct StoreError {
    pub action: String,
    pub path: PathBuf,
    pub source: io::Error,
}

impl std::fmt::Display for StoreError {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let StoreError { action, path, source } = self;
        write!(formatter, "cannot {action} {}: {source}", path.display())?;
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                write!(formatter, "; free some space and run again, finished jobs are kept")
            }
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                write!(formatter, "; make it writable or name another folder with --results")
            }
            _ => Ok(()),
        }
    }
}

impl std::error::Error for StoreError {}

/// Names the action and the path of a system error.
fn failed<'a>(action: &'a str, path: &'a Path) -> impl FnOnce(io::Error) -> StoreError + 'a {
    move |source| StoreError {
        action: action.into(),
        path: path.into(),
        source,
    }
}

/// What the store holds under a key.
#[derive(Debug)]
pub enum Lookup {
    Hit(Box<Record>),
    Miss,
    /// Something was there that must not be used.
    Damaged {
        reason: String,
        /// Where it was moved to, or why it could not be moved.
        quarantine: Result<PathBuf, String>,
    },
}

impl Store {
    /// The store in a folder, which need not exist yet.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Store { root: root.into() }
    }

    /// Its folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where the entry of a key is, or would be.
    pub fn entry(&self, key: &Key) -> PathBuf {
        self.shard(key).join(&key.0)
    }

    fn shard(&self, key: &Key) -> PathBuf {
        self.root.join(key.0.get(..2).unwrap_or("__"))
    }

    fn temporary(&self) -> PathBuf {
        self.root.join("tmp")
    }

    fn quarantine(&self) -> PathBuf {
        self.root.join("quarantine")
    }

    fn locks(&self) -> PathBuf {
        self.root.join("locks")
    }

    fn failure_path(&self, key: &Key) -> PathBuf {
        self.root.join("failures").join(format!("{}.json", key.0))
    }

    /// Creates the folders and makes sure that files can be written, so that a batch fails before its first job.
    pub fn prepare(&self) -> Result<(), StoreError> {
        for folder in [self.temporary(), self.locks(), self.root.join("failures")] {
            std::fs::create_dir_all(&folder).map_err(failed("create the folder", &folder))?;
        }
        let folder = self.temporary();
        tempfile::tempfile_in(&folder)
            .map(drop)
            .map_err(failed("write into the folder", &folder))
    }

    /// Reads and verifies the entry of a key.
    pub fn lookup(&self, key: &Key) -> Lookup {
        if !is_key(&key.0) {
            return Lookup::Miss;
        }
        let entry = self.entry(key);
        // A writer may replace the entry while it is read: then what was read is a mixture, and is read again.
        for _ in 0..4 {
            let before = identity(&entry);
            match read_entry(&entry, key) {
                Ok(record) => return Lookup::Hit(Box::new(record)),
                Err(Fault::Absent | Fault::OtherSchema) => return Lookup::Miss,
                Err(_) if identity(&entry) != before => {}
                Err(Fault::Unreadable(reason)) => {
                    return Lookup::Damaged {
                        quarantine: Err("left in place, since it may be readable later".into()),
                        reason,
                    };
                }
                Err(Fault::Damaged(reason)) => {
                    return match self.quarantine_entry(key) {
                        Ok(Some(path)) => Lookup::Damaged {
                            reason,
                            quarantine: Ok(path),
                        },
                        // Another process has moved it away or replaced it.
                        Ok(None) => continue,
                        Err(error) => Lookup::Damaged {
                            reason,
                            quarantine: Err(error.to_string()),
                        },
                    };
                }
            }
        }
        Lookup::Miss
    }

    /// The recorded failure of a key: a crash or a limit.
    pub fn failure(&self, key: &Key) -> Option<Record> {
        if !is_key(&key.0) {
            return None;
        }
        let bytes = std::fs::read(self.failure_path(key)).ok()?;
        let record: Record = serde_json::from_slice(&bytes).ok()?;
        (record.key == *key).then_some(record)
    }

    /// Moves the damaged entry of a key out of the way. `None` when a sound one, or none, is there after all.
    fn quarantine_entry(&self, key: &Key) -> Result<Option<PathBuf>, StoreError> {
        let folder = self.quarantine();
        std::fs::create_dir_all(&folder).map_err(failed("create the folder", &folder))?;
        let place = unused(&folder, key)?;
        let entry = self.entry(key);
        let moved = match std::fs::rename(&entry, &place) {
            Err(error) if error.kind() == io::ErrorKind::IsADirectory => {
                std::fs::rename(&entry, place.join("not-a-folder"))
            }
            moved => moved,
        };
        if let Err(error) = moved {
            let _ = std::fs::remove_dir(&place);
            return match error.kind() {
                io::ErrorKind::NotFound => Ok(None),
                _ => Err(failed("move to quarantine", &entry)(error)),
            };
        }
        // Between our reading and our moving, another process may have put a sound entry here: it goes back, unless
        // there already is another.
        if read_entry(&place, key).is_ok() {
            let _ = std::fs::rename(&place, &entry);
            return Ok(None);
        }
        Ok(Some(place))
    }
}

/// A new empty folder, removed when dropped; everyone whom the system's mask permits may read it.
fn fresh(parent: &Path, prefix: &str) -> Result<tempfile::TempDir, StoreError> {
    tempfile::Builder::new()
        .prefix(prefix)
        .permissions(Permissions::from_mode(0o777))
        .tempdir_in(parent)
        .map_err(failed("create a folder in", parent))
}

/// A new empty folder that stays.
fn unused(parent: &Path, key: &Key) -> Result<PathBuf, StoreError> {
    Ok(fresh(parent, &format!("{}-", key.0))?.keep())
}

/// Whether a text can be a key, and hence a folder's name.
fn is_key(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}

fn identity(entry: &Path) -> Option<(u64, u64)> {
    let metadata = std::fs::metadata(entry).ok()?;
    Some((metadata.dev(), metadata.ino()))
}

/// Why an entry cannot be used.
enum Fault {
    Absent,
    /// Sound, and written by a vargeo with another layout of records; no key of this one leads here.
    OtherSchema,
    /// The content is not what was published.
    Damaged(String),
    /// The system refused to read.
    Unreadable(String),
}

fn fault(name: &str, error: &io::Error) -> Fault {
    use io::ErrorKind::{IsADirectory, NotADirectory, NotFound};
    match error.kind() {
        NotFound => Fault::Damaged(format!("{name} is missing")),
        NotADirectory | IsADirectory => Fault::Damaged(format!("{name} is not a file")),
        _ => Fault::Unreadable(format!("{name} cannot be read: {error}")),
    }
}

/// Verifies every byte of an entry and returns its record.
fn read_entry(entry: &Path, key: &Key) -> Result<Record, Fault> {
    match std::fs::symlink_metadata(entry) {
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
            return Err(Fault::Absent);
        }
        Err(error) => {
            return Err(Fault::Unreadable(format!(
                "{} cannot be read: {error}",
                entry.display()
            )));
        }
        Ok(metadata) if !metadata.is_dir() => return Err(Fault::Damaged("the entry is not a folder".into())),
        Ok(_) => {}
    }
    let bytes = std::fs::read(entry.join(MANIFEST)).map_err(|error| fault(MANIFEST, &error))?;
    let manifest = Manifest::read(&bytes).map_err(Fault::Damaged)?;
    if manifest.key != *key {
        return Err(Fault::Damaged(format!("manifest.json is that of {}", manifest.key.0)));
    }
    if !manifest.files.contains_key(RECORD) {
        return Err(Fault::Damaged("manifest.json names no record".into()));
    }
    for file in std::fs::read_dir(entry).map_err(|error| fault("the entry", &error))? {
        let name = file.map_err(|error| fault("the entry", &error))?.file_name();
        let name = name.to_string_lossy();
        // Network file systems and desktops leave hidden files of their own.
        if name != MANIFEST && !manifest.files.contains_key(name.as_ref()) && !name.starts_with('.') {
            return Err(Fault::Damaged(format!("{name} does not belong to the entry")));
        }
    }
    let mut record = None;
    for (name, expected) in &manifest.files {
        let mut file = File::open(entry.join(name)).map_err(|error| fault(name, &error))?;
        let length = file.metadata().map_err(|error| fault(name, &error))?.len();
        if length != expected.length {
            return Err(Fault::Damaged(format!(
                "{name} has {length} bytes instead of {}",
                expected.length
            )));
        }
        let found = if name == RECORD {
            let bytes = std::fs::read(entry.join(name)).map_err(|error| fault(name, &error))?;
            let found = manifest::measure(&mut bytes.as_slice());
            record = Some(bytes);
            found
        } else {
            manifest::measure(&mut file)
        };
        let found = found.map_err(|error| fault(name, &error))?;
        if found != *expected {
            return Err(Fault::Damaged(format!(
                "{name} has SHA-256 {} instead of {}",
                found.sha256, expected.sha256
            )));
        }
    }
    let record = parse_record(&record.unwrap_or_default())?;
    if record.key != *key || Key::of(&record.job) != *key {
        return Err(Fault::Damaged(format!("{RECORD} is that of {}", record.key)));
    }
    for (name, hash) in &record.result.artifacts {
        if manifest.files.get(name).is_none_or(|file| file.sha256 != *hash) {
            return Err(Fault::Damaged(format!("{name} is not the one that the record names")));
        }
    }
    Ok(record)
}

fn parse_record(bytes: &[u8]) -> Result<Record, Fault> {
    let no_record = |error: serde_json::Error| Fault::Damaged(format!("{RECORD} is no record: {error}"));
    let value: serde_json::Value = serde_json::from_slice(bytes).map_err(no_record)?;
    let schema = value["job"]["record_schema"].as_u64();
    if schema.is_some_and(|schema| schema != u64::from(RECORD_SCHEMA)) {
        return Err(Fault::OtherSchema);
    }
    serde_json::from_value(value).map_err(no_record)
}

/// SHA-256 over what must be the same to the last bit whenever a job is computed.
///
/// Sentences for humans are left out: they may quote the names of input files, which are no part of a job.
pub fn fingerprint(result: &JobResult) -> String {
    let mut bare = result.clone();
    bare.reason.clear();
    bare.notices.clear();
    sha256(&serde_json::to_vec(&bare).expect("words and numbers always serialize"))
}
