//! The memory that a picture takes, and the limit that the user may set.

use crate::description::SceneDescription;
use crate::error::{Error, Result};
use std::path::Path;
use surfel_core::bytes::readable;
use surfel_core::flat::{MAX_GAUSSIAN_BYTES, PointBlock, max_field_bytes};
use surfel_core::math::LANES;
use surfel_core::points::{GAUSSIAN_COLUMNS, MAX_REST_COLUMNS, PointCloud, Subsample};
use surfel_core::progress::with_keys;
use surfel_core::scene::{Geometry, Graph};
use surfel_core::surface::SurfaceKind;
use surfel_core::words::counted;
use surfel_formats::FileInfo;

/// Counts from which the memory of a picture follows, known before it is rendered.
#[derive(Clone, Copy, Debug)]
pub struct MemoryEstimate {
    n_points: u64,
    n_kept_points: u64,
    /// Number of the points whose normals, radii and structure are estimated, as far as that is known.
    n_estimated_points: u64,
    /// Number of the points that are trained splats, and shown as such.
    n_splats: u64,
    n_triangles: u64,
    n_texels: u64,
    /// Bytes of the picture.
    picture: u64,
    /// Bytes of a point's tree, block, index, and other structures of its surface.
    flat_point: u64,
}

/// Bytes of a point as it is loaded: position, normal, radius, colour and intensity.
const COLUMNS: u64 = 12 + 12 + 4 + 6 + 4;

/// Bytes of the further columns of a trained splat as it is loaded.
const SPLAT_COLUMNS: u64 = 4 * (GAUSSIAN_COLUMNS.len() + MAX_REST_COLUMNS) as u64;

/// Bytes of a triangle as it is loaded: corners, and position, normal and texture coordinates of about a vertex.
const TRIANGLE: u64 = 12 + 12 + 12 + 8;

/// Bytes of a point's tree, block and index.
const FLAT_POINT: u64 = (size_of::<PointBlock>() / LANES + size_of::<u32>()) as u64 + 5;

/// Bytes of a point while its normal, radius and structure are estimated, beside those as it is loaded: measured with 2.5
/// million points of a ruin, of which the search for structures takes half.
const ESTIMATED_POINT: u64 = 175;

/// Bytes of a triangle's tree and corners.
const FLAT_TRIANGLE: u64 = 42;

const TEXEL: u64 = 4;

/// Bytes of a pixel: its colour and coverage.
pub const PIXEL: u64 = 16 + 4;

/// Bytes of a pixel with all its layers.
pub const PIXEL_WITH_LAYERS: u64 = 16 + 60;

/// Bytes of an average line of text, where a file does not say how many there are.
const LINE: u64 = 30;

