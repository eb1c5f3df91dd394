//! Descriptions from tables: layers, patches, paths of errors, and that what is written reads back equal.

use super::*;
use serde_json::json;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::neighbors::{NeighborMethod, Neighborhood};
use surfel_core::points::{
    Denoise, Duplicates, MixedPixels, NoisePoints, Orientation, OutlierRemoval, Preparation,
    Radius, StructureChoice, Subsample,
};
use surfel_core::scene::color::ColorSource;
use surfel_core::scene::{Camera, Projection, Track};
use surfel_core::surface::{Align, GatherLimit, SurfaceKind, SurfaceOptions};

fn parse(text: &str) -> Result<SceneDescription, Invalid> {
    SceneDescription::parse(text, false, Path::new("/data"))
}

fn error(text: &str) -> String {
    parse(text).unwrap_err().to_string()
}

const SCENE: &str = r##"
resolution = "720x405"
background = "#4f7fb8,white"
material = ["matte", "ball=glass:ior=1.33"]
cmap = "viridis_r"
camera-position = [1, 2, 3.5]

[camera]
focal-point = "4,5,6"
orthographic = true

[sun]
azimuth = 190

[[object]]
file = "ball.ply"
name = "ball"
orient = "mst"
radius = 0.25
material = { kind = "glass", attenuation-color = "#bfe8d8", attenuation-distance = 2 }
translate = [562333.6, 4183200.4, 149.62]
rotate = { axis = [0, 0, 1], angle = 30 }
scale = 1.6
instances = [{ translate = [1, 0, 0] }, { rotate = [0, 0, 90], scale = [1, 2, 3] }]

[[lamp]]
position = [0, 0, 5]
color = "orange"

[[animation]]
object = "ball"
times = [0, 1.5]
rotate = [[0, 0, 0], { axis = [0, 1, 0], angle = 45 }]

[[animation]]
object = "camera"
kind = "orbit"
seconds = 6
"##;

#[test]
fn keys_are_read_in_all_spellings() {
    let scene = parse(SCENE).unwrap();
    assert_eq!(scene.picture.resolution, Some((720, 405)));
    assert_eq!(scene.camera.position.map(|p| p.to_array()), Some([1.0, 2.0, 3.5]));
    assert_eq!(scene.camera.focal_point.map(|p| p.to_array()), Some([4.0, 5.0, 6.0]));
    assert_eq!(scene.camera.orthographic, Some(OrthographicHeight::Fit));
    assert_eq!((scene.sun.azimuth, scene.sun.elevation()), (Some(190.0), 40.0));
    assert_eq!(scene.objects[0].files, [Path::new("/data/ball.ply")]);
    assert_eq!(scene.objects[0].instances.len(), 2);
    assert_eq!(scene.lamps[0].name.as_deref(), Some("lamp 1"));
    assert_eq!(scene.materials.choices().len(), 2);
}

#[test]
fn a_written_description_reads_back_equal() {
    let scene = parse(SCENE).unwrap();
    let table = scene.to_table();
    assert_eq!(SceneDescription::from_table(&table, Path::new("")).unwrap(), scene);
    let json = serde_json::to_string(&scene).unwrap();
    assert_eq!(serde_json::from_str::<SceneDescription>(&json).unwrap(), scene);
    let toml = toml::to_string(&scene).unwrap();
    assert_eq!(SceneDescription::parse(&toml, false, Path::new("")).unwrap(), scene);
}

#[test]
fn the_empty_description_writes_nothing() {
    assert!(SceneDescription::default().to_table().is_empty());
    assert!(SceneDescription::default().non_default().is_empty());
}

#[test]
fn keys_that_repeat_their_default_are_not_listed() {
    let scene = parse("spp = 4\nsurface = \"disc\"\n[sun]\nelevation = 41").unwrap();
    let listed = scene.non_default();
    assert_eq!(listed, [("surface".into(), json!("disc")), ("sun.elevation".into(), json!(41.0))]);
}

