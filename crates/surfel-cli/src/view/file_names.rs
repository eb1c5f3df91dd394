//! Texts for clients: they name files without their folders, which are nobody's business beyond this machine.

use super::added_files::without_ids;
use std::path::{MAIN_SEPARATOR_STR, Path};
use surfel::description::rule::absolute_text;
use surfel_core::progress::Progress;
use surfel_web::{Error, Result};

/// The folders of the files that are viewed.
pub struct ViewedFolders {
    /// Each one as it was written and as an absolute path, with a slash at its end. The longest one is the first.
    names: Vec<String>,
}

impl ViewedFolders {
    /// The folders of these files.
    pub fn of<'f>(files: impl IntoIterator<Item = &'f Path>) -> Self {
        let folders = files.into_iter().filter_map(Path::parent);
        let named = folders.filter(|folder| folder.file_name().is_some());
        let both = named.flat_map(|folder| [folder.display().to_string(), absolute_text(folder)]);
        let mut names: Vec<String> = both.map(|name| name + MAIN_SEPARATOR_STR).collect();
        names.sort_by_key(|name| std::cmp::Reverse(name.len()));
        names.dedup();
        Self { names }
    }

    /// A text without these folders, and without the ids of added files.
    pub fn removed_from(&self, text: &str) -> String {
        let removed = self.names.iter().fold(text.to_owned(), |text, name| text.replace(name, ""));
        without_ids(&removed)
    }

    /// A result whose error has a text for clients.
    pub fn removed<T>(&self, result: Result<T>) -> Result<T> {
        result.map_err(|error| match error {
            Error::InvalidRequest { key, text } => {
                Error::InvalidRequest { key, text: self.removed_from(&text) }
            }
            Error::Failed(text) => Error::Failed(self.removed_from(&text)),
            other => other,
        })
    }
}

/// Passes progress on with names of stages for clients.
pub struct ClientProgress<'p> {
    /// The folders that the names leave out.
    pub folders: &'p ViewedFolders,
    /// The receiver.
    pub progress: &'p dyn Progress,
}

impl Progress for ClientProgress<'_> {
    fn begin(&self, stage: &str, total: u64) {
        self.progress.begin(&self.folders.removed_from(stage), total);
    }

    fn advance(&self, units: u64) {
        self.progress.advance(units);
    }

    fn note(&self, line: &str) {
        self.progress.note(&self.folders.removed_from(line));
    }

    fn end(&self) {
        self.progress.end();
    }

    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    //! Folders in messages.

    use super::*;

    #[test]
    fn files_are_named_without_their_folders() {
        let files = ["/data/a/scan.laz", "/data/b.ply", "models/house.glb", "c.xyz", "/d.obj"];
        let folders = ViewedFolders::of(files.map(Path::new));
        for (text, expected) in [
            ("/data/a/scan.laz: no points", "scan.laz: no points"),
            ("/data/b.ply and 2 more: empty", "b.ply and 2 more: empty"),
            ("read models/house.glb", "read house.glb"),
            ("c.xyz: 3 points/m²", "c.xyz: 3 points/m²"),
            ("/d.obj: empty", "/d.obj: empty"),
        ] {
            assert_eq!(folders.removed_from(text), expected);
        }
        let absolute = absolute_text(Path::new("models/house.glb"));
        assert_eq!(folders.removed_from(&absolute), "house.glb");
    }
}