impl MemoryEstimate {
    /// Estimates from the headers of files, without reading their points, beside the bytes of a picture.
    pub fn from_files<'f>(
        files: impl IntoIterator<Item = (&'f Path, &'f FileInfo)>,
        subsample: Option<Subsample>,
        picture: u64,
    ) -> Self {
        let (meshes, clouds): (Vec<_>, Vec<_>) =
            files.into_iter().partition(|(_, info)| info.n_triangles.is_some());
        let clouds = clouds.into_iter();
        let clouds: Vec<(u64, bool)> =
            clouds.map(|(file, info)| (n_points(file, info), are_splats(info))).collect();
        let n_points = sum(clouds.iter().map(|(n, _)| (*n, 1)));
        let n_splats =
            sum(clouds.iter().filter(|(_, are_splats)| *are_splats).map(|(n, _)| (*n, 1)));
        let triangles = meshes.iter().filter_map(|(_, info)| info.n_triangles);
        let n_triangles = sum(triangles.map(|n| (n, 1)));
        Self { n_splats, n_triangles, picture, ..Self::of_points(n_points, subsample) }
    }

    /// Estimates from a number of points that were read.
    pub fn of_points(n_points: u64, subsample: Option<Subsample>) -> Self {
        Self {
            n_points,
            n_kept_points: kept(n_points, subsample),
            n_estimated_points: 0,
            n_splats: 0,
            n_triangles: 0,
            n_texels: 0,
            picture: 0,
            flat_point: FLAT_POINT,
        }
    }

    /// Leaves the points out: how many a filter keeps is known only when they are read.
    pub fn without_points(self) -> Self {
        Self { n_points: 0, n_kept_points: 0, n_estimated_points: 0, n_splats: 0, ..self }
    }

    /// Counts the estimate of normals, radii and structures of all points.
    pub fn with_estimates(self) -> Self {
        Self { n_estimated_points: self.n_kept_points, ..self }
    }

    /// Estimates from what was read, where textures are known too, beside the bytes of a picture.
    pub fn from_graph(
        graph: &Graph<PointCloud>,
        subsample: Option<Subsample>,
        picture: u64,
    ) -> Self {
        let (n_points, n_triangles) = graph.n_points_and_triangles();
        let points = Self::of_points(n_points as u64, subsample);
        let n_points_of = |is_chosen: fn(&PointCloud) -> bool| {
            let clouds = graph.geometries.iter().filter_map(|geometry| match geometry {
                Geometry::Points(cloud) if is_chosen(cloud) => Some((cloud.len() as u64, 1)),
                _ => None,
            });
            sum(clouds)
        };
        let n_incomplete = n_points_of(|cloud| {
            !cloud.has_gaussians() && (cloud.normals.is_none() || cloud.radii.is_none())
        });
        Self {
            n_estimated_points: n_incomplete.min(points.n_kept_points),
            n_splats: n_points_of(PointCloud::has_gaussians),
            n_triangles: n_triangles as u64,
            n_texels: graph.textures.iter().map(|texture| texture.texels.len() as u64).sum(),
            picture,
            ..points
        }
    }

    /// Adds the structures that the surfaces of a description take besides the points' tree.
    pub fn with_surfaces_of(self, description: &SceneDescription) -> Self {
        let scene = &description.objects_default;
        let objects = description.objects.iter().map(|object| object.settings.over(scene));
        let kinds: Vec<SurfaceKind> =
            objects.chain([scene.clone()]).map(|settings| settings.surface.surface()).collect();
        let most = kinds.iter().copied().map(max_field_bytes).max().unwrap_or_default() as u64;
        // Pixels need neither normals nor radii.
        let are_pixels = kinds.iter().all(|kind| *kind == SurfaceKind::Points);
        let n_estimated_points = if are_pixels { 0 } else { self.n_estimated_points };
        let surface = scene.surface.surface;
        let are_gaussians = surface.is_none_or(|kind| kind == SurfaceKind::Gaussian);
        let n_splats = if are_gaussians { self.n_splats } else { 0 };
        let flat_point = self.flat_point + most;
        Self { flat_point, n_splats, n_estimated_points, ..self }
    }

    /// Bytes of the input as read, of its preparation or of the flat form with what building it takes, whichever is more,
    /// and of the picture.
    fn peak(&self) -> [u64; 3] {
        let [read, flat, picture] = self.bytes();
        [read, flat.max(self.preparation()), picture]
    }

    fn preparation(&self) -> u64 {
        sum([(self.n_estimated_points, ESTIMATED_POINT)])
    }

    /// Bytes of the input as read, of the flat form with what building it takes, and of the picture.
    fn bytes(&self) -> [u64; 3] {
        let meshes = sum([(self.n_triangles, TRIANGLE), (self.n_texels, TEXEL)]);
        let read = sum([(self.n_points, COLUMNS), (self.n_splats, SPLAT_COLUMNS), (meshes, 1)]);
        let n_kept_splats = self.n_splats.min(self.n_kept_points);
        let trees = sum([
            (self.n_kept_points, self.flat_point),
            (n_kept_splats, MAX_GAUSSIAN_BYTES as u64),
            (self.n_triangles, FLAT_TRIANGLE),
        ]);
        // Vertices and textures stand in the flat form as they were read.
        let flat = sum([(trees / 2, 5), (meshes, 1)]);
        [read, flat, self.picture]
    }

    /// Returns the bytes of a scene that is kept: as read, as prepared, and in the flat form.
    pub fn held(&self) -> u64 {
        let [read, flat, _] = self.bytes();
        sum([(read, 2), (flat, 1)])
    }

    /// Checks the estimate against a limit in bytes.
    ///
    /// # Errors
    ///
    /// Fails with [`Error::OutOfMemory`], which says what would fit.
    pub fn check(&self, limit: Option<u64>) -> Result<()> {
        let Some(limit) = limit else { return Ok(()) };
        let ([read, prepared, picture], all) = (self.peak(), self.total());
        if all <= limit {
            return Ok(());
        }
        let things = [(self.n_points, "point"), (self.n_triangles, "triangle")];
        let there = things.iter().filter(|(count, _)| 0 < *count);
        let things: Vec<String> = there.map(|(count, name)| counted(*count, name)).collect();
        let subject = match things.as_slice() {
            [] => "the picture needs".to_owned(),
            [thing] if self.n_points + self.n_triangles == 1 => format!("{thing} needs"),
            things => format!("{} need", things.join(" and ")),
        };
        let (advice, key) = self.advice(limit).unzip();
        let line = format!(
            "{subject} about {} of memory ({} as read, {} {}, {} picture), and the limit is {}; \
             {}raise the limit",
            readable(all),
            readable(read),
            readable(prepared),
            if prepared == self.preparation() { "preparation" } else { "tree" },
            readable(picture),
            readable(limit),
            advice.unwrap_or_default(),
        );
        let keys: Vec<&str> = key.into_iter().chain(["memory_limit"]).collect();
        Err(Error::OutOfMemory(with_keys(&line, &keys)))
    }

    fn total(&self) -> u64 {
        sum(self.peak().map(|bytes| (bytes, 1)))
    }

    /// Advice that helps besides a higher limit, if there is any, with the key that it is about.
    fn advice(&self, limit: u64) -> Option<(String, &'static str)> {
        let least = Self { n_kept_points: 0, n_estimated_points: 0, ..*self }.total();
        let splat = if 0 < self.n_splats { MAX_GAUSSIAN_BYTES as u64 } else { 0 };
        let estimate = if 0 < self.n_estimated_points { ESTIMATED_POINT } else { 0 };
        let each = (5 * (self.flat_point + splat)).max(2 * estimate);
        let fitting = limit.saturating_sub(least) / each * 2;
        let [.., picture] = self.bytes();
        if 0 < fitting && fitting < self.n_kept_points {
            return Some((format!("keep fewer points, as random:{fitting}, or "), "subsample"));
        }
        if self.total() / 2 < picture {
            return Some(("make a smaller picture or ".into(), "resolution"));
        }
        None
    }
}

