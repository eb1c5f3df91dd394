//! Invalid scene files: the error names the file, the path of the key, what was found and what was expected.

use super::common::{Folder, SMALL, dome, fail, gltf, stderr, surfel, tile};
use std::fs;

fn site() -> Folder {
    let folder = Folder::new();
    folder.write("a.ply", dome(10));
    folder.write("b.ply", tile(1.0, 0.0, [9; 3]));
    folder
}

/// Returns the error for a scene, which ends the program with code 2.
fn refused(folder: &Folder, name: &str, text: &str) -> String {
    let scene = folder.write(name, text);
    let message = fail(&["render", &scene, "-o", &folder.path("no.png")], 2);
    assert_eq!(message.lines().count(), 1, "{text}: {message}");
    assert!(message.contains(name), "{text}: {message}");
    fs::remove_file(scene).unwrap();
    message
}

fn check(cases: &[(&str, &[&str])]) {
    let folder = site();
    for (text, words) in cases {
        let message = refused(&folder, "scene.toml", text);
        for word in *words {
            assert!(message.contains(word), "`{word}` of {text}: {message}");
        }
    }
    assert_eq!(folder.names(), ["a.ply", "b.ply"]);
}

#[test]
fn unknown_keys_are_named_with_the_nearest_known_one() {
    check(&[
        ("spq = 3\n[[object]]\nfile = \"a.ply\"", &["spq: unknown key", "`spp`"]),
        ("[camera]\npositoin = [1, 2, 3]", &["camera.positoin: unknown", "`camera.position`"]),
        ("[[objects]]\nfile = \"a.ply\"", &["objects: unknown key", "`object`"]),
        ("[[lamps]]\nposition = [1, 2, 3]", &["lamps: unknown key", "`lamp`"]),
        (
            "[[object]]\nfile = \"a.ply\"\ntransalte = [1, 2, 3]",
            &["object[0].transalte: unknown key", "`translate`"],
        ),
        (
            "[[object]]\nfile = \"a.ply\"\nsurfcae = \"disc\"",
            &["object[0].surfcae: unknown key", "`surface`"],
        ),
        (
            "[[object]]\nfile = \"a.ply\"\n[[object]]\nfile = \"a.ply\"\nspp = 3",
            &["object[1].spp: unknown key; known: name, "],
        ),
        (
            "[[object]]\nfile = \"a.ply\"\nmaterial = { kind = \"glass\", iro = 1.3 }",
            &["object[0].material.iro: unknown key; the nearest known one is `ior`"],
        ),
        (
            "[[object]]\nfile = \"a.ply\"\nmaterial = \"glass:iro=1.3\"",
            &["object[0].material.iro: unknown key; the nearest known one is `ior`"],
        ),
        (
            "[[object]]\nfile = \"a.ply\"\nmaterial = { kind = \"emissive\", glow = 3 }",
            &["object[0].material.glow: unknown key"],
        ),
        (
            "[[object]]\nfile = \"a.ply\"\ninstances = [{}, { tanslate = [1, 2, 3] }]",
            &["object[0].instances[1].tanslate: unknown key", "`translate`"],
        ),
        ("[[object]]\nfile = \"a.ply\"\ncopies = [{}]", &["object[0].copies: unknown key"]),
        ("[[lamp]]\nposition = [1, 2, 3]\nstrenght = 4", &["lamp[0].strenght", "`strength`"]),
        ("[[animation]]\nobjet = \"a\"", &["animation[0].objet: unknown key", "`object`"]),
        (
            "[[object]]\nfile = \"a.ply\"\n[[animation]]\nobject = \"a\"\nseconds = 3\nturns = 1",
            &["animation[0].seconds: has no meaning here", "times"],
        ),
        (
            "[[object]]\nfile = \"a.ply\"\n[[animation]]\nobject = \"a\"\nkind = \"orbit\"\n\
             seconds = 3\ntimes = [0]",
            &["animation[0].times: has no meaning here"],
        ),
        ("zzz = 1", &["zzz: unknown key; known: ", "resolution", "object"]),
        ("[camera]\nspp = 4", &["camera.spp: unknown key; here it is `spp`, outside of [camera]"]),
        ("[camera]\nsamples = 4", &["unknown key; here it is `spp`, outside of [camera]"]),
        ("position = [1, 2, 3]", &["position: unknown key; here it is `camera.position`"]),
        ("strength = 2", &["here it is `sun.strength` or `sky.strength`"]),
        ("colour = \"class\"", &["unknown key; here it is `color`"]),
        ("no_background = true", &["no_background: unknown key", "`background`"]),
        ("quiet = true", &["quiet: unknown key"]),
    ]);
}

