//! Writes the initial corpus of the fuzzer: small valid files in the folder `corpus` next to this file.

use std::fs;
use std::path::Path;

use e57::{E57Writer, Record, RecordDataType, RecordName, RecordValue};
use surfel_core::image::Image;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::{PointCloud, Scalar, Values};
use surfel_core::progress::NoProgress;
use surfel_formats::{ImageOptions, SaveOptions, encode_png, save, save_image};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for target in [
        "ply",
        "xyz",
        "las",
        "bin",
        "pcd",
        "ptx",
        "e57",
        "environment",
        "obj",
        "stl",
        "off",
        "mtl",
        "gltf",
        "scene",
        "viewer",
        "area",
        "filter",
        "crs",
    ] {
        fs::create_dir_all(corpus.join(target))?;
    }
    for (name, cloud) in [("bare", bare_cloud(7)), ("full", full_cloud(7))] {
        for (target, extension) in [("ply", "ply"), ("las", "las"), ("las", "laz")] {
            let path = corpus.join(target).join(format!("{name}.{extension}"));
            save(&path, &cloud, &SaveOptions::default(), &NoProgress)?;
        }
    }
    write_sequential_laz(&corpus.join("las"))?;
    let ply = "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int i\n\
        element vertex 2\nproperty float x\nproperty double y\nproperty short z\n\
        property list uint ushort l\nend_header\n3 1 2 3\n0 1 2 1 5\n3 4 5 0\n";
    fs::write(corpus.join("ply/ascii.ply"), ply)?;
    for order in ["big", "little"] {
        let binary = ply.replace("ascii", &format!("binary_{order}_endian"));
        fs::write(corpus.join(format!("ply/{order}.ply")), binary)?;
    }
    let names = ["f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2"]
        .into_iter()
        .chain(["rot_0", "rot_1", "rot_2", "rot_3", "station", "row_index", "column_index"]);
    let properties: String = names.map(|name| format!("property float {name}\n")).collect();
    let splats = format!(
        "ply\nformat ascii 1.0\ncomment station 1 2 3 0 0 0 1 2 2 a name\nelement vertex 2\n\
        property float x\nproperty float y\nproperty float z\n{properties}end_header\n\
        0 0 0 .5 .5 .5 2 -3 -3 -5 1 0 0 0 0 0 0\n1 0 0 .5 0 -.5 9 -3 -2 -5 .5 .5 .5 .5 0 1 1\n"
    );
    fs::write(corpus.join("ply/splats.ply"), splats)?;
    write_meshes(&corpus)?;
    let texts = [
        "1 2 3\n4 5 6\n",
        "2\n1 2 3 -4 5 6 7\n1 2 3 -4 5 6 7\n",
        "# c\nx,y,z,r,g,b,time\n1,2,3,4,5,6,\n-1,2e3,nan,4,5,6,7.5",
        "1;2;3;0;6;7;8;9\n",
        "v 1 2 3\nv 1 2 3 1\nf 1 2 1\n",
        "v 1 2 3 0 0.5 1\n",
        "ncols 3\nnrows 2\nxllcorner 0.5\nyllcenter 1\ncellsize 10\nNODATA_value -1\n1 2 3\n-1 5 6\n",
        "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (I, P)\n7 1 2 3 4 5 6 0.5 16 65 15\n8 1 2 3 4 5 6 0.5\n",
        "1,5\t2,5\tNA\n1,5\t2,5\t3\n",
    ];
    for (i, text) in texts.iter().enumerate() {
        fs::write(corpus.join(format!("xyz/{i}")), text)?;
    }
    let record = [1.0f32, 2.0, 3.0, 0.5, 0.0, 0.0, 1.0].map(f32::to_le_bytes).concat();
    let non_finite =
        [f32::NAN, 1e30, -0.0, -1.0, 0.0, f32::INFINITY, 2.0].map(f32::to_le_bytes).concat();
    fs::write(corpus.join("bin/one.bin"), &record)?;
    fs::write(corpus.join("bin/three.bin"), [&record[..], &non_finite, &record].concat())?;
    write_conditions(&corpus)?;
    write_scans(&corpus)?;
    write_gltf(&corpus.join("gltf"))?;
    write_scenes(&corpus.join("scene"))?;
    write_viewer_input(&corpus.join("viewer"))?;
    write_environment_maps(&corpus.join("environment"))
}

