//! The objects that `surfel demo --gallery` adds to the ruin: a ball of points, a knot of triangles, and a scene file
//! that makes glass, a mirror and gold of them.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::path::Path;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_formats::SaveOptions;
use surfel_scanner::ruin::UTM_ORIGIN;

/// Positions on the site.
const GLASS: DVec3 = DVec3::new(-6.4, -9.6, 1.62);
const MIRROR: DVec3 = DVec3::new(-1.5, -10.2, 1.32);
const KNOT: DVec3 = DVec3::new(-9.8, -8.2, 1.75);
const EYE: DVec3 = DVec3::new(-13.2, -21.0, 4.2);
const TARGET: DVec3 = DVec3::new(-2.6, -3.0, 2.6);

/// Writes ball.ply, knot.obj and gallery.toml next to demo.laz.
pub fn write(folder: &Path, progress: &dyn Progress) -> anyhow::Result<()> {
    surfel_formats::save(
        &folder.join("ball.ply"),
        &ball(60_000),
        &SaveOptions::default(),
        progress,
    )?;
    for (name, text) in [("knot.obj", knot()), ("gallery.toml", scene())] {
        surfel_formats::save_text(&folder.join(name), &text)?;
    }
    Ok(())
}

/// Returns points of the unit sphere, on a spiral that keeps them evenly apart (Swinbank and Purser 2006).
fn ball(n: usize) -> PointCloud {
    let golden = PI * (3.0 - 5f64.sqrt());
    let position = |i: usize| {
        let z = 1.0 - (2 * i + 1) as f64 / n as f64;
        let (sin, cos) = (golden * i as f64).sin_cos();
        let level = (1.0 - z * z).sqrt();
        DVec3::new(level * cos, level * sin, z).as_vec3()
    };
    let positions: Vec<Vec3> = (0..n).map(position).collect();
    PointCloud { normals: Some(positions.clone()), ..PointCloud::from_positions(positions) }
}

/// Returns a trefoil knot of a round tube as OBJ, with normals.
fn knot() -> String {
    const N_ALONG: usize = 600;
    const N_AROUND: usize = 80;
    const THICKNESS: f64 = 0.34;
    let spine = |t: f64| {
        let (sin, cos) = (2.0 * t).sin_cos();
        let reach = 1.0 + 0.45 * (3.0 * t).cos();
        DVec3::new(reach * cos, reach * sin, 0.62 * (3.0 * t).sin())
    };
    let mut text = "# A trefoil knot\n".to_owned();
    for i in 0..N_ALONG {
        let t = TAU * i as f64 / N_ALONG as f64;
        let along = (spine(t + 1e-4) - spine(t - 1e-4)).normalize();
        let across = along.cross(spine(t)).normalize();
        let outward = across.cross(along);
        for j in 0..N_AROUND {
            let (sin, cos) = (TAU * j as f64 / N_AROUND as f64).sin_cos();
            let normal = cos * outward + sin * across;
            let position = spine(t) + THICKNESS * normal;
            // Writing to a text cannot fail.
            let _ = writeln!(text, "v {:.6} {:.6} {:.6}", position.x, position.y, position.z);
            let _ = writeln!(text, "vn {:.5} {:.5} {:.5}", normal.x, normal.y, normal.z);
        }
    }
    let vertex = |i: usize, j: usize| N_AROUND * (i % N_ALONG) + j % N_AROUND + 1;
    for i in 0..N_ALONG {
        for j in 0..N_AROUND {
            let [a, b, c, d] =
                [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| vertex(i, j));
            let _ = writeln!(text, "f {a}//{a} {d}//{d} {c}//{c} {b}//{b}");
        }
    }
    text
}