/// Returns true for a file of trained splats.
fn are_splats(info: &FileInfo) -> bool {
    let has_column = |name: &str| info.columns.iter().any(|column| column == name);
    GAUSSIAN_COLUMNS.into_iter().all(has_column)
}

/// Sum of counts times bytes; headers may claim any number.
fn sum(things: impl IntoIterator<Item = (u64, u64)>) -> u64 {
    let bytes = things.into_iter().map(|(count, each)| count.saturating_mul(each));
    bytes.fold(0, u64::saturating_add)
}

/// Returns the number of points that a file states, or that one of its size has about.
pub fn n_points(file: &Path, info: &FileInfo) -> u64 {
    let by_size = || std::fs::metadata(file).map_or(0, |data| data.len() / LINE);
    info.n_points.unwrap_or_else(by_size)
}

fn kept(n_points: u64, subsample: Option<Subsample>) -> u64 {
    match subsample {
        Some(Subsample::First(count) | Subsample::Random(count)) => n_points.min(count as u64),
        Some(Subsample::Stride(stride)) => (n_points as f64 / stride.max(1.0)) as u64,
        Some(Subsample::Spacing(_)) | None => n_points,
    }
}

#[cfg(test)]
mod tests {
    //! The advice fits the limit.

    use super::*;
    use surfel_core::math::Vec3;
    use surfel_core::scene::Material;

