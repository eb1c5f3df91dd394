//! Textures that a mesh file names, each read once.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use surfel_core::scene::Texture;

use super::texture::decode_texture;
use crate::file::{Input, MissingFiles, ResourceResolver, file_key};

/// Reads textures by the names of their files.
pub(crate) struct TextureLoader<'a> {
    /// Textures read so far.
    pub textures: Vec<Texture>,
    /// Files that were not found.
    pub missing: MissingFiles,
    /// Index of the texture of each requested name, `None` if it cannot be read.
    by_name: HashMap<String, Option<usize>>,
    /// Index of the texture of each file, which may have several names.
    by_file: HashMap<PathBuf, Option<usize>>,
    resolver: &'a ResourceResolver<'a>,
}

impl<'a> TextureLoader<'a> {
    /// Creates a loader that finds files by a resolver.
    pub fn new(resolver: &'a ResourceResolver) -> Self {
        Self {
            textures: Vec::new(),
            missing: MissingFiles::default(),
            by_name: HashMap::new(),
            by_file: HashMap::new(),
            resolver,
        }
    }

    /// Returns the index of the texture in the file of this name, or `None` if it cannot be read.
    pub fn load(&mut self, name: &str) -> Option<usize> {
        if let Some(known) = self.by_name.get(name) {
            return *known;
        }
        let texture = match self.resolver.find(name) {
            Ok(path) => self.load_file(&path),
            Err(reason) => {
                self.missing.add(reason);
                None
            }
        };
        self.by_name.insert(name.to_owned(), texture);
        texture
    }

    /// Returns the index of the texture in a file, or `None` if it cannot be read.
    fn load_file(&mut self, path: &Path) -> Option<usize> {
        let key = file_key(path);
        if let Some(known) = self.by_file.get(&key) {
            return *known;
        }
        let decoded = Input::open(path).and_then(|file| decode_texture(&file.name, &file));
        let texture = match decoded {
            Ok(texture) => {
                self.textures.push(texture);
                Some(self.textures.len() - 1)
            }
            Err(error) => {
                self.missing.add(error.to_string());
                None
            }
        };
        self.by_file.insert(key, texture);
        texture
    }
}
