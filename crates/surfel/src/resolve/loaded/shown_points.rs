//! Points that show where everything is: what the choices of up, camera and lights are made from.

use super::LoadedScene;
use crate::description::SceneDescription;
use std::borrow::Cow;
use surfel_core::points::{
    Duplicates, MixedPixels, PointCloud, Preparation, Scalar, Subsample, Values, WITHHELD,
    select_points,
};
use surfel_core::progress::NoProgress;
use surfel_core::scene::color::{ColorSource, choose_source};
use surfel_core::scene::{Geometry, Graph, Mesh, PART};

/// Maximum number of points of a cloud that are looked at where some of them are dropped, or where it is of several files.
const MAX_SAMPLE: usize = 400_000;
/// Number of points of each of several files that has so many.
const MIN_OF_FILE: usize = 1000;

impl LoadedScene {
    /// Returns points that show where everything is that a description shows; where all of it is if it shows nothing.
    /// Points that are dropped before others are looked at are left out: those of noise, withheld ones, and all but the
    /// first of a subsample.
    pub(crate) fn shown_points(&self, description: &SceneDescription) -> Cow<'_, PointCloud> {
        let kept = |(i, geometry): (usize, &Geometry<PointCloud>)| match geometry {
            Geometry::Points(cloud) => self.sample_of_kept(i, cloud, description),
            Geometry::Triangles(_) => None,
        };
        let mut kept: Vec<Option<PointCloud>> =
            self.graph.geometries.iter().enumerate().map(kept).collect();
        if let Some(cloud) = self.single_cloud() {
            return kept[0].take().map_or(Cow::Borrowed(cloud), Cow::Owned);
        }
        let nodes = self.graph.nodes.clone();
        let mut reduced = Graph::<Cow<PointCloud>> { nodes, ..Graph::default() };
        for (node, is_visible) in self.visibility(&self.graph, description) {
            reduced.nodes[node].is_visible = is_visible;
        }
        let is_visible = reduced.visible_nodes();
        if kept.iter().any(Option::is_some) {
            let geometries = self.graph.geometries.iter().zip(kept);
            reduced.geometries = geometries.map(|(all, kept)| of_kept(all, kept)).collect();
        }
        let sample = |is_chosen: &[bool]| match reduced.geometries.is_empty() {
            true => self.graph.sample_points_of(is_chosen),
            false => reduced.sample_points_of(is_chosen),
        };
        let shown = sample(&is_visible);
        Cow::Owned(if shown.is_empty() { sample(&vec![true; is_visible.len()]) } else { shown })
    }

    /// Returns points that show where everything is.
    pub fn sample_points(&self) -> Cow<'_, PointCloud> {
        let single = self.single_cloud().map(Cow::Borrowed);
        single.unwrap_or_else(|| Cow::Owned(self.graph.sample_points()))
    }

    /// Returns the source of colours that suits the points of a cloud that its preparation keeps, and the reason for the choice.
    pub(crate) fn suitable_color(
        &self,
        geometry: usize,
        cloud: &PointCloud,
        description: &SceneDescription,
    ) -> (ColorSource, String) {
        match self.sample_of_kept(geometry, cloud, description) {
            Some(kept) => choose_source(&kept),
            None => choose_source(cloud),
        }
    }

    /// Returns a sample of the points of a cloud that its preparation keeps, in which a column tells several files apart;
    /// `None` for the cloud of one file of which it drops no points before it looks at their neighbours.
    fn sample_of_kept(
        &self,
        geometry: usize,
        cloud: &PointCloud,
        description: &SceneDescription,
    ) -> Option<PointCloud> {
        let settings = self.settings_of(geometry, description);
        let preparation = settings.preparation(description.picture.seed());
        let n_first = match preparation.subsample {
            Some(Subsample::First(n)) => n.min(cloud.len()),
            _ => cloud.len(),
        };
        let has_flags = cloud.classification.is_some() || cloud.scalar(WITHHELD).is_some();
        let ends = self.ends_in(geometry, cloud);
        if n_first == cloud.len() && !has_flags && ends.len() < 2 {
            return None;
        }
        let (mut sampled, mut parts) = (Vec::new(), Vec::new());
        let step = n_first.div_ceil(MAX_SAMPLE).max(1);
        for (part, end) in (0..).zip(&ends) {
            let start = ends[..part as usize].last().copied().unwrap_or(0);
            let finest = ((end - start) / MIN_OF_FILE).max(1);
            let points = (start..(*end).min(n_first)).step_by(step.min(finest));
            sampled.extend(points.map(|i| i as u32));
            parts.resize(sampled.len(), part);
        }
        let by_columns = Preparation {
            duplicates: Duplicates::Keep,
            mixed_pixels: MixedPixels::Keep,
            subsample: None,
            remove_outliers: None,
            ..preparation
        };
        let mut sample = cloud.subset(&sampled);
        if 1 < ends.len() {
            sample.scalars.push(Scalar { name: PART.to_owned(), values: Values::I32(parts) });
        }
        let (kept, report) = select_points(sample, &by_columns, &NoProgress).ok()?;
        let drops_some = n_first < cloud.len() || 0 < report.n_noise + report.n_withheld;
        ((drops_some || 1 < ends.len()) && !kept.is_empty()).then_some(kept)
    }

    /// Returns the number of points of a cloud up to the end of each of its files.
    fn ends_in(&self, geometry: usize, cloud: &PointCloud) -> Vec<usize> {
        let Some(ends) = self.file_ends.get(&geometry) else { return vec![cloud.len()] };
        // Points that are left have kept their order, and the indices that they had.
        let left = |end: &usize| match &cloud.source_indices {
            Some(indices) => indices.partition_point(|index| (*index as usize) < *end),
            None => *end,
        };
        ends.iter().map(left).collect()
    }
}

