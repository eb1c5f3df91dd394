//! The kernels' source text: the files of each kernel, after the constants that Rust writes.

use crate::records::lens;
use crate::records::light_kind;
use crate::records::ray_kind;
use crate::records::{MAX_PLANES, TRIANGLE, surface_number};
use std::fmt::Write;
use surfel_core::bvh::MAX_DEPTH;
use surfel_core::integrator::constants as integrator;
use surfel_core::surface::align;
use surfel_core::surface::capsule;
use surfel_core::surface::disc;
use surfel_core::surface::edge_test;
use surfel_core::surface::smooth;
use surfel_core::surface::{
    FIT_REACH, MAX_GATHERED, NEIGHBORHOOD_RADIUS_FACTOR, SOLID_SPAWN_OFFSET, SUPPORT_FACTOR,
    SurfaceKind,
};
use surfel_core::trace::constants as trace;

/// Number of invocations of a workgroup.
pub const WORKGROUP_SIZE: u32 = 64;

/// A kernel: one pass over all rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kernel {
    /// Makes the camera rays.
    Generate,
    /// Finds the nearest hit on a tree whose points have this surface.
    Closest(Surface),
    /// Finds the points behind the hits on a tree.
    Support(Surface),
    /// Adds the light that surfaces emit.
    Shade,
    /// Adds the light of a sky that camera rays see.
    ShadeMiss,
    /// Makes rays toward a light.
    SampleLight,
    /// Finds out which rays toward a light a tree blocks.
    Any(Surface),
    /// Adds the light of the rays that nothing blocks.
    AddLight,
    /// Adds a sample to the sum over samples.
    Accumulate,
}

/// A surface that kernels trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Surface {
    /// Spheres.
    Sphere,
    /// Capsules.
    Capsule,
    /// Flat discs.
    Disc,
    /// Blended discs.
    Splat,
    /// The smooth surface.
    Smooth,
    /// Triangles.
    Triangle,
}

impl Surface {
    /// Every surface.
    pub const ALL: [Self; 6] =
        [Self::Sphere, Self::Capsule, Self::Disc, Self::Splat, Self::Smooth, Self::Triangle];

    /// Returns the surface by which a kind is traced, or none if no kernel traces it.
    pub fn of_kind(kind: SurfaceKind) -> Option<Self> {
        match kind {
            SurfaceKind::Sphere => Some(Self::Sphere),
            SurfaceKind::Capsule => Some(Self::Capsule),
            SurfaceKind::Disc => Some(Self::Disc),
            SurfaceKind::Splat | SurfaceKind::SplatMean => Some(Self::Splat),
            SurfaceKind::Smooth => Some(Self::Smooth),
            SurfaceKind::Points | SurfaceKind::SplatFit => None,
            // Their trees are traversed on the CPU alone.
            SurfaceKind::Implicit | SurfaceKind::Octree | SurfaceKind::OctreeSplat => None,
            SurfaceKind::Cylinder | SurfaceKind::Mls => None,
        }
    }

    /// Returns the kind of the shapes in the blocks.
    fn shape(self) -> SurfaceKind {
        match self {
            Self::Sphere => SurfaceKind::Sphere,
            Self::Capsule => SurfaceKind::Capsule,
            _ => SurfaceKind::Disc,
        }
    }
}

macro_rules! parts {
    ($($path:literal),* $(,)?) => {
        &[$(include_str!(concat!("shader/", $path))),*]
    };
}

const COMMON: &[&str] = parts!["math/ray.wgsl", "records.wgsl"];
const SAMPLING: &[&str] = parts!["math/random.wgsl", "math/sampling.wgsl", "render/key.wgsl"];
const GENERATE: &[&str] = parts!["scene/camera.wgsl", "render/generate.wgsl"];
const SHADING: &[&str] = parts!["integrator/shading.wgsl"];
const SHADE: &[&str] = parts!["integrator/whitted.wgsl"];
const DIRECT: &[&str] = parts!["math/basis.wgsl", "scene/light.wgsl", "integrator/direct.wgsl"];
const TREE: &[&str] = parts![
    "bvh/node.wgsl",
    "flat/block.wgsl",
    "surface/disc.wgsl",
    "surface/sphere.wgsl",
    "surface/capsule.wgsl",
    "surface/kind.wgsl",
    "trace/visit.wgsl",
];
const TRAVERSE: &[&str] = parts!["trace/traverse.wgsl"];
const REGION: &[&str] = parts!["trace/region.wgsl"];
const SUPPORT: &[&str] = parts!["trace/support_kernel.wgsl"];
const CLOSEST: &[&str] = parts!["trace/query/closest.wgsl"];
const CLOSEST_KERNEL: &[&str] = parts!["trace/closest_kernel.wgsl"];
const ANY: &[&str] = parts!["trace/query/any.wgsl"];
const ANY_KERNEL: &[&str] = parts!["trace/any_kernel.wgsl"];
const TRIANGLES: &[&str] = parts![
    "math/basis.wgsl",
    "surface/triangle.wgsl",
    "flat/triangles.wgsl",
    "trace/query/triangles.wgsl",
];
const EDGE: &[&str] =
    parts!["math/basis.wgsl", "surface/edge_test.wgsl", "trace/query/edge_test.wgsl",];