/// Writes LAZ files of old point formats, whose chunks are not layered.
fn write_sequential_laz(folder: &Path) -> las::Result<()> {
    for number in [1, 3] {
        let mut builder = las::Builder::from((1, 2));
        builder.point_format = las::point::Format::new(number)?;
        builder.point_format.is_compressed = true;
        let path = folder.join(format!("sequential-{number}.laz"));
        let mut writer = las::Writer::from_path(path, builder.into_header()?)?;
        for i in 0..9 {
            writer.write_point(las::Point {
                x: f64::from(i),
                gps_time: Some(f64::from(i) / 8.0),
                color: (number == 3).then(|| las::Color::new(i as u16, 7, 65535)),
                ..las::Point::default()
            })?;
        }
        writer.close()?;
    }
    Ok(())
}

/// Writes areas and conditions on columns.
fn write_conditions(corpus: &Path) -> std::io::Result<()> {
    let rings = "[[[0,0],[4,0],[4,4],[0,0]],[[1,0.5],[2,0.5],[2,1],[1,0.5]]]";
    let feature = |kind: &str, coordinates: &str| {
        format!(
            r#"{{"type":"Feature","properties":null,"geometry":{{"type":"{kind}","coordinates":{coordinates}}}}}"#
        )
    };
    let features = [feature("Polygon", rings), feature("MultiPolygon", &format!("[{rings}]"))];
    let areas = [
        "POLYGON ((0 0, 4 0, 4 4, 0 0), (1 0.5, 2 0.5, 2 1, 1 0.5))",
        "MULTIPOLYGON Z (((0 0 1, 1 0 1, 0 1 1, 0 0 1)), ((-1e9 2 0, 3 .5 0, 2 2 0)))",
        "([0,10],[-1.5,5],[0,1e3])",
        "0,0,10,5",
        &features[0],
        &format!(r#"{{"type":"FeatureCollection","features":[{}]}}"#, features.join(",")),
        r#"{"type":"GeometryCollection","geometries":[{"type":"Point","coordinates":[1,2]}]}"#,
    ];
    for (i, text) in areas.iter().enumerate() {
        fs::write(corpus.join(format!("area/{i}")), text)?;
    }
    let conditions = [
        "classification == 2 && z < 1200",
        "not (Intensity[100:] or ReturnNumber(1:3]) and x != -1.5e3",
        "!(blue>=65535||red<=y)",
    ];
    for (i, text) in conditions.iter().enumerate() {
        fs::write(corpus.join(format!("filter/{i}")), text)?;
    }
    let systems = [
        "EPSG:25832+5783",
        "EPSG:4978",
        r#"PROJCS["a",GEOGCS["b",DATUM["c",SPHEROID["d",6378137,298.26]],PRIMEM["Greenwich",0],UNIT["degree",0.01745]],PROJECTION["Transverse_Mercator"],PARAMETER["central_meridian",9],PARAMETER["scale_factor",0.9996],UNIT["metre",1],AUTHORITY["EPSG","25832"]]"#,
    ];
    for (i, text) in systems.iter().enumerate() {
        fs::write(corpus.join(format!("crs/{i}")), text)?;
    }
    Ok(())
}

/// Writes the formats of scanners: PCD in each encoding, PTX, and E57 with floats and with scaled integers.
fn write_scans(corpus: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let header = "# .PCD v.7\nVERSION .7\nFIELDS x y z rgb _\nSIZE 4 4 4 4 1\nTYPE F F F U U\n\
        COUNT 1 1 1 1 2\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ";
    let ascii = format!("{header}ascii\n1 2 3 255 0 0\nnan 5 6 4.2e6 0 0\n");
    fs::write(corpus.join("pcd/ascii.pcd"), ascii)?;
    fs::write(corpus.join("pcd/binary.pcd"), [header.as_bytes(), b"binary\n", &[7; 36]].concat())?;
    // A run of one byte, then 35 repetitions of it.
    let compressed = [5, 0, 0, 0, 36, 0, 0, 0, 0, 7, 0xe0, 26, 0];
    let compressed = [header.as_bytes(), b"binary_compressed\n", &compressed].concat();
    fs::write(corpus.join("pcd/compressed.pcd"), compressed)?;
    let pose = "2\n1\n1 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5e5 4e6 10 1\n";
    let scans = format!("{pose}1 2 3 0.5 1 2 3\n0 0 0 0.5 0 0 0\n{pose}1 2 3 1\n4 5 6 1\n");
    fs::write(corpus.join("ptx/scans.ptx"), scans)?;

    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut file, "file")?;
    let axes = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
    let data_type = RecordDataType::ScaledInteger { min: -9, max: 600, scale: 0.01, offset: 1.0 };
    let axes = axes.map(|name| Record { name, data_type: data_type.clone() }).to_vec();
    let mut scan = writer.add_pointcloud("integers", axes)?;
    scan.add_point(vec![RecordValue::ScaledInteger(7); 3])?;
    scan.add_point(vec![RecordValue::ScaledInteger(-3); 3])?;
    scan.finalize()?;
    let sphere = vec![
        Record::SPHERICAL_RANGE_F32,
        Record::SPHERICAL_AZIMUTH_F32,
        Record::SPHERICAL_ELEVATION_F32,
        Record::SPHERICAL_INVALID_STATE,
    ];
    let mut scan = writer.add_pointcloud("angles", sphere)?;
    let angles = [1.0, 0.5, 0.25].map(RecordValue::Single).to_vec();
    scan.add_point([angles, vec![RecordValue::Integer(0)]].concat())?;
    scan.finalize()?;
    writer.finalize()?;
    drop(writer);
    let bytes = file.into_inner();
    // The descriptions of the scans take the last two pages.
    for n_lost in 0..2 {
        let length = bytes.len().saturating_sub(1024 * n_lost);
        fs::write(corpus.join(format!("e57/scans{n_lost}.e57")), &bytes[..length])?;
    }
    write_cut_scans(&corpus.join("e57/cut.e57"))
}