fn scene() -> String {
    let world = |position: DVec3| {
        let [x, y, z] = (UTM_ORIGIN + position).to_array();
        format!("[{x:.3}, {y:.3}, {z:.3}]")
    };
    let (eye, target) = (world(EYE), world(TARGET));
    let (glass, mirror, knot) = (world(GLASS), world(MIRROR), world(KNOT));
    format!(
        r##"# A scanned ruin with three objects in it. `surfel render --help` lists the settings as options.
resolution = "1280x720"
background = "#4f7fb8,#d5e2ee"

[camera]
position = {eye}
focal-point = {target}
view-angle = 34

[sun]
azimuth = 190
elevation = 32

[[object]]
file = "demo.laz"
orient = "mst"

# Points of a ball: 60 thousand of them, no mesh.
[[object]]
name = "glass"
file = "ball.ply"
orient = "mst"
material = {{ kind = "glass", attenuation-color = "#bfe8d8", attenuation-distance = 2 }}
translate = {glass}
scale = 1.6

# The same points again, held once.
[[object]]
name = "mirror"
file = "ball.ply"
orient = "mst"
material = "mirror"
translate = {mirror}
scale = 1.3

# Triangles.
[[object]]
name = "knot"
file = "knot.obj"
material = {{ kind = "metal", color = "#d9a441", roughness = 0.12 }}
translate = {knot}
rotate = [70, 0, 20]

[[animation]]
object = "knot"
kind = "orbit"
seconds = 6

[[animation]]
object = "camera"
kind = "orbit"
seconds = 6
"##
    )
}

#[cfg(test)]
mod tests {
    //! Old files are replaced as a whole, and the scene is one that can be rendered.

    use super::*;
    use std::fs;
    use surfel::SceneDescription;
    use surfel_core::progress::NoProgress;
    use surfel_core::scene::Material;
    use surfel_scanner::ruin;

    #[test]
    fn files_are_replaced_not_overwritten() {
        let folder = std::env::temp_dir().join(format!("surfel-gallery-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let names = ["ball.ply", "knot.obj", "gallery.toml"];
        for name in names {
            fs::write(folder.join(name), "old").unwrap();
            // Another name of the old file, which would change if that were overwritten.
            fs::hard_link(folder.join(name), folder.join(format!("{name}.old"))).unwrap();
        }
        write(&folder, &NoProgress).unwrap();
        for name in names {
            assert_eq!(fs::read(folder.join(format!("{name}.old"))).unwrap(), b"old", "{name}");
            assert!(3 < fs::metadata(folder.join(name)).unwrap().len(), "{name}");
        }
        fs::remove_dir_all(&folder).unwrap();
    }
    #[test]
    fn the_scene_has_the_ruin_glass_a_mirror_and_gold_before_a_camera_that_turns() {
        let folder = std::env::temp_dir().join(format!("surfel-scene-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        write(&folder, &NoProgress).unwrap();
        let ruin = ruin::scan(2000, &NoProgress).unwrap();
        let file = folder.join("demo.laz");
        surfel_formats::save(&file, &ruin, &SaveOptions::default(), &NoProgress).unwrap();
        let mut description = SceneDescription::read(&folder.join("gallery.toml")).unwrap();
        description.picture.resolution = Some((64, 36));
        let resolved = surfel::resolve(&description, &NoProgress).unwrap();
        let mut scene = resolved.build(&NoProgress).unwrap();
        fs::remove_dir_all(&folder).unwrap();

        assert_eq!(scene.flat().instances.len(), 4);
        let materials = &scene.flat().materials;
        let count = |has: fn(&Material) -> bool| materials.iter().filter(|one| has(one)).count();
        let is_mirror = |one: &Material| one.metallic == 1.0 && one.roughness == 0.0;
        let is_gold = |one: &Material| one.metallic == 1.0 && one.ignores_vertex_colors;
        assert_eq!((count(|one| one.transmission == 1.0), count(is_mirror)), (1, 1));
        assert_eq!(count(is_gold), 2, "the mirror and the knot");
        // After half of six seconds the camera is on the other side of what it looks at.
        let mut position_at = |time_secs: f64| {
            scene.seek(time_secs, &NoProgress).unwrap();
            scene.flat().camera.position - UTM_ORIGIN
        };
        assert!(position_at(0.0).distance(EYE) < 0.01);
        let opposite = DVec3 { z: EYE.z, ..2.0 * TARGET - EYE };
        assert!(position_at(3.0).distance(opposite) < 0.01);
    }
}
