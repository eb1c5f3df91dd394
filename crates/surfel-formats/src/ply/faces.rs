//! Reads the faces of PLY files: polygons and strips, as triangles.

use surfel_core::math::Vec2;
use surfel_core::progress::Progress;

use super::element_lines::end_of_lines;
use super::header::{Element, Encoding, Header};
use super::skip::{property_end, skip_elements};
use crate::error::{Location, Result};
use crate::file::Input;
use crate::salvage::Salvage;
use crate::table::{
    Field, LineError, NumberType, ParseFault, TextChunk, find_line_end, line_at, parse_chunks,
    parse_number, words_of,
};

/// The faces of a file.
#[derive(Default)]
pub(super) struct Faces {
    /// Triangles as indices of vertices.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates of their corners, with v up as in the file; as many as triangles, or none.
    pub uvs: Vec<[Vec2; 3]>,
    /// Number of faces that were read.
    pub n_read: u64,
    /// Number of faces with fewer than three corners.
    pub n_short: u64,
    /// Location of the first face.
    pub location: Option<Location>,
}

/// An element whose items are faces.
struct FaceElement<'a> {
    element: &'a Element,
    /// Index of the property that lists the vertices.
    indices: usize,
    /// Index of the property that lists texture coordinates, two numbers a corner, as MeshLab writes them.
    texcoords: Option<usize>,
    /// True if the list holds triangle strips, separated by negative numbers, instead of a polygon.
    is_strips: bool,
    n_vertices: u64,
}

/// The lists of one face.
#[derive(Default)]
struct Lists {
    corners: Vec<f64>,
    texcoords: Vec<f64>,
}

/// Returns the number of faces in the file; a list of strips counts as one.
pub(super) fn count_faces(header: &Header) -> u64 {
    let elements = header.elements.iter();
    let faces = elements.filter(|element| FaceElement::new(element, 0).is_some());
    faces.fold(0, |sum, element| sum.saturating_add(element.count))
}

/// Reads all faces, whose corners are indices of `n_vertices` vertices; salvage reads those before the first damage.
pub(super) fn read_faces(
    salvage: &mut Salvage,
    header: &Header,
    n_vertices: u64,
    progress: &dyn Progress,
) -> Result<Faces> {
    let input = salvage.input;
    // Lines of text are parsed in chunks of many bytes, binary faces one by one.
    let is_ascii = header.encoding == Encoding::Ascii;
    let n_bytes = (input.len() - header.body) as u64;
    let n_units = if is_ascii { n_bytes } else { count_faces(header) };
    progress.begin(&format!("read the faces of {}", input.name), n_units);
    let mut faces = Faces::default();
    let mut at = header.body;
    for element in &header.elements {
        let read = match FaceElement::new(element, n_vertices) {
            Some(element) => element.read(input, at, header.encoding, &mut faces, progress),
            None => skip(input, at, element, header.encoding, progress),
        };
        match read {
            Ok(end) => at = end,
            Err(error) => {
                salvage.accept(error)?;
                break;
            }
        }
    }
    Ok(faces)
}

/// Returns the first byte after elements that hold no faces, which begin at `start`.
fn skip(
    input: &Input,
    start: usize,
    element: &Element,
    encoding: Encoding,
    progress: &dyn Progress,
) -> Result<usize> {
    match encoding {
        Encoding::Ascii => {
            let end = end_of_lines(input, start, element, progress)?;
            progress.advance((end - start) as u64);
            Ok(end)
        }
        _ => skip_elements(input, start, element, encoding == Encoding::BigEndian, progress),
    }
}

impl<'a> FaceElement<'a> {
    /// The faces of `element`; `None` if it holds none.
    fn new(element: &'a Element, n_vertices: u64) -> Option<Self> {
        let is_strips = element.name == "tristrips";
        let list = |names: [&str; 2]| {
            let mut properties = element.properties.iter();
            properties.position(|p| p.length_type.is_some() && names.contains(&p.name.as_str()))
        };
        let indices = list(["vertex_indices", "vertex_index"])?;
        let texcoords = list(["texcoord", "texcoords"]).filter(|_| !is_strips);
        let has_faces = (is_strips || element.name == "face") && 0 < element.count;
        has_faces.then_some(Self { element, indices, texcoords, is_strips, n_vertices })
    }

    /// Reads faces from `start`; returns the first byte after them. If one is broken, those before it are read.
    fn read(
        &self,
        input: &Input,
        start: usize,
        encoding: Encoding,
        faces: &mut Faces,
        progress: &dyn Progress,
    ) -> Result<usize> {
        let is_ascii = encoding == Encoding::Ascii;
        let location = if is_ascii { line_at(input, start) } else { Location::Byte(start as u64) };
        faces.location.get_or_insert(location);
        match encoding {
            Encoding::Ascii => self.read_ascii(input, start, faces, progress),
            _ => self.read_binary(input, start, encoding == Encoding::BigEndian, faces, progress),
        }
    }

    /// Reads binary faces from `start`; returns the first byte after them.
    fn read_binary(
        &self,
        input: &Input,
        start: usize,
        big_endian: bool,
        faces: &mut Faces,
        progress: &dyn Progress,
    ) -> Result<usize> {
        let mut at = start;
        let mut lists = Lists::default();
        for count in 0..self.element.count {
            if count % 65536 == 0 {
                progress.check()?;
                progress.advance(65536.min(self.element.count - count));
            }
            let first = at;
            for (i, property) in self.element.properties.iter().enumerate() {
                let end = property_end(input, at, property, big_endian)
                    .ok_or_else(|| self.element.ends_early(input))?;
                if let Some(list) = self.list(i, &mut lists) {
                    let items = &input[at + property.length_type.map_or(0, NumberType::size)..end];
                    let item = Field::new(0, property.number_type);
                    let items = items.chunks_exact(property.number_type.size());
                    list.clear();
                    list.extend(items.map(|bytes| item.value(bytes, big_endian)));
                }
                at = end;
            }
            self.add(&lists, faces).map_err(|LineError { found, expected }| {
                let advice = "the face is broken: write the file again from its source";
                input.malformed(Location::Byte(first as u64), found, expected, advice)
            })?;
        }
        Ok(at)
    }

