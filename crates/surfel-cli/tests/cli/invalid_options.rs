//! Invalid options: exit code 2, whatever the file.

use super::common::{Folder, dome, fail, light_picture, stderr, succeed, surfel};
use std::fs;

#[test]
fn marks_that_the_camera_does_not_allow_are_named_by_their_options() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let picture = folder.path("out.png");
    for option in ["--scale-bar", "--north"] {
        let message = fail(&["render", &cloud, "-o", &picture, option], 2);
        assert!(message.contains(&format!("error: {option}: needs a camera")), "{message}");
    }
}

#[test]
fn outputs_replace_no_inputs_and_no_other_outputs() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let sky = folder.write("sky.hdr", light_picture());
    let png = folder.path("sky.png");
    fs::rename(&sky, &png).unwrap();
    let area = folder.write("area.tif", "POLYGON ((-1 -1, 1 -1, 1 1, -1 1, -1 -1))");
    let (plan, heights) = (folder.path("plan.tif"), folder.path("h.tif"));
    let scene = format!("environment = {png:?}\n[[object]]\nfile = {cloud:?}\ncrop = {area:?}");
    let scene = folder.write("scene.toml", scene);
    for arguments in [
        &["render", &cloud, "--environment", &png, "-o", &png][..],
        &["render", &scene, "-o", &area],
        &["render", &scene, "-o", &plan, "--gsd", "0.1", "--height-map", &plan],
        &["render", &scene, "-o", &plan, "--gsd", "0.1", "--height-map", &area],
        &[
            "render",
            &scene,
            "-o",
            &plan,
            "--gsd",
            "0.1",
            "--height-map",
            &heights,
            "--stats",
            &heights,
        ],
        &["render", &scene, "-o", &plan, "--stats", &scene],
        &["animate", &scene, "-o", &png, "--frames", "1"],
        &["prepare", &cloud, "-o", &cloud],
    ] {
        let message = fail(arguments, 2);
        assert!(message.contains("would replace that file"), "{arguments:?}: {message}");
    }
    assert_eq!(folder.names(), ["area.tif", "dome.ply", "scene.toml", "sky.png"]);
}

#[test]
fn invalid_values_end_with_code_2() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let picture = folder.path("out.png");
    let wrong = [
        &["--surface", "marble"][..],
        &["--edge-test", "maybe"],
        &["--octree-depth", "17"],
        &["--octree-depth", "deep"],
        &["--reach", "0"],
        &["--density", "0"],
        &["--degree", "4"],
        &["--radius-scale", "0"],
        &["--clip-box", "0,1,0,1"],
        &["--clip-box", "([0,1],[1,0])"],
        &["--clip-plane", "0,0,0"],
        &["--clip-plane", "1,2,3,0,0,0"],
        &["--resolution", "0x0"],
        &["--resolution", "4000000000x4000000000"],
        &["--resolution", "20000x20000"],
        &["--resolution", "99999999999999999999x1"],
        &["--spp", "0"],
        &["--point-size", "0"],
        &["--point-size", "0.99"],
        &["--point-size", "65"],
        &["--point-size", "NaN"],
        &["--point-size", "big"],
        &["--light-samples", "0"],
        &["--threads", "0"],
        &["--threads", "-1"],
        &["--camera-position", "NaN,0,0"],
        &["--camera-position", "1,2"],
        &["--camera-position", "inf,2,3"],
        &["--camera-view-up", "0,0,0"],
        &["--camera-direction", "0,0,0"],
        &["--camera-view-angle", "0"],
        &["--camera-view-angle", "180"],
        &["--camera-view-angle", "NaN"],
        &["--camera-zoom-factor", "0"],
        &["--camera-orthographic=-1"],
        &["--camera-panorama", "--camera-orthographic"],
        &["--camera-panorama", "--camera-view-angle", "60"],
        &["--camera-position", "1,2,3", "--camera-focal-point", "1,2,3"],
        &["--up", "W"],
        &["--light", "moon"],
        &["--light", "none,sun"],
        &["--sun-elevation", "NaN"],
        &["--sun-angle", "-1"],
        &["--sky-ao-distance", "0"],
        &["--exposure", "bright"],
        &["--color", "#12345"],
        &["--color", ""],
        &["--cmap", "beige"],
        &["--range", "1,1"],
        &["--background", "reddish"],
        &["--subsample", "first:0"],
        &["--subsample", "random:0"],
        &["--subsample", "stride:0"],
        &["--subsample", "half"],
        &["--remove-outliers", "statistical:0"],
        &["--remove-outliers", "radius"],
        &["--normals-k", "0"],
        &["--normals-radius", "NaN"],
        &["--orient", "viewpoint:1,2"],
        &["--radius", "-1"],
        &["--radius", "adaptive:0"],
        &["--bit-depth", "12"],
        &["--memory-limit", "lots"],
        &["--backend", "abacus"],
        &["--no-such-option"],
    ];
    for options in wrong {
        fail(&[&["render", &cloud, "-o", &picture], options].concat(), 2);
    }
    assert_eq!(folder.names(), ["dome.ply"]);
}

