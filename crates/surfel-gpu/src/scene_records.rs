//! The records of a scene that shading reads: materials, instances, lights, and the picture.

use crate::constants::N_SUPPORT_COLORS;
use crate::mesh_blocks::attributes;
use crate::numbers::alpha_mode;
use crate::numbers::background;
use crate::numbers::lens;
use crate::numbers::light_kind;
use crate::numbers::path_state;
use crate::numbers::texture;
use crate::numbers::{MAX_PLANES, NO_LIMIT, NONE};
use crate::records::{FrameRecord, InstanceRecord, LightRecord, MaterialRecord, TextureRecord};
use bytemuck::Zeroable;
use surfel_core::flat::{FlatGeometry, FlatPunctualLight, FlatScene, Instance};
use surfel_core::math::Vec3;
use surfel_core::progress::Progress;
use surfel_core::render::Settings;
use surfel_core::scene::{
    AlphaMode, Background, Environment, Lens, Light, Material, PunctualLightKind, Sky, Sun,
    TextureRef, View, Wrap,
};

/// The first words of the textures, environment maps and colours by support of a scene in one array.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WordOffsets {
    /// Offset of each texture.
    pub textures: Vec<u32>,
    /// Offset of each environment map among the lights.
    pub environments: Vec<u32>,
    /// Offset of the colours by support of each geometry that has them.
    pub support_colors: Vec<Option<u32>>,
}

/// The records of a scene, each at least one.
#[derive(Debug)]
pub struct SceneRecords {
    /// Materials.
    pub materials: Vec<MaterialRecord>,
    /// Instances.
    pub instances: Vec<InstanceRecord>,
    /// Lights of the scene, then lamps.
    pub lights: Vec<LightRecord>,
}

impl SceneRecords {
    /// Returns the records of nothing.
    pub fn empty() -> Self {
        Self {
            materials: at_least_one(Vec::new()),
            instances: at_least_one(Vec::new()),
            lights: at_least_one(Vec::new()),
        }
    }

    /// Returns the records of a scene whose words are at these offsets.
    pub fn new(scene: &FlatScene, offsets: &WordOffsets) -> Self {
        let materials =
            scene.materials.iter().map(|material| material_record(scene, material, offsets));
        let instances =
            scene.instances.iter().map(|instance| instance_record(scene, instance, offsets));
        Self {
            materials: at_least_one(materials.collect()),
            instances: at_least_one(instances.collect()),
            lights: at_least_one(lights(scene, offsets)),
        }
    }
}

fn at_least_one<T: Zeroable>(mut records: Vec<T>) -> Vec<T> {
    records.resize_with(records.len().max(1), Zeroable::zeroed);
    records
}

fn lights(scene: &FlatScene, offsets: &WordOffsets) -> Vec<LightRecord> {
    let mut environments = offsets.environments.iter();
    let lights = scene.lights.iter().map(|light| match light {
        Light::Environment(environment) => {
            environment_record(environment, environments.next().copied().unwrap_or_default())
        }
        Light::Sun(sun) => sun_record(sun),
        Light::Sky(sky) => sky_record(sky),
        Light::Headlight(strength) => headlight_record(*strength),
    });
    let lamps = scene.punctual_lights.iter().enumerate();
    lights.chain(lamps.map(|(i, lamp)| lamp_record(i as u32, lamp))).collect()
}

fn sun_record(sun: &Sun) -> LightRecord {
    let is_point = sun.angular_diameter_deg <= 0.0;
    LightRecord {
        direction: sun.direction.to_array(),
        kind: if is_point { light_kind::POINT_SUN } else { light_kind::SUN },
        color: sun.color.to_array(),
        cos_max: (sun.angular_diameter_deg.to_radians() / 2.0).cos(),
        lamp: NONE,
        ..Zeroable::zeroed()
    }
}