/// Writes an E57 file of floats and doubles that ends before its description.
fn write_cut_scans(path: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut file, "file")?;
    let singles = [Record::CARTESIAN_X_F32, Record::CARTESIAN_Y_F32, Record::CARTESIAN_Z_F32];
    let doubles = [Record::CARTESIAN_X_F64, Record::CARTESIAN_Y_F64, Record::CARTESIAN_Z_F64];
    let values: [fn(f64) -> RecordValue; 2] =
        [|value| RecordValue::Single(value as f32), RecordValue::Double];
    for (prototype, value) in [singles, doubles].into_iter().zip(values) {
        let mut scan = writer.add_pointcloud("scan", prototype.to_vec())?;
        for i in 0..150 {
            let angle = f64::from(i) * 0.37;
            scan.add_point([8.3 * angle.cos(), 9.1 * angle.sin(), angle].map(value).to_vec())?;
        }
        scan.finalize()?;
    }
    writer.finalize()?;
    drop(writer);
    let bytes = file.into_inner();
    let xml_start = u64::from_le_bytes(*bytes[24..].first_chunk().ok_or("no header")?) as usize;
    Ok(fs::write(path, &bytes[..xml_start / 1024 * 1024])?)
}

/// Writes an HDR file in each encoding, and an EXR file.
fn write_environment_maps(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let head = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\nCOLORCORR=1 1 2\n\n";
    let channels = [&[2, 2, 0, 9, 137, 50, 3, 1, 2, 3, 134, 9][..], &[137, 0, 137, 136]].concat();
    let hdrs = [
        ("flat.hdr", "-Y 1 +X 2\n", vec![1, 2, 3, 136, 4, 5, 6, 130]),
        ("old.hdr", "+X 1 -Y 300\n", vec![1, 2, 3, 136, 1, 1, 1, 43, 1, 1, 1, 1]),
        ("channels.hdr", "+Y 2 -X 9\n", channels.repeat(2)),
    ];
    for (name, size, pixels) in hdrs {
        fs::write(folder.join(name), [head.as_bytes(), size.as_bytes(), &pixels].concat())?;
    }
    Ok(save_image(&folder.join("light.exr"), &Image::new(9, 3), &ImageOptions::default())?)
}

