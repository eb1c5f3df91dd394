//! The passes that render a sample of each pixel, and the records that they read.

use crate::mesh_blocks::{attributes, block_vectors};
use crate::records::lens;
use crate::records::light_kind;
use crate::records::{
    FrameRecord, LightSample, MAX_PLANES, MaterialRecord, NO_LIMIT, TRIANGLE, Visit, surface_number,
};
use crate::shader::{Kernel, Surface};
use crate::unsupported::trees;
use crate::wavefront::RECORD_STRIDE;
use surfel_core::flat::{
    FlatCloud, FlatGeometry, FlatMesh, FlatPunctualLight, FlatScene, Instance,
};
use surfel_core::math::{Affine3A, Mat3, Vec3, Vec3A};
use surfel_core::render::Settings;
use surfel_core::scene::{Background, Lens, Light, Material, PunctualLightKind, Sky, View};
use surfel_core::surface::{EdgeTest, SurfaceKind};

/// A tree that rays are traced against, as an instance shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TreeRef {
    /// Index of the geometry.
    pub geometry_idx: usize,
    /// Index of the tree among those of the geometry.
    pub tree_idx: usize,
}

/// One pass over all rays.
#[derive(Clone, Copy, Debug)]
pub struct Pass {
    /// The kernel.
    pub kernel: Kernel,
    /// The tree that the kernel reads.
    pub tree: Option<TreeRef>,
    /// Offset of the record of the instance or light.
    pub record_offset: u32,
}

/// The passes of one sample, and the records of instances and lights that they read.
#[derive(Debug, Default)]
pub struct Passes {
    /// The passes in their order.
    pub passes: Vec<Pass>,
    /// The passes that find the hits of the rays through the centres of pixels, if the picture has AOVs.
    pub aov_passes: Vec<Pass>,
    /// The records, at multiples of `RECORD_STRIDE`.
    pub records: Vec<u8>,
}

impl Passes {
    /// Returns the passes that render one sample of each pixel.
    pub fn new(scene: &FlatScene, settings: &Settings) -> Self {
        let mut passes = Self::default();
        let visits = passes.add_visits(scene);
        passes.add(Kernel::Generate, None, 0);
        for (tree, surface, record) in &visits {
            passes.add(Kernel::Closest(*surface), Some(*tree), *record);
        }
        passes.add(Kernel::Shade, None, 0);
        passes.add_background(scene);
        let lights = scene.lights.iter().map(|light| light_samples(light, settings));
        let lamps = scene.punctual_lights.iter().enumerate();
        let lamps = lamps.map(|(i, lamp)| lamp_samples(i as u32, lamp, settings));
        for samples in lights.chain(lamps) {
            for sample in &samples {
                let record = passes.add_record(bytemuck::bytes_of(sample));
                passes.add(Kernel::SampleLight, None, record);
                if sample.kind == light_kind::HEADLIGHT {
                    continue;
                }
                for (tree, surface, record) in &visits {
                    passes.add(Kernel::Any(*surface), Some(*tree), *record);
                }
                passes.add(Kernel::AddLight, None, record);
            }
        }
        passes.add(Kernel::Accumulate, None, 0);
        passes.add_aov_passes(&visits, settings);
        passes.records.resize(passes.records.len().max(RECORD_STRIDE as usize), 0);
        passes
    }

    fn add(&mut self, kernel: Kernel, tree: Option<TreeRef>, record_offset: u32) {
        self.passes.push(Pass { kernel, tree, record_offset });
    }

    /// Adds the passes that show the sky, black without one, where it is the background.
    fn add_background(&mut self, scene: &FlatScene) {
        if scene.background != Background::Environment {
            return;
        }
        let black = LightSample { kind: light_kind::SKY, ..bytemuck::Zeroable::zeroed() };
        let skies = scene.lights.iter().filter_map(|light| match light {
            Light::Sky(sky) => Some(sky_record(sky)),
            _ => None,
        });
        for sample in skies.chain([black]) {
            let record = self.add_record(bytemuck::bytes_of(&sample));
            self.add(Kernel::ShadeMiss, None, record);
        }
    }