fn sky_record(sky: &Sky) -> LightRecord {
    LightRecord {
        direction: sky.up.to_array(),
        kind: light_kind::SKY,
        color: sky.zenith.to_array(),
        ground: sky.ground.to_array(),
        lamp: NONE,
        ao_distance: sky.ao_distance.min(NO_LIMIT),
        ..Zeroable::zeroed()
    }
}

fn headlight_record(strength: f32) -> LightRecord {
    LightRecord {
        kind: light_kind::HEADLIGHT,
        color: [strength; 3],
        lamp: NONE,
        ..Zeroable::zeroed()
    }
}

fn environment_record(environment: &Environment, first_word: u32) -> LightRecord {
    let arrays = environment.arrays();
    let [right, middle, up] = arrays.axes.map(|axis| axis.to_array());
    LightRecord {
        direction: right,
        kind: light_kind::ENVIRONMENT,
        color: middle,
        ground: up,
        lamp: NONE,
        size: arrays.size.map(|size| size as u32),
        first_word,
        strength: arrays.strength,
        ..Zeroable::zeroed()
    }
}

/// Returns the record of a lamp. A directional one is a sun without extent.
fn lamp_record(lamp_idx: u32, lamp: &FlatPunctualLight) -> LightRecord {
    let (kind, cosines) = match lamp.kind {
        PunctualLightKind::Directional => (light_kind::POINT_SUN, (0.0, 0.0)),
        PunctualLightKind::Point => (light_kind::POINT, (0.0, 0.0)),
        PunctualLightKind::Spot { inner_rad, outer_rad } => {
            (light_kind::SPOT, (inner_rad.cos(), outer_rad.cos()))
        }
    };
    let is_directional = lamp.kind == PunctualLightKind::Directional;
    let direction = if is_directional { -lamp.direction } else { lamp.direction };
    LightRecord {
        direction: direction.to_array(),
        kind,
        color: lamp.color.to_array(),
        lamp: lamp_idx,
        range: lamp.range.min(NO_LIMIT),
        position: lamp.position.to_array(),
        radius: lamp.radius,
        inner_cos: cosines.0,
        outer_cos: cosines.1,
        ..Zeroable::zeroed()
    }
}

fn instance_record(
    scene: &FlatScene,
    instance: &Instance,
    offsets: &WordOffsets,
) -> InstanceRecord {
    let geometry_idx = instance.geometry_idx as usize;
    let none = InstanceRecord {
        lower: instance.bounds.min.to_array(),
        material: instance.material_idx,
        upper: instance.bounds.max.to_array(),
        max_scale: instance.max_scale,
        first_support_color: NONE,
        spawn_factor: 1.0,
        ..Zeroable::zeroed()
    };
    match scene.geometry(instance) {
        FlatGeometry::Mesh(mesh) => {
            InstanceRecord { has_outward_normals: 1, attributes: attributes(mesh), ..none }
        }
        FlatGeometry::Cloud(cloud) => {
            let offset = offsets.support_colors.get(geometry_idx).copied().flatten();
            let range = cloud.support_colors.as_ref().map(|colors| &colors.range);
            InstanceRecord {
                has_outward_normals: cloud.has_outward_normals.into(),
                first_support_color: offset.unwrap_or(NONE),
                spawn_factor: cloud.options.spawn_factor(cloud.surface),
                support_low: range.map_or(0.0, |range| range.low as f32),
                support_high: range.map_or(0.0, |range| range.high as f32),
                ..none
            }
        }
    }
}

/// Returns the number of words of the texels, environment maps and colours by support of a scene.
pub fn n_words(scene: &FlatScene) -> usize {
    let textures = scene.textures.iter().map(|texture| texture.texels.len());
    let environments = scene.lights.iter().filter_map(|light| match light {
        Light::Environment(environment) => {
            let arrays = environment.arrays();
            Some(size_of_val(arrays.pixels) / 4 + arrays.row_cdf.len() + arrays.column_cdf.len())
        }
        _ => None,
    });
    let colors = scene.clouds().filter(|cloud| cloud.support_colors.is_some());
    let colors = colors.map(|_| N_SUPPORT_COLORS as usize);
    textures.chain(environments).chain(colors).sum()
}

