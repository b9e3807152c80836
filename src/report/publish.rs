//! Files written whole or not at all: beside their place, flushed, then renamed over it.

use super::ReportError;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes `name` in `folder` and returns its path. A file with the same bytes is left alone.
pub fn publish(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, ReportError> {
    let path = folder.join(name);
    let place = |error: std::io::Error| ReportError::Write(path.clone(), error);
    if std::fs::metadata(&path).is_ok_and(|found| found.len() == bytes.len() as u64)
        && std::fs::read(&path).is_ok_and(|found| found == bytes)
    {
        return Ok(path);
    }
    let mut file = tempfile::Builder::new()
        .prefix(".vargeo-")
        .tempfile_in(folder)
        .map_err(place)?;
    file.write_all(bytes).map_err(place)?;
    file.as_file().sync_all().map_err(place)?;
    // Temporary files are private to their owner; a result is as readable as any other file.
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o644);
    file.as_file().set_permissions(mode).map_err(place)?;
    file.persist(&path)
        .map_err(|error| ReportError::Write(path.clone(), error.error))?;
    Ok(path)
}
