//! Files as they are typed: folders, patterns and standard input become files.

use crate::Usage;
use crate::interrupt::is_cancelled;
use crate::report::Report;
use crate::stdin_copy::remember;
use anyhow::{Context, anyhow};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;
use surfel::description::is_scene_file;
use surfel::description::pattern::{file_names, matching};
use surfel_core::progress::Progress;

/// Size of a chunk of standard input.
const CHUNK_BYTES: u64 = 1 << 20;
/// Number of chunks that are read before one is written.
const CHUNKS_AHEAD: usize = 4;
/// Time between two looks at a signal.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

/// Extensions of files of folders that often hold no points: notes, tables and the buffers of glTF.
const EXTENSIONS_OF_OTHER_FILES: [&str; 4] = ["txt", "csv", "asc", "bin"];

/// Returns the files that words of a command line stand for. Reports files of folders that it leaves out.
///
/// # Errors
///
/// Fails for folders without a file that surfel reads, for patterns that match nothing, and if standard input is named
/// twice.
pub fn expand(words: &[PathBuf], report: &Report) -> anyhow::Result<Vec<PathBuf>> {
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
            files.extend(files_of_folder(word, report)?);
        } else if word.to_string_lossy().contains('*') && !word.exists() {
            files.extend(matching(word).map_err(|error| anyhow!(error))?);
        } else {
            files.push(word.clone());
        }
    }
    Ok(files)
}

/// Returns the files that words of a command line stand for, none of which may be a scene file.
///
/// # Errors
///
/// Fails for scene files, and as [`expand`] does.
pub fn expand_content(words: &[PathBuf], report: &Report) -> anyhow::Result<Vec<PathBuf>> {
    let files = expand(words, report)?;
    match files.iter().find(|file| is_scene_file(file)) {
        None => Ok(files),
        Some(file) => {
            let file = file.display();
            let text =
                "is a scene file, which surfel render, animate and view take; name the files in it";
            Err(Usage(format!("{file}: {text}")).into())
        }
    }
}

fn is_stdin(word: &Path) -> bool {
    word == Path::new("-")
}

fn files_of_folder(folder: &Path, report: &Report) -> anyhow::Result<Vec<PathBuf>> {
    let names = file_names(folder).map_err(|error| anyhow!(error))?;
    let is_known = |name: &String| {
        let name = name.to_ascii_lowercase();
        surfel_formats::FORMATS
            .iter()
            .flat_map(|format| format.extensions)
            .any(|extension| name.strip_suffix(extension).is_some_and(|stem| stem.ends_with('.')))
    };
    let mut files: Vec<PathBuf> =
        names.into_iter().filter(is_known).map(|name| folder.join(name)).collect();
    files.retain(|file| {
        let is_other = is_other_file(file);
        if is_other {
            report.note(&format!(
                "{}: left out, since it does not begin with points",
                file.display()
            ));
        }
        !is_other
    });
    if files.is_empty() {
        anyhow::bail!("{}: holds no point cloud, mesh or glTF scene", folder.display());
    }
    Ok(files)
}

/// Returns true for a readable file that has an extension of points and begins with something else.
fn is_other_file(file: &Path) -> bool {
    let extension = file.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    EXTENSIONS_OF_OTHER_FILES.contains(&&*extension)
        && matches!(surfel_formats::inspect(file), Err(surfel_formats::Error::Malformed { .. }))
}

/// Copies standard input to a temporary file, whose extension says what its first bytes are.
fn standard_input() -> anyhow::Result<PathBuf> {
    let path = std::env::temp_dir().join(format!("surfel-stdin-{}.xyz", std::process::id()));
    // A process of the same number may have been killed before it could remove its file.
    let _ = std::fs::remove_file(&path);
    // Only a new file: a link of this name could lead anywhere.
    let mut file = std::fs::File::create_new(&path).with_context(|| path.display().to_string())?;
    crate::cleanup::remove_at_exit(path.clone());
    remember(&path);
    for chunk in chunks_of_stdin()? {
        let chunk = chunk?.context("standard input cannot be read")?;
        file.write_all(&chunk).with_context(|| path.display().to_string())?;
    }
    drop(file);
    let format = surfel_formats::detect_file(&path)?;
    let extension = format.and_then(|format| format.extensions.first()).unwrap_or(&"xyz");
    let named = path.with_extension(extension);
    std::fs::rename(&path, &named).with_context(|| named.display().to_string())?;
    crate::cleanup::remove_at_exit(named.clone());
    remember(&named);
    Ok(named)
}

/// Returns standard input in chunks, until it ends or a signal cancels the run: a thread of its own waits for a writer
/// that may never write.
fn chunks_of_stdin()
-> anyhow::Result<impl Iterator<Item = surfel_core::Result<std::io::Result<Vec<u8>>>>> {
    let (sender, receiver) = sync_channel(CHUNKS_AHEAD);
    let read = move || {
        loop {
            let mut chunk = Vec::new();
            let read = std::io::stdin().lock().take(CHUNK_BYTES).read_to_end(&mut chunk);
            if matches!(read, Ok(0)) {
                return;
            }
            let is_broken = read.is_err();
            if sender.send(read.map(|_| chunk)).is_err() || is_broken {
                return;
            }
        }
    };
    std::thread::Builder::new().name("stdin".into()).spawn(read)?;
    Ok(std::iter::from_fn(move || {
        while !is_cancelled() {
            match receiver.recv_timeout(SIGNAL_INTERVAL) {
                Ok(chunk) => return Some(Ok(chunk)),
                Err(RecvTimeoutError::Disconnected) => return None,
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
        Some(Err(surfel_core::Error::Cancelled))
    }))
}