const SOLIDS: &[&str] = parts!["trace/query/solids.wgsl"];
const ACCEPT_ALL: &[&str] = parts!["trace/query/accept_all.wgsl"];
const DISCS: &[&str] = parts!["trace/query/disc_query.wgsl", "trace/query/surface.wgsl"];
const SPLATS: &[&str] = parts![
    "surface/splat.wgsl",
    "trace/query/gather.wgsl",
    "trace/query/splat_query.wgsl",
    "trace/query/surface.wgsl",
];
const EDGE_FILTER: &[&str] = parts!["trace/query/edge_filter.wgsl"];
const SMOOTH: &[&str] = parts!["surface/smooth.wgsl", "trace/query/smooth_query.wgsl"];
const SMOOTH_SURFACE: &[&str] = parts!["trace/query/smooth_surface.wgsl"];
const SMOOTH_FILTER: &[&str] = parts!["trace/query/smooth_filter.wgsl"];

impl Kernel {
    /// Returns every kernel.
    pub fn all() -> Vec<Self> {
        let mut all = vec![
            Self::Generate,
            Self::Shade,
            Self::ShadeMiss,
            Self::SampleLight,
            Self::AddLight,
            Self::Accumulate,
        ];
        all.extend(Surface::ALL.map(Self::Closest));
        all.extend(Surface::ALL.map(Self::Any));
        let of_points = Surface::ALL.into_iter().filter(|surface| *surface != Surface::Triangle);
        all.extend(of_points.map(Self::Support));
        all
    }

    /// Returns the name of the kernel's entry point.
    pub fn entry_point(self) -> &'static str {
        match self {
            Self::Generate => "generate",
            Self::Closest(_) => "closest",
            Self::Shade => "shade",
            Self::ShadeMiss => "shade_miss",
            Self::SampleLight => "sample_light",
            Self::Any(_) => "any",
            Self::Support(_) => "support",
            Self::AddLight => "add_light",
            Self::Accumulate => "accumulate",
        }
    }

    /// Returns true if the kernel reads a tree.
    pub fn reads_tree(self) -> bool {
        matches!(self, Self::Closest(_) | Self::Any(_) | Self::Support(_))
    }

    /// Returns the kernel's source text.
    pub fn source(self) -> String {
        let mut source = constants();
        if let Self::Closest(surface) | Self::Any(surface) | Self::Support(surface) = self {
            let has_colors = matches!(self, Self::Closest(_));
            _ = writeln!(source, "const SHAPE: u32 = {}u;", surface_number(surface.shape()));
            _ = writeln!(source, "const HAS_COLORS: bool = {has_colors};");
        }
        self.parts().iter().copied().flatten().for_each(|part| source.push_str(part));
        source
    }

    fn parts(self) -> Vec<&'static [&'static str]> {
        match self {
            Self::Generate | Self::Accumulate => vec![COMMON, SAMPLING, GENERATE],
            Self::Shade => vec![COMMON, SHADING, SHADE],
            Self::ShadeMiss | Self::SampleLight | Self::AddLight => {
                vec![COMMON, SAMPLING, SHADING, DIRECT]
            }
            Self::Closest(surface) => {
                let mut parts = vec![COMMON, TREE, TRAVERSE, CLOSEST_KERNEL];
                parts.extend_from_slice(match surface {
                    Surface::Sphere | Surface::Capsule => &[CLOSEST, SOLIDS],
                    Surface::Disc => &[CLOSEST, REGION, EDGE, DISCS],
                    Surface::Splat => &[REGION, EDGE, SPLATS],
                    Surface::Triangle => &[TRIANGLES],
                    Surface::Smooth => &[CLOSEST, REGION, EDGE, SMOOTH, SMOOTH_SURFACE],
                });
                parts
            }
            Self::Support(_) => vec![COMMON, TREE, REGION, SUPPORT],
            Self::Any(surface) => {
                let mut parts = vec![COMMON, TREE, TRAVERSE, ANY_KERNEL];
                parts.extend_from_slice(match surface {
                    Surface::Sphere | Surface::Capsule => &[ANY, ACCEPT_ALL],
                    Surface::Triangle => &[TRIANGLES],
                    Surface::Disc | Surface::Splat => &[ANY, REGION, EDGE, EDGE_FILTER],
                    Surface::Smooth => &[ANY, REGION, EDGE, SMOOTH, SMOOTH_FILTER],
                });
                parts
            }
        }
    }
}

