//! The file formats that surfel reads and writes: one table, with a row for each.

use std::path::Path;
use std::sync::LazyLock;

use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::Graph;

use crate::bin;
use crate::e57;
use crate::error::{Location, Result};
use crate::esri_grid;
use crate::file::{Input, ResourceResolver};
use crate::gltf;
use crate::las;
use crate::mesh::Model;
use crate::obj;
use crate::off;
use crate::options::{FileInfo, LoadOptions, Loaded, SaveOptions};
use crate::pcd;
use crate::ply;
use crate::ptx;
use crate::stl;
use crate::text;

/// A file format that surfel reads.
pub struct Format {
    /// Name of the format, as in "PLY".
    pub name: &'static str,
    /// Extensions of its files, in lower case and without the dot.
    pub extensions: &'static [&'static str],
    /// First bytes of each of its files, in words; `None` if files of this format begin in no particular way.
    signature: Option<&'static str>,
    /// Returns true if the first bytes of an input show this format, or its name alone decides.
    probe: fn(&Input) -> bool,
    /// Reads what the file states about itself, without its points and triangles.
    pub(crate) inspect: fn(&Input) -> Result<FileInfo>,
    /// Functions that read the content.
    pub(crate) read: Reader,
    /// The function that writes clouds; none if the format is only read.
    pub(crate) writer: Option<CloudWriter>,
}

/// The function that writes clouds in a format.
pub(crate) struct CloudWriter {
    /// Extensions that ask for the format, in lower case and without the dot.
    pub extensions: &'static [&'static str],
    /// Writes a cloud to a path with one of the extensions.
    pub write: fn(&Path, &PointCloud, &SaveOptions, &dyn Progress) -> Result<()>,
    /// True if names, poses and grids of stations are written.
    pub keeps_stations: bool,
}

/// The functions that read the content of a format, by what it can contain.
pub(crate) enum Reader {
    /// The format has points only.
    Points(ReadPoints),
    /// The format has one mesh; `has_triangles` is false for files whose points are without faces.
    Mesh { has_triangles: fn(&Input) -> Result<bool>, read_points: ReadPoints, read_mesh: ReadMesh },
    /// The format has a whole scene, read with the animation of the given name or else the first.
    Scene(ReadScene),
}

pub(crate) type ReadPoints = fn(&Input, &LoadOptions, &dyn Progress) -> Result<Loaded>;
type ReadMesh =
    fn(&Input, &ResourceResolver, &LoadOptions, &dyn Progress) -> Result<(Model, FileInfo)>;
type ReadScene = fn(
    &Input,
    ResourceResolver,
    Option<&str>,
    &dyn Progress,
) -> Result<(Graph<PointCloud>, FileInfo)>;

/// All formats. An input is of the first format whose probe accepts it, else of the one that
/// has its extension.
pub const FORMATS: &[Format] = &[
    Format {
        name: "glTF",
        extensions: &["gltf", "glb"],
        signature: None,
        probe: gltf::is_gltf,
        inspect: gltf::inspect,
        read: Reader::Scene(gltf::read),
        writer: None,
    },
    Format {
        name: "PLY",
        extensions: &["ply"],
        signature: Some("`ply` and the end of the line"),
        probe: |input| {
            input.starts_with(b"ply") && input.get(3).is_some_and(u8::is_ascii_whitespace)
        },
        inspect: ply::inspect,
        read: Reader::Mesh {
            has_triangles: ply::has_faces,
            read_points: ply::read,
            read_mesh: ply::read_mesh,
        },
        writer: Some(CloudWriter {
            extensions: &["ply"],
            write: |path, cloud, _, progress| ply::write(path, cloud, progress),
            keeps_stations: true,
        }),
    },
    Format {
        name: "LAS",
        extensions: &["las", "laz"],
        signature: Some("`LASF`"),
        probe: |input| input.starts_with(b"LASF"),
        inspect: las::inspect,
        read: Reader::Points(las::read),
        writer: Some(CloudWriter {
            extensions: &["las", "laz"],
            write: las::write,
            keeps_stations: false,
        }),
    },
    Format {
        name: "E57",
        extensions: &["e57"],
        signature: Some("`ASTM-E57`"),
        probe: |input| input.starts_with(b"ASTM-E57"),
        inspect: e57::inspect,
        read: Reader::Points(e57::read),
        writer: None,
    },
    Format {
        name: "PCD",
        extensions: &["pcd"],
        signature: None,
        probe: pcd::is_pcd,
        inspect: pcd::inspect,
        read: Reader::Points(pcd::read),
        writer: None,
    },
    Format {
        name: "PTX",
        extensions: &["ptx"],
        signature: None,
        probe: ptx::is_ptx,
        inspect: ptx::inspect,
        read: Reader::Points(ptx::read),
        writer: None,
    },
    Format {
        name: "BIN",
        extensions: &["bin"],
        signature: None,
        // The extension decides before foreign signatures do: a coordinate may begin with the bytes of one.
        probe: |input| {
            let is_bin = !input.is_empty() && input.extension() == "bin";
            is_bin && !input.starts_with(CLOUD_COMPARE)
        },
        inspect: bin::inspect,
        read: Reader::Points(bin::read),
        writer: None,
    },
    Format {
        name: "ESRI ASCII grid",
        // Its files end as other texts do.
        extensions: &[],
        signature: None,
        probe: esri_grid::is_grid,
        inspect: esri_grid::inspect,
        read: Reader::Points(esri_grid::read),
        writer: None,
    },
    Format {
        name: "text",
        extensions: &["xyz", "txt", "csv", "asc", "pts", "xyzrgb", "xyzn"],
        signature: None,
        probe: |_| false,
        inspect: text::inspect,
        read: Reader::Points(text::read),
        writer: Some(CloudWriter {
            extensions: &["xyz", "txt", "csv", "asc", "pts"],
            write: text::write,
            keeps_stations: false,
        }),
    },
    Format {
        name: "OBJ",
        extensions: &["obj"],
        signature: None,
        probe: |_| false,
        inspect: obj::inspect,
        read: Reader::Mesh {
            has_triangles: |input| Ok(obj::has_faces(input)),
            read_points: obj::read,
            read_mesh: obj::read_mesh,
        },
        writer: None,
    },
    Format {
        name: "OFF",
        extensions: &["off"],
        signature: None,
        probe: |_| false,
        inspect: off::inspect,
        read: Reader::Mesh {
            has_triangles: off::has_faces,
            read_points: off::read,
            read_mesh: off::read_mesh,
        },
        writer: None,
    },
    Format {
        name: "STL",
        extensions: &["stl"],
        signature: None,
        probe: |_| false,
        inspect: stl::inspect,
        read: Reader::Mesh {
            has_triangles: |_| Ok(true),
            read_points: stl::read,
            read_mesh: stl::read_mesh,
        },
        writer: None,
    },
];

