//! The kernels' source text: the files of each kernel, after the constants that Rust writes.

use crate::constants::constants;
use crate::numbers::surface_number;
use crate::surface::Surface;
use std::fmt::Write;

/// A kernel: one pass over the entries of a queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kernel {
    /// Makes the camera rays.
    Generate,
    /// Closes a queue, so that passes over it do only what is needed.
    TakeQueue,
    /// Sets the hits of all rays to misses.
    ClearHits,
    /// Finds the nearest hit on a tree whose points have this surface.
    Closest(Surface),
    /// Finds the next disc of each ray: the nearest one, in later rounds the nearest behind it.
    NextDisc,
    /// Finds discs on rays toward a light.
    AnyDisc,
    /// Tests whether rays hit the surface near their first discs.
    TestClosest(Surface),
    /// Tests whether rays toward a light are blocked near the discs that were found.
    TestAny(Surface),
    /// Finds the points behind the hits on a tree.
    Support(Surface),
    /// Computes the light of trained Gaussians before the hits of rays.
    Gaussians,
    /// Attenuates rays toward a light by trained Gaussians.
    GaussianShadow,
    /// Finds where trained Gaussians let half of the light pass.
    GaussianHits,
    /// Finds how near rays pass the trained Gaussians that they hit.
    GaussianSupport,
    /// Adds the light that surfaces emit, and makes the rays that continue the paths.
    Shade,
    /// Makes rays toward a light.
    SampleLight,
    /// Finds out which rays toward a light a tree blocks.
    Any(Surface),
    /// Adds the light of the rays that nothing blocks.
    AddLight,
    /// Tints the light of rays by the surfaces that they hit, and adds that of rays that hit none.
    PassSurface,
    /// Computes the colours of pixels from the sums of their samples.
    Resolve,
}

/// The arrays that a kernel reads beside those of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resources {
    /// A tree.
    Tree,
    /// Materials, instances, lights, textures.
    Scene,
    /// The sizes of dispatches.
    Dispatches,
    /// The colours of pixels.
    Colors,
}

macro_rules! parts {
    ($($path:literal),* $(,)?) => {
        &[$(include_str!(concat!("shader/", $path))),*]
    };
}

const COMMON: &[&str] = parts!["math/ray.wgsl", "records.wgsl"];
const SAMPLING: &[&str] = parts!["math/random.wgsl", "math/sampling.wgsl", "render/key.wgsl"];
const GENERATE: &[&str] = parts!["scene/camera.wgsl", "render/generate.wgsl"];
const QUEUE: &[&str] = parts!["render/queue.wgsl"];
const RESOLVE: &[&str] = parts!["render/resolve.wgsl"];
const CLEAR: &[&str] = parts!["render/clear.wgsl"];
const SCENE: &[&str] = parts!["math/basis.wgsl", "scene/buffers.wgsl", "render/pixel.wgsl"];
const LIGHTS: &[&str] = parts!["scene/light.wgsl", "scene/environment.wgsl"];
const SPECULAR: &[&str] = parts!["integrator/specular.wgsl"];
const SHADING: &[&str] =
    parts!["scene/texture.wgsl", "integrator/shading.wgsl", "integrator/media.wgsl"];
const SHADE: &[&str] =
    parts!["render/slot.wgsl", "integrator/background.wgsl", "integrator/whitted.wgsl"];
