//! Radiance HDR: pixels of three mantissas and a common exponent (Ward 1991, Real Pixels), in lines.

use surfel::math::Vec3;
use surfel::progress::Progress;

use super::{LinearPicture, black, check_size, note_primaries};
use crate::error::{Place, Result};
use crate::input::Input;

pub(super) const MAGIC: &[u8] = b"#?";

const LONGEST_LINE: usize = 4096;
const ADVICE: &str = "the header is broken; write the file again";
const CUT_OFF: &str = "copy the file again from its source, or write it again";

/// Red, green, blue and exponent as stored.
type Rgbe = [u8; 4];

struct Header {
    /// What the stored values were multiplied with: exposure times colour correction.
    scale: [f64; 3],
    layout: Layout,
    /// Where the pixels begin.
    body: usize,
}

/// How the scanlines lie in the picture.
struct Layout {
    width: u32,
    height: u32,
    /// A scanline is a column.
    is_by_column: bool,
    /// The axes run from right to left and from the bottom up.
    is_mirrored: bool,
    is_flipped: bool,
}

pub(super) fn read(input: &Input, progress: &dyn Progress) -> Result<LinearPicture> {
    let header = read_header(input, progress)?;
    let layout = &header.layout;
    let mut picture = black(input, layout.width, layout.height)?;
    let (n_lines, length) = layout.lines();
    progress.begin(&format!("read {}", input.name), n_lines as u64);
    let values = value_table(header.scale);
    let mut reader = Scanlines { input, at: header.body };
    let mut scanline: Vec<Rgbe> = vec![[0; 4]; length];
    for line in 0..n_lines {
        progress.check()?;
        reader.read(&mut scanline, line)?;
        for (along, [r, g, b, e]) in scanline.iter().enumerate() {
            let mantissas = Vec3::new(f32::from(*r), f32::from(*g), f32::from(*b));
            picture.pixels[layout.index(line, along)] = mantissas * values[usize::from(*e)];
        }
        progress.advance(1);
    }
    Ok(picture)
}

/// What one step of the mantissas is worth, for each exponent. Ward adds half a step to each; like most
/// readers and writers of today we do not, so that black stays black.
fn value_table(scale: [f64; 3]) -> Vec<Vec3> {
    let value = |exponent: i32| {
        // Exponent 0 marks black.
        let step = if exponent == 0 { 0.0 } else { 2f64.powi(exponent - 136) };
        Vec3::from_array(scale.map(|scale| (step / scale).min(f64::from(f32::MAX) / 255.0) as f32))
    };
    (0..256).map(value).collect()
}

impl Layout {
    /// Number of scanlines, and of pixels in each.
    fn lines(&self) -> (usize, usize) {
        let (width, height) = (self.width as usize, self.height as usize);
        if self.is_by_column { (width, height) } else { (height, width) }
    }

    fn index(&self, line: usize, along: usize) -> usize {
        let (x, y) = if self.is_by_column { (line, along) } else { (along, line) };
        let (width, height) = (self.width as usize, self.height as usize);
        let x = if self.is_mirrored { width - 1 - x } else { x };
        let y = if self.is_flipped { height - 1 - y } else { y };
        y * width + x
    }
}