#[test]
fn errors_for_invalid_types_and_values_say_what_is_expected() {
    let object = |line: &str| format!("[[object]]\nname = \"o\"\nfile = \"a.ply\"\n{line}");
    let lamp = |line: &str| format!("[[lamp]]\nposition = [0, 0, 1]\n{line}");
    let motion = |line: &str| format!("{}\n[[animation]]\nobject = \"o\"\n{line}", object(""));
    let cases: Vec<(String, &[&str])> = vec![
        ("object = 5".into(), &["object: found 5, expected tables"]),
        ("object = [5]".into(), &["object[0]: found 5, expected a table"]),
        ("[[object]]\nfile = 5".into(), &["object[0].file: found 5, expected a name in quotes"]),
        ("[[object]]\nfiles = []".into(), &["object[0].file: expected `file = ", "`files`"]),
        ("[[object]]\nfiles = [1]".into(), &["object[0].files: expected names in quotes"]),
        ("[[object]]\nname = \"a\"".into(), &["object[0].file: expected `file = "]),
        (
            "[[object]]\nfile = \"a.ply\"\nfiles = \"b.ply\"".into(),
            &["object[0].file: expected `file = "],
        ),
        (object("name2 = 4"), &["object[0].name2: unknown key", "`name`"]),
        (
            object("translate = [1, 2]"),
            &["object[0].translate: found [1,2], expected three numbers"],
        ),
        (object("translate = [1, 2, nan]"), &["object[0].translate[2]: found nan"]),
        (object("translate = [1, 2, inf]"), &["object[0].translate[2]: found nan or inf"]),
        (object("translate = [1, 2, 1e30]"), &["object[0].translate: found [1,2,1e+30]", "1e15"]),
        (object("rotate = 90"), &["object[0].rotate: found 90, expected degrees"]),
        (
            object("rotate = { axis = [0, 0, 0], angle = 3 }"),
            &["object[0].rotate: found {", "an axis and an angle"],
        ),
        (object("scale = 0"), &["object[0].scale: the object would be flat"]),
        (object("scale = [1, 0, 1]"), &["object[0].scale: the object would be flat"]),
        (object("scale = nan"), &["object[0].scale: found nan"]),
        (object("scale = \"big\""), &["object[0].scale: found \"big\", expected a number"]),
        (object("scale = 1e200"), &["object[0].scale: found 1e+200", "below 1e15"]),
        (
            object("instances = [{ scale = 0 }]"),
            &["object[0].instances[0].scale: the object would be flat"],
        ),
        (object("instances = 3"), &["object[0].instances[0]: found 3, expected a table"]),
        (object("matrix = [1, 2, 3]"), &["object[0].matrix: expected 16 numbers"]),
        (
            object("matrix = [1,0,0,0, 0,0,0,0, 0,0,1,0, 0,0,0,1]"),
            &["object[0].matrix: the object would be flat"],
        ),
        (
            object("scale = 2\nmatrix = [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]"),
            &["object[0].matrix: excludes translate, rotate and scale"],
        ),
        (
            object("visible = \"yes\""),
            &["object[0].visible: found \"yes\", expected true or false"],
        ),
        (object("fps = 0"), &["object[0].fps: found 0, expected frames per second from 0.01"]),
        (object("parent = \"p\""), &["object[0].parent: no object `p` stands before this one"]),
        (object("parent = 1"), &["object[0].parent: no object `1`"]),
        (object("material = 5"), &["object[0].material: found 5, expected the name of a material"]),
        (object("material = \"glas\""), &["object[0].material.kind: found \"glas\"", "`glass`"]),
        (
            object("material = { kind = 1 }"),
            &["object[0].material.kind: found 1, expected the name"],
        ),
        (
            object("material = { ior = 9 }"),
            &["object[0].material.ior: found 9, expected a number from 1 to 4"],
        ),
        (
            object("material = { color = \"reddish\" }"),
            &["object[0].material.color: found \"reddish\"", "#aabbcc"],
        ),
        (
            object("surface = \"marble\""),
            &["object[0].surface: found \"marble\", expected one of points"],
        ),
        (object("radius = -1"), &["object[0].radius: found -1, expected a positive length"]),
        ("[[lamp]]\nkind = \"point\"".into(), &["lamp[0].position: is missing"]),
        (lamp("kind = \"moon\""), &["lamp[0].kind: found \"moon\", expected one of point, spot"]),
        (lamp("strength = -1"), &["lamp[0].strength: found -1, expected a number from 0"]),
        (lamp("strength = inf"), &["lamp[0].strength: found nan or inf"]),
        (lamp("color = \"reddish\""), &["lamp[0].color: found \"reddish\"", "#aabbcc"]),
        (lamp("angle = 200"), &["lamp[0].angle: found 200", "180"]),
        (lamp("blend = 2"), &["lamp[0].blend: found 2"]),
        ("[[animation]]\ntimes = [0]".into(), &["animation[0].object: is missing"]),
        (
            "[[animation]]\nobject = \"x\"\nkind = \"orbit\"\nseconds = 1".into(),
            &["animation[0].object: no object `x`"],
        ),
        (
            motion("kind = \"jump\""),
            &["animation[0].kind: found \"jump\", expected one of keys", "orbit"],
        ),
        (motion("times = [0, 1]"), &["animation[0]: nothing moves"]),
        (
            motion("times = [1, 0]\nscale = [1, 2]"),
            &["animation[0].times: expected rising seconds"],
        ),
        (
            motion("times = [0, 0]\nscale = [1, 2]"),
            &["animation[0].times: expected rising seconds"],
        ),
        (motion("times = [0, nan]\nscale = [1, 2]"), &["animation[0].times[1]: found nan"]),
        (motion("times = []\nscale = []"), &["animation[0].times: expected rising seconds"]),
        (motion("times = [0, 1]\nscale = [1]"), &["animation[0].scale: 1 value for 2 times"]),
        (motion("times = [0]\nscale = [1e300]"), &["animation[0].scale: "]),
        (motion("times = [0]\nscale = [[1, 2]]"), &["animation[0].scale: "]),
        (motion("times = [0]\nrotate = [[0, 0]]"), &["animation[0].rotate: "]),
        (motion("times = [0]\nvisible = [1]"), &["animation[0].visible: "]),
        (
            motion("times = [0]\nscale = [1]\ninterpolation = \"jolt\""),
            &["animation[0].interpolation: found \"jolt\""],
        ),
        (motion("kind = \"orbit\""), &["animation[0].seconds: is missing"]),
        (motion("kind = \"orbit\"\nseconds = 0"), &["animation[0].seconds: found 0"]),
        (motion("kind = \"orbit\"\nseconds = 1\nturns = 0"), &["animation[0].turns: "]),
        (motion("kind = \"orbit\"\nseconds = 1\nturns = 1e6"), &["animation[0].turns: "]),
        (motion("kind = \"orbit\"\nseconds = 1\naxis = [0, 0, 0]"), &["animation[0].axis: "]),
        (
            motion("kind = \"path\"\nseconds = 1\npoints = [[0, 0, 0]]"),
            &["animation[0].points: expected two points"],
        ),
        (
            "[[animation]]\nobject = \"camera\"\ntimes = [0]".into(),
            &["animation[0]: nothing moves; expected position"],
        ),
        ("spp = \"many\"".into(), &["spp: found \"many\", expected a whole number"]),
        ("spp = 1.5".into(), &["spp: found 1.5, expected a whole number"]),
        ("spp = true".into(), &["spp: found true, expected a whole number"]),
        ("exposure = nan".into(), &["exposure: found nan"]),
        (
            "[camera]\nposition = [1, 2]".into(),
            &["camera.position: found [1,2], expected three numbers"],
        ),
        ("vertices = 3".into(), &["vertices: found 3, expected true or false"]),
        ("light = [\"moon\"]".into(), &["light: found [\"moon\"], expected one of sun"]),
        ("light = [[1]]".into(), &["light: found [[1]], expected one of sun"]),
    ];
    let cases: Vec<(&str, &[&str])> =
        cases.iter().map(|(text, words)| (text.as_str(), *words)).collect();
    check(&cases);
}