/// Returns a geometry with the points that are kept of a cloud, if some are not; of a mesh only what shows its place.
fn of_kept(all: &Geometry<PointCloud>, kept: Option<PointCloud>) -> Geometry<Cow<'_, PointCloud>> {
    match all {
        Geometry::Points(cloud) => Geometry::Points(kept.map_or(Cow::Borrowed(cloud), Cow::Owned)),
        Geometry::Triangles(mesh) => Geometry::Triangles(Mesh {
            origin: mesh.origin,
            positions: mesh.positions.clone(),
            triangles: mesh.triangles.clone(),
            ..Mesh::default()
        }),
    }
}

#[cfg(test)]
mod tests {
    //! Points that are dropped do not decide what the camera shows.

    use super::*;
    use crate::memory_files::MemoryContent;
    use crate::resolve::KeepOptions;
    use serde_json::{Value, json};
    use std::path::Path;
    use std::sync::Arc;
    use surfel_core::math::Vec3;
    use surfel_core::scene::inlier_bounds;

    /// Returns how far the shown points reach along X with some settings: of a plane 20 long, and behind it in the file one
    /// of low noise 100 away.
    fn reach(settings: &[(&str, Value)], beside_another: bool) -> f32 {
        let point = |i: u32| Vec3::new((i % 20) as f32, (i / 20 % 20) as f32, 0.0);
        let plane = (0..400).map(point);
        let noise = (0..400).map(|i| point(i) + 100.0 * Vec3::X);
        let mut cloud = PointCloud::from_positions(plane.chain(noise).collect());
        cloud.classification = Some((0..800).map(|i| if i < 400 { 2 } else { 7 }).collect());
        let other = PointCloud::from_positions((0..400).map(point).collect());
        let mut description = SceneDescription::default();
        for (name, cloud) in [("memory:a", cloud), ("memory:b", other)] {
            description.memory.insert(name, MemoryContent::Points(Arc::new(cloud), None));
        }
        description.files.push("memory:a".into());
        if beside_another {
            let table = json!({ "file": "memory:b" });
            description.add_object(table.as_object().unwrap(), Path::new("")).unwrap();
        }
        for (key, value) in settings {
            description.set(key, value, Path::new("")).unwrap();
        }
        let keep = KeepOptions { all_columns: true, ..KeepOptions::default() };
        let scene = LoadedScene::read(&description, keep, &NoProgress).unwrap();
        let shown = scene.shown_points(&description);
        let along = shown.positions.iter().map(|p| shown.origin.x as f32 + p.x);
        along.fold(f32::MIN, f32::max)
    }

    #[test]
    fn each_file_of_a_cloud_is_a_part_of_its_own() {
        let mut description = SceneDescription::default();
        for (name, n_points, x) in [("memory:a", 50_000, 0.0), ("memory:b", 81, 90.0)] {
            let point = |i: u32| Vec3::new(x + (i % 9) as f32, (i / 9 % 9) as f32, i as f32 * 1e-4);
            let cloud = PointCloud::from_positions((0..n_points).map(point).collect());
            description.memory.insert(name, MemoryContent::Points(Arc::new(cloud), None));
            description.files.push(name.into());
        }
        for filter in [None, Some("y > 3.5")] {
            if let Some(filter) = filter {
                description.set("filter", &json!(filter), Path::new("")).unwrap();
            }
            let keep = KeepOptions { all_columns: true, source_indices: true };
            let all = LoadedScene::read(&description, keep, &NoProgress).unwrap();
            let scene = all.filtered(&description, &NoProgress).unwrap();
            let shown = scene.shown_points(&description);
            let parts = shown.scalar(PART).unwrap();
            let is_second = |i: usize| 80.0 < shown.origin.x as f32 + shown.positions[i].x;
            let is_told = |i: usize| parts.get(i) == f64::from(u8::from(is_second(i)));
            assert!((0..shown.len()).all(is_told), "{filter:?}");
            assert!(20 < (0..shown.len()).filter(|i| is_second(*i)).count());
            let bounds = inlier_bounds(&shown);
            assert!(80.0 < bounds.size().x, "{bounds:?}");
        }
    }

    #[test]
    fn points_that_are_dropped_are_not_shown() {
        for beside_another in [false, true] {
            let reach = |settings: &[(&str, Value)]| reach(settings, beside_another);
            assert_eq!(reach(&[]), 19.0, "noise");
            assert_eq!(reach(&[("class", json!([2, 7]))]), 119.0);
            let first = ("subsample", json!("first:300"));
            assert_eq!(reach(&[("class", json!([2, 7])), first]), 19.0, "a subsample");
        }
    }
}
