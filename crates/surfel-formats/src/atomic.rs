//! Outputs are written beside their name and renamed: a failed run leaves no half file and destroys no old one.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Writes a text to a file, which takes the place of an old one once it is whole.
pub fn save_text(path: &Path, text: &str) -> Result<()> {
    write_file(path, |writer| {
        writer.write_all(text.as_bytes()).map_err(|cause| write_failed(path, cause))
    })
}

/// Has `write` fill a new file, which then takes the place of `path`.
///
/// On an error of any kind the new file is removed and an old one stays.
pub(crate) fn write_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<()>,
) -> Result<()> {
    write_aside(path, |_, file| {
        let mut writer = BufWriter::with_capacity(1 << 20, file);
        write(&mut writer)?;
        writer.into_inner().map_err(|e| write_failed(path, e.into_error()))?;
        Ok(())
    })
}

/// The same for other programs, which open the new file by its name.
pub(crate) fn write_aside(
    path: &Path,
    write: impl FnOnce(&Path, File) -> Result<()>,
) -> Result<()> {
    let (aside, file) = create_aside(path)?;
    let remover = Remover(aside);
    write(&remover.0, file)?;
    fs::rename(&remover.0, path).map_err(|source| write_failed(path, source))?;
    Ok(())
}

/// The error of a write to `path` that failed.
pub(crate) fn write_failed(path: &Path, cause: io::Error) -> Error {
    let file = path.display().to_string();
    let advice = match cause.kind() {
        io::ErrorKind::NotFound => {
            return Error::NoFolder { file, folder: folder_of(path).display().to_string() };
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "choose a folder you may write to"
        }
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "free space there or write elsewhere"
        }
        io::ErrorKind::IsADirectory => "name a file, not a folder",
        io::ErrorKind::NotADirectory => "name a file in a folder, not in a file",
        _ => "check the disk and the connection to it",
    };
    Error::Io { file, action: "written", cause, advice }
}

/// The folder that a file of this name is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
}

/// Removes the file aside; after the rename there is none left to remove.
struct Remover(PathBuf);

impl Drop for Remover {
    fn drop(&mut self) {
        // Nobody is left to tell if this fails.
        let _ = fs::remove_file(&self.0);
    }
}

fn create_aside(path: &Path) -> Result<(PathBuf, File)> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let process = std::process::id();
    // Several threads, or a run that was killed, may have left a file of the same name.
    let mut attempt = 0;
    loop {
        let aside = path.with_file_name(format!(".{name}.{process}-{attempt}.part"));
        match File::create_new(&aside) {
            Ok(file) => return Ok((aside, file)),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists && attempt < 1000 => attempt += 1,
            Err(source) => return Err(write_failed(path, source)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_old_file_survives_a_failure_and_nothing_is_left_beside_it() {
        let folder = std::env::temp_dir().join(format!("surfel-atomic-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("out.ply");
        fs::write(&path, "old").unwrap();

        let failed = write_file(&path, |writer| {
            writer.write_all(b"half").unwrap();
            Err(surfel::Error::Cancelled.into())
        });
        assert!(matches!(failed, Err(Error::Surfel(surfel::Error::Cancelled))));
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");

        write_file(&path, |writer| writer.write_all(b"new").map_err(|e| write_failed(&path, e)))
            .unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        fs::remove_dir_all(&folder).unwrap();
    }
}
