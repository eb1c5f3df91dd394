//! `--clip-box` and `--clip-plane` hide points and triangles.

use super::common::{Folder, dome, fail, shot, tile};

/// Returns the points of a level grid of spacing 1, from `first` to `last` along x and y, relative to `zero`, as text.
fn level(first: i32, last: i32, zero: [f64; 2]) -> String {
    let side = first..=last;
    let cells = side.clone().flat_map(|x| side.clone().map(move |y| [x, y]));
    let line = |[x, y]: [i32; 2]| {
        let [red, green] = [20 * x + 30, 20 * y + 30];
        format!(
            "{:.1} {:.1} 7.0 {red} {green} 90\n",
            zero[0] + f64::from(x),
            zero[1] + f64::from(y)
        )
    };
    cells.map(line).collect()
}

/// Options with which a picture depends on the visible points alone.
const PLAIN: [&str; 6] = ["--light", "none", "--radius", "0.8", "--camera-view-up", "0,1,0"];

#[test]
fn a_clip_box_shows_the_same_picture_as_a_cloud_of_the_points_inside() {
    let folder = Folder::new();
    for zero in [[0.0, 0.0], [562_300.0, 4_183_100.0]] {
        let all = folder.write("all.xyz", level(0, 8, zero));
        let middle = folder.write("middle.xyz", level(2, 6, zero));
        let [x, y] = zero.map(|zero| format!("[{},{}]", zero + 1.5, zero + 6.0));
        let position = format!("{},{},30", zero[0] + 4.0, zero[1] + 4.0);
        let focal_point = format!("{},{},7", zero[0] + 4.0, zero[1] + 4.0);
        let view = ["--camera-position", &position, "--camera-focal-point", &focal_point];
        let plain = [&PLAIN[..], &view].concat();
        let expected = shot(&folder, &[&[middle.as_str()][..], &plain].concat());
        assert_ne!(shot(&folder, &[&[all.as_str()][..], &plain].concat()), expected);
        let [x0, y0] = zero.map(|zero| zero + 1.5);
        let [x1, y1] = zero.map(|zero| zero + 6.0);
        let six = format!("{x0},{y0},-6,{x1},{y1},8");
        for bounds in [format!("({x},{y})"), format!("( {x}, {y}, [6, 8] )"), six] {
            let clipped = [&[all.as_str(), "--clip-box", &bounds][..], &plain].concat();
            assert!(shot(&folder, &clipped) == expected, "{bounds}");
        }
    }
}

#[test]
fn a_clip_plane_hides_triangles() {
    let folder = Folder::new();
    let both = tile(1.0, 0.0, [200, 100, 50]);
    let lower = both.replace("face 2", "face 1").replace("3 0 2 3\n", "");
    let (both, lower) = (folder.write("both.ply", both), folder.write("lower.ply", lower));
    let view = ["--camera-position", "0,-1,5", "--camera-focal-point", "0,0,0"];
    let plain = [&PLAIN[..], &view].concat();
    let clipped = [&[both.as_str(), "--clip-plane", "0,0,0,-1,1,0"][..], &plain].concat();
    let expected = shot(&folder, &[&[lower.as_str()][..], &plain].concat());
    assert!(shot(&folder, &clipped) == expected);
}

#[test]
fn a_box_of_six_numbers_may_begin_with_a_negative_one() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let view = ["--camera-position", "3,-3,3", "--camera-focal-point", "0,0,0"];
    let clipped = |bounds: &str| {
        shot(&folder, &[&[cloud.as_str(), "--clip-box", bounds][..], &view, &PLAIN].concat())
    };
    assert!(clipped("-1,-1,-1,0.5,0.5,1") == clipped("([-1,0.5],[-1,0.5],[-1,1])"));
    assert!(clipped("-1,-1,-1,0.5,0.5,1") != clipped("-2,-2,-2,2,2,2"));
}

#[test]
fn objects_are_clipped_in_world_coordinates_and_by_their_own_settings() {
    let folder = Folder::new();
    folder.write("first.xyz", level(0, 3, [0.0, 0.0]));
    folder.write("second.xyz", level(0, 8, [0.0, 0.0]));
    let picture = |object: &str, time: &str, options: &[&str]| {
        let scene = format!("[[object]]\ntranslate = [100, 0, 0]\n{object}\n");
        let scene = folder.write("scene.toml", scene);
        let view = ["--camera-position", "104,4,30", "--camera-focal-point", "104,4,7"];
        shot(&folder, &[&[scene.as_str(), "--time", time][..], options, &view, &PLAIN].concat())
    };
    let sequence = "files = [\"first.xyz\", \"second.xyz\"]\nfps = 1\n";
    let second = "file = \"second.xyz\"\n";
    let left = ["--clip-plane", "102.5,0,0,1,0,0"];
    let clipped = picture(second, "0", &left);
    assert_ne!(clipped, picture(second, "0", &[]));
    assert!(clipped == picture(sequence, "1", &left));
    let own = format!("{second}clip_plane = [102.5, 0, 0, 1, 0, 0]");
    assert!(clipped == picture(&own, "0", &["--clip-plane", "0,0,0,1,0,0"]));
    // A later cloud of a sequence may be hidden entirely.
    let beyond = ["--clip-box", "([100,103],[0,8])"];
    let elsewhere = "files = [\"first.xyz\", \"far.xyz\"]\nfps = 1\n";
    folder.write("far.xyz", level(0, 3, [50.0, 0.0]));
    assert_ne!(picture(elsewhere, "1", &beyond), picture(elsewhere, "0", &beyond));
}

#[test]
fn clipping_everything_is_an_error() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let mesh = folder.write("tile.ply", tile(1.0, 0.0, [200; 3]));
    let (outside, below) = ("([5,6],[5,6])", "0,0,-1,0,0,1");
    for (options, message) in [
        (&["--clip-box", outside][..], "--clip-box: everything is hidden"),
        (&["--clip-plane", below], "--clip-plane: everything is hidden"),
        (
            &["--clip-box", outside, "--clip-plane", below],
            "--clip-box, --clip-plane: everything is hidden",
        ),
    ] {
        let text = fail(&[&["render", &cloud, &mesh, "-o", "no.png"], options].concat(), 2);
        assert!(text.contains(message), "{text}");
    }
    // One of two files may be hidden entirely.
    shot(&folder, &[&cloud, &mesh, "--clip-plane", "0,0,0.1,0,0,-1"]);
}
