//! Images, each decoded once, and how materials refer to them.

use std::collections::HashMap;

use surfel::math::Vec2;
use surfel::scene::{Texture, TextureRef, Wrap};

use super::document::Document;
use super::json::Json;
use super::uri::{fetch, is_data};
use crate::error::{Error, Result};
use crate::texture::decode;

/// The images that materials have asked for so far.
pub(super) struct Pictures<'a> {
    document: &'a Document<'a>,
    pub textures: Vec<Texture>,
    /// Index of the texture by where its bytes are; none where they cannot be read.
    known: HashMap<String, Option<usize>>,
}

impl<'a> Pictures<'a> {
    pub fn new(document: &'a Document<'a>) -> Self {
        Self { document, textures: Vec::new(), known: HashMap::new() }
    }

    /// The texture in the member `key` of a material. A picture that is missing or cannot be read is told
    /// and left out: people would rather see the rest than nothing.
    pub fn refer(&mut self, material: &Json<'a>, key: &str) -> Result<Option<TextureRef>> {
        let Some(info) = material.get(key) else { return Ok(None) };
        let texture = self.document.referred("textures", &info.need("index")?)?;
        let Some(source) = texture.get("source") else {
            let pointer = texture.pointer();
            self.document.note(format!("{pointer} has no PNG or JPEG, and is left out"));
            return Ok(None);
        };
        let image = self.document.referred("images", &source)?;
        let Some(texture_idx) = self.texture(&image)? else { return Ok(None) };
        let sampler = texture.get("sampler");
        let sampler = sampler.map(|sampler| self.document.referred("samplers", &sampler));
        let mut reference = TextureRef::new(texture_idx);
        if let Some(sampler) = sampler.transpose()? {
            reference.wrap = [wrap(&sampler, "wrapS")?, wrap(&sampler, "wrapT")?];
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
                "{} uses TEXCOORD_{uv_set} and is left out; surfel keeps the first two",
                info.pointer()
            );
            self.document.note(line);
            return Ok(None);
        }
        reference.uv_set = uv_set as usize;
        Ok(Some(reference))
    }

    fn texture(&mut self, image: &Json<'a>) -> Result<Option<usize>> {
        let key = match image.get("uri") {
            Some(uri) if !is_data(uri.text()?) => uri.text()?.to_owned(),
            Some(_) => image.pointer().to_owned(),
            // No name of a file has this letter.
            None => format!("\0{}", image.need("bufferView")?.index()?),
        };
        if let Some(known) = self.known.get(&key) {
            return Ok(*known);
        }
        self.document.progress.check()?;
        let index = match self.read(image) {
            Ok(texture) => {
                self.textures.push(texture);
                Some(self.textures.len() - 1)
            }
            Err(Unread::Picture(error)) => {
                let line = format!("{} is left out: {error}", image.pointer());
                self.document.note(line);
                None
            }
            Err(Unread::File(error)) => return Err(error),
        };
        self.known.insert(key, index);
        Ok(index)
    }

    fn read(&self, image: &Json<'a>) -> std::result::Result<Texture, Unread> {
        let Some(uri) = image.get("uri") else {
            let view = image.need("bufferView").map_err(Unread::File)?;
            let bytes = self.document.view(&view).map_err(Unread::File)?.bytes;
            self.document.charge_picture(image, bytes.len()).map_err(Unread::File)?;
            let name = format!("{}{}", image.file(), image.pointer());
            return decode(&name, bytes).map_err(Unread::Picture);
        };
        let bytes = fetch(self.document.beside, &uri).map_err(Unread::Picture)?;
        let name = match uri.text().map_err(Unread::File)? {
            data if is_data(data) => format!("{}{}", image.file(), image.pointer()),
            path => path.into(),
        };
        decode(&name, &bytes).map_err(Unread::Picture)
    }
}

/// Why there is no picture.
enum Unread {
    /// It is missing or broken: one does without.
    Picture(Error),
    /// The file around it is.
    File(Error),
}

fn wrap(sampler: &Json, key: &str) -> Result<Wrap> {
    match sampler.unsigned_or(key, 10497)? {
        10497 => Ok(Wrap::Repeat),
        33648 => Ok(Wrap::MirroredRepeat),
        33071 => Ok(Wrap::ClampToEdge),
        _ => Err(sampler.need(key)?.unlike("10497, 33648 or 33071")),
    }
}