/// Reads lines up to an empty one, then that of the size.
fn read_header(input: &Input, progress: &dyn Progress) -> Result<Header> {
    let mut scale = [1.0; 3];
    let mut primaries = None;
    let mut lines = HeaderLines { input, at: 0, number: 0 };
    loop {
        progress.check()?;
        let line = lines.next("an empty line behind the header")?;
        if line.is_empty() {
            break;
        }
        let Some((name, value)) = line.split_once('=') else { continue };
        match name {
            "FORMAT" if value.trim() == "32-bit_rle_rgbe" => {}
            "FORMAT" if value.trim() == "32-bit_rle_xyze" => {
                let advice = "convert it to RGB: `ra_xyze -r` of Radiance does so";
                return Err(input.unsupported("colours in CIE XYZ (32-bit_rle_xyze)", advice));
            }
            "FORMAT" => return Err(lines.malformed(&line, "`FORMAT=32-bit_rle_rgbe`")),
            // Each program that changed the brightness has left such a line: they multiply.
            "EXPOSURE" => match numbers(value).as_deref() {
                Some([exposure]) => scale = scale.map(|scale| scale * exposure),
                _ => return Err(lines.malformed(&line, "EXPOSURE= and a number above 0")),
            },
            "COLORCORR" => match numbers(value).as_deref() {
                Some([r, g, b]) => scale = [scale[0] * r, scale[1] * g, scale[2] * b],
                _ => return Err(lines.malformed(&line, "COLORCORR= and three numbers above 0")),
            },
            "PRIMARIES" => primaries = Some(numbers(value).unwrap_or_default()),
            _ => {}
        }
        if !scale.iter().all(|scale| scale.is_normal()) {
            return Err(lines.malformed(&line, "exposures whose product is a number above 0"));
        }
    }
    if let Some(primaries) = primaries {
        note_primaries(input, &primaries, progress);
    }
    let line = lines.next("the size, such as `-Y 512 +X 1024`")?;
    let layout = parse_size(&line)
        .ok_or_else(|| lines.malformed(&line, "the size, such as `-Y 512 +X 1024`"))?;
    let size = [layout.width, layout.height].map(u64::from);
    check_size(input, Place::Line(lines.number), size, size_of::<Rgbe>() as u64)?;
    Ok(Header { scale, layout, body: lines.at })
}

/// Numbers above 0, separated by spaces.
fn numbers(text: &str) -> Option<Vec<f64>> {
    let number =
        |word: &str| word.parse().ok().filter(|number: &f64| number.is_normal() && 0.0 < *number);
    text.split_ascii_whitespace().map(number).collect()
}

/// Two axes with signs and lengths: the first goes from scanline to scanline.
fn parse_size(line: &str) -> Option<Layout> {
    let words: Vec<&str> = line.split_ascii_whitespace().collect();
    let [first, n_lines, second, length] = words[..] else { return None };
    let axis = |word| match word {
        "+X" => Some(('X', false)),
        "-X" => Some(('X', true)),
        // Y points up, our rows go down.
        "-Y" => Some(('Y', false)),
        "+Y" => Some(('Y', true)),
        _ => None,
    };
    let (n_lines, length) = (n_lines.parse().ok()?, length.parse().ok()?);
    match (axis(first)?, axis(second)?) {
        (('Y', is_flipped), ('X', is_mirrored)) => {
            let (width, height) = (length, n_lines);
            Some(Layout { width, height, is_by_column: false, is_mirrored, is_flipped })
        }
        (('X', is_mirrored), ('Y', is_flipped)) => {
            let (width, height) = (n_lines, length);
            Some(Layout { width, height, is_by_column: true, is_mirrored, is_flipped })
        }
        _ => None,
    }
}

struct HeaderLines<'i> {
    input: &'i Input<'i>,
    at: usize,
    /// Of the line that was read last, from 1.
    number: u64,
}

impl HeaderLines<'_> {
    /// The next line without its end, with what is no UTF-8 replaced.
    fn next(&mut self, expected: &str) -> Result<String> {
        self.number += 1;
        let rest = &self.input[self.at..];
        let Some(length) = memchr::memchr(b'\n', &rest[..rest.len().min(LONGEST_LINE)]) else {
            let found =
                if rest.len() < LONGEST_LINE { "the end of the file" } else { "a longer line" };
            return Err(self.input.malformed(Place::Line(self.number), found, expected, ADVICE));
        };
        self.at += length + 1;
        let line = &rest[..length];
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        Ok(String::from_utf8_lossy(line).into_owned())
    }

    fn malformed(&self, found: &str, expected: &str) -> crate::Error {
        let found = format!("`{}`", found.trim().chars().take(80).collect::<String>());
        self.input.malformed(Place::Line(self.number), found, expected, ADVICE)
    }
}

