//! The contents of an array, which are laid out piece by piece where they are copied: no copy of the whole is made.

use crate::numbers::{NODE_VECTORS, VECTOR_BYTES};
use bytemuck::{NoUninit, Pod, Zeroable};
use surfel_core::bvh::BvhNode;

/// Number of words that are laid out at once, if records are not longer.
const WORDS_AT_ONCE: usize = 512;

/// The contents of an array: parts, one behind the other.
#[derive(Default)]
pub struct Payload<'a>(pub Vec<PayloadPart<'a>>);

/// A part of the contents of an array.
pub enum PayloadPart<'a> {
    /// Bytes as they are.
    Bytes(&'a [u8]),
    /// Records of the same size.
    Records {
        /// Number of records.
        n_records: usize,
        /// Number of words of a record.
        n_words: usize,
        /// The function that lays them out.
        lay_out: LayOut<'a>,
    },
}

/// Lays out the record of an index in words that are zero.
pub type LayOut<'a> = Box<dyn Fn(usize, &mut [u32]) + Sync + 'a>;

/// A node in the device's memory: five times sixteen bytes, so that it is read in vectors of four words.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PaddedNode {
    node: BvhNode,
    padding: [u32; 2],
}

const _: () = assert!(size_of::<PaddedNode>() == VECTOR_BYTES * NODE_VECTORS);

impl<'a> PayloadPart<'a> {
    /// Returns records of words.
    pub fn records<T: NoUninit>(n: usize, record: impl Fn(usize) -> T + Sync + 'a) -> Self {
        Self::Records {
            n_records: n,
            n_words: size_of::<T>() / 4,
            lay_out: Box::new(move |i, words| {
                words.copy_from_slice(bytemuck::cast_slice(&[record(i)]));
            }),
        }
    }

    /// Returns nodes, each padded to `NODE_VECTORS`.
    pub fn nodes(n: usize, node: impl Fn(usize) -> BvhNode + Sync + 'a) -> Self {
        Self::records(n, move |i| PaddedNode { node: node(i), padding: [0; 2] })
    }

    /// Returns the number of bytes.
    fn len(&self) -> usize {
        match self {
            Self::Bytes(bytes) => bytes.len(),
            Self::Records { n_records, n_words, .. } => 4 * n_records * n_words,
        }
    }

    /// Copies bytes from `offset` on, as many as `target` holds.
    fn copy(&self, mut offset: usize, mut target: wgpu::WriteOnly<[u8]>) {
        let (n_records, n_words, lay_out) = match self {
            Self::Bytes(bytes) => {
                let n = target.len();
                return target.copy_from_slice(&bytes[offset..offset + n]);
            }
            Self::Records { n_records, n_words, lay_out } => (*n_records, *n_words, lay_out),
        };
        let n_at_once = (WORDS_AT_ONCE / n_words).clamp(1, n_records);
        let mut words = vec![0; n_at_once * n_words];
        while !target.is_empty() {
            let (first, skipped) = (offset / (4 * n_words), offset % (4 * n_words));
            let words = &mut words[..n_at_once.min(n_records - first) * n_words];
            words.fill(0);
            for (i, record) in words.chunks_exact_mut(n_words).enumerate() {
                lay_out(first + i, record);
            }
            let bytes = &bytemuck::cast_slice(words)[skipped..];
            let n = bytes.len().min(target.len());
            let (mut part, rest) = target.split_at(n);
            part.copy_from_slice(&bytes[..n]);
            (offset, target) = (offset + n, rest);
        }
    }
}

impl Payload<'_> {
    /// Returns the number of bytes.
    pub fn len(&self) -> usize {
        self.0.iter().map(PayloadPart::len).sum()
    }

    /// Copies bytes from `offset` on, as many as `target` holds.
    pub fn copy(&self, mut offset: usize, mut target: wgpu::WriteOnly<[u8]>) {
        for part in &self.0 {
            let n = part.len().saturating_sub(offset).min(target.len());
            if n == 0 {
                offset = offset.saturating_sub(part.len());
                continue;
            }
            let (piece, rest) = target.split_at(n);
            part.copy(offset, piece);
            (offset, target) = (0, rest);
        }
    }
}

/// Returns all bytes of a payload.
#[cfg(test)]
pub fn bytes_of(payload: &Payload) -> Vec<u8> {
    let mut bytes = vec![0xff; payload.len()];
    payload.copy(0, wgpu::WriteOnly::from(bytes.as_mut_slice()));
    bytes
}

#[cfg(test)]
mod tests {
    //! Bytes are the same from wherever they are copied.

    use super::*;

    #[test]
    fn bytes_are_the_same_from_wherever_they_are_copied() {
        let bytes: Vec<u8> = (0..24).collect();
        let long = |i: usize, words: &mut [u32]| words[..600].fill(i as u32);
        let payload = Payload(vec![
            PayloadPart::records(0, |i| i as u32),
            PayloadPart::records(1000, |i| [i as u32, 7, i as u32 + 1]),
            PayloadPart::Bytes(&bytes),
            PayloadPart::Bytes(&[]),
            PayloadPart::Records { n_records: 3, n_words: 601, lay_out: Box::new(long) },
        ]);
        let mut expected: Vec<u8> =
            (0..1000u32).flat_map(|i| [i, 7, i + 1]).flat_map(u32::to_ne_bytes).collect();
        expected.extend(&bytes);
        let long = |i: u32| [i; 600].into_iter().chain([0]).flat_map(u32::to_ne_bytes);
        expected.extend((0..3).flat_map(long));
        assert!(bytes_of(&payload) == expected);
        for (start, n) in [(0, 11_000), (5, 1), (11_990, 50), (12_020, 4), (13_001, 5_000)] {
            let mut part = vec![0xff; n];
            payload.copy(start, wgpu::WriteOnly::from(part.as_mut_slice()));
            assert!(part == expected[start..start + n], "{start} {n}");
        }
    }

    #[test]
    fn nodes_are_padded() {
        let mut node = BvhNode::zeroed();
        bytemuck::bytes_of_mut(&mut node).fill(5);
        let bytes = bytes_of(&Payload(vec![PayloadPart::nodes(2, |_| node)]));
        let padded = [[5; 72].as_slice(), &[0; 8]].concat();
        assert!(bytes == [padded.as_slice(), &padded].concat());
    }
}
