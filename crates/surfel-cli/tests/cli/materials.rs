//! Materials, and the light of environment maps.

use super::common::{
    Folder, SMALL, fail, light_picture, read_png, shot, stderr, succeed, surfel, tile,
};
use super::scenes::{picture_and_replay, site};

#[test]
fn materials_apply_to_everything_or_to_one_file() {
    let folder = site();
    let (cloud, mesh) = (folder.path("dome.ply"), folder.path("tile.ply"));
    let with = |materials: &[&str]| {
        let options = materials.iter().flat_map(|name| ["--material", name]);
        let words: Vec<&str> = [cloud.as_str(), &mesh].into_iter().chain(options).collect();
        shot(&folder, &words)
    };
    let plain = with(&[]);
    assert_eq!(with(&["dome.ply=matte", "tile=matte"]), plain);
    assert_eq!(with(&["unlit"]), with(&["dome=unlit", "tile.ply=unlit"]));
    assert_eq!(with(&["mirror", "dome=glass"]), with(&["dome=glass", "tile=mirror"]));
    assert_eq!(with(&["mirror", "unlit"]), with(&["unlit"]), "the last one counts");
    assert_ne!(with(&["tile=mirror"]), plain);
    let refused = |material: &str| {
        fail(&["render", &cloud, &mesh, "-o", "no.png", "--material", material], 2)
    };
    let text = refused("statue.ply=glass");
    assert!(text.contains("statue.ply") && text.contains("tile.ply"), "{text}");
    assert!(refused("brick").contains("glass"));
    assert!(refused("glass:colour=#fff").contains("color"));
    assert!(refused("glass:ior=9").contains("from 1 to 4"));
}

#[test]
fn materials_of_the_command_line_apply_to_objects() {
    let folder = site();
    let objects = |material: &str| {
        format!(
            "[[object]]\nname = \"house\"\nfile = \"dome.ply\"\n\
             [[object]]\nfile = \"tile.ply\"\n{material}\n"
        )
    };
    let plain = folder.write("plain.toml", objects(""));
    let unlit = folder.write("unlit.toml", objects("material = \"unlit\""));
    let own = shot(&folder, &[&unlit]);
    assert_ne!(shot(&folder, &[&plain]), own);
    assert_eq!(shot(&folder, &[&plain, "--material", "tile.ply=unlit"]), own);
    assert_eq!(shot(&folder, &[&plain, "--material", "tile=unlit"]), own);
    // A material for everything leaves an object's own; one for the object replaces it.
    assert_eq!(shot(&folder, &[&unlit, "--material", "matte"]), own);
    let mirror = shot(&folder, &[&unlit, "--material", "house=mirror"]);
    assert_ne!(mirror, own);
    assert_eq!(shot(&folder, &[&unlit, "--material", "dome.ply=mirror"]), mirror);
    let matte = shot(&folder, &[&unlit, "--material", "tile=matte"]);
    assert_eq!(matte, shot(&folder, &[&plain]));
    let top = folder.write("top.toml", format!("material = \"mirror\"\n{}", objects("")));
    assert_eq!(shot(&folder, &[&top]), shot(&folder, &[&plain, "--material", "mirror"]));
    assert_ne!(shot(&folder, &[&top]), shot(&folder, &[&plain]));
    let text = fail(&["render", &plain, "-o", "no.png", "--material", "hous=glass"], 2);
    assert!(text.contains("house"), "{text}");
    let (made, again) = picture_and_replay(&folder, &[&unlit, "--material", "house=glass"]);
    assert!(made == again);
}

#[test]
fn meshes_without_light_show_their_colours() {
    let folder = Folder::new();
    let mesh = folder.write("tile.ply", tile(1.0, 0.0, [128, 64, 200]));
    let view = ["--camera-direction", "0,0,-1", "--camera-orthographic=1"];
    let picture = folder.path("a.png");
    let arguments = [&["render", &mesh, "-o", &picture, "--light", "none"], &SMALL[..2], &view];
    succeed(&arguments.concat());
    let (.., samples) = read_png(&picture);
    assert!(samples.chunks(3).all(|pixel| pixel == [128, 64, 200]));
}

#[test]
fn materials_without_light_show_their_colours() {
    let folder = Folder::new();
    let mesh = folder.write("tile.ply", tile(1.0, 0.0, [255, 255, 255]));
    let light = folder.write("light.hdr", light_picture());
    let view = ["--camera-direction", "0,0,-1", "--camera-orthographic=1", "--background", "#000"];
    let is_all = |color: [u8; 3], options: &[&str]| {
        let picture = folder.path("a.png");
        let dark = ["render", &mesh, "-o", &picture, "--light", "none", "--exposure", "0"];
        succeed(&[&dark, &SMALL[..], &view, options].concat());
        read_png(&picture).3.chunks(3).all(|pixel| pixel == color)
    };
    for kind in ["matte:", "plastic:", "metal:roughness=1,"] {
        let material = format!("{kind}color=#8040c8");
        assert!(is_all([128, 64, 200], &["--material", &material]), "{kind}");
    }
    // Mirrors, metals and glass are black without light.
    for kind in ["mirror", "metal", "glass"] {
        assert!(is_all([0; 3], &["--material", kind]), "{kind}");
    }
    // An environment map lights the scene.
    let lit = ["--material", "matte:color=#8040c8", "--environment", &light];
    assert!(!is_all([128, 64, 200], &lit));
}

#[test]
fn an_environment_lights_the_scene_and_can_be_the_background() {
    let folder = site();
    let cloud = folder.path("dome.ply");
    let light = folder.write("light.hdr", light_picture());
    let lit =
        |options: &[&str]| shot(&folder, &[&[&cloud, "--environment", &light], options].concat());
    let plain = lit(&[]);
    assert_ne!(plain, shot(&folder, &[&cloud]));
    assert_ne!(plain, lit(&["--environment-rotation", "180"]));
    assert_ne!(plain, lit(&["--light", "sun"]));
    // The camera is low enough to see the environment behind the dome.
    let around = ["--background", "environment", "--camera-elevation-angle", "10"];
    let (black, seen) = (["--background", "#000", around[2], around[3]], lit(&around));
    assert_ne!(lit(&black), seen);
    let dark = folder.path("dark.exr");
    let pixel = |x, y| if (x, y) == (0, 0) { (-1.0, f32::NAN, 0.5) } else { (1.0f32, 1.0, 1.0) };
    exr::prelude::write_rgb_file(&dark, 4, 2, pixel).unwrap();
    let picture = folder.path("dark.png");
    let arguments = ["render", &cloud, "--environment", &dark, "-o", &picture];
    let output = surfel(&[&arguments, &SMALL[..]].concat());
    let text = stderr(&output);
    assert!(
        text.contains("dark.exr: repaired 1 pixel with a negative, infinite or NaN value"),
        "{text}"
    );
    let broken = folder.write("broken.hdr", "#?RADIANCE\n\n-Y 9");
    let text = fail(&["render", &cloud, "-o", "no.png", "--environment", &broken], 1);
    assert!(text.contains("broken.hdr"), "{text}");
}