#[test]
fn an_overlay_overrides_keys_and_unsets_excluded_ones() {
    let mut scene =
        parse("spp = 9\nnormals-k = 12\n[camera]\ndirection = [0, 0, -1]\nposition = [1, 2, 3]")
            .unwrap();
    scene.overlay(
        parse("normals-radius = 0.5\n[camera]\nelevation-angle = 20\nzoom-factor = 2").unwrap(),
    );
    assert_eq!(scene.picture.spp(), 9);
    assert_eq!((scene.camera.direction, scene.camera.position), (None, None));
    let preparation = &scene.objects_default.preparation;
    assert_eq!((preparation.normals_k, preparation.normals_radius), (None, Some(0.5)));
}

#[test]
fn a_direction_over_a_scene_replaces_its_position_and_focal_point() {
    let view = "[camera]\nposition = [1, 2, 3]\nfocal-point = [4, 5, 6]\nview-up = [0, 1, 0]\nview-angle = 20";
    let turned = |scene: &str, over: &str| {
        let mut scene = parse(scene).unwrap();
        scene.overlay(parse(over).unwrap());
        assert_eq!(scene.check(), Ok(()), "{over}");
        scene.camera
    };
    for over in ["direction = [0, 0, -1]", "azimuth-angle = 0", "elevation-angle = 30"] {
        let camera = turned(view, &format!("[camera]\n{over}"));
        assert_eq!((camera.position, camera.focal_point, camera.view_up), (None, None, None));
        assert_eq!(camera.view_angle, Some(20.0));
    }
    // A position and a focal point replace a direction, too.
    for key in ["direction = [0, 0, -1]", "azimuth-angle = 30", "elevation-angle = 30"] {
        let camera = turned(&format!("[camera]\n{key}"), view);
        let angles = (camera.azimuth_angle, camera.elevation_angle);
        assert_eq!((camera.direction, angles), (None, (None, None)), "{key}");
        assert!(camera.focal_point.is_some() && camera.view_up.is_some());
    }
    let base = parse("camera.azimuth-angle = 30").unwrap();
    let options = parse(view).unwrap().to_options_over(&base);
    assert!(!options.iter().any(|option| option.contains("azimuth")), "{options:?}");
    // What the upper layer sets itself stays, and a position or a focal point alone leaves the direction open.
    let camera = turned(view, "[camera]\nazimuth-angle = 30\nposition = [7, 8, 9]");
    assert_eq!((camera.position.map(|p| p.x), camera.focal_point), (Some(7.0), None));
    for key in ["position", "focal-point"] {
        let scene = format!("[camera]\n{key} = [1, 2, 3]\nview-up = [0, 1, 0]");
        let camera = turned(&scene, "camera.azimuth-angle = 30");
        let kept = camera.position.or(camera.focal_point);
        assert_eq!((kept.map(|point| point.z), camera.view_up), (Some(3.0), Some(DVec3::Y)));
    }
}

#[test]
fn a_height_and_a_zoom_replace_each_other() {
    let [zoomed, of_height] =
        ["zoom-factor = 4", "orthographic = 5"].map(|text| format!("[camera]\n{text}"));
    assert!(error(&format!("{zoomed}\northographic = 5")).contains("does not change the height"));
    let overlaid = |below: &str, above: &str| {
        let mut scene = parse(below).unwrap();
        scene.overlay(parse(above).unwrap());
        assert_eq!(scene.check(), Ok(()));
        (scene.camera.zoom_factor, scene.camera.orthographic)
    };
    let height = Some(OrthographicHeight::Fixed(5.0));
    assert_eq!(overlaid(&zoomed, &of_height), (None, height));
    assert_eq!(overlaid(&of_height, &zoomed), (Some(4.0), Some(OrthographicHeight::Fit)));
    assert!(parse(&format!("{zoomed}\northographic = true")).is_ok());
    assert!(error("[camera]\northographic = true\nview-angle = 60").contains("excludes"));
}

