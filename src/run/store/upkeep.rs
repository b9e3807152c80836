//! Looking after a store: verifying everything, counting, and removing what nobody needs.

use super::{Lookup, Store, StoreError, failed, fresh, is_key};
use crate::experiment::job::Key;
use crate::experiment::record::Status;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// A damaged entry.
#[derive(Debug)]
pub struct Damage {
    pub key: Key,
    pub reason: String,
    /// Where it was moved to, or why it could not be moved.
    pub quarantine: Result<PathBuf, String>,
}

/// Counts of a store.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    pub entries: usize,
    /// Bytes of all entries.
    pub bytes: u64,
    /// Entries by method and status, such as `volume-map done`.
    pub kinds: BTreeMap<String, usize>,
    pub failures: usize,
    pub quarantined: usize,
    pub quarantined_bytes: u64,
    pub leftovers: usize,
    pub leftover_bytes: u64,
}

/// Why something may be removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum GarbageKind {
    /// Written by a process that did not finish.
    Leftover,
    Quarantined,
    /// A finished job that none of the given experiments has.
    Unreferenced,
    /// A failure of a job that none of the given experiments has.
    Failure,
    /// A lock that nobody holds.
    Lock,
}

/// Something that may be removed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Garbage {
    pub kind: GarbageKind,
    pub path: PathBuf,
    pub bytes: u64,
}

impl Store {
    /// The keys that have an entry, in order.
    pub fn keys(&self) -> Result<Vec<Key>, StoreError> {
        let mut keys = Vec::new();
        for shard in names(&self.root)?.into_iter().filter(|name| name.len() == 2) {
            let folder = self.root.join(&shard);
            let entries = names(&folder)?.into_iter();
            keys.extend(entries.filter(|name| is_key(name) && name.starts_with(&shard)).map(Key));
        }
        Ok(keys)
    }

    /// Verifies every byte of every entry; damaged ones are moved to quarantine. Returns the number of sound ones.
    pub fn verify(&self) -> Result<(usize, Vec<Damage>), StoreError> {
        let found: Vec<Option<Damage>> = self
            .keys()?
            .into_par_iter()
            .filter_map(|key| match self.lookup(&key) {
                Lookup::Hit(_) => Some(None),
                // Written with another layout of records, or just removed by another process.
                Lookup::Miss => self.entry(&key).is_dir().then_some(None),
                Lookup::Damaged { reason, quarantine } => Some(Some(Damage {
                    key,
                    reason,
                    quarantine,
                })),
            })
            .collect();
        let sound = found.iter().filter(|damage| damage.is_none()).count();
        Ok((sound, found.into_iter().flatten().collect()))
    }

    /// Counts what is there, without verifying it.
    pub fn statistics(&self) -> Result<Statistics, StoreError> {
        let mut statistics = Statistics::default();
        for key in self.keys()? {
            let entry = self.entry(&key);
            statistics.entries += 1;
            statistics.bytes += size(&entry);
            let record = std::fs::read(entry.join(super::RECORD))
                .ok()
                .and_then(|bytes| serde_json::from_slice::<super::Record>(&bytes).ok());
            let kind = match record {
                Some(record) => format!("{} {}", record.job.method, status_word(record.result.status)),
                None => "unreadable".into(),
            };
            *statistics.kinds.entry(kind).or_default() += 1;
        }
        statistics.failures = names(&self.root.join("failures"))?.len();
        for name in names(&self.quarantine())? {
            statistics.quarantined += 1;
            statistics.quarantined_bytes += size(&self.quarantine().join(name));
        }
        for name in names(&self.temporary())? {
            statistics.leftovers += 1;
            statistics.leftover_bytes += size(&self.temporary().join(name));
        }
        Ok(statistics)
    }

