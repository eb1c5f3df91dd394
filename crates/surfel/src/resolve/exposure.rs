//! Automatic exposure: a small preview shows how bright the median and the highlights of the scene are, or how much light
//! falls on it where a legend explains the colours.

use super::plan::WholePlan;
use std::borrow::Cow;
use surfel_core::flat::{FlatGeometry, FlatScene, Instance};
use surfel_core::image::{Aovs, Image};
use surfel_core::math::{median, quantile};
use surfel_core::progress::Progress;
use surfel_core::render::{Renderer, Settings};
use surfel_core::surface::SurfaceKind;

/// Linear value of the highlights: sRGB 91 %, which leaves white roofs and foreheads their shape.
const HIGHLIGHT_TARGET: f32 = 0.8;

/// Linear value below which the median is too dark: sRGB 42 %.
const MIN_MEDIAN: f32 = 0.15;

/// Greatest factor by which highlights exceed their target to brighten a dark median.
const MAX_EXCESS: f32 = 1.4;

/// Fraction of the covered pixels that stay below white where a dark median is brightened.
const UNCLIPPED_PERCENTILE: f64 = 0.98;

/// Fraction of the covered pixels that are darker than the highlights.
const HIGHLIGHT_PERCENTILE: f64 = 0.99;

/// Fraction of the covered pixels that are at most as bright as their colour where a legend explains it. On fields these are
/// as bright as their colour; the sunny sides of trees, which turn to the sun more than the ground, are a little brighter.
const LEVEL_PERCENTILE: f64 = 0.9;

/// Least and greatest number of stops: a black object must not turn white.
const LIMITS: (f32, f32) = (-1.0, 2.2);

/// Width of the preview in pixels.
const WIDTH: u32 = 200;

/// The choices of an automatic exposure: the view that is metered, and the brightness that is aimed at.
#[derive(Clone, Debug, Default)]
pub struct Metering {
    /// The whole of a plan, which is metered in place of the picture: that may be one of several sheets.
    pub plan: Option<WholePlan>,
    /// True if a legend explains the colours. A surface in the light then shows its own.
    pub has_legend: bool,
}

/// Returns the stops by which the lights of `scene` are too dark on what they light.
pub fn automatic_exposure(
    renderer: &dyn Renderer,
    scene: &FlatScene,
    settings: &Settings,
    metering: &Metering,
    progress: &dyn Progress,
) -> surfel_core::Result<f32> {
    let (scene, aspect) = match metering.plan {
        Some(WholePlan { camera, size: [width, height] }) => {
            let mut whole = scene.clone();
            whole.camera = camera;
            (Cow::Owned(whole), height / width)
        }
        None => (Cow::Borrowed(scene), f64::from(settings.height) / f64::from(settings.width)),
    };
    let is_unlit: Vec<bool> = scene.instances.iter().map(|it| !is_lit(&scene, it)).collect();
    let preview = Settings {
        width: WIDTH,
        height: (f64::from(WIDTH) * aspect).clamp(1.0, 4.0 * f64::from(WIDTH)) as u32,
        samples_per_pixel: 1,
        with_aovs: is_unlit.contains(&true) || metering.has_legend,
        ..*settings
    };
    let (image, _) = renderer.render(&scene, &preview, progress)?;
    let instances = image.aovs.as_ref().map(|aovs| &aovs.instance_id[..]);
    let shows_unlit = |pixel: usize| {
        let instance = instances.map(|instances| instances[pixel] as usize);
        instance.and_then(|instance| is_unlit.get(instance)).is_some_and(|is_unlit| *is_unlit)
    };
    let metered =
        (0..image.color.len()).filter(|pixel| 0.0 < image.coverage[*pixel] && !shows_unlit(*pixel));
    match image.aovs.as_ref().filter(|_| metering.has_legend) {
        Some(aovs) => Ok(stops_to_own_color(metered.filter_map(|i| light_at(&image, aovs, i)))),
        // The strongest channel, not luminance: a meadow whose green is cut off turns to neon.
        None => Ok(stops(metered.map(|i| strongest_channel(image.color[i])).collect())),
    }
}

fn strongest_channel([r, g, b, _]: [f32; 4]) -> f32 {
    r.max(g).max(b)
}

/// Returns how much brighter a pixel is than the colour of the surface that it shows; `None` for black ones.
fn light_at(image: &Image, aovs: &Aovs, pixel: usize) -> Option<f32> {
    let own = aovs.albedo[pixel].max_element();
    (0.0 < own).then(|| strongest_channel(image.color[pixel]) / own)
}