#[test]
fn false_lies_over_what_a_scene_sets() {
    let mut scene = parse("[camera]\northographic = 12").unwrap();
    scene.overlay(parse("camera.orthographic = false").unwrap());
    assert_eq!(scene.camera.orthographic, Some(OrthographicHeight::Off));
    assert!(scene.camera.is_automatic());
}

#[test]
fn flags_that_are_false_unset_nothing() {
    let mut scene = parse("gsd = 0.1\n[camera]\ndirection = [1, 0, 0]").unwrap();
    scene.overlay(parse("camera.panorama = false\ncamera.orthographic = false").unwrap());
    assert_eq!((scene.plan.gsd, scene.camera.direction), (Some(0.1), Some(DVec3::X)));
    assert_eq!(scene.check(), Ok(()));
}

#[test]
fn options_over_a_scene_restore_defaults_that_it_changes() {
    let text = "spp = 64\nlegend = true\n[camera]\northographic = true\n[sun]\nelevation = 20";
    let base = parse(text).unwrap();
    let restored = ["--spp=4", "--legend=false", "--camera-orthographic=false"];
    let plain = parse("spp = 4").unwrap().to_options_over(&base);
    assert_eq!(plain, [&restored[..], &["--sun-elevation=40"]].concat());
    // The date says where the sun stands.
    let of_date = parse("[sun]\ndate = \"2026-06-21T15:00+02:00\"").unwrap();
    assert_eq!(of_date.to_options_over(&base)[1..], restored);
}

#[test]
fn dates_of_toml_need_no_quotes() {
    let date = |text: &str| parse(&format!("[sun]\ndate = {text}")).map(|scene| scene.sun.date);
    let quoted = date("\"2026-06-21T15:00+02:00\"").unwrap();
    assert_eq!(date("2026-06-21T15:00:00+02:00").unwrap(), quoted);
    assert_eq!(date("2026-06-21 15:00:00+02:00").unwrap(), quoted);
    let message = date("2026-06-21").unwrap_err().to_string();
    assert!(message.contains("2026-06-21") && message.contains("offset from UTC"), "{message}");
}

#[test]
fn a_named_device_demands_the_gpu() {
    let backend = |text: &str| parse(text).unwrap().run.chosen_backend();
    assert_eq!(backend("device = \"nvidia\""), Backend::Gpu);
    assert_eq!(backend("device = \"0\"\nbackend = \"auto\""), Backend::Auto);
    assert_eq!(backend(""), Backend::Auto);
    assert_eq!(
        error("device = \"0\"\nbackend = \"cpu\""),
        "device: names a GPU, and the backend is cpu; leave out one of them"
    );
    let mut scene = parse("device = \"0\"").unwrap();
    scene.overlay(parse("backend = \"cpu\"").unwrap());
    assert_eq!((scene.run.chosen_backend(), scene.check()), (Backend::Cpu, Ok(())));
    scene.overlay(parse("device = \"1\"").unwrap());
    assert_eq!(scene.run.chosen_backend(), Backend::Gpu);
}

#[test]
fn settings_of_an_object_override_those_of_the_scene() {
    let scene = parse("surface = \"sphere\"\nnormals-k = 12\n[[object]]\nfile = \"a.ply\"\nsurface = \"disc\"\nnormals-radius = 1").unwrap();
    let own = scene.objects[0].settings.over(&scene.objects_default);
    assert_eq!(own.surface.surface(), SurfaceKind::Disc);
    assert_eq!((own.preparation.normals_k, own.preparation.normals_radius), (None, Some(1.0)));
}