    const NOTHING: MemoryEstimate = MemoryEstimate {
        n_points: 0,
        n_kept_points: 0,
        n_estimated_points: 0,
        n_splats: 0,
        n_triangles: 0,
        n_texels: 0,
        picture: 0,
        flat_point: FLAT_POINT,
    };

    fn advice(
        n_points: u64,
        n_kept_points: u64,
        picture: u64,
        limit: u64,
    ) -> Option<(String, &'static str)> {
        let estimate = MemoryEstimate { n_points, n_kept_points, picture, ..NOTHING };
        assert!(limit < estimate.total());
        estimate.advice(limit)
    }

    #[test]
    fn the_advice_fits_the_limit() {
        let (n_points, limit) = (1_000_000, 60_000_000);
        let (text, key) = advice(n_points, n_points, 760_000, limit).unwrap();
        assert_eq!(key, "subsample");
        let n_kept_points = text.split(|c: char| !c.is_ascii_digit()).find(|word| !word.is_empty());
        let n_kept_points = n_kept_points.unwrap().parse().unwrap();
        let estimate = MemoryEstimate { n_points, n_kept_points, picture: 760_000, ..NOTHING };
        assert!(limit - 1000 < estimate.total() && estimate.total() <= limit, "{text}");
        // Fewer points do not reduce what is read.
        assert_eq!(advice(n_points, n_points, 760_000, 30_000_000), None);
        assert_eq!(advice(n_points, 16, 760_000, 30_000_000), None);
        assert_eq!(advice(64, 64, 19_000, 10_000).unwrap().1, "resolution");
    }

    #[test]
    fn estimates_of_columns_count_where_they_are_made() {
        let estimate = |surface: SurfaceKind, has_columns: bool| {
            let mut cloud = PointCloud::from_positions(vec![Vec3::X; 1000]);
            cloud.normals = has_columns.then(|| vec![Vec3::Z; 1000]);
            cloud.radii = has_columns.then(|| vec![1.0; 1000]);
            let graph = Graph::from_geometry(Geometry::Points(cloud), Material::MATTE);
            let mut description = SceneDescription::default();
            description.objects_default.surface.surface = Some(surface);
            MemoryEstimate::from_graph(&graph, None, 0).with_surfaces_of(&description)
        };
        let missing = estimate(SurfaceKind::Smooth, false);
        assert_eq!(missing.total(), 1000 * (COLUMNS + ESTIMATED_POINT));
        let text = missing.check(Some(100_000)).unwrap_err().to_string();
        assert!(text.contains("preparation, 0 B picture"), "{text}");
        for (surface, has_columns) in [(SurfaceKind::Smooth, true), (SurfaceKind::Points, false)] {
            let known = estimate(surface, has_columns);
            assert_eq!(known.total(), 1000 * COLUMNS + 1000 * FLAT_POINT / 2 * 5);
        }
    }

    #[test]
    fn trained_splats_take_the_bytes_of_all_their_columns() {
        let points = MemoryEstimate { n_points: 1000, n_kept_points: 1000, ..NOTHING };
        let splats = MemoryEstimate { n_splats: 1000, ..points };
        let [read, flat, _] = splats.bytes();
        let [read_of_points, flat_of_points, _] = points.bytes();
        assert_eq!(read - read_of_points, 1000 * 4 * 56);
        assert_eq!(flat - flat_of_points, 2500 * MAX_GAUSSIAN_BYTES as u64);
        let mut description = SceneDescription::default();
        description.objects_default.surface.surface = Some(SurfaceKind::Disc);
        assert_eq!(splats.with_surfaces_of(&description).n_splats, 0);
    }
}
