//! Files that a file names: buffers, materials and textures.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use surfel_core::progress::Progress;
use surfel_core::words::counted;

/// Finds the files that a file names, and remembers which it looked for.
pub(crate) struct ResourceResolver<'a> {
    /// Folder of the file that names others; `None` if its bytes do not come from disk.
    pub folder: Option<&'a Path>,
    requested: RefCell<Vec<PathBuf>>,
}

/// Files that could not be read. Messages give the reason for the first and the number of the others.
#[derive(Default)]
pub(crate) struct MissingFiles {
    first: Option<String>,
    n_others: usize,
}

impl<'a> ResourceResolver<'a> {
    /// A resolver that looks in the folder of the file at `path`.
    pub fn for_file(path: &'a Path) -> Self {
        Self { folder: Some(path.parent().unwrap_or(Path::new(""))), ..Self::none() }
    }

    /// A resolver that finds no file.
    pub fn none() -> Self {
        Self { folder: None, requested: RefCell::default() }
    }

    /// Returns the first of `paths` at which there is a file, or else the first of all.
    pub fn choose<'p>(&self, paths: &'p [PathBuf]) -> &'p Path {
        let path = paths.iter().find(|path| path.is_file()).unwrap_or(&paths[0]);
        self.requested.borrow_mut().push(path.clone());
        path
    }

    /// Paths of the files that were looked for, found or not.
    pub fn into_requested(self) -> Vec<PathBuf> {
        self.requested.into_inner()
    }

    /// Returns the path of the file of this name, found or not, or the reason why none is looked up.
    ///
    /// Programs write the paths of their own machine: if there is no file at the whole path, its last part is
    /// looked up in the folder.
    pub fn find(&self, name: &str) -> Result<PathBuf, String> {
        let Some(folder) = self.folder else {
            return Err(format!(
                "{name} is a separate file, and is not looked up for bytes in memory"
            ));
        };
        let path = name.replace('\\', "/");
        let last = path.rsplit('/').next().unwrap_or_default();
        let paths = [folder.join(&path), folder.join(last)];
        Ok(self.choose(&paths).to_owned())
    }
}

/// Returns a path that is the same for all names of a file; of a file that does not exist, the path itself.
///
/// Files are remembered by it: a file that is named in a thousand ways must not be read a thousand times.
pub(crate) fn file_key(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

impl MissingFiles {
    /// Adds a file by the reason why it could not be read.
    pub fn add(&mut self, reason: String) {
        match self.first {
            None => self.first = Some(reason),
            Some(_) => self.n_others += 1,
        }
    }

    /// Reports the missing files, if there are any, after the effect that their absence has.
    pub fn report(&self, effect: &str, progress: &dyn Progress) {
        match (&self.first, self.n_others) {
            (None, _) => {}
            (Some(first), 0) => progress.note(&format!("{effect}: {first}")),
            (Some(first), n) => {
                progress.note(&format!("{effect}: {first} (and {})", counted(n, "other")))
            }
        }
    }
}