/// Writes meshes in every format, and materials.
fn write_meshes(corpus: &Path) -> std::io::Result<()> {
    let ply = "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement tristrips 1\n\
        property list int int vertex_indices\nelement vertex 4\nproperty float x\nproperty double y\n\
        property float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty uchar red\n\
        property uchar green\nproperty uchar blue\nproperty uchar alpha\nproperty float s\n\
        property float t\nelement face 1\nproperty list uchar uint vertex_index\n\
        property list uchar float texcoord\nend_header\n\
        5 0 1 2 -1 3\n0 0 0 0 0 1 1 2 3 4 0 1\n1 0 0 0 0 1 1 2 3 4 0 1\n1 1 0 0 0 1 1 2 3 4 0 1\n\
        0 1 0 0 0 1 1 2 3 4 0 1\n4 0 1 2 3 8 0 0 1 0 1 1 0 1\n";
    fs::write(corpus.join("ply/mesh.ply"), ply)?;
    let header = "element vertex 3\nproperty char x\nproperty char y\nproperty char z\n\
        element face 2\nproperty list uchar uchar vertex_index\nend_header\n";
    let body = [0, 0, 0, 1, 0, 0, 0, 1, 0, /* faces */ 3, 0, 1, 2, 4, 2, 1, 0, 1];
    for order in ["big", "little"] {
        let header = format!("ply\nformat binary_{order}_endian 1.0\n{header}");
        let mesh = [header.as_bytes(), &body].concat();
        fs::write(corpus.join(format!("ply/mesh-{order}.ply")), mesh)?;
    }
    let obj = "mtllib a.mtl b.mtl\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0\nvt 0 0.5\nvn 0 0 1\n\
        usemtl a\nf 1/1/1 2/1/1 3/1/1\nusemtl b\nf -3//1 -2//-1 \\\n -1 # c\ng x\ns 1\nf 1 2 3 1\n";
    fs::write(corpus.join("obj/all.obj"), obj)?;
    fs::write(corpus.join("obj/faces.obj"), "f 1 2 3\nf -1/-1/-1 1/1/1 2//1\n")?;
    let stl = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 0\n\
        endloop\nendfacet\nendsolid a\n";
    fs::write(corpus.join("stl/ascii.stl"), stl)?;
    let corners = [0.0f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, -0.0];
    let facet = [&corners.map(f32::to_le_bytes).concat()[..], &[0; 2]].concat();
    fs::write(corpus.join("stl/facet"), &facet)?;
    fs::write(corpus.join("stl/binary.stl"), [&[b' '; 80][..], &[1, 0, 0, 0], &facet].concat())?;
    let off = "COFF\n4 2 0\n0 0 0 255 0 0 255\n1 0 0 0 1 0 1\n1 1 0 1 1 1 1\n0 1 0 9 9 9 9\n4 0 1 2 3\n3 0 1 2 1 1 1\n";
    fs::write(corpus.join("off/colors.off"), off)?;
    fs::write(
        corpus.join("off/normals.off"),
        "NOFF 3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1 # c\n3 0 1 2\n",
    )?;
    let mtl = "newmtl m\nKd 0.5 0.25 1\nKs 0.5\nNs 30\nKe 1 2 3\nTf 1 1 1\nNi 1.5\nd 0.5\nTr 0.5\nillum 7\n\
        Pr 0.5\nPm 1\nmap_Kd -s 2 3 1 -o 0.5 -clamp on -mm 0 1 a.png\nmap_Ke b.png\nnorm -bm 2 c.png\n";
    fs::write(corpus.join("mtl/all.mtl"), mtl)?;
    fs::write(corpus.join("mtl/mirror.mtl"), "newmtl m\nKs 1 1 0.5\nillum 3\n")
}