#[test]
fn keys_of_the_surface_are_its_options() {
    let options = |text: &str| parse(text).unwrap().objects_default.surface.options();
    assert_eq!(options(""), SurfaceOptions::default());
    let text = "align = \"nearest\"\ngather-limit = \"nearest\"\nmin-distance = 3\nreach = 1.5\n\
        density = 7\ndegree = 3";
    let expected = SurfaceOptions {
        align: Align::Nearest,
        gather_limit: GatherLimit::Nearest,
        min_distance: Some(3.0),
        reach: Some(1.5),
        density: 7,
        degree: 3,
    };
    assert_eq!(options(text), expected);
    let (of_scene, default) = (parse(text).unwrap(), SurfaceOptions::default());
    let own = parse("[[object]]\nfile = \"a.ply\"\nalign = \"each\"\nreach = 2").unwrap();
    let own = own.objects[0].settings.over(&of_scene.objects_default).surface.options();
    assert_eq!(own, SurfaceOptions { align: Align::Each, reach: Some(2.0), ..expected });
    // No value above is the default, which would hide that a key is not read.
    assert!(expected.align != default.align && expected.gather_limit != default.gather_limit);
    assert!(expected.density != default.density && expected.degree != default.degree);
}

#[test]
fn keys_of_the_preparation_are_its_settings() {
    let text = "duplicates = \"keep\"\nclass = [7]\nmixed-pixels = \"keep\"\nsubsample = \"first:9\"\n\
        noise-points = \"keep\"\n\
        remove-outliers = \"radius:2,5\"\ndenoise = \"off\"\nneighbors = \"grid\"\nnormals-k = 12\n\
        orient = \"up\"\nradius = 0.25\nstructure = \"scatter\"\nfree-space = false\n\
        color = \"surface_variation\"";
    let expected = Preparation {
        duplicates: Duplicates::Keep,
        kept_noise: vec![7],
        noise_points: NoisePoints::Keep,
        mixed_pixels: MixedPixels::Keep,
        subsample: Some(Subsample::First(9)),
        remove_outliers: Some(OutlierRemoval::Radius { radius: 2.0, count: 5 }),
        denoise: Denoise::Off,
        neighbors: NeighborMethod::Grid,
        normals: Neighborhood::Nearest(12),
        estimates_normals: true,
        orientation: Orientation::Up,
        radii_from_normals: false,
        radius: Radius::Fixed(0.25),
        structure: StructureChoice::Scatter,
        free_space: false,
        keep_variation: true,
        seed: 3,
    };
    let preparation = |text: &str| parse(text).unwrap().objects_default.preparation(3);
    assert_eq!(preparation(text), expected);
    let within = preparation(&text.replace("normals-k = 12", "normals-radius = 1.5"));
    assert_eq!(within, Preparation { normals: Neighborhood::Within(1.5), ..expected });
    let plain = Preparation { orientation: Orientation::Station, seed: 3, ..Default::default() };
    assert_eq!(preparation(""), plain);
}

#[test]
fn a_patch_sets_and_unsets_and_changes_nothing_when_it_fails() {
    let mut scene = parse("spp = 9\nsurface = \"disc\"").unwrap();
    let patch = json!({ "spp": null, "surface": "sphere", "sun": { "azimuth": 12 } });
    scene.merge(patch.as_object().unwrap()).unwrap();
    assert_eq!((scene.picture.spp, scene.sun.azimuth), (None, Some(12.0)));
    let before = scene.clone();
    let wrong = json!({ "spp": 3, "sun.elevation": "high" });
    let error = scene.merge(wrong.as_object().unwrap()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "sun.elevation: found \"high\", expected a number from -90 to 90"
    );
    assert_eq!(scene, before);
}

