//! Writes the initial corpus of the fuzzer: small valid files in the folder `corpus` of this package.

mod gltf;
mod scene;
mod viewer;

use std::fs;
use std::path::Path;

use e57::{E57Writer, Record, RecordDataType, RecordName, RecordValue};
use surfel_core::image::Image;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::{PointCloud, Scalar, Values};
use surfel_core::progress::NoProgress;
use surfel_formats::{ImageOptions, SaveOptions, save, save_image};

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
    gltf::write(&corpus.join("gltf"))?;
    scene::write(&corpus.join("scene"))?;
    viewer::write(&corpus.join("viewer"))?;
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
