//! Rays in world coordinates against a scene, on all threads, after Open3D's `RaycastingScene`.

use crate::built_scene::BuiltScene;
use crate::description::Invalid;
use crate::error::{Error, Result};
use rayon::prelude::*;
use surfel_core::flat::{FlatGeometry, FlatScene};
use surfel_core::image::NO_ID;
use surfel_core::math::{DVec3, Ray, Vec3};
use surfel_core::progress::{NoProgress, Progress};
use surfel_core::render::uses_rasterizer;
use surfel_core::trace::{InstanceFilter, SceneHit, Simd, scene_hits, scene_occlusions};

/// Part of a ray from its origin without end.
pub const WHOLE_RAY: (f32, f32) = (0.0, f32::INFINITY);

/// Number of rays that a thread claims at a time.
const CHUNK: usize = 1024;

/// Rays in world coordinates, kept relative to the origin of a flat scene.
#[derive(Clone, Debug, Default)]
pub struct WorldRays {
    rays: Vec<Ray>,
    /// Lengths of the directions.
    lengths: Vec<f32>,
}

impl WorldRays {
    /// Rays `[x, y, z, dx, dy, dz]`: origin and direction in world coordinates. The direction has any length; one of length
    /// 0 as f32, and a ray with a number that is not finite as f32, hits nothing. `t_range` is the part of each ray that counts, in
    /// multiples of the length of its direction; nothing counts behind the origin.
    pub fn new(
        rays: impl IndexedParallelIterator<Item = [f64; 6]>,
        t_range: (f32, f32),
        scene: &FlatScene,
    ) -> Self {
        let local = |[x, y, z, dx, dy, dz]: [f64; 6]| {
            let origin = (DVec3::new(x, y, z) - scene.origin).as_vec3();
            let direction = DVec3::new(dx, dy, dz);
            let length = direction.length() as f32;
            let is_valid = origin.is_finite() && 0.0 < length && length.is_finite();
            let Some(direction) = direction.try_normalize().filter(|_| is_valid) else {
                return (Ray { t_max: -1.0, ..Ray::new(Vec3::ZERO, Vec3::Z) }, length);
            };
            let (t_min, t_max) = (t_range.0.max(0.0) * length, t_range.1 * length);
            (Ray { t_min, t_max, ..Ray::new(origin, direction.as_vec3()) }, length)
        };
        let (rays, lengths) = rays.map(local).unzip();
        Self { rays, lengths }
    }

    /// Returns the number of rays.
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// Returns true if there are no rays.
    pub fn is_empty(&self) -> bool {
        self.rays.is_empty()
    }
}

/// The nearest surfaces on rays as columns, with an entry for each ray.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RayHits {
    /// Distance in multiples of the length of the direction; infinite without a hit.
    pub t_hit: Vec<f32>,
    /// Index of the instance; `NO_ID` without a hit.
    pub instances: Vec<u32>,
    /// Index of the triangle in its mesh; `NO_ID` for points and without a hit.
    pub triangles: Vec<u32>,
    /// Index that the nearest point had when it was read; `NO_ID` for triangles and without a hit.
    pub points: Vec<u32>,
    /// Unit normal that faces the ray's origin; 0 without a hit.
    pub normals: Vec<[f32; 3]>,
}

impl RayHits {
    /// Returns the hit of one ray, of which these are the columns.
    fn of_ray(&self, ray_idx: usize, [x, y, z, dx, dy, dz]: [f64; 6]) -> Option<RayHit> {
        let t_hit = self.t_hit[ray_idx];
        let some = |ids: &[u32]| Some(ids[ray_idx]).filter(|id| *id != NO_ID);
        let position = DVec3::new(x, y, z) + f64::from(t_hit) * DVec3::new(dx, dy, dz);
        Some(RayHit {
            t_hit,
            position: position.to_array(),
            normal: self.normals[ray_idx],
            instance: some(&self.instances)?,
            point: some(&self.points),
            triangle: some(&self.triangles),
        })
    }
}