#[test]
fn syntax_errors_name_the_line() {
    let folder = site();
    let message = refused(&folder, "scene.toml", "spp = 1\n[camera\nup = \"+Z\"");
    assert!(message.contains("line 2"), "{message}");
    let message = refused(&folder, "scene.toml", "spp = 1\nspp = 2");
    assert!(message.contains("line 2") && message.contains("spp"), "{message}");
    let message = refused(&folder, "scene.json", "{\"spp\": 1,\n}");
    assert!(message.contains("line 2"), "{message}");
    for text in ["[1, 2]", "5", "null", "\"text\""] {
        let message = refused(&folder, "scene.json", text);
        assert!(message.contains("keys and values"), "{message}");
    }
    let deep = "[".repeat(100_000);
    refused(&folder, "scene.json", &format!("{{\"light\": {deep}"));
    refused(&folder, "scene.toml", &format!("light = {deep}"));
}

#[test]
fn a_scene_without_objects_is_an_error() {
    let folder = site();
    for text in ["", "spp = 2", "[[lamp]]\nposition = [0, 0, 1]"] {
        let message = refused(&folder, "scene.toml", text);
        assert!(message.contains("[[object]]"), "{message}");
    }
    refused(&folder, "scene.json", "{}");
}

#[test]
fn scene_files_that_cannot_be_read_are_named() {
    let folder = site();
    let picture = folder.path("no.png");
    let absent = folder.path("absent.toml");
    let message = fail(&["render", &absent, "-o", &picture], 1);
    assert!(message.contains("absent.toml: cannot be read"), "{message}");
    fs::create_dir(folder.path("folder.json")).unwrap();
    let message = fail(&["render", &folder.path("folder.json"), "-o", &picture], 1);
    assert!(message.contains("folder.json: holds no point cloud"), "{message}");
    let binary = folder.write("binary.toml", [0xff; 3000]);
    let message = fail(&["render", &binary, "-o", &picture], 1);
    assert!(message.contains("binary.toml") && message.contains("text"), "{message}");
    let huge = folder.write("huge.json", "");
    fs::File::options().write(true).open(&huge).unwrap().set_len(1 << 33).unwrap();
    let message = fail(&["render", &huge, "-o", &picture], 1);
    assert!(message.contains("huge.json") && message.contains("at most"), "{message}");
    #[cfg(target_os = "linux")]
    {
        std::os::unix::fs::symlink("/dev/zero", folder.path("endless.toml")).unwrap();
        let message = fail(&["render", &folder.path("endless.toml"), "-o", &picture], 1);
        assert!(message.contains("endless.toml"), "{message}");
    }
    for (text, name) in [
        ("[[object]]\nfile = \"absent.ply\"", "absent.ply"),
        ("[[object]]\nfiles = [\"a.ply\", \"absent.ply\"]", "absent.ply"),
        ("[[object]]\nfile = \"b.ply\"\n[[object]]\nfile = \"a.ply\"\ncolor = \"hail\"", "a.ply"),
        ("environment = \"absent.hdr\"\n[[object]]\nfile = \"a.ply\"", "absent.hdr"),
    ] {
        let scene = folder.write("scene.toml", text);
        let message = fail(&["render", &scene, "-o", &picture], 1);
        assert!(message.contains(&folder.path(name)), "{message}");
    }
}

