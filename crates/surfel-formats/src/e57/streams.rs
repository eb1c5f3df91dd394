//! The bytes of a scan's values: a stream for each field, cut into packets.

use surfel_core::progress::Progress;
use surfel_core::words::counted;

use super::pages::Pages;
use crate::error::{Location, Result};
use crate::salvage::Salvage;

/// First byte of the section that holds a scan's packets.
pub(super) const SECTION_ID: u8 = 1;
/// Bytes of a section before its packets.
pub(super) const SECTION_HEADER_LENGTH: u64 = 32;
/// First bytes of packets: an index of packets, values, or nothing of use.
const INDEX_PACKET: u8 = 0;
pub(super) const DATA_PACKET: u8 = 1;
const IGNORED_PACKET: u8 = 2;
/// Bytes of a data packet before the lengths of its streams' parts.
const DATA_HEADER_LENGTH: u64 = 6;

/// The stream of a field.
#[derive(Clone, Debug, Default)]
pub(super) struct Stream {
    segments: Vec<Segment>,
    length: u64,
}

/// A part of a stream that lies in one packet.
#[derive(Clone, Copy, Debug)]
struct Segment {
    /// Byte of the stream at which the part begins.
    start: u64,
    /// Position in the pages' content.
    at: u64,
}

impl Stream {
    /// Returns the number of bytes.
    pub fn len(&self) -> u64 {
        self.length
    }

    /// Returns true if each packet has as many bytes of this stream as of `other`.
    pub fn is_parallel_to(&self, other: &Self) -> bool {
        let mut parts = self.segments.iter().zip(&other.segments);
        self.length == other.length
            && self.segments.len() == other.segments.len()
            && parts.all(|(part, other)| part.start == other.start)
    }

    /// Copies the bytes from `start` on; the stream must have them.
    pub fn copy(&self, pages: Pages, start: u64, mut out: &mut [u8]) {
        let first = self.segments.partition_point(|segment| segment.start <= start) - 1;
        let mut from = start;
        for (i, segment) in self.segments.iter().enumerate().skip(first) {
            if out.is_empty() {
                return;
            }
            let end = self.segments.get(i + 1).map_or(self.length, |next| next.start);
            let (front, rest) = out.split_at_mut(out.len().min((end - from) as usize));
            let copied = pages.copy(segment.at + (from - segment.start), front);
            copied.expect("segments lie within the pages");
            (from, out) = (end, rest);
        }
    }

    fn push(&mut self, at: u64, length: u64) {
        if 0 < length {
            self.segments.push(Segment { start: self.length, at });
            self.length += length;
        }
    }
}

/// Finds the streams of as many fields as `needed` has numbers, in the section at byte `section` of the file. Packets are
/// read until every stream has as many bytes as `needed` says, until the section ends, or until one is damaged.
pub(super) fn find_streams(
    salvage: &mut Salvage,
    pages: Pages,
    section: u64,
    needed: &[u64],
    progress: &dyn Progress,
) -> Result<Vec<Stream>> {
    let input = salvage.input;
    let mut streams = vec![Stream::default(); needed.len()];
    let start = Pages::content_position(section);
    let malformed = |at: u64, found: String, expected: &str| {
        let location = Location::Byte(Pages::file_position(at));
        input.malformed(location, found, expected, "copy the file again from its source")
    };
    let Some(header) = pages.bytes::<{ SECTION_HEADER_LENGTH as usize }>(start) else {
        salvage.accept(malformed(start, "the end of the file".into(), "a section of points"))?;
        return Ok(streams);
    };
    if header[0] != SECTION_ID {
        let found = format!("section {}", header[0]);
        salvage.accept(malformed(start, found, "a section of points, 1"))?;
        return Ok(streams);
    }
    let number = |at: usize| u64::from_le_bytes(header[at..at + 8].try_into().expect("8 bytes"));
    let end = start.saturating_add(number(8)).min(pages.len());
    let mut at = Pages::content_position(number(16));
    let is_complete = |streams: &[Stream]| {
        streams.iter().zip(needed).all(|(stream, needed)| *needed <= stream.length)
    };
    let mut n_packets = 0u64;
    while at < end && !is_complete(&streams) {
        if n_packets.is_multiple_of(256) {
            progress.check()?;
        }
        n_packets += 1;
        let Some([kind, _, low, high]) = pages.bytes(at) else { break };
        let length = u64::from(u16::from_le_bytes([low, high])) + 1;
        if !pages.are_whole(at, length) {
            break;
        }
        let added = match kind {
            DATA_PACKET => add_packet(&mut streams, pages, at, length),
            INDEX_PACKET | IGNORED_PACKET => Ok(()),
            _ => Err((format!("packet type {kind}"), "type 0, 1 or 2".into())),
        };
        if let Err((found, expected)) = added {
            salvage.accept(malformed(at, found, &expected))?;
            break;
        }
        at += length.next_multiple_of(4);
    }
    Ok(streams)
}

/// Returns the number of streams in the first data packet of the section at byte `section` of the file; 0 if there is none.
pub(super) fn n_section_streams(pages: Pages, section: u64) -> usize {
    /// Packets before the first of data: an index, or nothing of use.
    const MAX_OTHERS: usize = 1024;
    let start = Pages::content_position(section);
    let Some(offset) = pages.bytes(start.saturating_add(16)) else { return 0 };
    let mut at = Pages::content_position(u64::from_le_bytes(offset));
    for _ in 0..MAX_OTHERS {
        match pages.bytes(at) {
            Some([DATA_PACKET, _, _, _]) => return n_streams(pages, at),
            Some([_, _, low, high]) => {
                let length = u64::from(u16::from_le_bytes([low, high])) + 1;
                at = at.saturating_add(length.next_multiple_of(4));
            }
            None => break,
        }
    }
    0
}

/// Returns the number of streams in the data packet at a position in the pages' content.
pub(super) fn n_streams(pages: Pages, at: u64) -> usize {
    pages.bytes::<2>(at + 4).map_or(0, u16::from_le_bytes).into()
}

/// Adds the parts of the streams in a data packet; fails with what was found and what was expected.
fn add_packet(
    streams: &mut [Stream],
    pages: Pages,
    at: u64,
    length: u64,
) -> std::result::Result<(), (String, String)> {
    let n_found = n_streams(pages, at);
    if n_found != streams.len() {
        let expected = format!("{}, one for each field", streams.len());
        return Err((format!("a packet of {}", counted(n_found, "stream")), expected));
    }
    let mut part = DATA_HEADER_LENGTH + 2 * streams.len() as u64;
    for (i, stream) in streams.iter_mut().enumerate() {
        let size = pages.bytes::<2>(at + DATA_HEADER_LENGTH + 2 * i as u64);
        let size = u64::from(size.map_or(0, u16::from_le_bytes));
        if length < part + size {
            let found = format!("a stream up to byte {} of a packet", part + size);
            return Err((found, format!("at most {length} bytes")));
        }
        stream.push(at + part, size);
        part += size;
    }
    Ok(())
}