/// Appends the texels, environment maps and colours by support of a scene; returns where each begins.
///
/// # Errors
///
/// Fails once `progress` is cancelled.
pub fn append_words(
    scene: &FlatScene,
    words: &mut Vec<u32>,
    progress: &dyn Progress,
) -> surfel_core::Result<WordOffsets> {
    let mut offsets = WordOffsets::default();
    for texture in &scene.textures {
        progress.check()?;
        offsets.textures.push(words.len() as u32);
        words.extend(texture.texels.iter().map(|texel| u32::from_le_bytes(*texel)));
    }
    for light in &scene.lights {
        let Light::Environment(environment) = light else { continue };
        progress.check()?;
        let arrays = environment.arrays();
        offsets.environments.push(words.len() as u32);
        words.extend(arrays.pixels.iter().flat_map(|pixel| pixel.to_array().map(f32::to_bits)));
        words.extend_from_slice(arrays.row_cdf);
        words.extend_from_slice(arrays.column_cdf);
    }
    for geometry in &scene.geometries {
        let FlatGeometry::Cloud(cloud) = &**geometry else {
            offsets.support_colors.push(None);
            continue;
        };
        offsets.support_colors.push(cloud.support_colors.as_ref().map(|colors| {
            let first = words.len() as u32;
            words.extend((0..N_SUPPORT_COLORS).map(|i| {
                let position = i as f32 / (N_SUPPORT_COLORS - 1) as f32;
                let [red, green, blue] = colors.colormap.color(position);
                u32::from_le_bytes([red, green, blue, 0])
            }));
            first
        }));
    }
    debug_assert_eq!(words.len(), n_words(scene));
    words.resize(words.len().max(1), 0);
    Ok(offsets)
}

fn material_record(
    scene: &FlatScene,
    material: &Material,
    offsets: &WordOffsets,
) -> MaterialRecord {
    let (alpha_mode, alpha_cutoff) = match material.alpha_mode {
        AlphaMode::Opaque => (alpha_mode::OPAQUE, 0.0),
        AlphaMode::Mask(cutoff) => (alpha_mode::MASK, cutoff),
        AlphaMode::Blend => (alpha_mode::BLEND, 0.0),
    };
    let mut textures = [TextureRecord::zeroed(); texture::N_TEXTURES];
    let of_material = &material.textures;
    let normal = of_material.normal.as_ref().map(|(texture, _)| texture);
    for (number, reference) in [
        (texture::BASE_COLOR, of_material.base_color.as_ref()),
        (texture::ROUGHNESS, of_material.metallic_roughness.as_ref()),
        (texture::NORMAL, normal),
        (texture::EMISSIVE, of_material.emissive.as_ref()),
        (texture::TRANSMISSION, of_material.transmission.as_ref()),
    ] {
        if let Some(reference) = reference {
            textures[number as usize] = texture_record(scene, reference, offsets);
        }
    }
    MaterialRecord {
        base_color: material.base_color.to_array(),
        ignores_vertex_colors: material.ignores_vertex_colors.into(),
        emissive: material.emissive.to_array(),
        emissive_strength: material.emissive_strength,
        attenuation_color: material.attenuation_color.to_array(),
        attenuation_distance: material.attenuation_distance.min(NO_LIMIT),
        is_unlit: material.is_unlit.into(),
        alpha: material.alpha,
        alpha_mode,
        alpha_cutoff,
        metallic: material.metallic,
        roughness: material.roughness,
        ior: material.ior,
        transmission: material.transmission,
        is_thin: material.is_thin.into(),
        normal_scale: of_material.normal.as_ref().map_or(1.0, |(_, scale)| *scale),
        textures,
        ..Zeroable::zeroed()
    }
}