/// The nearest surface on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Distance from the ray's origin, in multiples of the length of its direction.
    pub t_hit: f32,
    /// World coordinates of the hit.
    pub position: [f64; 3],
    /// Unit normal that faces the ray's origin.
    pub normal: [f32; 3],
    /// Index of the instance that was hit.
    pub instance: u32,
    /// The point that is nearest to the hit, by its index among those that were read; none for triangles.
    pub point: Option<u32>,
    /// The triangle that was hit, by its index in its mesh; none for points.
    pub triangle: Option<u32>,
}

/// Casts rays at a scene, which has surfaces: rays pass between round points.
#[derive(Clone, Debug)]
pub struct RayCaster<'s> {
    scene: &'s FlatScene,
    simd: Simd,
    /// For each instance, the index that each of its points had when it was read; empty where that is not known.
    sources: Vec<&'s [u32]>,
}

impl<'s> RayCaster<'s> {
    /// Takes a scene, and for each instance the index that each of its points had when it was read.
    ///
    /// # Errors
    ///
    /// Fails for scenes of round points, which have no surface.
    pub fn new(scene: &'s FlatScene, simd: Simd, sources: Vec<&'s [u32]>) -> Result<Self> {
        if uses_rasterizer(scene)? {
            let advice = "points have no surface that rays meet; choose another, as `smooth`";
            return Err(Invalid::at("surface", advice).into());
        }
        Ok(Self { scene, simd, sources })
    }
    /// Finds the nearest surface on each ray.
    ///
    /// # Errors
    ///
    /// Fails if cancelled.
    pub fn hits(&self, rays: &WorldRays, progress: &dyn Progress) -> Result<RayHits> {
        let n = rays.len();
        // Memory of zeros is touched first by the threads that write hits to it.
        let mut hits = RayHits {
            t_hit: vec![0.0; n],
            instances: vec![0; n],
            triangles: vec![0; n],
            points: vec![0; n],
            normals: vec![[0.0; 3]; n],
        };
        let columns = hits.t_hit.par_chunks_mut(CHUNK).zip(hits.instances.par_chunks_mut(CHUNK));
        let columns = columns.zip(hits.triangles.par_chunks_mut(CHUNK));
        let columns = columns.zip(hits.points.par_chunks_mut(CHUNK));
        let columns = columns.zip(hits.normals.par_chunks_mut(CHUNK));
        let chunks = rays.rays.par_chunks(CHUNK).zip(rays.lengths.par_chunks(CHUNK));
        let buffer = || vec![SceneHit::MISS; CHUNK];
        columns.zip(chunks).try_for_each_init(buffer, |buffer, (columns, (rays, lengths))| {
            progress.check()?;
            let ((((t_hit, instances), triangles), points), normals) = columns;
            let found = &mut buffer[..rays.len()];
            scene_hits(self.scene, self.simd, InstanceFilter::All, rays, found);
            t_hit.fill(f32::INFINITY);
            for ids in [&mut *instances, &mut *triangles, &mut *points] {
                ids.fill(NO_ID);
            }
            for (i, hit) in found.iter().enumerate().filter(|(_, hit)| !hit.is_miss()) {
                t_hit[i] = hit.distance / lengths[i];
                instances[i] = hit.instance;
                normals[i] = hit.normal.to_array();
                match self.point(hit) {
                    Some(point) => points[i] = point,
                    None => triangles[i] = hit.id,
                }
            }
            Ok::<(), Error>(())
        })?;
        Ok(hits)
    }

    /// Returns the index that the point of a hit had when it was read; none for triangles.
    fn point(&self, hit: &SceneHit) -> Option<u32> {
        let instance = self.scene.instances.get(hit.instance as usize)?;
        let FlatGeometry::Cloud(_) = self.scene.geometry(instance) else { return None };
        let source = || self.sources.get(hit.instance as usize)?.get(hit.id as usize).copied();
        Some(source().unwrap_or(hit.id))
    }