    /// What may be removed: leftovers of at least this age, quarantine, idle locks, and, if keys to keep are given,
    /// every finished and failed job of another key. A job that is being computed is never among them.
    pub fn garbage(&self, age: Duration, keep: Option<&BTreeSet<Key>>) -> Result<Vec<Garbage>, StoreError> {
        let mut garbage = Vec::new();
        let mut add = |kind, path: PathBuf| {
            let bytes = size(&path);
            garbage.push(Garbage { kind, path, bytes });
        };
        let oldest = SystemTime::now().checked_sub(age);
        for folder in [self.temporary(), self.root.join("failures")] {
            for name in names(&folder)? {
                let path = folder.join(&name);
                let modified = std::fs::symlink_metadata(&path).and_then(|metadata| metadata.modified());
                let old = matches!((modified, oldest), (Ok(modified), Some(oldest)) if modified <= oldest);
                if old && !name.ends_with(".json") {
                    add(GarbageKind::Leftover, path);
                }
            }
        }
        for name in names(&self.quarantine())? {
            add(GarbageKind::Quarantined, self.quarantine().join(name));
        }
        if let Some(keep) = keep {
            for key in self.keys()? {
                if !keep.contains(&key) && !self.is_locked(&key) {
                    add(GarbageKind::Unreferenced, self.entry(&key));
                }
            }
            for name in names(&self.root.join("failures"))? {
                let key = Key(name.strip_suffix(".json").unwrap_or_default().into());
                if is_key(&key.0) && !keep.contains(&key) {
                    add(GarbageKind::Failure, self.failure_path(&key));
                }
            }
        }
        for name in names(&self.locks())? {
            let key = Key(name.strip_suffix(".lock").unwrap_or_default().into());
            if is_key(&key.0) && !self.is_locked(&key) {
                add(GarbageKind::Lock, self.lock_path(&key));
            }
        }
        Ok(garbage)
    }

    /// Removes what [`Store::garbage`] found; an entry disappears whole.
    pub fn remove(&self, garbage: &[Garbage]) -> Result<(), StoreError> {
        for Garbage { kind, path, .. } in garbage {
            match kind {
                GarbageKind::Lock => {
                    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                    // Only its holder may unlink a lock.
                    if let Some(_lock) = self.try_lock(&Key(name)) {
                        remove(path)?;
                    }
                }
                GarbageKind::Unreferenced => {
                    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                    if let Some(_lock) = self.try_lock(&Key(name)) {
                        let temporary = self.temporary();
                        std::fs::create_dir_all(&temporary).map_err(failed("create the folder", &temporary))?;
                        let aside = fresh(&temporary, "removed-")?;
                        std::fs::rename(path, aside.path()).map_err(failed("remove", path))?;
                    }
                }
                GarbageKind::Leftover | GarbageKind::Quarantined | GarbageKind::Failure => remove(path)?,
            }
        }
        Ok(())
    }
}

fn remove(path: &Path) -> Result<(), StoreError> {
    let removed = match std::fs::symlink_metadata(path) {
        Ok(metadata) if metadata.is_dir() => std::fs::remove_dir_all(path),
        Ok(_) => std::fs::remove_file(path),
        Err(error) => Err(error),
    };
    match removed {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        other => other.map_err(failed("remove", path)),
    }
}

/// The names within a folder, in order; none when there is no such folder.
fn names(folder: &Path) -> Result<Vec<String>, StoreError> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(failed("read the folder", folder)(error)),
    };
    let mut names = Vec::new();
    for entry in entries {
        let entry = entry.map_err(failed("read the folder", folder))?;
        names.push(entry.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    Ok(names)
}

/// Bytes of a file or of everything below a folder; what cannot be read counts nothing.
fn size(path: &Path) -> u64 {
    match std::fs::symlink_metadata(path) {
        Ok(metadata) if metadata.is_dir() => std::fs::read_dir(path)
            .map(|entries| entries.flatten().map(|entry| size(&entry.path())).sum())
            .unwrap_or(0),
        Ok(metadata) => metadata.len(),
        Err(_) => 0,
    }
}

fn status_word(status: Status) -> &'static str {
    match status {
        Status::Done => "done",
        Status::Refused => "refused",
        Status::Failed => "failed",
        Status::Skipped => "skipped",
    }
}