#[test]
fn names_that_were_typed_are_no_fault_of_a_scene_file() {
    let folder = site();
    let object = "[[object]]\nfile = \"a.ply\"\n";
    let scene = folder.write("scene.toml", object);
    let typed = ["--object-settings", "towr:color=class"];
    let picture = folder.path("no.png");
    let render = ["render", &scene, "-o", &picture];
    let message = fail(&[&render[..], &typed].concat(), 2);
    let known = folder.path("a.ply");
    let start = "error: --object-settings: no file or object `towr`; there is ";
    assert!(message.starts_with(start) && message.contains(&known), "{message}");
    let message = refused(
        &folder,
        "scene.toml",
        &format!("object_settings = [\"towr:color=class\"]\n{object}"),
    );
    assert!(message.contains("object_settings: no file or object `towr`"), "{message}");
}

#[test]
fn a_pattern_that_matches_no_file_is_an_error() {
    let folder = site();
    let message = refused(&folder, "scene.toml", "[[object]]\nfiles = \"frame_*.ply\"");
    assert!(message.contains("object[0].files: ") && message.contains("frame_*.ply"), "{message}");
    let message = refused(&folder, "scene.toml", "[[object]]\nfiles = \"nowhere/f*.ply\"");
    assert!(message.contains("object[0].files: ") && message.contains("nowhere"), "{message}");
}