/// Returns the declarations of the constants that the kernels share with Rust.
fn constants() -> String {
    let kinds = [
        ("SPHERE", SurfaceKind::Sphere),
        ("DISC", SurfaceKind::Disc),
        ("SPLAT", SurfaceKind::Splat),
        ("SMOOTH", SurfaceKind::Smooth),
        ("CAPSULE", SurfaceKind::Capsule),
    ];
    let kinds = kinds.map(|(name, kind)| (name, surface_number(kind)));
    let integers = [
        ("WORKGROUP_SIZE", WORKGROUP_SIZE),
        ("MAX_PLANES", MAX_PLANES as u32),
        ("MAX_DEPTH", MAX_DEPTH as u32),
        ("MAX_GATHERED", MAX_GATHERED as u32),
        ("MAX_REJECTED_HITS", trace::MAX_REJECTED_HITS as u32),
        ("MAX_FITS", trace::MAX_FITS as u32),
        ("MIN_DENSE", edge_test::MIN_DENSE),
        ("MIN_NEIGHBORS", edge_test::MIN_NEIGHBORS),
        ("PERSPECTIVE", lens::PERSPECTIVE),
        ("PANORAMA", lens::PANORAMA),
        ("SUN", light_kind::SUN),
        ("SKY", light_kind::SKY),
        ("HEADLIGHT", light_kind::HEADLIGHT),
        ("POINT", light_kind::POINT),
        ("SPOT", light_kind::SPOT),
        ("TRIANGLE", TRIANGLE),
        ("PUNCTUAL_LIGHT_POSITION", integrator::PUNCTUAL_LIGHT_POSITION as u32),
        ("PRIMARY_RAYS", ray_kind::PRIMARY as u32),
        ("SHADOW_RAYS", ray_kind::SHADOW as u32),
        ("SKY_RAYS", ray_kind::SKY as u32),
        ("SKY_DIRECTION", integrator::SKY_DIRECTION as u32),
        ("SKY_DISTANCE", integrator::SKY_DISTANCE as u32),
        ("SUN_DIRECTION", integrator::SUN_DIRECTION as u32),
    ];
    let floats = [
        ("CAPSULE_ASPECT", capsule::ASPECT),
        ("MIN_ALIGNED_COSINE", align::MIN_ALIGNED_COSINE),
        ("MIN_BENT_COSINE", align::MIN_BENT_COSINE),
        ("SOLID_SPAWN_OFFSET", SOLID_SPAWN_OFFSET),
        ("DISC_SPAWN_OFFSET", disc::SPAWN_OFFSET),
        ("DISC_SPAWN_T_MIN", disc::SPAWN_T_MIN),
        ("SMOOTH_SPAWN_OFFSET", smooth::SPAWN_OFFSET),
        ("SMOOTH_SPAWN_T_MIN", smooth::SPAWN_T_MIN),
        ("NEIGHBORHOOD_RADIUS_FACTOR", NEIGHBORHOOD_RADIUS_FACTOR),
        ("EDGE_MAX_PLANE_DISTANCE", edge_test::MAX_PLANE_DISTANCE),
        ("MIN_PASSED_DISTANCE", edge_test::MIN_PASSED_DISTANCE),
        ("MAX_BACKFACE_COSINE", edge_test::MAX_BACKFACE_COSINE),
        ("HEIGHT_STEPS", edge_test::HEIGHT_STEPS),
        ("TIE_BREAK_ANGLE", edge_test::TIE_BREAK_ANGLE),
        ("RETRY_RADIUS_FACTOR", trace::RETRY_RADIUS_FACTOR),
        ("RESTART_OFFSET", trace::RESTART_OFFSET),
        ("SMOOTH_RESTART_OFFSET", trace::SMOOTH_RESTART_OFFSET),
        ("MIN_SLIT_DEPTH", trace::MIN_SLIT_DEPTH),
        ("MIN_SLIT_COSINE", trace::MIN_SLIT_COSINE),
        ("MAX_DISTANCE_FROM_DISC", trace::MAX_DISTANCE_FROM_DISC),
        ("FIT_TOLERANCE", trace::TOLERANCE),
        ("MAX_LAST_STEP", trace::MAX_LAST_STEP),
        ("SUPPORT_FACTOR", SUPPORT_FACTOR),
        ("FIT_REACH", FIT_REACH),
        ("FIT_STEPS", smooth::STEPS),
        ("FIT_MIN_WEIGHT", smooth::MIN_WEIGHT),
        ("NEAREST_COLOR_WEIGHT", smooth::NEAREST_COLOR_WEIGHT),
        ("NORMAL_FALLOFF", smooth::NORMAL_FALLOFF),
        ("MAX_CURVATURE", smooth::MAX_CURVATURE),
        ("FLAT_SPREAD", smooth::FLAT_SPREAD),
        ("CURVED_SPREAD", smooth::CURVED_SPREAD),
        ("FIT_MAX_PLANE_DISTANCE", smooth::MAX_PLANE_DISTANCE),
        ("MAX_EDGE_COSINE", smooth::MAX_EDGE_COSINE),
        ("MIN_EDGE_WEIGHT", smooth::MIN_EDGE_WEIGHT),
        ("MAX_OVERHANG", smooth::MAX_OVERHANG),
        ("MAX_STEP", smooth::MAX_STEP),
        ("MIN_FACING_COS", integrator::MIN_FACING_COS),
    ];
    let integers = integers.into_iter().chain(kinds);
    let integers = integers.map(|(name, value)| format!("const {name}: u32 = {value}u;\n"));
    let floats = floats.map(|(name, value)| format!("const {name}: f32 = {value:?}f;\n"));
    integers.chain(floats).collect()
}

