//! Parses OBJ files: columns of positions, texture coordinates and normals, and polygons that index them.

use surfel_core::math::{DVec3, Vec2, Vec3};
use surfel_core::progress::Progress;

use super::lines::{line_end, name, numbers, split_keyword, words};
use crate::error::Result;
use crate::file::Input;
use crate::table::{LineError, ParseFault, TextChunk, parse_chunks};

/// Index of absent texture coordinates, or of an absent normal.
pub(super) const ABSENT: u32 = u32::MAX;

/// Indices of the position, the texture coordinates and the normal of a corner.
pub(super) type Corner = [u32; 3];

/// The content of a file.
#[derive(Default)]
pub(super) struct Parsed {
    /// Positions of the vertices.
    pub positions: Vec<DVec3>,
    /// sRGB-encoded colours of the positions in the range of the file, NaN for a vertex without; empty if none has one.
    pub colors: Vec<Vec3>,
    /// Texture coordinates.
    pub uvs: Vec<Vec2>,
    /// Normals.
    pub normals: Vec<Vec3>,
    /// Corners of all triangles.
    pub corners: Vec<Corner>,
    /// Index of the corner after the last of each polygon.
    pub polygon_ends: Vec<usize>,
    /// Index of the first polygon with another material, and the name of that material.
    pub materials: Vec<(usize, String)>,
    /// Names of MTL files.
    pub libraries: Vec<String>,
    /// First byte of the first polygon.
    pub first_polygon: Option<usize>,
}

/// Numbers of positions, texture coordinates and normals.
#[derive(Clone, Copy, Default)]
struct Counts([usize; 3]);

const KEYWORDS: [&[u8]; 3] = [b"v", b"vt", b"vn"];

/// Parses the lines of a file.
pub(super) fn parse(input: &Input, progress: &dyn Progress) -> Result<Parsed> {
    let chunks = TextChunk { text: input, start: 0 }.split(line_end);
    progress.begin(&format!("read {}", input.name), 2 * input.len() as u64);
    // Polygons may count back from their own line, so the counts before each chunk are needed.
    let counts = parse_chunks(input, &chunks, |_, chunk| Ok(count(chunk)), progress)?;
    let mut total = Counts::default();
    let befores: Vec<Counts> = counts
        .into_iter()
        .map(|Counts(more)| {
            let before = total;
            total.0.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
            before
        })
        .collect();
    let too_many = |what: &str| {
        let found = format!("more than {} {what}", ABSENT - 1);
        input.unsupported(found, "cut the mesh into several files")
    };
    if total.0.iter().any(|count| ABSENT as usize <= *count) {
        return Err(too_many("vertices"));
    }
    let parse = |i: usize, chunk| parse_chunk(chunk, befores[i], total);
    let parsed = join(parse_chunks(input, &chunks, parse, progress)?);
    if ABSENT as usize <= parsed.corners.len() {
        return Err(too_many("corners"));
    }
    Ok(parsed)
}

/// Counts the numbered lines of a chunk.
fn count(chunk: TextChunk) -> Counts {
    let mut counts = Counts::default();
    for (_, line) in chunk.lines(line_end) {
        let (keyword, _) = split_keyword(line);
        if let Some(kind) = KEYWORDS.iter().position(|known| *known == keyword) {
            counts.0[kind] += 1;
        }
    }
    counts
}

/// Parses a chunk, with `counts` before it and `total` in the file.
fn parse_chunk(
    chunk: TextChunk,
    mut counts: Counts,
    total: Counts,
) -> std::result::Result<Parsed, ParseFault> {
    let mut parsed = Parsed::default();
    for (byte, line) in chunk.lines(line_end) {
        let (keyword, rest) = split_keyword(line);
        parsed
            .add(byte, keyword, rest, counts, total)
            .map_err(|error| ParseFault::new(byte, error))?;
        if let Some(kind) = KEYWORDS.iter().position(|known| *known == keyword) {
            counts.0[kind] += 1;
        }
    }
    Ok(parsed)
}