    /// Finds out for each ray whether any surface lies on it.
    ///
    /// # Errors
    ///
    /// Fails if cancelled.
    pub fn occlusions(&self, rays: &WorldRays, progress: &dyn Progress) -> Result<Vec<bool>> {
        let mut occluded = vec![false; rays.len()];
        let chunks = occluded.par_chunks_mut(CHUNK).zip(rays.rays.par_chunks(CHUNK));
        chunks.try_for_each(|(occluded, rays)| {
            progress.check()?;
            scene_occlusions(self.scene, self.simd, InstanceFilter::All, rays, occluded);
            Ok::<(), Error>(())
        })?;
        Ok(occluded)
    }

    /// Counts the surfaces on each ray. Surfaces of points that are nearer to each other than a point's radius are one.
    ///
    /// # Errors
    ///
    /// Fails if cancelled.
    pub fn counts(&self, rays: &WorldRays, progress: &dyn Progress) -> Result<Vec<u32>> {
        let mut counts = vec![0; rays.len()];
        let chunks = counts.par_chunks_mut(CHUNK).zip(rays.rays.par_chunks(CHUNK));
        chunks.try_for_each(|(counts, rays)| self.count(rays, counts, progress))?;
        Ok(counts)
    }

    /// Counts surfaces one after the other, on all rays that have any left.
    fn count(&self, rays: &[Ray], counts: &mut [u32], progress: &dyn Progress) -> Result<()> {
        let (mut rays, mut indices): (Vec<Ray>, Vec<usize>) =
            (rays.to_vec(), (0..rays.len()).collect());
        let mut hits = vec![SceneHit::MISS; rays.len()];
        while !rays.is_empty() {
            progress.check()?;
            scene_hits(
                self.scene,
                self.simd,
                InstanceFilter::All,
                &rays,
                &mut hits[..indices.len()],
            );
            let mut n_left = 0;
            for i in (0..indices.len()).filter(|i| !hits[*i].is_miss()) {
                counts[indices[i]] += 1;
                (rays[n_left], indices[n_left]) = (behind(&rays[i], &hits[i]), indices[i]);
                n_left += 1;
            }
            rays.truncate(n_left);
            indices.truncate(n_left);
        }
        Ok(())
    }
}

impl BuiltScene {
    /// Returns what casts rays at the scene, many at a time and with progress.
    ///
    /// # Errors
    ///
    /// Fails for scenes of round points, which have no surface.
    pub fn ray_caster(&self) -> Result<RayCaster<'_>> {
        RayCaster::new(self.flat(), self.simd(), self.sources())
    }

    /// Finds the nearest surface on each ray. A ray is `[x, y, z, dx, dy, dz]`: origin and direction in world
    /// coordinates; the direction has any length but 0.
    ///
    /// # Errors
    ///
    /// Fails for scenes of round points, which have no surface.
    pub fn cast_rays(&self, rays: &[[f64; 6]]) -> Result<Vec<Option<RayHit>>> {
        let hits = self.ray_caster()?.hits(&self.world_rays(rays, WHOLE_RAY), &NoProgress)?;
        let found = rays.iter().enumerate().map(|(i, ray)| hits.of_ray(i, *ray));
        Ok(found.collect())
    }

    /// Returns whether any surface lies on each ray, within distances from `t_range.0` to `t_range.1` in multiples of
    /// the length of its direction: `(0.0, 1.0)` is a line of sight that ends where the direction does, [`WHOLE_RAY`]
    /// has no end.
    ///
    /// # Errors
    ///
    /// Fails for scenes of round points, which have no surface.
    pub fn test_occlusions(&self, rays: &[[f64; 6]], t_range: (f32, f32)) -> Result<Vec<bool>> {
        self.ray_caster()?.occlusions(&self.world_rays(rays, t_range), &NoProgress)
    }

    fn world_rays(&self, rays: &[[f64; 6]], t_range: (f32, f32)) -> WorldRays {
        WorldRays::new(rays.par_iter().copied(), t_range, self.flat())
    }
}

