//! Scene files that are wrong: each is told with its place, what was found and what is known.

use super::common::{Folder, SMALL, dome, fail, gltf, stderr, surfel, tile};
use std::fs;

fn site() -> Folder {
    let folder = Folder::new();
    folder.write("a.ply", dome(10));
    folder.write("b.ply", tile(1.0, 0.0, [9; 3]));
    folder
}

/// What is said about a scene, which must be wrong use.
fn refused(folder: &Folder, name: &str, text: &str) -> String {
    let scene = folder.write(name, text);
    let told = fail(&["render", &scene, "-o", &folder.path("no.png")], 2);
    assert_eq!(told.lines().count(), 1, "{text}: {told}");
    assert!(told.contains(name), "{text}: {told}");
    fs::remove_file(scene).unwrap();
    told
}

fn check(cases: &[(&str, &[&str])]) {
    let folder = site();
    for (text, words) in cases {
        let told = refused(&folder, "scene.toml", text);
        for word in *words {
            assert!(told.contains(word), "`{word}` of {text}: {told}");
        }
    }
    assert_eq!(folder.names(), ["a.ply", "b.ply"]);
}

#[test]
fn unknown_keys_are_named_with_the_nearest_known_one() {
    check(&[
        ("spq = 3\n[[object]]\nfile = \"a.ply\"", &["`spq`", "`spp`"]),
        ("[camera]\npositoin = [1, 2, 3]", &["`camera-positoin`", "`camera-position`"]),
        ("[[objects]]\nfile = \"a.ply\"", &["`objects`", "`object`"]),
        ("[[lamps]]\nposition = [1, 2, 3]", &["`lamps`", "`lamp`"]),
        ("[[object]]\nfile = \"a.ply\"\ntransalte = [1, 2, 3]", &["object 1", "`translate`"]),
        ("[[object]]\nfile = \"a.ply\"\nsurfcae = \"disc\"", &["object 1", "`surface`"]),
        (
            "[[object]]\nfile = \"a.ply\"\n[[object]]\nfile = \"a.ply\"\nspp = 3",
            &["object 2", "`spp`"],
        ),
        (
            "[[object]]\nfile = \"a.ply\"\nmaterial = { kind = \"glass\", iro = 1.3 }",
            &["object 1: material", "`iro`", "`ior`"],
        ),
        (
            "[[object]]\nfile = \"a.ply\"\ncopies = [{}, { tanslate = [1, 2, 3] }]",
            &["object 1: copies 2", "`tanslate`", "`translate`"],
        ),
        ("[[lamp]]\nposition = [1, 2, 3]\nstrenght = 4", &["lamp 1", "`strength`"]),
        ("[[animation]]\nobjet = \"a\"", &["animation 1", "`objet`", "`object`"]),
        (
            "[[object]]\nfile = \"a.ply\"\n[[animation]]\nobject = \"a\"\nseconds = 3\nturns = 1",
            &["animation 1", "times"],
        ),
        (
            "[[object]]\nfile = \"a.ply\"\n[[animation]]\nobject = \"a\"\nkind = \"orbit\"\n\
             seconds = 3\ntimes = [0]",
            &["animation 1", "`times`"],
        ),
        ("zzz = 1", &["`zzz`", "resolution", "object"]),
    ]);
}

