//! OFF (Geomview): the vertices of a mesh, then its polygons, as lines of text. The first word says whether vertices have
//! normals and texture coordinates; whatever follows is a colour.

use surfel_core::math::DVec3;
use surfel_core::points::{PointCloud, Scalar, Values};
use surfel_core::progress::Progress;
use surfel_core::scene::{Material, Mesh};
use surfel_core::words::counted;

use crate::error::{Error, Location, Result};
use crate::file::{Input, ResourceResolver};
use crate::mesh::{Model, linear_colors, relative_to_origin, repair_model};
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::table::{
    ColorRange, LineError, ParseFault, Tolerance, find_line_end, keep_matching, line_at,
    parse_numbers, words_of,
};

/// Number of lines between two looks for cancellation.
const LINES_PER_CHECK: u64 = 1 << 16;
const ADVICE: &str = "write the mesh again, as OFF of text or as PLY";

/// The content of the first lines.
#[derive(Default)]
struct Header {
    has_normals: bool,
    has_uvs: bool,
    /// True if vertices have colours; the lines of some files have them though the first word does not say so.
    has_colors: bool,
    n_vertices: u64,
    n_faces: u64,
}

/// Reads the numbers of vertices and faces.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    Ok(file_info(&Body::open(input)?.header))
}

/// Returns true if the header announces faces.
pub(crate) fn has_faces(input: &Input) -> Result<bool> {
    Ok(0 < Body::open(input)?.header.n_faces)
}

/// Reads the vertices as points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let mut body = Body::open(input)?;
    let mut cloud = body.read_vertices(options, progress)?;
    body.header.has_colors = cloud.colors.is_some();
    keep_matching(&mut cloud, 0, options.filter.as_ref())?;
    options.columns.drop_others(&mut cloud);
    Ok(Loaded { cloud, info: file_info(&body.header) })
}

/// Reads the faces as a mesh of triangles.
pub(crate) fn read_mesh(
    input: &Input,
    _: &ResourceResolver,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Model, FileInfo)> {
    let mut body = Body::open(input)?;
    let cloud = body.read_vertices(options, progress)?;
    let first_face = body.at;
    let (triangles, n_short) = body.read_faces(progress)?;
    body.header.has_colors = cloud.colors.is_some();
    let colors = linear_colors(&cloud);
    let PointCloud { origin, positions, normals, .. } = cloud;
    let mesh = Mesh { origin, positions, triangles, normals, colors, ..Mesh::default() };
    let model = Model { parts: vec![(mesh, Material::MATTE)], textures: Vec::new() };
    let location = line_at(input, first_face);
    let (model, n_triangles) = repair_model(input, model, n_short, location, progress)?;
    Ok((model, FileInfo { n_triangles: Some(n_triangles), ..file_info(&body.header) }))
}

fn file_info(header: &Header) -> FileInfo {
    let present = [
        (true, &["x", "y", "z"][..]),
        (header.has_normals, &["nx", "ny", "nz"]),
        (header.has_colors, &["red", "green", "blue"]),
        (header.has_uvs, &["u", "v"]),
    ];
    let columns = present.iter().filter(|(is_present, _)| *is_present);
    FileInfo {
        format: "OFF".into(),
        n_points: Some(header.n_vertices),
        n_triangles: (0 < header.n_faces).then_some(header.n_faces),
        columns: columns.flat_map(|(_, names)| *names).map(|name| (*name).into()).collect(),
        ..FileInfo::default()
    }
}

/// A file whose header is read.
struct Body<'a> {
    input: &'a Input<'a>,
    header: Header,
    /// First byte that is not read.
    at: usize,
}

impl<'a> Body<'a> {
    /// Reads the header of a file.
    fn open(input: &'a Input<'a>) -> Result<Self> {
        let mut body = Self { input, header: Header::default(), at: 0 };
        let (start, line) = body.next_line().unwrap_or_default();
        let keyword = memchr::memmem::find(line, b"OFF").filter(|at| *at <= "STCN4n".len());
        let Some(keyword) = keyword else {
            let found = format!("`{}`", line[..line.len().min(40)].escape_ascii());
            return Err(input.malformed(line_at(input, start), found, "`OFF`", ADVICE));
        };
        let (prefix, rest) = (&line[..keyword], line[keyword + 3..].trim_ascii());
        if prefix.iter().any(|letter| matches!(letter, b'4' | b'n')) {
            return Err(input.unsupported("OFF of other than three coordinates", ADVICE));
        }
        if rest.eq_ignore_ascii_case(b"BINARY") {
            return Err(input.unsupported("binary OFF", ADVICE));
        }
        let counts =
            if rest.is_empty() { body.next_line().unwrap_or_default() } else { (start, rest) };
        let count = |word: &[u8]| str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        let mut words = words_of(counts.1);
        let [n_vertices, n_faces] = [words.next(), words.next()].map(|word| word.and_then(count));
        let (Some(n_vertices), Some(n_faces)) = (n_vertices, n_faces) else {
            let found = format!("`{}`", counts.1[..counts.1.len().min(40)].escape_ascii());
            let expected = "the numbers of vertices, faces and edges";
            return Err(input.malformed(line_at(input, counts.0), found, expected, ADVICE));
        };
        if u64::from(u32::MAX) < n_vertices {
            let found = format!("{n_vertices} vertices");
            return Err(input.unsupported(found, "cut the mesh into several files"));
        }
        body.header = Header {
            has_normals: prefix.contains(&b'N'),
            has_uvs: prefix.starts_with(b"ST"),
            has_colors: prefix.contains(&b'C'),
            n_vertices,
            n_faces,
        };
        Ok(body)
    }