#[test]
fn errors_name_the_path_what_was_found_and_what_was_expected() {
    assert_eq!(
        error("[[object]]\nfile = \"a\"\n[[object]]\nfile = \"b\"\nmaterial = { ior = 9 }"),
        "object[1].material.ior: found 9, expected a number from 1 to 4"
    );
    assert_eq!(
        error("[camera]\nfocal-pont = [1, 2, 3]"),
        "camera.focal-pont: unknown key; the nearest known one is `camera.focal_point`"
    );
    assert_eq!(
        error("[[object]]\nfile = \"a\"\ntranslat = [1, 2, 3]"),
        "object[0].translat: unknown key; the nearest known one is `translate`"
    );
    assert_eq!(
        error("[camera]\nfov = 60"),
        "camera.fov: unknown key; here it is `camera.view_angle`"
    );
    assert_eq!(
        error("[[object]]\nfile = \"a\"\nscalars = \"z\""),
        "object[0].scalars: unknown key; here it is `color`"
    );
    assert_eq!(
        error("[[object]]\nfile = \"a\"\ninstances = [{}, { scale = 0 }]"),
        "object[0].instances[1].scale: the object would be flat, empty or infinite"
    );
    assert_eq!(
        error("surface = \"splatt\""),
        "surface: found \"splatt\", expected one of points, sphere, disc, splat-mean, splat, splat-fit, cylinder, mls, smooth, implicit, octree, octree-splat, gaussian; the nearest known one is `splat`"
    );
    assert_eq!(error("spp = 0"), "spp: found 0, expected a whole number from 1 to 65536");
    assert_eq!(error("spp = nan"), "spp: found nan or inf, expected a number");
    assert_eq!(
        error("[[object]]\nfile = \"a\"\ntranslate = [1, 2, inf]"),
        "object[0].translate[2]: found nan or inf, expected a number"
    );
    assert_eq!(
        error("[[object]]\nfile = \"a\"\nmaterial = { kind = \"glass\", iro = 1.3 }"),
        "object[0].material.iro: unknown key; the nearest known one is `ior`"
    );
    assert_eq!(
        error("spp = "),
        "line 1, column 7: string values must be quoted, expected literal string"
    );
    assert_eq!(
        error("[camera]\npanorama = true\nview-angle = 30"),
        "camera.panorama: excludes camera.view_angle; leave out one of them"
    );
    assert_eq!(
        error("[[object]]\nname = \"x\""),
        "object[0].file: expected `file = \"name\"`, or `files` with several names or a `*`"
    );
    assert_eq!(
        error(
            "[[animation]]\nobject = \"bal\"\nkind = \"orbit\"\nseconds = 1\n[[object]]\nfile = \"ball.ply\""
        ),
        "animation[0].object: no object `bal`; the nearest known one is `ball`"
    );
    assert_eq!(
        error("[[animation]]\nobject = \"camera\"\nkind = \"orbit\""),
        "animation[0].seconds: is missing; expected a duration"
    );
    assert_eq!(
        error("[[lamp]]\nkind = \"spot\""),
        "lamp[0].position: is missing; expected [x, y, z]"
    );
}

#[test]
fn every_key_has_a_unique_option_and_a_sentence_of_help() {
    let keys = SceneDescription::keys();
    let mut options: Vec<String> = keys.iter().map(|(path, ..)| option_name(path)).collect();
    let n_options = options.len();
    options.sort();
    options.dedup();
    assert_eq!(options.len(), n_options);
    for (path, _, key) in &keys {
        assert!(key.doc.ends_with(['.', ']']) && 10 < key.doc.len(), "{path}: {}", key.doc);
    }
}

#[test]
fn the_help_of_colors_lists_every_source() {
    let names = ColorSource::names_where(|_| true).join(", ");
    let keys = SceneDescription::keys();
    let mut of_colors = keys.iter().filter(|(path, ..)| path == "color");
    assert!(of_colors.all(|(.., key)| key.doc.contains(&names)));
    assert!(keys.iter().any(|(path, ..)| path == "color"));
}

/// Returns the motion of the camera by the first animation of a text.
fn camera_motion(text: &str) -> CameraMotion {
    let mut motion = CameraMotion::default();
    parse(text).unwrap().animations[0].camera_motion(&mut motion).unwrap();
    motion
}

