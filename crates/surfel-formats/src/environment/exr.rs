//! EXR: the colours of the first part. The crate decodes; what a file claims is checked before.

use std::cell::Cell;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::reader::Reader;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::compression::Compression;
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelList, Chromaticities, SampleType};
use exr::meta::header::Header;
use exr::prelude::f16;
use rayon::prelude::*;
use surfel::progress::Progress;

use super::{LinearPicture, black, check_size, granted_bytes, note_primaries};
use crate::error::{Error, Place, Result};
use crate::input::Input;

pub(super) const MAGIC: &[u8] = &exr::meta::magic_number::BYTES;

const CUT_OFF: &str = "copy the file again from its source, or write it again";
const WAY_OUT: &str =
    "write it again as one flat part with the channels R, G and B and ZIP compression";
/// Blocks are decoded by all threads, about so many bytes of them at a time.
const BYTES_AT_A_TIME: usize = 16 << 20;

pub(super) fn read(input: &Input, progress: &dyn Progress) -> Result<LinearPicture> {
    let at = Cell::new(0);
    let here = || Place::Byte(at.get());
    let bytes = Tracked { bytes: Cursor::new(input), at: &at };
    let reader = guarded(input, here, || Reader::read_from_buffered(bytes, false))?;
    let meta_data = reader.meta_data().clone();
    // Of all parts: a block may claim to belong to any.
    for header in &meta_data.headers {
        check_sizes(input, header)?;
    }
    let Some(header) = meta_data.headers.first() else {
        return Err(broken(input, here(), "no part", "one at least"));
    };
    let colors = find_colors(input, &header.channels)?;
    if let Some(Chromaticities { red, green, blue, white }) =
        &header.shared_attributes.chromaticities
    {
        let given = [red, green, blue, white].map(|color| [color.0, color.1].map(f64::from));
        note_primaries(input, given.as_flattened(), progress);
    }
    // As checked, each fits.
    let Vec2(width, height) = header.layer_size;
    let mut picture = black(input, width as u32, height as u32)?;

    let filter = |_: &_, _, block: BlockIndex| is_of_picture(&block);
    let mut chunks = guarded(input, here, || reader.filter_chunks(true, filter))?;
    progress.begin(&format!("read {}", input.name), chunks.len() as u64);
    let n_at_a_time = (BYTES_AT_A_TIME / header.max_block_byte_size().max(1)).clamp(1, 1024);
    while 0 < chunks.len() {
        let mut batch = Vec::new();
        while batch.len() < n_at_a_time && 0 < chunks.len() {
            if let Some(chunk) = guarded(input, here, || chunks.next().transpose())? {
                batch.push((at.get(), chunk));
            }
        }
        let decode = |(end, chunk): (u64, Chunk)| {
            progress.check()?;
            let start = end.saturating_sub(compressed_bytes(&chunk).len() as u64);
            let place = || Place::Byte(start);
            let of_other = || {
                let expected = "one of the first part in full size";
                broken(input, place(), "a block of another picture", expected)
            };
            if chunk.layer_index != 0 {
                return Err(of_other());
            }
            check_dwa(input, place(), header, &chunk)?;
            let decode = || UncompressedBlock::decompress_chunk(chunk, &meta_data, false);
            let block = guarded(input, place, decode)?;
            if is_of_picture(&block.index) { Ok(block) } else { Err(of_other()) }
        };
        let n_chunks = batch.len() as u64;
        // The first error in the file is told, whichever thread came upon one first.
        let blocks: Vec<Result<_>> = batch.into_par_iter().map(decode).collect();
        for block in blocks {
            fill(&mut picture, &block?, &header.channels, colors);
        }
        progress.advance(n_chunks);
    }
    Ok(picture)
}

/// Refuses a part whose pixels, or one of whose blocks, the file's bytes cannot stand for.
fn check_sizes(input: &Input, header: &Header) -> Result<()> {
    let bytes_per_pixel = header.channels.bytes_per_pixel as u64;
    let size = [header.layer_size.0, header.layer_size.1].map(|side| side as u64);
    check_size(input, Place::Byte(0), size, bytes_per_pixel)?;
    let pixels_per_block = match header.blocks {
        BlockDescription::Tiles(tiles) => {
            (tiles.tile_size.0 as u64).saturating_mul(tiles.tile_size.1 as u64)
        }
        BlockDescription::ScanLines => {
            (header.compression.scan_lines_per_block() as u64).saturating_mul(size[0])
        }
    };
    if granted_bytes(input) < pixels_per_block.saturating_mul(bytes_per_pixel) {
        let found = format!("blocks of {pixels_per_block} pixels in {} bytes", input.len());
        return Err(broken(input, Place::Byte(0), found, "blocks that the bytes can hold"));
    }
    Ok(())
}

