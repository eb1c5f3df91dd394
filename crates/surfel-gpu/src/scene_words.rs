//! Texels, environment maps and colours by support in one array on a device, kept from picture to picture.

use crate::device::Gpu;
use crate::error::Result;
use crate::scene_records::{WordOffsets, append_words, n_words};
use crate::transfer::write;
use crate::upload::{array, check_array};
use std::sync::Arc;
use surfel_core::flat::{FlatGeometry, FlatScene};
use surfel_core::progress::Progress;
use surfel_core::scene::Light;
use surfel_core::scene::color::SupportColors;

/// The words of a scene in a device's memory.
#[derive(Debug)]
pub struct SceneWords {
    source: Source,
    /// The array.
    pub buffer: wgpu::Buffer,
    /// The places of textures and the like in it.
    pub offsets: WordOffsets,
}

/// The addresses of pictures that are alive, and the colours by support of geometries.
#[derive(Debug, Default, PartialEq)]
struct Source {
    pictures: Vec<Picture>,
    support_colors: Vec<Option<SupportColors>>,
}

/// A picture, kept alive so that its address stays its own.
#[derive(Debug, Clone)]
enum Picture {
    Texture(Arc<[[u8; 4]]>),
    Environment(Box<surfel_core::scene::Environment>),
}

impl PartialEq for Picture {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Texture(a), Self::Texture(b)) => Arc::ptr_eq(a, b),
            (Self::Environment(a), Self::Environment(b)) => {
                std::ptr::eq(a.arrays().pixels, b.arrays().pixels)
            }
            _ => false,
        }
    }
}

impl Source {
    fn new(scene: &FlatScene) -> Self {
        let textures =
            scene.textures.iter().map(|texture| Picture::Texture(texture.texels.clone()));
        let environments = scene.lights.iter().filter_map(|light| match light {
            Light::Environment(environment) => {
                Some(Picture::Environment(Box::new(environment.clone())))
            }
            _ => None,
        });
        let support_colors = scene.geometries.iter().map(|geometry| match &**geometry {
            FlatGeometry::Cloud(cloud) => cloud.support_colors,
            FlatGeometry::Mesh(_) => None,
        });
        Self {
            pictures: textures.chain(environments).collect(),
            support_colors: support_colors.collect(),
        }
    }
}

impl SceneWords {
    /// Frees `known` unless they are the words of this scene.
    ///
    /// # Errors
    ///
    /// Fails if the words of the scene are too many for the device, or if it has failed.
    pub fn free_unless_same(known: &mut Option<Self>, gpu: &Gpu, scene: &FlatScene) -> Result<()> {
        check_array(gpu, 4 * n_words(scene))?;
        let source = Source::new(scene);
        match known.take_if(|known| known.source != source) {
            // The memory is free once the device has finished with it.
            Some(_) => gpu.wait(),
            None => Ok(()),
        }
    }

    /// Returns `known`, which [`SceneWords::free_unless_same`] has left, or the words of the scene.
    ///
    /// # Errors
    ///
    /// Fails if the device has too little memory, or once `progress` is cancelled.
    pub fn update<'a>(
        known: &'a mut Option<Self>,
        gpu: &Gpu,
        scene: &FlatScene,
        progress: &dyn Progress,
    ) -> surfel_core::Result<&'a Self> {
        let words = match known.take() {
            Some(words) => words,
            None => Self::new(gpu, scene, progress)?,
        };
        Ok(known.insert(words))
    }

    fn new(gpu: &Gpu, scene: &FlatScene, progress: &dyn Progress) -> surfel_core::Result<Self> {
        let mut words = Vec::new();
        let offsets = append_words(scene, &mut words, progress)?;
        let buffer = array(gpu, "textures", 4 * words.len())?;
        write(gpu, &buffer, bytemuck::cast_slice(&words), progress)?;
        Ok(Self { source: Source::new(scene), buffer, offsets })
    }
}
