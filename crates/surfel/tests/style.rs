//! Modules look down only: each uses just those declared before it in `lib.rs`.

use std::fs;
use std::path::{Path, PathBuf};

#[test]
fn modules_look_down_only() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let lib = fs::read_to_string(src.join("lib.rs")).unwrap();
    let modules: Vec<&str> =
        lib.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';')).collect();
    assert!(modules.len() > 3, "lib.rs declares its modules as `pub mod name;`");
    for (layer, module) in modules.iter().enumerate() {
        let mut files = files_below(&src.join(module));
        files.push(src.join(format!("{module}.rs")));
        for path in files.iter().filter(|path| path.is_file()) {
            let text = fs::read_to_string(path).unwrap();
            for higher in &modules[layer + 1..] {
                assert!(!text.contains(&format!("crate::{higher}")), "{path:?} uses {higher}");
            }
            assert!(!text.contains("use crate::{"), "{path:?}: name one module a line");
        }
    }
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() { files.extend(files_below(&path)) } else { files.push(path) }
    }
    files
}
