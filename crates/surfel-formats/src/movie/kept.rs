//! The frames of a movie in the making: which are done, and how they were made.

use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::PathBuf;

use crate::atomic::{save_text, write_failed};
use crate::error::{Error, Result};

use super::format::MovieFormat;
use super::names::FrameNames;
use super::plan::Plan;

/// Frames that are done; if none are, all that was written for them is removed at the end.
pub(super) struct Kept {
    /// Counted from 0.
    pub done: BTreeSet<u32>,
    files: Files,
}

impl Kept {
    /// Begins, or with `resume` goes on if frames were begun with the same settings.
    pub fn open(plan: &Plan, resume: bool) -> Result<Self> {
        let files = Files::new(plan);
        let done = match files.read_note()? {
            Some(note) if resume => done_before(plan, &note)?,
            Some(_) => {
                files.remove();
                BTreeSet::new()
            }
            None => BTreeSet::new(),
        };
        files.make_folder()?;
        // From here on, what is there is surfel's own.
        let kept = Self { done, files };
        kept.begin_note(&plan.settings())?;
        Ok(kept)
    }

    /// Notes that the picture of a frame is there.
    pub fn note(&mut self, frame: u32) -> Result<()> {
        let note = &self.files.note;
        let line = format!("{}\n", u64::from(frame) + 1);
        let file = OpenOptions::new().append(true).open(note);
        file.and_then(|mut file| file.write_all(line.as_bytes()))
            .map_err(|cause| write_failed(note, cause))?;
        self.done.insert(frame);
        Ok(())
    }

    /// Written whole, so that no half line of a killed run is left in it.
    fn begin_note(&self, settings: &str) -> Result<()> {
        let note = &self.files.note;
        let mut text = format!("{settings}\n");
        text.extend(self.done.iter().map(|&frame| format!("{}\n", u64::from(frame) + 1)));
        save_text(note, &text)
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        if self.done.is_empty() {
            self.files.remove();
        }
    }
}

/// What is written for the frames, and where.
struct Files {
    /// A line with the settings, then one for each frame that is done, counted from 1. A picture that
    /// is there does not mean that its frame is done: it may be that of an older movie.
    note: PathBuf,
    names: FrameNames,
    /// Whether the pictures are there for the film's sake only, in a folder of their own.
    are_scratch: bool,
}

impl Files {
    fn new(plan: &Plan) -> Self {
        let names = plan.names.clone();
        let are_scratch = plan.format != MovieFormat::Pictures;
        let name = plan.path.file_name().unwrap_or_default().to_string_lossy();
        let note = if are_scratch {
            names.folder.join("settings")
        } else {
            plan.path.with_file_name(format!(".{name}.surfel"))
        };
        Self { note, names, are_scratch }
    }

    fn read_note(&self) -> Result<Option<String>> {
        use io::ErrorKind::{NotADirectory, NotFound};
        match fs::read(&self.note) {
            Ok(bytes) => Ok(Some(String::from_utf8_lossy(&bytes).into_owned())),
            Err(cause) if matches!(cause.kind(), NotFound | NotADirectory) => Ok(None),
            Err(cause) => Err(Error::Io {
                file: self.note.display().to_string(),
                action: "read",
                cause,
                advice: "ask for the right to read it, or remove it to start again",
            }),
        }
    }

    /// Makes the folder, or takes one that is empty or surfel's own.
    fn make_folder(&self) -> Result<()> {
        let folder = &self.names.folder;
        if !self.are_scratch {
            return Ok(());
        }
        match fs::create_dir(folder) {
            Ok(()) => return Ok(()),
            Err(cause) if cause.kind() == io::ErrorKind::AlreadyExists => {}
            Err(cause) => return Err(write_failed(folder, cause)),
        }
        let found = if !folder.is_dir() {
            "a file"
        } else if self.note.exists() || self.list().all(|name| is_unfinished(&name)) {
            return Ok(());
        } else {
            "files without surfel's `settings`"
        };
        Err(Error::Frames {
            file: folder.display().to_string(),
            found: found.into(),
            expected: "a folder for the frames".into(),
            advice: "move it away, or give the movie another name",
        })
    }

    /// Removes what was written for the frames, and nothing else.
    ///
    /// What cannot be removed stays. The note goes after the pictures: if this is cut short, the next
    /// run still knows the folder for surfel's own.
    fn remove(&self) {
        if self.are_scratch {
            for name in self.list().filter(|name| self.names.fits(name) || is_unfinished(name)) {
                let _ = fs::remove_file(self.names.folder.join(name));
            }
        }
        let _ = fs::remove_file(&self.note);
        if self.are_scratch {
            let _ = fs::remove_dir(&self.names.folder);
        }
    }

    fn list(&self) -> impl Iterator<Item = String> {
        let entries = fs::read_dir(&self.names.folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned())
    }
}

/// Whether a run that was killed left the file of this name half written.
fn is_unfinished(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(".part")
}

/// The frames that a note calls done and whose pictures are there.
fn done_before(plan: &Plan, note: &str) -> Result<BTreeSet<u32>> {
    let (found, frames) = note.split_once('\n').unwrap_or((note, ""));
    let expected = plan.settings();
    if found != expected {
        return Err(Error::OtherSettings { file: plan.file(), found: found.into(), expected });
    }
    // A line without end may have lost digits.
    let numbers = frames.split_inclusive('\n').filter_map(|line| line.strip_suffix('\n'));
    let frames = numbers.filter_map(|number| number.parse::<u32>().ok()?.checked_sub(1));
    let is_done = |&frame: &u32| frame < plan.options.n_frames && plan.names.path(frame).is_file();
    Ok(frames.filter(is_done).collect())
}