/// First bytes of CloudCompare's BIN files, which have nothing but the extension in common with BIN.
const CLOUD_COMPARE: &[u8] = b"CCB2";

/// First bytes of formats that surfel does not read, and their names.
const FOREIGN_SIGNATURES: [(&[u8], &str); 4] = [
    (CLOUD_COMPARE, "a BIN file of CloudCompare"),
    (b"\x89HDF", "an HDF5 file"),
    (b"PK\x03\x04", "a zip archive"),
    (b"\x1f\x8b", "a gzip archive"),
];

/// Extensions of compressed files of trained splats, which surfel does not read, and their names.
const SPLAT_EXTENSIONS: [(&str, &str); 4] = [
    ("splat", "a .splat file of trained splats"),
    ("ksplat", "a .ksplat file of trained splats"),
    ("spz", "an SPZ file of trained splats"),
    ("sog", "an SOG file of trained splats"),
];

static ADVICE: LazyLock<String> = LazyLock::new(|| {
    let extensions = FORMATS.iter().flat_map(|format| format.extensions);
    let extensions = list_extensions(extensions, "and");
    format!(
        "surfel reads {extensions}, and scene files (.toml, .json); convert the file to one of them"
    )
});

/// Returns extensions with their dots as a list in words, whose last two are joined by `conjunction`.
pub(crate) fn list_extensions<'e>(
    extensions: impl Iterator<Item = &'e &'e str>,
    conjunction: &str,
) -> String {
    let extensions: Vec<String> = extensions.map(|extension| format!(".{extension}")).collect();
    match extensions.split_last() {
        Some((last, others)) if !others.is_empty() => {
            format!("{} {conjunction} {last}", others.join(", "))
        }
        _ => extensions.concat(),
    }
}

/// Returns the format of an input, by its first bytes or else by its extension.
pub(crate) fn detect(input: &Input) -> Result<&'static Format> {
    if let Some(format) = probe(input) {
        return Ok(format);
    }
    if input.is_empty() {
        let advice = "write the file again or copy it again from its source";
        return Err(input.malformed(Location::Byte(0), "an empty file", "points", advice));
    }
    let extension = input.extension();
    if let Some((_, name)) = SPLAT_EXTENSIONS.iter().find(|(splats, _)| *splats == extension) {
        return Err(input.unsupported(*name, ply::SPLAT_ADVICE));
    }
    let mut foreign = FOREIGN_SIGNATURES.iter();
    if let Some((_, name)) = foreign.find(|(signature, _)| input.starts_with(signature)) {
        return Err(input.unsupported(*name, &ADVICE));
    }
    let has_extension = |format: &&Format| format.extensions.contains(&&*extension);
    let of_name = FORMATS.iter().find(has_extension);
    let Some(format) = of_name.or_else(|| text_format(input)) else {
        let found = match extension.as_str() {
            "" => "a name without extension and unknown content".into(),
            extension => format!("the extension `.{extension}`"),
        };
        return Err(input.unsupported(found, &ADVICE));
    };
    if let Some(signature) = format.signature {
        let found = format!("`{}`", input[..input.len().min(4)].escape_ascii());
        let advice = "the extension does not fit the content; give the file its right one";
        return Err(input.malformed(Location::Byte(0), found, signature, advice));
    }
    Ok(format)
}