#[test]
fn info_and_prepare_reject_scene_files() {
    let folder = site();
    let scene = folder.write("scene.toml", "spp = 2\n[[object]]\nfile = \"a.ply\"");
    for arguments in [&["info", &scene][..], &["prepare", &scene, "-o", &folder.path("x.ply")]] {
        let message = fail(arguments, 2);
        let expected = "scene.toml: is a scene file, which surfel render, animate and view take";
        assert!(message.contains(expected), "{message}");
    }
}

/// Extreme values give a picture or a clear error, never a panic.
#[test]
fn extreme_scenes_do_not_panic() {
    let folder = site();
    folder.write("c.gltf", gltf());
    for text in [
        "scale = 1e12",
        "scale = 1e-11",
        "scale = [1e10, 1e-10, -1]",
        "translate = [1e14, -1e14, 1e14]",
        "rotate = [1e14, -1e14, 1e12]",
        "matrix = [1e14,0,0,1e14, 0,1e14,0,0, 0,0,1e14,0, 9,9,9,9]",
        "visible = false",
        "instances = [{ translate = [1e14, 0, 0] }, { scale = 1e-12 }]",
        "[[lamp]]\nposition = [0, 0, 0]\ntarget = [0, 0, 0]\nkind = \"spot\"\nstrength = 1e300",
        "[[lamp]]\nposition = [0, 0, 2]\nradius = 1e300\nrange = 1e-300",
        "[[animation]]\nobject = \"a\"\ntimes = [0, 1]\nscale = [0, 0]",
        "[[animation]]\nobject = \"a\"\ntimes = [-1e300, 1e300]\nscale = [1, 1e14]\ninterpolation = \"cubic\"",
        "[[animation]]\nobject = \"a\"\nkind = \"path\"\nseconds = 1\npoints = [[0,0,0],[0,0,0],[1e14,0,0]]",
        "[[animation]]\nobject = \"camera\"\ntimes = [0]\nposition = [[0, 0, 0]]\nfocal_point = [[0, 0, 0]]",
        "[[animation]]\nobject = \"camera\"\nkind = \"orbit\"\nseconds = 0.001\nturns = 1000",
    ] {
        for file in ["a.ply", "b.ply", "c.gltf"] {
            let scene = format!("[[object]]\nname = \"a\"\nfile = \"{file}\"\n{text}\n");
            let scene = folder.write("scene.toml", scene);
            let picture = folder.path("out.png");
            let arguments = [&["render", &scene, "-o", &picture, "--time", "0.5"], &SMALL[..]];
            let output = surfel(&arguments.concat());
            let message = stderr(&output);
            assert!(matches!(output.status.code(), Some(0 | 1)), "{file}: {text}: {message}");
            assert!(!message.contains("panicked"), "{file}: {text}: {message}");
        }
    }
}