    /// Returns the next line with its first byte, without comments and blanks around it; empty lines are skipped.
    fn next_line(&mut self) -> Option<(usize, &'a [u8])> {
        let input = self.input;
        while self.at < input.len() {
            let (start, rest) = (self.at, &input[self.at..]);
            let length = find_line_end(rest).unwrap_or(rest.len());
            self.at += length;
            let text = rest[..length].split(|byte| *byte == b'#').next().unwrap_or_default();
            if !text.trim_ascii().is_empty() {
                return Some((start, text.trim_ascii()));
            }
        }
        None
    }

    /// Reads the vertices with their normals and colours.
    fn read_vertices(
        &mut self,
        options: &LoadOptions,
        progress: &dyn Progress,
    ) -> Result<PointCloud> {
        let Header { has_normals, has_uvs, n_vertices, .. } = self.header;
        let n_before_color = if has_normals { 6 } else { 3 };
        let (mut positions, mut normals, mut colors) = (Vec::new(), Vec::new(), Vec::new());
        let mut uvs = [Vec::new(), Vec::new()];
        progress.begin(&format!("read {}", self.input.name), n_vertices);
        self.for_each_line(n_vertices, progress, |numbers| {
            let n_uvs = if has_uvs { 2 } else { 0 };
            if numbers.len() < n_before_color + n_uvs {
                let expected = format!("at least {}", n_before_color + n_uvs);
                return Err(LineError { found: counted(numbers.len(), "number"), expected });
            }
            positions.push(DVec3::new(numbers[0], numbers[1], numbers[2]));
            if has_normals {
                normals.push(DVec3::new(numbers[3], numbers[4], numbers[5]).as_vec3());
            }
            let (before, last) = numbers.split_at(numbers.len() - n_uvs);
            if let [r, g, b, ..] = before[n_before_color..] {
                colors.push([r, g, b]);
            }
            for (column, value) in uvs.iter_mut().zip(last) {
                column.push(*value as f32);
            }
            Ok(())
        })?;
        let (origin, positions) = relative_to_origin(&positions, Tolerance::UNSTATED, options);
        let range = ColorRange::from_text(colors.as_flattened().iter().copied());
        let is_complete = !colors.is_empty() && colors.len() == positions.len();
        let uvs = ["u", "v"].into_iter().zip(uvs).filter(|_| has_uvs);
        let scalar =
            |(name, values)| Scalar { name: String::from(name), values: Values::F32(values) };
        let to_16_bits = |color: &[f64; 3]| color.map(|v| (v * range.scale()).round() as u16);
        Ok(PointCloud {
            origin,
            normals: has_normals.then_some(normals),
            colors: is_complete.then(|| colors.iter().map(to_16_bits).collect()),
            scalars: uvs.map(scalar).collect(),
            ..PointCloud::from_positions(positions)
        })
    }

    /// Reads the faces as triangles; also returns the number of those that have fewer than three corners.
    fn read_faces(&mut self, progress: &dyn Progress) -> Result<(Vec<[u32; 3]>, u64)> {
        let Header { n_vertices, n_faces, .. } = self.header;
        let (mut triangles, mut n_short) = (Vec::new(), 0);
        progress.begin(&format!("read the faces of {}", self.input.name), n_faces);
        let mut corners: Vec<u32> = Vec::new();
        self.for_each_line(n_faces, progress, |numbers| {
            let n_corners = numbers[0];
            let is_whole = n_corners.fract() == 0.0 && 0.0 <= n_corners;
            let Some(found) = numbers[1..].get(..n_corners as usize).filter(|_| is_whole) else {
                let expected = "the number of corners and their vertices".into();
                return Err(LineError { found: counted(numbers.len(), "number"), expected });
            };
            corners.clear();
            for corner in found {
                if corner.fract() != 0.0 || !(0.0..n_vertices as f64).contains(corner) {
                    let expected = format!("0 to {}", n_vertices.saturating_sub(1));
                    return Err(LineError { found: format!("vertex {corner}"), expected });
                }
                corners.push(*corner as u32);
            }
            n_short += u64::from(corners.len() < 3);
            let others = corners.windows(2).skip(1);
            triangles.extend(others.map(|pair| [corners[0], pair[0], pair[1]]));
            Ok(())
        })?;
        Ok((triangles, n_short))
    }

    /// Parses so many lines of numbers, at least one each.
    fn for_each_line(
        &mut self,
        n_lines: u64,
        progress: &dyn Progress,
        mut visit: impl FnMut(&[f64]) -> std::result::Result<(), LineError>,
    ) -> Result<()> {
        let input = self.input;
        let mut numbers = Vec::new();
        for i in 0..n_lines {
            if i % LINES_PER_CHECK == 0 {
                progress.check()?;
                progress.advance(LINES_PER_CHECK.min(n_lines - i));
            }
            let (start, line) = self
                .next_line()
                .ok_or_else(|| input.truncated(Location::Byte(input.len() as u64), i, n_lines))?;
            numbers.clear();
            let fault = |error| -> Error { ParseFault::new(start, error).into_error(input) };
            parse_numbers(line, &mut numbers).map_err(fault)?;
            visit(&numbers).map_err(fault)?;
        }
        Ok(())
    }
}
