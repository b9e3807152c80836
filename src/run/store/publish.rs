//! Publishing: written beside, synced, renamed into place, synced again; the manifest last.

use super::manifest::{FileEntry, Manifest};
use super::{
    Artifacts, Lookup, MANIFEST, RECORD, Store, StoreError, failed, fingerprint, fresh, is_key, sha256, unused,
};
use crate::experiment::record::Record;
use std::collections::BTreeMap;
use std::fs::{File, Permissions};
use std::io::{self, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// The instants of a publication, told before each is begun; tests kill or fail at every one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    CreateFolder,
    /// The first half of a file is written, by name.
    Write(String),
    /// A file is half written.
    Halfway(String),
    SyncFile(String),
    SyncFolder,
    CreateShard,
    /// The entry becomes visible.
    Rename,
    SyncShard,
    /// What was replaced is removed.
    RemoveReplaced,
    Finish,
}

/// What became of a published record.
#[derive(Debug)]
pub enum Publication {
    /// It is the first under its key.
    New,
    /// Another process was quicker with the same result; that one stays.
    AlreadyThere(Box<Record>),
    /// The result is the stored one; its measurement took the stored one's place.
    Remeasured,
    /// The computation is not deterministic: the stored result differs from this one.
    Differs {
        /// Fingerprints of the deterministic part, [`fingerprint`].
        stored: String,
        computed: String,
        /// What is in the store now.
        kept: Box<Record>,
        /// Where the other one is for examination.
        set_aside: PathBuf,
    },
}

impl Store {
    /// Puts a record and its artifacts, by file name, into the store.
    ///
    /// Where an entry is already there, it stays, unless `replace` asks for the new measurement to take its place; and
    /// even then times that were taken exclusively do not give way to as many that were not.
    pub fn publish(&self, record: &Record, artifacts: &Artifacts, replace: bool) -> Result<Publication, StoreError> {
        self.publish_in_steps(record, artifacts, replace, &mut |_| Ok(()))
    }

    /// [`Store::publish`], told before every step; an error ends the publication as if the step had failed with it.
    pub fn publish_in_steps(
        &self,
        record: &Record,
        artifacts: &Artifacts,
        replace: bool,
        step: &mut dyn FnMut(&Step) -> io::Result<()>,
    ) -> Result<Publication, StoreError> {
        let entry = self.entry(&record.key);
        if !is_key(&record.key.0) {
            let source = io::Error::new(io::ErrorKind::InvalidInput, "the key is no SHA-256");
            return Err(failed("store", &entry)(source));
        }
        let temporary = self.temporary();
        step(&Step::CreateFolder).map_err(failed("write into", &temporary))?;
        std::fs::create_dir_all(&temporary).map_err(failed("create the folder", &temporary))?;
        // Removed on every way out but the last.
        let folder = fresh(&temporary, &format!("{}-", &record.key.0[..16]))?;
        self.write_entry(folder.path(), record, artifacts, step)?;

        let shard = self.shard(&record.key);
        step(&Step::CreateShard).map_err(failed("create the folder", &shard))?;
        if !shard.is_dir() {
            std::fs::create_dir_all(&shard).map_err(failed("create the folder", &shard))?;
            sync_folder(&self.root)?;
        }
        let publication = self.move_into_place(folder, &entry, record, replace, step)?;
        step(&Step::Finish).map_err(failed("write", &entry))?;
        // A failure of former days is over.
        let _ = std::fs::remove_file(self.failure_path(&record.key));
        Ok(publication)
    }

    fn write_entry(
        &self,
        folder: &Path,
        record: &Record,
        artifacts: &Artifacts,
        step: &mut dyn FnMut(&Step) -> io::Result<()>,
    ) -> Result<(), StoreError> {
        let mut bytes = serde_json::to_vec_pretty(record)
            .map_err(io::Error::other)
            .map_err(failed("write", &folder.join(RECORD)))?;
        bytes.push(b'\n');
        let mut files = BTreeMap::new();
        let contents = artifacts.iter().map(|(name, bytes)| (name.as_str(), bytes));
        for (name, bytes) in contents.chain([(RECORD, &bytes)]) {
            write_file(&folder.join(name), name, bytes, step)?;
            let (length, sha256) = (bytes.len() as u64, sha256(bytes));
            files.insert(name.to_string(), FileEntry { length, sha256 });
        }
        let manifest = Manifest::new(record.key.clone(), files).spelled();
        write_file(&folder.join(MANIFEST), MANIFEST, &manifest, step)?;
        step(&Step::SyncFolder).map_err(failed("write", folder))?;
        sync_folder(folder)
    }