/// Returns true if the lights change how bright an instance is. Trained Gaussians, unlit materials, and points as pixels
/// without normals have a brightness of their own.
fn is_lit(scene: &FlatScene, instance: &Instance) -> bool {
    let has_sides = match scene.geometry(instance) {
        FlatGeometry::Cloud(cloud) => cloud.surface != SurfaceKind::Points || cloud.has_normals,
        FlatGeometry::Mesh(_) => true,
    };
    let is_unlit = scene.materials[instance.material_idx as usize].is_unlit;
    has_sides && !instance.is_gaussian && !is_unlit
}

/// Returns the stops that make surfaces in the light as bright as their colours, of how much brighter pixels are.
fn stops_to_own_color(lights: impl Iterator<Item = f32>) -> f32 {
    let level = quantile(lights, LEVEL_PERCENTILE).unwrap_or(1.0);
    (-level.max(1e-6).log2()).clamp(LIMITS.0, LIMITS.1)
}

fn stops(values: Vec<f32>) -> f32 {
    let Some(highlights) = quantile(values.iter().copied(), HIGHLIGHT_PERCENTILE) else {
        return 0.0;
    };
    let unclipped = quantile(values.iter().copied(), UNCLIPPED_PERCENTILE).unwrap_or(highlights);
    let for_highlights = HIGHLIGHT_TARGET / highlights.max(1e-6);
    let for_unclipped = 1.0 / unclipped.max(1e-6);
    let for_median = MIN_MEDIAN / median(values).map_or(1e-6, |median| median.max(1e-6));
    let gain = for_highlights.max(for_median.min(MAX_EXCESS * for_highlights).min(for_unclipped));
    gain.log2().clamp(LIMITS.0, LIMITS.1)
}

#[cfg(test)]
mod tests {
    //! The stops for known pictures.

    use super::*;
    use crate::description::SceneDescription;
    use crate::memory_files::MemoryContent;
    use crate::resolve::resolve;
    use serde_json::json;
    use std::path::Path;
    use std::sync::Arc;
    use surfel_core::image::encode_srgb8;
    use surfel_core::math::Vec3;
    use surfel_core::points::PointCloud;
    use surfel_core::progress::NoProgress;