/// Writes a scene with all supported features, as GLB and as JSON.
fn write_gltf(folder: &Path) -> std::io::Result<()> {
    let png = encode_png(&Image::new(2, 2), &ImageOptions::default());
    let png = png.map_err(std::io::Error::other)?;
    let floats = |floats: &[f32]| -> Vec<u8> {
        floats.iter().flat_map(|value| value.to_le_bytes()).collect()
    };
    let square = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let identity = floats(&[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.]);
    let times = floats(&[0.0, 1.0]);
    let bytes = [0, 1, 2, 0, 2, 3, 0, 0, 127, 0, 0, 127, 255, 0, 0, 127];
    let buffer = [&square[..], &identity, &times, &bytes, &png].concat();
    let view = |offset: usize, length: usize| {
        format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#)
    };
    let views = [view(0, 48), view(48, 64), view(112, 8), view(120, 16), view(136, png.len())];
    let accessor = |view: usize, offset: usize, component: usize, kind: &str, count: usize| {
        format!(
            r#"{{"bufferView":{view},"byteOffset":{offset},"componentType":{component},"type":"{kind}","count":{count}}}"#
        )
    };
    let accessors = [
        accessor(0, 0, 5126, "VEC3", 4),
        accessor(3, 0, 5121, "SCALAR", 6),
        accessor(0, 0, 5126, "VEC2", 4),
        accessor(3, 0, 5121, "VEC4", 4),
        accessor(1, 0, 5126, "MAT4", 1),
        accessor(2, 0, 5126, "SCALAR", 2),
        accessor(0, 0, 5126, "VEC3", 2),
        accessor(1, 0, 5126, "VEC4", 2),
        accessor(3, 0, 5120, "VEC3", 4),
        r#"{"componentType":5126,"type":"VEC3","count":4,"sparse":{"count":1,"indices":{"bufferView":3,"byteOffset":1,"componentType":5121},"values":{"bufferView":0,"byteOffset":12}}}"#.into(),
    ];
    let rest = r#""scene":0,"scenes":[{"nodes":[0,1,3]}],
"nodes":[{"mesh":0,"skin":0,"weights":[0.5]},{"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,1,2,3,1],"children":[2],"camera":0},
{"translation":[1,2,3],"rotation":[0,0,0,1],"scale":[1,2,1],"extensions":{"KHR_lights_punctual":{"light":0}}},
{"mesh":1,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":6}}}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":8,"TEXCOORD_0":2,"COLOR_0":3,"JOINTS_0":3,"WEIGHTS_0":3,"TANGENT":3},"indices":1,"material":0,"mode":5,"targets":[{"POSITION":9}]}]},
{"primitives":[{"attributes":{"POSITION":0,"COLOR_0":3},"mode":0},{"attributes":{"POSITION":0},"indices":1,"mode":6}]}],
"skins":[{"joints":[2],"inverseBindMatrices":4}],
"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}},"alphaMode":"MASK","extensions":{"KHR_materials_transmission":{"transmissionFactor":1},"KHR_materials_volume":{"thicknessFactor":1},"KHR_materials_ior":{"ior":1.4}}}],
"textures":[{"source":0,"sampler":0}],"samplers":[{"wrapS":33071}],"images":[{"bufferView":4}],
"cameras":[{"type":"perspective","perspective":{"yfov":1}}],
"extensions":{"KHR_lights_punctual":{"lights":[{"type":"spot","spot":{"outerConeAngle":0.5}}]}},
"animations":[{"samplers":[{"input":5,"output":6},{"input":5,"output":7,"interpolation":"STEP"},{"input":5,"output":5}],
"channels":[{"sampler":0,"target":{"node":1,"path":"translation"}},{"sampler":1,"target":{"node":2,"path":"rotation"}},{"sampler":2,"target":{"node":0,"path":"weights"}}]}]"#;
    let json = |buffer: &str| {
        let (accessors, views) = (accessors.join(","), views.join(","));
        let start = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{buffer}],"bufferViews":[{views}],"accessors":[{accessors}],"#
        );
        // The skin has only joint 0, so the joints come from a separate accessor of zeros.
        (start + rest + "}").replace(r#""JOINTS_0":3"#, r#""JOINTS_0":10"#).replace(
            r#"],"scene":0"#,
            r#",{"componentType":5121,"type":"VEC4","count":4}],"scene":0"#,
        )
    };
    let escaped: String = buffer.iter().map(|byte| format!("%{byte:02x}")).collect();
    let length = buffer.len();
    let data = format!(r#"{{"byteLength":{length},"uri":"data:,{escaped}"}}"#);
    fs::write(folder.join("scene.gltf"), json(&data))?;
    let mut json = json(&format!(r#"{{"byteLength":{length}}}"#)).into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |n: usize| (n as u32).to_le_bytes();
    let header =
        [&b"glTF"[..], &word(2), &word(28 + json.len() + length), &word(json.len()), b"JSON"];
    let glb = [&header.concat()[..], &json, &word(length), b"BIN\0", &buffer].concat();
    surfel_formats::load_gltf_bytes("scene.glb", &glb, &NoProgress)
        .map_err(std::io::Error::other)?;
    fs::write(folder.join("scene.glb"), glb)
}

/// Writes a scene with all features as TOML and as JSON, after a byte that selects the format.
fn write_scenes(folder: &Path) -> std::io::Result<()> {
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

/// Writes HTTP requests and page messages, after a byte that selects the kind.
fn write_viewer_input(folder: &Path) -> std::io::Result<()> {
    let camera =
        r#"{"position":[9,-2,3],"focal_point":[2,1,-1],"view_up":[0,0,1],"view_angle":40}"#;
    let pages = [
        r#"{"type":"camera","seq":1,"camera":CAMERA,"moving":true}
{"type":"ack","frame":1}
{"type":"camera","seq":2,"camera":CAMERA}
{"type":"pick","id":1,"x":20.5,"y":15}
{"type":"profile","id":2,"points":[[0,0,0],[4,2,1]],"width":0.5,"up":[0,0,1]}
{"type":"volume","id":4,"points":[[0,0,0],[4,2,1],[0,3,0]],"up":[0,0,1],"base":"mean","cell_size":0.5}
{"type":"histogram","id":5,"column":"z"}
{"type":"points","id":6,"format":"laz"}"#,
        r##"{"type":"set","seq":1,"scene":{"surface":"disc","color":"elevation","cmap":"viridis","range":[0,2],"radius":"adaptive:6"}}
{"type":"set","seq":2,"scene":{"sun":{"azimuth":120,"elevation":30},"light":["sun","sky"],"exposure":0.5,"background":"#102030"}}
{"type":"set","seq":3,"scene":{"material":"full.ply=glass:ior=1.3","clip_box":"([0,5],[0,3],[-2,2])","clip_plane":[1,1,0,1,0,0]},"moving":true}
{"type":"set","seq":4,"scene":{"surface":null,"material":null,"clip_box":null,"time":0.5,"subsample":"random:5","spp":2}}"##,
        r#"{"type":"size","width":64,"height":32}
{"type":"save","id":1,"width":30,"height":20}
{"type":"cancel","id":1}
{"type":"export","id":2,"width":30,"height":20}
{"type":"loadScene","id":3,"name":"a.toml","text":"spp = 2\n[camera]\nposition = [1, 2, 3]\n[[object]]\nfile = \"full.ply\""}
{"type":"loadScene","id":4,"name":"a.json","text":"{\"surface\": \"sphere\", \"object\": []}"}"#,
        r#"{"type":"set","seq":1,"scene":{"camera":{"orthographic":9,"view_angle":null},"up":[0,1,0],"edge_test":"off"}}
{"type":"set","seq":2,"scene":{"camera":{"panorama":true,"orthographic":null},"environment":"/etc/passwd"}}
{"type":"hello","width":3,"height":2}"#,
        r#"{"type":"ping"}
{"type":"visible","id":1,"points":[[0,0,0],[4,2,1]]}
{"type":"movie","id":2,"format":"gif","width":16,"height":12,"fps":5}
{"type":"addFile","id":3,"name":"b.xyz","n_bytes":12}
{"type":"cancel","id":2}"#,
    ];
    for (i, page) in pages.iter().enumerate() {
        let page = page.replace("CAMERA", camera);
        fs::write(folder.join(format!("page-{i}")), format!("\t{page}"))?;
    }
    let body = r#"{"camera":{"direction":[0,0,-1],"orthographic":true},"resolution":[20,10]}"#;
    let requests = [
        "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n".to_owned(),
        "GET /scene HTTP/1.1\r\nHost: 127.0.0.1:80\r\n\r\nGET /stats HTTP/1.0\r\nHost: localhost\r\n\r\n".into(),
        "GET /render?resolution=20x10&camera-azimuth-angle=30&light=sky HTTP/1.1\r\nHost: [::1]\r\nOrigin: http://[::1]\r\n\r\n".into(),
        format!("POST /render HTTP/1.1\r\nHost: localhost\r\nContent-Length: {}\r\n\r\n{body}", body.len()),
        format!("POST /render HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n{:x}\r\n{body}\r\n0\r\n\r\n", body.len()),
        "GET /ws HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n\u{1}\u{3}abc".into(),
    ];
    for (i, request) in requests.iter().enumerate() {
        fs::write(folder.join(format!("request-{i}")), format!("\n{request}"))?;
    }
    Ok(())
}

/// Returns a cloud with positions only.
fn bare_cloud(n: u16) -> PointCloud {
    let position = |i| Vec3::new(f32::from(i), 0.5 * f32::from(i * i % 5), -1.0);
    PointCloud::from_positions((0..n).map(position).collect())
}

/// Returns a cloud with all columns.
fn full_cloud(n: u16) -> PointCloud {
    let scalar = |name: &str, values| Scalar { name: name.into(), values };
    PointCloud {
        origin: DVec3::new(500_000.0, 4_900_000.0, 0.0),
        normals: Some((0..n).map(|_| Vec3::Z).collect()),
        colors: Some((0..n).map(|i| [257 * i, 0, 65535]).collect()),
        intensity: Some((0..n).map(f32::from).collect()),
        classification: Some((0..n).map(|i| i as u8).collect()),
        scalars: vec![
            scalar("gps_time", Values::F64((0..n).map(f64::from).collect())),
            scalar("nir", Values::U16((0..n).collect())),
            scalar("other", Values::U8((0..n).map(|i| i as u8).collect())),
        ],
        ..bare_cloud(n)
    }
}
