//! Parses OBJ files: columns of what is numbered, and polygons of these numbers.

use surfel::math::{DVec3, Vec2, Vec3};
use surfel::progress::Progress;

use super::lines::{keyword, line_end, name, numbers, words};
use crate::error::Result;
use crate::input::Input;
use crate::lines::LineError;
use crate::pieces::{Fault, Piece, parse_pieces};

/// Of a corner that has no texture coordinates or no normal.
pub(super) const ABSENT: u32 = u32::MAX;

/// Indices of a position, of texture coordinates and of a normal.
pub(super) type Corner = [u32; 3];

#[derive(Default)]
pub(super) struct Parsed {
    pub positions: Vec<DVec3>,
    /// sRGB-encoded, in the range that the file has; for all positions or for none. NaN where a vertex has none.
    pub colors: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    pub corners: Vec<Corner>,
    /// For each polygon the first corner behind it.
    pub polygon_ends: Vec<usize>,
    /// Where polygons begin to have another material, and its name.
    pub materials: Vec<(usize, String)>,
    pub libraries: Vec<String>,
    /// First byte of the first polygon.
    pub first_polygon: Option<usize>,
}

/// How many positions, texture coordinates and normals there are.
#[derive(Clone, Copy, Default)]
struct Counts([usize; 3]);

const KEYWORDS: [&[u8]; 3] = [b"v", b"vt", b"vn"];

pub(super) fn parse(input: &Input, progress: &dyn Progress) -> Result<Parsed> {
    let pieces = Piece { text: input, start: 0 }.cut(line_end);
    progress.begin(&format!("read {}", input.name), 2 * input.len() as u64);
    // Polygons may count back from where they stand, so what stands before has to be known.
    let counts = parse_pieces(input, &pieces, |_, piece| Ok(count(piece)), progress)?;
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
    let parse = |i: usize, piece| parse_piece(piece, befores[i], total);
    let parsed = joined(parse_pieces(input, &pieces, parse, progress)?);
    if ABSENT as usize <= parsed.corners.len() {
        return Err(too_many("corners"));
    }
    Ok(parsed)
}

fn count(piece: Piece) -> Counts {
    let mut counts = Counts::default();
    for (_, line) in piece.lines(line_end) {
        let (keyword, _) = keyword(line);
        if let Some(kind) = KEYWORDS.iter().position(|known| *known == keyword) {
            counts.0[kind] += 1;
        }
    }
    counts
}

fn parse_piece(
    piece: Piece,
    mut counts: Counts,
    total: Counts,
) -> std::result::Result<Parsed, Fault> {
    let mut parsed = Parsed::default();
    for (at, line) in piece.lines(line_end) {
        let (keyword, rest) = keyword(line);
        parsed.add(at, keyword, rest, counts, total).map_err(|error| Fault::new(at, error))?;
        if let Some(kind) = KEYWORDS.iter().position(|known| *known == keyword) {
            counts.0[kind] += 1;
        }
    }
    Ok(parsed)
}

impl Parsed {
    /// Adds what a line says; lines of unknown keywords say nothing.
    fn add(
        &mut self,
        at: usize,
        keyword: &[u8],
        rest: &[u8],
        before: Counts,
        total: Counts,
    ) -> std::result::Result<(), LineError> {
        match keyword {
            b"v" => self.add_vertex(rest)?,
            b"vt" => {
                let ([u, v], _) = numbers::<1, 2>(rest)?;
                // In the file v goes up.
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
                self.first_polygon.get_or_insert(at);
            }
            b"usemtl" => self.materials.push((self.polygon_ends.len(), name(rest))),
            b"mtllib" => self.libraries.push(name(rest)),
            _ => {}
        }
        Ok(())
    }

    fn add_vertex(&mut self, rest: &[u8]) -> std::result::Result<(), LineError> {
        let ([x, y, z, rest @ ..], count) = numbers::<3, 7>(rest)?;
        self.positions.push(DVec3::new(x, y, z));
        // A weight stands between position and colour, or at the end.
        let color = match count {
            6 => Some([rest[0], rest[1], rest[2]]),
            7 => Some([rest[1], rest[2], rest[3]]),
            _ => None,
        };
        if color.is_some() || !self.colors.is_empty() {
            self.colors.resize(self.positions.len() - 1, Vec3::NAN);
            self.colors.push(color.map_or(Vec3::NAN, |color| DVec3::from_array(color).as_vec3()));
        }
        Ok(())
    }
}

/// A corner as `v`, `v/vt`, `v//vn` or `v/vt/vn`.
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

/// Counts from 1, or backward from -1, which is the last before the line.
fn index(
    number: &[u8],
    kind: usize,
    Counts(before): Counts,
    Counts(total): Counts,
) -> std::result::Result<u32, LineError> {
    let given = std::str::from_utf8(number).ok().and_then(|text| text.parse::<i64>().ok());
    let index = given.and_then(|given| match given {
        0 => None,
        1.. => usize::try_from(given - 1).ok(),
        _ => before[kind].checked_sub(usize::try_from(given.unsigned_abs()).ok()?),
    });
    index.filter(|index| *index < total[kind]).map(|index| index as u32).ok_or_else(|| {
        let what = ["vertex", "texture coordinates", "normal"][kind];
        LineError {
            found: format!("{what} `{}`", number[..number.len().min(40)].escape_ascii()),
            expected: match (total[kind], before[kind]) {
                (0, _) => "none, since the file has none".into(),
                (n_all, 0) => format!("1 to {n_all}"),
                (n_all, n_before) => format!("1 to {n_all}, or -1 to -{n_before}"),
            },
        }
    })
}

/// The pieces as one.
fn joined(pieces: Vec<Parsed>) -> Parsed {
    let mut all = Parsed::default();
    let has_colors = pieces.iter().any(|piece| !piece.colors.is_empty());
    for mut piece in pieces {
        let (n_corners, n_polygons) = (all.corners.len(), all.polygon_ends.len());
        if has_colors {
            piece.colors.resize(piece.positions.len(), Vec3::NAN);
        }
        all.positions.append(&mut piece.positions);
        all.colors.append(&mut piece.colors);
        all.uvs.append(&mut piece.uvs);
        all.normals.append(&mut piece.normals);
        all.corners.append(&mut piece.corners);
        all.polygon_ends.extend(piece.polygon_ends.iter().map(|end| end + n_corners));
        let materials = piece.materials.into_iter();
        all.materials.extend(materials.map(|(polygon, name)| (polygon + n_polygons, name)));
        all.libraries.append(&mut piece.libraries);
        all.first_polygon = all.first_polygon.or(piece.first_polygon);
    }
    all
}
