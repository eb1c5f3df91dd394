//! What `--clip-box` and `--clip-plane` hide.

use super::common::{Folder, dome, fail, shot, tile};

/// Points a unit apart on a level square about (4, 4), from `first` to `last` in both directions, as text.
fn level(first: i32, last: i32, zero: [f64; 2]) -> String {
    let side = first..=last;
    let places = side.clone().flat_map(|x| side.clone().map(move |y| [x, y]));
    let line = |[x, y]: [i32; 2]| {
        let [red, green] = [20 * x + 30, 20 * y + 30];
        format!(
            "{:.1} {:.1} 7.0 {red} {green} 90\n",
            zero[0] + f64::from(x),
            zero[1] + f64::from(y)
        )
    };
    places.map(line).collect()
}

/// Options by which a picture depends on nothing but the points that are seen.
const PLAIN: [&str; 6] = ["--light", "none", "--radius", "0.8", "--camera-view-up", "0,1,0"];

#[test]
fn what_stays_is_seen_as_if_there_were_nothing_else() {
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
        for bounds in [format!("({x},{y})"), format!("( {x}, {y}, [6, 8] )")] {
            let clipped = [&[all.as_str(), "--clip-box", &bounds][..], &plain].concat();
            assert!(shot(&folder, &clipped) == expected, "{bounds}");
        }
    }
}

#[test]
fn triangles_are_hidden_too() {
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
fn objects_are_cut_where_they_stand_and_by_their_own_options() {
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
    // A cloud of a sequence may be hidden, if that which is seen first is not.
    let beyond = ["--clip-box", "([100,103],[0,8])"];
    let elsewhere = "files = [\"first.xyz\", \"far.xyz\"]\nfps = 1\n";
    folder.write("far.xyz", level(0, 3, [50.0, 0.0]));
    assert_ne!(picture(elsewhere, "1", &beyond), picture(elsewhere, "0", &beyond));
}

#[test]
fn to_hide_everything_is_an_error() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let mesh = folder.write("tile.ply", tile(1.0, 0.0, [200; 3]));
    let (outside, below) = ("([5,6],[5,6])", "0,0,-1,0,0,1");
    for (options, told) in [
        (&["--clip-box", outside][..], "--clip-box: nothing"),
        (&["--clip-plane", below], "--clip-plane: nothing"),
        (&["--clip-box", outside, "--clip-plane", below], "--clip-box, --clip-plane: nothing"),
    ] {
        let text = fail(&[&["render", &cloud, &mesh, "-o", "no.png"], options].concat(), 2);
        assert!(text.contains(told), "{text}");
    }
    // One of two may go.
    shot(&folder, &[&cloud, &mesh, "--clip-plane", "0,0,0.1,0,0,-1"]);
}