const DIRECT: &[&str] = parts!["render/slot.wgsl", "integrator/direct.wgsl"];
const TRANSMITTANCE: &[&str] = parts!["integrator/transmittance.wgsl"];
const ARRAYS: &[&str] = parts!["flat/arrays.wgsl"];
const PAGED_ARRAYS: &[&str] = parts!["flat/paged_arrays.wgsl"];
const VISIT: &[&str] = parts!["bvh/node.wgsl", "trace/visit.wgsl"];
const GAUSSIANS: &[&str] = parts!["flat/gaussians.wgsl", "surface/gaussian.wgsl"];
const GAUSSIAN_LIGHT: &[&str] = parts![
    "trace/query/gaussian_buffer.wgsl",
    "trace/query/gaussian_query.wgsl",
    "trace/query/gaussian_light.wgsl",
];
const GAUSSIANS_KERNEL: &[&str] = parts!["trace/gaussians_kernel.wgsl"];
const GAUSSIAN_SHADOW: &[&str] = parts!["trace/gaussian_shadow_kernel.wgsl"];
const GAUSSIAN_HITS: &[&str] = parts!["trace/gaussian_hits_kernel.wgsl"];
const GAUSSIAN_SUPPORT: &[&str] = parts!["trace/gaussian_support_kernel.wgsl"];
const TREE: &[&str] = parts![
    "flat/block.wgsl",
    "surface/disc.wgsl",
    "surface/sphere.wgsl",
    "surface/capsule.wgsl",
    "surface/leaves.wgsl",
    "surface/mls_ball.wgsl",
    "surface/kind.wgsl",
];
const TRAVERSE: &[&str] = parts!["trace/traverse.wgsl"];
const REGION: &[&str] = parts!["trace/region.wgsl"];
const SUPPORT: &[&str] = parts!["trace/support_kernel.wgsl"];
const CLOSEST: &[&str] = parts!["trace/query/closest.wgsl"];
const CLOSEST_KERNEL: &[&str] = parts!["trace/closest_kernel.wgsl"];
const CLOSEST_SINGLE_RAY: &[&str] = parts!["trace/query/closest_single_ray.wgsl"];
const GROUP: &[&str] = parts!["trace/group.wgsl"];
const ANY: &[&str] = parts!["trace/query/any.wgsl"];
const ANY_KERNEL: &[&str] = parts!["trace/any_kernel.wgsl"];
const ANY_SINGLE_RAY: &[&str] = parts!["trace/query/any_single_ray.wgsl"];
const ANY_TESTED: &[&str] = parts!["trace/query/any_tested.wgsl"];
const TRIANGLES: &[&str] = parts![
    "math/basis.wgsl",
    "surface/triangle.wgsl",
    "flat/triangles.wgsl",
    "trace/query/triangles.wgsl",
];
const EDGE: &[&str] = parts![
    "math/basis.wgsl",
    "surface/edge_test.wgsl",
    "trace/query/facing.wgsl",
    "trace/query/edge_test.wgsl",
];
const SOLIDS: &[&str] = parts!["trace/query/solids.wgsl"];
const DISCS: &[&str] = parts!["trace/query/disc_query.wgsl", "trace/query/surface.wgsl"];
const SPLATS: &[&str] = parts![
    "math/eigen.wgsl",
    "surface/splat.wgsl",
    "trace/query/gather.wgsl",
    "trace/query/plane_fit.wgsl",
    "trace/query/splat_query.wgsl",
    "trace/query/surface.wgsl",
];
const WITHIN_EDGE: &[&str] = parts!["trace/query/within_edge.wgsl"];
const WITHIN_RIMS: &[&str] = parts!["trace/query/within_rims.wgsl"];
const FACING: &[&str] = parts!["trace/query/facing.wgsl"];
const ANY_SURFACE: &[&str] = parts!["trace/query/any_surface.wgsl"];
const EDGE_FILTER: &[&str] = parts!["trace/query/edge_filter.wgsl"];
const SMOOTH: &[&str] = parts![
    "surface/weight.wgsl",
    "surface/smooth.wgsl",
    "trace/query/damped.wgsl",
    "trace/query/smooth_query.wgsl",
];
const SMOOTH_DISC: &[&str] = parts!["trace/query/smooth_disc.wgsl"];
const SLOT: &[&str] = parts!["render/slot.wgsl"];
const NEARER: &[&str] = parts!["trace/nearer.wgsl"];
const NEXT_DISC: &[&str] = parts!["trace/query/passed_disc.wgsl", "trace/next_disc_kernel.wgsl"];
const ANY_DISC: &[&str] = parts!["trace/any_disc_kernel.wgsl"];
const TEST_CLOSEST: &[&str] = parts!["trace/test_closest_kernel.wgsl"];
const TEST_ANY: &[&str] = parts!["trace/test_any_kernel.wgsl"];
const SMOOTH_SURFACE: &[&str] =
    parts!["trace/query/passed_disc.wgsl", "trace/query/smooth_surface.wgsl"];