    /// Returns what is said about the exposure of a dark square with some settings, beside a bright one of the material unlit
    /// or alone.
    fn exposure_line(settings: &[(&str, &str)], has_bright: bool) -> String {
        let square = |brightness: u16| {
            let corner = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0);
            let mut cloud = PointCloud::from_positions((0..400).map(corner).collect());
            cloud.colors = Some(vec![[brightness; 3]; 400]);
            MemoryContent::Points(Arc::new(cloud), None)
        };
        let mut description = SceneDescription::default();
        description.memory.insert("memory:dark", square(0x4000));
        description.memory.insert("memory:bright", square(0xffff));
        let dark = json!({ "file": "memory:dark" });
        let bright =
            json!({ "file": "memory:bright", "material": "unlit", "translate": [22, 0, 0] });
        for table in [Some(dark), has_bright.then_some(bright)].into_iter().flatten() {
            description.add_object(table.as_object().unwrap(), Path::new("")).unwrap();
        }
        for (key, value) in [("resolution", "64x36"), ("gamma", "1")].iter().chain(settings) {
            description.set(key, &json!(value), Path::new("")).unwrap();
        }
        let scene = resolve(&description, &NoProgress).unwrap().build(&NoProgress).unwrap();
        let lines = scene.choices().iter().map(|choice| choice.reason.clone());
        lines.filter(|line| line.starts_with("exposure")).collect()
    }

    #[test]
    fn what_lights_do_not_change_does_not_decide_about_their_strength() {
        let unlit = [("material", "unlit")];
        assert_eq!(exposure_line(&unlit, false), "exposure +0.00 stops");
        let pixels = [("surface", "points"), ("background", "environment")];
        assert_eq!(exposure_line(&pixels, false), "exposure +0.00 stops");
        let stops = |has_bright: bool| {
            let line = exposure_line(&[], has_bright);
            line.split(' ').nth(1).unwrap().parse::<f32>().unwrap()
        };
        let (alone, beside) = (stops(false), stops(true));
        assert!(1.0 < alone && (alone - beside).abs() < 0.3, "{alone} {beside}");
    }

    #[test]
    fn a_level_surface_shows_the_color_of_the_legend() {
        let corner = |i: u32| Vec3::new((i % 40) as f32, (i / 40) as f32, 0.0);
        let mut cloud = PointCloud::from_positions((0..1600).map(corner).collect());
        cloud.classification = Some(vec![2; 1600]);
        let cloud = Arc::new(cloud);
        let color = |settings: &[(&str, &str)]| {
            let mut description = SceneDescription::of_files(["memory:field"]);
            description.memory.insert("memory:field", MemoryContent::Points(cloud.clone(), None));
            let plan = [("color", "class"), ("gsd", "1"), ("resolution", "16x16")];
            for (key, value) in plan.iter().chain(settings) {
                description.set(key, &json!(value), Path::new("")).unwrap();
            }
            let scene = resolve(&description, &NoProgress).unwrap().build(&NoProgress).unwrap();
            let image = scene.render().unwrap();
            let [r, g, b, _] = image.color[8 * 16 + 8];
            [r, g, b].map(encode_srgb8)
        };
        // The colour of ground, under the usual lights and under weak ones.
        let differs =
            |found: [u8; 3]| found.iter().zip([161, 82, 46]).any(|(a, b)| 4 < a.abs_diff(b));
        for weak in [&[][..], &[("sun.strength", "0.4"), ("sky.strength", "0.4")]] {
            let found = color(weak);
            assert!(!differs(found), "{found:?}");
        }
        let found = color(&[("exposure", "1")]);
        assert!(differs(found), "{found:?}");
    }

    #[test]
    fn sheets_of_one_plan_have_one_exposure() {
        // A bright half and a dark one, each on a sheet.
        let corner = |i: u32| Vec3::new((i % 40) as f32, (i / 40) as f32, 0.0);
        let mut cloud = PointCloud::from_positions((0..1600).map(corner).collect());
        cloud.colors =
            Some((0..1600).map(|i| [if i % 40 < 20 { 0xe000 } else { 0x3000 }; 3]).collect());
        let cloud = Arc::new(cloud);
        let line = |resolution: &str, middle: [f64; 3]| {
            let mut description = SceneDescription::of_files(["memory:field"]);
            description.memory.insert("memory:field", MemoryContent::Points(cloud.clone(), None));
            for (key, value) in [("gsd", json!(1)), ("resolution", json!(resolution))] {
                description.set(key, &value, Path::new("")).unwrap();
            }
            description.set("camera.focal_point", &json!(middle), Path::new("")).unwrap();
            let scene = resolve(&description, &NoProgress).unwrap().build(&NoProgress).unwrap();
            let lines = scene.choices().iter().map(|choice| choice.reason.clone());
            lines.filter(|line| line.starts_with("exposure")).collect::<String>()
        };
        let bright = line("18x30", [9.0, 20.0, 0.0]);
        assert_eq!(bright, line("18x20", [30.0, 20.0, 0.0]));
        assert_eq!(bright, line("40x40", [20.0, 20.0, 0.0]));
    }

    #[test]
    fn stops_bring_the_highlights_to_the_target() {
        assert_eq!(stops(vec![]), 0.0);
        assert_eq!(stops(vec![HIGHLIGHT_TARGET / 2.0; 50]), 1.0);
        assert_eq!((stops(vec![0.0; 50]), stops(vec![9.0; 50])), (LIMITS.1, LIMITS.0));
        let mut with_glint = vec![HIGHLIGHT_TARGET / 2.0; 199];
        with_glint.push(100.0);
        assert_eq!(stops(with_glint), 1.0);
    }

    #[test]
    fn a_dark_median_brightens_the_picture_by_half_a_stop_at_most() {
        let stops_of = |median: f32| {
            let mut values = vec![median; 985];
            values.extend([HIGHLIGHT_TARGET; 15]);
            stops(values)
        };
        assert_eq!(stops_of(MIN_MEDIAN), 0.0);
        assert!((stops_of(MIN_MEDIAN / 1.2) - 1.2f32.log2()).abs() < 1e-4);
        assert!((stops_of(0.01) - MAX_EXCESS.log2()).abs() < 1e-4);
    }

    #[test]
    fn a_dark_median_does_not_turn_more_than_a_fiftieth_of_the_picture_white() {
        let mut values = vec![0.01; 900];
        values.extend([HIGHLIGHT_TARGET; 100]);
        assert!((stops(values) - (1.0 / HIGHLIGHT_TARGET).log2()).abs() < 1e-4);
    }
}
