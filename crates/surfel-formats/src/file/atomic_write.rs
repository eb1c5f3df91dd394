//! Writes each output to a temporary file in its folder and renames it: a failed run leaves no half file and destroys
//! no old one. The file that a symbolic link names is replaced, not the link.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Writes a text to a file, which replaces an old one once it is complete.
///
/// # Errors
///
/// Fails if the file cannot be written; an old file then stays.
pub fn save_text(path: &Path, text: &str) -> Result<()> {
    write_file(path, |writer| {
        writer.write_all(text.as_bytes()).map_err(|cause| write_error(path, cause))
    })
}

/// Lets `write` fill a new file, which then replaces `path`.
///
/// If anything fails, the new file is removed and an old one stays.
pub(crate) fn write_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<()>,
) -> Result<()> {
    write_temp(path, |_, file| {
        let mut writer = BufWriter::with_capacity(1 << 20, file);
        write(&mut writer)?;
        writer.into_inner().map_err(|e| write_error(path, e.into_error()))?;
        Ok(())
    })
}

/// Lets `write` fill a new file, which it gets by path and opened, so that other programs can write to it; the file
/// then replaces `path`.
///
/// If anything fails, the new file is removed and an old one stays.
pub(crate) fn write_temp(path: &Path, write: impl FnOnce(&Path, File) -> Result<()>) -> Result<()> {
    let path = &link_target(path);
    let (temp, file) = create_temp(path)?;
    let guard = TempGuard(temp);
    write(&guard.0, file)?;
    copy_permissions(path, &guard.0);
    fs::rename(&guard.0, path).map_err(|cause| write_error(path, cause))?;
    Ok(())
}

/// Checks that the folder of `path` takes new files.
pub(crate) fn check_writable(path: &Path) -> Result<()> {
    let (temp, _) = create_temp(&link_target(path))?;
    drop(TempGuard(temp));
    Ok(())
}

/// Returns the error of a write to `path` that failed.
pub(crate) fn write_error(path: &Path, cause: io::Error) -> Error {
    let file = path.display().to_string();
    let advice = match cause.kind() {
        io::ErrorKind::NotFound if !parent_folder(path).is_dir() => {
            let folder = parent_folder(path).display().to_string();
            return Error::FolderNotFound { file, folder };
        }
        io::ErrorKind::NotFound => "choose another folder or a shorter name",
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

/// Returns the folder that contains `path`.
pub(crate) fn parent_folder(path: &Path) -> &Path {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
}

/// Returns the path of the file that a chain of symbolic links names, whether it exists or not; a path that is no link
/// itself.
fn link_target(path: &Path) -> PathBuf {
    /// Number of links that systems follow; more are a circle.
    const MAX_LINKS: usize = 40;
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
        let Ok(next) = fs::read_link(&target) else { break };
        target = parent_folder(&target).join(next);
    }
    target
}

/// Gives the file `temp` the permissions of the one at `path`, if there is one: a private file stays private.
fn copy_permissions(path: &Path, temp: &Path) {
    // A file without permission to write cannot be renamed on Windows.
    if cfg!(unix)
        && let Ok(old) = fs::metadata(path)
    {
        // Some file systems have no permissions, and the file is whole without them.
        let _ = fs::set_permissions(temp, old.permissions());
    }
}

/// Removes a temporary file when dropped; after the rename there is none left to remove.
struct TempGuard(PathBuf);

impl Drop for TempGuard {
    fn drop(&mut self) {
        // A failure cannot be reported from here.
        let _ = fs::remove_file(&self.0);
    }
}

fn create_temp(path: &Path) -> Result<(PathBuf, File)> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let process = std::process::id();
    // Several threads, or a run that was killed, may have left a file of the same name.
    let mut attempt = 0;
    loop {
        let temp = path.with_file_name(format!(".{name}.{process}-{attempt}.part"));
        match File::create_new(&temp) {
            Ok(file) => return Ok((temp, file)),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists && attempt < 1000 => attempt += 1,
            Err(cause) => return Err(write_error(path, cause)),
        }
    }
}

#[cfg(test)]
mod tests {
    //! A write that fails keeps the old file and leaves no temporary one.

    use super::*;

    #[test]
    fn old_file_survives_a_failure_and_no_temporary_file_stays() {
        let folder = std::env::temp_dir().join(format!("surfel-atomic-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("out.ply");
        fs::write(&path, "old").unwrap();

        let failed = write_file(&path, |writer| {
            writer.write_all(b"half").unwrap();
            Err(surfel_core::Error::Cancelled.into())
        });
        assert!(matches!(failed, Err(Error::Core(surfel_core::Error::Cancelled))));
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");

        write_file(&path, |writer| writer.write_all(b"new").map_err(|e| write_error(&path, e)))
            .unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_its_file_keeps_the_permissions() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = std::env::temp_dir().join(format!("surfel-links-{}", std::process::id()));
        fs::create_dir_all(folder.join("run7")).unwrap();
        let (target, link) = (folder.join("run7/picture.ply"), folder.join("latest.ply"));
        symlink("run7/picture.ply", &link).unwrap();
        symlink("latest.ply", folder.join("newest.ply")).unwrap();
        symlink(folder.join("round.ply"), folder.join("round.ply")).unwrap();
        // The first write finds a link to a file that does not exist yet.
        for text in ["first", "second"] {
            save_text(&folder.join("newest.ply"), text).unwrap();
            assert_eq!(fs::read_to_string(&target).unwrap(), text);
            assert!(link.symlink_metadata().unwrap().is_symlink());
            fs::set_permissions(&target, fs::Permissions::from_mode(0o600)).unwrap();
        }
        save_text(&link, "third").unwrap();
        assert_eq!(target.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::read_dir(folder.join("run7")).unwrap().count(), 1);
        save_text(&folder.join("round.ply"), "a circle of links").unwrap();

        fs::remove_dir_all(folder.join("run7")).unwrap();
        let error = check_writable(&link).unwrap_err();
        assert!(matches!(error, Error::FolderNotFound { .. }), "{error}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