#[test]
fn errors_for_negative_numbers_say_what_is_expected() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let picture = folder.path("out.png");
    for (option, expected) in [
        ("--radius", "a positive number in world units"),
        ("--normals-radius", "a positive number"),
        ("--camera-zoom-factor", "a positive number"),
        ("--sun-strength", "a number from 0 to 1000"),
        ("--threads", "found \"-1\", expected a whole number from 1 to 1024"),
    ] {
        let text = fail(&["render", &cloud, "-o", &picture, option, "-1"], 2);
        assert!(text.contains(expected) && text.contains(option), "{option}: {text}");
    }
}

#[test]
fn a_command_without_a_required_argument_ends_with_code_2() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    for arguments in [&["render"][..], &["render", &cloud], &["info"], &["prepare", &cloud], &["x"]]
    {
        fail(arguments, 2);
    }
    fail(&["render", &cloud, "-o", "-", "--stats", "-"], 2);
    assert_eq!(surfel(&[]).status.code(), Some(2));
    assert!(succeed(&["--version"]).starts_with("surfel "));
}

/// Extreme values give a picture or a clear error, never a panic.
#[test]
fn extreme_values_do_not_panic() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let picture = folder.path("out.png");
    for options in [
        &["--camera-position", "1e14,-1e14,1e14"][..],
        &["--camera-position", "0,0,0", "--camera-focal-point", "0,0,1e-12"],
        &["--camera-view-up", "1e-8,0,0"],
        &["--camera-zoom-factor", "1e14"],
        &["--camera-zoom-factor", "1e-8"],
        &["--camera-orthographic=1e14"],
        &["--camera-elevation-angle", "90"],
        &["--camera-view-angle", "170"],
        &["--radius", "1e30"],
        &["--radius", "1e-30"],
        &["--sky-ao-distance", "1e14", "--sky-strength", "1000"],
        &["--range", "1e308,-1e308", "--color", "rain"],
        &["--color", "elevation", "--up", "1e-6,0,1e6"],
        &["--resolution", "1x300", "--spp", "1"],
        &["--resolution", "3000x1", "--spp", "1"],
        &["--normals-radius", "1e-8"],
        &["--sun-elevation", "-90", "--exposure", "20"],
        &["--subsample", "spacing:1e30"],
        &["--subsample", "stride:1e300"],
        &["--threads", "64"],
    ] {
        let common = ["render", &cloud, "-o", &picture, "--resolution", "32x18"];
        let arguments = match options[0] {
            "--resolution" => [&common[..4], options].concat(),
            _ => [&common[..], options].concat(),
        };
        let output = surfel(&arguments);
        let text = stderr(&output);
        assert!(matches!(output.status.code(), Some(0 | 1)), "{options:?}: {text}");
        assert!(!text.contains("panicked"), "{options:?}: {text}");
    }
}
