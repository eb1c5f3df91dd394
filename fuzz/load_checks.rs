//! Reads bytes as a cloud, whole and salvaged.

use surfel_core::progress::NoProgress;
use surfel_formats::{LoadOptions, load_bytes};

/// Reads a file with salvage off and on; each cloud must have at most `max_points` points. What is read whole must be
/// the same if it is salvaged.
pub fn check_load(name: &str, bytes: &[u8], options: &LoadOptions, max_points: usize) {
    let whole = load_bytes(name, bytes, options, &NoProgress);
    let salvage = LoadOptions { salvage: true, ..options.clone() };
    let salvaged = load_bytes(name, bytes, &salvage, &NoProgress);
    let clouds = [&whole, &salvaged].into_iter().flatten();
    assert!(clouds.map(|loaded| loaded.cloud.len()).all(|n_points| n_points <= max_points));
    if let Ok(whole) = whole {
        let salvaged = salvaged.expect("a whole file is read");
        assert_eq!(whole.cloud.len(), salvaged.cloud.len());
        assert_eq!(whole.info, salvaged.info);
    }
}
