//! What memory a picture takes, and the limit that the user may set.

use crate::args::Global;
use anyhow::bail;
use std::collections::BTreeMap;
use std::path::Path;
use surfel::flat::PointBlock;
use surfel::math::LANES;
use surfel::points::Select;
use surfel::scene::Graph;
use surfel_formats::Source;

/// What is known of a picture before it is made.
pub struct Plan {
    n_points: u64,
    n_selected: u64,
    n_triangles: u64,
    n_texels: u64,
    n_pixels: u64,
}

/// Position, normal, radius, colour and intensity as they are loaded or made.
const COLUMNS: u64 = 12 + 12 + 4 + 6 + 4;
/// Corners of a triangle, with position, normal and texture coordinates of about a vertex, as loaded.
const TRIANGLE: u64 = 12 + 12 + 12 + 8;
/// Tree, block and index of a point.
const FLAT_POINT: u64 = (size_of::<PointBlock>() / LANES + size_of::<u32>()) as u64 + 5;
/// Tree and corners of a triangle.
const FLAT_TRIANGLE: u64 = 42;
const TEXEL: u64 = 4;
/// A pixel with all its layers.
const PIXEL: u64 = 16 + 52;
/// Bytes of an average line of text, where a file does not tell how many there are.
const LINE: u64 = 30;

impl Plan {
    /// From the headers of files, without reading their points.
    pub fn new(sources: &BTreeMap<&Path, Source>, select: Option<Select>, n_pixels: u64) -> Self {
        let clouds = sources.iter().filter(|(_, source)| source.n_triangles.is_none());
        let n_points = sum(clouds.map(|(file, source)| (n_points(file, source), 1)));
        let triangles = sources.values().filter_map(|source| source.n_triangles);
        let n_triangles = sum(triangles.map(|n| (n, 1)));
        let n_selected = selected(n_points, select);
        Self { n_points, n_selected, n_triangles, n_texels: 0, n_pixels }
    }

    /// From what was read, where textures are known, too.
    pub fn of(graph: &Graph, select: Option<Select>, n_pixels: u64) -> Self {
        let (n_points, n_triangles) = graph.counts();
        let (n_points, n_triangles) = (n_points as u64, n_triangles as u64);
        let n_texels = graph.textures.iter().map(|texture| texture.texels.len() as u64).sum();
        let n_selected = selected(n_points, select);
        Self { n_points, n_selected, n_triangles, n_texels, n_pixels }
    }

    /// What was read, flat form and what building it takes beside, picture.
    fn bytes(&self) -> [u64; 3] {
        let meshes = sum([(self.n_triangles, TRIANGLE), (self.n_texels, TEXEL)]);
        let read = sum([(self.n_points, COLUMNS), (meshes, 1)]);
        let trees = sum([(self.n_selected, FLAT_POINT), (self.n_triangles, FLAT_TRIANGLE)]);
        // Vertices and textures stand in the flat form as they were read.
        let flat = sum([(trees / 2, 5), (meshes, 1)]);
        [read, flat, sum([(self.n_pixels, PIXEL)])]
    }

    pub fn check(&self, global: &Global) -> anyhow::Result<()> {
        let Some(limit) = global.memory_limit else { return Ok(()) };
        let ([read, flat, picture], all) = (self.bytes(), self.total());
        if limit < all {
            let things = [(self.n_points, "points"), (self.n_triangles, "triangles")];
            let there = things.iter().filter(|(count, _)| 0 < *count);
            let things: Vec<String> =
                there.map(|(count, name)| format!("{count} {name}")).collect();
            bail!(
                "{} need about {} of memory ({} as read, {} tree, {} picture), and \
                 --memory-limit is {}; {}raise the limit",
                things.join(" and "),
                readable(all),
                readable(read),
                readable(flat),
                readable(picture),
                readable(limit),
                self.advice(limit),
            );
        }
        Ok(())
    }

    fn total(&self) -> u64 {
        sum(self.bytes().map(|bytes| (bytes, 1)))
    }

    /// What helps beside a higher limit, if anything does.
    fn advice(&self, limit: u64) -> String {
        let least = Self { n_selected: 0, ..*self }.total();
        let fitting = limit.saturating_sub(least) / 5 * 2 / FLAT_POINT;
        let [.., picture] = self.bytes();
        if 0 < fitting && fitting < self.n_selected {
            return format!("take fewer points with --select random:{fitting} or ");
        }
        if self.total() / 2 < picture {
            return "make a smaller picture with --resolution or ".into();
        }
        String::new()
    }
}

/// So many things of so many bytes each; headers may claim any number.
fn sum(things: impl IntoIterator<Item = (u64, u64)>) -> u64 {
    let bytes = things.into_iter().map(|(count, each)| count.saturating_mul(each));
    bytes.fold(0, u64::saturating_add)
}

/// What a file says, or about what one of its size has.
pub fn n_points(file: &Path, source: &Source) -> u64 {
    let by_size = || std::fs::metadata(file).map_or(0, |data| data.len() / LINE);
    source.n_points.unwrap_or_else(by_size)
}

fn selected(n_points: u64, select: Option<Select>) -> u64 {
    match select {
        Some(Select::First(count) | Select::Random(count)) => n_points.min(count as u64),
        Some(Select::Stride(stride)) => (n_points as f64 / stride.max(1.0)) as u64,
        Some(Select::Spacing(_)) | None => n_points,
    }
}

/// Bytes in the largest unit that leaves a number above one.
pub fn readable(bytes: u64) -> String {
    let units = ["B", "KB", "MB", "GB", "TB"];
    let power = (bytes.max(1).ilog2() / 10).min(4);
    let value = bytes as f64 / 1024f64.powi(power as i32);
    let digits = usize::from(0 < power);
    format!("{value:.digits$} {}", units[power as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn advice(n_points: u64, n_selected: u64, n_pixels: u64, limit: u64) -> String {
        let plan = Plan { n_points, n_selected, n_triangles: 0, n_texels: 0, n_pixels };
        assert!(limit < plan.total());
        plan.advice(limit)
    }

    #[test]
    fn what_is_advised_helps() {
        let (n_points, limit) = (1_000_000, 60_000_000);
        let told = advice(n_points, n_points, 10_000, limit);
        let n_selected = told.split(|c: char| !c.is_ascii_digit()).find(|word| !word.is_empty());
        let n_selected = n_selected.unwrap().parse().unwrap();
        let plan = Plan { n_points, n_selected, n_triangles: 0, n_texels: 0, n_pixels: 10_000 };
        assert!(limit - 1000 < plan.total() && plan.total() <= limit, "{told}");
        // What is read stays, however few are selected of it.
        assert_eq!(advice(n_points, n_points, 10_000, 30_000_000), "");
        assert_eq!(advice(n_points, 16, 10_000, 30_000_000), "");
        assert!(advice(64, 64, 250, 10_000).contains("--resolution"));
    }
}
