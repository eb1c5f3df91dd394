//! STL: separate triangles, binary or as text. Corners with equal coordinates are welded to one vertex.

use rayon::prelude::*;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::{Material, Mesh};
use surfel_core::words::counted;

use crate::error::{Location, Result};
use crate::file::{Input, ResourceResolver};
use crate::mesh::{Model, relative_to_origin, repair_model, weld};
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::table::{
    LineError, ParseFault, TextChunk, Tolerance, keep_matching, parse_chunks, parse_number,
};

/// Bytes of free text at the start of a binary file; the number of triangles follows.
const HEADER: usize = 80;
/// First byte of the triangles in a binary file.
const BODY: usize = HEADER + 4;
/// Bytes of a triangle in a binary file: a normal and three corners of f32, and two bytes without agreed meaning.
const STRIDE: usize = 50;

/// Reads the number of triangles of a binary file.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    let n_triangles = if is_ascii(input) { None } else { Some(count(input)? as u64) };
    Ok(file_info(input, n_triangles))
}

/// Reads the corners as points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let (mesh, info) = read_triangles(input, options, progress)?;
    let mut cloud =
        PointCloud { origin: mesh.origin, ..PointCloud::from_positions(mesh.positions) };
    let info = FileInfo { n_points: Some(cloud.len() as u64), ..info };
    keep_matching(&mut cloud, 0, options.filter.as_ref())?;
    Ok(Loaded { cloud, info })
}

/// Reads the triangles as a mesh.
pub(crate) fn read_mesh(
    input: &Input,
    _: &ResourceResolver,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Model, FileInfo)> {
    let (mesh, info) = read_triangles(input, options, progress)?;
    let model = Model { parts: vec![(mesh, Material::MATTE)], textures: Vec::new() };
    let location = if is_ascii(input) { Location::Line(1) } else { Location::Byte(BODY as u64) };
    let (model, n_triangles) = repair_model(input, model, 0, location, progress)?;
    Ok((model, FileInfo { n_triangles: Some(n_triangles), ..info }))
}

fn file_info(input: &Input, n_triangles: Option<u64>) -> FileInfo {
    let encoding = if is_ascii(input) { "ascii" } else { "binary" };
    FileInfo {
        format: format!("STL, {encoding}"),
        n_triangles,
        columns: ["x", "y", "z"].map(String::from).into(),
        ..FileInfo::default()
    }
}

fn read_triangles(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Mesh, FileInfo)> {
    progress.begin(&format!("read {}", input.name), input.len() as u64);
    let (origin, corners) = match is_ascii(input) {
        true => relative_to_origin(&read_ascii(input, progress)?, Tolerance::UNSTATED, options),
        false => {
            relative_to_origin(&read_binary(input, progress)?, Tolerance::F32_COORDINATES, options)
        }
    };
    if u32::MAX as usize <= corners.len() {
        let found = format!("{} triangles", corners.len() / 3);
        return Err(input.unsupported(found, "cut the mesh into several files"));
    }
    progress.check()?;
    // Adding zero turns -0 into 0.
    let key = |corner: &Vec3| (*corner + 0.0).to_array().map(f32::to_bits);
    let keys: Vec<[u32; 3]> = corners.par_iter().map(key).collect();
    let welded = weld(&keys);
    let vertices = welded.first_corners.iter();
    let mesh = Mesh {
        origin,
        positions: vertices.map(|corner| corners[*corner as usize]).collect(),
        triangles: welded.vertex_of_corner.as_chunks().0.to_vec(),
        ..Mesh::default()
    };
    let n_triangles = Some(mesh.triangles.len() as u64);
    let n_points = Some(mesh.positions.len() as u64);
    Ok((mesh, FileInfo { n_points, ..file_info(input, n_triangles) }))
}

/// Returns true if the file is text. A binary file may begin with `solid` too, but has the length that follows from its
/// number of triangles.
fn is_ascii(input: &Input) -> bool {
    let is_solid =
        input.trim_ascii_start().get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    let expected = claimed(input).map(|n_triangles| BODY as u64 + STRIDE as u64 * n_triangles);
    is_solid && expected != Some(input.len() as u64) && !input[..input.len().min(BODY)].contains(&0)
}

/// Returns the number of triangles that the header of a binary file claims.
fn claimed(input: &Input) -> Option<u64> {
    let count = input.get(HEADER..)?.first_chunk()?;
    Some(u64::from(u32::from_le_bytes(*count)))
}

