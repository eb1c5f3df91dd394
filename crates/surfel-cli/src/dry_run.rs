//! What `--dry-run` tells: every choice, resolved, as a scene file that makes the same picture.

use crate::args::{Choice, Exposure, SceneArgs};
use crate::assemble::Assembly;
use crate::picture::Choices;
use crate::render::Args;
use crate::scene_file::Line;
use clap::ValueEnum;
use serde_json::{Map, Value, json};
use std::path::{Path, absolute};
use surfel::math::Vec3;
use surfel::scene::color::{ColorSource, choose};
use surfel::scene::{Background, Camera, Light, Projection};
use surfel::trace::Simd;

pub fn resolved(assembly: &Assembly, choices: &Choices, args: &Args, line: &Line) -> String {
    let mut scene = scene(assembly, choices, &args.scene, line);
    scene["output"] = json!(args.output);
    scene["time"] = json!(args.time);
    format!("{scene:#}")
}

/// All that decides what a picture shows.
pub fn scene(assembly: &Assembly, choices: &Choices, args: &SceneArgs, line: &Line) -> Value {
    let color = args.color.color.clone().or_else(|| chosen_color(assembly));
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
        "camera": camera(assembly, choices, args),
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
    for (key, value) in line.given() {
        let is_told = scene.get(&key).is_some() || key == "no_background";
        if !is_told {
            scene[key] = value;
        }
    }
    let objects = file_objects(assembly, args).chain(scene_objects(args, line));
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

/// What all clouds that leave it open are coloured by, if that is the same.
fn chosen_color(assembly: &Assembly) -> Option<ColorSource> {
    let open = assembly.clouds().filter(|(_, args, _)| args.color.color.is_none());
    let mut chosen = open.map(|(cloud, ..)| choose(cloud).0);
    let first = chosen.next()?;
    chosen.all(|other| other == first).then_some(first)
}

/// The command line's files as objects.
fn file_objects(assembly: &Assembly, args: &SceneArgs) -> impl Iterator<Item = Value> {
    assembly.files().map(|files| {
        let mut object = match &files[..] {
            [only] => json!({ "file": in_full(only) }),
            several => {
                let files: Vec<String> = several.iter().map(|file| in_full(file)).collect();
                json!({ "files": files, "merge": true })
            }
        };
        if let Some(choice) = args.material.of(files[files.len() - 1]) {
            object["material"] = material(choice);
        }
        object
    })
}

/// Objects of scene files, with the materials that the command line has for them.
fn scene_objects(args: &SceneArgs, line: &Line) -> impl Iterator<Item = Value> {
    let objects = line.scene.objects.iter().zip(line.scene.raw_objects());
    objects.map(|(object, raw)| {
        let mut raw = raw.clone();
        if let Some(choice) = object.choice(&args.material) {
            raw["material"] = material(choice);
        }
        raw
    })
}

fn material(choice: &Choice) -> Value {
    let (kind, properties) = &choice.words;
    let mut material = Map::new();
    material.insert("kind".into(), json!(kind));
    material.extend(properties.iter().map(|(name, value)| (name.clone(), json!(value))));
    Value::Object(material)
}

/// From the root, so that the scene may lie anywhere.
pub fn in_full(file: &Path) -> String {
    absolute(file).unwrap_or_else(|_| file.to_owned()).display().to_string()
}

/// Where it stands, or by its name if it is one of a file that moves.
fn camera(assembly: &Assembly, choices: &Choices, args: &SceneArgs) -> Value {
    if let Some(node) = choices.eye.node.filter(|node| assembly.moves(*node)) {
        let name = &assembly.graph.nodes[node].name;
        let mut keys = json!({ "name": name });
        if let Some(angle) = args.camera.camera_view_angle {
            keys["view_angle"] = json!(angle);
        }
        return keys;
    }
    let mut keys = camera_keys(&choices.eye.camera);
    if args.camera.camera_still {
        keys["still"] = json!(true);
    }
    keys
}

/// A camera as a scene file has it, with nothing left to be chosen.
pub fn camera_keys(camera: &Camera) -> Value {
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
    for light in &choices.lights {
        match light {
            Light::Sun(_) => {
                scene["sun"] = json!({
                    "azimuth": choices.sun_azimuth_deg,
                    "elevation": args.light.sun_elevation,
                    "angle": args.light.sun_angle,
                    "strength": args.light.sun_strength,
                });
            }
            Light::Sky(sky) => {
                scene["sky"] = json!({ "reach": sky.reach, "strength": args.light.sky_strength });
            }
            Light::Environment(_) => {
                scene["environment"] = json!(args.light.environment.as_deref().map(in_full));
                scene["environment_rotation"] = json!(args.light.environment_rotation);
                scene["environment_strength"] = json!(args.light.environment_strength);
            }
            Light::Headlight(_) => {}
        }
    }
    let kinds = args.light.kinds().into_iter();
    let names = kinds.filter_map(|kind| Some(kind.to_possible_value()?.get_name().to_owned()));
    let names: Vec<String> = names.collect();
    if !names.is_empty() {
        scene["light"] = json!(names);
    }
}
