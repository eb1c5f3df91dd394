//! Radiance HDR reader: scanlines of pixels with three mantissas and a shared exponent (Ward 1991, *Real
//! Pixels*).

use surfel_core::math::Vec3;
use surfel_core::progress::Progress;
use surfel_core::words::counted;

use super::hdr_image::{HdrImage, check_size, warn_about_primaries};
use crate::error::{Location, Result};
use crate::file::Input;

pub(super) const MAGIC: &[u8] = b"#?";

const MAX_LINE_LENGTH: usize = 4096;
const HEADER_ADVICE: &str = "the header is broken; write the file again";
const REWRITE_ADVICE: &str = "copy the file again from its source, or write it again";

/// The stored bytes of a pixel: red, green and blue mantissas and the exponent.
type Rgbe = [u8; 4];

struct Header {
    /// Factor per channel that the stored values were multiplied by: exposure times colour correction.
    scale: [f64; 3],
    layout: Layout,
    /// Byte offset of the pixels.
    pixels_at: usize,
}

/// The size of the image and the direction of its scanlines.
struct Layout {
    width: u32,
    height: u32,
    /// True if a scanline is a column.
    is_column_major: bool,
    /// True if x runs from right to left.
    is_mirrored: bool,
    /// True if y runs from the bottom up.
    is_flipped: bool,
}

/// Reads a Radiance HDR file.
pub(super) fn read(input: &Input, progress: &dyn Progress) -> Result<HdrImage> {
    let header = read_header(input, progress)?;
    let layout = &header.layout;
    let mut image = HdrImage::black(input, layout.width, layout.height)?;
    let (n_lines, length) = layout.n_lines_and_length();
    progress.begin(&format!("read {}", input.name), n_lines as u64);
    let steps = step_table(header.scale);
    let mut reader = ScanlineReader { input, at: header.pixels_at };
    let mut scanline: Vec<Rgbe> = vec![[0; 4]; length];
    for line in 0..n_lines {
        progress.check()?;
        reader.read(&mut scanline, line)?;
        for (offset, [r, g, b, e]) in scanline.iter().enumerate() {
            let mantissas = Vec3::new(f32::from(*r), f32::from(*g), f32::from(*b));
            image.pixels[layout.index(line, offset)] = mantissas * steps[usize::from(*e)];
        }
        progress.advance(1);
    }
    Ok(image)
}

/// Returns the radiance of one mantissa step for each exponent. Ward adds half a step to each mantissa; this
/// reader, like most others today, does not, so that black stays black.
fn step_table(scale: [f64; 3]) -> Vec<Vec3> {
    let step = |exponent: i32| {
        // Exponent 0 means black.
        let step = if exponent == 0 { 0.0 } else { 2f64.powi(exponent - 136) };
        Vec3::from_array(scale.map(|scale| (step / scale).min(f64::from(f32::MAX) / 255.0) as f32))
    };
    (0..256).map(step).collect()
}

impl Layout {
    /// Returns the number of scanlines and the number of pixels per scanline.
    fn n_lines_and_length(&self) -> (usize, usize) {
        let (width, height) = (self.width as usize, self.height as usize);
        if self.is_column_major { (width, height) } else { (height, width) }
    }

    /// Returns the index in the image of pixel `offset` of scanline `line`.
    fn index(&self, line: usize, offset: usize) -> usize {
        let (x, y) = if self.is_column_major { (line, offset) } else { (offset, line) };
        let (width, height) = (self.width as usize, self.height as usize);
        let x = if self.is_mirrored { width - 1 - x } else { x };
        let y = if self.is_flipped { height - 1 - y } else { y };
        y * width + x
    }
}