#[test]
fn wrong_types_and_values_are_told_with_what_is_expected() {
    let object = |line: &str| format!("[[object]]\nname = \"o\"\nfile = \"a.ply\"\n{line}");
    let lamp = |line: &str| format!("[[lamp]]\nposition = [0, 0, 1]\n{line}");
    let motion = |line: &str| format!("{}\n[[animation]]\nobject = \"o\"\n{line}", object(""));
    let cases: Vec<(String, &[&str])> = vec![
        ("object = 5".into(), &["object", "5"]),
        ("object = [5]".into(), &["object", "5", "table"]),
        ("[[object]]\nfile = 5".into(), &["object 1", "file", "5", "text"]),
        ("[[object]]\nfiles = []".into(), &["object 1", "files"]),
        ("[[object]]\nfiles = [1]".into(), &["object 1", "files", "quotes"]),
        ("[[object]]\nname = \"a\"".into(), &["object 1", "file ="]),
        ("[[object]]\nfile = \"a.ply\"\nfiles = \"b.ply\"".into(), &["object 1", "file"]),
        (object("name2 = 4"), &["object 1", "`name2`"]),
        (object("translate = [1, 2]"), &["object 1: translate", "[1,2]", "three numbers"]),
        (object("translate = [1, 2, nan]"), &["object 1", "translate", "nan"]),
        (object("translate = [1, 2, inf]"), &["object 1", "translate", "inf"]),
        (object("translate = [1, 2, 1e30]"), &["object 1: translate", "1e+30"]),
        (object("rotate = 90"), &["object 1: rotate", "90", "degrees"]),
        (object("rotate = { axis = [0, 0, 0], angle = 3 }"), &["object 1: rotate", "axis"]),
        (object("scale = 0"), &["object 1", "scale"]),
        (object("scale = [1, 0, 1]"), &["object 1", "scale"]),
        (object("scale = nan"), &["object 1", "scale", "nan"]),
        (object("scale = \"big\""), &["object 1: scale", "big", "number"]),
        (object("scale = 1e200"), &["object 1", "scale"]),
        (object("copies = [{ scale = 0 }]"), &["object 1: copies 1", "scale"]),
        (object("copies = 3"), &["object 1: copies", "3"]),
        (object("matrix = [1, 2, 3]"), &["object 1: matrix", "16"]),
        (object("matrix = [1,0,0,0, 0,0,0,0, 0,0,1,0, 0,0,0,1]"), &["object 1", "matrix"]),
        (
            object("scale = 2\nmatrix = [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]"),
            &["matrix stands alone", "scale"],
        ),
        (object("visible = \"yes\""), &["object 1: visible", "true or false"]),
        (object("fps = 0"), &["object 1: fps", "0", "0.01"]),
        (object("parent = \"p\""), &["`o`", "`p`", "parent"]),
        (object("parent = 1"), &["object 1: parent", "1"]),
        (object("material = 5"), &["object 1: material", "5"]),
        (object("material = \"glas\""), &["object 1: material", "glas", "glass"]),
        (object("material = { kind = 1 }"), &["object 1: material.kind", "1"]),
        (object("material = { ior = 9 }"), &["object 1: material: ior", "from 1 to 4"]),
        (object("material = { color = \"red\" }"), &["object 1: material: color", "#aabbcc"]),
        (object("surface = \"marble\""), &["object", "`o`", "marble", "splat"]),
        (object("radius = -1"), &["object", "`o`", "radius"]),
        ("[[lamp]]\nkind = \"point\"".into(), &["lamp 1", "position"]),
        (lamp("kind = \"moon\""), &["lamp 1: kind", "moon", "spot"]),
        (lamp("strength = -1"), &["lamp 1: strength", "-1"]),
        (lamp("strength = inf"), &["lamp 1", "strength", "inf"]),
        (lamp("color = \"red\""), &["lamp 1: color", "#aabbcc"]),
        (lamp("angle = 200"), &["lamp 1: angle", "200", "180"]),
        (lamp("blend = 2"), &["lamp 1: blend", "2"]),
        ("[[animation]]\ntimes = [0]".into(), &["animation 1", "object is missing"]),
        ("[[animation]]\nobject = \"x\"\nkind = \"orbit\"\nseconds = 1".into(), &["`x`"]),
        (motion("kind = \"jump\""), &["animation 1: kind", "jump", "orbit"]),
        (motion("times = [0, 1]"), &["animation 1", "nothing moves"]),
        (motion("times = [1, 0]\nscale = [1, 2]"), &["animation 1: times", "rising"]),
        (motion("times = [0, 0]\nscale = [1, 2]"), &["animation 1: times", "rising"]),
        (motion("times = [0, nan]\nscale = [1, 2]"), &["animation 1", "times", "nan"]),
        (motion("times = []\nscale = []"), &["animation 1: times"]),
        (motion("times = [0, 1]\nscale = [1]"), &["animation 1", "1 value", "2 times"]),
        (motion("times = [0]\nscale = [1e300]"), &["animation 1: scale"]),
        (motion("times = [0]\nscale = [[1, 2]]"), &["animation 1: scale"]),
        (motion("times = [0]\nrotate = [[0, 0]]"), &["animation 1: rotate"]),
        (motion("times = [0]\nvisible = [1]"), &["animation 1: visible"]),
        (motion("times = [0]\nscale = [1]\ninterpolation = \"jolt\""), &["interpolation", "jolt"]),
        (motion("kind = \"orbit\""), &["animation 1: seconds"]),
        (motion("kind = \"orbit\"\nseconds = 0"), &["animation 1: seconds", "0"]),
        (motion("kind = \"orbit\"\nseconds = 1\nturns = 0"), &["animation 1: turns"]),
        (motion("kind = \"orbit\"\nseconds = 1\nturns = 1e6"), &["animation 1: turns"]),
        (motion("kind = \"orbit\"\nseconds = 1\naxis = [0, 0, 0]"), &["animation 1: axis"]),
        (motion("kind = \"path\"\nseconds = 1\npoints = [[0, 0, 0]]"), &["points", "two"]),
        ("[[animation]]\nobject = \"camera\"\ntimes = [0]".into(), &["animation 1", "position"]),
        ("spp = \"many\"".into(), &["spp", "many"]),
        ("spp = 1.5".into(), &["spp", "1.5"]),
        ("spp = true".into(), &["spp", "true"]),
        ("exposure = nan".into(), &["exposure", "nan"]),
        ("[camera]\nposition = [1, 2]".into(), &["camera-position", "1,2", "three numbers"]),
        ("no_background = 3".into(), &["no-background", "3", "true or false"]),
        ("light = [\"moon\"]".into(), &["light", "moon"]),
        ("light = [[1]]".into(), &["light", "[1]"]),
    ];
    let cases: Vec<(&str, &[&str])> =
        cases.iter().map(|(text, words)| (text.as_str(), *words)).collect();
    check(&cases);
}

