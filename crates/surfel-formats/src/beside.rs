//! Files that a file names: materials and textures, each read once.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use surfel::progress::Progress;
use surfel::scene::Texture;

use crate::input::Input;
use crate::texture::decode;

/// Where such files are looked for, and which were.
pub(crate) struct Beside<'a> {
    /// None if the file itself is none of the disk.
    pub folder: Option<&'a Path>,
    wanted: RefCell<Vec<PathBuf>>,
}

/// The textures that have been read, and what could not be.
pub(crate) struct Textures<'a> {
    pub all: Vec<Texture>,
    pub missing: Missing,
    by_name: HashMap<String, Option<usize>>,
    beside: &'a Beside<'a>,
}

/// What was not found; the first is told with its reason, of the others their number.
#[derive(Default)]
pub(crate) struct Missing {
    first: Option<String>,
    n_others: u64,
}

impl<'a> Beside<'a> {
    pub fn file(path: &'a Path) -> Self {
        Self { folder: Some(path.parent().unwrap_or(Path::new(""))), ..Self::nowhere() }
    }

    pub fn nowhere() -> Self {
        Self { folder: None, wanted: RefCell::default() }
    }

    /// The first of `paths` where there is a file, or the first of all.
    pub fn choose<'p>(&self, paths: &'p [PathBuf]) -> &'p Path {
        let path = paths.iter().find(|path| path.is_file()).unwrap_or(&paths[0]);
        self.wanted.borrow_mut().push(path.clone());
        path
    }

    /// Files that were looked for, also those that are not there.
    pub fn into_wanted(self) -> Vec<PathBuf> {
        self.wanted.into_inner()
    }

    /// The file of this name, or why there is none.
    ///
    /// Programs write the paths of their own machine: where there is nothing, the last part of the
    /// path is looked for in the folder.
    pub fn open(&self, name: &str) -> Result<Input<'static>, String> {
        let Some(folder) = self.folder else {
            return Err(format!("{name} is a file of its own, and not looked for"));
        };
        let path = name.replace('\\', "/");
        let last = path.rsplit('/').next().unwrap_or_default();
        let paths = [folder.join(&path), folder.join(last)];
        Input::open(self.choose(&paths)).map_err(|error| error.to_string())
    }
}

impl<'a> Textures<'a> {
    pub fn new(beside: &'a Beside) -> Self {
        Self { all: Vec::new(), missing: Missing::default(), by_name: HashMap::new(), beside }
    }

    /// Index of the texture in the file of this name, if it can be read.
    pub fn read(&mut self, name: &str) -> Option<usize> {
        if let Some(known) = self.by_name.get(name) {
            return *known;
        }
        let decoded = self
            .beside
            .open(name)
            .and_then(|picture| decode(&picture.name, &picture).map_err(|error| error.to_string()));
        let texture = match decoded {
            Ok(texture) => {
                self.all.push(texture);
                Some(self.all.len() - 1)
            }
            Err(reason) => {
                self.missing.add(reason);
                None
            }
        };
        self.by_name.insert(name.to_owned(), texture);
        texture
    }
}

impl Missing {
    pub fn add(&mut self, reason: String) {
        match self.first {
            None => self.first = Some(reason),
            Some(_) => self.n_others += 1,
        }
    }

    /// Notes what was not found, behind what follows from it.
    pub fn tell(&self, effect: &str, progress: &dyn Progress) {
        match (&self.first, self.n_others) {
            (None, _) => {}
            (Some(first), 0) => progress.note(&format!("{effect}: {first}")),
            (Some(first), n) => progress.note(&format!("{effect}: {first} (and {n} others)")),
        }
    }
}