/// Returns the rest of a ray behind a surface.
fn behind(ray: &Ray, hit: &SceneHit) -> Ray {
    /// A ray along the surface would otherwise be moved without bound.
    const MIN_COS: f32 = 0.1;
    let cos = ray.direction.dot(hit.geometric_normal).abs().max(MIN_COS);
    // Distances are rounded where instances scale them.
    let end = (hit.distance.max(ray.t_min) * (1.0 + 4.0 * f32::EPSILON)).next_up();
    Ray { t_min: end.max(hit.distance + hit.radius / cos), ..*ray }
}

#[cfg(test)]
mod tests {
    //! Columns of rays against a square of triangles and against nothing.

    use super::*;
    use crate::description::SceneDescription;
    use crate::memory_files::MemoryContent;
    use crate::resolve;
    use std::path::Path;
    use std::sync::Arc;
    use surfel_core::math::DAffine3;
    use surfel_core::math::Vec2;
    use surfel_core::points::PointCloud;
    use surfel_core::scene::Background;
    use surfel_core::scene::{
        Camera, Geometry, Graph, Material, Mesh, Projection, Scene, Transform,
    };

    /// Two squares of side 2 about the z axis, at z = 0 and z = 3, far from the world's origin.
    fn two_squares() -> FlatScene {
        squares(Transform::IDENTITY)
    }

    fn squares(transform: Transform) -> FlatScene {
        let corners =
            [Vec2::new(-1.0, -1.0), Vec2::new(1.0, -1.0), Vec2::ONE, Vec2::new(-1.0, 1.0)];
        let square = |z: f32| corners.map(|corner| corner.extend(z));
        let mesh = Mesh {
            origin: DVec3::new(5e5, 4e6, 0.0),
            positions: [square(0.0), square(3.0)].concat(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
            ..Mesh::default()
        };
        let mut graph = Graph::from_geometry(Geometry::Triangles(mesh), Material::MATTE);
        graph.nodes[0].transform = transform;
        let camera = Camera {
            position: DVec3::ZERO,
            focal_point: DVec3::Y,
            view_up: DVec3::Z,
            projection: Projection::Panorama,
        };
        let scene =
            Scene { graph, lights: Vec::new(), background: Background::Transparent, camera };
        FlatScene::new(&scene, &NoProgress).unwrap()
    }

    #[test]
    fn rays_meet_both_squares() {
        let scene = two_squares();
        let caster = RayCaster::new(&scene, Simd::detect(), Vec::new()).unwrap();
        let down = |x: f64, length: f64| [5e5 + x, 4e6 + 0.25, 10.0, 0.0, 0.0, -length];
        let nan = [f64::NAN, 4e6, 10.0, 0.0, 0.0, -1.0];
        let rays = [down(0.5, 1.0), down(0.5, 2.0), down(5.0, 1.0), down(0.5, 0.0), nan];
        let all = WorldRays::new(rays.par_iter().copied(), WHOLE_RAY, &scene);
        let hits = caster.hits(&all, &NoProgress).unwrap();
        let none = f32::INFINITY;
        assert_eq!(hits.t_hit, [7.0, 3.5, none, none, none]);
        assert_eq!(hits.instances, [0, 0, NO_ID, NO_ID, NO_ID]);
        assert_eq!(hits.triangles, [2, 2, NO_ID, NO_ID, NO_ID]);
        assert_eq!(hits.points, [NO_ID; 5]);
        assert_eq!(hits.normals[..3], [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0; 3]]);
        assert_eq!(caster.counts(&all, &NoProgress).unwrap(), [2, 2, 0, 0, 0]);
        let occluded = [true, true, false, false, false];
        assert_eq!(caster.occlusions(&all, &NoProgress).unwrap(), occluded);
        let short = WorldRays::new(rays.par_iter().copied(), (0.0, 6.0), &scene);
        assert_eq!(caster.occlusions(&short, &NoProgress).unwrap()[..2], [false, true]);
        // Neither length is one of f32.
        let lengths = [1e-60, 1e60].map(|length| down(0.5, length));
        let odd = WorldRays::new(lengths.par_iter().copied(), WHOLE_RAY, &scene);
        assert_eq!(caster.hits(&odd, &NoProgress).unwrap().t_hit, [none, none]);
        let late = WorldRays::new(rays.par_iter().copied(), (8.0, 20.0), &scene);
        assert_eq!(caster.hits(&late, &NoProgress).unwrap().t_hit[0], 10.0);
    }