    /// Adds the passes for AOVs. The only sample of a pixel goes through its centre and has left its hits.
    fn add_aov_passes(&mut self, visits: &[(TreeRef, Surface, u32)], settings: &Settings) {
        if !settings.with_aovs {
            return;
        }
        let pass = |kernel, (tree, _, record_offset): &(TreeRef, Surface, u32)| Pass {
            kernel,
            tree: Some(*tree),
            record_offset: *record_offset,
        };
        if 1 < settings.samples_per_pixel {
            let generate = Pass { kernel: Kernel::Generate, tree: None, record_offset: 0 };
            self.aov_passes.push(generate);
            let closest = visits.iter().map(|visit| pass(Kernel::Closest(visit.1), visit));
            self.aov_passes.extend(closest);
        }
        let visits = visits.iter().filter(|(_, surface, _)| *surface != Surface::Triangle);
        self.aov_passes.extend(visits.map(|visit| pass(Kernel::Support(visit.1), visit)));
    }

    /// Adds the records of all instances of trees, in the order of the instances.
    fn add_visits(&mut self, scene: &FlatScene) -> Vec<(TreeRef, Surface, u32)> {
        let mut visits = Vec::new();
        for (instance_idx, instance) in scene.instances.iter().enumerate() {
            let cloud = match scene.geometry(instance) {
                FlatGeometry::Cloud(cloud) => cloud,
                FlatGeometry::Mesh(mesh) => {
                    let visit = mesh_visit(instance_idx as u32, instance, mesh);
                    let record = self.add_record(bytemuck::bytes_of(&visit));
                    let geometry_idx = instance.geometry_idx as usize;
                    let tree = TreeRef { geometry_idx, tree_idx: 0 };
                    visits.push((tree, Surface::Triangle, record));
                    continue;
                }
            };
            for (tree_idx, (kind, points)) in trees(cloud).into_iter().enumerate() {
                let Some(surface) = Surface::of_kind(kind) else { continue };
                if points.nodes.is_empty() {
                    continue;
                }
                let visit = visit(instance_idx as u32, instance, cloud, kind);
                let record = self.add_record(bytemuck::bytes_of(&visit));
                let geometry_idx = instance.geometry_idx as usize;
                visits.push((TreeRef { geometry_idx, tree_idx }, surface, record));
            }
        }
        visits
    }

    fn add_record(&mut self, record: &[u8]) -> u32 {
        let offset = self.records.len();
        self.records.extend_from_slice(record);
        self.records.resize(offset + RECORD_STRIDE as usize, 0);
        offset as u32
    }
}

fn visit(instance_idx: u32, instance: &Instance, cloud: &FlatCloud, kind: SurfaceKind) -> Visit {
    let is_surface = kind == cloud.surface;
    Visit {
        surface: surface_number(kind),
        max_blend_distance: if is_surface { cloud.max_blend_distance } else { 0.0 },
        edge_retest_factor: cloud.edge_retest_factor,
        has_edge_test: (cloud.edge_test == EdgeTest::AngularGap).into(),
        has_front_sides: cloud.has_front_sides.into(),
        blends_colors: cloud.blends_colors.into(),
        ..placement(instance_idx, instance)
    }
}

fn mesh_visit(instance_idx: u32, instance: &Instance, mesh: &FlatMesh) -> Visit {
    Visit {
        surface: TRIANGLE,
        block_vectors: block_vectors(mesh),
        attributes: attributes(mesh),
        ..placement(instance_idx, instance)
    }
}

fn placement(instance_idx: u32, instance: &Instance) -> Visit {
    Visit {
        object_from_world: affine_columns(&instance.object_from_world),
        world_from_normal: matrix_columns(&instance.world_from_normal),
        instance: instance_idx,
        material: instance.material_idx,
        is_identity: instance.is_identity.into(),
        max_scale: instance.max_scale,
        ..bytemuck::Zeroable::zeroed()
    }
}

fn affine_columns(transform: &Affine3A) -> [[f32; 4]; 4] {
    let Affine3A { matrix3, translation } = transform;
    let column = |axis: Vec3A| Vec3::from(axis).extend(0.0).to_array();
    [column(matrix3.x_axis), column(matrix3.y_axis), column(matrix3.z_axis), column(*translation)]
}

fn matrix_columns(matrix: &Mat3) -> [[f32; 4]; 3] {
    [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| axis.extend(0.0).to_array())
}