fn texture_record(
    scene: &FlatScene,
    reference: &TextureRef,
    offsets: &WordOffsets,
) -> TextureRecord {
    let of_scene = &scene.textures[reference.texture];
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::MirroredRepeat => texture::WRAP_MIRRORED,
        Wrap::ClampToEdge => texture::WRAP_CLAMP,
    };
    let is_nearest = if reference.is_nearest { texture::IS_NEAREST } else { 0 };
    let is_second = if reference.uv_set == 1 { texture::SECOND_UV_SET } else { 0 };
    let [across, down] = reference.wrap.map(wrap);
    let wraps = across << texture::WRAP_X | down << texture::WRAP_Y;
    let (sin, cos) = reference.rotation_rad.sin_cos();
    TextureRecord {
        first_word: offsets.textures[reference.texture],
        width: of_scene.width,
        height: of_scene.height,
        flags: texture::IS_PRESENT | is_nearest | is_second | wraps,
        offset: reference.offset.into(),
        scale: reference.scale.into(),
        cos,
        sin,
        ..Zeroable::zeroed()
    }
}

/// Returns the record of a picture, for no rays.
pub fn frame(scene: &FlatScene, view: &View, settings: &Settings) -> FrameRecord {
    let (lens, pixel_width, pixel_height) = match view.lens {
        Lens::Perspective { pixel_size } => (lens::PERSPECTIVE, pixel_size, pixel_size),
        Lens::Orthographic { pixel_size } => (lens::ORTHOGRAPHIC, pixel_size, pixel_size),
        Lens::Panorama { pixel_rad } => (lens::PANORAMA, pixel_rad.0, pixel_rad.1),
    };
    let is_parallel = matches!(view.lens, Lens::Orthographic { .. });
    let mut planes = [[0.0; 4]; MAX_PLANES];
    for (record, plane) in planes.iter_mut().zip(&scene.camera_planes) {
        let normal = plane.normal.as_vec3();
        let distance = normal.dot((plane.point - scene.origin).as_vec3());
        *record = normal.extend(distance).to_array();
    }
    let (background, top, bottom) = match scene.background {
        Background::Transparent => (background::TRANSPARENT, Vec3::ZERO, Vec3::ZERO),
        Background::Environment => (background::ENVIRONMENT, Vec3::ZERO, Vec3::ZERO),
        Background::Gradient { top, bottom } => (background::GRADIENT, top, bottom),
    };
    FrameRecord {
        position: view.position.to_array(),
        lens,
        forward: view.forward.to_array(),
        pixel_width,
        right: view.right.to_array(),
        pixel_height,
        up: view.up.to_array(),
        n_planes: scene.camera_planes.len() as u32,
        center: view.center.into(),
        seed: [settings.seed as u32, (settings.seed >> 32) as u32],
        is_centered: (settings.samples_per_pixel == 1).into(),
        background_top: top.to_array(),
        background,
        background_bottom: bottom.to_array(),
        height: settings.height,
        background_up: scene.camera.view_up.as_vec3().normalize_or(Vec3::Z).to_array(),
        n_lights: (scene.lights.len() + scene.punctual_lights.len()) as u32,
        max_depth: settings.max_depth.min(path_state::MAX_COUNT),
        n_light_samples: n_light_samples(settings),
        pixel_at_origin: if is_parallel { view.pixel_size() } else { 0.0 },
        pixel_per_distance: if is_parallel { 0.0 } else { view.pixel_size() },
        planes,
        ..Zeroable::zeroed()
    }
}

/// Returns the number of rays toward each extended light from a hit of a camera ray.
pub fn n_light_samples(settings: &Settings) -> u32 {
    settings.light_samples.div_ceil(settings.samples_per_pixel)
}

#[cfg(test)]
mod tests {
    //! Settings keep the limits of the kernels.

    use super::*;
    use crate::test_support::empty_scene;

    #[test]
    fn more_bounces_than_a_path_counts_do_not_begin_anew() {
        let scene = empty_scene();
        let settings = Settings { max_depth: 256, ..Settings::default() };
        let view = scene.camera.view(scene.origin, settings.width, settings.height);
        assert_eq!(frame(&scene, &view, &settings).max_depth, 255);
    }
}