/// Reads the header lines up to an empty line, and the line with the size.
fn read_header(input: &Input, progress: &dyn Progress) -> Result<Header> {
    let mut scale = [1.0; 3];
    let mut primaries = None;
    let mut lines = HeaderLines { input, at: 0, line_number: 0 };
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
            // Every program that changes the brightness appends such a line; the factors multiply.
            "EXPOSURE" => match parse_positive_numbers(value).as_deref() {
                Some([exposure]) => scale = scale.map(|scale| scale * exposure),
                _ => return Err(lines.malformed(&line, "EXPOSURE= and a number above 0")),
            },
            "COLORCORR" => match parse_positive_numbers(value).as_deref() {
                Some([r, g, b]) => scale = [scale[0] * r, scale[1] * g, scale[2] * b],
                _ => return Err(lines.malformed(&line, "COLORCORR= and three numbers above 0")),
            },
            "PRIMARIES" => primaries = Some(parse_positive_numbers(value).unwrap_or_default()),
            _ => {}
        }
        if !scale.iter().all(|scale| scale.is_normal()) {
            return Err(lines.malformed(&line, "exposures whose product is a number above 0"));
        }
    }
    if let Some(primaries) = primaries {
        warn_about_primaries(input, &primaries, progress);
    }
    let line = lines.next("the size, such as `-Y 512 +X 1024`")?;
    let layout = parse_size(&line)
        .ok_or_else(|| lines.malformed(&line, "the size, such as `-Y 512 +X 1024`"))?;
    let size = [layout.width, layout.height].map(u64::from);
    check_size(input, Location::Line(lines.line_number), size, size_of::<Rgbe>() as u64)?;
    Ok(Header { scale, layout, pixels_at: lines.at })
}

/// Parses positive numbers that are separated by spaces.
fn parse_positive_numbers(text: &str) -> Option<Vec<f64>> {
    let number =
        |word: &str| word.parse().ok().filter(|number: &f64| number.is_normal() && 0.0 < *number);
    text.split_ascii_whitespace().map(number).collect()
}

/// Parses two signed axes with lengths; the first axis counts the scanlines.
fn parse_size(line: &str) -> Option<Layout> {
    let words: Vec<&str> = line.split_ascii_whitespace().collect();
    let [first, n_lines, second, length] = words[..] else { return None };
    let axis = |word| match word {
        "+X" => Some(('X', false)),
        "-X" => Some(('X', true)),
        // Y points up in the format, but rows run down in the image.
        "-Y" => Some(('Y', false)),
        "+Y" => Some(('Y', true)),
        _ => None,
    };
    let (n_lines, length) = (n_lines.parse().ok()?, length.parse().ok()?);
    match (axis(first)?, axis(second)?) {
        (('Y', is_flipped), ('X', is_mirrored)) => {
            let (width, height) = (length, n_lines);
            Some(Layout { width, height, is_column_major: false, is_mirrored, is_flipped })
        }
        (('X', is_mirrored), ('Y', is_flipped)) => {
            let (width, height) = (n_lines, length);
            Some(Layout { width, height, is_column_major: true, is_mirrored, is_flipped })
        }
        _ => None,
    }
}

/// A reader of the lines of the header.
struct HeaderLines<'i> {
    input: &'i Input<'i>,
    at: usize,
    /// Number of the last line read, counted from 1.
    line_number: u64,
}

impl HeaderLines<'_> {
    /// Returns the next line without its line break. Invalid UTF-8 is replaced.
    fn next(&mut self, expected: &str) -> Result<String> {
        self.line_number += 1;
        let rest = &self.input[self.at..];
        let Some(length) = memchr::memchr(b'\n', &rest[..rest.len().min(MAX_LINE_LENGTH)]) else {
            let found =
                if rest.len() < MAX_LINE_LENGTH { "the end of the file" } else { "a longer line" };
            return Err(self.input.malformed(
                Location::Line(self.line_number),
                found,
                expected,
                HEADER_ADVICE,
            ));
        };
        self.at += length + 1;
        let line = &rest[..length];
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        Ok(String::from_utf8_lossy(line).into_owned())
    }

    fn malformed(&self, found: &str, expected: &str) -> crate::Error {
        let found = format!("`{}`", found.trim().chars().take(80).collect::<String>());
        self.input.malformed(Location::Line(self.line_number), found, expected, HEADER_ADVICE)
    }
}

/// A reader of the pixels after the header.
struct ScanlineReader<'i> {
    input: &'i Input<'i>,
    at: usize,
}