impl Parsed {
    /// Adds the content of a line; lines with unknown keywords are skipped.
    fn add(
        &mut self,
        byte: usize,
        keyword: &[u8],
        rest: &[u8],
        before: Counts,
        total: Counts,
    ) -> std::result::Result<(), LineError> {
        match keyword {
            b"v" => self.add_vertex(rest)?,
            b"vt" => {
                let ([u, v], _) = numbers::<1, 2>(rest)?;
                // In the file v points up.
                self.uvs.push(Vec2::new(u as f32, (1.0 - v) as f32));
            }
            b"vn" => {
                let (normal, _) = numbers::<3, 3>(rest)?;
                self.normals.push(DVec3::from_array(normal).as_vec3());
            }
            b"f" | b"fo" => {
                for word in words(rest) {
                    self.corners.push(corner(word, before, total)?);
                }
                self.polygon_ends.push(self.corners.len());
                self.first_polygon.get_or_insert(byte);
            }
            b"usemtl" => self.materials.push((self.polygon_ends.len(), name(rest))),
            b"mtllib" => self.libraries.push(name(rest)),
            _ => {}
        }
        Ok(())
    }

    fn add_vertex(&mut self, rest: &[u8]) -> std::result::Result<(), LineError> {
        let (position, color) = vertex(rest)?;
        self.positions.push(DVec3::from_array(position));
        if color.is_some() || !self.colors.is_empty() {
            self.colors.resize(self.positions.len() - 1, Vec3::NAN);
            self.colors.push(color.map_or(Vec3::NAN, |color| DVec3::from_array(color).as_vec3()));
        }
        Ok(())
    }
}

/// Parses the position of a vertex and its colour, if it has one.
pub(super) fn vertex(rest: &[u8]) -> std::result::Result<([f64; 3], Option<[f64; 3]>), LineError> {
    let ([x, y, z, rest @ ..], count) = numbers::<3, 7>(rest)?;
    // A weight may stand between position and colour, or at the end.
    let color = match count {
        6 => Some([rest[0], rest[1], rest[2]]),
        7 => Some([rest[1], rest[2], rest[3]]),
        _ => None,
    };
    Ok(([x, y, z], color))
}

/// Parses a corner of the form `v`, `v/vt`, `v//vn` or `v/vt/vn`.
fn corner(word: &[u8], before: Counts, total: Counts) -> std::result::Result<Corner, LineError> {
    let mut corner = [ABSENT; 3];
    for (kind, number) in word.split(|byte| *byte == b'/').enumerate() {
        if kind == 3 || kind == 0 && number.is_empty() {
            let found = format!("`{}`", word[..word.len().min(40)].escape_ascii());
            return Err(LineError {
                found,
                expected: "a corner as in 1, 1/1, 1//1 or 1/1/1".into(),
            });
        }
        if !number.is_empty() {
            corner[kind] = index(number, kind, before, total)?;
        }
    }
    Ok(corner)
}

/// Parses an index, which counts from 1, or backward from -1 for the last before the line.
fn index(
    number: &[u8],
    kind: usize,
    Counts(before): Counts,
    Counts(total): Counts,
) -> std::result::Result<u32, LineError> {
    let value = std::str::from_utf8(number).ok().and_then(|text| text.parse::<i64>().ok());
    let index = value.and_then(|value| match value {
        0 => None,
        1.. => usize::try_from(value - 1).ok(),
        _ => before[kind].checked_sub(usize::try_from(value.unsigned_abs()).ok()?),
    });
    index.filter(|index| *index < total[kind]).map(|index| index as u32).ok_or_else(|| {
        let column = ["vertex", "texture coordinates", "normal"][kind];
        LineError {
            found: format!("{column} `{}`", number[..number.len().min(40)].escape_ascii()),
            expected: match (total[kind], before[kind]) {
                (0, _) => "none, since the file has none".into(),
                (n_all, 0) => format!("1 to {n_all}"),
                (n_all, n_before) => format!("1 to {n_all}, or -1 to -{n_before}"),
            },
        }
    })
}

/// Joins the content of all chunks.
fn join(chunks: Vec<Parsed>) -> Parsed {
    let mut all = Parsed::default();
    let has_colors = chunks.iter().any(|chunk| !chunk.colors.is_empty());
    for mut chunk in chunks {
        let (n_corners, n_polygons) = (all.corners.len(), all.polygon_ends.len());
        if has_colors {
            chunk.colors.resize(chunk.positions.len(), Vec3::NAN);
        }
        all.positions.append(&mut chunk.positions);
        all.colors.append(&mut chunk.colors);
        all.uvs.append(&mut chunk.uvs);
        all.normals.append(&mut chunk.normals);
        all.corners.append(&mut chunk.corners);
        all.polygon_ends.extend(chunk.polygon_ends.iter().map(|end| end + n_corners));
        let materials = chunk.materials.into_iter();
        all.materials.extend(materials.map(|(polygon, name)| (polygon + n_polygons, name)));
        all.libraries.append(&mut chunk.libraries);
        all.first_polygon = all.first_polygon.or(chunk.first_polygon);
    }
    all
}
