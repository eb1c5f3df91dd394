//! The words of the command line.

use std::path::PathBuf;
use surfel_core::surface::SurfaceKind;
use surfel_tests::bench_args::take_folder;

/// The surfaces and clouds to compare, and the folders to read and write.
pub struct Selection {
    /// Surface kinds with their names.
    pub kinds: Vec<(&'static str, SurfaceKind)>,
    /// The folder that gets the clouds.
    pub written_clouds: Option<PathBuf>,
    /// The folder of meshes that another program made from the clouds.
    pub meshes: Option<PathBuf>,
    /// The folder that gets pictures.
    pub pictures: Option<PathBuf>,
    filters: Vec<String>,
}

impl Selection {
    /// Parses the command line. Without the name of a kind they are `splat` and `smooth`.
    ///
    /// # Panics
    ///
    /// Panics if an option has no folder.
    pub fn from_args() -> Self {
        let mut args: Vec<String> = std::env::args().skip(1).collect();
        let [written_clouds, meshes, pictures] =
            ["--write-clouds", "--meshes", "--pictures"].map(|name| take_folder(&mut args, name));
        let words = args.into_iter().filter(|word| !word.starts_with('-'));
        let is_kind = |word: &String| SurfaceKind::ALL.iter().any(|(name, _)| name == word);
        let (mut names, filters): (Vec<String>, Vec<String>) = words.partition(is_kind);
        if names.is_empty() {
            names = ["splat", "smooth"].map(str::to_owned).to_vec();
        }
        let kinds = SurfaceKind::ALL.into_iter().filter(|(_, kind)| *kind != SurfaceKind::Gaussian);
        let kinds = kinds.filter(|(name, _)| names.iter().any(|word| word == name)).collect();
        Self { kinds, written_clouds, meshes, pictures, filters }
    }

    /// Returns true if the cloud of this name is selected.
    pub fn includes(&self, cloud: &str) -> bool {
        self.filters.is_empty() || self.filters.iter().any(|filter| cloud.contains(filter))
    }
}
