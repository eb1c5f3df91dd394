//! Textures of materials. Each image is decoded once.

use std::collections::HashMap;

use surfel_core::math::Vec2;
use surfel_core::scene::{Texture, TextureRef, Wrap};

use super::document::Document;
use super::json::Json;
use super::uri::{is_data_uri, load_uri};
use crate::error::{Error, Result};
use crate::mesh::decode_texture;

/// The textures that materials have referred to so far.
pub(super) struct TextureCache<'a> {
    document: &'a Document<'a>,
    /// Decoded textures.
    pub all: Vec<Texture>,
    /// Index of the texture by the URI or buffer view of its image; `None` if it cannot be decoded.
    by_source: HashMap<String, Option<usize>>,
}

impl<'a> TextureCache<'a> {
    /// Creates a reader of the document's textures.
    pub fn new(document: &'a Document<'a>) -> Self {
        Self { document, all: Vec::new(), by_source: HashMap::new() }
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
            Ok(texture) => {
                self.all.push(texture);
                Some(self.all.len() - 1)
            }
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

    fn decode(&self, image: &Json<'a>) -> std::result::Result<Texture, ImageError> {
        let Some(uri) = image.get("uri") else {
            let view = image.require("bufferView").map_err(ImageError::Fatal)?;
            let bytes = self.document.view(&view).map_err(ImageError::Fatal)?.bytes;
            self.document.reserve_image(image, bytes.len()).map_err(ImageError::Fatal)?;
            let name = format!("{}{}", image.file(), image.pointer());
            return decode_texture(&name, bytes).map_err(ImageError::Skipped);
        };
        let bytes = load_uri(self.document.resolver, &uri).map_err(ImageError::Skipped)?;
        let name = match uri.string().map_err(ImageError::Fatal)? {
            data if is_data_uri(data) => format!("{}{}", image.file(), image.pointer()),
            path => path.into(),
        };
        decode_texture(&name, &bytes).map_err(ImageError::Skipped)
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
