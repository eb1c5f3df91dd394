//! Decodes the GPS times of LAZ files, with a limit on the changes between time sequences for one value.

use std::io::{Error, ErrorKind, Read, Result};

use laz::decoders::ArithmeticDecoder;
use laz::decompressors::{IntegerDecompressor, IntegerDecompressorBuilder};
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};
use laz::record::FieldDecompressor;

/// Largest multiple of the last difference with a symbol of its own.
const MAX_MULTIPLE: i32 = 500;
/// Smallest multiple of the last difference with a symbol of its own.
const MIN_MULTIPLE: i32 = -10;
/// Symbol, the first after those of multiples, that announces a complete time.
const FULL_TIME: i32 = MAX_MULTIPLE - MIN_MULTIPLE + 1;
/// Maximum number of changes between sequences for one value; an encoder writes at most one. The decoder of the `laz`
/// crate has no limit and recurses: 1.6 KB of broken data overflow its stack, which nothing can catch.
const MAX_SEQUENCE_CHANGES: usize = 8;

/// The two generations of the code; only the older one has a symbol for an unchanged time.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Generation {
    /// LAZ of point formats up to 5.
    Pointwise,
    /// LAZ of point formats from 6 on, in which another layer marks unchanged times.
    Layered,
}

/// Four sequences of times, each predicted from its own last difference.
pub(super) struct GpsTimes {
    generation: Generation,
    first_symbols: ArithmeticModel,
    multiples: ArithmeticModel,
    integers: IntegerDecompressor,
    sequences: [Sequence; 4],
    current: usize,
    newest: usize,
}

/// A sequence of times.
#[derive(Clone, Copy, Default)]
struct Sequence {
    /// Bits of the last time, an f64.
    time: i64,
    /// Difference from which the next time is predicted.
    difference: i32,
    /// Number of recent multiples for which the difference was a bad prediction.
    n_extremes: u32,
}

impl GpsTimes {
    /// A decoder of the times after `first`.
    pub fn new(first: i64, generation: Generation) -> Self {
        let n_unchanged = u32::from(generation == Generation::Pointwise);
        let mut sequences = [Sequence::default(); 4];
        sequences[0].time = first;
        Self {
            generation,
            first_symbols: ArithmeticModelBuilder::new(5 + n_unchanged).build(),
            multiples: ArithmeticModelBuilder::new(FULL_TIME as u32 + 4 + n_unchanged).build(),
            integers: IntegerDecompressorBuilder::new().bits(32).contexts(9).build_initialized(),
            sequences,
            current: 0,
            newest: 0,
        }
    }

    /// Decodes the next time; returns its bits.
    pub fn next<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> Result<i64> {
        for _ in 0..=MAX_SEQUENCE_CHANGES {
            let has_difference = self.sequences[self.current].difference != 0;
            let step = if has_difference {
                self.next_by_multiple(decoder)?
            } else {
                self.next_by_difference(decoder)?
            };
            // A step leads to another sequence, which continues with the time.
            if step == 0 {
                return Ok(self.sequences[self.current].time);
            }
            self.current = (self.current + step) & 3;
        }
        Err(Error::new(ErrorKind::InvalidData, "times that change between sequences endlessly"))
    }

    /// Decodes a difference; returns the step to another sequence, or 0 if the current one has the time.
    fn next_by_difference<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> Result<usize> {
        let mut symbol = decoder.decode_symbol(&mut self.first_symbols)? as usize;
        if self.generation == Generation::Pointwise {
            if symbol == 0 {
                return Ok(0);
            }
            symbol -= 1;
        }
        match symbol {
            0 => {
                let difference = self.integers.decompress(decoder, 0, 0)?;
                let sequence = &mut self.sequences[self.current];
                sequence.difference = difference;
                sequence.n_extremes = 0;
                sequence.time = sequence.time.wrapping_add(difference.into());
            }
            1 => self.begin_sequence(decoder)?,
            _ => return Ok(symbol - 1),
        }
        Ok(0)
    }

    /// Decodes a multiple of the last difference; returns the step to another sequence, or 0 if the current one has the
    /// time.
    fn next_by_multiple<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> Result<usize> {
        let mut symbol = decoder.decode_symbol(&mut self.multiples)? as i32;
        if self.generation == Generation::Pointwise {
            if symbol == FULL_TIME {
                return Ok(0);
            }
            symbol -= i32::from(FULL_TIME < symbol);
        }
        if symbol == FULL_TIME {
            self.begin_sequence(decoder)?;
            return Ok(0);
        }
        if FULL_TIME < symbol {
            return Ok((symbol - FULL_TIME) as usize);
        }
        let multiple = if symbol <= MAX_MULTIPLE { symbol } else { MAX_MULTIPLE - symbol };
        let context = match multiple {
            0 => 7,
            1 => 1,
            2..10 => 2,
            MAX_MULTIPLE => 4,
            10.. => 3,
            ..=MIN_MULTIPLE => 6,
            _ => 5,
        };
        let expected = self.sequences[self.current].difference.wrapping_mul(multiple);
        let difference = self.integers.decompress(decoder, expected, context)?;
        let sequence = &mut self.sequences[self.current];
        sequence.time = sequence.time.wrapping_add(difference.into());
        if multiple == 1 {
            sequence.n_extremes = 0;
        } else if matches!(multiple, 0 | MAX_MULTIPLE | MIN_MULTIPLE) {
            sequence.n_extremes += 1;
            // The old difference no longer predicts well.
            if 3 < sequence.n_extremes {
                sequence.difference = difference;
                sequence.n_extremes = 0;
            }
        }
        Ok(0)
    }

    /// Decodes a complete time, which replaces the oldest sequence.
    fn begin_sequence<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> Result<()> {
        let last = self.sequences[self.current].time;
        let upper = self.integers.decompress(decoder, (last >> 32) as i32, 8)?;
        let time = i64::from(upper) << 32 | i64::from(decoder.read_int()?);
        self.newest = (self.newest + 1) & 3;
        self.current = self.newest;
        self.sequences[self.current] = Sequence { time, ..Sequence::default() };
        Ok(())
    }
}

/// The decoder of the GPS times in pointwise records.
pub(super) struct GpsTimeField(GpsTimes);

impl Default for GpsTimeField {
    fn default() -> Self {
        Self(GpsTimes::new(0, Generation::Pointwise))
    }
}

impl<R: Read> FieldDecompressor<R> for GpsTimeField {
    fn size_of_field(&self) -> usize {
        8
    }

    fn decompress_first(&mut self, source: &mut R, first_point: &mut [u8]) -> Result<()> {
        source.read_exact(first_point)?;
        let bits = i64::from_le_bytes(first_point.first_chunk().copied().unwrap_or_default());
        *self = Self(GpsTimes::new(bits, Generation::Pointwise));
        Ok(())
    }

    fn decompress_with(
        &mut self,
        decoder: &mut ArithmeticDecoder<R>,
        point: &mut [u8],
    ) -> Result<()> {
        point.copy_from_slice(&self.0.next(decoder)?.to_le_bytes());
        Ok(())
    }
}
