//! OpenEXR reader for the colours of the first part.
//!
//! The `exr` crate decodes; the sizes that a file claims are checked first.

use std::cell::Cell;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use surfel_core::words::counted;

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
use surfel_core::progress::Progress;

use super::hdr_image::{HdrImage, check_size, max_decoded_bytes, warn_about_primaries};
use crate::error::{Error, Location, Result};
use crate::file::Input;

pub(super) const MAGIC: &[u8] = &exr::meta::magic_number::BYTES;

const REWRITE_ADVICE: &str = "copy the file again from its source, or write it again";
const CONVERT_ADVICE: &str =
    "write it again as one flat part with the channels R, G and B and ZIP compression";
/// Approximate decoded bytes per batch of blocks; the blocks of a batch are decoded in parallel.
const BATCH_BYTES: usize = 16 << 20;

/// Reads an EXR file.
pub(super) fn read(input: &Input, progress: &dyn Progress) -> Result<HdrImage> {
    let position = Cell::new(0);
    let here = || Location::Byte(position.get());
    let bytes = TrackedReader { bytes: Cursor::new(input), position: &position };
    let reader = run_decoder(input, here, || Reader::read_from_buffered(bytes, false))?;
    let meta_data = reader.meta_data().clone();
    // All parts are checked, because a block may claim to belong to any of them.
    for header in &meta_data.headers {
        check_sizes(input, header)?;
    }
    let Some(header) = meta_data.headers.first() else {
        return Err(malformed(input, here(), "no part", "one at least"));
    };
    let colors = find_colors(input, &header.channels)?;
    if let Some(Chromaticities { red, green, blue, white }) =
        &header.shared_attributes.chromaticities
    {
        let primaries = [red, green, blue, white].map(|color| [color.0, color.1].map(f64::from));
        warn_about_primaries(input, primaries.as_flattened(), progress);
    }
    // `check_sizes` has shown that both fit in 32 bits.
    let Vec2(width, height) = header.layer_size;
    let mut image = HdrImage::black(input, width as u32, height as u32)?;

    let filter = |_: &_, _, block: BlockIndex| is_full_size_first_part(&block);
    let mut chunks = run_decoder(input, here, || reader.filter_chunks(true, filter))?;
    progress.begin(&format!("read {}", input.name), chunks.len() as u64);
    let batch_size = (BATCH_BYTES / header.max_block_byte_size().max(1)).clamp(1, 1024);
    while 0 < chunks.len() {
        let mut batch = Vec::new();
        while batch.len() < batch_size && 0 < chunks.len() {
            if let Some(chunk) = run_decoder(input, here, || chunks.next().transpose())? {
                batch.push((position.get(), chunk));
            }
        }
        let decode = |(end, chunk): (u64, Chunk)| {
            progress.check()?;
            let start = end.saturating_sub(compressed_bytes(&chunk).len() as u64);
            let location = || Location::Byte(start);
            let wrong_block = || {
                let expected = "one of the first part in full size";
                malformed(input, location(), "a block of another image", expected)
            };
            if chunk.layer_index != 0 {
                return Err(wrong_block());
            }
            check_dwa(input, location(), header, &chunk)?;
            let decode = || UncompressedBlock::decompress_chunk(chunk, &meta_data, false);
            let block = run_decoder(input, location, decode)?;
            if is_full_size_first_part(&block.index) { Ok(block) } else { Err(wrong_block()) }
        };
        let n_chunks = batch.len() as u64;
        // Collecting in order reports the first error of the file, independent of the threads.
        let blocks: Vec<Result<_>> = batch.into_par_iter().map(decode).collect();
        for block in blocks {
            copy_colors(&mut image, &block?, &header.channels, colors);
        }
        progress.advance(n_chunks);
    }
    Ok(image)
}

/// Rejects a part whose pixels or blocks are larger than the file's bytes can decode to.
fn check_sizes(input: &Input, header: &Header) -> Result<()> {
    let bytes_per_pixel = header.channels.bytes_per_pixel as u64;
    let size = [header.layer_size.0, header.layer_size.1].map(|side| side as u64);
    check_size(input, Location::Byte(0), size, bytes_per_pixel)?;
    let pixels_per_block = match header.blocks {
        BlockDescription::Tiles(tiles) => {
            (tiles.tile_size.0 as u64).saturating_mul(tiles.tile_size.1 as u64)
        }
        BlockDescription::ScanLines => {
            (header.compression.scan_lines_per_block() as u64).saturating_mul(size[0])
        }
    };
    if max_decoded_bytes(input) < pixels_per_block.saturating_mul(bytes_per_pixel) {
        let found = format!("blocks of {pixels_per_block} pixels in {} bytes", input.len());
        return Err(malformed(input, Location::Byte(0), found, "blocks that the bytes can hold"));
    }
    Ok(())
}

