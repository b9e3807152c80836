//! Advisory locks, so that of several processes that need one result, one computes and the others wait.
//!
//! A lock is `flock` on a file under `locks/`: the system frees it when its holder dies, however it dies, and a waiting
//! process takes over. Where a file system knows no locks, or permits none, work goes on without: a result is then
//! computed twice at worst, for publishing never relies on a lock.

use super::Store;
use crate::experiment::job::Key;
use std::fs::{File, OpenOptions, TryLockError};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Freed when dropped, or when its process ends.
#[derive(Debug)]
pub struct Lock {
    /// Absent where the file system offers no locks.
    _file: Option<File>,
}

/// Whether others may hold the lock at the same time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sharing {
    Shared,
    Alone,
}

impl Store {
    /// Takes the lock on a key, or returns nothing when another process holds it.
    pub fn try_lock(&self, key: &Key) -> Option<Lock> {
        try_lock(&self.lock_path(key), Sharing::Alone)
    }

    /// Whether some process holds the lock on a key at this moment.
    pub fn is_locked(&self, key: &Key) -> bool {
        let path = self.lock_path(key);
        let Ok(file) = File::open(&path) else { return false };
        matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
    }

    /// Takes this machine's lock: jobs share it, a job whose times are reported has it alone.
    ///
    /// It reaches the runs that share a store. Starts of the system tell machines apart, so no host name is kept.
    pub fn try_lock_machine(&self, sharing: Sharing) -> Option<Lock> {
        match std::fs::read_to_string("/proc/sys/kernel/random/boot_id") {
            Ok(boot) => {
                let name = format!("machine-{}.lock", &super::sha256(boot.trim().as_bytes())[..16]);
                try_lock(&self.locks().join(name), sharing)
            }
            Err(_) => Some(Lock { _file: None }),
        }
    }

    pub(super) fn lock_path(&self, key: &Key) -> PathBuf {
        self.locks().join(format!("{}.lock", key.0))
    }
}

fn try_lock(path: &Path, sharing: Sharing) -> Option<Lock> {
    loop {
        let opened = OpenOptions::new().create(true).truncate(false).write(true).open(path);
        let Ok(file) = opened else {
            return Some(Lock { _file: None });
        };
        let taken = match sharing {
            Sharing::Shared => file.try_lock_shared(),
            Sharing::Alone => file.try_lock(),
        };
        match taken {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return None,
            Err(TryLockError::Error(_)) => return Some(Lock { _file: None }),
        }
        // Tidying may have unlinked the file between our opening and our locking it: a lock on a nameless file
        // excludes nobody.
        let same = match (file.metadata(), std::fs::metadata(path)) {
            (Ok(ours), Ok(named)) => ours.ino() == named.ino() && ours.dev() == named.dev(),
            _ => false,
        };
        if same {
            return Some(Lock { _file: Some(file) });
        }
    }
}