/// Returns the number of triangles in a binary file, after checking that the file is long enough for them.
fn count(input: &Input) -> Result<usize> {
    let end = Location::Byte(input.len() as u64);
    let advice = "copy the file again from its source";
    let Some(claimed) = claimed(input) else {
        let expected = "a header of 84 bytes, or `solid` at the start";
        return Err(input.malformed(end, "the end of the file", expected, advice));
    };
    let readable = (input.len() - BODY) / STRIDE;
    if (readable as u64) < claimed {
        let found = format!("the end of the file after {}", counted(readable, "triangle"));
        return Err(input.malformed(end, found, format!("{claimed}"), advice));
    }
    Ok(claimed as usize)
}

fn read_binary(input: &Input, progress: &dyn Progress) -> Result<Vec<Vec3>> {
    let n_bytes = STRIDE * count(input)?;
    let records = &input[BODY..][..n_bytes];
    progress.check()?;
    let corners = records.par_chunks_exact(STRIDE).flat_map_iter(|record| {
        let (numbers, _) = record[12..48].as_chunks::<4>();
        let (corners, _) = numbers.as_chunks::<3>();
        corners.iter().map(|corner| Vec3::from_array(corner.map(f32::from_le_bytes)))
    });
    Ok(corners.collect())
}

fn read_ascii(input: &Input, progress: &dyn Progress) -> Result<Vec<DVec3>> {
    let chunks = TextChunk { text: input, start: 0 }.split(end_of_facet);
    let corners = parse_chunks(input, &chunks, |_, chunk| parse_facets(chunk), progress)?;
    Ok(corners.into_iter().flatten().collect())
}

fn end_of_facet(text: &[u8]) -> Option<usize> {
    const END: &[u8] = b"endfacet";
    memchr::memmem::find(text, END).map(|at| at + END.len())
}

/// Parses the corners of the facets of a chunk, which ends with a facet or with the file.
fn parse_facets(chunk: TextChunk) -> std::result::Result<Vec<DVec3>, ParseFault> {
    let mut corners = Vec::new();
    let mut words = Words { text: chunk.text, at: 0 };
    let fault = |at: usize, found: &[u8], expected: &str| {
        let found = format!("`{}`", found[..found.len().min(40)].escape_ascii());
        ParseFault::new(chunk.start + at, LineError { found, expected: expected.into() })
    };
    let mut n_corners = 0;
    loop {
        let at = words.skip_space();
        let word = words.next();
        let is = |name: &str| word.eq_ignore_ascii_case(name.as_bytes());
        if is("vertex") {
            n_corners += 1;
            let mut corner = DVec3::ZERO;
            for axis in 0..3 {
                let at = words.skip_space();
                let number = parse_number(words.next());
                corner[axis] = number.map_err(|error| ParseFault::new(chunk.start + at, error))?;
            }
            corners.push(corner);
        } else if is("endloop") {
            if n_corners != 3 {
                return Err(fault(at, word, &format!("three vertices before it, not {n_corners}")));
            }
            n_corners = 0;
        } else if n_corners != 0 {
            return Err(fault(at, word, "`vertex` or `endloop`"));
        } else if is("facet") {
            // The normal is skipped, because it follows from the corners.
            for _ in 0..4 {
                words.next();
            }
        } else if is("solid") || is("endsolid") {
            // A name may contain any words.
            words.skip_line();
        } else if is("") {
            return Ok(corners);
        } else if !(is("outer") || is("loop") || is("endfacet")) {
            return Err(fault(at, word, "facets of an ascii STL file"));
        }
    }
}

/// A cursor over the words of a text.
struct Words<'a> {
    text: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    /// Skips whitespace; returns the position of the next word.
    fn skip_space(&mut self) -> usize {
        let space = self.text[self.at..].iter().take_while(|byte| byte.is_ascii_whitespace());
        self.at += space.count();
        self.at
    }

    /// Returns the next word, which is empty at the end.
    fn next(&mut self) -> &'a [u8] {
        let start = self.skip_space();
        let word = self.text[start..].iter().take_while(|byte| !byte.is_ascii_whitespace());
        self.at += word.count();
        &self.text[start..self.at]
    }

    fn skip_line(&mut self) {
        let rest = &self.text[self.at..];
        self.at += memchr::memchr(b'\n', rest).unwrap_or(rest.len());
    }
}
