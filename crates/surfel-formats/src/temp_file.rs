//! Temporary files, which are removed with what refers to them.

use std::fs::{self, DirBuilder, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::Error;
use crate::file::write_error;

/// A file in a folder of its own, which nobody else may enter. Both are removed when this is dropped.
#[derive(Debug)]
pub struct TempFile {
    folder: PathBuf,
    path: PathBuf,
    n_bytes: u64,
}

impl TempFile {
    /// Lets `write` make the file of a name, as in `points.laz`, and files that it needs beside it.
    ///
    /// # Errors
    ///
    /// Fails as `write` does, and if the system's folder for temporary files cannot be written to.
    pub fn write<E: From<Error>>(
        name: &str,
        write: impl FnOnce(&Path) -> Result<(), E>,
    ) -> Result<Self, E> {
        let parent = std::env::temp_dir();
        let folder = new_folder(&parent).map_err(|cause| write_error(&parent, cause))?;
        let path = folder.join(name);
        // Removes the folder also if writing fails.
        let mut file = Self { folder, path, n_bytes: 0 };
        write(&file.path)?;
        let metadata = fs::metadata(&file.path).map_err(|cause| write_error(&file.path, cause))?;
        file.n_bytes = metadata.len();
        Ok(file)
    }

    /// Returns the size of the file.
    pub fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// Opens the file.
    ///
    /// # Errors
    ///
    /// Fails if the file was removed by another program.
    pub fn open(&self) -> io::Result<File> {
        File::open(&self.path)
    }
}

impl Drop for TempFile {
    fn drop(&mut self) {
        // A failure cannot be reported from here.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Makes a folder that only this user may enter.
fn new_folder(parent: &Path) -> io::Result<PathBuf> {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let mut builder = DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    loop {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let folder = parent.join(format!("surfel-{}-{number}", std::process::id()));
        match builder.create(&folder) {
            Ok(()) => return Ok(folder),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    //! Temporary files and their ends.

    use super::*;
    use crate::load::load_bytes;
    use crate::options::{LoadOptions, SaveOptions};
    use crate::save::save;
    use std::io::Read;
    use surfel_core::math::Vec3;
    use surfel_core::points::PointCloud;
    use surfel_core::progress::NoProgress;

    #[test]
    fn a_cloud_is_read_back_until_its_file_is_removed() {
        let cloud = PointCloud::from_positions(vec![Vec3::ONE, Vec3::new(2.0, 3.0, 4.0)]);
        let options = SaveOptions::default();
        let write = |extension: &str| {
            let name = format!("points.{extension}");
            TempFile::write(&name, |path| save(path, &cloud, &options, &NoProgress))
        };
        for extension in ["laz", "ply"] {
            let file = write(extension).unwrap();
            let mut bytes = Vec::new();
            file.open().unwrap().read_to_end(&mut bytes).unwrap();
            assert_eq!(bytes.len() as u64, file.n_bytes());
            let name = format!("a.{extension}");
            let read = load_bytes(&name, &bytes, &LoadOptions::default(), &NoProgress).unwrap();
            assert_eq!(read.cloud.len(), 2);
            let folder = file.folder.clone();
            drop(file);
            assert!(!folder.exists());
        }
        assert!(write("exe").is_err());
    }
}
