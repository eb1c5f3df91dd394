//! Options that have no effect on a file or a scene: a warning says why.

use super::common::{Folder, SMALL, dome, stderr, succeed, surfel};

/// Returns the warnings of a run, which must succeed.
fn warnings(arguments: &[&str]) -> Vec<String> {
    let output = surfel(arguments);
    let text = stderr(&output);
    assert!(output.status.success(), "{arguments:?}: {text}");
    text.lines().filter(|line| line.starts_with("warning: ")).map(str::to_owned).collect()
}

#[test]
fn options_that_a_file_cannot_hold_are_warned_of() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    for (name, options, expected) in [
        ("a.jpg", &["--bit-depth", "16"][..], &["no effect on .jpg: only .png and .tif"][..]),
        (
            "a.jpg",
            &["--background", "transparent"],
            &[".jpg has no transparency: the background is white"],
        ),
        ("a.webp", &["--dpi", "200"], &["200 pixels per inch are not stated in the file"]),
        ("a.png", &["--dpi", "200"], &["stated in the file alone: without a scale"]),
        ("a.tif", &["--bit-depth", "16", "--no-background"], &[]),
        ("a.png", &["--dpi", "200", "--bit-depth", "8"], &["stated in the file alone"]),
        (
            "a.exr",
            &["--legend", "--scale-bar", "--north", "--caption", "May"],
            &[
                "no effect on .exr: nothing is drawn over its layers [--legend, --scale-bar, --north, --caption]",
            ],
        ),
        ("a.exr", &["--legend=false"], &[]),
    ] {
        let picture = folder.path(name);
        let arguments = [&["render", &cloud, "-o", &picture], &SMALL[..], options].concat();
        let found = warnings(&arguments);
        let matches = found.iter().zip(expected).all(|(line, text)| line.contains(text));
        assert!(found.len() == expected.len() && matches, "{name} {options:?}: {found:?}");
    }
    let movie = folder.path("a.gif");
    let movie = ["animate", &cloud, "-o", &movie, "--frames", "1"];
    let found = warnings(&[&movie, &SMALL[..], &["--no-background"]].concat());
    assert!(found[0].contains(".gif has no transparency: the background is black"), "{found:?}");
}

#[test]
fn options_for_other_files_and_surfaces_are_warned_of() {
    let folder = Folder::new();
    let ply = folder.write("dome.ply", dome(10));
    let text = folder.path("dome.xyz");
    succeed(&["prepare", &ply, "-o", &text, "--duplicates", "keep"]);
    let picture = folder.path("a.png");
    let render = |cloud: &str, options: &[&str]| {
        warnings(&[&["render", cloud, "-o", &picture], &SMALL[..], options].concat())
    };
    for (options, expected) in [
        (&["--columns", "x,y,z"][..], "no effect, since no file is text"),
        (&["--animation-name", "walk"], "no effect, since no file is glTF"),
        (&["--noise-threshold", "0.01"], "no effect: noise is estimated after 8 camera rays"),
        (&["--surface", "points", "--material", "mirror"], "the surface points shows nothing of a"),
    ] {
        let found = render(&ply, options);
        assert!(found.len() == 1 && found[0].contains(expected), "{options:?}: {found:?}");
    }
    for (options, ends) in [
        (&["--point-size", "8"][..], "points [--point-size, --surface]"),
        (&["--reach", "3"], "splat-fit [--reach, --surface]"),
        (&["--density", "3", "--surface", "disc"], "cylinder [--density, --surface]"),
        (&["--align", "each"], "for the surface splat [--align, --surface]"),
        (&["--gather-limit", "nearest"], "splat-fit and cylinder [--gather-limit, --surface]"),
        (&["--min-distance", "1", "--surface", "sphere"], "gaussian [--min-distance, --surface]"),
        (&["--structure", "scatter", "--radius", "0.1"], "deform [--structure, --radius]"),
        (&["--structure", "auto", "--radius", "median"], "deform [--structure, --radius]"),
        (&["--cmap", "turbo"], "[--cmap, --color]"),
        (&["--cmap", "turbo", "--range", "0,1", "--color", "red"], "[--cmap, --range, --color]"),
        (&["--light", "none", "--sun-elevation", "10"], "no sun shines [--sun-elevation, --light]"),
        (&["--light", "sun", "--sky-strength", "2"], "no sky shines [--sky-strength, --light]"),
    ] {
        let found = render(&ply, options);
        assert!(found.len() == 1 && found[0].ends_with(ends), "{options:?}: {found:?}");
    }
    let ends = ["--camera-position", "3,3,3", "--camera-focal-point", "0,0,0"];
    let found = render(&ply, &[&ends[..], &["--camera-azimuth-angle", "30"]].concat());
    let keys = "[--camera-azimuth-angle, --camera-position, --camera-focal-point]";
    assert!(found.len() == 1 && found[0].ends_with(keys), "{found:?}");
    for options in [
        &["--point-size", "8", "--surface", "points"][..],
        &["--reach", "3", "--surface", "mls"],
        &["--cmap", "turbo", "--range", "0,1", "--color", "elevation"],
        &["--sun-elevation", "10", "--sky-strength", "2"],
        &["--align", "each", "--gather-limit", "nearest", "--surface", "splat"],
        &["--min-distance", "1", "--structure", "scatter"],
        &["--structure", "surface", "--radius", "0.1"],
    ] {
        assert_eq!(render(&ply, options), [""; 0], "{options:?}");
    }
    let columns = ["--columns", "x,y,z,red,green,blue,class,rain"];
    assert_eq!(render(&text, &columns), [""; 0]);
    assert_eq!(render(&ply, &["--surface", "points", "--material", "unlit"]), [""; 0]);
    let prepared = folder.path("b.ply");
    let prepare =
        |options: &[&str]| warnings(&[&["prepare", &ply, "-o", &prepared], options].concat());
    for (options, ends) in [
        (&columns[..], "[--columns]"),
        (&["--structure", "scatter", "--radius", "0.1"], "[--structure, --radius]"),
    ] {
        let found = prepare(options);
        assert!(found.len() == 1 && found[0].ends_with(ends), "{found:?}");
    }
    assert_eq!(prepare(&["--structure", "scatter"]), [""; 0]);
}
