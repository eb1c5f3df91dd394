//! The log of finished frames, from which an interrupted movie resumes.

use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::file::{save_text, write_error};

use super::format::MovieFormat;
use super::frame_names::FrameNames;
use super::spec::MovieSpec;

/// The frames of an unfinished movie. Dropping a log without finished frames removes its files.
pub(super) struct FrameLog {
    /// Indices of the finished frames, counted from 0.
    pub done: BTreeSet<u32>,
    files: LogFiles,
}

impl FrameLog {
    /// Starts a log. With `resume` it continues the log of an earlier run.
    ///
    /// # Errors
    ///
    /// Fails if the frames of the earlier run have other settings, if the folder for the frames contains
    /// foreign files, or if a file cannot be read or written.
    pub fn open(spec: &MovieSpec, resume: bool) -> Result<Self> {
        let files = LogFiles::new(spec);
        let done = match files.read_log()? {
            Some(log) if resume => parse_done_frames(spec, &log)?,
            Some(_) => {
                files.remove();
                BTreeSet::new()
            }
            None => BTreeSet::new(),
        };
        files.create_folder()?;
        // From here on, `drop` may remove the files: they are surfel's own.
        let log = Self { done, files };
        log.write_header(&spec.settings())?;
        Ok(log)
    }

    /// Records that the image of a frame is complete.
    ///
    /// # Errors
    ///
    /// Fails if the log cannot be written.
    pub fn record(&mut self, frame: u32) -> Result<()> {
        let path = &self.files.log;
        let line = format!("{}\n", u64::from(frame) + 1);
        let file = OpenOptions::new().append(true).open(path);
        file.and_then(|mut file| file.write_all(line.as_bytes()))
            .map_err(|cause| write_error(path, cause))?;
        self.done.insert(frame);
        Ok(())
    }

    /// Rewrites the whole log, which removes a half-written line that a killed run may have left.
    fn write_header(&self, settings: &str) -> Result<()> {
        let mut text = format!("{settings}\n");
        text.extend(self.done.iter().map(|&frame| format!("{}\n", u64::from(frame) + 1)));
        save_text(&self.files.log, &text)
    }
}

impl Drop for FrameLog {
    fn drop(&mut self) {
        if self.done.is_empty() {
            self.files.remove();
        }
    }
}

/// The files of an unfinished movie on disk.
struct LogFiles {
    /// A text file: a line with the settings, then the number of each finished frame, counted from 1. An
    /// image alone does not prove that its frame is done: it may belong to an older movie.
    log: PathBuf,
    names: FrameNames,
    /// True if the images are temporary and lie in a folder of their own.
    are_temporary: bool,
}

impl LogFiles {
    fn new(spec: &MovieSpec) -> Self {
        let names = spec.names.clone();
        let are_temporary = spec.format != MovieFormat::ImageSequence;
        let name = spec.path.file_name().unwrap_or_default().to_string_lossy();
        let log = if are_temporary {
            names.folder.join("settings")
        } else {
            spec.path.with_file_name(format!(".{name}.surfel"))
        };
        Self { log, names, are_temporary }
    }

    /// Reads the log; `None` if there is none.
    fn read_log(&self) -> Result<Option<String>> {
        use io::ErrorKind::{NotADirectory, NotFound};
        match fs::read(&self.log) {
            Ok(bytes) => Ok(Some(String::from_utf8_lossy(&bytes).into_owned())),
            Err(cause) if matches!(cause.kind(), NotFound | NotADirectory) => Ok(None),
            Err(cause) => Err(Error::Io {
                file: self.log.display().to_string(),
                action: "read",
                cause,
                advice: "make it readable, or remove it to start again",
            }),
        }
    }

    /// Creates the folder, or accepts one that is empty or surfel's own.
    fn create_folder(&self) -> Result<()> {
        let folder = &self.names.folder;
        if !self.are_temporary {
            return Ok(());
        }
        match fs::create_dir(folder) {
            Ok(()) => return Ok(()),
            Err(cause) if cause.kind() == io::ErrorKind::AlreadyExists => {}
            Err(cause) => return Err(write_error(folder, cause)),
        }
        let found = if !folder.is_dir() {
            "a file"
        } else if self.log.exists() || self.list().all(|name| is_temp_file(&name)) {
            return Ok(());
        } else {
            "files without surfel's `settings`"
        };
        Err(Error::InvalidFrames {
            file: folder.display().to_string(),
            found: found.into(),
            expected: "a folder for the frames".into(),
            advice: "move it away, or give the movie another name",
        })
    }

    /// Removes the files of the frames and nothing else, and ignores failures.
    ///
    /// The log goes last: if the removal is interrupted, the next run still recognises the folder as
    /// surfel's own.
    fn remove(&self) {
        if self.are_temporary {
            for name in self.list().filter(|name| self.names.matches(name) || is_temp_file(name)) {
                let _ = fs::remove_file(self.names.folder.join(name));
            }
        }
        let _ = fs::remove_file(&self.log);
        if self.are_temporary {
            let _ = fs::remove_dir(&self.names.folder);
        }
    }

    fn list(&self) -> impl Iterator<Item = String> {
        let entries = fs::read_dir(&self.names.folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned())
    }
}

/// Returns true for the name of a temporary file that a killed run may have left.
fn is_temp_file(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(".part")
}

/// Returns the frames that `log` records and whose images exist.
fn parse_done_frames(spec: &MovieSpec, log: &str) -> Result<BTreeSet<u32>> {
    let (found, frames) = log.split_once('\n').unwrap_or((log, ""));
    let expected = spec.settings();
    if found != expected {
        return Err(Error::ResumeMismatch { file: spec.file(), found: found.into(), expected });
    }
    // A line without a line break may have lost digits.
    let numbers = frames.split_inclusive('\n').filter_map(|line| line.strip_suffix('\n'));
    let frames = numbers.filter_map(|number| number.parse::<u32>().ok()?.checked_sub(1));
    let is_done = |&frame: &u32| frame < spec.options.n_frames && spec.names.path(frame).is_file();
    Ok(frames.filter(is_done).collect())
}
