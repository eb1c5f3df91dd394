//! The words of the command line.

use surfel_core::surface::SurfaceKind;

/// The surfaces and clouds to compare.
pub struct Selection {
    /// Surface kinds with their names.
    pub kinds: Vec<(&'static str, SurfaceKind)>,
    filters: Vec<String>,
}

impl Selection {
    /// Parses the command line. Without the name of a kind it is `splat` and, where there is one, `smooth`.
    pub fn from_args() -> Self {
        let words: Vec<String> =
            std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
        let is_kind = |word: &String| SurfaceKind::ALL.iter().any(|(name, _)| name == word);
        let (mut names, filters): (Vec<String>, Vec<String>) = words.into_iter().partition(is_kind);
        if names.is_empty() {
            names = ["splat", "smooth"].map(str::to_owned).to_vec();
        }
        let kinds = SurfaceKind::ALL.into_iter();
        let kinds = kinds.filter(|(name, _)| names.iter().any(|word| word == name)).collect();
        Self { kinds, filters }
    }

    /// Returns true if the cloud of this name is selected.
    pub fn includes(&self, cloud: &str) -> bool {
        self.filters.is_empty() || self.filters.iter().any(|filter| cloud.contains(filter))
    }
}