#[test]
fn what_is_no_toml_or_json_is_told_with_its_line() {
    let folder = site();
    let told = refused(&folder, "scene.toml", "spp = 1\n[camera\nup = \"+Z\"");
    assert!(told.contains("line 2"), "{told}");
    let told = refused(&folder, "scene.toml", "spp = 1\nspp = 2");
    assert!(told.contains("line 2") && told.contains("spp"), "{told}");
    let told = refused(&folder, "scene.json", "{\"spp\": 1,\n}");
    assert!(told.contains("line 2"), "{told}");
    for text in ["[1, 2]", "5", "null", "\"text\""] {
        let told = refused(&folder, "scene.json", text);
        assert!(told.contains("keys and values"), "{told}");
    }
    let deep = "[".repeat(100_000);
    refused(&folder, "scene.json", &format!("{{\"light\": {deep}"));
    refused(&folder, "scene.toml", &format!("light = {deep}"));
}

#[test]
fn a_scene_without_objects_is_told_so() {
    let folder = site();
    for text in ["", "spp = 2", "[[lamp]]\nposition = [0, 0, 1]"] {
        let told = refused(&folder, "scene.toml", text);
        assert!(told.contains("[[object]]"), "{told}");
    }
    refused(&folder, "scene.json", "{}");
}

#[test]
fn scene_files_that_cannot_be_read_are_named() {
    let folder = site();
    let picture = folder.path("no.png");
    let absent = folder.path("absent.toml");
    let told = fail(&["render", &absent, "-o", &picture], 1);
    assert!(told.contains("absent.toml: cannot be read"), "{told}");
    fs::create_dir(folder.path("folder.json")).unwrap();
    let told = fail(&["render", &folder.path("folder.json"), "-o", &picture], 1);
    assert!(told.contains("folder.json: found a folder"), "{told}");
    let binary = folder.write("binary.toml", [0xff; 3000]);
    let told = fail(&["render", &binary, "-o", &picture], 1);
    assert!(told.contains("binary.toml") && told.contains("text"), "{told}");
    let huge = folder.write("huge.json", "");
    fs::File::options().write(true).open(&huge).unwrap().set_len(1 << 33).unwrap();
    let told = fail(&["render", &huge, "-o", &picture], 1);
    assert!(told.contains("huge.json") && told.contains("at most"), "{told}");
    #[cfg(target_os = "linux")]
    {
        std::os::unix::fs::symlink("/dev/zero", folder.path("endless.toml")).unwrap();
        let told = fail(&["render", &folder.path("endless.toml"), "-o", &picture], 1);
        assert!(told.contains("endless.toml"), "{told}");
    }
    for (text, name) in [
        ("[[object]]\nfile = \"absent.ply\"", "absent.ply"),
        ("[[object]]\nfiles = [\"a.ply\", \"absent.ply\"]", "absent.ply"),
        ("[[object]]\nfile = \"b.ply\"\n[[object]]\nfile = \"a.ply\"\ncolor = \"snow\"", "a.ply"),
        ("environment = \"absent.hdr\"\n[[object]]\nfile = \"a.ply\"", "absent.hdr"),
    ] {
        let scene = folder.write("scene.toml", text);
        let told = fail(&["render", &scene, "-o", &picture], 1);
        assert!(told.contains(&folder.path(name)), "{told}");
    }
}

#[test]
fn a_pattern_that_no_file_fits_is_told() {
    let folder = site();
    let told = refused(&folder, "scene.toml", "[[object]]\nfiles = \"frame_*.ply\"");
    assert!(told.contains("object 1") && told.contains("frame_*.ply"), "{told}");
    let told = refused(&folder, "scene.toml", "[[object]]\nfiles = \"nowhere/f*.ply\"");
    assert!(told.contains("object 1") && told.contains("nowhere"), "{told}");
}

#[test]
fn scene_files_are_for_commands_that_show_them() {
    let folder = site();
    let scene = folder.write("scene.toml", "spp = 2\n[[object]]\nfile = \"a.ply\"");
    for arguments in [&["info", &scene][..], &["prepare", &scene, "-o", &folder.path("x.ply")]] {
        let told = fail(arguments, 1);
        assert!(told.contains("scene.toml") && !told.contains("unknown key"), "{told}");
    }
}

/// Far from sense: a picture or a clear error, never a panic.
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
        "copies = [{ translate = [1e14, 0, 0] }, { scale = 1e-12 }]",
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
            let told = stderr(&output);
            assert!(matches!(output.status.code(), Some(0 | 1)), "{file}: {text}: {told}");
            assert!(!told.contains("panicked"), "{file}: {text}: {told}");
        }
    }
}