/// Returns the format of text if the lines of an input are points, whatever its extension.
fn text_format(input: &Input) -> Option<&'static Format> {
    let format = FORMATS.iter().find(|format| format.extensions.contains(&"xyz"));
    format.filter(|_| text::begins_with_points(input))
}

/// Returns true if an input holds a whole scene, with transforms and animation of its own.
pub(crate) fn is_scene(input: &Input) -> bool {
    probe(input).is_some_and(|format| matches!(format.read, Reader::Scene(_)))
}

/// Returns the format that the content of a file shows, if it shows one.
///
/// # Errors
///
/// Fails if the file cannot be read.
pub fn detect_file(path: &Path) -> Result<Option<&'static Format>> {
    Ok(probe(&Input::open(path)?))
}

fn probe(input: &Input) -> Option<&'static Format> {
    FORMATS.iter().find(|format| (format.probe)(input))
}

#[cfg(test)]
mod tests {
    //! Formats are found by first bytes and by extension, and messages list every extension.

    use super::*;

    fn detected(name: &str, bytes: &[u8]) -> Result<&'static str> {
        detect(&Input::from_bytes(name, bytes)).map(|format| format.name)
    }

    #[test]
    fn signatures_take_precedence_over_extensions() {
        assert_eq!(detected("a.txt", b"ply\nformat").unwrap(), "PLY");
        assert_eq!(detected("a", b"LASF").unwrap(), "LAS");
        assert_eq!(detected("a.bin", b"glTF").unwrap(), "glTF");
        assert_eq!(detected("a.bin", b"PK\x03\x04").unwrap(), "BIN");
        assert_eq!(detected("A.XYZ", b"1 2 3").unwrap(), "text");
        assert!(detected("a.xyz", b"PK\x03\x04").is_err());
    }

    #[test]
    fn lines_of_numbers_are_text_whatever_the_extension() {
        for name in ["-", "cloud", "cloud.3d", "cloud.neu"] {
            assert_eq!(detected(name, b"# scan 7\n1 2 3\n4 5 6\n").unwrap(), "text", "{name}");
        }
        assert!(detected("notes.md", b"1 of 2 things: 3\n").is_err());
        assert!(detected("cloud.neu", b"\x00\x01\x02").is_err());
    }

    #[test]
    fn ptx_and_pcd_are_known_by_their_first_lines() {
        let ptx =
            "2\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 6 7 1\n1 2 3 .5\n";
        let pcd = "# written by hand\n\nVERSION .7\nFIELDS x y z\n";
        for name in ["-", "scan.txt", "scan"] {
            assert_eq!(detected(name, ptx.as_bytes()).unwrap(), "PTX", "{name}");
            assert_eq!(detected(name, pcd.as_bytes()).unwrap(), "PCD", "{name}");
            assert_eq!(detected(name, b"FIELDS x y z\nSIZE 4 4 4\n").unwrap(), "PCD", "{name}");
            // The number of points before them is no grid, nor are three numbers a row of four.
            assert_eq!(detected(name, b"2\n1 2 3\n4 5 6\n").unwrap(), "text", "{name}");
            let short = ptx.replace("5 6 7 1", "5 6 7");
            assert_ne!(detected(name, short.as_bytes()).ok(), Some("PTX"), "{name}");
        }
    }

    #[test]
    fn compressed_splats_are_refused_by_name() {
        let gzip: &[u8] = b"\x1f\x8b\x08";
        for (name, bytes) in [("a.splat", &[0; 32][..]), ("a.KSPLAT", &[1; 64]), ("a.spz", gzip)] {
            let message = detected(name, bytes).unwrap_err().to_string();
            let kind = name.to_ascii_lowercase().replace("a.", "");
            assert!(
                message.to_ascii_lowercase().contains(&format!("{kind} file of trained")),
                "{message}"
            );
            assert!(message.contains("export the splats as PLY"), "{message}");
        }
    }

    #[test]
    fn every_extension_belongs_to_one_format_and_is_listed_in_messages() {
        let mut extensions: Vec<&str> =
            FORMATS.iter().flat_map(|f| f.extensions).copied().collect();
        let message = detected("a.what", b"words").unwrap_err().to_string();
        assert!(extensions.iter().all(|extension| message.contains(&format!(".{extension}"))));
        let n_extensions = extensions.len();
        extensions.sort_unstable();
        extensions.dedup();
        assert_eq!(extensions.len(), n_extensions);
    }
}