/// Returns the records of the samples of a light at each hit.
fn light_samples(light: &Light, settings: &Settings) -> Vec<LightSample> {
    let n_light_samples = n_light_samples(settings);
    let none = LightSample { n_samples: 1, ..bytemuck::Zeroable::zeroed() };
    let sample = match light {
        Light::Sun(sun) => {
            let is_point = sun.angular_diameter_deg <= 0.0;
            LightSample {
                direction: sun.direction.to_array(),
                kind: if is_point { light_kind::POINT_SUN } else { light_kind::SUN },
                color: sun.color.to_array(),
                cos_max: (sun.angular_diameter_deg.to_radians() / 2.0).cos(),
                n_samples: if is_point { 1 } else { n_light_samples },
                ..none
            }
        }
        Light::Sky(sky) => LightSample { n_samples: n_light_samples, ..sky_record(sky) },
        Light::Headlight(strength) => {
            LightSample { kind: light_kind::HEADLIGHT, color: [*strength; 3], ..none }
        }
        Light::Environment(_) => return Vec::new(),
    };
    repeated(sample)
}

fn n_light_samples(settings: &Settings) -> u32 {
    settings.light_samples.div_ceil(settings.samples_per_pixel)
}

fn repeated(sample: LightSample) -> Vec<LightSample> {
    (0..sample.n_samples).map(|sample_idx| LightSample { sample_idx, ..sample }).collect()
}

/// Returns the records of the samples of a lamp at each hit. A directional one is a sun without extent.
fn lamp_samples(lamp_idx: u32, lamp: &FlatPunctualLight, settings: &Settings) -> Vec<LightSample> {
    let is_directional = lamp.kind == PunctualLightKind::Directional;
    let is_point = lamp.radius <= 0.0 || is_directional;
    let (kind, cosines) = match lamp.kind {
        PunctualLightKind::Directional => (light_kind::POINT_SUN, (0.0, 0.0)),
        PunctualLightKind::Point => (light_kind::POINT, (0.0, 0.0)),
        PunctualLightKind::Spot { inner_rad, outer_rad } => {
            (light_kind::SPOT, (inner_rad.cos(), outer_rad.cos()))
        }
    };
    let direction = if is_directional { -lamp.direction } else { lamp.direction };
    repeated(LightSample {
        direction: direction.to_array(),
        kind,
        color: lamp.color.to_array(),
        n_samples: if is_point { 1 } else { n_light_samples(settings) },
        light: lamp_idx,
        range: lamp.range.min(NO_LIMIT),
        position: lamp.position.to_array(),
        radius: lamp.radius,
        inner_cos: cosines.0,
        outer_cos: cosines.1,
        ..bytemuck::Zeroable::zeroed()
    })
}

fn sky_record(sky: &Sky) -> LightSample {
    LightSample {
        direction: sky.up.to_array(),
        kind: light_kind::SKY,
        color: sky.zenith.to_array(),
        ground: sky.ground.to_array(),
        ao_distance: sky.ao_distance.min(NO_LIMIT),
        ..bytemuck::Zeroable::zeroed()
    }
}

/// Returns the record of a picture from its first pixel and sample on, for no rays.
pub fn frame(scene: &FlatScene, view: &View, settings: &Settings) -> FrameRecord {
    let (lens, pixel_width, pixel_height) = match view.lens {
        Lens::Perspective { pixel_size } => (lens::PERSPECTIVE, pixel_size, pixel_size),
        Lens::Orthographic { pixel_size } => (lens::ORTHOGRAPHIC, pixel_size, pixel_size),
        Lens::Panorama { pixel_rad } => (lens::PANORAMA, pixel_rad.0, pixel_rad.1),
    };
    let mut planes = [[0.0; 4]; MAX_PLANES];
    for (record, plane) in planes.iter_mut().zip(&scene.camera_planes) {
        let normal = plane.normal.as_vec3();
        let distance = normal.dot((plane.point - scene.origin).as_vec3());
        *record = normal.extend(distance).to_array();
    }
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
        width: settings.width,
        samples_per_pixel: settings.samples_per_pixel,
        is_centered: (settings.samples_per_pixel == 1).into(),
        planes,
        ..bytemuck::Zeroable::zeroed()
    }
}

/// Returns the records of a scene's materials, at least one.
pub fn materials(scene: &FlatScene) -> Vec<MaterialRecord> {
    let mut materials: Vec<_> = scene.materials.iter().map(material).collect();
    materials.resize_with(materials.len().max(1), bytemuck::Zeroable::zeroed);
    materials
}

fn material(material: &Material) -> MaterialRecord {
    MaterialRecord {
        base_color: material.base_color.to_array(),
        ignores_vertex_colors: material.ignores_vertex_colors.into(),
        emissive: material.emissive.to_array(),
        emissive_strength: material.emissive_strength,
        is_unlit: material.is_unlit.into(),
        reserved_a: 0,
        reserved_b: 0,
        reserved_c: 0,
    }
}