/// The pixels behind the header.
struct Scanlines<'i> {
    input: &'i Input<'i>,
    at: usize,
}

/// What can be wrong with a scanline.
enum Problem {
    End,
    OtherLength(usize),
    EmptyRun,
    LongRun,
    NothingToRepeat,
}

impl Scanlines<'_> {
    /// The next scanline, in either encoding: each says for itself which.
    fn read(&mut self, scanline: &mut [Rgbe], line: usize) -> Result<()> {
        let length = scanline.len();
        let start = self.input.get(self.at..self.at + 4);
        let read = match start {
            // A pixel of such mantissas would have been written with a smaller exponent.
            Some([2, 2, high, low]) if *high < 128 && (8..1 << 15).contains(&length) => {
                self.at += 4;
                match usize::from(u16::from_be_bytes([*high, *low])) {
                    other if other != length => Err(Problem::OtherLength(other)),
                    _ => self.read_channels(scanline),
                }
            }
            _ => self.read_pixels(scanline),
        };
        read.map_err(|problem| {
            let (found, expected) = match problem {
                Problem::End => ("the end of the file".into(), format!("{length} pixels")),
                Problem::OtherLength(other) => (format!("{other} pixels"), length.to_string()),
                Problem::EmptyRun => ("a run of no bytes".into(), "one of 1 to 128".into()),
                Problem::LongRun => ("a run past its end".into(), format!("{length} pixels")),
                Problem::NothingToRepeat => ("a repetition first".into(), "a pixel first".into()),
            };
            let found = format!("in scanline {line} {found}");
            self.input.malformed(Place::Byte(self.at as u64), found, expected, CUT_OFF)
        })
    }

    /// One channel of the line after the other, as runs of one byte or of several.
    fn read_channels(&mut self, scanline: &mut [Rgbe]) -> std::result::Result<(), Problem> {
        for channel in 0..4 {
            let mut filled = 0;
            while filled < scanline.len() {
                let code = self.take(1)?[0];
                let count = usize::from(if 128 < code { code - 128 } else { code });
                if count == 0 {
                    return Err(Problem::EmptyRun);
                }
                let run = scanline.get_mut(filled..filled + count).ok_or(Problem::LongRun)?;
                let bytes = self.take(if 128 < code { 1 } else { count })?;
                for (pixel, byte) in run.iter_mut().zip(bytes.iter().cycle()) {
                    pixel[channel] = *byte;
                }
                filled += count;
            }
        }
        Ok(())
    }

    /// Whole pixels. One with mantissas of 1, which is no other pixel's, repeats the one before as often
    /// as its exponent says; several on end are the digits of a number, the lowest first.
    fn read_pixels(&mut self, scanline: &mut [Rgbe]) -> std::result::Result<(), Problem> {
        let (mut filled, mut shift) = (0, 0);
        while filled < scanline.len() {
            let bytes = self.take(4)?;
            let pixel = [bytes[0], bytes[1], bytes[2], bytes[3]];
            if let [1, 1, 1, digit] = pixel {
                let repeated = filled.checked_sub(1).ok_or(Problem::NothingToRepeat)?;
                let count = if 24 < shift { usize::MAX } else { usize::from(digit) << shift };
                let end = filled.saturating_add(count);
                let previous = scanline[repeated];
                scanline.get_mut(filled..end).ok_or(Problem::LongRun)?.fill(previous);
                (filled, shift) = (end, shift + 8);
            } else {
                scanline[filled] = pixel;
                (filled, shift) = (filled + 1, 0);
            }
        }
        Ok(())
    }

    fn take(&mut self, count: usize) -> std::result::Result<&[u8], Problem> {
        let bytes = self.input.get(self.at..self.at + count).ok_or(Problem::End)?;
        self.at += count;
        Ok(bytes)
    }
}