/// An error in the encoding of a scanline.
enum ScanlineError {
    EndOfFile,
    WrongLength(usize),
    EmptyRun,
    RunTooLong,
    NothingToRepeat,
}

impl ScanlineReader<'_> {
    /// Reads the next scanline. Each scanline declares which of the two encodings it uses.
    fn read(&mut self, scanline: &mut [Rgbe], line: usize) -> Result<()> {
        let length = scanline.len();
        let start = self.input.get(self.at..self.at + 4);
        let read = match start {
            // No encoder writes a pixel with these mantissas: it would have a smaller exponent.
            Some([2, 2, high, low]) if *high < 128 && (8..1 << 15).contains(&length) => {
                self.at += 4;
                match usize::from(u16::from_be_bytes([*high, *low])) {
                    other if other != length => Err(ScanlineError::WrongLength(other)),
                    _ => self.read_channels(scanline),
                }
            }
            _ => self.read_pixels(scanline),
        };
        read.map_err(|error| {
            let (found, expected) = match error {
                ScanlineError::EndOfFile => {
                    ("the end of the file".into(), counted(length, "pixel"))
                }
                ScanlineError::WrongLength(other) => (counted(other, "pixel"), length.to_string()),
                ScanlineError::EmptyRun => ("a run of no bytes".into(), "one of 1 to 128".into()),
                ScanlineError::RunTooLong => {
                    ("a run past its end".into(), counted(length, "pixel"))
                }
                ScanlineError::NothingToRepeat => {
                    ("a repetition first".into(), "a pixel first".into())
                }
            };
            let found = format!("in scanline {line} {found}");
            self.input.malformed(Location::Byte(self.at as u64), found, expected, REWRITE_ADVICE)
        })
    }

    /// Reads a scanline that stores one channel after the other, as runs and literals.
    fn read_channels(&mut self, scanline: &mut [Rgbe]) -> std::result::Result<(), ScanlineError> {
        for channel in 0..4 {
            let mut filled = 0;
            while filled < scanline.len() {
                let code = self.take(1)?[0];
                let count = usize::from(if 128 < code { code - 128 } else { code });
                if count == 0 {
                    return Err(ScanlineError::EmptyRun);
                }
                let run =
                    scanline.get_mut(filled..filled + count).ok_or(ScanlineError::RunTooLong)?;
                let bytes = self.take(if 128 < code { 1 } else { count })?;
                for (pixel, byte) in run.iter_mut().zip(bytes.iter().cycle()) {
                    pixel[channel] = *byte;
                }
                filled += count;
            }
        }
        Ok(())
    }

    /// Reads a scanline of whole pixels. A pixel with mantissas of 1, which no encoder writes otherwise,
    /// repeats the previous pixel; its exponent is the count. Several such pixels in a row are the digits of
    /// the count in base 256, the lowest first.
    fn read_pixels(&mut self, scanline: &mut [Rgbe]) -> std::result::Result<(), ScanlineError> {
        let (mut filled, mut shift) = (0, 0);
        while filled < scanline.len() {
            let bytes = self.take(4)?;
            let pixel = [bytes[0], bytes[1], bytes[2], bytes[3]];
            if let [1, 1, 1, digit] = pixel {
                let last = filled.checked_sub(1).ok_or(ScanlineError::NothingToRepeat)?;
                let count = if 24 < shift { usize::MAX } else { usize::from(digit) << shift };
                let end = filled.saturating_add(count);
                let previous = scanline[last];
                scanline.get_mut(filled..end).ok_or(ScanlineError::RunTooLong)?.fill(previous);
                (filled, shift) = (end, shift + 8);
            } else {
                scanline[filled] = pixel;
                (filled, shift) = (filled + 1, 0);
            }
        }
        Ok(())
    }

    fn take(&mut self, count: usize) -> std::result::Result<&[u8], ScanlineError> {
        let bytes = self.input.get(self.at..self.at + count).ok_or(ScanlineError::EndOfFile)?;
        self.at += count;
        Ok(bytes)
    }
}
