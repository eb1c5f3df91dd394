//! Files as they are typed: folders, patterns and standard input become files.

use crate::Usage;
use anyhow::{Context, anyhow};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use surfel::description::pattern::{file_names, matching};

/// Returns the files that words of a command line stand for.
///
/// # Errors
///
/// Fails for folders without a file that surfel reads, for patterns that match nothing, and if standard input is named
/// twice.
pub fn expand(words: &[PathBuf]) -> anyhow::Result<Vec<PathBuf>> {
    if 1 < words.iter().filter(|word| is_stdin(word)).count() {
        return Err(
            Usage("- is standard input, which can be read once; name it once".into()).into()
        );
    }
    let mut files = Vec::new();
    for word in words {
        if is_stdin(word) {
            files.push(standard_input()?);
        } else if word.is_dir() {
            files.extend(files_of_folder(word)?);
        } else if word.to_string_lossy().contains('*') && !word.exists() {
            files.extend(matching(word).map_err(|error| anyhow!(error))?);
        } else {
            files.push(word.clone());
        }
    }
    Ok(files)
}

fn is_stdin(word: &Path) -> bool {
    word == Path::new("-")
}

fn files_of_folder(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let names = file_names(folder).map_err(|error| anyhow!(error))?;
    let is_known = |name: &String| {
        let name = name.to_ascii_lowercase();
        surfel_formats::FORMATS
            .iter()
            .flat_map(|format| format.extensions)
            .any(|extension| name.strip_suffix(extension).is_some_and(|stem| stem.ends_with('.')))
    };
    let files: Vec<PathBuf> =
        names.into_iter().filter(is_known).map(|name| folder.join(name)).collect();
    if files.is_empty() {
        anyhow::bail!("{}: holds no point cloud, mesh or glTF scene", folder.display());
    }
    Ok(files)
}

/// Copies standard input to a temporary file, whose extension says what its first bytes are.
fn standard_input() -> anyhow::Result<PathBuf> {
    let mut bytes = Vec::new();
    std::io::stdin().lock().read_to_end(&mut bytes).context("standard input cannot be read")?;
    let format = surfel_formats::detect_bytes(&bytes);
    let extension = format.and_then(|format| format.extensions.first()).unwrap_or(&"xyz");
    let name = format!("surfel-stdin-{}.{extension}", std::process::id());
    let path = std::env::temp_dir().join(name);
    // A process of the same number may have been killed before it could remove its file.
    let _ = std::fs::remove_file(&path);
    // Only a new file: a link of this name could lead anywhere.
    let mut file = std::fs::File::create_new(&path).with_context(|| path.display().to_string())?;
    crate::cleanup::remove_at_exit(path.clone());
    file.write_all(&bytes).with_context(|| path.display().to_string())?;
    Ok(path)
}
