//! Scene descriptions.

use std::fs;
use std::path::Path;

/// Writes a scene with all features as TOML and as JSON, after a byte that selects the format.
pub fn write(folder: &Path) -> std::io::Result<()> {
    let toml = r##"# A scene
resolution = [64, 48]
spp = 2
light = ["sun", "sky"]
background = "#102030,#fff"
camera_panorama = false
[camera]
position = [1, -2.5, 3e0]
focal_point = [0, 0, 0]
[sun]
elevation = 30
[[object]]
name = "a"
file = "a.ply"
surface = "disc"
radius = "median:6"
translate = [1, 2, 3]
rotate = [0, 0, 90]
scale = 2
visible = true
material = { kind = "glass", ior = 1.3, attenuation_color = "#88ccff", thin = true }
instances = [{ translate = [5, 0, 0] }, { rotate = { axis = [0, 0, 1], angle = 30 }, scale = [1, 2, 3] }]
[[object]]
files = ["b.obj", "c.glb"]
fps = 5
parent = "a"
material = "mirror"
matrix = [1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1]
[[lamp]]
name = "l"
kind = "spot"
position = [0, 0, 4]
target = [1, 1, 0]
color = "#ffcc88"
strength = 10
radius = 0.1
range = 50
angle = 60
blend = 0.2
[[animation]]
object = "a"
times = [0, 1.5, 3]
interpolation = "cubic"
translate = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
rotate = [[0, 0, 0], { axis = [1, 1, 0], angle = 40 }, [0, 0, 90]]
scale = [1, [1, 2, 1], 0]
visible = [true, false, true]
[[animation]]
object = "b"
kind = "orbit"
seconds = 8
turns = -2
axis = [0, 1, 0]
center = [1, 0, 0]
[[animation]]
object = "l"
kind = "path"
points = [[0, 0, 4], [1, 0, 4], [1, 0, 4]]
seconds = 2
[[animation]]
object = "camera"
times = [0, 1]
interpolation = "ease"
position = [[1, 1, 1], [2, 2, 2]]
focal_point = [[0, 0, 0], [0, 0, 1]]
[[animation]]
object = "camera"
kind = "orbit"
seconds = 4
"##;
    let json = r##"{"spp": 2, "output": null, "camera": {"position": [1, 2, 3], "view-angle": 40.5},
"object": [{"file": "a.ply", "instances": {"scale": 0.5}, "material": {"color": "#fff", "alpha": "0.5"}}],
"lamp": [{"position": [0, 0, 1], "kind": "directional"}],
"animation": {"object": "a", "kind": "keys", "times": [0, 1], "interpolation": "step", "rotate": [[0, 0, 0], [0, 0, 9]]},
"info": {"points": 7}}"##;
    fs::write(folder.join("all.toml"), format!("\n{toml}"))?;
    fs::write(folder.join("all.json"), format!("\t{json}"))?;
    for (i, table) in toml.split("\n[[").enumerate().skip(1) {
        fs::write(folder.join(format!("{i}.toml")), format!("\n[[{table}"))?;
    }
    Ok(())
}