/// Returns the indices of the channels that hold red, green and blue.
fn find_colors(input: &Input, channels: &ChannelList) -> Result<[usize; 3]> {
    let names: Vec<String> = channels.list.iter().map(|channel| channel.name.to_string()).collect();
    let find = |name: &str| names.iter().position(|other| other == name);
    let colors = match (find("R"), find("G"), find("B"), find("Y")) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        // Y together with RY and BY would be luminance and chroma.
        (None, None, None, Some(y)) if find("RY").or(find("BY")).is_none() => [y; 3],
        _ => {
            let names = names.join(", ").chars().take(200).collect::<String>();
            let found = format!("a first part with the channels {names}");
            return Err(input.unsupported(found, CONVERT_ADVICE));
        }
    };
    if colors.iter().any(|index| channels.list[*index].sample_type == SampleType::U32) {
        return Err(input.unsupported("colours stored as whole numbers", CONVERT_ADVICE));
    }
    Ok(colors)
}

/// Returns true for a block of the first part at full resolution.
fn is_full_size_first_part(block: &BlockIndex) -> bool {
    block.layer == 0 && block.level == Vec2(0, 0)
}

/// Copies a block's colours into the image. The crate has checked that the block lies inside.
fn copy_colors(
    image: &mut HdrImage,
    block: &UncompressedBlock,
    channels: &ChannelList,
    colors: [usize; 3],
) {
    for line in block.lines(channels) {
        let Vec2(x, y) = line.location.position;
        let start = y * image.width as usize + x;
        let pixels = &mut image.pixels[start..][..line.location.sample_count];
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

/// Returns sample `i` of a line, whose bytes have the machine's order.
fn sample(line: &[u8], sample_type: SampleType, i: usize) -> f32 {
    match sample_type {
        SampleType::F16 => f16::from_ne_bytes([line[2 * i], line[2 * i + 1]]).to_f32(),
        SampleType::F32 | SampleType::U32 => {
            let bytes = [line[4 * i], line[4 * i + 1], line[4 * i + 2], line[4 * i + 3]];
            f32::from_ne_bytes(bytes)
        }
    }
}

/// Rejects a block in DWA compression that claims to unpack to more than its pixels, because the crate
/// allocates that much memory at once.
fn check_dwa(input: &Input, location: Location, header: &Header, chunk: &Chunk) -> Result<()> {
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    let area = run_decoder(
        input,
        || location.clone(),
        || {
            let tile = header.get_block_data_indices(&chunk.compressed_block)?;
            Ok(header.get_absolute_block_pixel_coordinates(tile)?.size.area())
        },
    )?;
    let n_bytes = area.saturating_mul(header.channels.bytes_per_pixel);
    let bytes = compressed_bytes(chunk);
    if bytes.len() == n_bytes {
        // The block is stored uncompressed.
        return Ok(());
    }
    // Padding to tiles of 8 x 8 coefficients and inefficient runs may exceed the size of the pixels.
    let limit = (n_bytes as u64).saturating_mul(4).saturating_add(1 << 16);
    // A block begins with eleven counters. These five are unpacked sizes: four in bytes, the last one in
    // 16-bit numbers.
    let counters = bytes.as_chunks::<8>().0;
    let claimed =
        [1, 6, 7, 8, 9].map(|index| counters.get(index).map(|bytes| u64::from_le_bytes(*bytes)));
    match claimed.into_iter().flatten().find(|claimed| limit < *claimed) {
        Some(claimed) => {
            let found =
                format!("a block of {} that unpacks to {claimed}", counted(n_bytes, "byte"));
            Err(malformed(input, location, found, "a size that fits it"))
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

/// Runs `work` of the `exr` crate and converts its errors and panics.
fn run_decoder<T>(
    input: &Input,
    location: impl Fn() -> Location,
    work: impl FnOnce() -> exr::error::Result<T>,
) -> Result<T> {
    // Malformed headers can make the crate panic: it divides by zero or indexes past the end of a table.
    // Nothing that `work` touched is used again after a panic.
    let result = catch_unwind(AssertUnwindSafe(work));
    let expected = "an EXR image";
    match result {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(exr::error::Error::NotSupported(what))) => {
            Err(input.unsupported(format!("EXR data of a rare kind ({what})"), CONVERT_ADVICE))
        }
        Ok(Err(_)) if location() == Location::Byte(input.len() as u64) => {
            Err(malformed(input, location(), "the end of the file", expected))
        }
        Ok(Err(error)) => {
            Err(malformed(input, location(), format!("bad data ({error})"), expected))
        }
        Err(_) => Err(malformed(input, location(), "bytes that no encoder writes", expected)),
    }
}

fn malformed(input: &Input, location: Location, found: impl Into<String>, expected: &str) -> Error {
    input.malformed(location, found, expected, REWRITE_ADVICE)
}

/// A reader that shares its position, so that errors can name it.
struct TrackedReader<'a> {
    bytes: Cursor<&'a [u8]>,
    position: &'a Cell<u64>,
}

impl Read for TrackedReader<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.bytes.read(buffer)?;
        self.position.set(self.bytes.position());
        Ok(count)
    }
}

impl Seek for TrackedReader<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let position = self.bytes.seek(to)?;
        self.position.set(position);
        Ok(position)
    }
}