    #[test]
    fn each_surface_of_a_scaled_mesh_counts_once() {
        for scale in [0.01, 0.3048, 10.0, 1000.0] {
            let scene = squares(Transform::Matrix(DAffine3::from_scale(DVec3::splat(scale))));
            let caster = RayCaster::new(&scene, Simd::detect(), Vec::new()).unwrap();
            let rays = (0..1000).map(|i| {
                let (x, z) = (scale * (5e5 + 0.3), scale * (4.0 + 7.0 * f64::from(i) / 1000.0));
                [x, scale * 4e6, z, 0.0, 0.0, -1.0]
            });
            let rays: Vec<[f64; 6]> = rays.collect();
            let rays = WorldRays::new(rays.par_iter().copied(), WHOLE_RAY, &scene);
            assert_eq!(caster.counts(&rays, &NoProgress).unwrap(), [2; 1000], "{scale}");
        }
    }

    /// Returns a plane of points on z = 0, the first of which is not finite.
    fn plane(surface: &str) -> BuiltScene {
        let corner = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0);
        let mut cloud = PointCloud::from_positions((0..400).map(corner).collect());
        cloud.positions[0] = Vec3::NAN;
        let mut description = SceneDescription::of_files(["memory:plane"]);
        description.memory.insert("memory:plane", MemoryContent::Points(Arc::new(cloud), None));
        description.set("surface", &surface.into(), Path::new("")).unwrap();
        resolve(&description, &NoProgress).unwrap().build_trees(&NoProgress).unwrap()
    }

    #[test]
    fn a_built_scene_answers_as_its_ray_caster_does() {
        let scene = plane("sphere");
        let rays = [[3.0, 4.0, 6.0, 0.0, 0.0, -2.0], [50.0, 4.0, 6.0, 0.0, 0.0, -2.0]];
        let hits = scene.cast_rays(&rays).unwrap();
        let hit = hits[0].unwrap();
        assert_eq!(hit.position, [3.0, 4.0, 6.0 - 2.0 * f64::from(hit.t_hit)]);
        // The 84th point of the file, though the first one is gone.
        assert_eq!((hit.point, hit.triangle, hits[1]), (Some(83), None, None));
        let caster = scene.ray_caster().unwrap();
        let columns = caster.hits(&scene.world_rays(&rays, WHOLE_RAY), &NoProgress).unwrap();
        assert_eq!((columns.points, columns.triangles), (vec![83, NO_ID], vec![NO_ID; 2]));
        let occluded = |t_range| scene.test_occlusions(&rays, t_range).unwrap();
        assert_eq!(occluded(WHOLE_RAY), [true, false]);
        assert_eq!(occluded((0.0, 1.0)), [false, false]);
    }

    #[test]
    fn rays_are_refused_where_nothing_is_a_surface() {
        let scene = plane("points");
        let error = scene.cast_rays(&[[3.0, 4.0, 6.0, 0.0, 0.0, -1.0]]).unwrap_err().to_string();
        assert!(error.starts_with("surface: points have no surface"), "{error}");
        assert!(scene.test_occlusions(&[], WHOLE_RAY).is_err());
    }
}