#[test]
fn keys_of_the_camera_change_its_projection() {
    let text = "[[animation]]\nobject = \"camera\"\ntimes = [0, 2]\nview-angle = [30, 60]\northographic = [4, 8]\nview-up = [[0, 0, 1], [0, 1, 1]]";
    let motion = camera_motion(text);
    assert_eq!(motion.duration_secs(), 2.0);
    let at = |projection| {
        let (position, focal_point) = (DVec3::ZERO, DVec3::Y);
        let camera = Camera { position, focal_point, view_up: DVec3::Z, projection };
        motion.at(1.0, camera, Vec3::Z)
    };
    let perspective = at(Projection::Perspective { view_angle_deg: 20.0 });
    assert_eq!(perspective.projection, Projection::Perspective { view_angle_deg: 45.0 });
    assert_eq!(perspective.view_up, DVec3::new(0.0, 0.5, 1.0));
    let flat = at(Projection::Orthographic { height: 1.0 });
    assert_eq!(flat.projection, Projection::Orthographic { height: 6.0 });
    let wrong = text.replace("[30, 60]", "[30, 180]");
    assert!(error(&wrong).contains("angles"), "{}", error(&wrong));
}

/// Returns the angles about z in degrees, from 0 to 360, of an object with these lines of keys at times.
fn angles_at(keys: &str, times_secs: &[f64]) -> Vec<f64> {
    let object = "[[object]]\nfile = \"ball.ply\"\nname = \"ball\"";
    let scene = parse(&format!("{object}\n[[animation]]\nobject = \"ball\"\n{keys}")).unwrap();
    let motion = scene.animations[0].object_motion().unwrap();
    let Track::Rotation(keys) = &motion.tracks[0] else { panic!("no rotation") };
    let at = |time: &f64| {
        let turned = keys.at(*time) * DVec3::X;
        turned.y.atan2(turned.x).to_degrees().round().rem_euclid(360.0)
    };
    times_secs.iter().map(at).collect()
}

#[test]
fn rotations_by_half_a_turn_and_more_turn_as_their_angles_say() {
    let whole = "times = [0, 4]\nrotate = [[0, 0, 0], [0, 0, 360]]";
    let times = [0.0, 0.5, 1.0, 3.0, 4.0, 9.0];
    assert_eq!(angles_at(whole, &times), [0.0, 45.0, 90.0, 270.0, 0.0, 0.0]);
    let about_axis = "times = [0, 4]\nrotate = [{ axis = [0, 0, 2], angle = 0 }, { axis = [0, 0, 1], angle = -270 }]";
    assert_eq!(angles_at(about_axis, &[2.0, 4.0]), [225.0, 90.0]);
    // Less than half a turn takes the shorter way, also beside others.
    let mixed = "times = [0, 1, 2]\nrotate = [[0, 0, 0], [0, 0, 90], [0, 0, 270]]";
    assert_eq!(angles_at(mixed, &[0.5, 1.0, 1.5]), [45.0, 90.0, 180.0]);
    let eased = format!("{whole}\ninterpolation = \"ease\"");
    assert_eq!(angles_at(&eased, &[0.0, 1.0, 2.0]), [0.0, 56.0, 180.0]);
    let stepped = format!("{whole}\ninterpolation = \"step\"");
    assert_eq!(angles_at(&stepped, &[1.0, 3.9]), [0.0, 0.0]);
    let endless =
        "[[animation]]\nobject = \"a\"\ntimes = [0, 1]\nrotate = [[0, 0, 0], [0, 0, 1e9]]";
    assert!(error(endless).contains("expected at most 360000"), "{}", error(endless));
}

#[test]
fn the_camera_stays_where_its_orbit_ends() {
    let text = "[[animation]]\nobject = \"camera\"\nkind = \"orbit\"\nseconds = 4\nturns = 0.25";
    let motion = camera_motion(text);
    let projection = Projection::Perspective { view_angle_deg: 20.0 };
    let position_at = |time_secs: f64| {
        let (position, focal_point) = (DVec3::X, DVec3::ZERO);
        let camera = Camera { position, focal_point, view_up: DVec3::Z, projection };
        motion.at(time_secs, camera, Vec3::Z).position
    };
    assert!(position_at(4.0).distance(DVec3::Y) < 1e-9);
    assert_eq!(position_at(6.0), position_at(4.0));
    assert_eq!(position_at(-1.0), position_at(0.0));
}
