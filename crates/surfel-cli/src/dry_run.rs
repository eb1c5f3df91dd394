//! What `--dry-run` tells: every choice, resolved, as a scene file that makes the same picture.

use crate::args::{Exposure, SceneArgs};
use crate::assemble::Assembly;
use crate::picture::Choices;
use crate::render::Args;
use crate::scene_file::{Line, is_scene_file};
use serde_json::{Map, Value, json};
use std::path::{Path, absolute};
use surfel::math::Vec3;
use surfel::scene::color::choose;
use surfel::scene::{Background, Light, Projection, Sun};
use surfel::trace::Simd;

pub fn resolved(assembly: &Assembly, choices: &Choices, args: &Args, line: &Line) -> String {
    let mut scene = scene(assembly, choices, &args.scene, line);
    scene["output"] = json!(args.output);
    scene["time"] = json!(args.time);
    format!("{scene:#}")
}

/// All that decides what a picture shows.
pub fn scene(assembly: &Assembly, choices: &Choices, args: &SceneArgs, line: &Line) -> Value {
    let chosen = || assembly.clouds().next().map(|(cloud, _)| choose(cloud).0);
    let color = args.color.color.clone().or_else(chosen);
    let (n_points, n_triangles) = assembly.graph.counts();
    let preparation = args.preparation.preparation(args.picture.seed, args.color.color.as_ref());
    let (width, height) = args.picture.resolution;
    let mut scene = json!({
        "resolution": format!("{width}x{height}"),
        "spp": args.picture.spp,
        "samples": args.picture.samples,
        "seed": args.picture.seed,
        "max_depth": args.material.max_depth,
        "bit_depth": args.picture.bit_depth,
        "surface": args.surface.surface.name(),
        "boundary": format!("{:?}", args.surface.boundary).to_lowercase(),
        "up": choices.up.to_array(),
        "camera": camera(choices),
        "exposure": match args.light.exposure {
            Exposure::Auto => json!("auto"),
            Exposure::Stops(stops) => json!(stops),
        },
        "background": background(args.color.background()),
    });
    if let Some(color) = color {
        scene["color"] = json!(color.to_string());
    }
    add_lights(&mut scene, choices, args);
    let objects = file_objects(args).chain(line.scene.raw_objects().iter().cloned());
    scene["object"] = Value::Array(objects.collect());
    for (key, tables) in line.scene.raw_others() {
        scene[key] = Value::Array(tables.clone());
    }
    scene["info"] = json!({
        "points": n_points,
        "triangles": n_triangles,
        "preparation": format!("{preparation:?}"),
        "threads": rayon::current_num_threads(),
        "simd": Simd::detect().name(),
        "backend": "cpu",
    });
    scene
}

/// The command line's files as objects.
fn file_objects(args: &SceneArgs) -> impl Iterator<Item = Value> {
    args.files.iter().filter(|file| !is_scene_file(file)).map(|file| {
        let mut object = json!({ "file": in_full(file) });
        if let Some((kind, properties)) = args.material.words_of(file) {
            let mut material = Map::new();
            material.insert("kind".into(), json!(kind));
            material.extend(properties.into_iter().map(|(name, value)| (name, json!(value))));
            object["material"] = Value::Object(material);
        }
        object
    })
}

/// From the root, so that the scene may lie anywhere.
pub fn in_full(file: &Path) -> String {
    absolute(file).unwrap_or_else(|_| file.to_owned()).display().to_string()
}

fn camera(choices: &Choices) -> Value {
    let camera = &choices.camera;
    let (name, value) = match camera.projection {
        Projection::Perspective { view_angle_deg } => ("view_angle", json!(view_angle_deg)),
        Projection::Orthographic { height } => ("orthographic", json!(height)),
        Projection::Panorama => ("panorama", json!(true)),
    };
    json!({
        "position": camera.position.to_array(),
        "focal_point": camera.focal_point.to_array(),
        "view_up": camera.view_up.to_array(),
        name: value,
    })
}

fn background(background: Background) -> Value {
    let hex = |color: Vec3| {
        let byte = |value: f32| (255.0 * surfel::image::encode_srgb(value)).round() as u8;
        let [r, g, b] = color.to_array().map(byte);
        format!("#{r:02x}{g:02x}{b:02x}")
    };
    match background {
        Background::Transparent => json!("transparent"),
        Background::Surroundings => json!("surroundings"),
        Background::Gradient { top, bottom } => json!([hex(top), hex(bottom)]),
    }
}

fn add_lights(scene: &mut Value, choices: &Choices, args: &SceneArgs) {
    let mut kinds = Vec::new();
    for light in &choices.lights {
        match light {
            Light::Sun(sun) => {
                let (azimuth, elevation) = sun_angles(sun, choices.up);
                kinds.push("sun");
                scene["sun"] = json!({
                    "azimuth": azimuth,
                    "elevation": elevation,
                    "angle": args.light.sun_angle,
                    "strength": args.light.sun_strength,
                });
            }
            Light::Sky(sky) => {
                kinds.push("sky");
                scene["sky"] = json!({ "reach": sky.reach, "strength": args.light.sky_strength });
            }
            Light::Environment(_) => {
                scene["environment"] = json!(args.light.environment.as_deref().map(in_full));
                scene["environment_rotation"] = json!(args.light.environment_rotation);
                scene["environment_strength"] = json!(args.light.environment_strength);
            }
            Light::Headlight(_) => kinds.push("headlight"),
        }
    }
    let has_environment = args.light.environment.is_some();
    if !kinds.is_empty() {
        scene["light"] = json!(kinds);
    } else if !has_environment {
        scene["light"] = json!(["none"]);
    }
}

/// Degrees clockwise from north, and above the horizon.
fn sun_angles(sun: &Sun, up: Vec3) -> (f32, f32) {
    let (north, east) = (Sun::toward(0.0, 0.0, up), Sun::toward(90.0, 0.0, up));
    let azimuth = sun.direction.dot(east).atan2(sun.direction.dot(north)).to_degrees();
    (azimuth.rem_euclid(360.0), sun.direction.dot(up).clamp(-1.0, 1.0).asin().to_degrees())
}
