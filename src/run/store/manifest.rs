//! The manifest of a store entry: every file with its length and SHA-256, and a checksum over the manifest itself.
//!
//! A manifest has one spelling. A file that spells the same content differently, by a single byte, is damaged.

use crate::experiment::job::Key;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io::{self, Read};

/// Length and hash of one file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct FileEntry {
    /// Bytes.
    pub(super) length: u64,
    /// Lower-case hexadecimal.
    pub(super) sha256: String,
}

/// What an entry's `manifest.json` says.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Manifest {
    pub(super) key: Key,
    pub(super) files: BTreeMap<String, FileEntry>,
    /// SHA-256 of the manifest with this field empty.
    checksum: String,
}

impl Manifest {
    pub(super) fn new(key: Key, files: BTreeMap<String, FileEntry>) -> Self {
        let mut manifest = Manifest {
            key,
            files,
            checksum: String::new(),
        };
        manifest.checksum = hexadecimal(&Sha256::digest(manifest.spelled()));
        manifest
    }

    /// The bytes of the file.
    pub(super) fn spelled(&self) -> Vec<u8> {
        let mut bytes = serde_json::to_vec_pretty(self).expect("strings and numbers always serialize");
        bytes.push(b'\n');
        bytes
    }

    /// Reads and verifies; the error says what is wrong.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let read: Manifest =
            serde_json::from_slice(bytes).map_err(|error| format!("manifest.json is no manifest: {error}"))?;
        let expected = Manifest::new(read.key.clone(), read.files.clone());
        if expected.spelled() != bytes {
            return Err("manifest.json does not have its own checksum".into());
        }
        Ok(read)
    }
}

/// Lower-case hexadecimal digits.
fn hexadecimal(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes
        .iter()
        .fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        })
}

/// Length and hash of everything that a reader yields, without holding it in memory.
pub(super) fn measure(reader: &mut impl Read) -> io::Result<FileEntry> {
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 1 << 18];
    let mut length = 0;
    loop {
        match reader.read(&mut buffer) {
            Ok(0) => {
                return Ok(FileEntry {
                    length,
                    sha256: hexadecimal(&hasher.finalize()),
                });
            }
            Ok(count) => {
                length += count as u64;
                hasher.update(&buffer[..count]);
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}
