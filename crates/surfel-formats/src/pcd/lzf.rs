//! Decompresses LZF, the compression of binary PCD files (M. Lehmann, LibLZF, 2000).

/// Maximum ratio of decompressed to compressed bytes: three bytes repeat at most 264.
pub(super) const MAX_RATIO: usize = 88;

/// The fault of compressed bytes.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Fault {
    /// Compressed byte at which decoding stops.
    pub byte: usize,
    /// The content there, in words.
    pub found: &'static str,
}

/// Decompresses `compressed` to `length` bytes. Returns the bytes before the first fault, and the fault.
///
/// A control byte below 32 is followed by that many bytes and one, which are copied. Any other has a length in its upper
/// three bits, 7 being followed by a further byte that adds to it, and the upper five bits of a distance in the others,
/// followed by its lower eight: length + 2 bytes are repeated from distance + 1 bytes before.
pub(super) fn decompress(compressed: &[u8], length: usize) -> (Vec<u8>, Option<Fault>) {
    let mut out = Vec::with_capacity(length.min(compressed.len().saturating_mul(MAX_RATIO)));
    let fault = decompress_into(compressed, length, &mut out).err();
    (out, fault)
}

fn decompress_into(compressed: &[u8], length: usize, out: &mut Vec<u8>) -> Result<(), Fault> {
    let mut at = 0;
    while at < compressed.len() {
        let start = at;
        let fault = |found: &'static str| Fault { byte: start, found };
        let cut = || fault("the end of the data within a run");
        let mut next = || {
            at += 1;
            compressed.get(at - 1).copied()
        };
        let control = usize::from(next().ok_or_else(cut)?);
        let n_new = if control < 32 {
            control + 1
        } else {
            let n = control >> 5;
            n + 2 + if n == 7 { usize::from(next().ok_or_else(cut)?) } else { 0 }
        };
        if length - out.len() < n_new {
            return Err(fault("more bytes than the header claims"));
        }
        if control < 32 {
            let literal = compressed.get(at..at + n_new).ok_or_else(cut)?;
            out.extend_from_slice(literal);
            at += n_new;
            continue;
        }
        let distance = ((control & 31) << 8) + usize::from(next().ok_or_else(cut)?) + 1;
        let from = out.len().checked_sub(distance);
        let from = from.ok_or_else(|| fault("a repetition from before the start"))?;
        // A repetition may reach into the bytes that it writes.
        if n_new <= distance {
            out.extend_from_within(from..from + n_new);
        } else {
            (from..from + n_new).for_each(|i| out.push(out[i]));
        }
    }
    if out.len() < length {
        return Err(Fault { byte: at, found: "fewer bytes than the header claims" });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    //! Runs, repetitions that overlap themselves, and broken data.

    use super::*;

    #[test]
    fn runs_and_repetitions_are_decoded() {
        let compressed = [2, b'a', b'b', b'c', 0x20, 2, 0xe0, 3, 0, 0, b'!'];
        let expected = [b"abcabc" as &[u8], &[b'c'; 12], b"!"].concat();
        assert_eq!(decompress(&compressed, expected.len()), (expected, None));
    }

    #[test]
    fn broken_data_is_reported() {
        let found = |compressed: &[u8], length| decompress(compressed, length).1.unwrap().found;
        assert_eq!(found(&[4, 1, 2], 5), "the end of the data within a run");
        assert_eq!(found(&[0, 1, 0x20], 4), "the end of the data within a run");
        assert_eq!(found(&[0, 1, 0x20, 1], 4), "a repetition from before the start");
        assert_eq!(found(&[1, 1, 2], 1), "more bytes than the header claims");
        assert_eq!(found(&[1, 1, 2], 3), "fewer bytes than the header claims");
        // The bytes before the fault are kept.
        assert_eq!(decompress(&[1, 7, 8, 0x20, 9], 6).0, [7, 8]);
        assert_eq!(decompress(&[1, 7, 8, 0x20, 0, 31], 99).0, [7, 8, 8, 8, 8]);
    }
}