/// The indices of the channels that hold red, green and blue.
fn find_colors(input: &Input, channels: &ChannelList) -> Result<[usize; 3]> {
    let names: Vec<String> = channels.list.iter().map(|channel| channel.name.to_string()).collect();
    let find = |name: &str| names.iter().position(|other| other == name);
    let colors = match (find("R"), find("G"), find("B"), find("Y")) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        // With RY and BY it would be luminance and chroma.
        (None, None, None, Some(y)) if find("RY").or(find("BY")).is_none() => [y; 3],
        _ => {
            let names = names.join(", ").chars().take(200).collect::<String>();
            let found = format!("a first part with the channels {names}");
            return Err(input.unsupported(found, WAY_OUT));
        }
    };
    if colors.iter().any(|index| channels.list[*index].sample_type == SampleType::U32) {
        return Err(input.unsupported("colours of whole numbers", WAY_OUT));
    }
    Ok(colors)
}

/// Neither of another part nor scaled down.
fn is_of_picture(block: &BlockIndex) -> bool {
    block.layer == 0 && block.level == Vec2(0, 0)
}

/// Copies a block's colours to their place; the crate has checked that it lies in the picture.
fn fill(
    picture: &mut LinearPicture,
    block: &UncompressedBlock,
    channels: &ChannelList,
    colors: [usize; 3],
) {
    for line in block.lines(channels) {
        let Vec2(x, y) = line.location.position;
        let start = y * picture.width as usize + x;
        let pixels = &mut picture.pixels[start..][..line.location.sample_count];
        let channel = line.location.channel;
        let sample_type = channels.list[channel].sample_type;
        let is_color = |axis: &usize| colors[*axis] == channel;
        for axis in (0..3).filter(is_color) {
            for (i, pixel) in pixels.iter_mut().enumerate() {
                pixel[axis] = sample(line.value, sample_type, i);
            }
        }
    }
}

/// Number `i` of a line, whose bytes have the machine's order.
fn sample(line: &[u8], sample_type: SampleType, i: usize) -> f32 {
    match sample_type {
        SampleType::F16 => f16::from_ne_bytes([line[2 * i], line[2 * i + 1]]).to_f32(),
        SampleType::F32 | SampleType::U32 => {
            let bytes = [line[4 * i], line[4 * i + 1], line[4 * i + 2], line[4 * i + 3]];
            f32::from_ne_bytes(bytes)
        }
    }
}

/// Refuses a block in DWA compression that claims to unpack to more than its pixels: the crate takes
/// that much memory at once.
fn check_dwa(input: &Input, place: Place, header: &Header, chunk: &Chunk) -> Result<()> {
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    let area = guarded(
        input,
        || place.clone(),
        || {
            let tile = header.get_block_data_indices(&chunk.compressed_block)?;
            Ok(header.get_absolute_block_pixel_coordinates(tile)?.size.area())
        },
    )?;
    let n_bytes = area.saturating_mul(header.channels.bytes_per_pixel);
    let bytes = compressed_bytes(chunk);
    if bytes.len() == n_bytes {
        // Stored as it is.
        return Ok(());
    }
    // Whole tiles of 8 x 8 coefficients and runs that do not pay come to more than the pixels.
    let most = (n_bytes as u64).saturating_mul(4).saturating_add(1 << 16);
    // Of eleven counters, the sizes of what is unpacked: bytes, and at last numbers of 16 bits.
    let counters = bytes.as_chunks::<8>().0;
    let claimed =
        [1, 6, 7, 8, 9].map(|index| counters.get(index).map(|bytes| u64::from_le_bytes(*bytes)));
    match claimed.into_iter().flatten().find(|claimed| most < *claimed) {
        Some(claimed) => {
            let found = format!("a block of {n_bytes} bytes that unpacks to {claimed}");
            Err(broken(input, place, found, "a size that fits it"))
        }
        None => Ok(()),
    }
}

fn compressed_bytes(chunk: &Chunk) -> &[u8] {
    match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        CompressedBlock::DeepScanLine(_) | CompressedBlock::DeepTile(_) => &[],
    }
}

/// Has the crate do something, and turns its errors into ours.
fn guarded<T>(
    input: &Input,
    place: impl Fn() -> Place,
    work: impl FnOnce() -> exr::error::Result<T>,
) -> Result<T> {
    // Broken headers can make the crate divide by zero or pass the end of a table, where it panics.
    // What it was working on is not used again after that.
    let done = catch_unwind(AssertUnwindSafe(work));
    let expected = "an EXR picture";
    match done {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(exr::error::Error::NotSupported(what))) => {
            Err(input.unsupported(format!("EXR data of a rare kind ({what})"), WAY_OUT))
        }
        Ok(Err(_)) if place() == Place::Byte(input.len() as u64) => {
            Err(broken(input, place(), "the end of the file", expected))
        }
        Ok(Err(error)) => Err(broken(input, place(), format!("bad data ({error})"), expected)),
        Err(_) => Err(broken(input, place(), "bytes that no encoder writes", expected)),
    }
}

fn broken(input: &Input, place: Place, found: impl Into<String>, expected: &str) -> Error {
    input.malformed(place, found, expected, CUT_OFF)
}

/// Tells how far the crate has read.
struct Tracked<'a> {
    bytes: Cursor<&'a [u8]>,
    at: &'a Cell<u64>,
}

impl Read for Tracked<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.bytes.read(buffer)?;
        self.at.set(self.bytes.position());
        Ok(count)
    }
}

impl Seek for Tracked<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = self.bytes.seek(to)?;
        self.at.set(at);
        Ok(at)
    }
}
