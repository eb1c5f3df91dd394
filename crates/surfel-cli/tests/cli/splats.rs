//! Trained splats: what is chosen for them, and what options do.

use super::common::{Folder, SMALL, fail, read_png, shot, stderr, succeed, surfel, tile};

const PROPERTIES: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
    "rot_0", "rot_1", "rot_2", "rot_3",
];

/// A view from above at the origin.
const FROM_ABOVE: [&str; 6] =
    ["--camera-position", "0,0,12", "--camera-focal-point", "0,0,0", "--camera-view-up", "0,1,0"];

/// Returns two squares of nearly opaque splats, one below the other, as PLY, whose colour is the sRGB value 204, 51, 128.
fn splats(n_side: i32) -> String {
    let header: String = PROPERTIES.map(|name| format!("property float {name}\n")).concat();
    let cells = (0..n_side * n_side).map(|i| (i % n_side - n_side / 2, i / n_side - n_side / 2));
    // The colours are (c - 0.5) / 0.2821, the deviations e^-0.5 and e^-4.
    let splat = |(x, y): (i32, i32)| {
        let shape = "1.0635 -1.0635 0.00695 6 -0.5 -0.5 -4 1 0 0 0";
        format!("{x} {y} 0 {shape}\n{x} {y} -0.5 {shape}\n")
    };
    let body: String = cells.map(splat).collect();
    format!(
        "ply\nformat ascii 1.0\nelement vertex {}\n{header}end_header\n{body}",
        2 * n_side * n_side
    )
}

/// Returns the colour of the middle pixel of a picture.
fn middle(folder: &Folder, arguments: &[&str]) -> [u8; 3] {
    let picture = folder.path("picture.png");
    let size = ["--resolution", "33x25", "--spp", "1", "-o", &picture];
    succeed(&[&["render"], arguments, &size].concat());
    let (width, height, channels, samples) = read_png(&picture);
    let pixel = (height / 2 * width + width / 2) as usize * channels;
    [samples[pixel], samples[pixel + 1], samples[pixel + 2]]
}

#[test]
fn splats_show_their_trained_colours_with_no_option() {
    let folder = Folder::new();
    let file = folder.write("splats.ply", splats(9));
    let picture = folder.path("a.png");
    let arguments =
        [&["render", &file, "-o", &picture, "--resolution", "32x24"][..], &FROM_ABOVE].concat();
    let message = stderr(&surfel(&arguments));
    for line in ["surface gaussian: trained splats", "colors as trained", "no lights"] {
        assert!(message.contains(line), "{line}: {message}");
    }
    assert!(!message.contains("exposure"), "{message}");
    let with =
        |arguments: &[&str]| middle(&folder, &[&[file.as_str()], arguments, &FROM_ABOVE].concat());
    assert_eq!(with(&[]), [204, 51, 128]);
    // Light and materials change discs, and not Gaussians.
    let sun = ["--light", "sun", "--sun-elevation", "20"];
    assert_eq!(with(&[&sun[..], &["--material", "mirror"]].concat()), [204, 51, 128]);
    assert_ne!(with(&[&sun[..], &["--surface", "disc"]].concat()), [204, 51, 128]);
    assert_eq!(with(&["--surface", "disc", "--light", "none"]), [204, 51, 128]);
    // Other colours than those of the file.
    assert_eq!(with(&["--color", "#102030"]), [16, 32, 48]);
}

#[test]
fn what_is_chosen_for_splats_is_written_into_the_description() {
    let folder = Folder::new();
    let file = folder.write("splats.ply", splats(5));
    let single = succeed(&["render", &file, "--dry-run", "-o", "a.png"]);
    assert!(single.contains("\"gaussian\""), "{single}");
    // Beside a cloud of points, each has its own surface; a mesh has light.
    let scan = folder.write("scan.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0.5 0.5 0.2\n");
    let both = ["render", &file, &scan, "--dry-run", "-o", "a.png"];
    let scene = succeed(&[&both[..], &SMALL].concat());
    assert!(!scene.contains("\"gaussian\""), "{scene}");
    let again = folder.write("scene.json", &scene);
    let pictures = [shot(&folder, &[&again]), shot(&folder, &[&file, &scan])];
    assert!(pictures[0] == pictures[1]);
    let mesh = folder.write("mesh.ply", tile(1.0, -2.0, [200, 100, 50]));
    let with_mesh = succeed(&["render", &file, &mesh, "--dry-run", "-o", "a.png"]);
    assert!(with_mesh.contains("\"gaussian\"") && with_mesh.contains("\"sun\""), "{with_mesh}");
}

#[test]
fn clipped_and_filtered_splats_are_those_of_a_smaller_file() {
    let folder = Folder::new();
    let file = folder.write("splats.ply", splats(9));
    let smaller: String = splats(9)
        .lines()
        .filter(|line| !line.starts_with("-4") && !line.starts_with("-3"))
        .map(|line| format!("{line}\n"))
        .collect();
    let smaller = folder.write("smaller.ply", smaller.replace("vertex 162", "vertex 126"));
    let expected = shot(&folder, &[&[smaller.as_str()][..], &FROM_ABOVE].concat());
    let filters =
        ["--clip-box=-2.5,-9,-9,9,9,9", "--crop=-2.5,-9,9,9", "--filter=x > -2.5 && scale_2 < -3"];
    assert!(shot(&folder, &[&[file.as_str()][..], &FROM_ABOVE].concat()) != expected);
    for filter in filters {
        assert!(
            shot(&folder, &[&[file.as_str(), filter][..], &FROM_ABOVE].concat()) == expected,
            "{filter:?}"
        );
    }
}

#[test]
fn prepared_splats_stay_splats() {
    let folder = Folder::new();
    let file = folder.write("splats.ply", splats(5));
    for name in ["prepared.ply", "prepared.laz"] {
        let prepared = folder.path(name);
        succeed(&["prepare", &file, "-o", &prepared]);
        assert_eq!(
            middle(&folder, &[&[prepared.as_str()][..], &FROM_ABOVE].concat()),
            [204, 51, 128]
        );
    }
}

#[test]
fn other_clouds_are_no_gaussians() {
    let folder = Folder::new();
    let scan = folder.write("scan.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0\n");
    let message = fail(&["render", &scan, "--surface", "gaussian", "-o", &folder.path("a.png")], 1);
    assert!(message.contains("scan.xyz") && message.contains("f_dc_0"), "{message}");
    let message = fail(&["bench", &scan, "--surface", "gaussian"], 2);
    assert!(message.contains("surfel render --stats"), "{message}");
    let spz = folder.write("a.spz", b"\x1f\x8b\x08");
    let message = fail(&["render", &spz, "-o", &folder.path("a.png")], 1);
    assert!(message.contains("export the splats as PLY"), "{message}");
}

#[test]
fn info_shows_the_degree_of_the_harmonics() {
    let folder = Folder::new();
    let file = folder.write("splats.ply", splats(3));
    for arguments in [&["info", &file][..], &["info", "--summary", &file]] {
        let table = succeed(arguments);
        assert!(table.contains("harmonics     degree 0"), "{table}");
    }
    let info = succeed(&["info", "--json", &file]);
    assert!(info.contains("\"spherical_harmonics_degree\": 0"), "{info}");
    let plain = folder.write("plain.xyz", "0 0 0\n1 0 0\n0 1 0\n");
    assert!(!succeed(&["info", &plain]).contains("harmonics"));
}
