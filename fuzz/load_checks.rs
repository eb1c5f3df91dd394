//! Reads bytes as a cloud: the header alone, the whole file, salvaged and filtered.

use surfel_core::progress::NoProgress;
use surfel_formats::{LoadOptions, inspect_bytes, load_bytes};

/// Reads the header, and the file with salvage off and on; each cloud must have at most `max_points` points. What is
/// read whole must be the same if it is salvaged, and a filter keeps the points that meet it.
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
        assert!(inspect_bytes(name, bytes).is_ok());
        let filter = Some("z > 1".parse().unwrap());
        let filtered = LoadOptions { filter: filter.clone(), ..options.clone() };
        let filtered =
            load_bytes(name, bytes, &filtered, &NoProgress).expect("a whole file is read");
        let kept = filter.unwrap().matches(&whole.cloud, 0).unwrap();
        assert_eq!(filtered.cloud.len(), kept.into_iter().filter(|is_kept| *is_kept).count());
    } else {
        // The header alone may be whole.
        let _ = inspect_bytes(name, bytes);
    }
}