    /// Renames the finished folder to the entry, and decides what happens when there is one.
    fn move_into_place(
        &self,
        folder: tempfile::TempDir,
        entry: &Path,
        record: &Record,
        replace: bool,
        step: &mut dyn FnMut(&Step) -> io::Result<()>,
    ) -> Result<Publication, StoreError> {
        let shard = self.shard(&record.key);
        // Bounded only to make the impossible visible: each round needs another process to have acted in between.
        for _ in 0..100 {
            step(&Step::Rename).map_err(failed("write", entry))?;
            match std::fs::rename(folder.path(), entry) {
                Ok(()) => {
                    let _ = folder.keep();
                    step(&Step::SyncShard).map_err(failed("write", entry))?;
                    sync_folder(&shard)?;
                    return Ok(Publication::New);
                }
                Err(error) if occupied(&error) => {}
                Err(error) => return Err(failed("write", entry)(error)),
            }
            // Looking it up moves a damaged entry out of the way, and then the next round succeeds.
            let Lookup::Hit(stored) = self.lookup(&record.key) else {
                continue;
            };
            let (former, latter) = (&stored.measurement, &record.measurement);
            let worse = former.exclusive && !latter.exclusive && former.wall_seconds.len() >= latter.wall_seconds.len();
            let replace = replace && !worse;
            let fingerprints = (fingerprint(&stored.result), fingerprint(&record.result));
            let differs = fingerprints.0 != fingerprints.1;
            if !replace && !differs {
                return Ok(Publication::AlreadyThere(stored));
            }
            let kept = if replace {
                if !exchange(folder.path(), entry).map_err(failed("replace", entry))? {
                    continue;
                }
                step(&Step::SyncShard).map_err(failed("write", entry))?;
                sync_folder(&shard)?;
                Box::new(record.clone())
            } else {
                stored
            };
            step(&Step::RemoveReplaced).map_err(failed("write", entry))?;
            if !differs {
                drop(folder);
                return Ok(Publication::Remeasured);
            }
            let quarantine = self.quarantine();
            std::fs::create_dir_all(&quarantine).map_err(failed("create the folder", &quarantine))?;
            let set_aside = unused(&quarantine, &record.key)?;
            std::fs::rename(folder.path(), &set_aside).map_err(failed("move to", &set_aside))?;
            let _ = folder.keep();
            return Ok(Publication::Differs {
                stored: fingerprints.0,
                computed: fingerprints.1,
                kept,
                set_aside,
            });
        }
        let source = io::Error::other("it appears and disappears; is another program writing here?");
        Err(failed("write", entry)(source))
    }

    /// Keeps a crash or a limit apart from the results, until the job succeeds.
    pub fn record_failure(&self, record: &Record) -> Result<(), StoreError> {
        let path = self.failure_path(&record.key);
        let parent = self.root.join("failures");
        std::fs::create_dir_all(&parent).map_err(failed("create the folder", &parent))?;
        let write = || -> io::Result<()> {
            let mut file = tempfile::Builder::new()
                .permissions(Permissions::from_mode(0o666))
                .tempfile_in(&parent)?;
            serde_json::to_writer_pretty(&mut file, record)?;
            file.write_all(b"\n")?;
            file.as_file().sync_all()?;
            file.persist(&path)?;
            Ok(())
        };
        write().map_err(failed("write", &path))
    }
}

fn write_file(
    path: &Path,
    name: &str,
    bytes: &[u8],
    step: &mut dyn FnMut(&Step) -> io::Result<()>,
) -> Result<(), StoreError> {
    let mut write = || -> io::Result<()> {
        step(&Step::Write(name.into()))?;
        let mut file = File::create_new(path)?;
        let (first, second) = bytes.split_at(bytes.len() / 2);
        file.write_all(first)?;
        step(&Step::Halfway(name.into()))?;
        file.write_all(second)?;
        step(&Step::SyncFile(name.into()))?;
        file.sync_all()
    };
    write().map_err(failed("write", path))
}

fn sync_folder(folder: &Path) -> Result<(), StoreError> {
    let synced = File::open(folder).and_then(|file| file.sync_all());
    match synced {
        // Some network file systems cannot sync folders; they order renames themselves.
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => Ok(()),
        other => other.map_err(failed("sync the folder", folder)),
    }
}

fn occupied(error: &io::Error) -> bool {
    use io::ErrorKind::{AlreadyExists, DirectoryNotEmpty, NotADirectory};
    matches!(error.kind(), AlreadyExists | DirectoryNotEmpty | NotADirectory)
}

/// Swaps two folders in one step. `false` when the entry has vanished meanwhile.
///
/// Where the file system cannot swap, the entry is moved away first: a reader may then see a miss for an instant, and
/// a kill in that instant costs a computation, never a wrong result.
fn exchange(folder: &Path, entry: &Path) -> io::Result<bool> {
    #[cfg(any(target_os = "linux", target_vendor = "apple"))]
    {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        use rustix::io::Errno;
        match renameat_with(CWD, folder, CWD, entry, RenameFlags::EXCHANGE) {
            Ok(()) => return Ok(true),
            Err(Errno::NOENT) => return Ok(false),
            Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => {}
            Err(error) => return Err(error.into()),
        }
    }
    let mut aside = folder.as_os_str().to_owned();
    aside.push("-replaced");
    let aside = PathBuf::from(aside);
    match std::fs::rename(entry, &aside) {
        Ok(()) => {}
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
        Err(error) => return Err(error),
    }
    match std::fs::rename(folder, entry) {
        Ok(()) => {
            std::fs::rename(&aside, folder)?;
            Ok(true)
        }
        Err(error) if occupied(&error) => {
            std::fs::remove_dir_all(&aside)?;
            Ok(false)
        }
        Err(error) => {
            // Best effort: the former entry goes back.
            let _ = std::fs::rename(&aside, entry);
            Err(error)
        }
    }
}