    /// Reads ascii faces from `start`; returns the first byte after them.
    fn read_ascii(
        &self,
        input: &Input,
        start: usize,
        faces: &mut Faces,
        progress: &dyn Progress,
    ) -> Result<usize> {
        let end = end_of_lines(input, start, self.element, progress);
        // The last line of a file that ends early may be cut within a number.
        let last_line = || start + memchr::memrchr(b'\n', &input[start..]).map_or(0, |at| at + 1);
        let text_end = end.as_ref().map_or_else(|_| last_line(), |end| *end);
        let chunks = TextChunk { text: &input[start..text_end], start }.split(find_line_end);
        let parse = |_: usize, chunk: TextChunk| {
            let mut faces = Faces::default();
            let mut lists = Lists::default();
            for (at, line) in chunk.lines(find_line_end) {
                let parsed = self.parse_line(line, &mut lists);
                if let Err(error) = parsed.and_then(|()| self.add(&lists, &mut faces)) {
                    return Ok((faces, Some(ParseFault::new(at, error))));
                }
            }
            Ok((faces, None))
        };
        for (parsed, fault) in parse_chunks(input, &chunks, parse, progress)? {
            faces.triangles.extend(parsed.triangles);
            faces.uvs.extend(parsed.uvs);
            faces.n_read += parsed.n_read;
            faces.n_short += parsed.n_short;
            if let Some(fault) = fault {
                return Err(fault.into_error(input));
            }
        }
        end
    }

    /// Parses the lists in a line.
    fn parse_line(&self, line: &[u8], lists: &mut Lists) -> std::result::Result<(), LineError> {
        let mut words = words_of(line);
        let mut number = || {
            let word = words.next().ok_or_else(|| LineError {
                found: "the end of the line".into(),
                expected: "as many numbers as the lengths of its lists say".into(),
            })?;
            parse_number(word)
        };
        // The properties after the last list are not needed.
        let last = self.texcoords.map_or(self.indices, |texcoords| texcoords.max(self.indices));
        for (i, property) in self.element.properties[..=last].iter().enumerate() {
            let n_items = if property.length_type.is_some() { number()? as u64 } else { 1 };
            let mut list = self.list(i, lists);
            list.iter_mut().for_each(|list| list.clear());
            // A list longer than the line is an error at the end of the line.
            for _ in 0..n_items {
                let item = number()?;
                list.iter_mut().for_each(|list| list.push(item));
            }
        }
        Ok(())
    }

    /// Returns the list that takes the items of a property, if they are needed.
    fn list<'b>(&self, property: usize, lists: &'b mut Lists) -> Option<&'b mut Vec<f64>> {
        match property {
            _ if property == self.indices => Some(&mut lists.corners),
            _ if Some(property) == self.texcoords => Some(&mut lists.texcoords),
            _ => None,
        }
    }

    /// Adds the triangles of a polygon or of strips, all or none.
    fn add(&self, lists: &Lists, faces: &mut Faces) -> std::result::Result<(), LineError> {
        let n_before = faces.triangles.len();
        let added = self.add_triangles(lists, faces);
        match added {
            Ok(()) => faces.n_read += 1,
            Err(_) => faces.triangles.truncate(n_before),
        }
        added
    }

    fn add_triangles(
        &self,
        lists: &Lists,
        faces: &mut Faces,
    ) -> std::result::Result<(), LineError> {
        let vertex = |corner: f64| {
            let is_vertex =
                corner.fract() == 0.0 && 0.0 <= corner && corner < self.n_vertices as f64;
            is_vertex.then_some(corner as u32).ok_or_else(|| LineError {
                found: format!("vertex {corner}"),
                expected: match self.n_vertices {
                    1 => "0, since there is one vertex".into(),
                    n => format!("one of the {n} vertices, counted from 0"),
                },
            })
        };
        if self.is_strips {
            for strip in lists.corners.split(|corner| *corner < 0.0) {
                for (i, three) in strip.array_windows().enumerate() {
                    let [a, b, c] = *three;
                    let [a, b, c] = [vertex(a)?, vertex(b)?, vertex(c)?];
                    // Every other triangle of a strip has the opposite winding.
                    faces.triangles.push(if i % 2 == 0 { [a, b, c] } else { [b, a, c] });
                }
            }
            return Ok(());
        }
        let [first, rest @ ..] = lists.corners.as_slice() else {
            faces.n_short += 1;
            return Ok(());
        };
        let first = vertex(*first)?;
        for pair in rest.array_windows() {
            let [a, b] = *pair;
            faces.triangles.push([first, vertex(a)?, vertex(b)?]);
        }
        faces.n_short += u64::from(rest.len() < 2);
        if self.texcoords.is_some() {
            let uv = |corner: usize| {
                let pair = lists.texcoords.get(2 * corner..2 * corner + 2);
                pair.map_or(Vec2::ZERO, |pair| Vec2::new(pair[0] as f32, pair[1] as f32))
            };
            faces.uvs.extend((1..rest.len()).map(|i| [uv(0), uv(i), uv(i + 1)]));
        }
        Ok(())
    }
}