const MLS: &[&str] = parts![
    "math/eigen.wgsl",
    "surface/weight.wgsl",
    "surface/mls.wgsl",
    "trace/query/damped.wgsl",
    "trace/query/mls_query.wgsl",
    "trace/query/mls_surface.wgsl",
];
const IMPLICIT: &[&str] = parts![
    "surface/weight.wgsl",
    "surface/field.wgsl",
    "flat/field/kd_tree.wgsl",
    "trace/traversal/kd_walk.wgsl",
    "trace/query/ray_field.wgsl",
    "trace/query/field_query.wgsl",
];
const OCTREE: &[&str] = parts![
    "flat/field/octree.wgsl",
    "trace/traversal/octree_walk.wgsl",
    "trace/query/octree_query.wgsl",
];
const OCTREE_SURFACE: &[&str] = parts!["trace/query/octree_surface.wgsl"];
const ANY_CELL: &[&str] = parts!["trace/query/any_cell.wgsl"];
const SMOOTH_FILTER: &[&str] = parts!["trace/query/smooth_filter.wgsl"];

impl Kernel {
    /// Returns every kernel.
    pub fn all() -> Vec<Self> {
        let mut all = vec![
            Self::Generate,
            Self::TakeQueue,
            Self::ClearHits,
            Self::Gaussians,
            Self::GaussianShadow,
            Self::GaussianHits,
            Self::GaussianSupport,
            Self::Shade,
            Self::SampleLight,
            Self::AddLight,
            Self::PassSurface,
            Self::Resolve,
        ];
        all.extend([Self::NextDisc, Self::AnyDisc]);
        let tested = |any: bool| Surface::ALL.into_iter().filter(move |s| s.tests_first_disc(any));
        all.extend(tested(false).map(Self::TestClosest));
        all.extend(tested(true).map(Self::TestAny));
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
            Self::TakeQueue => "take_queue",
            Self::ClearHits => "clear_hits",
            Self::Closest(_) | Self::GaussianHits => "closest",
            Self::NextDisc => "next_disc",
            Self::AnyDisc => "any_disc",
            Self::TestClosest(_) => "test_closest",
            Self::TestAny(_) => "test_any",
            Self::Support(_) | Self::GaussianSupport => "support",
            Self::Gaussians => "gaussians",
            Self::GaussianShadow => "gaussian_shadow",
            Self::Shade => "shade",
            Self::SampleLight => "sample_light",
            Self::Any(_) => "any_hit",
            Self::AddLight => "add_light",
            Self::PassSurface => "pass_surface",
            Self::Resolve => "resolve",
        }
    }

    /// Returns the arrays that the kernel reads beside those of rays.
    pub fn resources(self) -> Resources {
        match self {
            Self::Closest(_) | Self::Any(_) | Self::Support(_) => Resources::Tree,
            Self::NextDisc | Self::AnyDisc | Self::TestClosest(_) | Self::TestAny(_) => {
                Resources::Tree
            }
            Self::Gaussians | Self::GaussianShadow | Self::GaussianHits | Self::GaussianSupport => {
                Resources::Tree
            }
            Self::Generate | Self::TakeQueue | Self::ClearHits => Resources::Dispatches,
            Self::Shade | Self::SampleLight | Self::AddLight | Self::PassSurface => {
                Resources::Scene
            }
            Self::Resolve => Resources::Colors,
        }
    }

    /// Returns the kernel's source text, for trees in pages of `1 << page_shift` vectors or for whole trees.
    pub fn source(self, page_shift: Option<u32>) -> String {
        let mut source = constants();
        if let Some(page_shift) = page_shift {
            _ = writeln!(source, "const PAGE_SHIFT: u32 = {page_shift}u;");
        }
        if let Some(surface) = self.surface() {
            let has_colors = matches!(self, Self::Closest(_) | Self::TestClosest(_));
            _ = writeln!(source, "const SHAPE: u32 = {}u;", surface_number(surface.shape()));
            _ = writeln!(source, "const SURFACE: u32 = {}u;", surface.number());
            _ = writeln!(source, "const MAX_DISCS: u32 = {}u;", surface.max_discs());
            if let Surface::Mls(degree) = surface {
                _ = writeln!(source, "const DEGREE: u32 = {degree}u;");
            }
            _ = writeln!(source, "const HAS_COLORS: bool = {has_colors};");
        }
        let arrays = if page_shift.is_some() { PAGED_ARRAYS } else { ARRAYS };
        let arrays = if self.resources() == Resources::Tree { arrays } else { &[] };
        let parts = self.parts().into_iter().flatten().chain(arrays);
        parts.for_each(|part| source.push_str(part));
        source
    }

    /// Returns the surface that the kernel traces.
    fn surface(self) -> Option<Surface> {
        match self {
            Self::Closest(surface) | Self::Any(surface) | Self::Support(surface) => Some(surface),
            Self::TestClosest(surface) | Self::TestAny(surface) => Some(surface),
            Self::NextDisc | Self::AnyDisc => Some(Surface::DiscRims),
            _ => None,
        }
    }

    fn parts(self) -> Vec<&'static [&'static str]> {
        match self {
            Self::Generate => vec![COMMON, SAMPLING, GENERATE],
            Self::TakeQueue => vec![COMMON, QUEUE],
            Self::ClearHits => vec![COMMON, CLEAR],
            Self::Resolve => vec![COMMON, SAMPLING, RESOLVE],
            Self::Shade => vec![COMMON, SAMPLING, SCENE, LIGHTS, SPECULAR, SHADING, SHADE],
            Self::SampleLight | Self::AddLight => {
                vec![COMMON, SAMPLING, SCENE, LIGHTS, SPECULAR, DIRECT]
            }
            Self::PassSurface => vec![COMMON, SAMPLING, SCENE, SPECULAR, SHADING, TRANSMITTANCE],
            Self::Closest(surface) => {
                let mut parts = vec![COMMON, VISIT, TREE, NEARER, CLOSEST_KERNEL];
                if surface.is_in_blocks() {
                    parts.push(TRAVERSE);
                }
                parts.extend_from_slice(match surface {
                    Surface::Sphere | Surface::Capsule | Surface::Leaves => {
                        &[CLOSEST_SINGLE_RAY, CLOSEST, SOLIDS]
                    }
                    Surface::Disc => {
                        &[CLOSEST_SINGLE_RAY, CLOSEST, REGION, EDGE, DISCS, WITHIN_EDGE]
                    }
                    Surface::DiscRims => &[CLOSEST_SINGLE_RAY, CLOSEST, FACING, DISCS, WITHIN_RIMS],
                    Surface::SplatRims => &[CLOSEST_SINGLE_RAY, FACING, SPLATS, WITHIN_RIMS],
                    Surface::Splat | Surface::SplatFit | Surface::Cylinder => {
                        &[CLOSEST_SINGLE_RAY, REGION, EDGE, SPLATS, WITHIN_EDGE]
                    }
                    Surface::Triangle => &[CLOSEST_SINGLE_RAY, TRIANGLES],
                    Surface::Mls(_) => &[CLOSEST_SINGLE_RAY, CLOSEST, REGION, EDGE, MLS],
                    Surface::Implicit => &[CLOSEST_SINGLE_RAY, REGION, EDGE, IMPLICIT],
                    Surface::Octree | Surface::OctreeSplat => {
                        &[CLOSEST_SINGLE_RAY, OCTREE, OCTREE_SURFACE]
                    }
                    Surface::Smooth => {
                        &[GROUP, CLOSEST, REGION, EDGE, SMOOTH, SMOOTH_DISC, SMOOTH_SURFACE]
                    }
                });
                parts
            }
            Self::NextDisc => {
                vec![COMMON, VISIT, TREE, TRAVERSE, CLOSEST, NEARER, NEXT_DISC]
            }
            Self::AnyDisc => vec![COMMON, VISIT, TREE, TRAVERSE, ANY, ANY_DISC],
            Self::TestClosest(_) => {
                let parts = [COMMON, VISIT, TREE, NEARER, SLOT, REGION, EDGE, SMOOTH, SMOOTH_DISC];
                parts.into_iter().chain([TEST_CLOSEST]).collect()
            }
            Self::TestAny(Surface::Smooth) => {
                let parts = [COMMON, VISIT, TREE, SLOT, REGION, EDGE, SMOOTH, SMOOTH_FILTER];
                parts.into_iter().chain([TEST_ANY]).collect()
            }
            Self::TestAny(_) => {
                vec![COMMON, VISIT, TREE, SLOT, REGION, EDGE, EDGE_FILTER, TEST_ANY]
            }
            Self::Support(_) => vec![COMMON, VISIT, TREE, REGION, SUPPORT],
            Self::Gaussians => {
                vec![COMMON, VISIT, GAUSSIANS, TRAVERSE, GAUSSIAN_LIGHT, GAUSSIANS_KERNEL]
            }
            Self::GaussianShadow => {
                vec![COMMON, VISIT, GAUSSIANS, TRAVERSE, GAUSSIAN_LIGHT, GAUSSIAN_SHADOW]
            }
            Self::GaussianHits => {
                vec![COMMON, VISIT, GAUSSIANS, TRAVERSE, GAUSSIAN_LIGHT, GAUSSIAN_HITS]
            }
            Self::GaussianSupport => vec![COMMON, VISIT, GAUSSIANS, GAUSSIAN_SUPPORT],
            Self::Any(surface) => {
                let mut parts = vec![COMMON, VISIT, TREE, ANY_KERNEL];
                if surface.is_in_blocks() {
                    parts.push(TRAVERSE);
                }
                parts.extend_from_slice(match surface {
                    Surface::Sphere
                    | Surface::Capsule
                    | Surface::Leaves
                    | Surface::DiscRims
                    | Surface::SplatRims => &[ANY_SINGLE_RAY, ANY],
                    Surface::Triangle => &[ANY_SINGLE_RAY, TRIANGLES],
                    Surface::Disc | Surface::Splat | Surface::SplatFit => {
                        &[GROUP, ANY_TESTED, REGION, EDGE, EDGE_FILTER]
                    }
                    Surface::Cylinder => {
                        &[ANY_SINGLE_RAY, REGION, EDGE, SPLATS, WITHIN_EDGE, ANY_SURFACE]
                    }
                    Surface::Mls(_) => &[ANY_SINGLE_RAY, CLOSEST, REGION, EDGE, MLS, ANY_SURFACE],
                    Surface::Implicit => &[ANY_SINGLE_RAY, REGION, EDGE, IMPLICIT, ANY_SURFACE],
                    Surface::Octree | Surface::OctreeSplat => &[ANY_SINGLE_RAY, OCTREE, ANY_CELL],
                    Surface::Smooth => &[GROUP, ANY_TESTED, REGION, EDGE, SMOOTH, SMOOTH_FILTER],
                });
                parts
            }
        }
    }
}

#[cfg(test)]
mod tests;