#[cfg(test)]
mod tests {
    //! Every kernel is valid and short, and the records have the same fields at the same offsets on both sides.

    use super::*;
    use crate::records::{
        FrameRecord, HitRecord, LightSample, MaterialRecord, Pixel, ShadowRay, Visit,
    };
    use std::mem::{offset_of, size_of};
    use surfel_core::math::Ray;
    use wgpu::naga::front::wgsl;
    use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};
    use wgpu::naga::{Module, TypeInner};

    fn parse(kernel: Kernel) -> Module {
        let source = kernel.source();
        wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{kernel:?}: {}", error.emit_to_string(&source)))
    }

    #[test]
    fn every_kernel_is_valid() {
        for kernel in Kernel::all() {
            let module = parse(kernel);
            let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
            if let Err(error) = validator.validate(&module) {
                panic!("{kernel:?}: {}", error.emit_to_string(&kernel.source()));
            }
            let entries: Vec<&str> =
                module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
            assert!(entries.contains(&kernel.entry_point()), "{kernel:?} {entries:?}");
        }
    }

    type Layout = (u32, Vec<(String, u32)>);

    fn wgsl_layout(module: &Module, name: &str) -> Layout {
        let (_, ty) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).unwrap();
        let TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no struct") };
        let members = members.iter().map(|member| (member.name.clone().unwrap(), member.offset));
        (*span, members.collect())
    }

    macro_rules! rust_layout {
        ($record:ident { $($field:ident),* $(,)? }) => {{
            let fields: Vec<(String, u32)> = vec![
                $((stringify!($field).to_owned(), offset_of!($record, $field) as u32)),*
            ];
            (stringify!($record), (size_of::<$record>() as u32, fields))
        }};
    }

    #[test]
    fn records_have_equal_layouts() {
        let layouts: Vec<(&str, Layout)> = vec![
            rust_layout!(Ray { origin, t_min, direction, t_max }),
            rust_layout!(FrameRecord {
                position,
                lens,
                forward,
                pixel_width,
                right,
                pixel_height,
                up,
                n_planes,
                center,
                seed,
                width,
                first_pixel,
                n_rays,
                sample_idx,
                samples_per_pixel,
                is_centered,
                is_first,
                reserved_a,
                planes
            }),
            rust_layout!(Visit {
                object_from_world,
                world_from_normal,
                instance,
                material,
                is_identity,
                surface,
                max_scale,
                max_blend_distance,
                edge_retest_factor,
                has_edge_test,
                has_front_sides,
                blends_colors,
                block_vectors,
                attributes
            }),
            rust_layout!(LightSample {
                direction,
                kind,
                color,
                cos_max,
                ground,
                ao_distance,
                sample_idx,
                n_samples,
                light,
                range,
                position,
                radius,
                inner_cos,
                outer_cos,
                reserved_a,
                reserved_b
            }),
            rust_layout!(MaterialRecord {
                base_color,
                ignores_vertex_colors,
                emissive,
                emissive_strength,
                is_unlit,
                reserved_a,
                reserved_b,
                reserved_c
            }),
            rust_layout!(HitRecord {
                normal,
                distance,
                color,
                radius,
                geometric_normal,
                reserved_c,
                slot,
                instance,
                material,
                surface,
                support_count,
                support_distance,
                reserved_a,
                reserved_b
            }),
            rust_layout!(ShadowRay { ray, contribution, is_open }),
            rust_layout!(Pixel { radiance, alpha, sum }),
        ];
        let module = parse(Kernel::Generate);
        for (name, layout) in layouts {
            assert_eq!(wgsl_layout(&module, name), layout, "{name}");
        }
    }

    #[test]
    fn files_of_kernels_are_short() {
        for kernel in Kernel::all() {
            for part in kernel.parts().into_iter().flatten() {
                assert!(part.lines().count() < 300, "{kernel:?}");
            }
        }
    }
}
