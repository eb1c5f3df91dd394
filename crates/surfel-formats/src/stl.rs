//! STL: triangles one by one, binary or as text; corners at the same place become one vertex.

use rayon::prelude::*;
use surfel::math::{DVec3, Vec3};
use surfel::points::PointCloud;
use surfel::progress::Progress;
use surfel::scene::{Material, Mesh};

use crate::error::{Place, Result};
use crate::input::Input;
use crate::lines::{LineError, parse_number};
use crate::mesh::{Model, about_origin, finish};
use crate::options::{LoadOptions, Loaded, Source};
use crate::pieces::{Fault, Piece, parse_pieces};
use crate::records::Tolerance;
use crate::weld::weld;

/// Free text, and the number of triangles behind it.
const HEADER: usize = 80;
const BODY: usize = HEADER + 4;
/// A normal and three corners of f32, and two bytes of no agreed meaning.
const STRIDE: usize = 50;

pub(crate) fn inspect(input: &Input) -> Result<Source> {
    let n_triangles = if is_ascii(input) { None } else { Some(count(input)? as u64) };
    Ok(source(input, n_triangles))
}

/// The corners as points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let (mesh, source) = read_triangles(input, options, progress)?;
    let cloud = PointCloud { origin: mesh.origin, ..PointCloud::from_positions(mesh.positions) };
    Ok(Loaded { cloud, source })
}

pub(crate) fn read_mesh(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Model, Source)> {
    let (mesh, source) = read_triangles(input, options, progress)?;
    let model = Model { parts: vec![(mesh, Material::MATTE)], textures: Vec::new() };
    let place = if is_ascii(input) { Place::Line(1) } else { Place::Byte(BODY as u64) };
    let (model, n_triangles) = finish(input, model, 0, place, progress)?;
    Ok((model, Source { n_triangles: Some(n_triangles), ..source }))
}

fn source(input: &Input, n_triangles: Option<u64>) -> Source {
    let encoding = if is_ascii(input) { "ascii" } else { "binary" };
    Source {
        format: format!("STL, {encoding}"),
        n_triangles,
        columns: ["x", "y", "z"].map(String::from).into(),
        ..Source::default()
    }
}

fn read_triangles(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Mesh, Source)> {
    progress.begin(&format!("read {}", input.name), input.len() as u64);
    let (origin, corners) = match is_ascii(input) {
        true => about_origin(&read_ascii(input, progress)?, Tolerance::UNSTATED, options),
        false => about_origin(&read_binary(input, progress)?, Tolerance::SINGLE, options),
    };
    if u32::MAX as usize <= corners.len() {
        let found = format!("{} triangles", corners.len() / 3);
        return Err(input.unsupported(found, "cut the mesh into several files"));
    }
    progress.check()?;
    // Adding zero makes one zero of the two.
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
    Ok((mesh, Source { n_points, ..source(input, n_triangles) }))
}

/// Binary files may begin with `solid` too: those have the length that their number of triangles asks for.
fn is_ascii(input: &Input) -> bool {
    let is_solid =
        input.trim_ascii_start().get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    let expected = claimed(input).map(|n_triangles| BODY as u64 + STRIDE as u64 * n_triangles);
    is_solid && expected != Some(input.len() as u64) && !input[..input.len().min(BODY)].contains(&0)
}

fn claimed(input: &Input) -> Option<u64> {
    let count = input.get(HEADER..)?.first_chunk()?;
    Some(u64::from(u32::from_le_bytes(*count)))
}

/// The number of triangles in a binary file, which has room for them.
fn count(input: &Input) -> Result<usize> {
    let end = Place::Byte(input.len() as u64);
    let advice = "copy the file again from its source";
    let Some(claimed) = claimed(input) else {
        let expected = "a header of 84 bytes, or `solid` at the start";
        return Err(input.malformed(end, "the end of the file", expected, advice));
    };
    let readable = (input.len() - BODY) / STRIDE;
    if (readable as u64) < claimed {
        let found = format!("the end of the file behind {readable} triangles");
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
    let pieces = Piece { text: input, start: 0 }.cut(end_of_facet);
    let corners = parse_pieces(input, &pieces, |_, piece| parse_facets(piece), progress)?;
    Ok(corners.into_iter().flatten().collect())
}

fn end_of_facet(text: &[u8]) -> Option<usize> {
    const END: &[u8] = b"endfacet";
    memchr::memmem::find(text, END).map(|at| at + END.len())
}

/// Three corners for each facet of a piece that ends with one, or with the file.
fn parse_facets(piece: Piece) -> std::result::Result<Vec<DVec3>, Fault> {
    let mut corners = Vec::new();
    let mut words = Words { text: piece.text, at: 0 };
    let fault = |at: usize, found: &[u8], expected: &str| {
        let found = format!("`{}`", found[..found.len().min(40)].escape_ascii());
        Fault::new(piece.start + at, LineError { found, expected: expected.into() })
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
                corner[axis] = number.map_err(|error| Fault::new(piece.start + at, error))?;
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
            // The normal behind it is that of the corners, if it is any.
            for _ in 0..4 {
                words.next();
            }
        } else if is("solid") || is("endsolid") {
            // Names may be anything.
            words.skip_line();
        } else if is("") {
            return Ok(corners);
        } else if !(is("outer") || is("loop") || is("endfacet")) {
            return Err(fault(at, word, "facets of an ascii STL file"));
        }
    }
}

/// The words of a text.
struct Words<'a> {
    text: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    /// Returns where the next word begins.
    fn skip_space(&mut self) -> usize {
        let space = self.text[self.at..].iter().take_while(|byte| byte.is_ascii_whitespace());
        self.at += space.count();
        self.at
    }

    /// Empty at the end.
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
