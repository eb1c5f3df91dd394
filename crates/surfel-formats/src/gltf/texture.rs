//! Textures of materials. Each image is decoded once.

use std::collections::HashMap;
use std::path::PathBuf;

use surfel_core::math::Vec2;
use surfel_core::scene::{Texture, TextureRef, Wrap};

use super::document::Document;
use super::json::Json;
use super::uri::{file_path, is_data_uri, open_file, read_data_uri};
use crate::error::{Error, Result};
use crate::file::file_key;
use crate::mesh::decode_texture;

/// The textures that materials have referred to so far.
pub(super) struct TextureCache<'a> {
    document: &'a Document<'a>,
    /// Decoded textures.
    pub all: Vec<Texture>,
    /// Index of the texture by the URI or buffer view of its image; `None` if it cannot be decoded.
    by_source: HashMap<String, Option<usize>>,
    /// Index of the texture of each file, which several URIs may name.
    by_file: HashMap<PathBuf, Option<usize>>,
}

impl<'a> TextureCache<'a> {
    /// Creates a reader of the document's textures.
    pub fn new(document: &'a Document<'a>) -> Self {
        let (by_source, by_file) = (HashMap::new(), HashMap::new());
        Self { document, all: Vec::new(), by_source, by_file }
    }

    /// Returns the texture in the member `key` of a material. An image that is missing or malformed is
    /// reported and skipped, so that the rest of the scene is still shown.
    pub fn load(&mut self, material: &Json<'a>, key: &str) -> Result<Option<TextureRef>> {
        let Some(info) = material.get(key) else { return Ok(None) };
        let texture = self.document.resolve("textures", &info.require("index")?)?;
        let Some(source) = texture.get("source") else {
            let pointer = texture.pointer();
            self.document.warn(format!("{pointer} has no PNG or JPEG image and is skipped"));
            return Ok(None);
        };
        let image = self.document.resolve("images", &source)?;
        let Some(texture_idx) = self.load_image(&image)? else { return Ok(None) };
        let sampler = texture.get("sampler");
        let sampler = sampler.map(|sampler| self.document.resolve("samplers", &sampler));
        let mut reference = TextureRef::new(texture_idx);
        if let Some(sampler) = sampler.transpose()? {
            reference.wrap = [read_wrap(&sampler, "wrapS")?, read_wrap(&sampler, "wrapT")?];
            const NEAREST: u64 = 9728;
            reference.is_nearest = sampler.unsigned_or("magFilter", 0)? == NEAREST;
        }
        let mut uv_set = info.unsigned_or("texCoord", 0)?;
        if let Some(transform) = info.extension("KHR_texture_transform") {
            reference.offset = Vec2::from(transform.floats_or("offset", [0.0; 2])?);
            reference.scale = Vec2::from(transform.floats_or("scale", [1.0; 2])?);
            reference.rotation_rad = transform.float_or("rotation", 0.0)?;
            uv_set = transform.unsigned_or("texCoord", uv_set)?;
        }
        if 1 < uv_set {
            let line = format!(
                "{} is skipped: it uses TEXCOORD_{uv_set}, and surfel reads only the first two sets",
                info.pointer()
            );
            self.document.warn(line);
            return Ok(None);
        }
        reference.uv_set = uv_set as usize;
        Ok(Some(reference))
    }

    /// Returns the index of the texture of an image, if it can be decoded.
    fn load_image(&mut self, image: &Json<'a>) -> Result<Option<usize>> {
        let key = match image.get("uri") {
            Some(uri) if !is_data_uri(uri.string()?) => uri.string()?.to_owned(),
            Some(_) => image.pointer().to_owned(),
            // No file name contains the zero byte.
            None => format!("\0{}", image.require("bufferView")?.index()?),
        };
        if let Some(index) = self.by_source.get(&key) {
            return Ok(*index);
        }
        self.document.progress.check()?;
        let index = match self.decode(image) {
            Ok(index) => index,
            Err(ImageError::Skipped(error)) => {
                let line = format!("{} is skipped: {error}", image.pointer());
                self.document.warn(line);
                None
            }
            Err(ImageError::Fatal(error)) => return Err(error),
        };
        self.by_source.insert(key, index);
        Ok(index)
    }

    /// Decodes an image and returns the index of the texture; `None` if it is in a file that was skipped already.
    fn decode(&mut self, image: &Json<'a>) -> Result<Option<usize>, ImageError> {
        let name = format!("{}{}", image.file(), image.pointer());
        let Some(uri) = image.get("uri") else {
            let view = image.require("bufferView").map_err(ImageError::Fatal)?;
            let bytes = self.document.view(&view).map_err(ImageError::Fatal)?.bytes;
            self.document.reserve_image(image, bytes.len()).map_err(ImageError::Fatal)?;
            return self.add(decode_texture(&name, bytes)).map(Some);
        };
        let text = uri.string().map_err(ImageError::Fatal)?;
        if is_data_uri(text) {
            let bytes = read_data_uri(&uri).map_err(ImageError::Skipped)?;
            return self.add(decode_texture(&name, &bytes)).map(Some);
        }
        let path = file_path(self.document.resolver, &uri).map_err(ImageError::Skipped)?;
        let key = file_key(&path);
        if let Some(known) = self.by_file.get(&key) {
            return Ok(*known);
        }
        let file = open_file(&path, &uri);
        let decoded = self.add(file.and_then(|file| decode_texture(text, &file)));
        self.by_file.insert(key, decoded.as_ref().ok().copied());
        decoded.map(Some)
    }

    /// Adds a decoded texture and returns its index.
    fn add(&mut self, decoded: Result<Texture>) -> Result<usize, ImageError> {
        self.all.push(decoded.map_err(ImageError::Skipped)?);
        Ok(self.all.len() - 1)
    }
}

/// An error that prevents a texture from being decoded.
enum ImageError {
    /// The image is missing or malformed; the material goes without it.
    Skipped(Error),
    /// The glTF file itself is malformed.
    Fatal(Error),
}

fn read_wrap(sampler: &Json, key: &str) -> Result<Wrap> {
    match sampler.unsigned_or(key, 10497)? {
        10497 => Ok(Wrap::Repeat),
        33648 => Ok(Wrap::MirroredRepeat),
        33071 => Ok(Wrap::ClampToEdge),
        _ => Err(sampler.require(key)?.type_error("10497, 33648 or 33071")),
    }
}
